//! Flights of particles: where they are, and how fast, at a time.

use glam::DVec3;

use crate::{
    model::features::{Features, With},
    motion::support::unbalanced_gravity,
    state::world::World,
};

impl World {
    /// Whether particles have no acceleration in their flights.
    pub fn flies_straight(&self) -> bool {
        self.gravity == DVec3::ZERO && !self.boundary.carries && self.boundary.pistons.is_empty()
    }

    /// Acceleration of a particle in its flight [length/time²], without that of a wall that carries it.
    #[inline(always)]
    pub fn acceleration(&self, i: u32) -> DVec3 {
        let particle = &self.particles[i as usize];
        if self.classes[particle.class()].inverse_mass == 0.0 {
            DVec3::ZERO
        } else if particle.rests() {
            self.supported_acceleration(i)
        } else {
            self.gravity
        }
    }

    /// Whether a particle falls freely: it has a finite mass, and does not rest on a wall. Only under
    /// gravity.
    #[inline(always)]
    pub fn falls(&self, i: u32) -> bool {
        let particle = &self.particles[i as usize];
        !particle.rests() && self.classes[particle.class()].inverse_mass != 0.0
    }

    /// The part of gravity that the walls under a particle do not balance, or that is along its carrier; with
    /// the friction on it.
    #[inline(never)]
    fn supported_acceleration(&self, i: u32) -> DVec3 {
        if let Some(wall) = self.carrier(i) {
            // A wall that accelerates carries a grain also against gravity.
            let n = self.boundary.walls[wall as usize].normal;
            let along = self.gravity - n * self.gravity.dot(n);
            let along = along - n * along.dot(n);
            // Other walls that support it are perpendicular to its carrier.
            let others = self.supported.support[i as usize][1..].iter().flatten();
            return unbalanced_gravity(
                along,
                &others.map(|&wall| self.boundary.walls[usize::from(wall)].normal),
            );
        }
        let walls = self.supported.support[i as usize].iter().flatten();
        let unbalanced =
            unbalanced_gravity(self.gravity, &walls.map(|&wall| self.boundary.walls[wall as usize].normal));
        if self.spin.is_some() { unbalanced + self.friction(i) } else { unbalanced }
    }

    /// Time from the anchor of particle i to `ticks` [time].
    #[inline(always)]
    pub fn age(&self, i: u32, ticks: i64) -> f64 {
        (ticks - self.particles[i as usize].time) as f64 * self.clock.tick
    }

    /// Position (in anchor coordinates) and velocity of particle i at `ticks`. Under a drag the velocity is
    /// that of the anchor.
    #[inline]
    pub fn flight<F: Features>(&self, i: u32, ticks: i64) -> (DVec3, DVec3) {
        let particle = &self.particles[i as usize];
        let dt = self.age(i, ticks);
        if F::GRAVITY {
            let a = self.acceleration(i);
            let flight = (
                haff_mechanics::free_flight(particle.position, particle.velocity, a, dt),
                haff_mechanics::free_flight_velocity(particle.velocity, a, dt),
            );
            match self.carrier(i) {
                Some(wall) => self.carried(i, wall, ticks, flight),
                None => flight,
            }
        } else {
            (haff_mechanics::drift(particle.position, particle.velocity, dt), particle.velocity)
        }
    }

    /// Position and velocity of particle i at `ticks`: of [`Self::flight`], with the velocity that a drag has
    /// left.
    pub fn state(&self, i: u32, ticks: i64) -> (DVec3, DVec3) {
        let (position, velocity) = self.any_flight(i, ticks);
        (position, self.damped(velocity, ticks))
    }

    /// [`Self::flight`] for code that is not compiled per feature. Returns the same bits.
    fn any_flight(&self, i: u32, ticks: i64) -> (DVec3, DVec3) {
        if self.flies_straight() {
            self.flight::<With<false, false>>(i, ticks)
        } else {
            self.flight::<With<true, false>>(i, ticks)
        }
    }

