//! Recorded states for `positions = { file = … }`. Callers implement the reading of files.

use std::path::Path;

use glam::DVec3;

/// All particles of a recorded frame, in scene order.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct State {
    /// Edge lengths of the box [length].
    pub size: DVec3,
    /// Centres [length], within [0, L) along periodic axes.
    pub position: Vec<DVec3>,
    /// Velocities [length/time].
    pub velocity: Vec<DVec3>,
    /// Box images.
    pub image: Vec<[i32; 3]>,
    /// Radii [length].
    pub radius: Vec<f64>,
    /// Masses [mass].
    pub mass: Vec<f64>,
}

/// Reads recorded states.
pub trait StateSource {
    /// The last frame of the file at `path` (relative to the current directory).
    ///
    /// # Errors
    /// The reason why the file cannot be read.
    fn last_state(&self, path: &Path) -> Result<State, String>;
}

/// For scenes without recorded states: every file is an error.
#[derive(Debug, Clone, Copy, Default)]
pub struct NoStates;

impl StateSource for NoStates {
    fn last_state(&self, path: &Path) -> Result<State, String> {
        Err(format!("{}: no reader for state files is at hand", path.display()))
    }
}
