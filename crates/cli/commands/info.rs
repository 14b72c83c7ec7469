//! `haff info`.

use std::{path::Path, time::Duration};

use console::Term;
use haff_engine::{Mean, Sample, residual_warning, significant};
use haff_record::NamedMean;
use serde_json::{Value, json};

use crate::{
    arguments::Info,
    running::parts::Parts,
    terminal::{
        failure::{Failure, file_failure},
        numbers::{counted, duration},
        output::{self, bytes, shown},
        watch::Watch,
    },
};

/// Interval between two reads of a file that another process writes: about its interval of flushes.
const LOOK_EVERY: Duration = Duration::from_secs(1);

/// Prints each new sample of a file, until its run is complete.
fn watch(path: &Path) -> Result<u8, Failure> {
    let mut watch = Watch::on(Term::stdout());
    let mut seen = None;
    loop {
        let info = haff_record::info(path).map_err(|error| file_failure(&error))?;
        if let Some(last) = &info.last_sample
            && seen != Some(last.time)
            && let Some(line) = watch.line(last)
        {
            seen = Some(last.time);
            output::line(line)?;
        }
        if info.finished {
            return Ok(0);
        }
        std::thread::sleep(LOOK_EVERY);
    }
}

/// An energy or a temperature with all digits that mean something to a reader.
fn energy(value: f64) -> String {
    significant(value, 9)
}

/// A mean and its error to two digits of the error.
pub fn rounded(mean: f64, error: f64) -> String {
    if error.is_nan() || error <= 0.0 {
        return energy(mean);
    }
    // At least as many digits as the error has in front of the point.
    let digits = 1 - error.log10().floor() as i32;
    if (-4..=12).contains(&digits) {
        let digits = digits.max(0) as usize;
        format!("{mean:.digits$} ± {error:.digits$}")
    } else {
        format!("{} ± {}", significant(mean, 9), significant(error, 2))
    }
}

/// A mean with its error, and from when it is.
fn with_error(found: &NamedMean) -> String {
    let Mean { mean, error, independent, drifts, .. } = found.mean;
    if error.is_nan() {
        return format!("{}, of too few samples for an error", energy(mean));
    }
    if error == 0.0 {
        return energy(mean);
    }
    let text = rounded(mean, error);
    let from = significant(found.from, 6);
    if drifts {
        format!("{text} from t = {from}, but it drifts")
    } else if independent < Mean::FEW {
        format!("{text} or more, from t = {from}: {independent:.0} independent values")
    } else {
        format!("{text} from t = {from}")
    }
}

/// The means of a file as JSON, by name.
fn means_as_json(means: &[NamedMean]) -> Value {
    let one = |NamedMean { name, mean, from }: &NamedMean| {
        let fields = json!({
            "mean": mean.mean, "error": mean.error, "start": from, "independent": mean.independent,
            "slope": mean.slope, "drifts": mean.drifts,
        });
        (name.clone(), fields)
    };
    Value::Object(means.iter().map(one).collect())
}

