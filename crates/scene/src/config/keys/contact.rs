//! Keys of `[contact]`.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::config::named::names_of_laws;

/// Contact laws. Precedence: `contact.pair`, then the wall's own, then `wall_restitution`, then
/// `restitution`.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ContactConfig {
    /// Coefficient of restitution; default 1, elastic.
    pub restitution: Option<RestitutionConfig>,
    /// The same for walls; default `restitution`.
    pub wall_restitution: Option<RestitutionConfig>,
    /// Speed Δ ≥ 0 of the Δ model [length/time]: each contact adds 2 Δ to the speed of separation. Default
    /// 0, for contacts of particles and with walls.
    #[schemars(range(min = 0.0))]
    pub added_speed: Option<f64>,
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
    /// Speed Δ ≥ 0 of the Δ model [length/time]: each contact adds 2 Δ to the speed of separation. Default
    /// `contact.added_speed`.
    #[schemars(range(min = 0.0))]
    pub added_speed: Option<f64>,
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
    Model(Box<RestitutionModelConfig>),
}

/// `{ model = "viscoelastic", coefficient = … }`, `{ model = "cutoff", restitution = …, speed = …, exponent =
/// … }`, `{ model = "random", … }` (drawn anew in each contact), a measured table `{ speeds = […], values =
/// […] }`, or a law of another crate.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RestitutionModelConfig {
    /// The law, if there is no table: `viscoelastic` (viscoelastic spheres, e = 1 − 1.15344 δ + …, δ =
    /// coefficient · v^(1/5)), `cutoff` (constant above a speed, tending to 1 below), `random` (drawn anew in
    /// each contact from `uniform`, `normal` or `values`), or one that the program was built with.
    #[schemars(schema_with = "names_of_laws")]
    pub model: Option<String>,
    /// Parameters of a law that the program was built with.
    pub parameters: Option<BTreeMap<String, serde_json::Value>>,
    /// Table: increasing approach speeds [length/time].
    #[schemars(inner(range(min = 0.0)))]
    pub speeds: Option<Vec<f64>>,
    /// Table: the restitution at each of these speeds, in [0, 1]; linear between them, constant beyond.
    /// random: each contact has one of these, all equally probable.
    #[schemars(inner(range(min = 0.0, max = 1.0)))]
    pub values: Option<Vec<f64>>,
    /// random: the restitution is uniform between these two, in [0, 1].
    #[schemars(length(equal = 2), inner(range(min = 0.0, max = 1.0)))]
    pub uniform: Option<Vec<f64>>,
    /// random: mean and standard deviation of a normal distribution that is cut off outside of [0, 1].
    #[schemars(length(equal = 2), inner(range(min = 0.0, max = 1.0)))]
    pub normal: Option<Vec<f64>>,
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
