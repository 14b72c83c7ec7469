//! Distances from walls, and contacts with them.

use glam::DVec3;

use crate::{
    model::{Shape, wall_motion::Approach},
    numerics::clock::HORIZON,
    state::{particle::Particle, world::World},
};

impl World {
    /// Signed distance of a particle's surface from a wall and its rate of change, for a particle at
    /// `position` with `velocity` at `ticks`.
    #[inline]
    pub fn wall_approach(
        &self,
        wall: u32,
        radius: f64,
        position: DVec3,
        velocity: DVec3,
        ticks: i64,
    ) -> (f64, f64) {
        if let Some(shape) = &self.boundary.walls[wall as usize].shape {
            let (distance, rate) = shape.surface().approach(position, velocity);
            return (distance - radius, rate);
        }
        if self.is_level(wall) {
            let wall = &self.boundary.walls[wall as usize];
            let contact = wall.point.dot(wall.normal) + radius;
            return (position.dot(wall.normal) - contact, velocity.dot(wall.normal));
        }
        let wall = &self.boundary.walls[wall as usize];
        let mut point = wall.point;
        let mut relative = velocity;
        if wall.motion.is_moving() {
            point += wall.motion.displacement(wall.normal, (&self.clock, ticks));
            relative -= wall.motion.velocity(wall.normal, (&self.clock, ticks));
        }
        ((position - point).dot(wall.normal) - radius, relative.dot(wall.normal))
    }

    /// Time from an anchor until its flight touches a wall \[ticks\]; `None` if it never does.
    #[inline(always)]
    pub fn wall_contact(
        &self,
        anchor: &Particle,
        radius: f64,
        acceleration: DVec3,
        wall: u32,
    ) -> Option<f64> {
        if let Some(shape) = &self.boundary.walls[wall as usize].shape {
            return self.surface_contact(anchor, radius, acceleration, shape);
        }
        let (distance, rate) =
            self.wall_approach(wall, radius, anchor.position, anchor.velocity, anchor.time);
        let wall = &self.boundary.walls[wall as usize];
        let approach = Approach {
            distance,
            rate,
            speed: anchor.velocity.dot(wall.normal),
            acceleration: acceleration.dot(wall.normal),
        };
        let delay = wall.motion.time_to_contact(&approach, (&self.clock, anchor.time))?;
        Some(delay * self.clock.per_time)
    }

    /// [`Self::wall_contact`] for a wall that is no half-space; infinite beyond the horizon.
    #[inline(never)]
    fn surface_contact(
        &self,
        anchor: &Particle,
        radius: f64,
        acceleration: DVec3,
        shape: &Shape,
    ) -> Option<f64> {
        let within = ((self.now - anchor.time).max(0) as f64 + HORIZON) * self.clock.tick;
        let surface = shape.surface();
        let delay =
            surface.time_to_contact(anchor.position, anchor.velocity, acceleration, radius, within)?;
        Some(delay * self.clock.per_time)
    }

    /// Whether a wall is at rest, under gravity, and perpendicular to an axis. A contact with such a wall has
    /// a fixed coordinate: every bounce starts and ends at exactly the same height, and rounding changes no
    /// energy.
    #[inline]
    pub fn is_level(&self, wall: u32) -> bool {
        let wall = &self.boundary.walls[wall as usize];
        self.gravity != DVec3::ZERO
            && !wall.motion.is_moving()
            && wall.shape.is_none()
            && wall.normal.abs().max_element() == 1.0
    }

    /// Unit normal of a wall towards a particle in contact.
    #[inline]
    pub fn wall_normal(&self, wall: u32, position: DVec3) -> DVec3 {
        let wall = &self.boundary.walls[wall as usize];
        match &wall.shape {
            Some(shape) => shape.surface().normal(position),
            None => wall.normal,
        }
    }
}
