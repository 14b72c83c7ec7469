//! The scene file as written: every key optional, nothing checked beyond its type.
//!
//! The doc comments of this file are the descriptions of the JSON Schema that `haff schema` prints, so they
//! are written for users who write scenes. Missing, contradictory and out-of-range values are found in the
//! module `assemble`, which collects and locates all errors; serde only checks types.

use std::{collections::BTreeMap, time::Duration};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::{
    config::{
        joints::{PendulumConfig, RodConfig, SpringConfig},
        whole::whole,
    },
    plugins::{drive_names, law_names, probe_names, surface_names},
};

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

/// A kind of particle.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
#[schemars(extend("required" = ["name", "count", "radius"]))]
pub struct SpeciesConfig {
    /// Name, used by `contact.pair` and in output files.
    pub name: Option<String>,
    /// Number of particles.
    #[serde(deserialize_with = "whole")]
    #[schemars(range(min = 1))]
    pub count: Option<i64>,
    /// Radius [length]: a number or a distribution. At least 2⁻⁴² of the largest coordinate: below that,
    /// rounding would decide which particles touch.
    pub radius: Option<RadiusConfig>,
    /// Mass [mass]; `inf` for fixed bodies. Either this or `density`.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub mass: Option<f64>,
    /// Mass per volume [mass/length³], in 2D per area [mass/length²]. Either this or `mass`.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub density: Option<f64>,
    /// Granular temperature of this species at the start [energy]; default `initial.temperature`.
    #[schemars(range(min = 0.0))]
    pub temperature: Option<f64>,
    /// q = I/(m R²), the moment of inertia: default 2/5 for spheres, 1/2 for disks. Only with spin.
    #[schemars(range(max = 1.0), extend("exclusiveMinimum" = 0))]
    pub inertia: Option<f64>,
}

/// One radius for all, or a distribution.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
#[serde(untagged)]
#[expect(clippy::large_enum_variant, reason = "one for each species")]
pub enum RadiusConfig {
    /// The same radius for every particle [length].
    Fixed(#[schemars(extend("exclusiveMinimum" = 0))] f64),
    /// Drawn per particle.
    Distribution(RadiusDistribution),
}

/// A distribution of radii: `{ uniform = [a, b] }`, `{ normal = [mean, sd], min = …, max = … }`, the same
/// with `lognormal` or `schulz`, `{ power = [min, max, exponent] }`, `{ list = […] }`, or `{ table =
/// "sizes.csv" }`.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RadiusDistribution {
    /// Uniform between the two values [length].
    #[schemars(length(equal = 2))]
    pub uniform: Option<Vec<f64>>,
    /// Normal with this mean and standard deviation [length].
    #[schemars(length(equal = 2))]
    pub normal: Option<Vec<f64>>,
    /// Lognormal: the radius has this mean and standard deviation [length].
    #[schemars(length(equal = 2))]
    pub lognormal: Option<Vec<f64>>,
    /// Distribution of Schulz (a gamma distribution) with this mean and standard deviation [length].
    #[schemars(length(equal = 2))]
    pub schulz: Option<Vec<f64>>,
    /// Smallest and largest radius [length], and the exponent a of the density R^a between them.
    #[schemars(length(equal = 3))]
    pub power: Option<Vec<f64>>,
    /// The radii of the particles in turn [length]; after the last one the first one again.
    pub list: Option<Vec<f64>>,
    /// Measured sizes, drawn by their weights: the path of a CSV file with a radius in each line [length], or
    /// a radius and its weight; or `{ radii = […], weights = […] }`.
    pub table: Option<SizeTableConfig>,
    /// Smallest radius of `normal`, `lognormal` and `schulz` [length]; default a tenth of the mean.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub min: Option<f64>,
    /// Largest radius of `normal`, `lognormal` and `schulz` [length]; default none.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub max: Option<f64>,
}

/// A table of sizes.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
#[serde(untagged)]
pub enum SizeTableConfig {
    /// Path of a CSV file, relative to the current directory.
    File(String),
    /// The table itself.
    Values(SizesConfig),
}

/// Radii and their weights.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
#[schemars(extend("required" = ["radii"]))]
pub struct SizesConfig {
    /// Radii [length].
    #[schemars(length(min = 1))]
    pub radii: Option<Vec<f64>>,
    /// How often each is drawn, relative to the sum; default all the same.
    pub weights: Option<Vec<f64>>,
}

