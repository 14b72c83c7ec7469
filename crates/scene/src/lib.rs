//! Scene files of haff: TOML to a validated system.
//!
//! [`load`] and [`parse`] take a scene file, overrides by dotted path and a source of recorded states, and return
//! a [`Scene`]: particles placed and moving, walls, contact rules, and plans of the run and its output. Or they return
//! [`SceneErrors`]: *all* errors found, each with its line, key, value and what is allowed. No input makes them panic.
//!
//! The way of the data: text → a tree that knows its lines → [`config::SceneConfig`] (serde, unknown keys
//! refused) → checks, defaults, packings and velocities → [`Scene`]. Every random number comes from a stream of its own
//! for purpose, species and particle, so a scene gives the same system on any machine and any number of threads.
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

mod build;
pub mod config;
mod document;
mod error;
#[cfg(test)]
mod fuzz;
mod grid;
pub mod joints;
mod packing;
mod random;
mod scene;
mod schema;
mod state;
mod templates;
mod velocity;

use std::path::Path;

pub use error::{ErrorKind, Place, SceneError, SceneErrors};
pub use scene::{OutputPlan, RunPlan, Scene, Schedule};
pub use schema::schema;
pub use state::{NoStates, State, StateSource};
pub use templates::templates;

/// Reads and validates the scene file at `path` (relative to the current directory) with `overrides`
/// (`KEY=VALUE` by dotted path, array elements by index or name, values in TOML; later ones win).
///
/// # Errors
/// All errors found; [`SceneErrors::kind`] tells an invalid scene from a file that cannot be read.
pub fn load(path: &Path, overrides: &[String], states: &dyn StateSource) -> Result<Scene, SceneErrors> {
    let name = path.display().to_string();
    let text = std::fs::read_to_string(path).map_err(|why| build::unreadable(&name, &why))?;
    parse(&name, &text, overrides, states)
}

/// Validates the text of a scene; `name` stands for the file in errors. See [`load`].
///
/// # Errors
/// All errors found.
pub fn parse(
    name: &str,
    text: &str,
    overrides: &[String],
    states: &dyn StateSource,
) -> Result<Scene, SceneErrors> {
    build::build(name, text, overrides, states, build::Limits::of_this_machine())
}
