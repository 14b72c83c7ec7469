//! Spins and rough contacts of a system.

use glam::DVec3;
use haff_mechanics::Roughness;

/// What a system needs for spin.
#[derive(Debug, Clone, PartialEq)]
pub struct Spin {
    /// q = I/(m R²) of the particles of each contact group.
    pub inertia: Vec<f64>,
    /// Angular velocity of each body at the start [1/time]; along z in two dimensions.
    pub angular_velocity: Vec<DVec3>,
    /// The tangential law of pairs of groups: row-major `groups × groups`, symmetric.
    pub pair: Vec<Roughness>,
    /// The same of groups with walls: row-major `groups × walls`.
    pub wall: Vec<Roughness>,
}

/// Number of axes about which particles rotate.
pub(crate) fn rotations(dimension: usize) -> usize {
    if dimension == 2 { 1 } else { 3 }
}