/// How the particles of the species start.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct InitialConfig {
    /// `lattice` (default; the densest of the dimension), `fcc` (3D), `hexagonal` (2D), `random`, or
    /// `{ file = "state.h5" }`: positions and velocities of the last frame of an output file.
    pub positions: Option<PositionsConfig>,
    /// Granular temperature T = Σ m v²/(dN) of the species [energy]; Maxwell velocities, shifted to zero
    /// momentum (a single particle is not) and rescaled to T exactly. Default 1; with positions from a file,
    /// the file's velocities are kept unless a temperature is given.
    #[schemars(range(min = 0.0))]
    pub temperature: Option<f64>,
    /// Rotational temperature Σ I ω²/(r N) of the species [energy], with r = 3 axes of rotation, 1 in two
    /// dimensions; exactly. Default 0, or the angular velocities of the file.
    #[schemars(range(min = 0.0))]
    pub rotational_temperature: Option<f64>,
}

/// Where the particles of the species start.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
#[serde(untagged)]
pub enum PositionsConfig {
    /// A packing made here.
    Packing(PackingConfig),
    /// The last frame of a file.
    File(FileConfig),
}

/// A packing.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum PackingConfig {
    /// fcc in 3D, hexagonal in 2D.
    Lattice,
    /// Face-centred cubic, up to a packing fraction of 0.74.
    Fcc,
    /// Triangular, up to 0.907.
    Hexagonal,
    /// Sequential insertion, then growth: up to 0.5 in 3D, 0.7 in 2D.
    Random,
}

/// A file with states: an output file of haff, GSD, extended XYZ (`.xyz`, `.extxyz`) or CSV.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
#[schemars(extend("required" = ["file"]))]
pub struct FileConfig {
    /// Path, relative to the current directory.
    pub file: Option<String>,
    /// Which frame; from the end if negative. Default −1, the last.
    #[serde(deserialize_with = "whole")]
    pub index: Option<i64>,
}

/// A particle placed by hand.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
#[schemars(extend("required" = ["radius"]))]
pub struct ParticleConfig {
    /// Name, default `particle`; particles of one name share their contact rules.
    pub name: Option<String>,
    /// Centre [length]; may be left out if the `angle` of a pendulum or rod places the particle.
    #[schemars(length(min = 2, max = 3))]
    pub position: Option<Vec<f64>>,
    /// Velocity [length/time]; default 0.
    #[schemars(length(min = 2, max = 3))]
    pub velocity: Option<Vec<f64>>,
    /// Angular velocity [1/time], three numbers; in two dimensions one, or three of which the first two are
    /// 0. Default 0.
    #[schemars(length(min = 1, max = 3))]
    pub angular_velocity: Option<Vec<f64>>,
    /// q = I/(m R²), the moment of inertia: default 2/5 for spheres, 1/2 for disks. Only with spin; the same
    /// for all particles of one name.
    #[schemars(range(max = 1.0), extend("exclusiveMinimum" = 0))]
    pub inertia: Option<f64>,
    /// Radius [length]; at least 2⁻⁴² of the largest coordinate.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub radius: Option<f64>,
    /// Mass [mass]; `inf` for a body that is fixed or, with a velocity, driven. Either this or `density`.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub mass: Option<f64>,
    /// Mass per volume [mass/length³], in 2D per area [mass/length²]. Either this or `mass`.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub density: Option<f64>,
}

