//! A container that shrinks with a box that is compressed.

use glam::DVec3;
use haff_engine::{Domain, Shape, Shrinking, Wall, WallMotion};

use super::{Assembler, domain::TOLERANCE, values::item};
use crate::config::{SideConfig, WallConfig, document::Path};

impl Assembler<'_> {
    /// Refuses walls beside those of the domain in a box that is compressed, by the key `name` at `path`, but
    /// for one container. `is_uniform`: along all axes at the same rate.
    pub(super) fn check_container(&mut self, path: &Path, name: &str, is_uniform: bool, extra: &[Wall]) {
        let [container] = extra else {
            if !extra.is_empty() {
                let why = "works with one wall beside those of domain.boundary: a container";
                self.document.report(path, why);
            }
            return;
        };
        let configs = self.config.wall.clone().unwrap_or_default();
        let Some(k) = configs.iter().position(|config| config.name.as_deref() == Some(&container.name))
        else {
            return;
        };
        let config = &configs[k];
        if !is_container(config) {
            let why = format!(
                "does not shrink with the box ({name}): only a cylinder, a sphere and a cone with particles inside do"
            );
            self.document.report(&item("wall", k, "name"), why);
        }
        if !is_uniform {
            let why = format!("shrinks with the box only along all axes at the same rate ({name})");
            self.document.report(&item("wall", k, "name"), why);
        }
        let keys = [
            ("velocity", config.velocity.is_some()),
            ("motion", config.motion.is_some()),
            ("rotation", config.rotation.is_some()),
            ("offset", config.offset.is_some()),
            ("passes", config.passes.is_some()),
        ];
        for (key, _) in keys.into_iter().filter(|(_, given)| *given) {
            self.document
                .report(&item("wall", k, key), format!("does not work for a wall that shrinks ({name})"));
        }
    }

    /// Lets the walls from row `first` on shrink with the domain, which has the volume inside of them.
    pub(super) fn shrink_container(&mut self, walls: &mut [Wall], first: usize, domain: &mut Domain) {
        let (size, d) = (domain.size, self.dimension.count());
        let Some(compression) = &mut domain.compression else { return };
        for wall in &mut walls[first..] {
            let Some(Shape::Named(surface)) = wall.shape else { continue };
            let configs = self.config.wall.as_deref().unwrap_or_default();
            let Some(k) = configs.iter().position(|config| config.name.as_deref() == Some(&wall.name)) else {
                continue;
            };
            let surface = surface.get();
            let is_inside = |[low, high]: [DVec3; 2]| {
                (0..d).filter(|&axis| !surface.is_same_along(axis)).all(|axis| {
                    low[axis] >= -TOLERANCE * size[axis] && high[axis] <= (1.0 + TOLERANCE) * size[axis]
                })
            };
            let volume = surface.volume(d, size).filter(|_| surface.enclosure().is_some_and(is_inside));
            let Some(volume) = volume else {
                let why = "must be inside of the box with which it shrinks, and closed";
                self.document.report(&item("wall", k, "name"), why);
                continue;
            };
            let box_volume: f64 = size.to_array()[..d].iter().product();
            compression.inside = (volume / box_volume).min(1.0);
            let rate = compression.rates.x;
            wall.motion = WallMotion::Shrinking(Shrinking { rate, speed: rate.abs() * size.length() });
        }
    }
}

/// Whether a wall is a container of a shape that can shrink.
fn is_container(config: &WallConfig) -> bool {
    let of = |side: Option<SideConfig>| side.unwrap_or(SideConfig::Inside) == SideConfig::Inside;
    config.cylinder.as_ref().is_some_and(|cylinder| of(cylinder.side))
        || config.sphere.as_ref().is_some_and(|sphere| of(sphere.side))
        || config.cone.as_ref().is_some_and(|cone| of(cone.side))
}
