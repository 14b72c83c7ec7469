//! Scenes: their checks, templates, schema, and the recorded states they may start from.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use glam::DVec3;
use haff_scene::{MeshFile, Scene, State, StateSource};
use numpy::{PyArray2, PyReadonlyArrayDyn};
use parking_lot::Mutex;
use pyo3::{exceptions::PyValueError, intern, prelude::*};

use crate::{arrays, errors, threads};

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
    /// Reads and checks it; `files` reads the states it starts from.
    pub fn scene(&self, py: Python<'_>, files: &Files) -> PyResult<Scene> {
        // Packing many particles takes long: other Python threads may run.
        py.detach(|| threads::shared(|| haff_scene::parse(&self.name, &self.text, &self.overrides, files)))
            .map_err(errors::threads)?
            .map_err(|errors| errors::scene(py, &errors, self.has_file))
    }

    /// Name in error messages.
    pub fn name(&self) -> &str {
        &self.name
    }
}

/// Recorded states, read by `haff.scenes.recorded_state` through h5py: no HDF5 is linked here. Each is read
/// once, so that keys of a simulation can change when the file it started from has changed or is gone.
#[derive(Default)]
pub struct Files(Mutex<HashMap<(PathBuf, i64), State>>);

impl StateSource for Files {
    fn state(&self, path: &Path, index: i64) -> Result<State, String> {
        let key = (path.to_owned(), index);
        if let Some(state) = self.0.lock().get(&key) {
            return Ok(state.clone());
        }
        // Without the lock: another thread may wait for it with the interpreter's.
        let state = Python::attach(|py| state(py, path, index).map_err(|error| error.value(py).to_string()))?;
        self.0.lock().insert(key, state.clone());
        Ok(state)
    }
}

fn state(py: Python<'_>, path: &Path, index: i64) -> PyResult<State> {
    let module = py.import(intern!(py, "haff.scenes"))?;
    let stored = module.call_method1(intern!(py, "recorded_state"), (path, index))?;
    let reals = |name: &str| -> PyResult<Option<Vec<f64>>> {
        let values = stored.get_item(name)?;
        if values.is_none() {
            return Ok(None);
        }
        Ok(Some(values.extract::<PyReadonlyArrayDyn<f64>>()?.as_array().iter().copied().collect()))
    };
    let vectors = |name: &str| -> PyResult<Option<Vec<DVec3>>> {
        Ok(reals(name)?.map(|flat| flat.chunks_exact(3).map(DVec3::from_slice).collect()))
    };
    let image = stored.get_item("image")?;
    let image = if image.is_none() {
        None
    } else {
        let flat = image.extract::<PyReadonlyArrayDyn<i32>>()?;
        Some(flat.as_array().iter().copied().collect::<Vec<_>>().as_chunks().0.to_vec())
    };
    Ok(State {
        size: vectors("size")?.and_then(|size| size.first().copied()),
        sheared_edges: if stored.contains("edges")? {
            vectors("edges")?.and_then(|edges| edges.try_into().ok())
        } else {
            None
        },
        position: vectors("position")?.unwrap_or_default(),
        velocity: vectors("velocity")?,
        angular_velocity: if stored.contains("angular_velocity")? {
            vectors("angular_velocity")?
        } else {
            None
        },
        image,
        radius: reals("radius")?.unwrap_or_default(),
        mass: reals("mass")?,
        precision: stored.get_item("precision")?.extract()?,
    })
}

/// Raises `SceneError` unless the scene is valid; returns it with every default and override written out.
// Taken from a dict, by value.
#[allow(clippy::needless_pass_by_value)]
#[pyfunction]
pub fn validate(py: Python<'_>, source: Source) -> PyResult<String> {
    Ok(source.scene(py, &Files::default())?.resolved)
}

/// Corners of the triangles of a file, `[3 F, 3]`, and its hash. Raises `ValueError` with what is wrong, the
/// end of a sentence.
// Taken from Python, by value.
#[allow(clippy::needless_pass_by_value)]
#[pyfunction]
pub fn mesh(py: Python<'_>, path: PathBuf) -> PyResult<(Bound<'_, PyArray2<f64>>, String)> {
    let file = py.detach(|| MeshFile::read(&path));
    let MeshFile { corners, hash } = file.map_err(|error| PyValueError::new_err(error.to_string()))?;
    Ok((arrays::vectors(py, corners.into_flattened())?, hash))
}

/// The JSON Schema of scene files.
#[pyfunction]
pub fn schema() -> String {
    haff_scene::schema().to_string()
}

/// Names of the totals of a run that are numbers.
#[pyfunction]
pub fn total_names() -> Vec<&'static str> {
    haff_engine::total_names().collect()
}

/// Observables of which a mean has no meaning, beside the terms of the energy balance.
#[pyfunction]
pub fn names_without_means() -> [&'static str; 3] {
    haff_engine::NO_MEANS
}

/// Paths and texts of the files of a scene.
type NamedTexts = Vec<(&'static str, &'static str)>;

/// Name, title and text of every shipped scene, and the files that it names.
#[pyfunction]
pub fn templates() -> Vec<(&'static str, &'static str, &'static str, NamedTexts)> {
    haff_scene::templates()
        .map(|template| (template.name, template.title(), template.text, template.files.to_vec()))
        .collect()
}
