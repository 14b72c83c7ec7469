//! Pistons: planes of finite mass.

use haff_engine::{Piston, Wall, WallMotion, bounds};

use super::domain::DomainPlan;
use super::values::{item, positive};
use super::{Assembler, Start};
use crate::config::WallConfig;

/// A velocity is along the normal if the rest of it is at most this part of it.
const ALONG: f64 = 1e-9;

impl Assembler<'_> {
    /// Gives wall `k`, a plane without end, the motion of a piston, if it is one. Its plane and its velocity
    /// have been checked.
    pub(super) fn piston(&mut self, k: usize, config: &WallConfig, wall: &mut Wall, domain: &DomainPlan) {
        let Some(mass) = config.mass else {
            self.refuse_force(k, config);
            return;
        };
        let errors = self.document.count();
        let path = |key: &str| item("wall", k, key);
        positive(&mut self.document, &path("mass"), mass);
        let force = config.force.unwrap_or(0.0);
        if bounds::component(force).is_err() {
            self.document.refuse(&path("force"), bounds::FINITE);
        }
        let others = [
            ("motion", config.motion.is_some()),
            ("rotation", config.rotation.is_some()),
            ("reference_time", config.reference_time.is_some()),
            ("temperature", config.temperature.is_some()),
            ("sticks", config.sticks == Some(true)),
            ("plane.hole", config.plane.as_ref().is_some_and(|plane| plane.hole.is_some())),
        ];
        for (key, _) in others.into_iter().filter(|(_, given)| *given) {
            self.document.report(&path(key), "does not work with mass: a piston moves by its impacts alone");
        }
        if self.has_joints() {
            let why = "a piston does not work with pendulums, springs, rods or sticking contacts";
            self.document.report(&path("mass"), why);
        }
        if self.config.contact.as_ref().and_then(|contact| contact.rest_speed).is_some_and(|v| v > 0.0) {
            let why = "a piston does not work with contact.rest_speed: grains under it are never at rest";
            self.document.report(&path("mass"), why);
        }
        let velocity = match &wall.motion {
            WallMotion::Constant(motion) => motion.velocity,
            _ => glam::DVec3::ZERO,
        };
        let speed = velocity.dot(wall.normal);
        if (velocity - wall.normal * speed).length() > ALONG * velocity.length() {
            let why = "must be along the normal: a piston is guided along it";
            self.document.refuse(&path("velocity"), why);
        }
        if self.document.count() == errors {
            let mut piston = Piston::new(mass, force, speed, (wall.normal, domain.gravity));
            if let Start::Present(present) = self.start
                && self.sets_piston(k)
            {
                piston.since = present.at;
            }
            wall.motion = WallMotion::Piston(piston);
        }
    }

    /// Refuses the keys of a piston for walls that cannot be one.
    pub(super) fn refuse_piston(&mut self, k: usize, config: &WallConfig) {
        if config.mass.is_some() {
            let why = "only a plane without end is a piston: give plane = { point = […], normal = […] }";
            self.document.report(&item("wall", k, "mass"), why);
        }
        self.refuse_force(k, config);
    }

    fn refuse_force(&mut self, k: usize, config: &WallConfig) {
        if config.force.is_some() && config.mass.is_none() {
            let why = "is the load of a piston: give its mass, too";
            self.document.report(&item("wall", k, "force"), why);
        }
    }
}
