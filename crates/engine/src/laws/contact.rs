//! The contact of two particles, and checks that all impacts share.
//!
//! Bounces under gravity are alike, and so would be their rounding. Flights to an event are rounded without
//! a preferred direction (`free_flight_stochastic`, with a hash of the event), contacts with walls
//! perpendicular to an axis are at a coordinate that is a number (`World::is_level`), and a series of
//! bounces is completed where it loses less than rounding. Bodies that overlap by more than two ulp of their
//! coordinates are put back, by halves if both can move. `allowed_overlap` is the bound that every impact of
//! such systems and every frame is tested against.

use glam::DVec3;
use haff_mechanics::{Impact, random::mix};

use crate::{
    laws::pair_law::PairContact,
    model::{bounds::allowed_overlap, features::Features},
    motion::flow_work,
    numerics::error::EngineError,
    report::ledger::Term,
    state::{State, accumulators::Accumulators, world::World},
};

/// A penetration is corrected if it is more than this fraction of the coordinates.
const PENETRATION_TOLERANCE: f64 = 2.0 * f64::EPSILON;

/// The distance by which bodies in contact must be moved apart: `depth`, their penetration, if coordinates of
/// this size resolve it, else 0.
///
/// A bounce under gravity returns to the height at which it started, and equal bounces are rounded in the
/// same way every time: without a correction the penetration would grow by one rounding error per bounce. The
/// correction also restores the potential energy that the penetration has taken. Without gravity, a grain in
/// a wedge also has very many bounces, which become shorter and shorter.
#[inline(always)]
pub(crate) fn penetration_to_correct(depth: f64, coordinates: DVec3, reach: f64) -> f64 {
    if depth > PENETRATION_TOLERANCE * (coordinates.max_element() + reach) { depth } else { 0.0 }
}

/// Position and velocity of particle i in its own event at `time`, before the impact.
#[inline(always)]
pub(crate) fn state_at_event<F: Features>(world: &World, i: u32, time: i64) -> (DVec3, DVec3) {
    if !F::GRAVITY {
        let (position, velocity) = world.flight::<F>(i, time);
        return (position, if F::DAMPED { world.damped(velocity, time) } else { velocity });
    }
    if let Some(wall) = world.carrier(i) {
        let particle = &world.particles[i as usize];
        let (a, dt) = (world.acceleration(i), world.age(i, time));
        let along = (
            haff_mechanics::free_flight(particle.position, particle.velocity, a, dt),
            haff_mechanics::free_flight_velocity(particle.velocity, a, dt),
        );
        return world.carried(i, wall, time, along);
    }
    let particle = &world.particles[i as usize];
    // The bits depend on the particle and the time only, so that every search, scheduler and resumed run
    // rounds in the same way.
    let bits = mix(time as u64 ^ u64::from(i).rotate_left(32) ^ u64::from(particle.count).rotate_right(16));
    haff_mechanics::free_flight_stochastic(
        particle.position,
        particle.velocity,
        world.acceleration(i),
        world.age(i, time),
        bits,
    )
}

/// Returns an error if a penetration of `depth` is more than rounding, for the contact distance `sigma` and
/// these coordinates.
#[cold]
pub(crate) fn check_penetration(
    world: &World,
    depth: f64,
    sigma: f64,
    coordinates: DVec3,
    (i, partner): (u32, Option<u32>),
    time: i64,
) -> Result<(), EngineError> {
    let length = partner.map_or(0.0, |j| world.flight_length(j, time)).max(world.flight_length(i, time));
    if depth
        <= allowed_overlap(sigma, coordinates.max_element().max(length) + sigma + world.resolution.extent)
    {
        return Ok(());
    }
    Err(EngineError::Overlap { time: world.clock.shown(time), i, partner, depth: depth / sigma })
}

/// Sets the anchor of particle i. Returns an error if the velocity is not finite.
pub(crate) fn anchor(
    world: &mut World,
    i: u32,
    position: DVec3,
    velocity: DVec3,
    time: i64,
) -> Result<(), EngineError> {
    world.set_anchor(i, position, velocity, time);
    if velocity.is_finite() { Ok(()) } else { Err(velocity_error(world, i, velocity, time)) }
}

/// Returns an error if the new velocity of particle i is not finite, or too large for the tick.
#[inline(always)]
pub(crate) fn check_velocity(world: &World, i: u32, velocity: DVec3, time: i64) -> Result<(), EngineError> {
    if world.is_resolved(velocity) { Ok(()) } else { Err(velocity_error(world, i, velocity, time)) }
}

