//! Keys of `[[inlet]]` and `[[outlet]]`.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::config::whole::whole;

/// A place where particles come in while the run goes on.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
#[schemars(extend("required" = ["box"]))]
pub struct InletConfig {
    /// Species of the particles, whose radii and masses are drawn as those of the start. With `refill` only
    /// particles of this species come back; default all.
    pub species: Option<String>,
    /// Lower and upper corner of a box [length]. Centers of new particles are at random in it, where they
    /// touch nothing; an entry without room is left out, and the particle comes at a later one.
    #[serde(rename = "box")]
    #[schemars(length(equal = 2))]
    pub cuboid: Option<Vec<Vec<f64>>>,
    /// Mean velocity [length/time]; default 0.
    #[schemars(length(min = 2, max = 3))]
    pub velocity: Option<Vec<f64>>,
    /// Temperature of the velocities relative to `velocity` [energy]; default 0.
    #[schemars(range(min = 0.0))]
    pub temperature: Option<f64>,
    /// Mean number of particles in a unit of time, at Poisson times [1/time]. Either this or `refill`.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub rate: Option<f64>,
    /// true: the particles that outlets take out come in again. Either this or `rate`.
    pub refill: Option<bool>,
    /// Number of particles that come in at most. With `rate` necessary: files have a place for each of them;
    /// default with `refill`: no limit.
    #[serde(deserialize_with = "whole")]
    #[schemars(range(min = 1))]
    pub count: Option<i64>,
}

/// A place where particles are taken out.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
#[schemars(extend("required" = ["box"]))]
pub struct OutletConfig {
    /// Lower and upper corner of a box [length]. Particles of finite mass with their centers in it are taken
    /// out.
    #[serde(rename = "box")]
    #[schemars(length(equal = 2))]
    pub cuboid: Option<Vec<Vec<f64>>>,
    /// Time between two searches of the box [time]; default a quarter of that in which the fastest particle
    /// crosses it.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub interval: Option<f64>,
}
