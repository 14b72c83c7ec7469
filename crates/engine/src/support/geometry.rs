//! The input of the searches: the geometry of a state.

use std::borrow::Cow;

use haff_neighbors::{Axis, Geometry, Plane};
use rayon::prelude::*;

use crate::{
    model::{Boundary, Dimension, Shape, System, Wall, WallMotion},
    state::world::World,
    support::enclosure::enclosed,
};

/// Least and largest present coordinate of all particles along an axis [length].
fn extent(world: &World, axis: usize) -> (f64, f64) {
    (0..world.particles.len() as u32)
        .into_par_iter()
        .map(|i| world.state(i, world.now).0[axis])
        .fold(|| (f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| (low.min(x), high.max(x)))
        .reduce(|| (f64::INFINITY, f64::NEG_INFINITY), |a, b| (a.0.min(b.0), a.1.max(b.1)))
}

/// The axes of a system, as searches have them.
pub(crate) fn axes(system: &System) -> [Axis; 3] {
    let mut axes = system.domain.boundary.map(|boundary| match boundary {
        Boundary::Periodic => Axis::Periodic,
        Boundary::Wall => Axis::Bounded,
        Boundary::Open => Axis::Open,
    });
    if system.dimension == Dimension::Two {
        axes[2] = Axis::Flat;
    }
    axes
}

/// The walls of a system, as searches have them.
pub(crate) fn planes(system: &System) -> Vec<Plane> {
    let plane = |wall: &Wall| {
        let surface = match wall.shape {
            Some(Shape::Named(named)) => Some(named),
            _ => None,
        };
        let is_constant = matches!(wall.motion, WallMotion::Constant(_));
        // Along any direction, for a surface.
        let sweep =
            if surface.is_some() && is_constant { f64::INFINITY } else { wall.motion.sweep(wall.normal) };
        Plane { point: wall.point, normal: wall.normal, sweep, surface }
    };
    system.walls.iter().map(plane).collect()
}

/// The largest distance at which two particles touch \[length\], from radii, whether the mass is finite, and
/// numbers of particles. Two bodies of infinite mass never touch.
pub(crate) fn largest_contact(particles: impl Iterator<Item = (f64, bool, u64)>) -> f64 {
    let (mut movable, mut fixed) = ([0.0; 2], 0.0_f64);
    for (radius, is_movable, count) in particles {
        if !is_movable && count > 0 {
            fixed = fixed.max(radius);
        }
        for _ in 0..if is_movable { count.min(2) } else { 0 } {
            if radius > movable[0] {
                movable = [radius, movable[0]];
            } else if radius > movable[1] {
                movable[1] = radius;
            }
        }
    }
    let partner = movable[1].max(fixed);
    // A single particle touches no other one; then lengths are measured in its diameters.
    movable[0] + if partner > 0.0 { partner } else { movable[0] }
}

/// The system with the edges that its box has at present, for searches: along open axes those of a container.
pub(crate) fn present_system<'a>(system: &'a System, world: &World) -> Cow<'a, System> {
    if let Some(domain) = enclosed(system, world) {
        return Cow::Owned(System { domain, ..system.clone() });
    }
    if system.domain.compression.is_none() {
        return Cow::Borrowed(system);
    }
    let mut present = system.clone();
    let (images, walls) =
        (world.periodicity(world.now).size, system.domain.edges(world.clock.time(world.now)));
    for axis in 0..3 {
        let is_walled = system.domain.boundary[axis] == Boundary::Wall;
        present.domain.size[axis] = if is_walled { walls[axis] } else { images[axis] };
    }
    Cow::Owned(present)
}

/// The input of partner searches: the geometry of a state. `filled` is the volume that all particles would
/// occupy at the local density of the average particle [length^d].
pub(crate) fn geometry(system: &System, world: &World, filled: f64) -> Geometry {
    let axes = axes(system);
    let classes = world.particles.iter().map(|particle| &world.classes[particle.class()]);
    let radii = |finite: bool| {
        let chosen = classes.clone().filter(|class| (class.inverse_mass != 0.0) == finite);
        chosen.map(|class| class.radius).fold(0.0, f64::max)
    };
    let (movable, fixed) = (radii(true), radii(false));
    let radius = classes.clone().map(|class| class.radius);
    let uniform = radius.clone().all(|radius| radius == movable);
    let mut size = world.periodicity(world.now).size;
    for axis in 0..3 {
        if axes[axis] == Axis::Bounded {
            // Of a container, and of walls that move with the box, the world does not have it.
            size[axis] = system.domain.size[axis];
        }
        if axes[axis] == Axis::Open {
            // An open axis has no size; the present extent of the particles is used.
            let (low, high) = extent(world, axis);
            size[axis] = (high - low).max(0.0) + 2.0 * movable.max(fixed);
        }
    }
    let volume: f64 = (0..3).filter(|&axis| axes[axis] != Axis::Flat).map(|axis| size[axis]).product();
    Geometry {
        size,
        axes,
        reach: largest_contact(classes.map(|class| (class.radius, class.inverse_mass != 0.0, 1))),
        crowding: (volume / filled).max(1.0),
        radius: movable,
        radii: if uniform { Vec::new() } else { radius.collect() },
        planes: planes(system),
        deforming: world.moving_images(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_largest_contact_distance_is_that_of_the_two_largest_particles() {
        let of = |radii: &[(f64, u64)]| {
            largest_contact(radii.iter().map(|&(radius, count)| (radius, true, count)))
        };
        assert_eq!(of(&[(0.5, 100), (5.0, 1)]), 5.5);
        assert_eq!(of(&[(5.0, 1), (0.5, 100), (2.0, 1)]), 7.0);
        assert_eq!(of(&[(5.0, 2), (0.5, 100)]), 10.0);
        assert_eq!(of(&[(5.0, 1), (5.0, 1)]), 10.0);
        assert_eq!(of(&[(0.5, 1)]), 1.0);
        // Bodies of infinite mass do not touch each other.
        assert_eq!(largest_contact([(5.0, false, 3), (0.5, true, 1)].into_iter()), 5.5);
        assert_eq!(largest_contact([(0.1, false, 3), (0.5, true, 2)].into_iter()), 1.0);
    }
}
