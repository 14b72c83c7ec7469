//! Joints of particles in a scene file: `[[pendulum]]`, `[[spring]]`, `[[rod]]`.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A particle at the end of a massless string or rod whose other end does not move.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
#[schemars(extend("required" = ["pivot", "bob"]))]
pub struct PendulumConfig {
    /// Name, for messages.
    pub name: Option<String>,
    /// The end that does not move [length].
    #[schemars(length(min = 2, max = 3))]
    pub pivot: Option<Vec<f64>>,
    /// From the pivot to the center of the bob [length]; default: their distance at the start.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub length: Option<f64>,
    /// Name of the particle that hangs on it.
    pub bob: Option<String>,
    /// `string` (default): it only pulls, and goes slack under compression. `rod`: rigid, turning freely
    /// about the pivot.
    pub tether: Option<TetherConfig>,
    /// Position of the bob, instead of its `position`: angle from hanging along gravity [rad], positive
    /// towards x (towards y if gravity is along x). Needs `length`.
    pub angle: Option<f64>,
    /// Whether a string may be slack at the start, its bob nearer to the pivot than its length; default
    /// false.
    pub slack: Option<bool>,
}

/// Kind of a pendulum.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum TetherConfig {
    /// A massless inextensible string.
    String,
    /// A massless rigid rod.
    Rod,
}

/// A massless linear spring between two particles, or between a particle and a point.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
#[schemars(extend("required" = ["between", "stiffness"]))]
pub struct SpringConfig {
    /// Name, for messages.
    pub name: Option<String>,
    /// Names of its two particles, or of one beside `point`.
    #[schemars(length(min = 1, max = 2))]
    pub between: Option<Vec<String>>,
    /// The end that does not move [length], in place of a second particle.
    #[schemars(length(min = 2, max = 3))]
    pub point: Option<Vec<f64>>,
    /// k [force/length].
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub stiffness: Option<f64>,
    /// Length without force [length]; default: that at the start.
    #[schemars(range(min = 0.0))]
    pub length: Option<f64>,
}

/// A massless rigid rod between the centers of two particles, which turns freely at both.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
#[schemars(extend("required" = ["between"]))]
pub struct RodConfig {
    /// Name, for messages.
    pub name: Option<String>,
    /// Names of its two particles.
    #[schemars(length(equal = 2))]
    pub between: Option<Vec<String>>,
    /// Distance of their centers [length]; default: that at the start.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub length: Option<f64>,
    /// Position of the second particle, instead of its `position`: angle of the rod, seen from the first, to
    /// the x axis in the xy plane [rad]. Needs `length`.
    pub angle: Option<f64>,
}
