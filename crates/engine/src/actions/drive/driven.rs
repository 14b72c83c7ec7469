//! The particles that a drive acts on, and kicks.

use glam::DVec3;

use crate::{
    laws::series,
    model::{System, drive::Drive},
    motion::flights,
    numerics::error::EngineError,
    report::{Exchange, Observer, Partner, VelocityChange, ledger::Term},
    state::State,
};

/// The particles that a drive acts on.
#[derive(Debug)]
pub(super) struct Driven {
    pub particles: Vec<u32>,
    pub dimension: usize,
}

impl Driven {
    pub(super) fn new(system: &System, drive: &Drive) -> Self {
        let is_driven = |&i: &u32| {
            let body = &system.bodies[i as usize];
            drive.species.contains(&body.species) && system.classes[body.class as usize].mass.is_finite()
        };
        let particles = (0..system.bodies.len() as u32).filter(is_driven).collect();
        Self { particles, dimension: system.dimension.count() }
    }
}

/// Gives particle i a new velocity at the present, and adds the work and the impulse to the accumulators. The
/// energy is that of the peculiar velocity.
pub(super) fn kick(
    state: &mut State,
    i: u32,
    velocity: DVec3,
    observer: &mut dyn Observer,
) -> Result<(), EngineError> {
    let now = state.world.now;
    if observer.wants_events() {
        series::end_of_bounces_early::<true>(state, i, now, observer);
    } else {
        series::end_of_bounces_early::<false>(state, i, now, observer);
    }
    let time = state.world.clock.shown(now);
    if !velocity.is_finite() {
        return Err(EngineError::Overflow { time, i, velocity: velocity.to_array() });
    }
    let (position, before) = state.world.state(i, now);
    let mass = state.world.class(i).mass;
    flights::end(state, i, now);
    state.world.particles[i as usize].set_anchor(position, velocity, now);
    let change = velocity - before;
    let flow = state.world.flow_velocity(position, now);
    let (before, velocity) = (before - flow, velocity - flow);
    state.accumulators.add_energy(Term::DriveWork, time, 0.5 * mass * change.dot(velocity + before));
    state.accumulators.add_impulse(change * mass);
    state.accumulators.center.change(change * mass, time);
    if let Some(images) = &state.world.boundary.deformation {
        state.world.force.change(images.force(change * mass, time), time);
    }
    if observer.wants_events() {
        let changes = [VelocityChange { i, mass, before, after: velocity }];
        observer.exchange(&Exchange { time, changes: &changes, partner: Partner::Drive });
    }
    series::keep_support(state, i, now);
    Ok(())
}
