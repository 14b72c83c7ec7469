//! The parts of a run: from a start or a resumption to the next stop, each with its wall time.
//!
//! Parts of a run are what happened between a start or a resumption and the next stop, each with its wall
//! time. The summary in the file has them; a resumption renames it (the dataset `earlier`) in place, so that
//! a full disk does not matter.

use std::fmt;

use haff_engine::{Checkpoint, significant};
use haff_record::Resumed;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use crate::terminal::numbers::{counted, duration};

/// One part of a run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Part {
    /// Simulated time at its start [time].
    pub from: f64,
    /// Simulated time at its end [time].
    pub to: f64,
    /// Collisions between particles in this part.
    pub collisions: u64,
    /// Wall time \[s\]; `None` if the process was killed.
    pub wall_seconds: Option<f64>,
}

impl Part {
    /// Collisions per second; NaN for a part of unknown wall time.
    pub fn rate(&self) -> f64 {
        self.collisions as f64 / self.wall_seconds.unwrap_or(f64::NAN)
    }
}

impl fmt::Display for Part {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        let time = self.wall_seconds.map_or_else(|| "a time not known".to_owned(), duration);
        let [from, to] = [self.from, self.to].map(|time| significant(time, 9));
        write!(out, "t = {from} … {to}: {} in {time}", counted(self.collisions, "collision"))?;
        match self.wall_seconds {
            Some(_) => write!(out, " ({} M/s)", significant(self.rate() / 1e6, 3)),
            None => Ok(()),
        }
    }
}

/// All parts of a run, in order.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Parts(Vec<Part>);

impl Parts {
    /// The parts of a run up to the checkpoint that it is resumed from.
    pub fn before(resumed: &Resumed) -> Self {
        let of = |summary: &Value| serde_json::from_value::<Self>(summary["parts"].clone()).ok();
        let summary = parsed(resumed.summary.as_deref());
        if let Some(parts) = of(&summary) {
            return parts;
        }
        // The last part has no summary: its process was killed, or an earlier version has written the file.
        let mut parts = of(&parsed(resumed.earlier.as_deref())).unwrap_or_default();
        let (time, collisions) = present(&resumed.checkpoint);
        parts.push(time, collisions, summary["wall_seconds"].as_f64());
        parts
    }

    /// Adds a part up to this time and total number of collisions.
    pub fn push(&mut self, to: f64, collisions: u64, wall_seconds: Option<f64>) {
        let from = self.0.last().map_or(0.0, |last| last.to);
        let before: u64 = self.0.iter().map(|part| part.collisions).sum();
        self.0.push(Part { from, to, collisions: collisions.saturating_sub(before), wall_seconds });
    }

    /// The parts in order.
    pub fn iter(&self) -> std::slice::Iter<'_, Part> {
        self.0.iter()
    }

    pub fn len(&self) -> usize {
        self.0.len()
    }

    /// The last part.
    pub fn last(&self) -> Option<&Part> {
        self.0.last()
    }

    /// All of known wall time as one part.
    pub fn known(&self) -> Part {
        let known = self.0.iter().filter(|part| part.wall_seconds.is_some());
        let (collisions, seconds) = known.fold((0, 0.0), |(collisions, seconds), part| {
            (collisions + part.collisions, seconds + part.wall_seconds.unwrap_or(0.0))
        });
        let ends = [self.0.first().map_or(0.0, |part| part.from), self.last().map_or(0.0, |part| part.to)];
        Part { from: ends[0], to: ends[1], collisions, wall_seconds: Some(seconds) }
    }

    /// Number of parts of unknown wall time.
    pub fn unknown(&self) -> usize {
        self.0.iter().filter(|part| part.wall_seconds.is_none()).count()
    }

    /// As JSON.
    pub fn json(&self) -> Value {
        serde_json::to_value(self).unwrap_or_default()
    }

    /// A summary with the parts alone.
    pub fn summary(&self) -> String {
        json!({ "parts": self.json() }).to_string()
    }
}

/// Reads JSON; null for text that is missing or invalid, since wall times are no reason to stop.
fn parsed(text: Option<&str>) -> Value {
    text.and_then(|text| serde_json::from_str(text).ok()).unwrap_or_default()
}

/// Simulated time and number of collisions at a checkpoint.
fn present(checkpoint: &Checkpoint) -> (f64, u64) {
    let bits = |name: &str| {
        let found = checkpoint.scalars.iter().find(|(found, _)| found == name);
        found.map_or(0, |&(_, bits)| bits)
    };
    (f64::from_bits(bits("clock.time")), bits("collisions"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_are_summed_where_their_wall_time_is_known() {
        let mut parts = Parts::default();
        parts.push(2.0, 100, Some(1.0));
        parts.push(3.0, 500, None);
        parts.push(5.0, 700, Some(0.5));
        let known = parts.known();
        assert_eq!((known.collisions, known.wall_seconds, known.rate()), (300, Some(1.5), 200.0));
        assert_eq!((known.from, known.to, parts.unknown()), (0.0, 5.0, 1));
        assert_eq!(parts.last().map(|part| (part.from, part.collisions)), Some((3.0, 200)));
        assert_eq!(serde_json::from_value::<Parts>(parts.json()).unwrap(), parts);
    }
}
