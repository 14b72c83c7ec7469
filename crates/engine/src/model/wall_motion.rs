//! Motions of walls: displacement and velocity at a time, and the next contact with a flight.
//!
//! To add a motion, add a variant of [`WallMotion`]; what depends on the variants besides is found by the
//! compiler.

use glam::DVec3;
use haff_mechanics::{Oscillation, Waveform, time_to_plane};

use crate::{
    model::piston::Piston,
    numerics::{clock::Clock, instant::Instant},
};

/// The motion of a wall.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum WallMotion {
    /// At rest.
    #[default]
    Fixed,
    /// At a constant velocity.
    Constant(ConstantVelocity),
    /// Shifted along the normal, about its given position.
    Oscillating(Oscillating),
    /// Turned in itself: the place of its surface does not change.
    Rotating(Rotation),
    /// Free to move along the normal, with a finite mass: impacts change its velocity.
    Piston(Piston),
    /// A surface that shrinks with a box that is compressed, or grows with it. (Planes then have a constant
    /// velocity.)
    Shrinking(Shrinking),
}

/// A surface that becomes smaller: all of its points are at 1 − γ t of their coordinates at time 0.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Shrinking {
    /// γ: that of the compression of the box [1/time].
    pub rate: f64,
    /// Largest speed of a point of it [length/time].
    pub speed: f64,
}

impl Shrinking {
    /// 1 − γ t.
    pub(crate) fn scale(&self, at: impl WallTime) -> f64 {
        1.0 - self.rate * at.time()
    }

    /// Velocity of the surface at a position [length/time].
    fn velocity(&self, position: DVec3, at: impl WallTime) -> DVec3 {
        position * (-self.rate / self.scale(at))
    }
}

/// The rotation of a surface of revolution about its axis, or of a plane about a normal.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rotation {
    /// A point of the axis \[length\].
    pub point: DVec3,
    /// Angular velocity along the axis [1/time].
    pub angular_velocity: DVec3,
}

impl Rotation {
    /// Velocity of the surface at a position [length/time].
    fn velocity(&self, position: DVec3) -> DVec3 {
        self.angular_velocity.cross(position - self.point)
    }
}

/// A motion at a constant velocity.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ConstantVelocity {
    /// Velocity [length/time]; only its component along the normal acts on smooth spheres.
    pub velocity: DVec3,
    /// Time at which the wall has its given position \[time\]. Late in a run a position that is extrapolated
    /// to time 0 would be far away, and rounded as such.
    pub reference_time: f64,
}

impl ConstantVelocity {
    /// Displacement from the given position \[length\].
    #[inline]
    fn displacement(&self, at: impl WallTime) -> DVec3 {
        if self.reference_time == 0.0 {
            return self.velocity * at.time();
        }
        self.velocity * at.instant().since(Instant::at(self.reference_time))
    }
}

/// An oscillation and its phase at time 0.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Oscillating {
    /// Form, amplitude and frequency.
    pub oscillation: Oscillation,
    /// Phase at time 0 in cycles, 0 ≤ u < 1.
    pub cycles: f64,
}

impl Oscillating {
    /// [`Oscillation::integrals`] over a `duration` around a time.
    pub(crate) fn integrals(&self, middle: impl WallTime, duration: f64) -> [f64; 3] {
        self.oscillation.integrals(self.at(middle), duration)
    }

    /// Phase at a time in cycles, from 0 to 2.
    pub(crate) fn at(&self, time: impl WallTime) -> f64 {
        self.cycles + time.instant().cycles(self.oscillation.frequency)
    }
}

/// A time of the state of a wall: rounded for displacements at constant velocity since time 0, without
/// rounding for those since a later time and for phases of oscillations.
pub trait WallTime: Copy {
    /// The time, rounded \[time\].
    fn time(self) -> f64;
    /// The time without rounding.
    fn instant(self) -> Instant;
}

impl WallTime for Instant {
    fn time(self) -> f64 {
        self.high
    }

    fn instant(self) -> Instant {
        self
    }
}

