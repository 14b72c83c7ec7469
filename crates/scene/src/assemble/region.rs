//! Where the particles of a species are at the start.

use haff_engine::{Cuboid, Dimension, bounds};
use haff_surfaces::{Revolution, Side, Sphere};

use super::Assembler;
use super::values::item;
use crate::config::{BallConfig, BarrelConfig, RegionConfig};
use haff_placement::room::Region;

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
            (Some(corners), ..) => {
                let Cuboid { low, high } = self.cuboid(("species", k), "region.box", Some(corners))?;
                Some(Region::Cuboid { low, high })
            }
            (_, Some(sphere), _) => self.ball(k, sphere),
            (.., Some(cylinder)) => self.barrel(k, cylinder),
            _ => None,
        }
    }

    /// A box with edges along the axes, by its corners under a key of an entry of a list.
    pub(super) fn cuboid(
        &mut self,
        (list, k): (&str, usize),
        key: &str,
        corners: Option<&Vec<Vec<f64>>>,
    ) -> Option<Cuboid> {
        let path = item(list, k, key);
        let Some(corners) = corners else {
            self.document.report_missing(&path, "missing: a lower and an upper corner");
            return None;
        };
        let [low, high] = corners.as_slice() else {
            self.document.refuse(&path, "must have a lower and an upper corner: [[0, 0, 0], [5, 10, 10]]");
            return None;
        };
        let errors = self.document.count();
        let mut low = self.vector(&item(list, k, &format!("{key}.0")), low);
        let mut high = self.vector(&item(list, k, &format!("{key}.1")), high);
        let axes = self.dimension.count();
        if let Some(axis) = (0..axes).find(|&axis| low[axis] >= high[axis]) {
            let why =
                format!("must have its upper corner above the lower one along {}", ["x", "y", "z"][axis]);
            self.document.refuse(&path, why);
        }
        if self.dimension == Dimension::Two {
            (low.z, high.z) = (-bounds::LARGEST, bounds::LARGEST);
        }
        (self.document.count() == errors).then_some(Cuboid { low, high })
    }

    fn ball(&mut self, k: usize, config: &BallConfig) -> Option<Region> {
        let keys = ["region.sphere.center", "region.sphere.radius"];
        let (center, radius) =
            self.point_and_length(("species", k), keys, (&config.center, config.radius))?;
        Some(Region::Inside(Box::new(Sphere { center, radius, side: Side::Inside })))
    }

    fn barrel(&mut self, k: usize, config: &BarrelConfig) -> Option<Region> {
        let keys = ["region.cylinder.point", "region.cylinder.radius"];
        let (point, radius) = self.point_and_length(("species", k), keys, (&config.point, config.radius))?;
        let errors = self.document.count();
        let axis = self.axis(("species", k), "region.cylinder.axis", config.axis.as_ref());
        let surface = match self.length(("species", k), "region.cylinder.length", config.length) {
            Some(length) => Revolution::finite_cylinder(point, axis, radius, length, Side::Inside),
            None => Revolution::cylinder(point, axis, radius, Side::Inside),
        };
        (self.document.count() == errors).then(|| Region::Inside(Box::new(surface)))
    }
}
