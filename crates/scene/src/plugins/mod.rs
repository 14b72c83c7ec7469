/*!
What other crates add to scenes: laws of contact, surfaces, drives and probes, by the names that scenes have
for them.

*What is here.* [`Plugins`] is the list of a program, made once at its start; [`Parameters`] reads the
parameters of one entry of a scene, and collects what is wrong with them.

*What to change here.* A new kind of plug-in is a list of [`Plugins`] with a method that adds to it; the
section of scenes that may name one looks it up in `assemble/`, and lists the names in its schema
(`config/keys.rs`).

*May import* no other room; `haff_mechanics` has the laws.

*Begin with* [`Plugins`], and `examples/plugin` of the repository.
*/

mod parameters;
mod registry;

pub(crate) use parameters::Fault;
pub use parameters::Parameters;
pub use registry::{PluginError, Plugins};
pub(crate) use registry::{
    all_drive_names, drive_names, law_names, make_action, make_law, make_probe, make_surface, probe_names,
    surface_names,
};
