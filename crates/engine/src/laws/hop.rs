/*!
The end of series of bounces on surfaces where they cannot be completed in closed form: curved ones (fixed and
driven bodies, partitions), walls of constant velocity, pistons, and walls that are not perpendicular to the
one that carries a grain.

With e < 1 the speeds of the bounces of a grain that is pressed against a surface fall geometrically, to
nothing within a finite time. Below the speed h √(a R), with the acceleration a towards the surface and the
radius R of the grain, bounces are therefore elastic: the grain hops along the surface, ½ h² R = 5·10⁻⁷ R
high, keeps its energy, follows a curved surface, and leaves it where it no longer presses.
*/

use glam::DVec3;

use crate::{
    model::{System, Wall, WallLaw, WallMotion},
    motion::carried,
    state::world::World,
};

/// h, see above.
const HOP: f64 = 1e-3;
/// A grain that touches a surface more slowly leaves it with this part of the speed of a hop: otherwise its
/// next contact would be at once.
const LEAST: f64 = 0.1;

/// Separation speed [length/time] of a grain of this `radius` from a surface that it approaches at `speed`,
/// with the coefficient of restitution `e`, and is pressed against by `acceleration` [length/time²].
pub(crate) fn separation_speed(e: f64, speed: f64, acceleration: f64, radius: f64) -> f64 {
    if e >= 1.0 || acceleration <= 0.0 {
        return e * speed;
    }
    let hop = HOP * (acceleration * radius).sqrt();
    if e * speed >= hop { e * speed } else { speed.clamp(LEAST * hop, hop) }
}

/// Whether series of bounces on a wall never have a closed form, whatever else the grain touches.
fn always_hops(wall: &Wall) -> bool {
    wall.shape.is_some()
        || match wall.motion {
            WallMotion::Fixed | WallMotion::Oscillating(_) => false,
            WallMotion::Constant(_)
            | WallMotion::Rotating(_)
            | WallMotion::Piston(_)
            | WallMotion::Shrinking(_) => true,
        }
}

/// Names of the walls of a system on which series of bounces end in hops: none without gravity, or if
/// `rest_speed` puts grains to rest.
pub fn hopping_walls(system: &System) -> Vec<&str> {
    if system.domain.gravity == DVec3::ZERO || system.contacts.rest_speed > 0.0 {
        return Vec::new();
    }
    let walls = system.walls.len();
    let has_series =
        |wall: usize| system.contacts.wall.iter().skip(wall).step_by(walls).any(WallLaw::has_series);
    let hops =
        system.walls.iter().enumerate().filter(|&(wall, plane)| always_hops(plane) && has_series(wall));
    hops.map(|(_, plane)| &*plane.name).collect()
}

/// The acceleration that presses particle i against a wall at `ticks` [length/time²], if a series of bounces
/// on it cannot be completed in closed form.
pub(crate) fn acceleration_to_wall(world: &World, i: u32, wall: u32, ticks: i64) -> Option<f64> {
    let plane = &world.boundary.walls[wall as usize];
    let completes = !always_hops(plane)
        && match plane.motion {
            WallMotion::Oscillating(_) => carried::can_start(world, i, wall),
            _ => world.carrier(i).is_none_or(|carrier| world.are_perpendicular(carrier, wall)),
        };
    if completes {
        return None;
    }
    let (position, velocity) = world.state(i, ticks);
    let normal = world.contact_normal(i, wall, (position, velocity), ticks);
    let along = if plane.shape.is_some() { plane.normal.dot(normal) } else { 1.0 };
    Some(along * plane.motion.acceleration((&world.clock, ticks)) - world.acceleration(i).dot(normal))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_series_of_bounces_ends_in_hops_of_constant_speed() {
        let (e, acceleration, radius) = (0.4, 9.81, 0.2);
        let hop = HOP * f64::sqrt(acceleration * radius);
        let mut speed = 3.0;
        for _ in 0..100 {
            let separation = separation_speed(e, speed, acceleration, radius);
            assert!(separation <= speed && separation >= e * speed);
            speed = separation;
        }
        assert_eq!(speed, hop);
        assert_eq!(separation_speed(e, 3.0, acceleration, radius), e * 3.0);
        // At rest on the surface; not pressed against it; elastic.
        assert_eq!(separation_speed(e, 0.0, acceleration, radius), LEAST * hop);
        assert_eq!(separation_speed(e, 1e-9, -acceleration, radius), e * 1e-9);
        assert_eq!(separation_speed(1.0, 1e-9, acceleration, radius), 1e-9);
    }
}