/// Contact laws. Precedence: `contact.pair`, then the wall's own, then `wall_restitution`, then
/// `restitution`.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ContactConfig {
    /// Coefficient of restitution; default 1, elastic.
    pub restitution: Option<RestitutionConfig>,
    /// The same for walls; default `restitution`.
    pub wall_restitution: Option<RestitutionConfig>,
    /// Coefficient of tangential restitution β of rough contacts, in [−1, 1]: −1 smooth, 1 perfectly rough.
    /// Default −1.
    #[schemars(range(min = -1.0, max = 1.0))]
    pub tangential_restitution: Option<f64>,
    /// Coulomb's coefficient of friction μ, which bounds the tangential impulse of a rough contact by μ times
    /// the normal one. Default none: no bound.
    #[schemars(range(min = 0.0))]
    pub friction: Option<f64>,
    /// Contact duration of the TC model [time]: contacts sooner than this after the last one are elastic.
    /// 0, the default, turns it off.
    #[schemars(range(min = 0.0))]
    pub tc: Option<f64>,
    /// Speed v of grains that come to rest, where gravity g acts [length/time]. A grain slower than v/2 that
    /// is supported by walls and other grains is put to rest, and wakes when it is hit faster than v; of
    /// contacts that follow another within 10 v/g, those slower than v/8 are elastic. 0, the default: never.
    /// Try 0.05 √(g d), d the smallest diameter.
    #[schemars(range(min = 0.0))]
    pub rest_speed: Option<f64>,
    /// Rules for two names.
    pub pair: Option<Vec<PairConfig>>,
}

/// The contact rule of two names.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
#[schemars(extend("required" = ["between"]))]
pub struct PairConfig {
    /// Two names of species, particles or walls (not two walls).
    #[schemars(length(equal = 2))]
    pub between: Option<Vec<String>>,
    /// Coefficient of restitution. Either this or `sticks`; default that of `[contact]` if the entry makes
    /// the contact rough.
    pub restitution: Option<RestitutionConfig>,
    /// Coefficient of tangential restitution β of rough contacts, in [−1, 1]: −1 smooth, 1 perfectly rough.
    /// Default `contact.tangential_restitution`.
    #[schemars(range(min = -1.0, max = 1.0))]
    pub tangential_restitution: Option<f64>,
    /// Coulomb's coefficient of friction μ, which bounds the tangential impulse of a rough contact by μ times
    /// the normal one. Default `contact.friction`.
    #[schemars(range(min = 0.0))]
    pub friction: Option<f64>,
    /// `true`: two particles stick together, or a particle to a wall (adhesive, plastic): all components of
    /// their relative velocity are lost, and they move on as one body. With restitution 0 they stay in
    /// contact, but slide along each other. Default false.
    pub sticks: Option<bool>,
}

/// A number in [0, 1] or a law of the approach speed.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
#[serde(untagged)]
pub enum RestitutionConfig {
    /// The same at every approach speed.
    Constant(#[schemars(range(min = 0.0, max = 1.0))] f64),
    /// Depends on the approach speed.
    Model(RestitutionModelConfig),
}

/// `{ model = "viscoelastic", coefficient = … }`, `{ model = "cutoff", restitution = …, speed = …, exponent =
/// … }`, a measured table `{ speeds = […], values = […] }`, or a law of another crate.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RestitutionModelConfig {
    /// The law, if there is no table: `viscoelastic` (viscoelastic spheres, e = 1 − 1.15344 δ + …, δ =
    /// coefficient · v^(1/5)), `cutoff` (constant above a speed, tending to 1 below), or one that the program
    /// was built with.
    #[schemars(schema_with = "names_of_laws")]
    pub model: Option<String>,
    /// Parameters of a law that the program was built with.
    pub parameters: Option<BTreeMap<String, serde_json::Value>>,
    /// Table: increasing approach speeds [length/time].
    #[schemars(inner(range(min = 0.0)))]
    pub speeds: Option<Vec<f64>>,
    /// Table: the restitution at each of these speeds, in [0, 1]; linear between them, constant beyond.
    #[schemars(inner(range(min = 0.0, max = 1.0)))]
    pub values: Option<Vec<f64>>,
    /// viscoelastic: δ at unit approach speed [(time/length)^(1/5)].
    #[schemars(range(min = 0.0))]
    pub coefficient: Option<f64>,
    /// cutoff: restitution at and above the cut-off speed.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub restitution: Option<f64>,
    /// cutoff: approach speed [length/time] below which e rises to 1.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub speed: Option<f64>,
    /// cutoff: e = 1 − (1 − restitution)(v/speed)^exponent below; default 0.75.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub exponent: Option<f64>,
}

/// The schema of a name; of any, if there is none: an empty choice is not valid in some drafts.
fn one_of(names: &[&str]) -> schemars::Schema {
    if names.is_empty() {
        return schemars::json_schema!({ "type": "string" });
    }
    schemars::json_schema!({ "type": "string", "enum": names })
}

