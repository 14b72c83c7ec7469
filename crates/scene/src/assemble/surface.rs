//! Walls that are surfaces of other crates.

use haff_mechanics::NamedSurface;

use super::{Assembler, values::item};
use crate::{
    config::WallConfig,
    plugins::{make_surface, surface_names},
};

impl Assembler<'_> {
    /// The surface of wall `k`, which names one of a plug-in.
    pub(super) fn surface(
        &mut self,
        k: usize,
        name: &str,
        config: &WallConfig,
    ) -> Option<&'static NamedSurface> {
        match make_surface(name, &config.parameters.clone().unwrap_or_default()) {
            None => {
                let known: Vec<String> = surface_names().iter().map(|name| format!("\"{name}\"")).collect();
                let known = if known.is_empty() { "this program has none".into() } else { known.join(", ") };
                let why = format!("must be one of these surfaces: {known}");
                self.document.refuse(&item("wall", k, "surface"), why);
                None
            }
            Some(Err(faults)) => {
                self.report_faults(&item("wall", k, "parameters"), faults);
                None
            }
            Some(Ok(surface)) => Some(surface),
        }
    }
}
