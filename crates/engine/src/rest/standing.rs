//! The census: who may be put to rest.

use glam::DVec3;
use haff_neighbors::Geometry;

use crate::{
    clock::whole,
    error::EngineError,
    grid::{Slabs, levels, meet, place},
    ledger::Term,
    particles::World,
    report::{EventKind, EventRecord, NO_PARTNER, Observer},
    resolve,
    rest::{Thresholds, events, is_fixed, jam::unwedge, stands},
    state::State,
    timed::TimedAction,
};

/// The settling scan at regular times.
pub(crate) struct SettlingScan;

impl TimedAction for SettlingScan {
    fn next(&self, state: &State) -> i64 {
        state.heap.next
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
    state.heap.next = state.world.now + whole(period);
    let free = state.world.movable - state.world.held;
    let happened = events(state);
    let stopped = if is_jammed { unwedge(state, geometry, &thresholds, observer) } else { Vec::new() };
    let worth_it = is_jammed || state.heap.is_worth_it(happened, free);
    state.heap.after_census(happened, worth_it);
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
    let State { world, heap, .. } = state;
    if heap.near.is_empty() && !standing.is_empty() {
        heap.near = vec![Vec::new(); world.particles.len()];
    }
    for (&i, slot) in standing.iter().zip(slots(&slow, &standing)) {
        let mut contacts = std::mem::take(&mut near[slot]);
        contacts.retain(|&j| world.is_held(j) || is_fixed(world, j));
        for &j in &contacts {
            let others = &mut heap.near[j as usize];
            if world.is_held(j)
                && let Err(place) = others.binary_search(&i)
            {
                others.insert(place, i);
            }
        }
        heap.near[i as usize] = contacts;
    }
    let mut changed = [standing, stopped].concat();
    changed.sort_unstable();
    changed.dedup();
    changed
}

/// The contacts of all held particles, as censuses have found them.
pub(crate) fn contacts_of_held(world: &World, geometry: &Geometry) -> Vec<Vec<u32>> {
    let Some(thresholds) = world.thresholds.filter(|_| world.held > 0) else { return Vec::new() };
    let held: Vec<u32> = (0..world.particles.len() as u32).filter(|&i| world.is_held(i)).collect();
    let mut near = vec![Vec::new(); world.particles.len()];
    for (&i, contacts) in held.iter().zip(contacts(world, geometry, &thresholds, &held)) {
        near[i as usize] = contacts;
    }
    near
}

/// Places of `some`, a part of `all`, in it; both are in order.
fn slots<'a>(all: &'a [u32], some: &'a [u32]) -> impl Iterator<Item = usize> + 'a {
    some.iter().filter_map(|i| all.binary_search(i).ok())
}

/// The largest set among these slow particles in which each one stands, and everyone's contacts.
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
        let among_grains = !near[k].is_empty() || world.particles[i as usize].is_jostled();
        let holds = |j: &u32| slow.binary_search(j).map_or(true, |other| counts[other]);
        if among_grains && stands(world, thresholds, i, near[k].iter().copied().filter(holds)) {
            continue;
        }
        counts[k] = false;
        doubtful.extend(slots(slow, &near[k]).filter(|&other| counts[other]));
    }
    (slow.iter().zip(counts).filter_map(|(&i, counts)| counts.then_some(i)).collect(), near)
}

/// Of each of these particles those in contact that are among them, held or fixed; in order.
pub(super) fn contacts(
    world: &World,
    geometry: &Geometry,
    thresholds: &Thresholds,
    some: &[u32],
) -> Vec<Vec<u32>> {
    let mut slot = vec![u32::MAX; world.particles.len()];
    for (k, &i) in some.iter().enumerate() {
        slot[i as usize] = k as u32;
    }
    let solid = (0..world.particles.len() as u32)
        .filter(|&i| slot[i as usize] != u32::MAX || world.is_held(i) || is_fixed(world, i));
    let mut near = vec![Vec::new(); some.len()];
    let levels = levels(world, geometry, &solid, thresholds.gap, &Slabs::BOX);
    for first in 0..levels.len() {
        for cell in 0..levels[first].len() {
            meet(world, &levels[first..], cell, |k, level, others| {
                let i = levels[first].rows[k];
                let (position, radius) = (place(world, i), world.class(i).radius);
                for &j in &level.rows[others] {
                    let slots = [slot[i as usize], slot[j as usize]];
                    let reach = radius + world.class(j).radius + thresholds.gap;
                    if slots == [u32::MAX; 2] {
                        continue;
                    }
                    let r = world.nearest_image(place(world, j) - position);
                    if r.length_squared() <= reach * reach {
                        for (slot, partner) in slots.into_iter().zip([j, i]) {
                            if slot != u32::MAX {
                                near[slot as usize].push(partner);
                            }
                        }
                    }
                }
            });
        }
    }
    for contacts in &mut near {
        contacts.sort_unstable();
    }
    near
}

/// Puts particle i to rest, and books what it loses.
fn settle(state: &mut State, i: u32, thresholds: &Thresholds, observer: &mut dyn Observer) {
    end_series(state, i, observer);
    let velocity = state.world.state(i, state.world.now).1;
    let momentum = state.world.body(i).mass * velocity;
    state.world.set_held(i, true, state.world.now);
    let energy = 0.5 * momentum.dot(velocity);
    // A plastic impact on a body at rest: E'_c = J²/(2m) equals the energy loss.
    book(state, i, momentum, [energy, energy], thresholds, observer);
}

/// Books the completed series of bounces of particle i, if there is one, before its time.
pub(super) fn end_series(state: &mut State, i: u32, observer: &mut dyn Observer) {
    let time = state.world.now;
    if observer.wants_events() {
        resolve::end_of_rest::<true>(state, i, time, observer);
    } else {
        resolve::end_of_rest::<false>(state, i, time, observer);
    }
}

/// Books a momentum, an energy and a Carnot energy that rest takes from particle i.
pub(super) fn book(
    state: &mut State,
    i: u32,
    momentum: DVec3,
    [energy, carnot_energy]: [f64; 2],
    thresholds: &Thresholds,
    observer: &mut dyn Observer,
) {
    let State { world, book, .. } = state;
    book.add_energy(Term::Rest, world.clock.time(world.now), energy);
    book.carnot.add(carnot_energy);
    book.add_impulse(-momentum);
    book.counters.rests += 1;
    if observer.wants_events() {
        let (position, _) = world.state(i, world.now);
        let body = world.body(i);
        let wall = world.walls.iter().enumerate().position(|(wall, plane)| {
            !plane.motion.is_moving()
                && world.wall_approach(wall as u32, body.radius, position, DVec3::ZERO, world.now).0
                    <= thresholds.gap
        });
        let down = world.gravity.normalize_or_zero();
        observer.event(&EventRecord {
            time: world.clock.time(world.now),
            kind: EventKind::Rest,
            i,
            j: wall.map_or(NO_PARTNER, |wall| wall as u32),
            approach_speed: momentum.length() / body.mass,
            impulse: momentum.length(),
            energy_loss: energy,
            carnot_energy,
            normal: down,
            position: world.wrap(position + down * body.radius).0,
        });
    }
}
