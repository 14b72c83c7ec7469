/*!
The kinetic term of pressures where particles accelerate between events: ∫ Σ m c ⊗ c dt.

Without acceleration c changes in events only, and the integral is its value at the end minus moments of the
changes ([`crate::state::accumulators`], [`crate::measure`]). Under gravity, on walls that carry grains and
in a box that deforms each flight adds its own integral when it ends. With the velocity c in the middle of a
time τ of constant acceleration a,

 ∫ c ⊗ c dt = τ (c ⊗ c + τ²/12 a ⊗ a),

which is a sum of positive terms and loses no digits. Peculiar velocities under shear have the acceleration
−γ̇ c_y along the flow. A carried grain has, in addition, the velocity of the wall along its normal. Where
edges become shorter or longer, c and the volume change along the flight: `Deformation::integral`.
*/

use glam::DVec3;

use crate::{
    model::wall_motion::WallMotion,
    motion::{drag, flow_work},
    numerics::{instant::Instant, total::total},
    state::{
        State,
        accumulators::Accumulators,
        deformation::Isotropic,
        flight_sums::{Moments, SECOND, Summed, symmetric},
        world::World,
    },
};

impl World {
    /// The integrals of the moments of particle i from its anchor, but not before `until`, to `end`. Zero for
    /// a body of infinite mass, and one that is asleep.
    fn flown(&self, i: u32, end: Instant, until: Instant) -> Moments {
        let particle = &self.particles[i as usize];
        let class = self.class(i);
        let anchor = self.clock.instant(particle.time);
        let start = anchor.max(until);
        let duration = end.since(start);
        if class.inverse_mass == 0.0 || duration <= 0.0 {
            return [0.0; 9];
        }
        if let Some(images) = &self.boundary.deformation
            && images.stretches()
        {
            let position = particle.position + particle.velocity * start.since(anchor);
            let motion = [position, particle.velocity];
            if self.flights == Summed::Trace {
                let trace = images.trace(class.mass, motion, start.time(), duration);
                return [trace, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
            }
            let moments = |c: DVec3| {
                let (second, p) = (symmetric(c, class.mass * c), class.mass * c);
                let [xx, xy, xz, yy, yz, zz] = second;
                [xx, xy, xz, yy, yz, zz, p.x, p.y, p.z]
            };
            return images.integral(motion, start.time(), duration, moments);
        }
        let (velocity, acceleration) = match self.shear() {
            Some(shear) => {
                let velocity = particle.velocity - shear.velocity(particle.position);
                (velocity, DVec3::AXES[shear.flow] * (-shear.rate * velocity[shear.gradient]))
            }
            None => (particle.velocity, self.acceleration(i)),
        };
        let c = velocity + acceleration * (start.since(anchor) + 0.5 * duration);
        let (of_velocity, of_acceleration) = (symmetric(c, c), symmetric(acceleration, acceleration));
        let twelfth = duration * duration / 12.0;
        let mut sums: [f64; SECOND] =
            std::array::from_fn(|k| class.mass * duration * (of_velocity[k] + twelfth * of_acceleration[k]));
        let mut momentum = class.mass * duration * c;
        if let Some(wall) = self.carrier(i)
            && let WallMotion::Oscillating(motion) = self.boundary.walls[wall as usize].motion
        {
            let n = self.boundary.walls[wall as usize].normal;
            let [moved, moment, square] = motion.integrals(start.after(0.5 * duration), duration);
            let along = symmetric(n, 2.0 * (c * moved + acceleration * moment));
            let of_wall = symmetric(n, n * square);
            for (k, sum) in sums.iter_mut().enumerate() {
                *sum += class.mass * (along[k] + of_wall[k]);
            }
            momentum += n * (class.mass * moved);
        }
        let [xx, xy, xz, yy, yz, zz] = sums;
        [xx, xy, xz, yy, yz, zz, momentum.x, momentum.y, momentum.z]
    }
}

impl Accumulators {
    /// Adds the integral of a flight that has ended.
    pub(super) fn add_flight(&mut self, summed: Summed, integral: Moments) {
        let sums = &mut self.flights.get_or_insert_default().sums;
        if summed == Summed::Trace {
            let [xx, _, _, yy, _, zz, ..] = integral;
            sums[0].add(xx + yy + zz);
            return;
        }
        for (sum, term) in sums.iter_mut().zip(integral).filter(|(_, term)| *term != 0.0) {
            sum.add(term);
        }
    }

