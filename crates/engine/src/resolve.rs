//! Resolves collisions of particles: changes velocities, sets anchors and records losses.
//!
//! Impacts on walls are in [`crate::wall_impact`].

use glam::DVec3;
use haff_mechanics::{Impact, work_of_moving_body};

use crate::{
    accumulators::Accumulators,
    error::EngineError,
    features::Features,
    flights,
    ledger::Term,
    overlap::allowed_overlap,
    pair_law::{self, PairContact},
    particles::{ClassData, World},
    random::mix,
    report::{EventKind, EventRecord, Exchange, Observer, Partner, VelocityChange},
    rough,
    series::{end_of_bounces_early, keep_support},
    shear,
    state::State,
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
        return world.flight::<F>(i, time);
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
    if depth <= allowed_overlap(sigma, coordinates.max_element().max(length) + sigma + world.extent) {
        return Ok(());
    }
    Err(EngineError::Overlap { time: world.clock.time(time), i, partner, depth: depth / sigma })
}

/// Sets the anchor of particle i. Returns an error if the velocity is not finite.
pub(crate) fn anchor(
    world: &mut World,
    i: u32,
    position: DVec3,
    velocity: DVec3,
    time: i64,
) -> Result<(), EngineError> {
    world.particles[i as usize].set_anchor(position, velocity, time);
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
        EngineError::Overflow { time: world.clock.time(time), i, velocity: velocity.to_array() }
    }
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

