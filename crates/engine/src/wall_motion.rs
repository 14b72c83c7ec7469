//! How walls move: displacement and velocity at a time, and the next contact with a flight.
//!
//! A new motion is one more variant of [`WallMotion`]; nothing else in the engine depends on which it is.

use glam::DVec3;
use haff_mechanics::time_to_plane;

/// The motion of a wall.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum WallMotion {
    /// At rest.
    #[default]
    Fixed,
    /// At a constant velocity [length/time]; only its component along the normal acts on smooth spheres.
    Constant(DVec3),
}

impl From<DVec3> for WallMotion {
    fn from(velocity: DVec3) -> Self {
        if velocity == DVec3::ZERO { Self::Fixed } else { Self::Constant(velocity) }
    }
}

impl WallMotion {
    /// Whether the wall moves at any time.
    #[inline]
    pub fn is_moving(&self) -> bool {
        !matches!(self, Self::Fixed)
    }

    /// Velocity [length/time].
    #[inline]
    pub fn velocity(&self) -> DVec3 {
        match self {
            Self::Fixed => DVec3::ZERO,
            Self::Constant(velocity) => *velocity,
        }
    }

    /// Displacement since time 0 at a `time` [length].
    #[inline]
    pub fn displacement(&self, time: f64) -> DVec3 {
        match self {
            Self::Fixed => DVec3::ZERO,
            Self::Constant(velocity) => *velocity * time,
        }
    }

    /// Time until a body touches the wall that is at this `distance` \[length\] from it, with this `rate` of
    /// change [length/time] and relative acceleration `acceleration` [length/time²], both along the normal; `None` if
    /// it never does.
    #[inline]
    pub(crate) fn time_to_contact(&self, distance: f64, rate: f64, acceleration: f64) -> Option<f64> {
        match self {
            // In the frame of the wall both are at rest.
            Self::Fixed | Self::Constant(_) => time_to_plane(distance, rate, acceleration),
        }
    }
}
