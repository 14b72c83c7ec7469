//! Scenes: their checks, templates, schema, and the recorded states they may start from.

use std::path::Path;

use glam::DVec3;
use haff_scene::{Scene, State, StateSource};
use numpy::PyReadonlyArrayDyn;
use pyo3::{intern, prelude::*};

use crate::errors;

/// A scene passed from Python.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct Source {
    /// Name in error messages: the file's path.
    name: String,
    /// TOML.
    text: String,
    /// `KEY=VALUE`, later ones win.
    overrides: Vec<String>,
    /// Whether the text is that of a file, whose lines errors may name.
    has_file: bool,
}

impl Source {
    /// Reads and checks it.
    pub fn scene(&self, py: Python<'_>) -> PyResult<Scene> {
        // Packing many particles takes long: other Python threads may run.
        py.detach(|| haff_scene::parse(&self.name, &self.text, &self.overrides, &Files))
            .map_err(|errors| errors::scene(py, &errors, self.has_file))
    }

    /// Name in error messages.
    pub fn name(&self) -> &str {
        &self.name
    }
}

/// Recorded states, read by `haff.scenes.last_state` through h5py: no HDF5 is linked here.
struct Files;

impl StateSource for Files {
    fn last_state(&self, path: &Path) -> Result<State, String> {
        Python::attach(|py| state(py, path).map_err(|error| error.value(py).to_string()))
    }
}

fn state(py: Python<'_>, path: &Path) -> PyResult<State> {
    let module = py.import(intern!(py, "haff.scenes"))?;
    let stored = module.call_method1(intern!(py, "last_state"), (path,))?;
    let reals = |name: &str| -> PyResult<Vec<f64>> {
        Ok(stored.get_item(name)?.extract::<PyReadonlyArrayDyn<f64>>()?.as_array().iter().copied().collect())
    };
    let vectors = |name: &str| -> PyResult<Vec<DVec3>> {
        Ok(reals(name)?.chunks_exact(3).map(DVec3::from_slice).collect())
    };
    let image = stored.get_item("image")?.extract::<PyReadonlyArrayDyn<i32>>()?;
    Ok(State {
        size: DVec3::from_slice(&reals("size")?),
        position: vectors("position")?,
        velocity: vectors("velocity")?,
        image: image.as_array().iter().copied().collect::<Vec<_>>().as_chunks().0.to_vec(),
        radius: reals("radius")?,
        mass: reals("mass")?,
    })
}

/// Raises `SceneError` unless the scene is valid; returns it with every default and override written out.
// Taken from a dict, by value.
#[allow(clippy::needless_pass_by_value)]
#[pyfunction]
pub fn validate(py: Python<'_>, source: Source) -> PyResult<String> {
    Ok(source.scene(py)?.resolved)
}

/// The JSON Schema of scene files.
#[pyfunction]
pub fn schema() -> String {
    haff_scene::schema().to_string()
}

/// Name, description and text of every starter scene.
#[pyfunction]
pub fn templates() -> Vec<(&'static str, &'static str, &'static str)> {
    haff_scene::templates().to_vec()
}
