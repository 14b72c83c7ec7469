//! Compression, expansion and elongation of a box.

use glam::DVec3;

/// Edges of the box that become shorter or longer at a constant velocity: the edge along each axis is
/// L (1 − γ t) at the time t of the run, for the edge L of the [`Domain`](super::Domain).
///
/// Along periodic axes the images move with the edges. Along axes with walls the caller gives the walls of
/// the domain the velocity of the edge; here these rates only tell how the volume changes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Compression {
    /// γ along each axis [1/time]; negative where the edge becomes longer.
    pub rates: DVec3,
    /// The part of the box that is inside of a container which shrinks with it; 1 without one.
    pub inside: f64,
}

impl Compression {
    /// The edges of a domain at a time of the run \[length\].
    #[must_use]
    pub fn edges(&self, size: DVec3, time: f64) -> DVec3 {
        size * (DVec3::ONE - self.rates * time)
    }

    /// The time at which an edge has no length left [time]; infinite if none becomes shorter.
    #[must_use]
    pub fn end(&self) -> f64 {
        1.0 / self.rates.max_element().max(0.0)
    }
}
