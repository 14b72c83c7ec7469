//! The scene file as written: every key optional, nothing checked beyond its type.
//!
//! The doc comments of this file are the descriptions of the JSON Schema that `haff schema` prints, so they
//! are written for users who write scenes. Missing, contradictory and out-of-range values are found in the
//! module `assemble`, which collects and locates all errors; serde only checks types.

mod contact;
mod deforming;
mod flow;
mod measure;
mod output;
mod particles;
mod walls;

use std::{collections::BTreeMap, time::Duration};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::config::{
    joints::{PendulumConfig, RodConfig, SpringConfig},
    named::add_names_of_drives,
    whole::whole,
};

pub use contact::*;
pub use deforming::*;
pub use flow::*;
pub use measure::*;
pub use output::*;
pub use particles::*;
pub use walls::*;

/// A scene of haff: the system, the length of the run, and its output. Units are the user's own and
/// consistent, with `k_B` = 1.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct SceneConfig {
    /// Version of the scene format: 1.
    #[schemars(range(min = 1, max = 1))]
    pub schema: Option<i64>,
    /// A description of the scene in one line.
    pub title: Option<String>,
    /// Seed of all random numbers; default 0.
    #[serde(deserialize_with = "whole")]
    #[schemars(range(min = 0))]
    pub seed: Option<i64>,
    /// 3: spheres in space (default). 2: disks in the plane z = 0.
    #[schemars(range(min = 2, max = 3))]
    pub dimension: Option<i64>,
    /// The box, its faces and gravity.
    pub domain: Option<DomainConfig>,
    /// Initial positions and velocities of the species.
    pub initial: Option<InitialConfig>,
    /// Contact laws.
    pub contact: Option<ContactConfig>,
    /// Algorithms of the engine; no choice changes the trajectory.
    pub engine: Option<EngineConfig>,
    /// How long to run: `until` and/or a number of collisions.
    pub run: Option<RunConfig>,
    /// Output.
    pub output: Option<OutputConfig>,
    /// Kinds of particles, placed by `[initial]`.
    pub species: Option<Vec<SpeciesConfig>>,
    /// Particles placed one by one, beside or instead of the species.
    pub particle: Option<Vec<ParticleConfig>>,
    /// Plane walls beside those of `domain.boundary`.
    pub wall: Option<Vec<WallConfig>>,
    /// What gives energy to the particles, or takes it, at stated times.
    pub drive: Option<Vec<DriveConfig>>,
    /// Where particles come in while the run goes on.
    pub inlet: Option<Vec<InletConfig>>,
    /// Where they are taken out.
    pub outlet: Option<Vec<OutletConfig>>,
    /// Growth of all particles, to dense packings.
    pub growth: Option<GrowthConfig>,
    /// Measurements while the run goes on.
    pub measure: Option<MeasureConfig>,
    /// Particles that hang on strings or rods from fixed points.
    pub pendulum: Option<Vec<PendulumConfig>>,
    /// Springs between particles, or between a particle and a point.
    pub spring: Option<Vec<SpringConfig>>,
    /// Rigid massless rods between particles.
    pub rod: Option<Vec<RodConfig>>,
}

/// The box [0, L) per axis.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct DomainConfig {
    /// Edge lengths [length], one per dimension. Along `open` axes a placeholder: where packings are put.
    #[schemars(length(min = 2, max = 3), inner(range(min = 0.0)))]
    pub size: Option<Vec<f64>>,
    /// Instead of `size`: a cube (2D: square) that the species fill to this fraction. Explicit particles do
    /// not count, so that adding one does not move the walls.
    #[schemars(range(max = 1.0), extend("exclusiveMinimum" = 0))]
    pub packing_fraction: Option<f64>,
    /// Per axis: `periodic`, `wall` or `open`. Default: periodic where the box has a size, open otherwise.
    #[schemars(length(min = 2, max = 3))]
    pub boundary: Option<Vec<BoundaryConfig>>,
    /// Common acceleration [length/time²]; zero along periodic axes. Default 0.
    #[schemars(length(min = 2, max = 3))]
    pub gravity: Option<Vec<f64>>,
    /// Simple shear of a box that is periodic along all axes (Lees–Edwards): the mean velocity along `flow`
    /// is `rate` times the coordinate along `gradient`.
    pub shear: Option<ShearConfig>,
    /// Compression or expansion of the box along axes that are not open. Along periodic axes the images move
    /// with the edges, and the mean velocity is −γ times the coordinate; along axes with walls the upper wall
    /// moves.
    pub compression: Option<BoxCompressionConfig>,
}

/// Simple shear.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
#[schemars(extend("required" = ["flow", "gradient", "rate"]))]
pub struct ShearConfig {
    /// Axis of the flow: `x`, `y` or `z`.
    #[schemars(extend("enum" = ["x", "y", "z"]))]
    pub flow: Option<String>,
    /// Axis along which the velocity grows; another one.
    #[schemars(extend("enum" = ["x", "y", "z"]))]
    pub gradient: Option<String>,
    /// Shear rate [1/time], of either sign.
    pub rate: Option<f64>,
    /// Displacement along the flow of the image across the upper face of the gradient axis at the start
    /// [length]. Default 0, or that of the file that the run starts from.
    pub offset: Option<f64>,
}

