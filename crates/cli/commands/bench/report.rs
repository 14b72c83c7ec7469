//! A measured cell as a JSON object and as a line of the table.

use haff_engine::{Counters, TRAJECTORY_VERSION};
use serde_json::{Map, Value, json};

use super::measure::{Measured, Stretch};
use crate::{
    arguments::VERSION,
    running::session::Ending,
    terminal::{machine, memory::peak_memory, output::shown, threads},
};

/// Middle of the rates, and the least and the largest [1/s].
fn rates(stretches: &[Stretch]) -> (f64, [f64; 2], Vec<f64>) {
    let all: Vec<f64> = stretches.iter().map(|part| part.collisions as f64 / part.seconds).collect();
    let least = all.iter().copied().fold(f64::INFINITY, f64::min);
    let most = all.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    (median(&all), [least, most], all)
}

/// The middle of some values, of an even number of them the mean of the two in the middle.
pub fn median(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let middle = sorted.len() / 2;
    if sorted.len() % 2 == 1 { sorted[middle] } else { 0.5 * (sorted[middle - 1] + sorted[middle]) }
}

/// Counters of the engine in the timed part. The pattern is exhaustive: a new counter does not compile until
/// it is added.
fn bookkeeping(before: Counters, after: Counters) -> Map<String, Value> {
    let Counters {
        collisions: _,
        fixed_collisions,
        wall_collisions: _,
        simultaneous,
        rests,
        wakes,
        predictions,
        dropped,
        stale,
        transfers,
        candidates,
        windows,
        epochs,
    } = after;
    let counts = [
        ("fixed_collisions", fixed_collisions - before.fixed_collisions),
        ("predictions", predictions - before.predictions),
        ("stale", stale - before.stale),
        ("dropped", dropped - before.dropped),
        ("transfers", transfers - before.transfers),
        ("candidates", candidates - before.candidates),
        ("windows", windows - before.windows),
        ("simultaneous", simultaneous - before.simultaneous),
        ("rests", rests - before.rests),
        ("wakes", wakes - before.wakes),
        ("epochs", epochs - before.epochs),
    ];
    counts.into_iter().map(|(name, count)| (name.to_owned(), json!(count))).collect()
}

/// The cell as one JSON object. Collisions, times and counters are those of the timed part; those of the
/// whole run are under `total`, and the state hash is that of its end. `phi` is the requested packing
/// fraction, if any.
pub fn report(cell: &Measured, scene: &str, phi: Option<f64>) -> Value {
    let simulation = &cell.simulation;
    let (before, start) = cell.melted;
    let after = simulation.counters();
    let collisions = after.collisions - before.collisions;
    let walls = after.wall_collisions - before.wall_collisions;
    let particles = simulation.particles();
    let span = simulation.time() - start;
    let seconds: f64 = cell.stretches.iter().map(|part| part.seconds).sum();
    let (median, spread, all) = rates(&cell.stretches);
    let counters = bookkeeping(before, after);
    let per_collision: Map<String, Value> = counters
        .iter()
        .map(|(name, count)| (name.clone(), json!(count.as_u64().unwrap_or(0) as f64 / collisions as f64)))
        .collect();
    let memory = peak_memory();
    let events = after.collisions + after.wall_collisions;
    let blocks = threads::report(&simulation.block_counts(), events, simulation.serial_reason());
    let mut report = json!({
        "scene": scene,
        "n": particles,
        "phi": phi.unwrap_or(cell.packing_fraction),
        // Null if an axis is open.
        "packing_fraction": cell.packing_fraction,
        "stopped": cell.ending.word(),
        "particles": particles,
        "collisions": collisions,
        "wall_collisions": walls,
        "events": collisions + walls,
        "simulated_time": span,
        "mean_free_time": span * cell.movable as f64 / (after.ended_flights() - before.ended_flights()) as f64,
        "wall_seconds": seconds,
        "collisions_per_second": median,
        "collisions_per_second_spread": spread,
        "collisions_per_second_repeats": all,
        "repeats": cell.stretches.len(),
        "melt_collisions": before.collisions,
        "melt_seconds": cell.melting.as_secs_f64(),
        "packing_seconds": cell.packing.as_secs_f64(),
        "building_seconds": cell.building.as_secs_f64(),
        "startup_seconds": (cell.packing + cell.building).as_secs_f64(),
        "per_collision": per_collision,
        "counters": counters,
        "total": {
            "collisions": after.collisions,
            "wall_collisions": after.wall_collisions,
            "events": after.collisions + after.wall_collisions,
            "simulated_time": simulation.time(),
        },
        "ledger_residual": simulation.ledger().residual,
        "max_overlap": simulation.max_overlap(),
        "peak_memory_bytes": memory,
        // Of the program without any particle.
        "process_bytes": cell.process,
        "bytes_per_particle": memory.zip(cell.process)
            .map(|(peak, process)| peak.saturating_sub(process) as f64 / particles as f64),
        "threads": rayon::current_num_threads(),
        "blocks": blocks,
        "neighbors": simulation.neighbors().name(),
        "seed": cell.seed,
        "machine": machine::machine(),
        "date": machine::now(),
        "version": VERSION,
        "trajectory_version": TRAJECTORY_VERSION,
        "state_hash": simulation.state_hash(),
    });
    if let Ending::Failed(error) = &cell.ending {
        report["error"] = json!(error.to_string());
    }
    report
}

