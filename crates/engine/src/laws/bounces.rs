//! When series of bounces end.

use haff_mechanics::Bounces;

/// A series of bounces is completed in closed form once the next bounce would rise by less than this fraction
/// of the radius: far below the resolution of a coordinate at the size of a system, and far above the effect
/// of rounding on a bounce.
pub(crate) const REST_HEIGHT: f64 = 1e-13;

/// The sums of a series in which the next impact is plastic, and so the last.
pub(crate) const PLASTIC_END: Bounces = Bounces { speeds: 1.0, squares: 1.0 };