    /// The time up to which flights have been taken.
    pub(super) fn flown_until(&self) -> Instant {
        self.flights.as_ref().map_or(Instant::ZERO, |flights| flights.until)
    }
}

/// Adds the flight of particle i from its anchor to `ticks`, where it gets another one, to the sums. Its
/// acceleration is still that of the flight.
#[inline(always)]
pub(crate) fn end(state: &mut State, i: u32, ticks: i64) {
    if !state.world.flies_straight() || state.world.boundary.deformation.is_some() {
        end_after(state, i, state.world.age(i, ticks));
    } else if state.world.is_damped() {
        drag::end_flights(state, &[i], ticks);
    }
}

/// [`end`] for a flight of `duration` \[time\].
#[inline(never)]
fn end_after(state: &mut State, i: u32, duration: f64) {
    flow_work::end_flight_after(state, i, duration);
    let State { world, accumulators, .. } = state;
    if world.flights != Summed::Nothing {
        let end = world.clock.instant(world.particles[i as usize].time).after(duration);
        let integral = world.flown(i, end, accumulators.flown_until());
        accumulators.add_flight(world.flights, integral);
    }
}

/// What [`end`] adds for two particles that collide at `ticks`, in a box that is compressed at one rate along
/// all axes: the work of the flow in their flights \[energy\]. Their integrals are added, if only the trace
/// is summed.
#[inline(always)]
pub(crate) fn end_isotropic(state: &mut State, isotropic: &Isotropic, bodies: [u32; 2], ticks: i64) -> f64 {
    let State { world, accumulators, .. } = state;
    let until = accumulators.flown_until();
    let mut sums = [0.0; 2];
    for i in bodies {
        let particle = &world.particles[i as usize];
        let mass = world.class(i).mass;
        let (start, duration) = (world.clock.time(particle.time), world.age(i, ticks));
        let motion = [particle.position, particle.velocity];
        let [work, mut trace] = isotropic.flight(mass, motion, start, duration);
        // Rarely: a sample has taken the first part.
        if start <= until.time() * (1.0 + 2.0 * f64::EPSILON) {
            [trace, ..] = world.flown(i, world.clock.instant(particle.time).after(duration), until);
        }
        sums = [sums[0] + work, sums[1] + trace];
    }
    if world.flights != Summed::Nothing {
        accumulators.flights.get_or_insert_default().sums[0].add(sums[1]);
    }
    sums[0]
}

/// Takes the integrals over all flights from the previous call, or the start, to the present. `None` if they
/// are not summed; if only the trace is, it is the first component.
pub(crate) fn take(state: &mut State) -> Option<Moments> {
    let State { world, accumulators, .. } = state;
    if world.flights == Summed::Nothing {
        return None;
    }
    let (now, until) = (world.clock.instant(world.now), accumulators.flown_until());
    let pending = total(world.particles.len(), |i| {
        if world.is_damped() { world.damped_flight(i, world.now, until) } else { world.flown(i, now, until) }
    });
    accumulators.add_flight(world.flights, pending);
    let flights = accumulators.flights.get_or_insert_default();
    flights.until = now;
    let integrals = std::mem::take(&mut flights.sums).map(|sum| sum.value());
    let [xx, _, _, yy, _, zz, ..] = integrals;
    flights.sampled.add(xx + yy + zz);
    Some(integrals)
}
