//! The settling scan: finds the grains that can be put to rest, and puts them to rest.

use haff_neighbors::Geometry;

use crate::{
    actions::timed::TimedAction,
    model::thresholds::Thresholds,
    numerics::{clock::whole, error::EngineError},
    report::{Observer, with_ids},
    state::{State, world::World},
    support::contacts::{find_contacts, is_fixed, is_supported},
};

use super::{jam::resolve_jam, settle::settle};

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

/// Puts to rest all grains that are slow and supported, if enough has happened since the last scan. If grains
/// are jammed, resolves the jam first, and always scans. Returns the particles that have changed, in
/// ascending order.
pub(crate) fn scan(
    state: &mut State,
    geometry: &Geometry,
    is_jammed: bool,
    observer: &mut dyn Observer,
) -> Vec<u32> {
    with_ids(state.world.ids.clone(), observer, |observer| scan_all(state, geometry, is_jammed, observer))
}

fn scan_all(
    state: &mut State,
    geometry: &Geometry,
    is_jammed: bool,
    observer: &mut dyn Observer,
) -> Vec<u32> {
    let Some(thresholds) = state.world.laws.thresholds else { return Vec::new() };
    let period = (thresholds.period * state.world.clock.per_time).clamp(1.0, crate::numerics::clock::HORIZON);
    state.settling.next = state.world.now + whole(period);
    let awake = state.world.movable - state.world.asleep;
    let events = state.accumulators.counters.collisions + state.accumulators.counters.wall_collisions;
    let jammed = if is_jammed { resolve_jam(state, geometry, &thresholds, observer) } else { Vec::new() };
    let is_useful = is_jammed || state.settling.should_scan(events, awake);
    state.settling.after_scan(events, is_useful);
    if !is_useful {
        return jammed;
    }
    let world = &state.world;
    let slow: Vec<u32> = (0..world.particles.len() as u32)
        .filter(|&i| {
            world.class(i).inverse_mass != 0.0
                && world.state(i, world.now).1.length_squared() <= thresholds.speed * thresholds.speed
        })
        .collect();
    let (settled, mut contacts_of_slow) = largest_supported_set(world, geometry, &thresholds, &slow);
    for &i in &settled {
        settle(state, i, &thresholds, observer);
    }
    let State { world, settling, .. } = state;
    if settling.contacts.is_empty() && !settled.is_empty() {
        settling.contacts = vec![Vec::new(); world.particles.len()];
    }
    for (&i, index) in settled.iter().zip(indices_of(&slow, &settled)) {
        let mut contacts = std::mem::take(&mut contacts_of_slow[index]);
        contacts.retain(|&j| world.is_asleep(j) || is_fixed(world, j));
        for &j in &contacts {
            let others = &mut settling.contacts[j as usize];
            if world.is_asleep(j)
                && let Err(position) = others.binary_search(&i)
            {
                others.insert(position, i);
            }
        }
        settling.contacts[i as usize] = contacts;
    }
    let mut changed = [settled, jammed].concat();
    changed.sort_unstable();
    changed.dedup();
    changed
}

/// The contacts of all asleep particles, the same that settling scans have found.
pub(crate) fn contacts_of_asleep(world: &World, geometry: &Geometry) -> Vec<Vec<u32>> {
    let Some(thresholds) = world.laws.thresholds.filter(|_| world.asleep > 0) else { return Vec::new() };
    let asleep: Vec<u32> = (0..world.particles.len() as u32).filter(|&i| world.is_asleep(i)).collect();
    let mut contacts_of_all = vec![Vec::new(); world.particles.len()];
    for (&i, contacts) in asleep.iter().zip(find_contacts(world, geometry, &thresholds, &asleep)) {
        contacts_of_all[i as usize] = contacts;
    }
    contacts_of_all
}

/// The indices in `all` of those of `some` that it contains; both are in ascending order.
fn indices_of<'a>(all: &'a [u32], some: &'a [u32]) -> impl Iterator<Item = usize> + 'a {
    some.iter().filter_map(|i| all.binary_search(i).ok())
}

/// The largest set of these slow particles in which each one is supported by the others and by what is at
/// rest, and the contacts of each slow particle.
///
/// Starts from all slow particles and removes those without support, until all others are supported.
fn largest_supported_set(
    world: &World,
    geometry: &Geometry,
    thresholds: &Thresholds,
    slow: &[u32],
) -> (Vec<u32>, Vec<Vec<u32>>) {
    if slow.is_empty() {
        return (Vec::new(), Vec::new());
    }
    let contacts = find_contacts(world, geometry, thresholds, slow);
    let mut is_member = vec![true; slow.len()];
    let mut unchecked: Vec<usize> = (0..slow.len()).rev().collect();
    while let Some(k) = unchecked.pop() {
        if !is_member[k] {
            continue;
        }
        let i = slow[k];
        // A single grain on a wall comes to rest by its series of bounces, which is completed in closed form.
        let among_grains = !contacts[k].is_empty() || world.particles[i as usize].is_recently_hit();
        let supports = |j: &u32| slow.binary_search(j).map_or(true, |other| is_member[other]);
        if among_grains && is_supported(world, thresholds, i, contacts[k].iter().copied().filter(supports)) {
            continue;
        }
        is_member[k] = false;
        unchecked.extend(indices_of(slow, &contacts[k]).filter(|&other| is_member[other]));
    }
    (slow.iter().zip(is_member).filter_map(|(&i, is_member)| is_member.then_some(i)).collect(), contacts)
}
