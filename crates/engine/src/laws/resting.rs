//! The rules of rest for single contacts: which are elastic, and which wake a grain.

use glam::DVec3;
use haff_mechanics::Impact;

use crate::{
    model::thresholds::Thresholds,
    state::{State, world::World},
    support::contacts::is_supported,
};

/// A flight from a wall back to it was undisturbed if it took at least this fraction of 2 v/a, the duration
/// that follows from its speed v at the end and the acceleration a.
const UNDISTURBED: f64 = 1.0 - 1e-9;

/// Whether particle i had a contact within [`Thresholds::recent`] before `time` \[ticks\].
fn had_recent_contact(world: &World, thresholds: &Thresholds, i: u32, time: i64) -> bool {
    world.class(i).inverse_mass != 0.0 && world.contact_age(i, time) < thresholds.recent
}

/// Whether a contact of two particles at `time` is repeated: one of them had another contact shortly before.
pub(crate) fn is_repeated_contact(world: &World, pair: [u32; 2], time: i64) -> bool {
    world
        .laws
        .thresholds
        .is_some_and(|thresholds| pair.iter().any(|&i| had_recent_contact(world, &thresholds, i, time)))
}

/// Whether a contact of particle i with a wall at `time` is repeated: its last contact was shortly before,
/// and was with a grain or itself repeated. A grain that returns to the wall undisturbed bounces on it alone,
/// and its contact is not repeated. On a moving wall, and on one that is no half-space, every contact shortly
/// after another one is repeated, because a series of bounces on it is not completed in closed form.
pub(crate) fn is_repeated_wall_contact(
    world: &World,
    i: u32,
    wall: u32,
    speed: f64,
    acceleration: f64,
    time: i64,
) -> bool {
    let Some(thresholds) = &world.laws.thresholds else { return false };
    let plane = &world.boundary.walls[wall as usize];
    let is_never_completed = plane.motion.is_moving() || plane.shape.is_some();
    let recently_hit = world.particles[i as usize].is_recently_hit()
        && world.contact_age(i, time) * acceleration < 2.0 * speed * UNDISTURBED;
    had_recent_contact(world, thresholds, i, time) && (is_never_completed || recently_hit)
}

/// The separation speed of two bodies that approach at `speed`, with the coefficient of restitution `e`.
///
/// A repeated contact is elastic for approaches slower than [`Thresholds::elastic`], and never reduces a
/// faster one below that speed. Negligible approaches follow `e`. `acceleration` is the relative acceleration
/// along the normal, positive if it presses the bodies together. Such bodies separate at least at the speed
/// that they would gain by falling towards each other for [`Thresholds::fall_time`].
pub(crate) fn separation_speed(world: &World, e: f64, speed: f64, acceleration: f64, repeated: bool) -> f64 {
    let Some(thresholds) = &world.laws.thresholds else { return e * speed };
    let mut separation = e * speed;
    if repeated && speed > thresholds.negligible {
        separation = separation.max(speed.min(thresholds.elastic));
    }
    separation.max(acceleration * thresholds.fall_time)
}

/// Resolves a contact of bodies that separate faster than they approach. Returns the velocities after it, and
/// the impact, whose energy loss is negative.
///
/// `n` is the unit vector from the first body to the second.
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

/// Before a collision of i and j: if one of them is asleep, wakes it if the impact is fast enough or the
/// other body has infinite mass. Returns all grains that wake, in ascending order.
pub(crate) fn wake_if_hit(state: &mut State, i: u32, j: u32, time: i64) -> Vec<u32> {
    let world = &state.world;
    let (at_rest, other) = if world.is_asleep(i) { (i, j) } else { (j, i) };
    let Some(thresholds) = world.laws.thresholds.filter(|_| world.is_asleep(at_rest)) else {
        return Vec::new();
    };
    let (position, velocity) = world.state(other, time);
    let r = world.boundary.periodicity.nearest(world.particles[at_rest as usize].position - position);
    let speed = velocity.dot(r) / r.length();
    if speed > thresholds.wake || world.body(other).inverse_mass == 0.0 {
        return wake(state, at_rest, time);
    }
    Vec::new()
}

/// Wakes particle i, if it is asleep, and all grains that are not supported without it. Returns them in
/// ascending order.
pub(crate) fn wake(state: &mut State, i: u32, time: i64) -> Vec<u32> {
    let mut woken = Vec::new();
    let mut unsupported = vec![i];
    while let Some(i) = unsupported.pop() {
        let world = &mut state.world;
        let Some(thresholds) = world.laws.thresholds.filter(|_| world.is_asleep(i)) else { continue };
        world.set_asleep(i, false, time);
        world.particles[i as usize].set_recently_hit(true);
        state.accumulators.counters.wakes += 1;
        woken.push(i);
        for j in std::mem::take(&mut state.settling.contacts[i as usize]) {
            let contacts = &mut state.settling.contacts[j as usize];
            contacts.retain(|&other| other != i);
            if world.is_asleep(j) && !is_supported(world, &thresholds, j, contacts.iter().copied()) {
                unsupported.push(j);
            }
        }
    }
    woken.sort_unstable();
    woken
}
