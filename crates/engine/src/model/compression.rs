//! Compression, expansion and elongation of a box.

use glam::DVec3;

use super::Dimension;

/// Edges of the box that become shorter or longer at a constant velocity: the edge along each axis is
/// L (1 − γ t) at the time t of the run, for the edge L of the [`Domain`](super::Domain).
///
/// Along periodic axes the images move with the edges. Along axes with walls the caller gives the walls of
/// the domain the velocity of the edge; here these rates only tell how the volume changes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Compression {
    /// γ along each axis [1/time]; negative where the edge becomes longer.
    pub rates: DVec3,
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

/// A box that is compressed, over the time since it was asked for the last time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Compressed {
    /// 2 or 3.
    pub dimension: Dimension,
    /// The part of the box that the particles fill now.
    pub packing_fraction: f64,
    /// p = ∫ P V dt/(N ∫ T dt); NaN for an empty interval, and without motion.
    pub reduced_pressure: f64,
}

impl Compressed {
    /// Least reduced pressure at which the packing fraction of jamming follows from it.
    const JAMMING: f64 = 1e3;

    /// The packing fraction φ_J at which the particles jam, from p = d/(1 − φ/φ_J) (Z. W. Salsburg,
    /// W. W. Wood, J. Chem. Phys. 37, 798 (1962)); `None` far from it.
    #[must_use]
    pub fn jamming(&self) -> Option<f64> {
        let left = 1.0 - self.dimension.count() as f64 / self.reduced_pressure;
        (self.reduced_pressure > Self::JAMMING).then(|| self.packing_fraction / left)
    }
}
