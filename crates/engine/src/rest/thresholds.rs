//! The speeds, lengths and times that follow from `contact.rest_speed`.

use crate::model::System;

/// When grains are put to rest.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Thresholds {
    /// Slower grains are put to rest, if they stand [length/time].
    pub speed: f64,
    /// Faster impacts wake [length/time].
    pub wake: f64,
    /// Surfaces closer than this are in contact \[length\].
    pub gap: f64,
    /// Slower impacts are elastic, …
    pub elastic: f64,
    /// … if they follow another contact within this [time].
    pub soon: f64,
    /// Bodies that gravity presses together part at least as fast as they fall towards each other in this
    /// time [time].
    pub hop: f64,
    /// Slower approaches are none, and end by the law [length/time].
    pub nothing: f64,
    /// Between two censuses [time].
    pub period: f64,
}

impl Thresholds {
    /// Those of a system; `None` where no grain is put to rest.
    pub fn of(system: &System) -> Option<Self> {
        let (v, g) = (system.contacts.rest_speed, system.domain.gravity.length());
        (v > 0.0 && g > 0.0).then(|| Self {
            wake: v,
            speed: v / 2.0,
            gap: v * v / (4.0 * g),
            elastic: v / 8.0,
            soon: 10.0 * v / g,
            hop: v / (128.0 * g),
            nothing: 1e-6 * v,
            period: v / g,
        })
    }
}
