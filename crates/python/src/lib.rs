//! The compiled module `haff._engine`: simulations that Python advances step by step, and the text of scenes.
//!
//! It links the engine, the linkages and the reader of scenes, but not HDF5: h5py contains its own copy, and
//! two copies in one process conflict. Runs that write files are made by the command `haff`, which is in the
//! same wheel. The public interface is the Python around it (`python/haff/live/simulation.py` and others);
//! signatures and shapes are in `_engine.pyi`.

// Without the feature this crate is empty, and pyo3 is not compiled.
#![cfg(feature = "python")]

mod arrays;
mod errors;
mod events;
mod keys;
mod measured;
mod observables;
mod recording;
mod scenes;
mod simulation;
mod text;
mod threads;

/// The module.
#[pyo3::pymodule]
mod _engine {
    #[pymodule_export]
    use super::{
        observables::mean,
        scenes::{mesh, names_without_means, schema, templates, total_names, validate},
        simulation::Simulation,
        text::{document, value},
    };

    // The form that pyo3 asks for.
    #[allow(clippy::unnecessary_wraps)]
    #[pymodule_init]
    fn init(_module: &pyo3::Bound<'_, pyo3::types::PyModule>) -> pyo3::PyResult<()> {
        super::threads::remember_process();
        Ok(())
    }

    #[pymodule_export]
    const VERSION: &str = env!("CARGO_PKG_VERSION");
    #[pymodule_export]
    const TRAJECTORY_VERSION: u32 = haff_engine::TRAJECTORY_VERSION;
}
