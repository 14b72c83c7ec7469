//! Measured cells as rows of CSV.

use serde_json::Value;

use crate::terminal::{
    failure::{Failure, Status},
    output,
};

/// Columns, and where a report has them.
const COLUMNS: [(&str, &str); 28] = [
    ("scene", "/scene"),
    ("n", "/n"),
    ("phi", "/phi"),
    ("threads", "/threads"),
    ("neighbors", "/neighbors"),
    ("collisions", "/collisions"),
    ("wall_collisions", "/wall_collisions"),
    ("wall_seconds", "/wall_seconds"),
    ("collisions_per_second", "/collisions_per_second"),
    ("collisions_per_second_least", "/collisions_per_second_spread/0"),
    ("collisions_per_second_most", "/collisions_per_second_spread/1"),
    ("repeats", "/repeats"),
    ("startup_seconds", "/startup_seconds"),
    ("bytes_per_particle", "/bytes_per_particle"),
    ("process_bytes", "/process_bytes"),
    ("peak_memory_bytes", "/peak_memory_bytes"),
    ("predictions_per_collision", "/per_collision/predictions"),
    ("stale_per_collision", "/per_collision/stale"),
    ("dropped_per_collision", "/per_collision/dropped"),
    ("transfers_per_collision", "/per_collision/transfers"),
    ("seed", "/seed"),
    ("state_hash", "/state_hash"),
    ("version", "/version"),
    ("trajectory_version", "/trajectory_version"),
    ("processor", "/machine/processor"),
    ("processors", "/machine/processors"),
    ("system", "/machine/system"),
    ("date", "/date"),
];

/// Prints a head, and a row for each report; what a report has not is empty.
pub fn print(reports: &[Value]) -> Result<(), Failure> {
    let mut writer = csv::Writer::from_writer(Vec::new());
    let failed = |error: &dyn std::fmt::Display| Failure::new(Status::File, format!("CSV: {error}"));
    writer.write_record(COLUMNS.map(|(name, _)| name)).map_err(|error| failed(&error))?;
    for report in reports {
        let values = COLUMNS.map(|(_, place)| match report.pointer(place) {
            None | Some(Value::Null) => String::new(),
            Some(Value::String(text)) => text.clone(),
            Some(value) => value.to_string(),
        });
        writer.write_record(values).map_err(|error| failed(&error))?;
    }
    let bytes = writer.into_inner().map_err(|error| failed(&error))?;
    output::print(String::from_utf8_lossy(&bytes))
}
