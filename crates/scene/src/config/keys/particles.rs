//! Keys of the particles: `[[species]]`, `[[particle]]`, `[initial]`.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::config::whole::whole;

/// A kind of particle.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
#[schemars(extend("required" = ["name", "count", "radius"]))]
pub struct SpeciesConfig {
    /// Name, used by `contact.pair` and in output files.
    pub name: Option<String>,
    /// Number of particles at the start; 0 only for a species that an inlet lets in.
    #[serde(deserialize_with = "whole")]
    #[schemars(range(min = 0))]
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
    /// Where the particles are at the start: with all of their volume in one shape. Default: anywhere in the
    /// box. Needs `initial.positions = "random"`, which is the default then.
    pub region: Option<RegionConfig>,
}

/// A part of space: one of these.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RegionConfig {
    /// Lower and upper corner of a box [length].
    #[serde(rename = "box")]
    #[schemars(length(equal = 2))]
    pub cuboid: Option<Vec<Vec<f64>>>,
    /// The inside of a sphere; in two dimensions of a circle.
    pub sphere: Option<BallConfig>,
    /// The inside of a cylinder; in two dimensions of a circle.
    pub cylinder: Option<BarrelConfig>,
}

/// The inside of a sphere.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
#[schemars(extend("required" = ["center", "radius"]))]
pub struct BallConfig {
    /// Its center [length].
    #[schemars(length(min = 2, max = 3))]
    pub center: Option<Vec<f64>>,
    /// Its radius [length].
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub radius: Option<f64>,
}

/// The inside of a cylinder.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
#[schemars(extend("required" = ["point", "radius"]))]
pub struct BarrelConfig {
    /// A point of its axis [length]; if it has a `length`, the center of one end.
    #[schemars(length(min = 2, max = 3))]
    pub point: Option<Vec<f64>>,
    /// Direction of its axis; need not have unit length. In two dimensions default z: a circle.
    #[schemars(length(min = 2, max = 3))]
    pub axis: Option<Vec<f64>>,
    /// Its radius [length].
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub radius: Option<f64>,
    /// Its length along the axis [length]; default: without end.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub length: Option<f64>,
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
    /// `lattice` (default; the densest of the dimension), `fcc` (3D), `hexagonal` (2D), `random`,
    /// `{ packing = 0.6 }`: a dense random packing, or `{ file = "state.h5" }`: positions and velocities of
    /// the last frame of an output file.
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
    /// A random packing that grows to a stated packing fraction.
    Grown(GrownConfig),
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
    /// Sequential insertion, then pushed apart: up to 0.58 in 3D, 0.78 in 2D; denser ones are `{ packing =
    /// … }`.
    Random,
}

/// A dense random packing: the particles are placed in a larger box, which is compressed to this packing
/// fraction while they collide.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
#[schemars(extend("required" = ["packing"]))]
pub struct GrownConfig {
    /// Packing fraction; that of the box, which follows from it unless `domain.size` is given.
    #[schemars(range(max = 1.0), extend("exclusiveMinimum" = 0))]
    pub packing: Option<f64>,
}

/// A file with states, by its ending: an output file of haff, GSD, extended XYZ (`.xyz`, `.extxyz`), CSV, a
/// dump or a data file of LAMMPS (`.lammpstrj`, `.dump`, `.data`, `.lmp`), a data file of MercuryDPM
/// (`.data`) or a configuration of DynamO (`.xml`, `.xml.bz2`).
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
#[schemars(extend("required" = ["file"]))]
pub struct FileConfig {
    /// Path, relative to the current directory.
    pub file: Option<String>,
    /// Only where no file is named: that of [`GrownConfig`].
    #[serde(skip_serializing)]
    #[schemars(skip)]
    pub packing: Option<f64>,
    /// Which frame; from the end if negative. Default −1, the last.
    #[serde(deserialize_with = "whole")]
    pub index: Option<i64>,
    /// Edge lengths to which the box of the file is scaled [length], one per dimension: positions and radii
    /// are multiplied by their ratio, the same along all axes, velocities stay, and masses are those of the
    /// scene.
    #[schemars(length(min = 2, max = 3), inner(range(min = 0.0)))]
    pub scale_to: Option<Vec<f64>>,
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