/// Ticks of a clock.
impl WallTime for (&Clock, i64) {
    #[inline]
    fn time(self) -> f64 {
        self.0.time(self.1)
    }

    #[inline]
    fn instant(self) -> Instant {
        self.0.instant(self.1)
    }
}

/// The approach of a body to a wall, along the wall's normal.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Approach {
    /// Distance of the body's surface from the wall \[length\].
    pub distance: f64,
    /// Its rate of change [length/time].
    pub rate: f64,
    /// Velocity of the body [length/time].
    pub speed: f64,
    /// Its acceleration [length/time²].
    pub acceleration: f64,
}

impl From<DVec3> for WallMotion {
    fn from(velocity: DVec3) -> Self {
        if velocity == DVec3::ZERO {
            Self::Fixed
        } else {
            Self::Constant(ConstantVelocity { velocity, reference_time: 0.0 })
        }
    }
}

impl WallMotion {
    /// Whether the wall moves at any time.
    #[inline]
    pub fn is_moving(&self) -> bool {
        !matches!(self, Self::Fixed)
    }

    /// Velocity of a wall with this normal [length/time], without that of a rotation, and of shrinking.
    #[inline]
    pub fn velocity(&self, normal: DVec3, at: impl WallTime) -> DVec3 {
        match self {
            Self::Fixed | Self::Rotating(_) | Self::Shrinking(_) => DVec3::ZERO,
            Self::Constant(motion) => motion.velocity,
            Self::Oscillating(motion) => normal * motion.oscillation.velocity(motion.at(at)),
            Self::Piston(piston) => normal * piston.at(at.instant()).1,
        }
    }

    /// Velocity of the surface of a wall with this normal at a position [length/time].
    #[inline]
    pub(crate) fn velocity_of_surface(&self, normal: DVec3, position: DVec3, at: impl WallTime) -> DVec3 {
        match self {
            Self::Rotating(rotation) => rotation.velocity(position),
            Self::Shrinking(motion) => motion.velocity(position, at),
            _ => self.velocity(normal, at),
        }
    }

    /// Displacement of a wall with this normal from its given position, which it has at its reference time or
    /// on average [length].
    #[inline]
    pub fn displacement(&self, normal: DVec3, at: impl WallTime) -> DVec3 {
        match self {
            Self::Fixed | Self::Rotating(_) | Self::Shrinking(_) => DVec3::ZERO,
            Self::Constant(motion) => motion.displacement(at),
            Self::Oscillating(motion) => normal * motion.oscillation.shift(motion.at(at)),
            Self::Piston(piston) => normal * piston.at(at.instant()).0,
        }
    }

    /// The present size of the surface as a part of that at time 0.
    #[inline]
    pub fn scale(&self, at: impl WallTime) -> f64 {
        match self {
            Self::Shrinking(motion) => motion.scale(at),
            _ => 1.0,
        }
    }

    /// Largest speed [length/time], without that of a rotation; of a piston, that at the start of its flight.
    pub fn max_speed(&self) -> f64 {
        match self {
            Self::Fixed | Self::Rotating(_) => 0.0,
            Self::Constant(motion) => motion.velocity.length(),
            Self::Shrinking(motion) => motion.speed,
            Self::Oscillating(motion) => motion.oscillation.max_speed(),
            Self::Piston(piston) => piston.speed.abs(),
        }
    }

    /// Acceleration along the normal [length/time²].
    pub(crate) fn acceleration(&self, at: impl WallTime) -> f64 {
        match self {
            Self::Fixed | Self::Constant(_) | Self::Rotating(_) | Self::Shrinking(_) => 0.0,
            Self::Oscillating(motion) => motion.oscillation.acceleration(motion.at(at)),
            Self::Piston(piston) => piston.acceleration,
        }
    }

    /// Largest magnitude of the acceleration [length/time²], without jumps of the velocity.
    pub(crate) fn max_acceleration(&self) -> f64 {
        match self {
            Self::Fixed | Self::Constant(_) | Self::Rotating(_) | Self::Shrinking(_) => 0.0,
            Self::Oscillating(motion) => motion.oscillation.max_acceleration(),
            Self::Piston(piston) => piston.acceleration.abs(),
        }
    }

