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
    model::features::Features,
    numerics::{instant::Instant, total::total},
    report::ledger::Term,
    state::{
        State,
        flight_sums::{Moments, Summed, moments},
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

    /// [`Self::undamped`] in code that is compiled per feature.
    #[inline(always)]
    pub fn anchor_velocity<F: Features>(&self, velocity: DVec3, ticks: i64) -> DVec3 {
        if F::DAMPED { self.undamped(velocity, ticks) } else { velocity }
    }

    /// [`Clock::shown`](crate::numerics::clock::Clock::shown) in code that is compiled per feature.
    #[inline(always)]
    pub fn shown<F: Features>(&self, ticks: i64) -> f64 {
        if F::DAMPED {
            self.clock.shown(ticks)
        } else {
            self.clock.straight_time(ticks).max(self.clock.earliest)
        }
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
        let turning = self.spin.as_ref().filter(|spins| spins.damped).map_or(0.0, |spins| {
            class.moment_of_inertia(&spins.inertia) * spins.angular_velocity[i as usize].length_squared()
        });
        let twice = class.mass * particle.velocity.length_squared() + turning;
        // Not the difference of both decays, which loses the digits of a short flight.
        let lost = self.age(i, ticks) * self.drag_rate();
        let decays = self.clock.decay(particle.time) + self.clock.decay(ticks);
        (0.5 * twice * lost * decays, particle.velocity * -(class.mass * lost))
    }

    /// 1/τ [1/time]; 0 without drag.
    fn drag_rate(&self) -> f64 {
        self.clock.drag.map_or(0.0, f64::recip)
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

    /// The integrals of the moments of particle i from its anchor, but not before `until`, to `ticks` in the
    /// same epoch: with v = u (1 − s/τ) and dt = ds/(1 − s/τ), ∫ v ⊗ v dt is u ⊗ u times the mean of 1 − s/τ
    /// at both ends times the transformed time.
    pub fn damped_flight(&self, i: u32, ticks: i64, until: Instant) -> Moments {
        let (particle, class) = (&self.particles[i as usize], self.class(i));
        let skipped = (self.clock.transformed(until) - particle.time as f64 * self.clock.tick).max(0.0);
        let duration = self.age(i, ticks) - skipped;
        if class.inverse_mass == 0.0 || duration <= 0.0 {
            return [0.0; 9];
        }
        let start = self.clock.decay(particle.time) - skipped * self.drag_rate();
        let mean = 0.5 * (start + self.clock.decay(ticks));
        let [xx, xy, xz, yy, yz, zz, x, y, z] = moments(class.mass * duration, particle.velocity);
        [xx * mean, xy * mean, xz * mean, yy * mean, yz * mean, zz * mean, x, y, z]
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

/// Adds what the drag has done to bodies in their flights, which end at `ticks`, to the balances. Their
/// anchors and spins are still those of the flights.
pub(crate) fn add(state: &mut State, bodies: &[u32], ticks: i64) {
    if !state.world.is_damped() {
        return;
    }
    let (mut loss, mut impulse) = (0.0, DVec3::ZERO);
    for &i in bodies {
        let (of_body, on_body) = state.world.drag_on(i, ticks);
        (loss, impulse) = (loss + of_body, impulse + on_body);
    }
    state.accumulators.add_work_in_flight(Term::Drag, loss);
    state.accumulators.add_impulse(impulse);
}

/// [`add`], and adds the flights to the integrals that are summed.
#[inline(never)]
pub(crate) fn end_flights(state: &mut State, bodies: &[u32], ticks: i64) {
    add(state, bodies, ticks);
    let State { world, accumulators, .. } = state;
    if world.flights != Summed::Nothing {
        let until = accumulators.flown_until();
        let mut sums = [0.0; 9];
        for &i in bodies {
            for (sum, term) in sums.iter_mut().zip(world.damped_flight(i, ticks, until)) {
                *sum += term;
            }
        }
        accumulators.add_flight(world.flights, sums);
    }
}
