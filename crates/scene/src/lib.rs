//! Scene files of haff: TOML to a validated system.
//!
//! [`load`] and [`parse`] take a scene file, overrides by dotted path and a source of recorded states, and
//! return a [`Scene`]: particles placed and moving, walls, contact rules, and plans of the run and its
//! output. Or they return [`SceneErrors`]: *all* errors found, each with its line, key, value and what is
//! allowed; the first twenty are kept, the others counted. No input makes them panic, and the time they take
//! is linear in the length of the text.
//!
//! Data flow: text → a tree of values with line numbers → [`config::SceneConfig`] (serde, unknown keys
//! refused) → checks, defaults, packings and velocities (`assemble`) → [`Scene`]. There is a stream of random
//! numbers for each purpose, species and particle, so a scene gives the same system on any machine and any
//! number of threads.
//!
//! ```
//! let text = r#"
//!     schema = 1
//!     domain = { packing_fraction = 0.1 }
//!     species = [{ name = "grain", count = 500, radius = 0.5, mass = 1.0 }]
//!     contact = { restitution = 0.9 }
//!     run = { until = 10.0 }
//! "#;
//! let scene = haff_scene::parse("gas.toml", text, &[], &haff_scene::NoStates)?;
//! assert_eq!(scene.system.bodies.len(), 500);
//!
//! let overrides = ["contact.restitution=1.2".to_owned()];
//! let errors = haff_scene::parse("gas.toml", text, &overrides, &haff_scene::NoStates).unwrap_err();
//! assert_eq!(errors.to_string(), "--set contact.restitution=1.2: must be in [0, 1]");
//! # Ok::<(), haff_scene::SceneErrors>(())
//! ```

// Docs give units in brackets, as [length]: these are not links, and escapes would show in the JSON Schema.
#![allow(rustdoc::broken_intra_doc_links)]

mod source;

mod plugins;

pub mod config;

mod model;

mod placement;

mod assemble;

#[cfg(test)]
mod fuzz;

use std::fs::File;
use std::io::{self, Read};
use std::path::Path;

pub use assemble::CHANGEABLE;
pub use config::{
    joints,
    schema::schema,
    templates::{Template, template, templates},
};
pub use glam::DVec3;
pub use haff_engine::{Action, Column, DrivenParticles, Exchange, Particles, Partner, Probe, VelocityChange};
pub use haff_mechanics::{ContactLaw, NormalContact, RelativeFlight, Surface};
pub use model::{
    present::Present,
    scene::{
        BoxLimit, BoxTooSmall, Grown, GrowthEnd, GrowthRun, OutputPlan, RunPlan, Scene, Schedule, UntilOf,
    },
    schedule::{Due, Records, Times},
    state::{NoStates, State, StateSource},
};
pub use placement::import;
pub use plugins::{Parameters, PluginError, Plugins};
use source::weight;
pub use source::{
    error::{Code, ErrorKind, Place, SceneError, SceneErrors, Words},
    mesh::{MeshFile, MeshFileError},
    text,
    weight::LONGEST_FILE,
};

/// Reads and validates the scene file at `path` (relative to the current directory) with `overrides`
/// (`KEY=VALUE` by dotted path, array elements by index or name, values in TOML; later ones win).
///
/// # Errors
/// All errors found; [`SceneErrors::kind`] distinguishes an invalid scene from a file that cannot be read.
pub fn load(path: &Path, overrides: &[String], states: &dyn StateSource) -> Result<Scene, SceneErrors> {
    let text = read_text(path)?;
    parse(&path.display().to_string(), &text, overrides, states)
}

/// The text of the scene file at `path`, for use by other parsers than [`parse`].
///
/// # Errors
/// If it cannot be read, is not text or is too long, or if reading it might exceed the free memory.
pub fn read(path: &Path) -> Result<String, SceneErrors> {
    let text = read_text(path)?;
    match check_weight(&text) {
        Ok(()) => Ok(text),
        Err(message) => Err(assemble::invalid(&path.display().to_string(), message)),
    }
}

/// Whether a TOML text can be parsed in the free memory and a common stack: some short ones take gigabytes.
///
/// # Errors
/// A message with the limit that is exceeded.
pub fn check_weight(text: &str) -> Result<(), String> {
    weight::Weight::of_document(text).check(assemble::Limits::of_this_machine().memory)
}

/// The text of a file, pipe or device, of which at most [`LONGEST_FILE`] bytes are read.
fn read_text(path: &Path) -> Result<String, SceneErrors> {
    let name = path.display().to_string();
    let unreadable = |why: &io::Error| assemble::unreadable(&name, why);
    let mut bytes = Vec::new();
    let mut file = File::open(path).map_err(|why| unreadable(&why))?;
    let long = file.metadata().is_ok_and(|metadata| metadata.len() > LONGEST_FILE);
    // Of a file that is too long, enough bytes to determine whether it is text.
    let most = if long { 1 << 12 } else { LONGEST_FILE + 1 };
    file.by_ref().take(most).read_to_end(&mut bytes).map_err(|why| unreadable(&why))?;
    let cut_short = long || bytes.len() as u64 > LONGEST_FILE;
    match String::from_utf8(bytes) {
        Ok(_) if cut_short => Err(assemble::too_long(&name)),
        // The last character may have been cut in two.
        Err(error) if cut_short && error.utf8_error().error_len().is_none() => Err(assemble::too_long(&name)),
        Ok(text) => Ok(text),
        Err(error) => Err(unreadable(&io::Error::new(io::ErrorKind::InvalidData, error))),
    }
}

/// Validates the text of a scene; `name` is the name of the file in errors. See [`load`].
///
/// # Errors
/// All errors found. A text of more than [`LONGEST_FILE`] bytes, or one that might exceed the free
/// memory, is refused.
pub fn parse(
    name: &str,
    text: &str,
    overrides: &[String],
    states: &dyn StateSource,
) -> Result<Scene, SceneErrors> {
    let limits = assemble::Limits::of_this_machine();
    assemble::assemble(name, text, overrides, states, assemble::Start::Scene, limits)
}

/// The scene that a file has recorded, for a run that is resumed. Its particles are in the checkpoint of the
/// file: the scene does not place them, and positions at the start are not checked. Walls that have changed
/// on the way need not suit them. `overrides` are of keys that no wall and no state depends on.
///
/// # Errors
/// All errors found.
pub fn parse_recorded(
    name: &str,
    text: &str,
    overrides: &[String],
    states: &dyn StateSource,
) -> Result<Scene, SceneErrors> {
    let limits = assemble::Limits::of_this_machine();
    assemble::assemble(name, text, overrides, states, assemble::Start::Recorded, limits)
}

/// A recorded scene with changed keys, for a run that goes on from `present`; the keys must be among
/// `changeable`, all of which are [`CHANGEABLE`].
///
/// Keys act from now on. A wall whose velocity or motion changes goes on from where it is
/// ([`haff_engine::Wall::going_on`]): the resolved scene has the `plane.point`, `phase`, `reference_time` and
/// `displacement` that follow. A wall jumps only where `plane.point`, `displacement`, `reference_time` or
/// `motion.phase` is set. Whether particles overlap is left to [`haff_engine::Simulation::change_system`].
///
/// # Errors
/// All errors found.
pub fn parse_changed(
    name: &str,
    text: &str,
    overrides: &[String],
    changeable: &[&str],
    states: &dyn StateSource,
    present: &Present,
) -> Result<Scene, SceneErrors> {
    let (start, limits) = (assemble::Start::Present(present), assemble::Limits::of_this_machine());
    assemble::assemble_changed(name, text, overrides, changeable, states, start, limits)
}
