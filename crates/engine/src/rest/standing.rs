//! The settling scan: the grains that may be put to rest.

use haff_neighbors::Geometry;

use super::{
    jam::resolve_jam,
    settle::settle,
    support::{contacts, is_fixed, is_supported},
    thresholds::Thresholds,
};
use crate::{
    clock::whole, error::EngineError, particles::World, report::Observer, state::State, timed::TimedAction,
};

/// The settling scan at regular times.
pub(crate) struct SettlingScan;

impl TimedAction for SettlingScan {
    fn next(&self, state: &State) -> i64 {
        state.settling.next
    }

    fn apply(
        &mut self,
        state: &mut State,
        geometry: &Geometry,
        observer: &mut dyn Observer,
    ) -> Result<Vec<u32>, EngineError> {
        Ok(scan(state, geometry, false, observer))
    }
}

/// Puts the grains to rest that are slow and supported, if a settling scan is worth it now; resolves a jam
/// before. Returns the particles that it has changed.
pub(crate) fn scan(
    state: &mut State,
    geometry: &Geometry,
    is_jammed: bool,
    observer: &mut dyn Observer,
) -> Vec<u32> {
    let Some(thresholds) = state.world.thresholds else { return Vec::new() };
    let period = (thresholds.period * state.world.clock.per_time).clamp(1.0, crate::clock::HORIZON);
    state.settling.next = state.world.now + whole(period);
    let free = state.world.movable - state.world.asleep;
    let happened = state.accumulators.counters.collisions + state.accumulators.counters.wall_collisions;
    let stopped = if is_jammed { resolve_jam(state, geometry, &thresholds, observer) } else { Vec::new() };
    let worth_it = is_jammed || state.settling.is_worth_it(happened, free);
    state.settling.after_scan(happened, worth_it);
    if !worth_it {
        return stopped;
    }
    let world = &state.world;
    let slow: Vec<u32> = (0..world.particles.len() as u32)
        .filter(|&i| {
            world.class(i).inverse_mass != 0.0
                && world.state(i, world.now).1.length_squared() <= thresholds.speed * thresholds.speed
        })
        .collect();
    let (standing, mut near) = standing(world, geometry, &thresholds, &slow);
    for &i in &standing {
        settle(state, i, &thresholds, observer);
    }
    let State { world, settling, .. } = state;
    if settling.near.is_empty() && !standing.is_empty() {
        settling.near = vec![Vec::new(); world.particles.len()];
    }
    for (&i, slot) in standing.iter().zip(slots(&slow, &standing)) {
        let mut contacts = std::mem::take(&mut near[slot]);
        contacts.retain(|&j| world.is_asleep(j) || is_fixed(world, j));
        for &j in &contacts {
            let others = &mut settling.near[j as usize];
            if world.is_asleep(j)
                && let Err(place) = others.binary_search(&i)
            {
                others.insert(place, i);
            }
        }
        settling.near[i as usize] = contacts;
    }
    let mut changed = [standing, stopped].concat();
    changed.sort_unstable();
    changed.dedup();
    changed
}

/// The contacts of all asleep particles, as settling scans have found them.
pub(crate) fn contacts_of_sleeping(world: &World, geometry: &Geometry) -> Vec<Vec<u32>> {
    let Some(thresholds) = world.thresholds.filter(|_| world.asleep > 0) else { return Vec::new() };
    let asleep: Vec<u32> = (0..world.particles.len() as u32).filter(|&i| world.is_asleep(i)).collect();
    let mut near = vec![Vec::new(); world.particles.len()];
    for (&i, contacts) in asleep.iter().zip(contacts(world, geometry, &thresholds, &asleep)) {
        near[i as usize] = contacts;
    }
    near
}

/// Places of `some`, a part of `all`, in it; both are in order.
fn slots<'a>(all: &'a [u32], some: &'a [u32]) -> impl Iterator<Item = usize> + 'a {
    some.iter().filter_map(|i| all.binary_search(i).ok())
}

/// The largest set among these slow particles in which each one is supported, and the contacts of each.
fn standing(
    world: &World,
    geometry: &Geometry,
    thresholds: &Thresholds,
    slow: &[u32],
) -> (Vec<u32>, Vec<Vec<u32>>) {
    if slow.is_empty() {
        return (Vec::new(), Vec::new());
    }
    let near = contacts(world, geometry, thresholds, slow);
    let mut counts = vec![true; slow.len()];
    let mut doubtful: Vec<usize> = (0..slow.len()).rev().collect();
    while let Some(k) = doubtful.pop() {
        if !counts[k] {
            continue;
        }
        let i = slow[k];
        // A single grain on a wall is the business of its series of bounces, which ends in closed form.
        let among_grains = !near[k].is_empty() || world.particles[i as usize].is_recently_hit();
        let holds = |j: &u32| slow.binary_search(j).map_or(true, |other| counts[other]);
        if among_grains && is_supported(world, thresholds, i, near[k].iter().copied().filter(holds)) {
            continue;
        }
        counts[k] = false;
        doubtful.extend(slots(slow, &near[k]).filter(|&other| counts[other]));
    }
    (slow.iter().zip(counts).filter_map(|(&i, counts)| counts.then_some(i)).collect(), near)
}
