//! The event log of a live simulation.

use haff_engine::{EventRecord, Observer, ProfileRow};
use pyo3::{prelude::*, types::PyDict};

use crate::arrays::{column, vectors};

/// Keeps rows of events and of profiles until Python takes them.
#[derive(Default)]
pub struct Log {
    pub enabled: bool,
    pub rows: Vec<EventRecord>,
    pub profiles: Vec<ProfileRow>,
    /// How many of the rows are in the file.
    pub recorded: usize,
    /// How many rows of profiles are.
    pub recorded_profiles: usize,
}

impl Log {
    /// Gives the rows to Python.
    pub fn take_rows(&mut self) -> Vec<EventRecord> {
        self.recorded = 0;
        std::mem::take(&mut self.rows)
    }

    /// Gives the rows of profiles to Python.
    pub fn take_profiles(&mut self) -> Vec<ProfileRow> {
        self.recorded_profiles = 0;
        std::mem::take(&mut self.profiles)
    }
}

impl Observer for Log {
    fn wants_events(&self) -> bool {
        self.enabled
    }

    fn event(&mut self, event: &EventRecord) {
        self.rows.push(*event);
    }

    fn profile(&mut self, row: ProfileRow) {
        self.profiles.push(row);
    }
}

/// The rows as a dict of columns, named as in files.
/// With the impulse as a vector, and the tangential loss, if the scene has them.
pub fn columns<'py>(
    py: Python<'py>,
    rows: &[EventRecord],
    [has_vectors, has_tangential]: [bool; 2],
) -> PyResult<Bound<'py, PyDict>> {
    let table = PyDict::new(py);
    table.set_item("time", column(py, rows.iter().map(|row| row.time).collect()))?;
    table.set_item("kind", column(py, rows.iter().map(|row| row.kind as u8).collect()))?;
    table.set_item("i", column(py, rows.iter().map(|row| row.i).collect()))?;
    table.set_item("j", column(py, rows.iter().map(|row| row.j).collect()))?;
    table.set_item("approach_speed", column(py, rows.iter().map(|row| row.approach_speed).collect()))?;
    table.set_item("impulse", column(py, rows.iter().map(|row| row.impulse).collect()))?;
    table.set_item("energy_loss", column(py, rows.iter().map(|row| row.energy_loss).collect()))?;
    table.set_item("carnot_energy", column(py, rows.iter().map(|row| row.carnot_energy).collect()))?;
    table.set_item("normal", vectors(py, rows.iter().map(|row| row.normal).collect())?)?;
    table.set_item("position", vectors(py, rows.iter().map(|row| row.position).collect())?)?;
    if has_vectors {
        let impulses = rows.iter().map(|row| row.impulse_vector).collect();
        table.set_item("impulse_vector", vectors(py, impulses)?)?;
    }
    if has_tangential {
        table
            .set_item("tangential_loss", column(py, rows.iter().map(|row| row.tangential_loss).collect()))?;
    }
    Ok(table)
}