/// Prints a summary of an output file.
pub fn info(options: &Info) -> Result<u8, Failure> {
    if options.watch {
        return watch(&options.file);
    }
    let info = haff_record::info(&options.file).map_err(|error| file_failure(&error))?;
    let means = haff_record::means(&options.file).map_err(|error| file_failure(&error))?;
    let running = !info.finished && haff_record::is_being_written(&options.file);
    let progress = match (info.finished, info.resumable) {
        _ if running => "running: another process is writing the file",
        (true, _) => "complete",
        (false, true) => "not complete: continue with haff run --resume",
        (false, false) => "not complete, and without a valid checkpoint",
    };
    let summary: Value =
        info.summary.as_deref().and_then(|text| serde_json::from_str(text).ok()).unwrap_or_default();
    let last = info.last_sample.as_ref();
    let warnings = warnings(&summary, last);
    // Not the number of rows in the event log, which is optional and has other kinds of rows, too.
    let counts = match (last, info.counters) {
        (Some(last), _) => Some([last.collisions, last.wall_collisions]),
        (None, Some(counters)) => Some([counters.collisions, counters.wall_collisions]),
        (None, None) => None,
    };
    if options.json {
        let ledger = last.map(|last| {
            let mut row = json!({
                "time": last.time, "step": last.step, "temperature": last.temperature,
                "rotational_temperature": last.rotational_temperature,
                "collisions": last.collisions, "wall_collisions": last.wall_collisions,
            });
            // Null where the file has none: NaN is no number of JSON.
            for (name, energy) in haff_engine::energies(&last.ledger) {
                row[name] = json!(energy);
            }
            row
        });
        let report = json!({
            "file": options.file, "title": info.title, "version": info.version, "git_revision": info.git_revision,
            "schema": info.schema, "trajectory_version": info.trajectory_version, "seed": info.seed,
            "dimension": info.dimension, "particles": info.particles, "species": info.species, "walls": info.walls,
            "box": info.box_size.to_array(), "periodic": info.periodic, "frames": info.frames,
            "samples": info.samples, "event_rows": info.event_rows, "event_columns": info.event_columns, "time_range": info.time_range, "last": ledger,
            "collisions": counts.map(|[pairs, _]| pairs), "wall_collisions": counts.map(|[_, walls]| walls),
            "events": counts.map(|[pairs, walls]| pairs.saturating_add(walls)),
            // As of the last checkpoint.
            "simultaneous_contacts": info.counters.map(|counters| counters.simultaneous),
            "means": means_as_json(&means),
            "checkpoint_time": info.checkpoint_time, "finished": info.finished, "running": running, "resumable": info.resumable && !running,
            "file_bytes": info.file_size, "warnings": warnings, "summary": summary, "scene": info.scene_toml,
        });
        return output::line(report).map(|()| 0);
    }
    let mut lines = vec![format!("{}: {}", output::path(&options.file), shown(&info.title))];
    let mut line = |name: &str, text: String| lines.push(format!("{name:<17} {}", shown(text)));
    line("written by", format!("haff {} {}, schema {}", info.version, info.git_revision, info.schema));
    line("progress", progress.to_owned());
    let names: Vec<String> = info.species.iter().map(|(name, count)| format!("{count} {name}")).collect();
    let kind = if info.dimension == 2 { "disk" } else { "sphere" };
    line("particles", format!("{}: {}", counted(info.particles, kind), names.join(", ")));
    let axes: Vec<String> = (0..info.dimension)
        .map(|axis| {
            let size = significant(info.box_size[axis], 6);
            format!("{size}{}", if info.periodic[axis] { " (periodic)" } else { "" })
        })
        .collect();
    line("box", axes.join(" × "));
    if !info.walls.is_empty() {
        line("walls", info.walls.join(", "));
    }
    line("seed", info.seed.to_string());
    if let Some((first, last)) = info.time_range {
        line("time", format!("{} … {}", significant(first, 9), significant(last, 9)));
    }
    let count = |number: Option<u64>| number.map_or("none requested".to_owned(), |number| number.to_string());
    line("frames", count(info.frames));
    line("samples", count(info.samples));
    let rows = count(info.event_rows);
    let columns = info.event_columns.join(", ");
    line("event rows", if columns.is_empty() { rows } else { format!("{rows} of {columns}") });
    if let Some([pairs, walls]) = counts {
        let events = pairs.saturating_add(walls);
        let both = [counted(pairs, "collision"), counted(walls, "wall collision")];
        line("events", format!("{events}: {}", both.join(", ")));
    }
    if let Some(ties) = info.counters.map(|counters| counters.simultaneous).filter(|&ties| ties > 0) {
        line("simultaneous", format!("{} of one body at one instant", counted(ties, "contact")));
    }
    if let Some(last) = last {
        let has_spin = !last.species_rotational_temperature.is_empty();
        line("temperature", energy(last.temperature));
        if has_spin {
            line("  of rotation", energy(last.rotational_temperature));
        }
        line("kinetic energy", energy(last.ledger.kinetic));
        if has_spin {
            line("  of rotation", energy(last.ledger.rotational));
        }
        line("potential energy", energy(last.ledger.potential));
        if !last.ledger.spring.is_nan() {
            line("  of springs", energy(last.ledger.spring));
        }
        line(
            "dissipated",
            format!("{}, Carnot {}", energy(last.ledger.dissipated), energy(last.ledger.carnot)),
        );
        for term in haff_engine::Term::ALL {
            let value = last.ledger.term(term);
            if value != 0.0 || term == haff_engine::Term::WallWork {
                line(term.label(), energy(value));
            }
        }
        line("ledger residual", significant(last.ledger.residual, 2));
    }
    // Of energies only those that a drive or walls change.
    let changes = |found: &&NamedMean| !found.name.ends_with("_energy") || found.mean.error > 0.0;
    let listed: Vec<&NamedMean> = means.iter().filter(changes).collect();
    if !listed.is_empty() {
        line("means", "± standard error, of the stationary part".to_owned());
        for found in listed {
            line(&format!("  {:<24}", found.name.replace('_', " ")), with_error(found));
        }
    }
    if let Some(time) = info.checkpoint_time {
        line("last checkpoint", format!("t = {}", significant(time, 9)));
    }
    for (name, key) in [
        ("stopped by", "stopped"),
        ("continues", "continues"),
        ("largest overlap", "max_overlap"),
        ("state hash", "state_hash"),
    ] {
        if let Some(value) = summary.get(key) {
            let number = value.as_f64().map(|value| significant(value, 3));
            let text = value.as_str().map(str::to_owned);
            line(name, text.or(number).unwrap_or_else(|| value.to_string()));
        }
    }
    if let Some(seconds) = summary["wall_seconds"].as_f64() {
        line("wall time", duration(seconds));
    }
    // Of a run that was resumed.
    let parts: Parts = serde_json::from_value(summary["parts"].clone()).unwrap_or_default();
    if parts.len() > 1 {
        for (k, part) in parts.iter().enumerate() {
            line(&format!("  part {}", k + 1), part.to_string());
        }
    }
    if let (Some(threads), Some(text)) = (summary["threads"].as_u64(), summary["blocks"]["text"].as_str()) {
        line("threads", format!("{threads}; {text}"));
    }
    line("file size", bytes(info.file_size));
    for warning in warnings {
        line("warning", warning);
    }
    output::lines(lines.join("\n")).map(|()| 0)
}

/// The warnings of a run's summary, and one for the residual of its last sample, which files of runs that
/// have not ended have, too.
fn warnings(summary: &Value, last: Option<&Sample>) -> Vec<String> {
    let of_run = summary["warnings"].as_array().into_iter().flatten();
    let mut warnings: Vec<String> = of_run.filter_map(|text| text.as_str().map(str::to_owned)).collect();
    let residual = summary["ledger_residual"].as_f64().or(last.map(|last| last.ledger.residual));
    if let Some(warning) = residual.and_then(residual_warning)
        && !warnings.contains(&warning)
    {
        warnings.push(warning);
    }
    warnings
}