/// An impact of two particles.
#[derive(Debug, Clone, Copy)]
pub(crate) struct PairImpact {
    /// In ascending order.
    bodies: [u32; 2],
    classes: [ClassData; 2],
    /// Positions at the contact.
    positions: [DVec3; 2],
    /// Velocities before and after the impact. Before it the second one is that of the image in contact.
    before: [DVec3; 2],
    after: [DVec3; 2],
    /// Unit vector from the first to the second, and the distance of their centers.
    n: DVec3,
    distance: f64,
    impact: Impact,
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
    if F::SHEAR {
        let image_velocity;
        (r, image_velocity) = world.nearest_image(r, time);
        wj += image_velocity;
    } else {
        r = world.periodicity.nearest(r);
    }
    let distance = r.length();
    let n = r / distance;
    let (a, b) = (*world.class(i), *world.class(j));
    if (!F::UNIFORM || F::GRAVITY) && world.corrects_penetration {
        let sigma = a.radius + b.radius;
        let depth = penetration_to_correct(sigma - distance, ri.abs().max(rj.abs()), sigma);
        if depth > 0.0 {
            let mut coordinates = ri.abs().max(rj.abs()).max(world.coordinates(i)).max(world.coordinates(j));
            if F::SHEAR {
                coordinates += DVec3::splat(shear::path(world, i, time).max(shear::path(world, j, time)));
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
    let contact = PairContact { bodies: [i, j], classes: [a, b], velocities: [wi, wj], r, distance, n, time };
    Ok((contact, [ri, rj]))
}

/// The impact of two particles at `time`: a function of their anchors.
///
/// # Errors
/// An overlap that is more than rounding, or a velocity that is not finite.
#[inline(always)]
pub(crate) fn collide<F: Features>(
    world: &World,
    bodies: [u32; 2],
    time: i64,
) -> Result<PairImpact, EngineError> {
    let (contact, [ri, rj]) = touch::<F>(world, bodies, time)?;
    let PairContact { bodies: [i, j], classes: [a, b], velocities: [wi, wj], distance, n, .. } = contact;
    let (ui, uj, impact) = pair_law::resolve::<F>(world, &contact);
    let [ui, mut uj] = if !F::ELASTIC && world.spin.is_some() {
        rough::velocities::<F>(world, [i, j], time)
    } else {
        [ui, uj]
    };
    if F::SHEAR {
        uj -= world.nearest_image(rj - ri, time).1;
    }
    if a.inverse_mass != 0.0 {
        check_velocity(world, i, ui, time)?;
    }
    if b.inverse_mass != 0.0 {
        check_velocity(world, j, uj, time)?;
    }
    Ok(PairImpact {
        bodies: [i, j],
        classes: [a, b],
        positions: [ri, rj],
        before: [wi, wj],
        after: [ui, uj],
        n,
        distance,
        impact,
    })
}

/// Resolves the collision of two particles at `time`.
#[inline(always)]
pub(crate) fn collision<F: Features, const EVENTS: bool>(
    state: &mut State,
    [i, j]: [u32; 2],
    time: i64,
    observer: &mut dyn Observer,
) -> Result<(), EngineError> {
    if F::GRAVITY {
        end_of_bounces_early::<EVENTS>(state, i.min(j), time, observer);
        end_of_bounces_early::<EVENTS>(state, i.max(j), time, observer);
    }
    let impact = collide::<F>(&state.world, [i, j], time)?;
    apply::<F, EVENTS>(state, &impact, time, observer);
    Ok(())
}

/// Sets the anchors of two particles after their impact, and adds its energies.
#[inline(always)]
pub(crate) fn apply<F: Features, const EVENTS: bool>(
    state: &mut State,
    impact: &PairImpact,
    time: i64,
    observer: &mut dyn Observer,
) {
    let &PairImpact { bodies: [i, j], classes: [a, b], positions, before, after, n, distance, .. } = impact;
    let impact = impact.impact;
    let tangential = if !F::ELASTIC && state.world.spin.is_some() {
        Some(rough::apply_pair::<F>(state, [i, j], time))
    } else {
        None
    };
    if F::SHEAR {
        let more = tangential.as_ref().map_or(DVec3::ZERO, |tangential| tangential.impulse);
        shear::end_flights(state, [i, j], n * distance, n * impact.impulse + more, time);
    }
    if F::GRAVITY {
        flights::end(state, i, time);
        flights::end(state, j, time);
    }
    let world = &mut state.world;
    // A body of infinite mass keeps its anchor: its flight has not changed, so predictions with it stay
    // valid.
    if a.inverse_mass != 0.0 {
        world.particles[i as usize].set_anchor(positions[0], after[0], time);
    }
    if b.inverse_mass != 0.0 {
        world.particles[j as usize].set_anchor(positions[1], after[1], time);
    }
    if !F::ELASTIC && world.contact_times.is_some() {
        world.note_contacts([i, j], time);
    }
    if F::REST {
        world.particles[i as usize].set_recently_hit(true);
        world.particles[j as usize].set_recently_hit(true);
    }
    let now = world.clock.time(time);
    if F::GRAVITY {
        keep_support(state, i, time);
        keep_support(state, j, time);
    }

    let accumulators = &mut state.accumulators;
    accumulators.counters.collisions += 1;
    add_impact::<F>(accumulators, now, impact.impulse * distance, &impact);
    if !F::UNIFORM {
        // The impulse on i is −J n, on j +J n.
        if a.inverse_mass == 0.0 {
            accumulators.counters.fixed_collisions += 1;
            accumulators.add_impulse(n * impact.impulse);
            accumulators.add_energy(Term::WallWork, now, work_of_moving_body(impact.impulse, -n, before[0]));
        } else if b.inverse_mass == 0.0 {
            accumulators.counters.fixed_collisions += 1;
            accumulators.add_impulse(n * -impact.impulse);
            accumulators.add_energy(Term::WallWork, now, work_of_moving_body(impact.impulse, n, before[1]));
        }
    }
    if EVENTS {
        let change =
            |i, class: &ClassData, before, after| VelocityChange { i, mass: class.mass, before, after };
        let mut changes = [change(i, &a, before[0], after[0]), change(j, &b, before[1], after[1])];
        if F::SHEAR {
            shear::make_peculiar(&state.world, &mut changes, positions, n * distance);
        }
        let [ri, rj] = positions;
        let (changes, position, branch) = match (a.inverse_mass == 0.0, b.inverse_mass == 0.0) {
            (false, false) => (&changes[..], ri, n * distance),
            (false, true) => (&changes[..1], ri, n * distance),
            (true, _) => (&changes[1..], rj, n * -distance),
        };
        let partner = Partner::Particle { position, branch };
        observer.exchange(&Exchange { time: now, changes, partner });
        let contact_point = state.world.wrap(ri + n * a.radius, time).0;
        let mut row = row(now, EventKind::Collision, [i, j], &impact, n, contact_point);
        if let Some(tangential) = tangential {
            tangential.add_to(&mut row);
        }
        observer.event(&row);
    }
}

impl PairImpact {
    /// The particles with their positions and velocities after the impact.
    #[inline(always)]
    pub fn after(&self) -> [(u32, DVec3, DVec3); 2] {
        [0, 1].map(|k| (self.bodies[k], self.positions[k], self.after[k]))
    }
}

pub(crate) fn row(
    time: f64,
    kind: EventKind,
    [i, j]: [u32; 2],
    impact: &Impact,
    normal: DVec3,
    position: DVec3,
) -> EventRecord {
    EventRecord {
        time,
        kind,
        i,
        j,
        approach_speed: impact.approach_speed,
        impulse: impact.impulse,
        energy_loss: impact.energy_loss,
        carnot_energy: impact.carnot_energy,
        normal,
        position,
        impulse_vector: normal * impact.impulse,
        tangential_loss: 0.0,
    }
}
