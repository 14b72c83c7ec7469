//! Samples and counters as dicts, named as in files.

use haff_engine::{Counters, Sample};
use pyo3::{prelude::*, types::PyDict};

use crate::arrays::{column, vector};

/// Properties of a scene that decide which observables apply.
#[derive(Debug, Clone, Copy)]
pub struct Shown {
    /// Whether it has springs.
    pub springs: bool,
    /// Whether grains may be put to rest.
    pub rest: bool,
}

/// A row of observables. Those that do not apply to the scene are left out, as in files.
pub fn sample(py: Python<'_>, sample: Sample, shown: Shown) -> PyResult<Bound<'_, PyDict>> {
    let row = PyDict::new(py);
    row.set_item("time", sample.time)?;
    row.set_item("step", sample.step)?;
    row.set_item("kinetic_energy", sample.ledger.kinetic)?;
    row.set_item("potential_energy", sample.ledger.potential)?;
    if shown.springs {
        row.set_item("gravity_energy", sample.ledger.potential - sample.ledger.spring)?;
        row.set_item("spring_energy", sample.ledger.spring)?;
    }
    row.set_item("dissipated_energy", sample.ledger.dissipated)?;
    row.set_item("carnot_energy", sample.ledger.carnot)?;
    if shown.rest {
        row.set_item("rest_energy", sample.ledger.rest)?;
    }
    row.set_item("wall_work", sample.ledger.wall_work)?;
    row.set_item("ledger_residual", sample.ledger.residual)?;
    row.set_item("temperature", sample.temperature)?;
    row.set_item("species_temperature", column(py, sample.species_temperature))?;
    row.set_item("sonine_a2", sample.sonine_a2)?;
    if let Some(pressure) = sample.pressure {
        row.set_item("pressure", pressure)?;
    }
    row.set_item("momentum", vector(py, sample.momentum))?;
    row.set_item("external_impulse", vector(py, sample.external_impulse))?;
    if let Some(momentum) = sample.angular_momentum {
        row.set_item("angular_momentum", vector(py, momentum))?;
    }
    row.set_item("collisions", sample.collisions)?;
    row.set_item("wall_collisions", sample.wall_collisions)?;
    row.set_item("collision_rate", sample.collision_rate)?;
    row.set_item("mean_free_time", sample.mean_free_time)?;
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
