//! A validated scene.

use std::fmt;
use std::path::PathBuf;
use std::time::Duration;

use haff_engine::{Compressed, EventColumn, Options, System, critical_length, significant};
use haff_linkage::Joints;
use haff_mechanics::Restitution;

use crate::source::mesh::MeshFile;

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
    /// Each time that the particles have collided this often with each other, in all.
    Collisions(u64),
}

/// What [`RunPlan::until`] is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum UntilOf {
    /// `run.until`.
    Run,
    /// The time at which the box has the packing fraction `growth.until_packing_fraction`.
    PackingFraction,
    /// The time at which a box that is compressed is too short or too full to go on.
    Box,
}

/// The growth of the particles of a run, or the compression of its box, until they jam.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GrowthRun {
    /// Sphere–sphere collisions between two tests of the pressure.
    pub step: u64,
    /// What ends the run.
    pub end: Option<GrowthEnd>,
}

/// What ends a growth.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum GrowthEnd {
    /// A packing fraction, unless the particles jam before.
    PackingFraction(f64),
    /// The reduced pressure P V/(N T) over a step: at least this.
    ReducedPressure(f64),
    /// A time of a box that is compressed, unless the particles jam before.
    Compressed {
        /// That time [time].
        until: f64,
        /// The packing fraction that the box has then.
        packing_fraction: f64,
    },
}

/// Why a growth ends after a step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Grown {
    /// It has its reduced pressure.
    ReducedPressure,
    /// It jams before it has its packing fraction.
    Jammed,
}

impl GrowthRun {
    /// Packing fraction at which growth begins, at most, in two and three dimensions: that of a fluid, which
    /// forgets how it was placed.
    pub const FLUID: [f64; 2] = [0.65, 0.5];
    /// Collisions of a particle in a step: in the meantime the pressure grows by less than a half.
    const COLLISIONS: u64 = 10;
    /// Steps before the pressure counts: particles that have been pushed apart nearly touch at the start.
    const FIRST: u64 = 5;

    /// The growth of so many particles.
    #[must_use]
    pub fn new(particles: usize, end: Option<GrowthEnd>) -> Self {
        // A collision is one of two particles.
        Self { step: (Self::COLLISIONS * particles as u64).div_ceil(2), end }
    }

    /// Whether each step ends with a row of observables.
    #[must_use]
    pub fn has_rows(&self) -> bool {
        !matches!(self.end, Some(GrowthEnd::Compressed { .. }))
    }

    /// The number of collisions at the end of the step in which there have been so many. Steps begin at
    /// multiples, so that a run that is resumed has the same ones.
    #[must_use]
    pub fn next(&self, collisions: u64) -> u64 {
        (collisions / self.step + 1).saturating_mul(self.step)
    }

    /// Why the growth ends after the step that ends with so many collisions, if it does.
    #[must_use]
    pub fn grown(&self, last: &Compressed, collisions: u64) -> Option<Grown> {
        if collisions <= Self::FIRST * self.step {
            return None;
        }
        match self.end? {
            GrowthEnd::ReducedPressure(pressure) => {
                (last.reduced_pressure >= pressure).then_some(Grown::ReducedPressure)
            }
            GrowthEnd::PackingFraction(wanted) | GrowthEnd::Compressed { packing_fraction: wanted, .. } => {
                last.jamming().filter(|jamming| *jamming < wanted).map(|_| Grown::Jammed)
            }
        }
    }
}

/// Length of the run; the first bound that is reached ends it. At least one of `until` and `collisions` is
/// given.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RunPlan {
    /// Simulated time [time]. In a box that is compressed at most the time at which it cannot go on.
    pub until: Option<f64>,
    /// What that time is.
    pub until_of: UntilOf,
    /// Sphere–sphere collisions. `collisions_per_particle = C` is N·C/2 of them, rounded up, since each
    /// involves two particles.
    pub collisions: Option<u64>,
    /// Time on the clock.
    pub wall_time: Option<Duration>,
    /// The growth, if particles grow or can jam.
    pub growth: Option<GrowthRun>,
}

/// The last time at which a box that is compressed can be.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BoxLimit {
    /// When [time]; negative if the box is too small from the start.
    pub time: f64,
    /// Why not later.
    pub why: BoxTooSmall,
}

/// Why a box cannot become smaller.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum BoxTooSmall {
    /// An edge is as short as this [length], along this axis.
    Edge(usize, f64),
    /// The particles fill as much of it.
    PackingFraction(f64),
    /// Its upper wall along this axis touches the particle of this row, which is fixed.
    Body(usize, usize),
}

impl fmt::Display for BoxTooSmall {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = |axis: &usize| ["x", "y", "z"][*axis];
        match self {
            Self::Edge(axis, length) => {
                write!(out, "the edge along {} is only {} long", name(axis), significant(*length, 6))
            }
            Self::PackingFraction(fraction) => {
                write!(out, "the packing fraction is {}, the largest possible", significant(*fraction, 6))
            }
            Self::Body(axis, row) => write!(out, "wall \"{}+\" reaches the fixed particle {row}", name(axis)),
        }
    }
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
    /// The last time at which the box can be, if it is compressed.
    pub box_limit: Option<BoxLimit>,
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
    /// The triangles of the meshes of walls, as their files have them.
    pub meshes: Vec<MeshFile>,
}

impl Scene {
    /// Mean of 1 − e² over the pairs of species of a gas that cools freely with a constant e < 1.
    #[must_use]
    pub fn cooling_loss(&self) -> Option<f64> {
        critical_length(&self.system)?;
        let loss = |law: &Restitution| if let Restitution::Constant(e) = law { 1.0 - e * e } else { 0.0 };
        let laws = &self.system.contacts.pair;
        Some(laws.iter().map(loss).sum::<f64>() / laws.len() as f64)
    }
}
