/*!
Flights under a linear drag, dv/dt = −v/τ.

Ticks are of the transformed time, in which flights are straight ([`crate::numerics::clock`]), so that
searches, predictions and cells are those without drag. Impacts, drives and measurements have the velocities
of the time: those of anchors times [`Clock::decay`](crate::numerics::clock::Clock::decay). Where rotations
are damped, angular velocities are stored in the same way.

Each flight adds what it loses to the balance when it ends, and its integral of m v ⊗ v to the pressure.
*/

use glam::DVec3;

use crate::{
    numerics::{instant::Instant, total::total},
    report::ledger::Term,
    state::{
        State,
        flight_sums::{Moments, SECOND, Summed, symmetric},
        world::World,
    },
};

/// A particle stops that will move by less than this part of the extent, 2⁻¹⁰⁰.
const STOPPED: f64 = 1.0 / (1_u128 << 100) as f64;

impl World {
    /// Whether a drag acts on the particles.
    #[inline(always)]
    pub fn is_damped(&self) -> bool {
        self.clock.drag.is_some()
    }

    /// The velocity at `ticks` of a particle whose anchor has this one.
    #[inline(always)]
    pub fn damped(&self, velocity: DVec3, ticks: i64) -> DVec3 {
        if self.is_damped() { velocity * self.clock.decay(ticks) } else { velocity }
    }

    /// The velocity of the anchor of a particle that has this one at `ticks`.
    #[inline(always)]
    pub fn undamped(&self, velocity: DVec3, ticks: i64) -> DVec3 {
        if self.is_damped() { velocity / self.clock.decay(ticks) } else { velocity }
    }

    /// The part that a drag has left of stored angular velocities at `ticks`.
    #[inline]
    pub fn spin_decay(&self, ticks: i64) -> f64 {
        if self.spin.as_ref().is_some_and(|spins| spins.damped) { self.clock.decay(ticks) } else { 1.0 }
    }

    /// Sets the anchor of particle i to its velocity at `ticks`, and counts an own event.
    #[inline(always)]
    pub fn set_anchor(&mut self, i: u32, position: DVec3, velocity: DVec3, ticks: i64) {
        let velocity = self.undamped(velocity, ticks);
        self.particles[i as usize].set_anchor(position, velocity, ticks);
    }

    /// What the drag does to particle i between its anchor and `ticks`: the energy that it takes \[energy\],
    /// and its impulse [mass·length/time].
    fn drag_on(&self, i: u32, ticks: i64) -> (f64, DVec3) {
        let (particle, class) = (&self.particles[i as usize], self.class(i));
        if class.inverse_mass == 0.0 {
            return (0.0, DVec3::ZERO);
        }
        let decay = [particle.time, ticks].map(|ticks| self.clock.decay(ticks));
        let turning = self.spin.as_ref().filter(|spins| spins.damped).map_or(0.0, |spins| {
            class.moment_of_inertia(&spins.inertia) * spins.angular_velocity[i as usize].length_squared()
        });
        let twice = class.mass * particle.velocity.length_squared() + turning;
        let lost = decay[0] - decay[1];
        (0.5 * twice * lost * (decay[0] + decay[1]), particle.velocity * -(class.mass * lost))
    }

    /// What the drag has taken since the anchors of all particles \[energy\], and its impulse.
    pub fn pending_drag(&self) -> (f64, DVec3) {
        if !self.is_damped() {
            return (0.0, DVec3::ZERO);
        }
        let [loss, x, y, z] = total(self.particles.len(), |i| {
            let (loss, impulse) = self.drag_on(i, self.now);
            [loss, impulse.x, impulse.y, impulse.z]
        });
        (loss, DVec3::new(x, y, z))
    }

    /// The integrals of the moments of particle i over `duration` from `start` on, under a drag with the time
    /// constant `drag`: those of v e^(−t/τ).
    pub fn damped_moments(&self, i: u32, start: Instant, duration: f64, drag: f64) -> Moments {
        let mass = self.class(i).mass;
        let velocity = self.particles[i as usize].velocity * self.clock.decay_at(start);
        let second = mass * -0.5 * drag * libm::expm1(-2.0 * duration / drag);
        let sums: [f64; SECOND] = symmetric(velocity, velocity).map(|component| component * second);
        let momentum = velocity * (mass * -drag * libm::expm1(-duration / drag));
        let [xx, xy, xz, yy, yz, zz] = sums;
        [xx, xy, xz, yy, yz, zz, momentum.x, momentum.y, momentum.z]
    }

    /// The velocities of all anchors for an epoch that starts at `now`, where they are. What will not move by
    /// any part of the `extent` \[length\] stops: its square would become 0 in the end.
    pub fn end_damped_epoch(&mut self, now: i64, extent: f64) {
        let (decay, of_spins) = (self.clock.decay(now), self.spin_decay(now));
        let slowest = self.clock.drag.map_or(0.0, |drag| STOPPED * extent / drag);
        for particle in self.particles.iter_mut() {
            particle.velocity *= decay;
            if particle.velocity.length() < slowest {
                particle.velocity = DVec3::ZERO;
            }
        }
        let radius = self.classes.iter().map(|class| class.radius).fold(0.0, f64::max);
        for spins in self.spin.iter_mut().filter(|spins| spins.damped) {
            for spin in spins.angular_velocity.iter_mut() {
                *spin *= of_spins;
                if spin.length() * radius < slowest {
                    *spin = DVec3::ZERO;
                }
            }
        }
    }
}

/// Adds what the drag has done to particle i in its flight, which ends at `ticks`, to the balances. Its
/// anchor and its spin are still those of the flight.
pub(crate) fn add(state: &mut State, i: u32, ticks: i64) {
    if state.world.is_damped() {
        let (loss, impulse) = state.world.drag_on(i, ticks);
        state.accumulators.add_work_in_flight(Term::Drag, loss);
        state.accumulators.add_impulse(impulse);
    }
}

/// [`add`], and adds the flight to the integrals that are summed.
#[cold]
#[inline(never)]
pub(crate) fn end_flight(state: &mut State, i: u32, ticks: i64) {
    add(state, i, ticks);
    let State { world, accumulators, .. } = state;
    if world.flights != Summed::Nothing {
        let integral = world.flown(i, world.clock.instant(ticks), accumulators.flown_until());
        accumulators.add_flight(world.flights, integral);
    }
}
