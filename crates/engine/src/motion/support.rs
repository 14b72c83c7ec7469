//! Which walls support a particle, and which particles are asleep.

use glam::DVec3;

use crate::state::{particle::Support, world::World};

impl World {
    /// Puts particle i to rest at its position at `ticks`, or wakes it. In both cases its velocity and its
    /// spin become zero, and walls no longer support it.
    pub fn set_asleep(&mut self, i: u32, asleep: bool, ticks: i64) {
        let (position, _) = self.state(i, ticks);
        if self.particles[i as usize].rests() {
            self.set_support(i, [None; 3], ticks);
        }
        let mass = self.body(i).mass;
        let before = mass * self.acceleration(i);
        self.restore_asleep(i, asleep);
        self.change_force(mass * self.acceleration(i) - before, ticks);
        self.particles[i as usize].set_anchor(position, DVec3::ZERO, ticks);
        // It is in contact with what supports it, or has just been hit.
        self.note_contact(i, ticks);
        if let Some(spins) = &mut self.spin {
            spins.angular_velocity[i as usize] = DVec3::ZERO;
        }
    }

    /// [`Self::set_asleep`] without changing the force, the support or the anchor.
    pub fn restore_asleep(&mut self, i: u32, asleep: bool) {
        if asleep == self.is_asleep(i) {
            return;
        }
        let particle = &mut self.particles[i as usize];
        if asleep {
            particle.set_class(particle.class() + self.class_count);
            self.asleep += 1;
        } else {
            particle.set_class(particle.class() - self.class_count);
            self.asleep -= 1;
        }
    }

    /// Sets the walls that support particle i from `ticks` on, and changes the force.
    pub fn set_support(&mut self, i: u32, support: Support, ticks: i64) {
        let before = self.acceleration(i);
        self.change_support_of_walls(i, -1.0, ticks);
        self.replace_support(i, support);
        self.change_support_of_walls(i, 1.0, ticks);
        let change = self.acceleration(i) - before;
        self.change_force(self.class(i).mass * change, ticks);
    }

    /// [`Self::set_support`] without changing the force.
    pub fn replace_support(&mut self, i: u32, support: Support) {
        if self.supported.support.is_empty() {
            self.supported.support = vec![[None; 3]; self.particles.len()];
        }
        self.supported.support[i as usize] = support;
        let (before, after) = (self.particles[i as usize].rests(), support != [None; 3]);
        self.supported.resting = self.supported.resting + usize::from(after) - usize::from(before);
        self.particles[i as usize].set_rests(after);
    }

    /// The walls that support particle i.
    pub fn support(&self, i: u32) -> Support {
        if self.particles[i as usize].rests() { self.supported.support[i as usize] } else { [None; 3] }
    }

    /// Changes the total force of gravity and of supporting walls from `ticks` on.
    fn change_force(&mut self, change: DVec3, ticks: i64) {
        if change != DVec3::ZERO {
            self.force.change(change, self.clock.shown(ticks));
        }
    }

    /// Whether nothing moves and nothing will.
    pub fn is_at_rest(&self) -> bool {
        let free = self.classes.iter().any(|class| class.inverse_mass != 0.0);
        (self.gravity == DVec3::ZERO || self.supported.resting + self.asleep > 0 || !free)
            && !self.boundary.walls.iter().any(|wall| wall.motion.is_moving())
            && (0..self.particles.len() as u32).all(|i| {
                self.particles[i as usize].velocity == DVec3::ZERO && self.acceleration(i) == DVec3::ZERO
            })
    }
}

/// The part of `gravity` that walls with these inward normals do not balance: the vector nearest to `gravity`
/// that points into none of the walls.
pub(crate) fn unbalanced_gravity(gravity: DVec3, normals: &(impl Iterator<Item = DVec3> + Clone)) -> DVec3 {
    let bound = -1e-12 * gravity.length();
    let mut best = DVec3::ZERO; // points into no wall
    let mut consider = |a: DVec3| {
        let allowed = normals.clone().all(|n| a.dot(n) >= bound);
        if allowed && (a - gravity).length_squared() < (best - gravity).length_squared() {
            best = a;
        }
    };
    consider(gravity);
    for (k, n) in normals.clone().enumerate() {
        let slide = gravity - n * gravity.dot(n);
        // The projection is repeated: the rounding error of the first one would let a grain at rest on a
        // tilted wall fall into it.
        consider(slide - n * slide.dot(n));
        for m in normals.clone().skip(k + 1) {
            let edge = n.cross(m);
            if edge != DVec3::ZERO {
                consider(edge * (gravity.dot(edge) / edge.length_squared()));
            }
        }
    }
    best
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn walls_balance_their_part_of_gravity() {
        let g = DVec3::new(1.0, 0.0, -10.0);
        assert_eq!(unbalanced_gravity(g, &[DVec3::Z].into_iter()), DVec3::X);
        assert_eq!(unbalanced_gravity(g, &[DVec3::Z, DVec3::NEG_X].into_iter()), DVec3::ZERO);
        assert_eq!(unbalanced_gravity(g, &[DVec3::X].into_iter()), g, "a wall does not attract");
        // Two walls that are not perpendicular leave only the component along their common edge.
        let wedge = [DVec3::Z, DVec3::new(0.6, 0.0, 0.8)];
        assert_eq!(
            unbalanced_gravity(DVec3::new(-1.0, 2.0, -10.0), &wedge.into_iter()),
            DVec3::new(0.0, 2.0, 0.0)
        );
    }
}
