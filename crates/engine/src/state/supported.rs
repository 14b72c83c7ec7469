//! Which walls support particles.

use crate::state::particle::Support;

/// Particles that rest on walls.
#[derive(Debug, Clone, Default)]
pub(crate) struct Supported {
    /// The walls that support each particle; empty until the first particle rests on a wall.
    pub support: Vec<Support>,
    /// Number of particles that rest on walls.
    pub resting: usize,
}
