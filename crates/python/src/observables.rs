//! Samples and counters as dicts, named as in files.

use haff_engine::{Counters, Mean, Observable, Quantity, Sample, SceneFeatures, Sizes, observables};
use numpy::{PyArrayMethods, PyReadonlyArray1};
use pyo3::{prelude::*, types::PyDict};

use crate::arrays::column;

/// A row of observables, as in files.
pub fn sample<'py>(
    py: Python<'py>,
    sample: &Sample,
    present: &SceneFeatures,
    sizes: Sizes,
) -> PyResult<Bound<'py, PyDict>> {
    let row = PyDict::new(py);
    row.set_item("time", sample.time)?;
    row.set_item("step", sample.step)?;
    for Observable { name, quantity, .. } in observables(present) {
        if let Quantity::Count(value) = quantity {
            row.set_item(name, value(sample))?;
            continue;
        }
        let mut numbers = Vec::new();
        quantity.append(sample, sizes, &mut numbers);
        match quantity.shape(sizes).as_slice() {
            [] => row.set_item(name, numbers.first())?,
            [_] => row.set_item(name, column(py, numbers))?,
            shape => row.set_item(name, column(py, numbers).reshape(shape.to_vec())?)?,
        }
    }
    Ok(row)
}

/// Counts since the start.
pub fn counters(py: Python<'_>, counters: Counters) -> PyResult<Bound<'_, PyDict>> {
    let row = PyDict::new(py);
    for (name, count) in [
        ("collisions", counters.collisions),
        ("fixed_collisions", counters.fixed_collisions),
        ("wall_collisions", counters.wall_collisions),
        ("simultaneous", counters.simultaneous),
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

/// The mean of a series over its stationary part: its fields by name; `None` if there is none. With the times
/// of samples `start` is the time at which that begins, not an index.
#[pyfunction]
#[pyo3(signature = (values, times = None))]
// pyo3 gives arrays by value.
#[allow(clippy::needless_pass_by_value)]
pub fn mean<'py>(
    py: Python<'py>,
    values: PyReadonlyArray1<'py, f64>,
    times: Option<PyReadonlyArray1<'py, f64>>,
) -> PyResult<Option<Bound<'py, PyDict>>> {
    let values = values.as_array().to_vec();
    let times = times.map(|times| times.as_array().to_vec());
    let found = py.detach(|| match times {
        Some(times) => Mean::of_samples(&times, &values).map(|(mean, from)| (mean, Some(from))),
        None => Mean::of(&values).map(|mean| (mean, None)),
    });
    let Some((found, from)) = found else { return Ok(None) };
    let row = PyDict::new(py);
    row.set_item("mean", found.mean)?;
    row.set_item("error", found.error)?;
    match from {
        Some(from) => row.set_item("start", from)?,
        None => row.set_item("start", found.start)?,
    }
    row.set_item("independent", found.independent)?;
    row.set_item("slope", found.slope)?;
    row.set_item("drifts", found.drifts)?;
    Ok(Some(row))
}
