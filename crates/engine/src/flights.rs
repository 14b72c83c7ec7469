/*!
The kinetic term of pressures where particles accelerate between events: ∫ Σ m c ⊗ c dt.

Without acceleration c changes in events only, and the integral is its value at the end minus moments of the
changes ([`crate::accumulators`], [`crate::measurements`]). Under gravity, on walls that carry grains and
under shear each flight adds its own integral when it ends. With the velocity c in the middle of a time τ of
constant acceleration a,

 ∫ c ⊗ c dt = τ (c ⊗ c + τ²/12 a ⊗ a),

which is a sum of positive terms and loses no digits. Peculiar velocities under shear have the acceleration
−γ̇ c_y along the flow. A carried grain has, in addition, the velocity of the wall along its normal.
*/

use glam::DVec3;

use crate::{
    accumulators::Accumulators,
    exact_sum::ExactSum,
    instant::Instant,
    measure::total,
    measurements::Tensor,
    model::{Boundary, System},
    particles::World,
    scalars::{ScalarReader, ScalarWriter},
    shear,
    state::State,
    sum::Sum,
    wall_motion::WallMotion,
};

/// What is summed of the flights of a system.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) enum Summed {
    /// They are straight, or no pressure needs them.
    #[default]
    Nothing,
    /// The trace of the tensor, for the pressure.
    Trace,
    /// All moments, for the pressure tensor.
    Tensor,
}

impl Summed {
    /// What the pressures of a system need, if its particles do not fly straight.
    pub fn of(system: &System) -> Self {
        let measure = &system.measure;
        let axes = &system.domain.boundary[..system.dimension.count()];
        if measure.stress || measure.correlations.stress {
            Self::Tensor
        } else if axes.contains(&Boundary::Open) {
            Self::Nothing
        } else {
            Self::Trace
        }
    }
}

/// Moments of the velocity c of a mass: the components xx, xy, xz, yy, yz, zz of m c ⊗ c, and m c.
pub(crate) type Moments = [f64; 9];

/// Number of components of m c ⊗ c in [`Moments`]; those of m c follow.
const SECOND: usize = 6;

/// Rows and columns of the components.
const PLACES: [(usize, usize); SECOND] = [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)];

/// The components of (a ⊗ b + b ⊗ a)/2.
fn symmetric(a: DVec3, b: DVec3) -> [f64; SECOND] {
    PLACES.map(|(i, j)| if i == j { a[i] * b[i] } else { 0.5 * (a[i] * b[j] + a[j] * b[i]) })
}

/// The moments of a body.
pub(crate) fn moments(mass: f64, c: DVec3) -> Moments {
    let [xx, xy, xz, yy, yz, zz] = symmetric(c, mass * c);
    let p = mass * c;
    [xx, xy, xz, yy, yz, zz, p.x, p.y, p.z]
}

/// The tensor m c ⊗ c, row by row, and the vector m c.
pub(crate) fn tensor_and_momentum(moments: &Moments) -> (Tensor, DVec3) {
    let [xx, xy, xz, yy, yz, zz, x, y, z] = *moments;
    ([xx, xy, xz, xy, yy, yz, xz, yz, zz], DVec3::new(x, y, z))
}

/// Sums over the flights that have ended.
#[derive(Debug, Clone, Default)]
pub(crate) struct FlightSums {
    /// Since `until`: the trace of the tensor, or all moments.
    pub sums: [ExactSum; 9],
    /// The time up to which all flights have been taken.
    pub until: Instant,
    /// The trace of what has been taken since the previous sample.
    pub sampled: Sum,
}

impl FlightSums {
    /// Adds its numbers to a checkpoint.
    pub fn save(&self, scalars: &mut ScalarWriter) {
        for (k, sum) in self.sums.iter().enumerate() {
            scalars.exact_sum(&format!("flights.{k}"), sum);
        }
        scalars.pair("flights.until", self.until.high, self.until.low);
        scalars.sum("flights.sampled", &self.sampled);
    }

    /// Loads what [`Self::save`] has saved.
    pub fn load(scalars: &mut ScalarReader) -> Self {
        let sums = std::array::from_fn(|k| scalars.exact_sum(&format!("flights.{k}")));
        let (high, low) = scalars.pair("flights.until");
        Self { sums, until: Instant { high, low }, sampled: scalars.sum("flights.sampled") }
    }

    /// Adds the sums of another thread.
    pub fn merge(&mut self, other: &Self) {
        for (sum, other) in self.sums.iter_mut().zip(&other.sums) {
            sum.merge(other);
        }
    }
}

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
        let (velocity, acceleration) = match &self.shear {
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
            && let WallMotion::Oscillating(motion) = self.walls[wall as usize].motion
        {
            let n = self.walls[wall as usize].normal;
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
    fn add_flight(&mut self, summed: Summed, integral: Moments) {
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
    fn flown_until(&self) -> Instant {
        self.flights.as_ref().map_or(Instant::ZERO, |flights| flights.until)
    }
}

/// Adds the flight of particle i from its anchor to `ticks`, where it gets another one, to the sums. Its
/// acceleration is still that of the flight.
#[inline(always)]
pub(crate) fn end(state: &mut State, i: u32, ticks: i64) {
    if !state.world.flies_straight() || state.world.shear.is_some() {
        end_after(state, i, state.world.age(i, ticks));
    }
}

/// [`end`] for a flight of `duration` \[time\].
#[inline(never)]
pub(crate) fn end_after(state: &mut State, i: u32, duration: f64) {
    shear::end_flight_after(state, i, duration);
    let State { world, accumulators, .. } = state;
    if world.flights != Summed::Nothing {
        let end = world.clock.instant(world.particles[i as usize].time).after(duration);
        let integral = world.flown(i, end, accumulators.flown_until());
        accumulators.add_flight(world.flights, integral);
    }
}

/// Takes the integrals over all flights from the previous call, or the start, to the present. `None` if they
/// are not summed; if only the trace is, it is the first component.
pub(crate) fn take(state: &mut State) -> Option<Moments> {
    let State { world, accumulators, .. } = state;
    if world.flights == Summed::Nothing {
        return None;
    }
    let (now, until) = (world.clock.instant(world.now), accumulators.flown_until());
    let pending = total(world.particles.len(), |i| world.flown(i, now, until));
    accumulators.add_flight(world.flights, pending);
    let flights = accumulators.flights.get_or_insert_default();
    flights.until = now;
    let integrals = std::mem::take(&mut flights.sums).map(|sum| sum.value());
    let [xx, _, _, yy, _, zz, ..] = integrals;
    flights.sampled.add(xx + yy + zz);
    Some(integrals)
}