// Inlined: a call takes the address of the velocity, which then is in memory in every impact, with all that
// it is computed from (45 instructions).
#[inline(always)]
fn velocity_error(world: &World, i: u32, velocity: DVec3, time: i64) -> EngineError {
    if velocity.is_finite() {
        EngineError::LongTick { speed: velocity.length() }
    } else {
        EngineError::Overflow { time: world.clock.shown(time), i, velocity: velocity.to_array() }
    }
}

/// Counts a contact of these bodies at `time` among the simultaneous ones, if one of them has had an event
/// then. Before the contact sets their anchors.
#[inline(always)]
pub(crate) fn note_tie(state: &mut State, bodies: &[u32], time: i64) {
    if bodies.iter().any(|&i| state.world.particles[i as usize].time == time) {
        count_tie(state, bodies, time);
    }
}

#[cold]
#[inline(never)]
fn count_tie(state: &mut State, bodies: &[u32], time: i64) {
    let is_tie = |&i: &u32| {
        let particle = &state.world.particles[i as usize];
        // At the start all anchors have the time of the start, and no events.
        particle.time == time && particle.count != 0
    };
    state.accumulators.counters.simultaneous += u64::from(bodies.iter().any(is_tie));
}

/// Adds the virial of an impact at `now`, 0 for a wall, and its losses. A negative loss, of bodies that
/// separate faster than they approach, is added to [`Term::Rest`].
#[inline(always)]
pub(crate) fn add_impact<F: Features>(
    accumulators: &mut Accumulators,
    now: f64,
    virial: f64,
    impact: &Impact,
) {
    if F::ELASTIC {
        accumulators.add_elastic_impact(virial, impact.carnot_energy);
        return;
    }
    let taken = if F::REST { impact.energy_loss.max(0.0) } else { impact.energy_loss };
    accumulators.add_impact(now, virial, taken, impact.carnot_energy);
    if F::REST && impact.energy_loss < 0.0 {
        accumulators.add_energy(Term::Rest, now, impact.energy_loss);
    }
}

/// The contact of two particles at `time`, and their positions: a function of their anchors.
///
/// # Errors
/// An overlap that is more than rounding.
#[inline(always)]
pub(crate) fn touch<F: Features>(
    world: &World,
    bodies: [u32; 2],
    time: i64,
) -> Result<(PairContact, [DVec3; 2]), EngineError> {
    // Lower index first, so that the bits do not depend on which of the two owned the entry.
    let (i, j) = (bodies[0].min(bodies[1]), bodies[0].max(bodies[1]));
    let (mut ri, wi) = state_at_event::<F>(world, i, time);
    let (mut rj, mut wj) = state_at_event::<F>(world, j, time);
    let mut r = rj - ri;
    let mut image_velocity = DVec3::ZERO;
    if F::DEFORMS {
        (r, image_velocity) = world.nearest_image(r, time);
        wj += image_velocity;
    } else {
        r = world.boundary.periodicity.nearest(r);
    }
    let distance = r.length();
    let n = r / distance;
    let (a, b) = (*world.class(i), *world.class(j));
    if (!F::UNIFORM || F::GRAVITY) && world.laws.corrects_penetration {
        let sigma = a.radius + b.radius;
        let depth = penetration_to_correct(sigma - distance, ri.abs().max(rj.abs()), sigma);
        if depth > 0.0 {
            let mut coordinates = ri.abs().max(rj.abs()).max(world.coordinates(i)).max(world.coordinates(j));
            if F::DEFORMS {
                // An image many edges away has many times the speed of the next one.
                let relative = (wj - wi).length() * world.age(i, time).max(world.age(j, time));
                let path = flow_work::path(world, i, time).max(flow_work::path(world, j, time));
                coordinates += DVec3::splat(path.max(relative));
            }
            check_penetration(world, depth, sigma, coordinates, (i, Some(j)), time)?;
            // By halves, whatever the masses. Shares by mass would move a light grain between a heavy one and
            // a wall almost alone, and press it into the wall deeper and deeper.
            let [shift_i, shift_j] = match (a.inverse_mass == 0.0, b.inverse_mass == 0.0) {
                // Where grains are put to rest, `resolve_jam` resolves jams instead. With a correction here,
                // one of the heaps in the tests ended in a collapse.
                (false, false) if F::REST => [0.0; 2],
                (false, false) => [0.5 * depth; 2],
                (false, true) => [depth, 0.0],
                (true, _) => [0.0, depth],
            };
            ri -= n * shift_i;
            rj += n * shift_j;
        }
    }
    let velocities = [wi, wj];
    let contact =
        PairContact { bodies: [i, j], classes: [a, b], velocities, image_velocity, r, distance, n, time };
    Ok((contact, [ri, rj]))
}
