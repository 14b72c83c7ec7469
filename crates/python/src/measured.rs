//! Profiles and correlations of a live simulation as dicts of arrays, named as in files.

use haff_engine::{Correlation, Grid, GridAxis, ProfileRow};
use numpy::{PyArrayDyn, PyArrayMethods};
use pyo3::{prelude::*, types::PyDict};

use crate::arrays::column;

/// All rows of all profiles: by the letters of the axes a dict with `time`, the centers of the cells by axis,
/// and the fields, each `[rows][bins...]` and the shape of the value in a cell.
pub fn profiles<'py>(
    py: Python<'py>,
    grids: &[Grid],
    rows: &[ProfileRow],
    dimension: usize,
) -> PyResult<Bound<'py, PyDict>> {
    let all = PyDict::new(py);
    for (index, grid) in grids.iter().enumerate() {
        let rows: Vec<&ProfileRow> = rows.iter().filter(|row| row.profile == index).collect();
        let field = |values: &dyn Fn(&ProfileRow) -> Vec<f64>, shape: &[usize]| {
            let numbers: Vec<f64> = rows.iter().flat_map(|row| values(row)).collect();
            let bins = grid.axes.iter().map(|axis| axis.bins);
            let shape: Vec<usize> =
                [rows.len()].into_iter().chain(bins).chain(shape.iter().copied()).collect();
            column(py, numbers).reshape(shape) as PyResult<Bound<'py, PyArrayDyn<f64>>>
        };
        let table = PyDict::new(py);
        table.set_item("time", column(py, rows.iter().map(|row| row.time).collect()))?;
        let centers = PyDict::new(py);
        for axis in &grid.axes {
            centers.set_item(["x", "y", "z"][axis.axis], column(py, GridAxis::centers(axis)))?;
        }
        table.set_item("centers", centers)?;
        table.set_item("density", field(&|row| row.density.clone(), &[])?)?;
        table.set_item("mass_density", field(&|row| row.mass_density.clone(), &[])?)?;
        let velocity = |row: &ProfileRow| row.velocity.iter().flat_map(glam::DVec3::to_array).collect();
        table.set_item("velocity", field(&velocity, &[3])?)?;
        table.set_item("temperature", field(&|row| row.temperature.clone(), &[])?)?;
        table.set_item("pressure", field(&|row| row.pressure.clone(), &[dimension; 2])?)?;
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
        table.set_item("value", column(py, correlation.value.clone()))?;
        table.set_item("error", column(py, correlation.error.clone()))?;
        let counts: Vec<i64> = correlation.count.iter().map(|&count| count as i64).collect();
        table.set_item("count", column(py, counts))?;
        all.set_item(correlation.name, table)?;
    }
    Ok(all)
}
