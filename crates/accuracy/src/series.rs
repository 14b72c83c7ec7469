//! Deviation from a reference against collisions.

/// Deviation from the reference against collisions per particle.
#[derive(Debug, Clone, PartialEq)]
pub struct Series {
    /// Collisions per particle, walls included.
    pub collisions: Vec<f64>,
    /// Root mean square deviation of the positions [diameters].
    pub deviation: Vec<f64>,
}
