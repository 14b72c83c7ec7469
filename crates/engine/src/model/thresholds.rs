//! Speeds, lengths and times derived from `contact.rest_speed`.

use crate::model::System;

/// The conditions under which grains are put to rest.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Thresholds {
    /// Slower grains are put to rest if they are supported [length/time].
    pub speed: f64,
    /// Faster impacts wake a grain [length/time].
    pub wake: f64,
    /// Bodies with a smaller gap between their surfaces are in contact \[length\].
    pub gap: f64,
    /// Repeated contacts with a slower approach are elastic [length/time].
    pub elastic: f64,
    /// A contact within this time after another one of the same body is repeated [time].
    pub recent: f64,
    /// Bodies that gravity presses together separate at least at the speed that they would gain by falling
    /// towards each other for this time [time].
    pub fall_time: f64,
    /// For slower approaches, repeated contacts follow the law of restitution, too [length/time].
    pub negligible: f64,
    /// Time between two settling scans [time].
    pub period: f64,
}

impl Thresholds {
    /// The thresholds of a system; `None` if no grain is put to rest.
    pub fn of(system: &System) -> Option<Self> {
        let (v, g) = (system.contacts.rest_speed, system.domain.gravity.length());
        (v > 0.0 && g > 0.0).then(|| Self {
            wake: v,
            speed: v / 2.0,
            gap: v * v / (4.0 * g),
            elastic: v / 8.0,
            recent: 10.0 * v / g,
            fall_time: v / (128.0 * g),
            negligible: 1e-6 * v,
            period: v / g,
        })
    }
}
