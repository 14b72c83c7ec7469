//! Profiles and correlations of a live simulation as dicts of arrays, named as in files.

use haff_engine::{CellFields, Correlation, Grid, GridAxis, ProfileRow};
use numpy::{PyArrayDyn, PyArrayMethods};
use pyo3::{prelude::*, types::PyDict};

use crate::arrays::column;

/// The fields of a cell: name, shape of the value with 0 for the number of dimensions, and values.
type Field = (&'static str, &'static [usize], fn(&CellFields) -> Vec<f64>);

const FIELDS: [Field; 5] = [
    ("density", &[], |cells| cells.density.clone()),
    ("mass_density", &[], |cells| cells.mass_density.clone()),
    ("velocity", &[3], |cells| cells.velocity.iter().flat_map(glam::DVec3::to_array).collect()),
    ("temperature", &[], |cells| cells.temperature.clone()),
    ("pressure", &[0, 0], |cells| cells.pressure.clone()),
];

/// All rows of all profiles: by the letters of the axes a dict with `time`, the centers of the cells by axis,
/// and the fields, each `[rows][bins...]` and the shape of the value in a cell; those of species,
/// `species_…`, `[rows][species][bins...]`, with the indices of the species in `species`.
pub fn profiles<'py>(
    py: Python<'py>,
    grids: &[Grid],
    rows: &[ProfileRow],
    dimension: usize,
) -> PyResult<Bound<'py, PyDict>> {
    let all = PyDict::new(py);
    for (index, grid) in grids.iter().enumerate() {
        let rows: Vec<&ProfileRow> = rows.iter().filter(|row| row.profile == index).collect();
        let table = PyDict::new(py);
        table.set_item("time", column(py, rows.iter().map(|row| row.time).collect()))?;
        let centers = PyDict::new(py);
        for axis in &grid.axes {
            centers.set_item(["x", "y", "z"][axis.axis], column(py, GridAxis::centers(axis)))?;
        }
        table.set_item("centers", centers)?;
        let bins = || grid.axes.iter().map(|axis| axis.bins);
        let array = |numbers: Vec<f64>, shape: Vec<usize>| -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
            column(py, numbers).reshape([&[rows.len()][..], &shape].concat())
        };
        for (name, shape, values) in FIELDS {
            let shape = || bins().chain(shape.iter().map(|&axes| if axes == 0 { dimension } else { axes }));
            let of_all: Vec<f64> = rows.iter().flat_map(|row| values(&row.all)).collect();
            table.set_item(name, array(of_all, shape().collect())?)?;
            if !grid.species.is_empty() {
                let of_species = rows.iter().flat_map(|row| row.species.iter().flat_map(values)).collect();
                let shape = std::iter::once(grid.species.len()).chain(shape()).collect();
                table.set_item(format!("species_{name}"), array(of_species, shape)?)?;
            }
        }
        if !grid.species.is_empty() {
            table.set_item("species", grid.species.clone())?;
        }
        all.set_item(grid.name(), table)?;
    }
    Ok(all)
}

/// The columns of correlations by name.
pub fn correlations<'py>(py: Python<'py>, found: &[Correlation]) -> PyResult<Bound<'py, PyDict>> {
    let all = PyDict::new(py);
    for correlation in found {
        let table = PyDict::new(py);
        table.set_item("lag", column(py, correlation.lag.clone()))?;
        let curves = correlation.species.len();
        for (name, values) in [("value", &correlation.value), ("error", &correlation.error)] {
            let values = column(py, values.clone());
            if curves == 0 {
                table.set_item(name, values)?;
            } else {
                table.set_item(name, values.reshape([correlation.lag.len(), curves])?)?;
            }
        }
        if curves > 0 {
            table.set_item("species", correlation.species.clone())?;
        }
        let counts: Vec<i64> = correlation.count.iter().map(|&count| count as i64).collect();
        table.set_item("count", column(py, counts))?;
        all.set_item(correlation.name, table)?;
    }
    Ok(all)
}
