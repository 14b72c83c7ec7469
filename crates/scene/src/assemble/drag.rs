//! A drag on all particles.

use glam::DVec3;
use haff_engine::{Drag, System, Wall, WallMotion};

use super::{
    Assembler,
    values::{item, positive},
};
use crate::config::DriveConfig;

/// A drag and the index of its `[[drive]]`.
pub(super) type DragPlan = (usize, Drag);

/// Whether the surface of a wall stays where it is.
fn stays(wall: &Wall) -> bool {
    match wall.motion {
        WallMotion::Fixed | WallMotion::Rotating(_) => true,
        WallMotion::Constant(motion) => wall.shape.is_none() && motion.velocity.dot(wall.normal) == 0.0,
        WallMotion::Oscillating(_) | WallMotion::Piston(_) | WallMotion::Shrinking(_) => false,
    }
}

impl Assembler<'_> {
    /// The drag of drive `k`. `given` is an earlier one.
    pub(super) fn drag(
        &mut self,
        k: usize,
        config: &DriveConfig,
        given: Option<&DragPlan>,
    ) -> Option<DragPlan> {
        let path = |key: &str| item("drive", k, key);
        if let Some((first, _)) = given {
            let why = format!("drive.{first} is a drag already: one acts on all particles");
            self.document.report(&path("kind"), why);
            return None;
        }
        if config.species.is_some() {
            let why = "a drag acts on all particles: their transformed time is the same (leave it out)";
            self.document.report(&path("species"), why);
        }
        let Some(time) = config.time else {
            let why = "missing: the time constant τ of dv/dt = −v/τ";
            self.document.report_missing(&path("time"), why);
            return None;
        };
        positive(&mut self.document, &path("time"), time);
        Some((k, Drag { time, rotational: config.rotational == Some(true) }))
    }

    /// Refuses what accelerates, or moves by itself, beside a drag.
    pub(super) fn check_drag(&mut self, plan: Option<&DragPlan>, system: &System) {
        let Some(&(k, _)) = plan else { return };
        let (domain, classes) = (&system.domain, &system.classes);
        let moving_wall = system.walls.iter().find(|wall| !stays(wall));
        let is_driven = |body: &haff_engine::Body| {
            classes[body.class as usize].mass == f64::INFINITY && body.velocity != DVec3::ZERO
        };
        let others = [
            (domain.gravity != DVec3::ZERO, "domain.gravity".to_owned()),
            (domain.shear.is_some(), "domain.shear".to_owned()),
            (domain.compression.is_some(), "domain.compression or [growth]".to_owned()),
            (
                moving_wall.is_some(),
                moving_wall.map_or_else(String::new, |wall| format!("a wall that moves, \"{}\"", wall.name)),
            ),
            (system.bodies.iter().any(is_driven), "bodies of infinite mass that move".to_owned()),
        ];
        for (_, what) in others.into_iter().filter(|(given, _)| *given) {
            let why = format!(
                "a drag does not work with {what}: flights are straight in its transformed time only where \
                 nothing else accelerates or moves"
            );
            self.document.report(&item("drive", k, "kind"), why);
        }
    }
}
