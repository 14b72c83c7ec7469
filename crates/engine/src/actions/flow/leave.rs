//! What a particle takes with it when an outlet takes it out.

use glam::DVec3;
use haff_mechanics::Impact;

use crate::{
    actions::settling::settle::end_series,
    laws::{carried, resting},
    motion::flights,
    numerics::error::EngineError,
    report::{EventKind, Exchange, NO_PARTNER, Observer, Partner, VelocityChange, ledger::Term, row},
    state::State,
};

/// Ends all that particle i takes part in, wakes the grains that it has supported, and takes its energy and
/// its momentum off the balances. It is still in the world afterwards.
pub(super) fn leave(state: &mut State, i: u32, observer: &mut dyn Observer) -> Result<(), EngineError> {
    let now = state.world.now;
    end_series(state, i, observer);
    resting::wake(state, i, now);
    if observer.wants_events() {
        carried::release::<true>(state, i, now, observer)?;
    } else {
        carried::release::<false>(state, i, now, observer)?;
    }
    let (position, velocity) = state.world.state(i, now);
    flights::end(state, i, now);
    if state.world.particles[i as usize].rests() {
        state.world.set_support(i, [None; 3], now);
    }
    // The acceleration is another one from now on.
    state.world.set_anchor(i, position, velocity, now);
    exchange(state, i, -1.0, observer);
    Ok(())
}

/// Adds the energy, momentum and weight of particle i, which comes in (`sign` 1) or leaves (−1), to the
/// balances, and reports it.
pub(super) fn exchange(state: &mut State, i: u32, sign: f64, observer: &mut dyn Observer) {
    let State { world, accumulators, .. } = state;
    let (now, mass) = (world.now, world.class(i).mass);
    let time = world.clock.shown(now);
    let (position, velocity) = world.peculiar(i, now);
    let (rotation, _) = world.rotation(i, now);
    let momentum = mass * velocity;
    let translation = 0.5 * momentum.dot(velocity);
    let potential = -mass * world.gravity.dot(position);
    let term = if sign > 0.0 { Term::Inlet } else { Term::Outlet };
    accumulators.add_energy(term, time, translation);
    accumulators.add_rotation(term, rotation + potential);
    accumulators.add_impulse(sign * momentum);
    let weight = mass * world.gravity;
    if weight != DVec3::ZERO {
        world.force.change(sign * weight, time);
    }
    if !observer.wants_events() {
        return;
    }
    let [before, after] = if sign > 0.0 { [DVec3::ZERO, velocity] } else { [velocity, DVec3::ZERO] };
    let changes = [VelocityChange { i, mass, before, after }];
    observer.exchange(&Exchange { time, changes: &changes, partner: Partner::Drive });
    let kind = if sign > 0.0 { EventKind::Enter } else { EventKind::Leave };
    let place = world.boundary.periodicity.wrap(world.state(i, now).0).0;
    observer.event(&row(time, kind, [i, NO_PARTNER], &Impact::default(), DVec3::ZERO, place));
}
