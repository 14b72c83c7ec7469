//! The particles that a drive acts on, and kicks.

use glam::DVec3;
use haff_mechanics::random::Draw;

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
    /// Whether it acts on angular velocities, too.
    pub rotational: bool,
}

impl Driven {
    pub(super) fn new(system: &System, drive: &Drive) -> Self {
        let is_driven = |&i: &u32| {
            let body = &system.bodies[i as usize];
            drive.species.contains(&body.species) && system.classes[body.class as usize].mass.is_finite()
        };
        let particles = (0..system.bodies.len() as u32).filter(is_driven).collect();
        let rotational = drive.rotational && system.spin.is_some();
        Self { particles, dimension: system.dimension.count(), rotational }
    }

    /// A normal number for each axis of rotation of a particle in its next event, times √(m/I): `spread`
    /// times this is the angular velocity, or its change, if `spread` times a normal number is that of a
    /// component of the velocity. `None` if the drive does not act on rotations.
    pub fn turns(&self, state: &State, seed: u64, i: u32) -> Option<DVec3> {
        let spins = self.rotational.then_some(state.world.spin.as_deref()).flatten()?;
        let (class, count) = (state.world.class(i), u64::from(state.world.particles[i as usize].count));
        // Another sequence than that of the velocity.
        let mut draw = Draw::new(seed ^ 0x6861_6666_2073_7069, i, count);
        let turn = if self.dimension == 2 { DVec3::Z * draw.normal() } else { draw.normals(3) };
        Some(turn * (class.mass / class.moment_of_inertia(&spins.inertia)).sqrt())
    }
}

/// Gives particle i a new velocity at the present, and a new angular velocity if there is one, and adds the
/// work and the impulse to the accumulators. The energy is that of the peculiar velocity.
pub(super) fn kick(
    state: &mut State,
    i: u32,
    velocity: DVec3,
    spin: Option<DVec3>,
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
    state.world.set_anchor(i, position, velocity, now);
    let change = velocity - before;
    let flow = state.world.flow_velocity(position, now);
    let (before, velocity) = (before - flow, velocity - flow);
    state.accumulators.add_energy(Term::DriveWork, time, 0.5 * mass * change.dot(velocity + before));
    if let Some(spin) = spin {
        let energy = state.world.set_spin(i, spin, now);
        state.accumulators.add_rotation(Term::DriveWork, energy);
    }
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
