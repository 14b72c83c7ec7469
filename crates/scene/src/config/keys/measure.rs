//! Keys of `[measure]`.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::config::{named::names_of_probes, whole::whole};

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
    /// Collisions per time by pair of species, and the mean free time of each species, as means since the
    /// previous sample: `observables/pair_collision_rate` and `observables/species_mean_free_time`.
    pub pair_collisions: Option<bool>,
    /// Profiles along an axis, or on a grid: density, velocity, temperature and pressure tensor.
    pub profiles: Option<Vec<ProfileConfig>>,
    /// The mean square displacement by lag: `correlations/msd`. `true`: of all particles together; or with a
    /// curve for each of some species.
    pub msd: Option<FollowedConfig>,
    /// The autocorrelation of velocities by lag: `correlations/vacf`, as `msd`.
    pub vacf: Option<FollowedConfig>,
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
    /// `"each"`, or names of species: they have fields of their own, too, `species_density` and so on.
    /// Default none.
    pub species: Option<SpeciesChoice>,
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

/// Whose displacements or velocities are followed.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
#[serde(untagged)]
pub enum FollowedConfig {
    /// Of all particles together, or of none.
    All(bool),
    /// Of some species.
    Species(FollowedSpeciesConfig),
}

impl FollowedConfig {
    /// Whether anything is followed.
    pub(crate) fn any(&self) -> bool {
        !matches!(self, Self::All(false))
    }
}

/// `{ species = ["tracer"] }`, or `{ species = "each" }`.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
#[schemars(extend("required" = ["species"]))]
pub struct FollowedSpeciesConfig {
    /// `"each"`, or names of species: each has a curve of its own.
    pub species: Option<SpeciesChoice>,
}

/// Some species.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
#[serde(untagged)]
pub enum SpeciesChoice {
    /// `"each"`: all of finite mass.
    Each(#[schemars(extend("enum" = ["each"]))] String),
    /// Their names.
    Names(#[schemars(length(min = 1))] Vec<String>),
}