/// The schema of the name of a law of restitution.
fn names_of_laws(_: &mut schemars::SchemaGenerator) -> schemars::Schema {
    one_of(&law_names())
}

/// The schema of the name of a surface.
fn names_of_surfaces(_: &mut schemars::SchemaGenerator) -> schemars::Schema {
    one_of(&surface_names())
}

/// The schema of the name of a probe.
fn names_of_probes(_: &mut schemars::SchemaGenerator) -> schemars::Schema {
    one_of(&probe_names())
}

/// Adds the drives of plug-ins to the schema of those of haff.
fn add_names_of_drives(schema: &mut schemars::Schema) {
    if !drive_names().is_empty()
        && let Some(choices) = schema.get_mut("anyOf").and_then(serde_json::Value::as_array_mut)
    {
        choices.push(serde_json::json!({ "type": "string", "enum": drive_names() }));
    }
}

/// A plane wall; it fills the half-space behind it.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
#[schemars(extend("required" = ["name"]))]
pub struct WallConfig {
    /// Name, used by `contact.pair`. The name of a wall of `domain.boundary` (`x-`, `x+`, `y-`, …) without a
    /// shape sets that wall's properties.
    pub name: Option<String>,
    /// Its plane.
    pub plane: Option<PlaneConfig>,
    /// Instead of a plane, a surface that the program has from another crate.
    #[schemars(schema_with = "names_of_surfaces")]
    pub surface: Option<String>,
    /// Parameters of the surface.
    pub parameters: Option<BTreeMap<String, serde_json::Value>>,
    /// Restitution of contacts with this wall; default `contact.wall_restitution`.
    pub restitution: Option<RestitutionConfig>,
    /// Coefficient of tangential restitution β of rough contacts, in [−1, 1]: −1 smooth, 1 perfectly rough.
    /// Default `contact.tangential_restitution`.
    #[schemars(range(min = -1.0, max = 1.0))]
    pub tangential_restitution: Option<f64>,
    /// Coulomb's coefficient of friction μ, which bounds the tangential impulse of a rough contact by μ times
    /// the normal one. Default `contact.friction`.
    #[schemars(range(min = 0.0))]
    pub friction: Option<f64>,
    /// `true`: all particles stick to this wall, except those with a `contact.pair`. Default false.
    pub sticks: Option<bool>,
    /// Temperature of a thermal wall \[energy\], which particles leave with velocities of that temperature.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub temperature: Option<f64>,
    /// Probability that a reflection from a thermal wall is thermal; default 1. Otherwise
    /// `contact.wall_restitution` applies.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub accommodation: Option<f64>,
    /// Velocity of the wall [length/time]; default 0. In a run that goes on the wall moves so from where it
    /// is; zero stops it there, also an oscillation.
    #[schemars(length(min = 2, max = 3))]
    pub velocity: Option<Vec<f64>>,
    /// Time at which a wall with a velocity goes through its `plane.point` [time]; default 0. Set when a run
    /// goes on with another velocity.
    pub reference_time: Option<f64>,
    /// Displacement of a wall of `domain.boundary` from its face, to the inside [length]; default 0. Set when
    /// a run goes on with another amplitude. Other walls have their `plane.point`.
    pub displacement: Option<f64>,
    /// Oscillation along the normal; also of a wall of `domain.boundary`.
    pub motion: Option<MotionConfig>,
}

/// The oscillation of a wall: a shift along its normal, about its given position.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
#[schemars(extend("required" = ["kind", "amplitude", "frequency"]))]
pub struct MotionConfig {
    /// Form of the shift.
    pub kind: Option<MotionKindConfig>,
    /// Largest shift A [length].
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub amplitude: Option<f64>,
    /// Cycles in a unit of time, f [1/time].
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub frequency: Option<f64>,
    /// Phase at time 0 [radians]; default 0, in a run that goes on the phase that the wall has.
    pub phase: Option<f64>,
}

/// Form of an oscillation.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum MotionKindConfig {
    /// A sin(2π f t + phase)
    Sine,
    /// Between ±A at the constant speed 4 A f, in phase with the sine.
    Triangle,
}

impl WallConfig {
    /// Whether the entry is for the wall of the boundary that has this name.
    pub(crate) fn names_boundary(&self, name: &str) -> bool {
        let is_boundary = name.len() == 2 && "xyz".contains(&name[..1]) && "-+".contains(&name[1..]);
        self.plane.is_none() && self.surface.is_none() && is_boundary && self.name.as_deref() == Some(name)
    }
}

