//! A run of a sweep, as the manifest has it.

use std::collections::BTreeMap;

use haff_record::NamedMean;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

use super::plan::Member;

/// Keys of a run's report that a row keeps beside the totals that are numbers.
const TEXTS: [&str; 3] = ["resumed_from", "stopped", "state_hash"];

/// State of a run.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum State {
    /// Not started.
    Missing,
    /// Another process writes its file.
    Running,
    /// Stopped or killed; its file can be resumed.
    Unfinished,
    /// Done.
    Complete,
    /// Ended with an error.
    Failed,
}

impl State {
    /// The word in tables.
    pub fn word(self) -> &'static str {
        match self {
            Self::Missing => "missing",
            Self::Running => "running",
            Self::Unfinished => "unfinished",
            Self::Complete => "complete",
            Self::Failed => "failed",
        }
    }
}

/// A TOML value as JSON.
fn json(value: &toml::Value) -> Value {
    match value {
        toml::Value::Float(number) if !number.is_finite() => Value::String(value.to_string()),
        other => serde_json::to_value(other).unwrap_or_else(|_| Value::String(other.to_string())),
    }
}

/// The mean of an observable over the stationary part of a run. Null where there are too few samples for an
/// error.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct RowMean {
    pub mean: Option<f64>,
    /// Standard error.
    pub error: Option<f64>,
    /// Time from which on the run is stationary [time].
    pub start: f64,
    /// Whether it drifts even then.
    pub drifts: bool,
}

impl From<&NamedMean> for RowMean {
    fn from(found: &NamedMean) -> Self {
        let finite = |value: f64| Some(value).filter(|value| value.is_finite());
        let (mean, error) = (finite(found.mean.mean), finite(found.mean.error));
        Self { mean, error, start: found.from, drifts: found.mean.drifts }
    }
}

/// A run of the sweep.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Row {
    /// Number of the run in the sweep, from 0.
    pub index: usize,
    /// Its parameters; numbers that JSON cannot represent (`inf`) as text.
    pub parameters: Map<String, Value>,
    /// Which of the runs with these parameters.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub replica: Option<u32>,
    /// Seed.
    pub seed: Option<u64>,
    /// File in the sweep's folder.
    pub file: String,
    /// State.
    pub status: State,
    /// Size of the complete file.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub file_bytes: Option<u64>,
    /// Means of the observables of a complete run, by name.
    #[serde(skip_serializing_if = "BTreeMap::is_empty", default)]
    pub means: BTreeMap<String, RowMean>,
    /// Exit status, as `haff run` would give it.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub exit: Option<u8>,
    /// Error message.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub error: Option<String>,
    /// Totals of the run, as in its report.
    #[serde(flatten)]
    pub totals: Map<String, Value>,
}

impl Row {
    /// The row of a run that has not started.
    pub fn missing(member: &Member) -> Self {
        let parameters = member.parameters.iter().map(|(key, value)| (key.clone(), json(value))).collect();
        Self {
            index: member.index,
            parameters,
            replica: member.replica,
            seed: member.seed,
            file: member.file.clone(),
            status: State::Missing,
            file_bytes: None,
            means: BTreeMap::new(),
            exit: None,
            error: None,
            totals: Map::new(),
        }
    }

    /// Copies the totals of a report.
    pub fn take(&mut self, report: &Value) {
        for key in haff_engine::total_names().chain(TEXTS) {
            if let Some(value) = report.get(key) {
                self.totals.insert(key.to_owned(), value.clone());
            }
        }
        // Most runs have none.
        match report.get("warnings") {
            Some(Value::Array(warnings)) if !warnings.is_empty() => {
                self.totals.insert("warnings".to_owned(), Value::Array(warnings.clone()));
            }
            _ => {
                self.totals.remove("warnings");
            }
        }
        if let Some(seed) = report["seed"].as_u64() {
            self.seed = Some(seed);
        }
    }
}
