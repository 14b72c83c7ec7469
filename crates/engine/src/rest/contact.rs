//! What rest means for single contacts: which are elastic, which wake.

use glam::DVec3;
use haff_mechanics::Impact;

use super::{support::is_supported, thresholds::Thresholds};
use crate::{particles::World, state::State};

/// A flight from a wall back to it has been undisturbed if it took this part of the time it takes by its end.
const UNDISTURBED: f64 = 1.0 - 1e-9;

/// Whether particle i has had a contact a short while before `time` \[ticks\].
fn is_soon(world: &World, thresholds: &Thresholds, i: u32, time: i64) -> bool {
    let particle = &world.particles[i as usize];
    world.class(i).inverse_mass != 0.0 && particle.count > 0 && world.age(i, time) < thresholds.soon
}

/// Whether one of two particles has had a contact a short while before `time`.
pub(crate) fn is_one_of_many(world: &World, pair: [u32; 2], time: i64) -> bool {
    world.thresholds.is_some_and(|thresholds| pair.iter().any(|&i| is_soon(world, &thresholds, i, time)))
}

/// Whether the contact of particle i with a wall is one of many: its last one, a short while before `time`,
/// was with a grain, or one of many. A grain that has come back from this wall undisturbed is alone with it,
/// unless the wall moves: on that no series of bounces is completed in closed form.
pub(crate) fn is_among_grains(
    world: &World,
    i: u32,
    wall: u32,
    speed: f64,
    acceleration: f64,
    time: i64,
) -> bool {
    let Some(thresholds) = &world.thresholds else { return false };
    let moves = world.walls[wall as usize].motion.is_moving();
    let recently_hit = world.particles[i as usize].is_recently_hit()
        && world.age(i, time) * acceleration < 2.0 * speed * UNDISTURBED;
    is_soon(world, thresholds, i, time) && (moves || recently_hit)
}

/// The speed at which two bodies part that approach at `speed`, where the law says `e`.
///
/// Contacts that are one of many are elastic below a speed, and take no more than down to it, unless there is
/// no speed worth the name. Bodies that gravity presses together, with the relative acceleration `acceleration` along
/// the normal, never part more slowly than they fall towards each other in a given time.
pub(crate) fn separation_speed(world: &World, e: f64, speed: f64, acceleration: f64, many: bool) -> f64 {
    let Some(thresholds) = &world.thresholds else { return e * speed };
    let mut separation = e * speed;
    if many && speed > thresholds.nothing {
        separation = separation.max(speed.min(thresholds.elastic));
    }
    separation.max(acceleration * thresholds.hop)
}

/// A contact of bodies that part faster than they approach. Velocities after it, and the impact, whose loss
/// is negative.
///
/// `n` points from the first to the second.
pub(crate) fn push_apart(
    inverse: [f64; 2],
    [wi, wj]: [DVec3; 2],
    n: DVec3,
    speed: f64,
    separation: f64,
) -> (DVec3, DVec3, Impact) {
    let lambda = inverse[0] + inverse[1];
    let impulse = (speed + separation) / lambda;
    let impact = Impact {
        approach_speed: speed,
        impulse,
        compression_impulse: speed / lambda,
        restitution_impulse: separation / lambda,
        energy_loss: 0.5 * (speed - separation) * (speed + separation) / lambda,
        carnot_energy: 0.5 * impulse * (speed + separation),
    };
    (wi - n * (impulse * inverse[0]), wj + n * (impulse * inverse[1]), impact)
}

/// Before the collision of i and j: wakes the one that is at rest if it is hit hard enough. All that wake, in
/// order.
pub(crate) fn wake_if_hit(state: &mut State, i: u32, j: u32, time: i64) -> Vec<u32> {
    let world = &state.world;
    let (at_rest, other) = if world.is_asleep(i) { (i, j) } else { (j, i) };
    let Some(thresholds) = world.thresholds.filter(|_| world.is_asleep(at_rest)) else { return Vec::new() };
    let (position, velocity) = world.state(other, time);
    let r = world.periodicity.nearest(world.particles[at_rest as usize].position - position);
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
        let Some(thresholds) = world.thresholds.filter(|_| world.is_asleep(i)) else { continue };
        world.set_asleep(i, false, time);
        world.particles[i as usize].set_recently_hit(true);
        state.accumulators.counters.wakes += 1;
        woken.push(i);
        for j in std::mem::take(&mut state.settling.near[i as usize]) {
            let near = &mut state.settling.near[j as usize];
            near.retain(|&other| other != i);
            if world.is_asleep(j) && !is_supported(world, &thresholds, j, near.iter().copied()) {
                falling.push(j);
            }
        }
    }
    woken.sort_unstable();
    woken
}