/// A plane.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
#[schemars(extend("required" = ["point", "normal"]))]
pub struct PlaneConfig {
    /// A point of the plane [length]: of a wall with a velocity at its `reference_time`, of one that
    /// oscillates at its mean position.
    #[schemars(length(min = 2, max = 3))]
    pub point: Option<Vec<f64>>,
    /// Normal to the inside, where the particles are; need not have unit length. Its components along
    /// periodic axes must be exactly 0, so that the plane repeats with the box.
    #[schemars(length(min = 2, max = 3))]
    pub normal: Option<Vec<f64>>,
    /// A round hole; in two dimensions a gap. The plane is then a partition, with particles on both sides.
    pub hole: Option<HoleConfig>,
    /// `true`: a partition without a hole. Default false: behind the plane is nothing.
    #[serde(rename = "two-sided")]
    pub two_sided: Option<bool>,
}

/// A hole in a plane.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
#[schemars(extend("required" = ["center", "radius"]))]
pub struct HoleConfig {
    /// Its center, a point of the plane [length].
    #[schemars(length(min = 2, max = 3))]
    pub center: Option<Vec<f64>>,
    /// Its radius [length], larger than that of every particle.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub radius: Option<f64>,
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
    /// Names of the species that it acts on; default all. Bodies of infinite mass are never driven.
    #[schemars(length(min = 1))]
    pub species: Option<Vec<String>>,
    /// Of a drive that the program has from another crate: its parameters.
    pub parameters: Option<BTreeMap<String, serde_json::Value>>,
}

/// Measurements while the run goes on. All are off by default, and free when off.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct MeasureConfig {
    /// The pressure tensor, as the mean since the previous sample: `observables/pressure_tensor` and its
    /// parts.
    pub stress: Option<bool>,
    /// The force of the particles on each wall and the heat that it gives to them, as means since the
    /// previous sample: `observables/wall_force` and `observables/wall_heat_flow`.
    pub wall_forces: Option<bool>,
    /// Profiles along an axis, or on a grid: density, velocity, temperature and pressure tensor.
    pub profiles: Option<Vec<ProfileConfig>>,
    /// The mean square displacement by lag: `correlations/msd`.
    pub msd: Option<bool>,
    /// The autocorrelation of velocities by lag: `correlations/vacf`.
    pub vacf: Option<bool>,
    /// The autocorrelation of the pressure tensor by lag, and the mean square of its integral:
    /// `correlations/stress` and `correlations/helfand`.
    pub stress_correlation: Option<bool>,
    /// Shortest lag of correlations [time]; default `output.observables`.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub interval: Option<f64>,
    /// Largest number of particles whose displacements and velocities are followed; of more, this many are
    /// chosen at equal distances in their order. Each needs up to 6 kB. Default 20000.
    #[serde(deserialize_with = "whole")]
    #[schemars(range(min = 1))]
    pub tracers: Option<i64>,
    /// Probes that the program has from other crates: their columns are in `observables`.
    pub probes: Option<Vec<ProbeConfig>>,
}

/// A probe that the program has from another crate.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
#[schemars(extend("required" = ["kind"]))]
pub struct ProbeConfig {
    /// Which one.
    #[schemars(schema_with = "names_of_probes")]
    pub kind: Option<String>,
    /// Its parameters.
    pub parameters: Option<BTreeMap<String, serde_json::Value>>,
}

/// A profile: means over the cells of a grid and over intervals of time.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
#[schemars(extend("required" = ["axis", "bins", "interval"]))]
pub struct ProfileConfig {
    /// One axis, such as `"z"`, or the letters of two or three for a grid, such as `"xz"`.
    pub axis: Option<String>,
    /// Number of cells along the axis, or one number for each axis.
    pub bins: Option<BinsConfig>,
    /// Time between rows [time].
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub interval: Option<f64>,
    /// Number of states in the mean of each row; default 10. Contacts count all.
    #[serde(deserialize_with = "whole")]
    #[schemars(range(min = 1))]
    pub samples: Option<i64>,
    /// `true` (default): the states are at random times, one in each part of the interval, so that no
    /// oscillation of a wall, nor a drive, is always met at the same phase. `false`: at equal times, the last
    /// one at the end of the interval.
    pub spread: Option<bool>,
    /// The range that the cells divide [length], two numbers for each axis; default the box. An open axis
    /// needs it.
    #[schemars(length(min = 2, max = 6))]
    pub range: Option<Vec<f64>>,
}

