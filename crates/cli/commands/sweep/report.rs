//! Output of a sweep: a table, a summary as JSON, and the lines at its end.

use std::{fmt::Write, path::Path};

use serde_json::{Value, json};

use super::{
    manifest::NAME,
    row::{Row, State},
};
use crate::terminal::{
    output::{self, shown},
    table,
};

/// Totals of a summary that are sums over its runs.
const SUMS: [&str; 4] = ["collisions", "wall_collisions", "events", "wall_seconds"];

/// All runs as one JSON object.
pub fn summary(rows: &[&Row], folder: Option<&Path>) -> Value {
    let mut summary = json!({
        "folder": folder.map(|folder| folder.display().to_string()),
        "members": rows.len(),
        "runs": rows,
    });
    for state in [State::Missing, State::Running, State::Unfinished, State::Complete, State::Failed] {
        summary[state.word()] = json!(count(rows, state));
    }
    for key in SUMS {
        let values = rows.iter().filter_map(|row| row.totals.get(key));
        // Counts stay whole numbers.
        summary[key] = match values.clone().map(Value::as_u64).sum::<Option<u64>>() {
            Some(sum) => json!(sum),
            None => json!(values.filter_map(Value::as_f64).sum::<f64>()),
        };
    }
    summary
}

/// One run as a JSON object: its row, and all of its report if it ran.
pub fn member(row: &Row, report: Option<&Value>) -> Value {
    let mut object = report.cloned().unwrap_or_else(|| json!({}));
    if let (Some(object), Ok(Value::Object(own))) = (object.as_object_mut(), serde_json::to_value(row)) {
        object.extend(own);
    }
    object
}

/// The runs as a text table.
pub fn table(rows: &[&Row]) -> String {
    let mut cells: Vec<Vec<String>> = Vec::new();
    if let Some(first) = rows.first() {
        let keys = first.parameters.keys().map(shown);
        cells.push(["run".to_owned()].into_iter().chain(keys).collect());
        cells[0].extend(["seed", "status", "file"].map(str::to_owned));
    }
    for row in rows {
        let values = row.parameters.values().map(plain);
        let seed = row.seed.map_or_else(|| "?".to_owned(), |seed| seed.to_string());
        let mut line: Vec<String> = [row.index.to_string()].into_iter().chain(values).collect();
        line.extend([seed, row.status.word().to_owned(), row.file.clone()]);
        cells.push(line.iter().map(shown).collect());
    }
    table::aligned(&cells)
}

/// A run on one line, or on more if its error has more.
pub fn line(row: &Row) -> String {
    let mut text = format!("run {}", row.index);
    for (key, value) in &row.parameters {
        // Writing to a string cannot fail.
        let _ = write!(text, "  {}", shown(format_args!("{key}={}", plain(value))));
    }
    if let Some(replica) = row.replica {
        let _ = write!(text, "  seed {replica}");
    }
    match &row.error {
        // Already consists of lines.
        Some(error) => text + ": " + error,
        None => text + ": " + row.status.word() + ", " + &shown(&row.file),
    }
}

/// Prints the end of a sweep; `folder` is where the manifest has been written.
pub fn print_end(rows: &[&Row], run: usize, folder: Option<&Path>) {
    let kept = rows.len() - run;
    let mut text = format!("{} of {} runs are complete", count(rows, State::Complete), rows.len());
    if kept > 0 {
        let _ = write!(text, ", {kept} since before");
    }
    for state in [State::Failed, State::Unfinished, State::Running, State::Missing] {
        match count(rows, state) {
            0 => {}
            count => {
                let _ = write!(text, "; {count} {}", state.word());
            }
        }
    }
    output::message(text);
    if let Some(folder) = folder {
        output::message(format_args!("wrote {}", output::path(&folder.join(NAME))));
    }
    if count(rows, State::Complete) < rows.len() {
        output::message(format_args!("continue with the same command"));
    }
    print_warnings(rows);
}

/// Prints the warnings of the first run that has any, and how many others have.
fn print_warnings(rows: &[&Row]) {
    let mut warned = rows.iter().filter_map(|row| Some((row.index, row.totals.get("warnings")?.as_array()?)));
    let Some((first, texts)) = warned.next() else { return };
    let texts: Vec<String> = texts.iter().map(|text| format!("run {first}: {}", plain(text))).collect();
    output::warnings(&texts);
    match warned.count() {
        0 => {}
        1 => output::message("warning: 1 other run has warnings: haff info FILE"),
        others => output::message(format_args!("warning: {others} other runs have warnings: haff info FILE")),
    }
}

fn count(rows: &[&Row], state: State) -> usize {
    rows.iter().filter(|row| row.status == state).count()
}

fn plain(value: &Value) -> String {
    value.as_str().map_or_else(|| value.to_string(), str::to_owned)
}
