//! Python values as TOML.

use pyo3::{
    exceptions::{PyTypeError, PyValueError},
    prelude::*,
    types::{PyBool, PyDict, PyFloat, PyInt, PyList, PyString, PyTuple},
};
use serde::{
    Serialize, Serializer,
    ser::{Error, SerializeMap, SerializeSeq},
};

/// Limit of nesting, which bounds the stack; scenes nest at most four deep.
const MAX_DEPTH: usize = 16;

/// A Python value, and the dotted path that leads to it.
struct Node<'py> {
    object: Bound<'py, PyAny>,
    path: Vec<String>,
}

impl<'py> Node<'py> {
    fn root(object: &Bound<'py, PyAny>, name: &str) -> Self {
        let path = if name.is_empty() { Vec::new() } else { vec![name.to_owned()] };
        Self { object: object.clone(), path }
    }

    fn child(&self, name: String, object: Bound<'py, PyAny>) -> Self {
        Self { object, path: [self.path.as_slice(), &[name]].concat() }
    }

    fn refuse<E: Error>(&self, why: impl std::fmt::Display) -> E {
        let path = if self.path.is_empty() { "scene".to_owned() } else { self.path.join(".") };
        E::custom(format!("{path}: {why}"))
    }

    fn list<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let items = self.object.try_iter().and_then(Iterator::collect::<PyResult<Vec<_>>>);
        let items = items.map_err(|error| self.refuse::<S::Error>(error))?;
        let mut list = serializer.serialize_seq(Some(items.len()))?;
        for (k, item) in items.into_iter().enumerate() {
            list.serialize_element(&self.child(k.to_string(), item))?;
        }
        list.end()
    }

    fn table<S: Serializer>(&self, table: &Bound<'py, PyDict>, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(Some(table.len()))?;
        for (key, value) in table {
            let Ok(key) = key.extract::<String>() else {
                return Err(self.refuse(format_args!("keys must be strings, not {key}")));
            };
            map.serialize_entry(&key, &self.child(key.clone(), value))?;
        }
        map.end()
    }
}

impl Serialize for Node<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let object = &self.object;
        let failed = |error: PyErr| self.refuse::<S::Error>(error);
        if self.path.len() > MAX_DEPTH {
            return Err(self.refuse("nested too deep"));
        }
        if object.is_instance_of::<PyBool>() {
            serializer.serialize_bool(object.extract().map_err(failed)?)
        } else if object.is_instance_of::<PyInt>() {
            serializer.serialize_i64(
                object
                    .extract()
                    .map_err(|_| self.refuse::<S::Error>(format_args!("{object} does not fit in 64 bits")))?,
            )
        } else if object.is_instance_of::<PyFloat>() {
            serializer.serialize_f64(object.extract().map_err(failed)?)
        } else if object.is_instance_of::<PyString>() {
            serializer.serialize_str(&object.extract::<String>().map_err(failed)?)
        } else if let Ok(table) = object.cast::<PyDict>() {
            self.table(table, serializer)
        } else if object.is_instance_of::<PyList>() || object.is_instance_of::<PyTuple>() {
            self.list(serializer)
        } else if let Ok(plain) = object.call_method0("tolist") {
            // NumPy's arrays and scalars, and objects with the same interface.
            Node { object: plain, path: self.path.clone() }.serialize(serializer)
        } else if let Ok(path) = object.call_method0("__fspath__") {
            Node { object: path, path: self.path.clone() }.serialize(serializer)
        } else {
            let kind = object.get_type();
            Err(self.refuse(format_args!("{kind} has no form in TOML; leave a key out for its default")))
        }
    }
}

fn refused(error: &toml::ser::Error) -> PyErr {
    PyTypeError::new_err(error.to_string())
}

/// A scene as TOML text, its keys in the order of the dict.
#[pyfunction]
pub fn document(scene: &Bound<'_, PyDict>) -> PyResult<String> {
    toml::to_string(&Node::root(scene.as_any(), "")).map_err(|error| refused(&error))
}

/// A value as TOML on one line, as for `--set`; `name` is its name in errors.
#[pyfunction]
pub fn value(value: &Bound<'_, PyAny>, name: &str) -> PyResult<String> {
    let mut text = String::new();
    Node::root(value, name)
        .serialize(toml::ser::ValueSerializer::new(&mut text))
        .map_err(|error| refused(&error))?;
    if text.contains('\n') {
        return Err(PyValueError::new_err(format!("{name}: must fit on one line")));
    }
    Ok(text)
}
