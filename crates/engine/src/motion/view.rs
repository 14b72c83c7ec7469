//! The particles at the present, as actions and probes of other crates are given them.

use glam::DVec3;

use crate::{model::particles::Particles, state::world::World};

/// The particles of a world at the present.
#[derive(Clone, Copy)]
pub(crate) struct View<'a> {
    pub world: &'a World,
    /// 2 or 3.
    pub dimension: usize,
}

impl Particles for View<'_> {
    fn count(&self) -> u32 {
        self.world.particles.len() as u32
    }

    fn dimension(&self) -> usize {
        self.dimension
    }

    fn time(&self) -> f64 {
        self.world.clock.shown(self.world.now)
    }

    fn position(&self, i: u32) -> DVec3 {
        let now = self.world.now;
        self.world.wrap(self.world.state(i, now).0, now).0
    }

    fn velocity(&self, i: u32) -> DVec3 {
        self.world.peculiar(i, self.world.now).1
    }

    fn mass(&self, i: u32) -> f64 {
        self.world.class(i).mass
    }

    fn radius(&self, i: u32) -> f64 {
        self.world.class(i).radius
    }
}
