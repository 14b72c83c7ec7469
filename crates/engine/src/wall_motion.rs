//! Motions of walls: displacement and velocity at a time, and the next contact with a flight.
//!
//! To add a motion, add a variant of [`WallMotion`]. Nothing else in the engine depends on the variants.

use glam::DVec3;
use haff_mechanics::time_to_plane;

/// The motion of a wall.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum WallMotion {
    /// At rest.
    #[default]
    Fixed,
    /// Moves at a constant velocity [length/time]. Only its normal component acts on smooth spheres.
    Constant(DVec3),
}

impl From<DVec3> for WallMotion {
    fn from(velocity: DVec3) -> Self {
        if velocity == DVec3::ZERO { Self::Fixed } else { Self::Constant(velocity) }
    }
}

impl WallMotion {
    /// Whether the wall moves.
    #[inline]
    pub fn is_moving(&self) -> bool {
        !matches!(self, Self::Fixed)
    }

    /// The velocity [length/time].
    #[inline]
    pub fn velocity(&self) -> DVec3 {
        match self {
            Self::Fixed => DVec3::ZERO,
            Self::Constant(velocity) => *velocity,
        }
    }

    /// Displacement from time 0 to `time` [length].
    #[inline]
    pub fn displacement(&self, time: f64) -> DVec3 {
        match self {
            Self::Fixed => DVec3::ZERO,
            Self::Constant(velocity) => *velocity * time,
        }
    }

    /// Time until a body at this `distance` \[length\] touches the wall; `None` if it never does. `rate` is
    /// the rate of change of the distance [length/time], `acceleration` the relative acceleration along the
    /// normal [length/time²].
    #[inline]
    pub(crate) fn time_to_contact(&self, distance: f64, rate: f64, acceleration: f64) -> Option<f64> {
        match self {
            // In the frame of the wall, a wall at constant velocity is at rest, too.
            Self::Fixed | Self::Constant(_) => time_to_plane(distance, rate, acceleration),
        }
    }
}