    /// Time from `at` until the velocity next jumps \[time\]; infinite if it never does.
    pub(crate) fn time_to_jump(&self, at: impl WallTime) -> f64 {
        match self {
            Self::Fixed | Self::Constant(_) | Self::Rotating(_) | Self::Piston(_) | Self::Shrinking(_) => {
                f64::INFINITY
            }
            Self::Oscillating(motion) => motion.oscillation.time_to_corner(motion.at(at)),
        }
    }

    /// Duration of a cycle \[time\]; infinite without one.
    pub(crate) fn period(&self) -> f64 {
        match self {
            Self::Fixed | Self::Constant(_) | Self::Rotating(_) | Self::Piston(_) | Self::Shrinking(_) => {
                f64::INFINITY
            }
            Self::Oscillating(motion) => 1.0 / motion.oscillation.frequency,
        }
    }

    /// Whether the wall accelerates, so that it can carry a grain and be left by it.
    #[inline]
    pub(crate) fn carries(&self) -> bool {
        matches!(self, Self::Oscillating(_))
    }

    /// Time from `at` until the wall is left by a body that it carries, whose own acceleration along the
    /// normal is `acceleration` [length/time²]; `None` if it never is.
    pub(crate) fn time_to_release(&self, acceleration: f64, at: impl WallTime) -> Option<f64> {
        match self {
            Self::Fixed | Self::Constant(_) | Self::Rotating(_) | Self::Piston(_) | Self::Shrinking(_) => {
                None
            }
            Self::Oscillating(motion) => motion.oscillation.time_to_release(acceleration, motion.at(at)),
        }
    }

    /// Velocity along the normal of a body that leaves the wall at `at` [length/time]: that of the wall, at a
    /// corner of a triangle the one before it.
    pub(crate) fn release_speed(&self, normal: DVec3, at: impl WallTime) -> f64 {
        let speed = self.velocity(normal, at).dot(normal);
        match self {
            Self::Oscillating(motion) if motion.oscillation.waveform == Waveform::Triangle => -speed,
            _ => speed,
        }
    }

    /// Time at which the wall has its given position, or 0 \[time\].
    pub(crate) fn reference_time(&self) -> f64 {
        match self {
            Self::Constant(motion) => motion.reference_time,
            Self::Fixed | Self::Oscillating(_) | Self::Rotating(_) | Self::Piston(_) | Self::Shrinking(_) => {
                0.0
            }
        }
    }

    /// A bound: the displacement along the normal differs from that at this mean velocity [length/time] by at
    /// most this distance \[length\].
    pub(crate) fn bound(&self, normal: DVec3) -> (f64, f64) {
        match self {
            Self::Fixed | Self::Rotating(_) => (0.0, 0.0),
            Self::Constant(motion) => (motion.velocity.dot(normal), 0.0),
            Self::Oscillating(motion) => (0.0, motion.oscillation.amplitude),
            Self::Piston(_) | Self::Shrinking(_) => (0.0, f64::INFINITY),
        }
    }

    /// The largest distance from the given position along the normal, at any time \[length\].
    pub fn sweep(&self, normal: DVec3) -> f64 {
        let (speed, amplitude) = self.bound(normal);
        if speed == 0.0 { amplitude } else { f64::INFINITY }
    }

    /// Time from `at` until a body touches the wall; `None` if it never does. Contacts with pistons are
    /// predicted by `search/pistons.rs`, since they depend on the impacts of all particles.
    #[inline]
    pub(crate) fn time_to_contact(&self, approach: &Approach, at: impl WallTime) -> Option<f64> {
        match self {
            // In the frame of the wall both have straight or parabolic paths.
            Self::Fixed | Self::Constant(_) | Self::Rotating(_) | Self::Shrinking(_) => {
                time_to_plane(approach.distance, approach.rate, approach.acceleration)
            }
            Self::Oscillating(motion) => motion.oscillation.time_to_contact(
                approach.distance,
                approach.speed,
                approach.acceleration,
                motion.at(at),
            ),
            Self::Piston(_) => None,
        }
    }
}
