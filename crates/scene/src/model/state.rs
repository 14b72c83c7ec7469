//! Recorded states for `positions = { file = … }`. Callers implement the reading of files.

use std::path::Path;

use glam::DVec3;
use haff_engine::{Checkpoint, System};

/// All particles of a recorded frame, in scene order.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct State {
    /// Edge lengths of the box [length], if the file has them.
    pub size: Option<DVec3>,
    /// Edge vectors of the box \[length\], if it is sheared.
    pub sheared_edges: Option<[DVec3; 3]>,
    /// Centres [length], within [0, L) along periodic axes.
    pub position: Vec<DVec3>,
    /// Velocities [length/time], if the file has them.
    pub velocity: Option<Vec<DVec3>>,
    /// Angular velocities [1/time], if the file has them.
    pub angular_velocity: Option<Vec<DVec3>>,
    /// Box images, if the file has them.
    pub image: Option<Vec<[i32; 3]>>,
    /// Radii [length].
    pub radius: Vec<f64>,
    /// Masses [mass], if the file has them.
    pub mass: Option<Vec<f64>>,
    /// Relative precision of the numbers, if it is less than that of doubles.
    pub precision: f64,
}

/// Reads recorded states.
pub trait StateSource {
    /// The frame `index` of the file at `path` (relative to the current directory); from the end if negative.
    ///
    /// # Errors
    /// The reason why the file cannot be read.
    fn state(&self, path: &Path, index: i64) -> Result<State, String>;

    /// Tells which part of a long work is done, and what it is.
    fn progress(&self, _work: &str, _part: f64) {}

    /// The checkpoint of a growth that was interrupted: the packing of a scene with this output file. `key`
    /// names all that the growth depends on. `None` if there is none.
    fn kept_growth(&self, _output: Option<&Path>, _key: &str) -> Option<Checkpoint> {
        None
    }

    /// Offers a checkpoint of a growth that goes on, for [`Self::kept_growth`].
    fn keep_growth(
        &self,
        _output: Option<&Path>,
        _key: &str,
        _system: &System,
        _take: &dyn Fn() -> Checkpoint,
    ) {
    }

    /// The triangles of the mesh with this hash, of a run that goes on where the file of the mesh is not;
    /// `None` if they are not known.
    fn mesh(&self, _hash: &str) -> Option<Vec<[DVec3; 3]>> {
        None
    }

    /// The text of the table of sizes at `path`, relative to the current directory.
    ///
    /// # Errors
    /// The reason why the file cannot be read.
    fn table(&self, path: &Path) -> Result<String, String> {
        let length = std::fs::metadata(path).map_err(|error| error.to_string())?.len();
        if length > LONGEST_TABLE {
            return Err(format!("it has {length} bytes, at most {LONGEST_TABLE} are read"));
        }
        std::fs::read_to_string(path).map_err(|error| error.to_string())
    }
}

/// Most bytes of a table of sizes.
const LONGEST_TABLE: u64 = 4 << 20;

/// For scenes without recorded states: every file is an error.
#[derive(Debug, Clone, Copy, Default)]
pub struct NoStates;

impl StateSource for NoStates {
    fn state(&self, path: &Path, _index: i64) -> Result<State, String> {
        Err(format!("{}: no reader for state files is at hand", path.display()))
    }
}
