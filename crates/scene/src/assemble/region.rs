//! Where the particles of a species are at the start.

use glam::DVec3;
use haff_engine::{Dimension, bounds};
use haff_mechanics::Surface;
use haff_surfaces::{Revolution, Side, Sphere};

use super::Assembler;
use super::values::{item, positive};
use crate::config::{BallConfig, BarrelConfig, RegionConfig};
use crate::placement::packing::Region;

impl Assembler<'_> {
    /// The region of species `k`, if it has one and it is valid.
    pub(super) fn region(&mut self, k: usize, config: &RegionConfig) -> Option<Region> {
        let given = [config.cuboid.is_some(), config.sphere.is_some(), config.cylinder.is_some()];
        if given.iter().filter(|&&given| given).count() != 1 {
            let why = "must be one of box = [[…], […]], sphere = { center, radius } and cylinder = { point, axis, radius, length }";
            self.document.report(&item("species", k, "region"), why);
            return None;
        }
        match (&config.cuboid, &config.sphere, &config.cylinder) {
            (Some(corners), ..) => self.cuboid(k, corners),
            (_, Some(sphere), _) => self.ball(k, sphere),
            (.., Some(cylinder)) => self.barrel(k, cylinder),
            _ => None,
        }
    }

    fn cuboid(&mut self, k: usize, corners: &[Vec<f64>]) -> Option<Region> {
        let path = item("species", k, "region.box");
        let [low, high] = corners else {
            self.document.refuse(&path, "must have a lower and an upper corner: [[0, 0, 0], [5, 10, 10]]");
            return None;
        };
        let errors = self.document.count();
        let mut low = self.vector(&item("species", k, "region.box.0"), low);
        let mut high = self.vector(&item("species", k, "region.box.1"), high);
        let axes = self.dimension.count();
        if let Some(axis) = (0..axes).find(|&axis| low[axis] >= high[axis]) {
            let why =
                format!("must have its upper corner above the lower one along {}", ["x", "y", "z"][axis]);
            self.document.refuse(&path, why);
        }
        if self.dimension == Dimension::Two {
            (low.z, high.z) = (-bounds::LARGEST, bounds::LARGEST);
        }
        (self.document.count() == errors).then_some(Region::Cuboid { low, high })
    }

    /// The required point and the required radius of a part of a region.
    fn round(
        &mut self,
        k: usize,
        [point_key, radius_key]: [&str; 2],
        (point, radius): (&Option<Vec<f64>>, Option<f64>),
    ) -> Option<(DVec3, f64)> {
        let paths = [point_key, radius_key].map(|key| item("species", k, key));
        for (path, missing) in [(&paths[0], point.is_none()), (&paths[1], radius.is_none())] {
            if missing {
                self.document.report_missing(path, "missing: the region needs it");
            }
        }
        let errors = self.document.count();
        let point = self.vector(&paths[0], point.as_ref()?);
        let radius = radius.filter(|&radius| positive(&mut self.document, &paths[1], radius))?;
        (self.document.count() == errors).then_some((point, radius))
    }

    fn ball(&mut self, k: usize, config: &BallConfig) -> Option<Region> {
        let keys = ["region.sphere.center", "region.sphere.radius"];
        let (center, radius) = self.round(k, keys, (&config.center, config.radius))?;
        Some(Region::of(Box::new(Sphere { center, radius, side: Side::Inside })))
    }

    fn barrel(&mut self, k: usize, config: &BarrelConfig) -> Option<Region> {
        let keys = ["region.cylinder.point", "region.cylinder.radius"];
        let (point, radius) = self.round(k, keys, (&config.point, config.radius))?;
        let errors = self.document.count();
        let flat = self.dimension == Dimension::Two;
        let axis = match &config.axis {
            None if flat => DVec3::Z,
            Some(axis) if flat && axis.len() == 3 && axis[2] != 0.0 => DVec3::Z,
            Some(axis) => self.vector(&item("species", k, "region.cylinder.axis"), axis),
            None => {
                let path = item("species", k, "region.cylinder.axis");
                self.document.report_missing(&path, "missing: the region needs it");
                DVec3::Z
            }
        };
        if axis == DVec3::ZERO {
            self.document.refuse(&item("species", k, "region.cylinder.axis"), "must not be zero");
        }
        let path = item("species", k, "region.cylinder.length");
        let surface: Box<dyn Surface> = match config.length {
            Some(length) if positive(&mut self.document, &path, length) => {
                Box::new(Revolution::finite_cylinder(point, axis, radius, length, Side::Inside))
            }
            _ => Box::new(Revolution::cylinder(point, axis, radius, Side::Inside)),
        };
        (self.document.count() == errors).then(|| Region::of(surface))
    }
}
