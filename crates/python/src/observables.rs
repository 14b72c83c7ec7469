//! Samples and counters as dicts, named as in files.

use haff_engine::{Counters, Observable, Present, Quantity, Sample, observables};
use pyo3::{prelude::*, types::PyDict};

use crate::arrays::{column, vector};

/// A row of observables, as in files.
pub fn sample<'py>(py: Python<'py>, sample: &Sample, present: Present) -> PyResult<Bound<'py, PyDict>> {
    let row = PyDict::new(py);
    row.set_item("time", sample.time)?;
    row.set_item("step", sample.step)?;
    for Observable { name, quantity, .. } in observables(&present) {
        match quantity {
            Quantity::Real(value) => row.set_item(name, value(sample))?,
            Quantity::Count(value) => row.set_item(name, value(sample))?,
            Quantity::Vector(value) => row.set_item(name, vector(py, value(sample)))?,
            Quantity::PerSpecies(values) => row.set_item(name, column(py, values(sample).to_vec()))?,
            Quantity::Term(term) => row.set_item(name, sample.ledger.term(term))?,
        }
    }
    Ok(row)
}

/// Counts since the start.
pub fn counters(py: Python<'_>, counters: Counters) -> PyResult<Bound<'_, PyDict>> {
    let row = PyDict::new(py);
    for (name, count) in [
        ("collisions", counters.collisions),
        ("wall_collisions", counters.wall_collisions),
        ("rests", counters.rests),
        ("wakes", counters.wakes),
        ("predictions", counters.predictions),
        ("stale", counters.stale),
        ("dropped", counters.dropped),
        ("transfers", counters.transfers),
        ("candidates", counters.candidates),
        ("windows", counters.windows),
        ("epochs", counters.epochs),
    ] {
        row.set_item(name, count)?;
    }
    Ok(row)
}
