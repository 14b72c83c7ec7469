//! Keys of `[[wall]]`.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::config::{keys::contact::RestitutionConfig, named::names_of_surfaces};

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
