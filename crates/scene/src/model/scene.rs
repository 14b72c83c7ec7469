//! A validated scene.

use std::path::PathBuf;
use std::time::Duration;

use haff_engine::{EventColumn, Options, System};
use haff_linkage::Joints;

/// Times of records, beside the start and the end.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Schedule {
    /// Never.
    Off,
    /// At k·Δ, k = 0, 1, … [time].
    Every(f64),
    /// At first · factor^k, k = 0, 1, ….
    Log {
        /// First time > 0 [time].
        first: f64,
        /// Factor > 1.
        factor: f64,
    },
}

/// Length of the run; the first bound that is reached ends it. At least one of `until` and `collisions` is
/// given.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RunPlan {
    /// Simulated time [time].
    pub until: Option<f64>,
    /// Sphere–sphere collisions. `collisions_per_particle = C` is N·C/2 of them, rounded up, since each
    /// involves two particles.
    pub collisions: Option<u64>,
    /// Time on the clock.
    pub wall_time: Option<Duration>,
}

/// Output of the run.
///
/// Defaults with `run.until`: frames every until/100, observables every until/1000, checkpoints every
/// until/10. Without it, the length of the run is known only for an elastic gas, where kinetic theory
/// predicts it and replaces `until`; otherwise frames and observables are logarithmic in time, beginning at a
/// tenth of the mean free time (or of the time to cross the box), and there is no periodic checkpoint.
#[derive(Debug, Clone, PartialEq)]
pub struct OutputPlan {
    /// HDF5 file, relative to the current directory.
    pub file: Option<PathBuf>,
    /// Trajectory frames.
    pub frames: Schedule,
    /// Observable samples.
    pub observables: Schedule,
    /// Columns of the event log in the order of files, the time first; empty: events are not recorded.
    pub events: Vec<EventColumn>,
    /// Whether frames and the event log are compressed.
    pub compressed: bool,
    /// Time between checkpoints [time].
    pub checkpoint: Option<f64>,
}

/// A scene that has passed every check.
#[derive(Debug, Clone, PartialEq)]
pub struct Scene {
    /// Description in one line; the file's name if the scene has no title.
    pub title: String,
    /// Seed of all random numbers.
    pub seed: u64,
    /// The state file that the species start from, as written in the scene.
    pub state_file: Option<PathBuf>,
    /// Particles, walls, contact rules and domain.
    pub system: System,
    /// Pendulums, springs, rods and contacts that stick; empty for a scene of the granular engine.
    pub joints: Joints,
    /// Algorithms of the engine.
    pub options: Options,
    /// Length of the run.
    pub run: RunPlan,
    /// Output of the run.
    pub output: OutputPlan,
    /// The scene with every default and override written out, as TOML text that parses to this scene again. A
    /// state file is still referred to by its path.
    pub resolved: String,
    /// Volume of all particles over that of the box; NaN with open axes.
    pub packing_fraction: f64,
    /// Collisions per particle and time at the start by Enskog's theory of a homogeneous fluid with Maxwell
    /// velocities [1/time], mixtures of spheres by their mean pair; NaN without a volume, without motion, and
    /// for one particle. Where [`Self::rate_unknown`] is a reason, it is a guess of the order of magnitude.
    pub collision_rate: f64,
    /// Why that theory does not apply to the scene.
    pub rate_unknown: Option<&'static str>,
}
