//! Rust's vectors as NumPy arrays: ownership of the memory moves, nothing is copied, and arrays are
//! read-only.

use glam::DVec3;
use numpy::{Element, PyArray1, PyArray2, PyArrayMethods};
use pyo3::prelude::*;

/// `[N]`, read-only.
pub fn column<T: Element>(py: Python<'_>, values: Vec<T>) -> Bound<'_, PyArray1<T>> {
    let array = PyArray1::from_vec(py, values);
    array.readwrite().make_nonwriteable();
    array
}

/// `[N, 3]`, read-only.
fn rows<T: Element>(py: Python<'_>, values: Vec<T>) -> PyResult<Bound<'_, PyArray2<T>>> {
    let count = values.len() / 3;
    let array = PyArray1::from_vec(py, values).reshape([count, 3])?;
    array.readwrite().make_nonwriteable();
    Ok(array)
}

/// `[N, 3]` of floats.
pub fn vectors(py: Python<'_>, values: Vec<DVec3>) -> PyResult<Bound<'_, PyArray2<f64>>> {
    rows(py, bytemuck::cast_vec(values))
}

/// `[N, 3]` of integers.
pub fn triples(py: Python<'_>, values: Vec<[i32; 3]>) -> PyResult<Bound<'_, PyArray2<i32>>> {
    rows(py, values.into_flattened())
}

/// `[3]`.
pub fn vector(py: Python<'_>, value: DVec3) -> Bound<'_, PyArray1<f64>> {
    column(py, value.to_array().to_vec())
}
