//! The motion of grains that an oscillating wall carries; see [`crate::laws::carried`].
//!
//! An oscillating wall on which a grain's bounces have ended carries it. Its anchor has the velocity along
//! the wall; the wall's motion is added where a flight is evaluated (`World::flight`), so nothing is
//! predicted again while the wall moves. Contacts of carried grains are found by steps within a bound of the
//! acceleration (`first_contact_bounded`), all others as before.

use glam::DVec3;

use crate::{numerics::total::total, state::world::World};

impl World {
    /// The oscillating wall that carries particle i.
    #[inline]
    pub fn carrier(&self, i: u32) -> Option<u32> {
        if !self.boundary.carries || !self.particles[i as usize].rests() {
            return None;
        }
        let wall = self.supported.support[i as usize][0]?;
        self.boundary.walls[usize::from(wall)].motion.carries().then_some(u32::from(wall))
    }

    /// Position and velocity at `ticks` of a particle that a wall carries, from its flight along the wall.
    pub fn carried(
        &self,
        i: u32,
        wall: u32,
        ticks: i64,
        (position, velocity): (DVec3, DVec3),
    ) -> (DVec3, DVec3) {
        let wall = &self.boundary.walls[wall as usize];
        let shift = |ticks: i64| wall.motion.displacement(wall.normal, (&self.clock, ticks));
        let since = self.particles[i as usize].time;
        (
            position + (shift(ticks) - shift(since)),
            velocity + wall.motion.velocity(wall.normal, (&self.clock, ticks)),
        )
    }

    /// Whether two walls are perpendicular, but for rounding: a grain that one of them moves along its normal
    /// keeps its distance from the other one.
    pub fn are_perpendicular(&self, a: u32, b: u32) -> bool {
        /// Cosine of walls that are perpendicular but for rounding.
        const PERPENDICULAR: f64 = 1e-15;
        self.boundary.walls[a as usize].normal.dot(self.boundary.walls[b as usize].normal).abs()
            <= PERPENDICULAR
    }

    /// The walls that support particle i besides the one that carries it, if there is one.
    pub fn support_besides_carrier(&self, i: u32) -> [Option<u16>; 2] {
        let [first, second, third] = self.support(i);
        match self.carrier(i) {
            Some(_) => [second, third],
            None => [first, second],
        }
    }

    /// Energy and momentum along the normal of a body of this mass that a wall carries, at its velocity along
    /// the normal.
    pub fn carried_energy(&self, wall: u32, mass: f64, speed: f64, ticks: i64) -> (f64, DVec3) {
        let wall = &self.boundary.walls[wall as usize];
        let height = wall.motion.displacement(wall.normal, (&self.clock, ticks)).dot(wall.normal);
        let weight = self.gravity.dot(wall.normal);
        (mass * (0.5 * speed * speed - weight * height), mass * speed * wall.normal)
    }

    /// Energy and momentum along the normals of all carried particles at the present.
    pub fn all_carried(&self) -> (f64, DVec3) {
        if !self.boundary.carries || self.supported.resting == 0 {
            return (0.0, DVec3::ZERO);
        }
        let [energy, x, y, z] = total(self.particles.len(), |i| {
            let Some(wall) = self.carrier(i) else { return [0.0; 4] };
            let normal = self.boundary.walls[wall as usize].normal;
            let speed = self.boundary.walls[wall as usize]
                .motion
                .velocity(normal, (&self.clock, self.now))
                .dot(normal);
            let (energy, momentum) = self.carried_energy(wall, self.class(i).mass, speed, self.now);
            [energy, momentum.x, momentum.y, momentum.z]
        });
        (energy, DVec3::new(x, y, z))
    }

    /// Time from the anchor of a carried particle until the wall is left \[ticks\].
    pub fn release(&self, i: u32, wall: u32) -> Option<f64> {
        let wall = &self.boundary.walls[wall as usize];
        let anchor = self.particles[i as usize].time;
        let delay = wall.motion.time_to_release(self.gravity.dot(wall.normal), (&self.clock, anchor))?;
        Some(delay * self.clock.per_time)
    }
}

/// Whether an oscillating wall can carry particle i: nothing else carries it, and at most two walls at rest
/// support it, perpendicular to this one.
pub(crate) fn can_start(world: &World, i: u32, wall: u32) -> bool {
    let [first, second, third] = world.support(i);
    let are_perpendicular =
        [first, second].into_iter().flatten().all(|other| world.are_perpendicular(wall, u32::from(other)));
    world.carrier(i).is_none() && third.is_none() && are_perpendicular
}