    /// Bound of the length of the flight of particle i from its own last event to `ticks` \[length\], to
    /// which the rounding error of its position is relative: |v| t + ½ |a| t². Under gravity it can be far
    /// longer than the distance of both ends.
    pub fn flight_length(&self, i: u32, ticks: i64) -> f64 {
        let age = self.age(i, ticks);
        let particle = &self.particles[i as usize];
        age * (particle.velocity.length() + 0.5 * self.acceleration(i).length() * age)
    }

    /// Magnitudes to which the rounding error of the position of particle i is relative \[length\]: those of
    /// its coordinates at its own last event, or the longest flight if that is longer.
    pub fn coordinates(&self, i: u32) -> DVec3 {
        self.particles[i as usize].position.abs().max(DVec3::splat(self.resolution.longest_flight))
    }

    /// Moves the anchor of particle i along its flight to the present, which is no own event.
    pub fn move_anchor(&mut self, i: u32) {
        let (mut position, mut velocity) = self.any_flight(i, self.now);
        for wall in self.support(i).into_iter().flatten().map(u32::from) {
            // Equal flights are rounded in the same way: from epoch to epoch a grain at rest would be moved
            // into its wall.
            let radius = self.class(i).radius;
            let (distance, _) = self.wall_approach(wall, radius, position, velocity, self.now);
            position -= self.boundary.walls[wall as usize].normal * distance.min(0.0);
        }
        if let Some(wall) = self.carrier(i) {
            // The anchor has the velocity along the wall.
            let wall = &self.boundary.walls[wall as usize];
            velocity -= wall.motion.velocity(wall.normal, (&self.clock, self.now));
        }
        let age = self.age(i, self.now);
        let particle = &mut self.particles[i as usize];
        (particle.position, particle.velocity, particle.time) = (position, velocity, self.now);
        self.wrap_anchor(i);
        if let Some(images) = &self.boundary.deformation {
            // A contact that is due now has been predicted for an image that has come this far.
            let along = images.sliding.map_or(DVec3::ONE, |shear| DVec3::AXES[shear.flow]);
            let speeds =
                [velocity, self.particles[i as usize].velocity].map(|v| (v * along).abs().max_element());
            let image = images.sliding.map_or(images.speeds.abs().max_element(), |shear| shear.speed.abs());
            self.note_path((speeds[0].max(speeds[1]) + image) * age);
        }
    }

    /// Wraps the anchor of particle i into the box. Returns the number of box lengths per axis.
    #[inline(always)]
    pub fn wrap_anchor(&mut self, i: u32) -> [i32; 3] {
        let position = self.particles[i as usize].position;
        if self.boundary.periodicity.contains(position) {
            return [0; 3];
        }
        self.wrap_anchor_outside(i, position)
    }

    /// [`Self::wrap_anchor`] for an anchor at `position`, outside of the box.
    #[cold]
    fn wrap_anchor_outside(&mut self, i: u32, position: DVec3) -> [i32; 3] {
        let before = position;
        let (position, wraps, velocity) = self.wrap(before, self.particles[i as usize].time);
        if wraps != [0; 3] {
            let particle = &mut self.particles[i as usize];
            particle.position = position;
            if self.boundary.deformation.is_some() {
                particle.velocity += velocity;
            }
            for (image, turns) in self.images[i as usize].iter_mut().zip(wraps) {
                *image += turns;
            }
            if let Some(shear) = self.shear() {
                // Wraps along the flow are not the length of a flight.
                let path = before[shear.flow].abs();
                self.note_path(path);
                return wraps;
            }
            for (axis, turns) in wraps.into_iter().enumerate().filter(|(_, turns)| turns.abs() > 1) {
                self.resolution.longest_flight = self
                    .resolution
                    .longest_flight
                    .max(f64::from(turns).abs() * self.boundary.periodicity.size[axis]);
            }
        }
        wraps
    }
}
