//! Errors of the engine and of scenes as the exceptions of `haff.errors`.

use haff_engine::Fault;
use haff_linkage::AnySimulationError;
use haff_record::RecordError;
use haff_scene::{Code, ErrorKind, Place, SceneError, SceneErrors, Words};
use pyo3::{import_exception, intern, prelude::*, types::PyDict};

use crate::recording::Ended;

mod python {
    use super::import_exception;

    import_exception!(haff.errors, ArgumentError);
    import_exception!(haff.errors, FileError);
    import_exception!(haff.errors, SceneError);
    import_exception!(haff.errors, SimulationError);
}

/// A scene's errors. Without a file, line numbers are omitted: they refer to generated text.
pub fn scene(py: Python<'_>, errors: &SceneErrors, has_file: bool) -> PyErr {
    if errors.kind() == ErrorKind::Unreadable {
        let texts = errors.errors.iter().map(|error| placed(error, has_file).told(Words::Python));
        return python::FileError::new_err(texts.collect::<Vec<_>>().join("\n"));
    }
    // Errors beyond the first ones are only counted: a last one has their number.
    let rest = (errors.more > 0).then(|| {
        let file = errors.errors.first().map_or("", |error| &error.file);
        SceneError::of_file(file, Code::Conflict, format!("and {} more", errors.more))
    });
    let all = errors.errors.iter().chain(&rest);
    let problems: PyResult<Vec<_>> = all.map(|error| problem(py, error, has_file)).collect();
    match problems {
        Ok(problems) => python::SceneError::new_err((problems,)),
        Err(error) => error,
    }
}

/// An error without a line, if that is one of generated text.
fn placed(error: &SceneError, has_file: bool) -> SceneError {
    let mut shown = error.clone();
    if !has_file && matches!(error.place, Place::File { .. }) {
        shown.place = Place::Whole;
    }
    shown
}

/// A `haff.errors.SceneProblem`.
fn problem(py: Python<'_>, error: &SceneError, has_file: bool) -> PyResult<Py<PyAny>> {
    let shown = placed(error, has_file);
    let line = match &shown.place {
        Place::File { line, .. } => Some(*line),
        Place::Override(_) | Place::Whole => None,
    };
    let fields = PyDict::new(py);
    fields.set_item("text", shown.told(Words::Python))?;
    fields.set_item("code", error.code.name())?;
    fields.set_item("file", &error.file)?;
    fields.set_item("line", line)?;
    fields.set_item("set", error.set_key())?;
    fields.set_item("key", &error.path)?;
    fields.set_item("value", &error.value)?;
    fields.set_item("message", &error.message)?;
    fields.set_item("allowed", &error.allowed)?;
    fields.set_item("meant", &error.meant)?;
    let class = py.import(intern!(py, "haff.errors"))?.getattr(intern!(py, "SceneProblem"))?;
    Ok(class.call_method1(intern!(py, "of"), (fields,))?.unbind())
}

/// An argument that is not possible.
pub fn argument(why: String) -> PyErr {
    python::ArgumentError::new_err(why)
}

/// A file that cannot be written.
pub fn record(error: &RecordError) -> PyErr {
    python::FileError::new_err(error.to_string())
}

/// What has ended a simulation that is recorded.
pub fn ended(py: Python<'_>, ended: &Ended, name: &str) -> PyErr {
    match ended {
        Ended::Simulation(error) => simulation(py, error, name),
        Ended::Record(error) => record(error),
    }
}

/// Threads that the system does not give.
pub fn threads(why: String) -> PyErr {
    python::SimulationError::new_err(why)
}

/// An error of a simulation, at its start or later.
pub fn simulation(py: Python<'_>, error: &AnySimulationError, name: &str) -> PyErr {
    if error.fault() != Fault::Invalid {
        return python::SimulationError::new_err(error.to_string());
    }
    let error = SceneError::of_file(name, Code::Conflict, error.to_string());
    match problem(py, &error, false) {
        Ok(problem) => python::SceneError::new_err((vec![problem],)),
        Err(error) => error,
    }
}
