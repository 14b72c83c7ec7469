//! Open axes along which a container holds all particles: for searches they are bounded.

use glam::DVec3;

use crate::{
    model::{Boundary, Domain, System, Wall, WallLaw, WallMotion},
    state::world::World,
};

/// Coordinates of a container may be below 0 by this part of its upper end: searches have cells from 0 on.
const BELOW: f64 = 0.05;

/// The domain with walls along open axes, if containers hold all particles along them.
pub(crate) fn enclosed(system: &System, world: &World) -> Option<Domain> {
    let is_open = |&axis: &usize| system.domain.boundary[axis] == Boundary::Open;
    let mut domain = system.domain;
    let mut is_changed = false;
    for axis in (0..system.dimension.count()).filter(is_open) {
        let ends = (0..system.walls.len()).filter_map(|wall| held_by(system, wall));
        let [low, high] = ends.fold([f64::NEG_INFINITY, f64::INFINITY], |[low, high], [from, to]| {
            [low.max(from[axis]), high.min(to[axis])]
        });
        if low >= -BELOW * high && high < f64::INFINITY && holds_fixed(world, axis, [low, high]) {
            (domain.boundary[axis], domain.size[axis]) = (Boundary::Wall, high);
            is_changed = true;
        }
    }
    is_changed.then_some(domain)
}

/// Whether bodies of infinite mass, which no wall holds, are between two ends along an axis, and stay there.
fn holds_fixed(world: &World, axis: usize, [low, high]: [f64; 2]) -> bool {
    let fixed =
        world.particles.iter().filter(|particle| world.classes[particle.class()].mass == f64::INFINITY);
    let stays = |position: f64, speed: f64| speed == 0.0 && (low..=high).contains(&position);
    fixed.into_iter().all(|particle| stays(particle.position[axis], particle.velocity[axis]))
}

/// The box in which a wall holds all particles: its lower and upper corner \[length\].
fn held_by(system: &System, wall: usize) -> Option<[DVec3; 2]> {
    let Wall { point, motion, .. } = &system.walls[wall];
    let walls = system.walls.len();
    let passes = system.contacts.wall.iter().skip(wall).step_by(walls).any(|law| *law == WallLaw::Passes);
    let stays = matches!(motion, WallMotion::Fixed | WallMotion::Rotating(_));
    if passes || !stays {
        return None;
    }
    let [low, high] = system.walls[wall].surface()?.enclosure()?;
    Some([low + *point, high + *point])
}
