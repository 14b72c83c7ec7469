//! Putting a grain to rest, and recording what it loses.

use glam::DVec3;

use crate::{
    laws::{series, slide},
    model::thresholds::Thresholds,
    motion::flights,
    report::{EventKind, EventRecord, NO_PARTNER, Observer, ledger::Term},
    state::State,
};

/// Puts particle i to rest, and records its losses.
pub(crate) fn settle(state: &mut State, i: u32, thresholds: &Thresholds, observer: &mut dyn Observer) {
    end_series(state, i, observer);
    let velocity = state.world.state(i, state.world.now).1;
    let momentum = state.world.body(i).mass * velocity;
    let (rotation, _) = state.world.rotation(i, state.world.now);
    flights::end(state, i, state.world.now);
    state.world.set_asleep(i, true, state.world.now);
    let energy = 0.5 * momentum.dot(velocity) + rotation;
    // A plastic impact on a body at rest: E'_c = J²/(2m) equals the energy loss.
    record_loss(state, i, momentum, [energy, energy], thresholds, observer);
}

/// If particle i is in a completed series of bounces or slides, ends that now and records its losses.
pub(crate) fn end_series(state: &mut State, i: u32, observer: &mut dyn Observer) {
    let time = state.world.now;
    if observer.wants_events() {
        series::end_of_bounces::<true>(state, i, time, observer);
        slide::interrupt::<true>(state, i, time, observer);
    } else {
        series::end_of_bounces::<false>(state, i, time, observer);
        slide::interrupt::<false>(state, i, time, observer);
    }
}

/// Records the momentum, energy and Carnot energy that particle i loses by being put to rest.
pub(crate) fn record_loss(
    state: &mut State,
    i: u32,
    momentum: DVec3,
    [energy, carnot_energy]: [f64; 2],
    thresholds: &Thresholds,
    observer: &mut dyn Observer,
) {
    let State { world, accumulators, .. } = state;
    accumulators.add_energy(Term::Rest, world.clock.shown(world.now), energy);
    accumulators.add_elastic_impact(0.0, carnot_energy);
    accumulators.add_impulse(-momentum);
    accumulators.counters.rests += 1;
    if observer.wants_events() {
        let (position, _) = world.state(i, world.now);
        let body = world.body(i);
        let wall = world.boundary.walls.iter().enumerate().position(|(wall, plane)| {
            !plane.motion.is_moving()
                && world.wall_distance(i, wall as u32, position) - body.radius <= thresholds.gap
        });
        let down = world.gravity.normalize_or_zero();
        observer.event(&EventRecord {
            time: world.clock.shown(world.now),
            kind: EventKind::Rest,
            i,
            j: wall.map_or(NO_PARTNER, |wall| wall as u32),
            approach_speed: momentum.length() / body.mass,
            impulse: momentum.length(),
            energy_loss: energy,
            carnot_energy,
            normal: down,
            position: world.boundary.periodicity.wrap(position + down * body.radius).0,
            impulse_vector: momentum,
            tangential_loss: 0.0,
        });
    }
}
