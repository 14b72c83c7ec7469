//! What rest means for single contacts: which are elastic, which wake.

use glam::DVec3;
use haff_mechanics::Impact;

use crate::{
    machine::State,
    particles::World,
    rest::{Thresholds, stands},
};

/// Whether particle i has had a contact a short while before `time` \[ticks\].
fn is_soon(world: &World, thresholds: &Thresholds, i: u32, time: i64) -> bool {
    let particle = &world.particles[i as usize];
    world.class(i).inverse_mass != 0.0 && particle.count > 0 && world.age(i, time) < thresholds.soon
}

/// Restitution of a contact of two particles whose law says `e`.
pub(crate) fn coefficient(world: &World, e: f64, speed: f64, pair: [u32; 2], time: i64) -> f64 {
    match &world.thresholds {
        Some(thresholds)
            if speed < thresholds.elastic && pair.iter().any(|&i| is_soon(world, thresholds, i, time)) =>
        {
            1.0
        }
        _ => e,
    }
}

/// Whether the last contact of particle i, a short while before `time`, was with a grain, or soon after such a one.
pub(crate) fn is_among_grains(world: &World, i: u32, time: i64) -> bool {
    world.particles[i as usize].is_jostled()
        && world.thresholds.is_some_and(|thresholds| is_soon(world, &thresholds, i, time))
}

/// Whether a contact at this speed is one of those that would follow each other without end.
pub(crate) fn is_slow(world: &World, speed: f64) -> bool {
    world.thresholds.is_some_and(|thresholds| speed < thresholds.elastic)
}

/// A contact of two bodies that gravity presses together and that hardly approach: they part with the least speed, because
/// bounces without height would follow each other without end. Velocities after it, and the impact, whose loss is negative.
///
/// `None` for other contacts. `n` points from i to j.
pub(crate) fn hop(
    world: &World,
    [i, j]: [u32; 2],
    [wi, wj]: [DVec3; 2],
    n: DVec3,
    speed: f64,
) -> Option<(DVec3, DVec3, Impact)> {
    let least = world.thresholds?.least;
    let pull = (world.acceleration(i) - world.acceleration(j)).dot(n);
    if speed >= least || pull <= 0.0 {
        return None;
    }
    let inverse = [world.class(i).inverse_mass, world.class(j).inverse_mass];
    let lambda = inverse[0] + inverse[1];
    let impulse = (speed + least) / lambda;
    let impact = Impact {
        approach_speed: speed,
        impulse,
        compression_impulse: speed / lambda,
        restitution_impulse: least / lambda,
        energy_loss: 0.5 * (speed * speed - least * least) / lambda,
        carnot_energy: 0.5 * impulse * (speed + least),
    };
    Some((wi - n * (impulse * inverse[0]), wj + n * (impulse * inverse[1]), impact))
}

/// Before the collision of i and j: wakes the one that is at rest if it is hit hard enough. All that wake, in order.
pub(crate) fn strike(state: &mut State, i: u32, j: u32, time: i64) -> Vec<u32> {
    let world = &state.world;
    let (at_rest, other) = if world.is_held(i) { (i, j) } else { (j, i) };
    let Some(thresholds) = world.thresholds.filter(|_| world.is_held(at_rest)) else { return Vec::new() };
    let (position, velocity) = world.state(other, time);
    let r = world.nearest_image(world.particles[at_rest as usize].position - position);
    let speed = velocity.dot(r) / r.length();
    if speed > thresholds.wake || world.body(other).inverse_mass == 0.0 {
        return wake(state, at_rest, time);
    }
    Vec::new()
}

/// Lets go of particle i, if it is at rest, and of those that do not stand without it. All of them, in order.
pub(crate) fn wake(state: &mut State, i: u32, time: i64) -> Vec<u32> {
    let mut woken = Vec::new();
    let mut falling = vec![i];
    while let Some(i) = falling.pop() {
        let world = &mut state.world;
        let Some(thresholds) = world.thresholds.filter(|_| world.is_held(i)) else { continue };
        world.set_held(i, false, time);
        world.particles[i as usize].set_jostled(true);
        state.book.counters.wakes += 1;
        woken.push(i);
        for j in std::mem::take(&mut state.heap.near[i as usize]) {
            let near = &mut state.heap.near[j as usize];
            near.retain(|&other| other != i);
            if world.is_held(j) && !stands(world, &thresholds, j, near.iter().copied()) {
                falling.push(j);
            }
        }
    }
    woken.sort_unstable();
    woken
}
