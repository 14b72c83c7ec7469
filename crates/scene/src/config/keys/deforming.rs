//! Keys of boxes that become smaller or larger: `domain.compression` and `[growth]`.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Compression or expansion of the box at constant velocities of its edges: either `rate` or `rates`.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
#[schemars(extend("minProperties" = 1, "maxProperties" = 1))]
pub struct BoxCompressionConfig {
    /// γ of all axes [1/time]: the edges are L (1 − γ t) at time t. Negative: the box expands.
    pub rate: Option<f64>,
    /// γ of each axis [1/time]; 0: the edge keeps its length.
    #[schemars(length(min = 2, max = 3))]
    pub rates: Option<Vec<f64>>,
}

/// Growth of all particles in proportion (Lubachevsky–Stillinger), in the units of the start: radii stay, and
/// the box shrinks as with `domain.compression`, which is the same motion.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
#[schemars(extend("required" = ["rate"]))]
pub struct GrowthConfig {
    /// Growth of the largest diameter in a unit of time [length/time]. The edges are L (1 − γ t) with γ =
    /// rate over that diameter.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub rate: Option<f64>,
    /// Temperature to which velocities are rescaled, at every hundredth of 1/γ and before it has changed by
    /// more than about a fifth \[energy\]. Default: they are not rescaled, and growth heats.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub temperature: Option<f64>,
    /// The run ends when the particles fill this part of the box.
    #[schemars(range(max = 1.0), extend("exclusiveMinimum" = 0))]
    pub until_packing_fraction: Option<f64>,
    /// The run ends at the first sample of observables whose reduced pressure P V/(N T) is at least this.
    /// There are samples in addition to those of `output.observables`: whenever particles have had ten
    /// collisions each on average.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub until_reduced_pressure: Option<f64>,
}
