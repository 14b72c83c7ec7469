//! What a box that is compressed is like.

use crate::model::Dimension;

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
