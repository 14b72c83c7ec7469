//! The largest speed and extent of a system, from which the tick of the clock follows.

use glam::DVec3;

use crate::{numerics::clock::Clock, state::world::World};

/// The tick is made shorter before a particle moves by more than this part of the extent in it: a time that
/// is rounded to a tick must not change a distance by more than [`allowed_overlap`](crate::allowed_overlap),
/// which is this part of the extent, too.
const RESOLUTION: f64 = 16.0 * f64::EPSILON;

/// A tick that is chosen for a speed serves for speeds up to this many times as large.
const GIVEN_RATIO: f64 = 4.0;

impl World {
    /// The system for which the present tick has been chosen: its extent \[length\] and its largest speed
    /// [length/time].
    pub fn set_scale(&mut self, extent: f64, speed: f64) {
        // The second bound, where a tick cannot be as short as the speed needs.
        // Velocities of anchors are up to twice those at a time under a drag.
        let resolution = if self.is_damped() { 0.5 * RESOLUTION } else { RESOLUTION };
        self.set_fastest(extent, (extent * resolution / self.clock.tick).max(2.0 * speed));
    }

    /// [`Self::set_scale`] with the largest speed for which the tick is short enough [length/time].
    pub fn set_fastest(&mut self, extent: f64, fastest: f64) {
        (self.resolution.extent, self.resolution.fastest) = (extent, fastest);
        self.resolution.fastest_square = (fastest * fastest).min(f64::MAX);
    }

    /// Whether the tick is short enough for a velocity; false if it is not finite.
    #[inline(always)]
    pub fn is_resolved(&self, velocity: DVec3) -> bool {
        velocity.length_squared() <= self.resolution.fastest_square
    }

    /// The exponent of the tick for this extent and largest speed. Of the time constant of a drag a tick is a
    /// small part, too.
    pub fn exponent_for(&self, extent: f64, speed: f64) -> i32 {
        let of_drag = self.clock.drag.map_or(0.0, |drag| extent / drag);
        Clock::exponent_for(extent, speed.max(of_drag))
    }

    /// A bound on the speed of particles: the largest present speed of bodies and walls, plus the gain of a
    /// fall through `extent`.
    pub fn largest_speed(&self, extent: f64) -> f64 {
        let fastest = (0..self.particles.len() as u32)
            .map(|i| self.state(i, self.now).1.length_squared())
            .chain(self.boundary.walls.iter().map(|wall| wall.motion.max_speed().powi(2)))
            .chain(self.states_of_pistons().into_iter().map(|[_, velocity]| velocity.length_squared()))
            .chain(self.boundary.deformation.iter().map(|images| images.fastest().powi(2)))
            .fold(0.0, f64::max);
        let pistons = self.pistons().map(|(_, piston)| piston.acceleration.abs());
        let strongest = pistons.fold(self.gravity.length(), f64::max);
        let present = (fastest + 2.0 * strongest * extent).sqrt();
        // What is given soon, if the present speeds are much lower: the tick is chosen for a whole epoch.
        if self.resolution.given_speed > GIVEN_RATIO * present {
            self.resolution.given_speed
        } else {
            present
        }
    }

    /// Largest extent of the system along any axis [length].
    pub fn extent(&self, open: [bool; 3]) -> f64 {
        let mut extent: f64 = 0.0;
        let edges = self.periodicity(self.now).size;
        let radius = self.classes.iter().map(|class| class.radius).fold(0.0, f64::max);
        for axis in 0..3 {
            if open[axis] {
                for i in 0..self.particles.len() as u32 {
                    extent = extent.max(self.state(i, self.now).0[axis].abs());
                }
            } else {
                extent = extent.max(edges[axis]);
            }
        }
        extent.max(2.0 * radius)
    }
}
