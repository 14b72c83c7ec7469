//! How many threads have taken the events of a run.

use haff_engine::BlockCounts;
use serde_json::{Value, json};

/// The events that were not taken by blocks, of this number of collisions in all. Counts of a resumed run
/// begin where it was resumed.
fn others(counts: &BlockCounts, collisions: u64) -> u64 {
    collisions.saturating_sub(counts.events())
}

/// The counts as a JSON object, of a run with this number of collisions. `reason`: why events are taken one
/// after the other.
pub fn report(counts: &BlockCounts, collisions: u64, reason: Option<&str>) -> Value {
    let others = others(counts, collisions);
    let mut report = json!({
        "count": counts.blocks.max(1),
        "first": counts.first,
        "further": counts.further,
        "last": counts.last,
        "others": others,
        "steps": counts.steps,
        "undone": counts.undone,
        "critical_path": counts.critical_path + others,
        "reason": reason,
    });
    report["text"] = words(&report).into();
    report
}

/// Shares of events in percent, from [`report`]: in blocks, at their faces, and one after the other.
pub fn shares(report: &Value) -> Option<[f64; 3]> {
    let count = |key: &str| report[key].as_u64().unwrap_or(0) as f64;
    let parts = [count("first"), count("further"), count("last") + count("others")];
    let all: f64 = parts.iter().sum();
    (count("steps") > 0.0 && all > 0.0).then(|| parts.map(|part| 100.0 * part / all))
}

/// The same in words.
fn words(report: &Value) -> String {
    match (shares(report), report["reason"].as_str()) {
        (Some([first, further, rest]), _) => format!(
            "events in {} blocks at a time: {first:.1} % inside, {further:.1} % at their faces, {rest:.1} % one after \
             the other; {} of {} steps undone",
            report["count"], report["undone"], report["steps"]
        ),
        (None, Some(reason)) => format!("events one after the other: {reason}"),
        (None, None) => "events one after the other: steps have few of them".to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_are_of_all_events() {
        let counts = BlockCounts {
            blocks: 2,
            first: 700,
            further: 200,
            last: 50,
            steps: 9,
            undone: 1,
            critical_path: 500,
        };
        let report = report(&counts, 1000, None);
        assert_eq!((report["others"].as_u64(), report["critical_path"].as_u64()), (Some(50), Some(550)));
        assert_eq!(shares(&report), Some([70.0, 20.0, 10.0]));
        let text = report["text"].as_str().unwrap();
        assert!(text.contains("1 of 9 steps undone"), "{text}");
        let serial = super::report(&BlockCounts::default(), 1000, Some("there is one thread or block"));
        assert_eq!(serial["text"], "events one after the other: there is one thread or block");
    }
}
