//! Keys of `[output]`.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Output.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct OutputConfig {
    /// Path of the HDF5 file, relative to the current directory; `false` or left out: none. Not that of the
    /// scene, nor of the state file it starts from.
    pub file: Option<OutputFileConfig>,
    /// Simulated time between trajectory frames, or `{ log = [first, factor] }`, or
    /// `{ collisions_per_particle = C }`, or `false`. Default: `until`/100.
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
    /// At logarithmic intervals, or by collisions.
    Table(ScheduleTableConfig),
    /// `false`: never.
    Off(#[schemars(extend("const" = false))] bool),
}

/// Records at other times than those of an interval; one of the two keys.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
#[schemars(extend("minProperties" = 1, "maxProperties" = 1))]
pub struct ScheduleTableConfig {
    /// `[first, factor]`: records at first · factor^k, k = 0, 1, …, with a first time [time] > 0 and a
    /// factor > 1.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(length(equal = 2))]
    pub log: Option<Vec<f64>>,
    /// A record each time that the particles have had this many collisions on average, of which each counts
    /// for both partners: C N/2 collisions, rounded up. The state is that after all events of the instant.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub collisions_per_particle: Option<f64>,
}