/// The table's head.
pub fn head() -> String {
    format!(
        "{:<10} {:>9} {:>7} {:>3} {:<9} {:>9} {:>6} {:>8}  {:>9} {:>7} {:>7} {:>9}  {:>8} {:>8}  {:<14}",
        "scene",
        "N",
        "φ",
        "thr",
        "neighbors",
        "M coll/s",
        "± %",
        "ns/coll",
        "predicted",
        "stale",
        "dropped",
        "transfers",
        "start s",
        "B/partcl",
        "blocks, undone"
    )
}

/// A cell's line of the table.
pub fn line(report: &Value) -> String {
    let number = |value: &Value, digits: usize, width: usize| match value.as_f64() {
        Some(number) => format!("{number:>width$.digits$}"),
        None => format!("{:>width$}", "–"),
    };
    let text = |key: &str| report[key].as_str().unwrap_or("–");
    let rate = report["collisions_per_second"].as_f64().unwrap_or(f64::NAN);
    let spread = &report["collisions_per_second_spread"];
    let half = match (spread[0].as_f64(), spread[1].as_f64(), report["repeats"].as_u64()) {
        (Some(least), Some(most), Some(2..)) => json!(50.0 * (most - least) / rate),
        _ => Value::Null,
    };
    let per = &report["per_collision"];
    // A long path is cut at its start.
    let name = shown(text("scene").rsplit('/').next().unwrap_or_default());
    // Shares in percent: inside of blocks, at their faces, one after the other; and the steps undone.
    let blocks = match threads::shares(&report["blocks"]) {
        Some([first, further, rest]) => {
            format!("{first:.0}+{further:.0}+{rest:.0} %, {}", report["blocks"]["undone"])
        }
        None => "–".to_owned(),
    };
    format!(
        "{name:<10} {:>9} {} {:>3} {:<9} {} {} {}  {} {} {} {}  {} {}  {blocks}",
        report["n"],
        report["phi"]
            .as_f64()
            .map_or(format!("{:>7}", "–"), |phi| format!("{:>7}", (phi * 1e6).round() / 1e6)),
        report["threads"],
        text("neighbors"),
        number(&json!(rate / 1e6), 4, 9),
        number(&half, 1, 6),
        number(&json!(1e9 / rate), 0, 8),
        number(&per["predictions"], 1, 9),
        number(&per["stale"], 3, 7),
        number(&per["dropped"], 3, 7),
        number(&per["transfers"], 3, 9),
        number(&report["startup_seconds"], 2, 8),
        number(&report["bytes_per_particle"], 0, 8),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rate_is_the_median_of_the_repeats() {
        let stretch = |collisions, seconds| Stretch { collisions, seconds };
        let (median, spread, all) = rates(&[stretch(6, 2.0), stretch(8, 1.0), stretch(4, 2.0)]);
        assert_eq!((median, spread, all), (3.0, [2.0, 8.0], vec![3.0, 8.0, 2.0]));
        assert_eq!(rates(&[stretch(1, 1.0), stretch(2, 1.0)]).0, 1.5);
    }
}
