//! How fine the clock and the coordinates are for what happens.

use crate::model::{DriveKind, System, WallLaw};

/// What the ticks of the clock and the rounding of coordinates must be fine enough for.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Resolution {
    /// Longest flight so far along a periodic axis that was longer than the box [length]; else 0. The
    /// rounding error of a position after such a flight is relative to its length.
    pub longest_flight: f64,
    /// Largest extent of the system when the tick was chosen \[length\]: in a tick a particle moves by no
    /// more than a part of it.
    pub extent: f64,
    /// The largest speed for which the tick is short enough [length/time], and its square, which is finite.
    pub fastest: f64,
    pub fastest_square: f64,
    /// Speed that drives and thermal walls give to the lightest particles [length/time].
    pub given_speed: f64,
    /// Whether a drive holds a temperature.
    pub holds: bool,
}

impl Resolution {
    pub fn of(system: &System) -> Self {
        Self {
            longest_flight: 0.0,
            extent: 0.0,
            fastest: f64::MAX,
            fastest_square: f64::MAX,
            given_speed: given_speed(system),
            holds: system.drives.iter().any(|drive| matches!(drive.kind, DriveKind::Hold { .. })),
        }
    }
}

/// Few particles are faster than this many thermal speeds.
const FAST: f64 = 3.0;

/// Speed that drives and thermal walls give to the lightest particles [length/time].
fn given_speed(system: &System) -> f64 {
    let finite = system.classes.iter().map(|class| class.mass).filter(|mass| mass.is_finite());
    let lightest = finite.fold(f64::INFINITY, f64::min);
    let extent = system.domain.size.max_element();
    let driven = system.drives.iter().map(|drive| match drive.kind {
        DriveKind::Rescale { temperature, .. }
        | DriveKind::Hold { temperature, .. }
        | DriveKind::Andersen { temperature, .. } => (temperature / lightest).sqrt(),
        // The speed that a particle reaches while it crosses the system.
        DriveKind::WhiteNoise { strength, .. } => (strength * extent).cbrt(),
        // Unknown: the tick becomes shorter when it is needed.
        DriveKind::Named(_) => 0.0,
    });
    let thermal = system.contacts.wall.iter().filter_map(|law| match law {
        WallLaw::Thermal(wall) => Some((wall.temperature / lightest).sqrt()),
        WallLaw::Restitution(_) | WallLaw::Passes => None,
    });
    FAST * driven.chain(thermal).fold(0.0, f64::max)
}
