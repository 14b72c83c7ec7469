//! States that scenes start from, read from files.

use std::path::{Path, PathBuf};

use glam::DVec3;
use haff_scene::{State, StateSource, import::is_foreign};
use serde::Deserialize;

use crate::running::python;

/// Reads the states that scenes start from.
pub struct States;

impl StateSource for States {
    fn state(&self, path: &Path, index: i64) -> Result<State, String> {
        if is_foreign(path) {
            return foreign(path, index);
        }
        let state = haff_record::state(path, index).map_err(|error| error.to_string())?;
        Ok(State {
            size: Some(state.box_size),
            sheared_edges: state.sheared_edges,
            position: state.position,
            velocity: Some(state.velocity),
            angular_velocity: Some(state.angular_velocity).filter(|spins| !spins.is_empty()),
            image: Some(state.image),
            radius: state.radius,
            mass: Some(state.mass),
            precision: 0.0,
        })
    }
}

/// States for a run that is resumed: particles come from the checkpoint, so any frame of the file itself is a
/// valid initial state of the scene; neither the state file that the run started from nor its meshes need to
/// exist.
pub struct OwnStates(pub PathBuf);

impl StateSource for OwnStates {
    fn state(&self, path: &Path, index: i64) -> Result<State, String> {
        States.state(&self.0, -1).or_else(|_| States.state(path, index))
    }

    fn mesh(&self, hash: &str) -> Option<Vec<[DVec3; 3]>> {
        haff_record::mesh(&self.0, hash).ok().flatten()
    }
}

/// What the Python package writes before the numbers.
#[derive(Debug, Deserialize)]
struct Header {
    count: usize,
    size: Option<[f64; 3]>,
    #[serde(default)]
    edges: Option<[[f64; 3]; 3]>,
    precision: f64,
    velocity: bool,
    mass: bool,
}

/// Reads a file of another program through the Python package, which has the libraries for it.
fn foreign(path: &Path, index: i64) -> Result<State, String> {
    let bytes = python::foreign_state(path, index)?;
    let damaged = || format!("{}: the Python package has returned no state", path.display());
    let end = bytes.iter().position(|&byte| byte == b'\n').ok_or_else(damaged)?;
    let header: Header = serde_json::from_slice(&bytes[..end]).map_err(|_| damaged())?;
    let mut numbers = bytes[end + 1..].as_chunks::<8>().0.iter().map(|&bytes| f64::from_le_bytes(bytes));
    let mut reals = |count: usize| -> Result<Vec<f64>, String> {
        let values: Vec<f64> = numbers.by_ref().take(count).collect();
        if values.len() == count { Ok(values) } else { Err(damaged()) }
    };
    let vectors = |flat: Vec<f64>| flat.chunks_exact(3).map(DVec3::from_slice).collect::<Vec<_>>();
    Ok(State {
        size: header.size.map(DVec3::from_array),
        sheared_edges: header.edges.map(|edges| edges.map(DVec3::from_array)),
        position: vectors(reals(3 * header.count)?),
        radius: reals(header.count)?,
        velocity: if header.velocity { Some(vectors(reals(3 * header.count)?)) } else { None },
        mass: if header.mass { Some(reals(header.count)?) } else { None },
        image: None,
        angular_velocity: None,
        precision: header.precision,
    })
}
