//! The input of the searches: the geometry of a state.

use haff_neighbors::Geometry;
use rayon::prelude::*;

use crate::{
    model::{Boundary, Dimension, System},
    state::world::World,
};

/// Least and largest present coordinate of all particles along an axis [length].
fn extent(world: &World, axis: usize) -> (f64, f64) {
    (0..world.particles.len() as u32)
        .into_par_iter()
        .map(|i| world.state(i, world.now).0[axis])
        .fold(|| (f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| (low.min(x), high.max(x)))
        .reduce(|| (f64::INFINITY, f64::NEG_INFINITY), |a, b| (a.0.min(b.0), a.1.max(b.1)))
}

/// The input of partner searches: the geometry of a state. `filled` is the volume that all particles would
/// occupy at the local density of the average particle [length^d].
pub(crate) fn geometry(system: &System, world: &World, filled: f64) -> Geometry {
    use haff_neighbors::{Axis, Plane};
    let mut axes = system.domain.boundary.map(|boundary| match boundary {
        Boundary::Periodic => Axis::Periodic,
        Boundary::Wall => Axis::Bounded,
        Boundary::Open => Axis::Open,
    });
    if system.dimension == Dimension::Two {
        axes[2] = Axis::Flat;
    }
    let classes = world.particles.iter().map(|particle| &world.classes[particle.class()]);
    let radii = |finite: bool| {
        let chosen = classes.clone().filter(|class| (class.inverse_mass != 0.0) == finite);
        chosen.map(|class| class.radius).fold(0.0, f64::max)
    };
    let (movable, fixed) = (radii(true), radii(false));
    // The largest radius of the others, if only one particle has that radius.
    let are_largest = classes.clone().filter(|class| class.inverse_mass != 0.0 && class.radius == movable);
    let smaller = classes.clone().filter(|class| class.inverse_mass != 0.0 && class.radius < movable);
    let second = if are_largest.take(2).count() == 2 {
        movable
    } else {
        smaller.map(|class| class.radius).fold(0.0, f64::max)
    };
    let radius = classes.clone().map(|class| class.radius);
    let uniform = radius.clone().all(|radius| radius == movable);
    let mut size = system.domain.size;
    for axis in 0..3 {
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
        // Two bodies of infinite mass never touch.
        reach: movable + second.max(fixed),
        crowding: (volume / filled).max(1.0),
        radius: movable,
        radii: if uniform { Vec::new() } else { radius.collect() },
        planes: system
            .walls
            .iter()
            .map(|wall| Plane {
                point: wall.point,
                normal: wall.normal,
                sweep: wall.motion.sweep(wall.normal),
            })
            .collect(),
        sliding: world.sliding_images(),
    }
}
