//! Impacts in a box that deforms: peculiar velocities, and the work of the flow.
//!
//! In an impact the work is −J·G r, with the vector r of the centers and the impulse J on the second
//! particle. With that in the flights it is −V P : G in a unit of time.

use glam::DVec3;

use crate::{
    motion::{flights, flow_work::note_path},
    report::VelocityChange,
    state::{State, flight_sums::Summed, world::World},
};

/// Makes the velocities of an impact peculiar. The velocity of the second particle before it is that of its
/// image in contact, at `r` from the first one.
pub(crate) fn make_peculiar(
    world: &World,
    changes: &mut [VelocityChange; 2],
    positions: [DVec3; 2],
    r: DVec3,
    ticks: i64,
) {
    let [first, second] = changes;
    let flow = world.flow_velocity(positions[0], ticks);
    (first.before, first.after) = (first.before - flow, first.after - flow);
    second.before -= world.flow_velocity(positions[0] + r, ticks);
    second.after -= world.flow_velocity(positions[1], ticks);
}

/// Adds the work of the flow on two particles until their impact at `ticks`, and in it: `r` is the vector
/// between their centers and `impulse` that on the second one. Their anchors are still those before.
#[inline(never)]
pub(crate) fn end_flights(state: &mut State, bodies: [u32; 2], r: DVec3, impulse: DVec3, ticks: i64) {
    let Some(images) = &state.world.boundary.deformation else { return };
    let (time, now) = (state.world.clock.time(ticks), state.world.clock.shown(ticks));
    let (term, work) = (images.term(), images.work_of_impact(r, impulse, time));
    let isotropic = images.isotropic;
    for i in bodies {
        note_path(&mut state.world, i, ticks);
    }
    match isotropic {
        Some(isotropic) if state.world.flights != Summed::Tensor => {
            let in_flights = flights::end_isotropic(state, &isotropic, bodies, ticks);
            state.accumulators.add_work(term, now, work, in_flights);
        }
        _ => {
            for i in bodies {
                flights::end(state, i, ticks);
            }
            state.accumulators.add_energy(term, now, work);
        }
    }
}
