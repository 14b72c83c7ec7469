//! Planes with particles on both sides, and the holes in them.

use haff_engine::{Boundary, Domain, Hole, Partition, Shape, Wall, bounds};

use super::Assembler;
use super::particles::Rows;
use super::values::{item, positive};
use crate::config::{HoleConfig, WallConfig};

/// A center of a hole is in the plane if it is off by at most this part of its coordinates.
const IN_PLANE: f64 = 1e-9;

impl Assembler<'_> {
    /// The partition of wall `k`, if it is one: with a hole, or `two-sided`. Its plane has been checked.
    pub(super) fn partition(&mut self, k: usize, config: &WallConfig, wall: &Wall) -> Option<Partition> {
        let plane = config.plane.as_ref()?;
        if plane.hole.is_none() && plane.two_sided != Some(true) {
            return None;
        }
        if plane.two_sided == Some(false) {
            let why = "contradicts the hole: a plane with a hole is a partition";
            self.document.report(&item("wall", k, "plane.two-sided"), why);
        }
        let moves = [
            ("velocity", config.velocity.is_some() && config.mass.is_none()),
            ("motion", config.motion.is_some()),
            ("sticks", config.sticks == Some(true)),
        ];
        for (key, _) in moves.iter().filter(|(_, given)| *given) {
            let why = "does not work with a partition, a plane with particles on both sides";
            self.document.report(&item("wall", k, key), why);
        }
        if self.has_joints() {
            let why = "a partition does not work with pendulums, springs, rods or sticking contacts";
            self.document.report(&item("wall", k, "plane"), why);
        }
        let hole = plane.hole.as_ref().and_then(|hole| self.hole(k, hole, wall));
        Some(Partition { point: wall.point, normal: wall.normal, hole })
    }

    /// The hole of wall `k`.
    fn hole(&mut self, k: usize, config: &HoleConfig, wall: &Wall) -> Option<Hole> {
        let path = item("wall", k, "plane.hole.radius");
        let radius = config.radius.unwrap_or_else(|| {
            self.document.report_missing(&path, "missing: a hole needs a radius");
            1.0
        });
        positive(&mut self.document, &path, radius);
        let path = item("wall", k, "plane.hole.center");
        let Some(center) = &config.center else {
            self.document.report_missing(&path, "missing: a hole needs a center in the plane");
            return None;
        };
        let center = self.vector(&path, center);
        let off = (center - wall.point).dot(wall.normal);
        let scale = center.abs().max(wall.point.abs()).max_element().max(radius);
        if off.abs() > IN_PLANE * scale {
            self.document.refuse(&path, format!("must be in the plane: it is {off:e} above it"));
        }
        Some(Hole { center: center - wall.normal * off, radius })
    }

    /// Checks partitions against the box and the particles.
    pub(super) fn check_partitions(&mut self, walls: &[Wall], domain: &Domain, rows: &Rows) {
        let largest = (0..rows.bodies.len()).map(|row| rows.radius(row)).fold(0.0, f64::max);
        let first = walls.len().saturating_sub(self.planes());
        let configs = self.config.wall.clone().unwrap_or_default();
        let places = configs.iter().enumerate().filter(|(_, config)| config.has_shape()).map(|(k, _)| k);
        for (wall, k) in walls[first..].iter().zip(places) {
            let Some(Shape::Partition(partition)) = &wall.shape else { continue };
            let Some(hole) = &partition.hole else { continue };
            if domain.boundary[..self.dimension.count()].contains(&Boundary::Periodic) {
                let why = "does not work in a periodic box: use walls or open axes";
                self.document.report(&item("wall", k, "plane.hole"), why);
            }
            if hole.radius < largest * bounds::LEAST_HOLE {
                let why = format!("must be larger than the radius of every particle, {largest}");
                self.document.refuse(&item("wall", k, "plane.hole.radius"), why);
            }
        }
    }

    /// Number of entries of `[[wall]]` that are walls of their own.
    fn planes(&self) -> usize {
        self.config.wall.iter().flatten().filter(|wall| wall.has_shape()).count()
    }
}
