//! Impacts under shear: peculiar velocities, and the work of the shear.
//!
//! In an impact the work is −γ̇ y₁₂ J_x, with the vector r₁₂ of the centers and the impulse J on the second
//! particle. With that in the flights it is −γ̇ V P_yx in a unit of time.

use glam::DVec3;

use crate::{
    motion::{flights, shear_work::note_path},
    report::{VelocityChange, ledger::Term},
    state::{State, world::World},
};

/// Makes the velocities of an impact peculiar. The velocity of the second particle before it is that of its
/// image in contact, at `r` from the first one.
pub(crate) fn make_peculiar(
    world: &World,
    changes: &mut [VelocityChange; 2],
    positions: [DVec3; 2],
    r: DVec3,
) {
    let [first, second] = changes;
    let flow = world.flow_velocity(positions[0]);
    (first.before, first.after) = (first.before - flow, first.after - flow);
    second.before -= world.flow_velocity(positions[0] + r);
    second.after -= world.flow_velocity(positions[1]);
}

/// Adds the work of the shear on two particles until their impact at `ticks`, and in it: `r` is the vector
/// between their centers and `impulse` that on the second one. Their anchors are still those before.
#[inline(never)]
pub(crate) fn end_flights(state: &mut State, bodies: [u32; 2], r: DVec3, impulse: DVec3, ticks: i64) {
    if state.world.boundary.shear.is_none() {
        return;
    }
    for i in bodies {
        note_path(&mut state.world, i, ticks);
        flights::end(state, i, ticks);
    }
    let Some(shear) = &state.world.boundary.shear else { return };
    let work = -shear.rate * r[shear.gradient] * impulse[shear.flow];
    let now = state.world.clock.shown(ticks);
    state.accumulators.add_energy(Term::ShearWork, now, work);
}
