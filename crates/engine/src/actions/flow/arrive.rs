//! A place for a particle that comes in.

use glam::DVec3;
use haff_mechanics::random::Draw;

use crate::{
    model::flow::Inlet,
    state::{periodicity::Periodicity, population::Arrival, world::World},
};

/// Places that are tried for each entry.
const PLACES: usize = 100;
/// Gap to all others at least [contact distances].
const GAP: f64 = 1e-9;

/// A particle of this class at a random place of an inlet where it touches nothing: neither a particle, wall
/// or body, nor those that come in at the same time. `None` if none of [`PLACES`] places drawn is free.
pub(super) fn arrive(
    world: &World,
    inlet: &Inlet,
    (id, class): (u32, u32),
    with: &[Arrival],
    draw: &mut Draw,
) -> Option<Arrival> {
    let body = &world.classes[class as usize];
    let near = near(world, inlet, body.radius);
    let others = with.iter().map(|other| (other.position, world.classes[other.class as usize].radius));
    let taken: Vec<(DVec3, f64)> = near.into_iter().chain(others).collect();
    let spread = (inlet.temperature / body.mass).sqrt();
    let mut found = None;
    for _ in 0..PLACES {
        let position = inlet.place.at(|axis| (axis < world.dimension).then(|| draw.uniform()));
        let touches = |&(other, radius): &(DVec3, f64)| {
            let contact = (body.radius + radius) * (1.0 + GAP);
            world.boundary.periodicity.nearest(position - other).length_squared() <= contact * contact
        };
        let is_walled = |wall: u32| world.distance_for(body, wall, position) <= body.radius * (1.0 + GAP);
        if !taken.iter().any(touches) && !(0..world.boundary.walls.len() as u32).any(is_walled) {
            found = Some(position);
            break;
        }
    }
    // Drawn also where there is no place: what follows does not depend on it.
    let velocity = inlet.velocity + spread * draw.normals(world.dimension);
    found.map(|position| Arrival { id, class, position, velocity })
}

/// Positions and radii of the particles that a particle of this radius in an inlet could touch.
fn near(world: &World, inlet: &Inlet, radius: f64) -> Vec<(DVec3, f64)> {
    let center = 0.5 * (inlet.place.low + inlet.place.high);
    let half = 0.5 * (inlet.place.high - inlet.place.low);
    let Periodicity { size, is_periodic, .. } = world.boundary.periodicity;
    let of = |i: u32| {
        let reach = (radius + world.body(i).radius) * (1.0 + GAP);
        let position = world.state(i, world.now).0;
        let offset = world.boundary.periodicity.nearest(position - center);
        let is_near = |axis: usize| {
            let reach = half[axis] + reach;
            // Of an inlet longer than half of a periodic edge the nearest image is not the only one.
            offset[axis].abs() <= reach || is_periodic[axis] && 2.0 * reach >= size[axis]
        };
        (0..3).all(is_near).then(|| (position, world.body(i).radius))
    };
    (0..world.particles.len() as u32).filter_map(of).collect()
}