/// The boundary of the domain along one axis.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum BoundaryConfig {
    /// The domain repeats.
    Periodic,
    /// Walls at 0 and at L.
    Wall,
    /// Unbounded.
    Open,
}

/// A drive of the particles.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
#[schemars(extend("required" = ["kind"]))]
pub struct DriveConfig {
    /// What it does.
    pub kind: Option<DriveKindConfig>,
    /// Temperature that it drives to [energy].
    #[schemars(range(min = 0.0))]
    pub temperature: Option<f64>,
    /// Of white noise: variance that each component of a velocity gets in a unit of time [length²/time³].
    #[schemars(range(min = 0.0))]
    pub strength: Option<f64>,
    /// Time between actions \[time\].
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub interval: Option<f64>,
    /// Mean number of kicks of a particle in a unit of time [1/time].
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub rate: Option<f64>,
    /// Of a drag: the time constant τ of dv/dt = −v/τ \[time\].
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub time: Option<f64>,
    /// Names of the species that it acts on; default all, and a drag always acts on all. Bodies of infinite
    /// mass are never driven.
    #[schemars(length(min = 1))]
    pub species: Option<Vec<String>>,
    /// `true`: it drives the spins, too, each of their degrees of freedom as one of the translation. Rescale
    /// and Andersen: to the same temperature. White noise: the variance of each component grows by `strength`
    /// m/I. Drag: dω/dt = −ω/τ. Only with spin. Default false.
    pub rotational: Option<bool>,
    /// Of a drive that the program has from another crate: its parameters.
    pub parameters: Option<BTreeMap<String, serde_json::Value>>,
}

/// What a drive does.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
#[schemars(transform = add_names_of_drives)]
pub enum DriveKindConfig {
    /// Every `interval` all velocities relative to the center of mass of the driven particles are multiplied
    /// by one factor, such that their temperature is `temperature`. Between walls the observable
    /// `temperature` also contains the motion of the center of mass, about 1/N of it.
    Rescale,
    /// At Poisson times, `rate` for each particle, a particle gets a velocity of the Maxwell distribution of
    /// `temperature`.
    Andersen,
    /// Each component of a velocity gets normal random numbers: at Poisson times of mean `rate` for each
    /// particle, or for all particles at every `interval`, with their mean taken out. Either `rate` or
    /// `interval`.
    WhiteNoise,
    /// A drag on all particles: dv/dt = −v/τ between collisions, exactly. A particle that meets nothing stops
    /// after v τ. With white noise it is a bath of Langevin's equation: T = m ξ₀² τ/2 without collisions. Not
    /// with gravity, walls or bodies that move, or a box that deforms.
    Drag,
    /// The drive of a plug-in.
    #[serde(untagged)]
    #[schemars(skip)]
    Named(String),
}

impl DriveKindConfig {
    /// The name in scenes.
    pub(crate) fn name(&self) -> &str {
        match self {
            Self::Rescale => "rescale",
            Self::Andersen => "andersen",
            Self::WhiteNoise => "white_noise",
            Self::Drag => "drag",
            Self::Named(name) => name,
        }
    }
}

/// Algorithms of the engine; no choice changes the trajectory.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct EngineConfig {
    /// Neighbor search; default `auto`.
    pub neighbors: Option<NeighborsConfig>,
    /// Vector instructions of the prediction kernel; default `auto`.
    pub simd: Option<SimdConfig>,
    /// Number of blocks of space whose events are taken at the same time, with windows and lists;
    /// 1 for one event after the other. Default: that of threads, from 100,000 particles on.
    pub blocks: Option<i64>,
}

/// Neighbor search.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum NeighborsConfig {
    /// The engine chooses.
    Auto,
    /// Windows of time, for gases in closed boxes; an error for other scenes.
    Windows,
    /// A grid of cells.
    Cells,
    /// Neighbor lists.
    Lists,
    /// Every pair.
    AllPairs,
}

/// Vector instructions of the prediction kernel.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum SimdConfig {
    /// The best the processor has.
    Auto,
    /// 256-bit vectors.
    Avx2,
    /// Baseline instructions.
    Portable,
}

/// Length of the run. The first bound that is reached ends it.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RunConfig {
    /// Simulated time [time].
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub until: Option<f64>,
    /// Number of sphere–sphere collisions.
    #[serde(deserialize_with = "whole")]
    #[schemars(range(min = 1))]
    pub collisions: Option<i64>,
    /// Collisions per particle: C of them are N·C/2 collisions, since each involves two particles.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub collisions_per_particle: Option<f64>,
    /// Stop cleanly after this time on the clock: `"2h"`, `"90s"`, or a number of seconds. Resumable.
    pub wall_time: Option<WallTimeConfig>,
}

/// A duration on the clock.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
#[serde(untagged)]
pub enum WallTimeConfig {
    /// Seconds.
    Seconds(#[schemars(extend("exclusiveMinimum" = 0))] f64),
    /// Such as `2h 30m`.
    Text(String),
}

impl WallTimeConfig {
    /// The duration in either form; `None` if it is invalid.
    pub fn duration(&self) -> Option<Duration> {
        match self {
            Self::Seconds(seconds) => Duration::try_from_secs_f64(*seconds).ok(),
            Self::Text(text) => humantime::parse_duration(text).ok(),
        }
    }
}
