//! Walls that are surfaces of other crates.

use glam::DVec3;
use haff_engine::{Shape, Wall, WallMotion};

use super::{Assembler, values::item};
use crate::{
    config::WallConfig,
    plugins::{make_surface, surface_names},
};

impl Assembler<'_> {
    /// Wall `k`, which names a surface of a plug-in.
    pub(super) fn surface_wall(&mut self, k: usize, name: &str, config: &WallConfig) -> Option<Wall> {
        let refused = [
            ("plane", config.plane.is_some(), "does not belong to a surface: give either of them"),
            ("velocity", config.velocity.is_some(), "a surface does not move"),
            ("motion", config.motion.is_some(), "a surface does not move"),
            ("displacement", config.displacement.is_some(), "a surface does not move"),
            ("sticks", config.sticks == Some(true), "nothing sticks to a surface"),
        ];
        for (key, _, why) in refused.into_iter().filter(|(_, given, _)| *given) {
            self.document.report(&item("wall", k, key), why);
        }
        if self.has_joints() {
            let why = "a surface does not work with pendulums, springs, rods or sticking contacts";
            self.document.report(&item("wall", k, "surface"), why);
        }
        if self.config.contact.as_ref().and_then(|contact| contact.rest_speed).is_some_and(|v| v > 0.0) {
            let why = "a surface does not work with contact.rest_speed";
            self.document.report(&item("wall", k, "surface"), why);
        }
        if config.name.is_none() {
            self.document.report_missing(&item("wall", k, "name"), "missing: a wall needs a name");
        }
        let surface = match make_surface(name, &config.parameters.clone().unwrap_or_default()) {
            None => {
                let known: Vec<String> = surface_names().iter().map(|name| format!("\"{name}\"")).collect();
                let known = if known.is_empty() { "this program has none".into() } else { known.join(", ") };
                let why = format!("must be one of these surfaces: {known}");
                self.document.refuse(&item("wall", k, "surface"), why);
                return None;
            }
            Some(Err(faults)) => {
                self.report_faults(&item("wall", k, "parameters"), faults);
                return None;
            }
            Some(Ok(surface)) => surface,
        };
        // Of a surface without end no point is known.
        let (center, extent) = surface.get().bounds();
        let point = if extent.is_finite() { center + DVec3::splat(extent) } else { DVec3::ZERO };
        Some(Wall {
            name: config.name.clone().unwrap_or_default(),
            point,
            normal: DVec3::ZERO,
            motion: WallMotion::Fixed,
            shape: Some(Shape::Named(surface)),
        })
    }
}
