//! Planes of finite mass.

use glam::DVec3;

use crate::numerics::instant::{Instant, two_sum};

/// The motion of a plane of finite mass along its normal: constant acceleration between impacts, each of
/// which starts another flight. It does not turn, and it is guided along its normal: nothing moves it across.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Piston {
    /// Mass [mass].
    pub mass: f64,
    /// Acceleration along the normal by the load and the weight [length/time²].
    pub acceleration: f64,
    /// Displacement from the given position along the normal, at the start of the flight \[length\].
    pub displacement: f64,
    /// What is missing in it by rounding: of very many short flights it would add up \[length\].
    pub displacement_low: f64,
    /// Velocity along the normal at the start of the flight [length/time].
    pub speed: f64,
    /// Start of the flight. In a system with which a run goes on it is the present where position and
    /// velocity are those to take from now on, and the start of the run where the piston keeps those it has.
    pub since: Instant,
}

impl Piston {
    /// A piston at its given position at the start of a run, with a load along its `normal` [force] and a
    /// speed along it [length/time], under gravity [length/time²].
    #[must_use]
    pub fn new(mass: f64, force: f64, speed: f64, (normal, gravity): (DVec3, DVec3)) -> Self {
        let acceleration = force / mass + gravity.dot(normal);
        Self { mass, acceleration, displacement: 0.0, displacement_low: 0.0, speed, since: Instant::ZERO }
    }

    /// Displacement \[length\] and velocity [length/time] along the normal at a time of the flight.
    #[inline]
    pub fn at(&self, time: Instant) -> (f64, f64) {
        let (way, speed) = self.flown(time);
        (self.displacement + way, speed)
    }

    /// The way since the start of the flight, with what [`Self::displacement`] lacks \[length\], and the
    /// velocity [length/time].
    #[inline]
    fn flown(&self, time: Instant) -> (f64, f64) {
        let duration = time.since(self.since);
        let gain = self.acceleration * duration;
        (self.displacement_low + (self.speed + 0.5 * gain) * duration, self.speed + gain)
    }

    /// The same flight, begun anew at a time of it.
    #[must_use]
    pub fn restarted(&self, time: Instant) -> Self {
        let (way, speed) = self.flown(time);
        let (displacement, displacement_low) = two_sum(self.displacement, way);
        Self { displacement, displacement_low, speed, since: time, ..*self }
    }

    /// Kinetic energy at a time of the flight \[energy\].
    pub(crate) fn kinetic(&self, time: Instant) -> f64 {
        let (_, speed) = self.at(time);
        0.5 * self.mass * speed * speed
    }

    /// Work of the load and the weight from the given position on \[energy\].
    pub(crate) fn work(&self, time: Instant) -> f64 {
        let (displacement, _) = self.at(time);
        self.mass * self.acceleration * displacement
    }

    /// The flight as named numbers, for checkpoints.
    pub(crate) fn flight(&self) -> [(&'static str, f64); 5] {
        let Self { displacement, displacement_low, speed, since, .. } = *self;
        [
            ("displacement", displacement),
            ("displacement_low", displacement_low),
            ("speed", speed),
            ("since", since.high),
            ("since_low", since.low),
        ]
    }
}
