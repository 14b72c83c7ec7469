//! States that scenes start from, read from files.

use std::path::{Path, PathBuf};

use haff_scene::{State, StateSource};

/// Reads the states that scenes start from.
pub struct States;

impl StateSource for States {
    fn last_state(&self, path: &Path) -> Result<State, String> {
        let state = haff_record::last_state(path).map_err(|error| error.to_string())?;
        Ok(State {
            size: state.box_size,
            position: state.position,
            velocity: state.velocity,
            image: state.image,
            radius: state.radius,
            mass: state.mass,
        })
    }
}

/// States for a run that is resumed: particles come from the checkpoint, so any frame of the file itself is a
/// valid initial state of the scene, and the state file that the run started from need not exist any more.
pub struct OwnStates(pub PathBuf);

impl StateSource for OwnStates {
    fn last_state(&self, path: &Path) -> Result<State, String> {
        States.last_state(&self.0).or_else(|_| States.last_state(path))
    }
}
