//! Distances from walls, and contacts with them.

use glam::DVec3;

use crate::{
    model::wall_motion::Approach,
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
        if let Some(partition) = &self.walls[wall as usize].partition {
            let r = partition.from_nearest(position);
            let distance = r.length();
            return (distance - radius, velocity.dot(r) / distance);
        }
        if self.is_level(wall) {
            let wall = &self.walls[wall as usize];
            let contact = wall.point.dot(wall.normal) + radius;
            return (position.dot(wall.normal) - contact, velocity.dot(wall.normal));
        }
        let wall = &self.walls[wall as usize];
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
        if let Some(partition) = &self.walls[wall as usize].partition {
            let delay = partition.time_to_contact(anchor.position, anchor.velocity, acceleration, radius)?;
            return Some(delay * self.clock.per_time);
        }
        let (distance, rate) =
            self.wall_approach(wall, radius, anchor.position, anchor.velocity, anchor.time);
        let wall = &self.walls[wall as usize];
        let approach = Approach {
            distance,
            rate,
            speed: anchor.velocity.dot(wall.normal),
            acceleration: acceleration.dot(wall.normal),
        };
        let delay = wall.motion.time_to_contact(&approach, (&self.clock, anchor.time))?;
        Some(delay * self.clock.per_time)
    }

    /// Whether a wall is at rest, under gravity, and perpendicular to an axis. A contact with such a wall has
    /// a fixed coordinate: every bounce starts and ends at exactly the same height, and rounding changes no
    /// energy.
    #[inline]
    pub fn is_level(&self, wall: u32) -> bool {
        let wall = &self.walls[wall as usize];
        self.gravity != DVec3::ZERO
            && !wall.motion.is_moving()
            && wall.partition.is_none()
            && wall.normal.abs().max_element() == 1.0
    }

    /// Unit normal of a wall towards a particle in contact.
    #[inline]
    pub fn wall_normal(&self, wall: u32, position: DVec3) -> DVec3 {
        let wall = &self.walls[wall as usize];
        match &wall.partition {
            Some(partition) => partition.from_nearest(position).normalize_or(wall.normal),
            None => wall.normal,
        }
    }
}