/// Numbers of cells.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
#[serde(untagged)]
pub enum BinsConfig {
    /// The same along all axes.
    Each(#[schemars(range(min = 1.0))] f64),
    /// One for each axis.
    PerAxis(#[schemars(length(min = 1, max = 3))] Vec<f64>),
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

/// Output.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct OutputConfig {
    /// Path of the HDF5 file, relative to the current directory; `false` or left out: none. Not that of the
    /// scene, nor of the state file it starts from.
    pub file: Option<OutputFileConfig>,
    /// Simulated time between trajectory frames, or `{ log = [first, factor] }`, or `false`. Default:
    /// `until`/100.
    pub frames: Option<ScheduleConfig>,
    /// The same for observables. Default: `until`/1000.
    pub observables: Option<ScheduleConfig>,
    /// `true`: record every event, in a row of about 80 bytes; `{ columns = [...] }`: of every event only
    /// these columns. `["i", "j"]` makes rows of about 11 bytes, `["i", "j", "energy_loss"]` of 18. Default
    /// `false`.
    pub events: Option<EventsConfig>,
    /// Simulated time between checkpoints. Default: `until`/10.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub checkpoint: Option<f64>,
    /// Of frames and of the event log: `deflate` (default), about a sixth smaller, or `none`, which halves
    /// the work of writing them and is faster to read.
    pub compression: Option<CompressionConfig>,
}

/// Columns of the event log.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
#[serde(untagged)]
pub enum EventsConfig {
    /// `true`: all columns. `false`: nothing.
    All(bool),
    /// Some columns.
    Some(EventColumnsConfig),
}

/// Some columns of the event log.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
#[schemars(extend("required" = ["columns"]))]
pub struct EventColumnsConfig {
    /// Names of columns, each once. The time is always recorded.
    #[schemars(length(min = 1))]
    pub columns: Option<Vec<EventColumnConfig>>,
}

/// A column of the event log.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum EventColumnConfig {
    /// Time of the event [time].
    Time,
    /// Kind: `collision`, `wall`, `rest`; with joints also `slack`, `taut`, `release`, `stick`, `lift`,
    /// `settle`.
    Kind,
    /// Row of the particle.
    I,
    /// Row of its partner, or index of the wall.
    J,
    /// Normal component of the relative velocity before [length/time].
    ApproachSpeed,
    /// Impulse [mass·length/time].
    Impulse,
    /// Kinetic energy lost [energy].
    EnergyLoss,
    /// Carnot's energy [energy].
    CarnotEnergy,
    /// Unit vector from i to j, or into the wall.
    Normal,
    /// Point of contact [length].
    Position,
    /// Impulse on j, or on the wall, with its tangential component [mass·length/time].
    ImpulseVector,
    /// The part of the energy loss by the tangential impulse [energy].
    TangentialLoss,
}

/// Compression of datasets.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum CompressionConfig {
    /// Shuffle and deflate, without loss; every HDF5 reader supports them.
    Deflate,
    /// Uncompressed.
    None,
}

/// A path, or `false` for no file.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
#[serde(untagged)]
pub enum OutputFileConfig {
    /// Path of the file.
    Path(String),
    /// `false`: no file.
    Off(#[schemars(extend("const" = false))] bool),
}

/// Times of records.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
#[serde(untagged)]
pub enum ScheduleConfig {
    /// Simulated time between two records [time].
    Every(#[schemars(extend("exclusiveMinimum" = 0))] f64),
    /// At logarithmic intervals.
    Log(LogConfig),
    /// `false`: never.
    Off(#[schemars(extend("const" = false))] bool),
}

/// Records at first · factor^k, k = 0, 1, ….
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
#[schemars(extend("required" = ["log"]))]
pub struct LogConfig {
    /// `[first, factor]`: first time [time] > 0 and factor > 1.
    #[schemars(length(equal = 2))]
    pub log: Option<Vec<f64>>,
}
