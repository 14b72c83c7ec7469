//! Resolves events: changes velocities, sets anchors and records losses.

use glam::DVec3;
use haff_mechanics::{Impact, Restitution, resolve_contact, work_of_moving_body};

use crate::{
    accumulators::Accumulators,
    carried,
    error::EngineError,
    features::Features,
    ledger::Term,
    overlap::allowed_overlap,
    pair_law::{self, PairContact, coefficient, impact_with_separation},
    particles::{ClassData, World},
    random::{Draw, mix},
    report::{EventKind, EventRecord, Exchange, Observer, Partner, VelocityChange},
    rest::contact,
    rough,
    series::{come_to_rest, end_of_bounces_early, keep_support, keep_supporting_walls},
    shear, slide,
    state::State,
    wall_law::WallLaw,
    wall_motion::WallMotion,
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
fn penetration_to_correct(depth: f64, coordinates: DVec3, reach: f64) -> f64 {
    if depth > PENETRATION_TOLERANCE * (coordinates.max_element() + reach) { depth } else { 0.0 }
}

/// Position and velocity of particle i in its own event at `time`, before the impact.
#[inline(always)]
fn state_at_event<F: Features>(world: &World, i: u32, time: i64) -> (DVec3, DVec3) {
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
fn check_penetration(
    world: &World,
    depth: f64,
    sigma: f64,
    coordinates: DVec3,
    (i, partner): (u32, Option<u32>),
    time: i64,
) -> Result<(), EngineError> {
    if depth <= allowed_overlap(sigma, coordinates.max_element() + sigma) {
        return Ok(());
    }
    Err(EngineError::Overlap { time: world.clock.time(time), i, partner, depth: depth / sigma })
}

/// Sets the anchor of particle i. Returns an error if the velocity is not finite.
#[inline(always)]
pub(crate) fn anchor(
    world: &mut World,
    i: u32,
    position: DVec3,
    velocity: DVec3,
    time: i64,
) -> Result<(), EngineError> {
    world.particles[i as usize].set_anchor(position, velocity, time);
    check_velocity(world, i, velocity, time)
}

/// Returns an error if the new velocity of particle i is not finite.
#[inline(always)]
fn check_velocity(world: &World, i: u32, velocity: DVec3, time: i64) -> Result<(), EngineError> {
    if velocity.is_finite() {
        return Ok(());
    }
    Err(EngineError::Overflow { time: world.clock.time(time), i, velocity: velocity.to_array() })
}

/// Adds the virial of an impact at `now`, 0 for a wall, and its losses. A negative loss, of bodies that
/// separate faster than they approach, is added to [`Term::Rest`].
#[inline(always)]
fn add_impact<F: Features>(accumulators: &mut Accumulators, now: f64, virial: f64, impact: &Impact) {
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
    let world = &mut state.world;
    // A body of infinite mass keeps its anchor: its flight has not changed, so predictions with it stay
    // valid.
    if a.inverse_mass != 0.0 {
        world.particles[i as usize].set_anchor(positions[0], after[0], time);
    }
    if b.inverse_mass != 0.0 {
        world.particles[j as usize].set_anchor(positions[1], after[1], time);
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
            accumulators.add_impulse(n * impact.impulse);
            accumulators.add_energy(Term::WallWork, now, work_of_moving_body(impact.impulse, -n, before[0]));
        } else if b.inverse_mass == 0.0 {
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

/// Resolves the collision of particle i with a wall at `time`.
#[inline]
pub(crate) fn wall<F: Features, const EVENTS: bool>(
    state: &mut State,
    i: u32,
    wall: u32,
    time: i64,
    observer: &mut dyn Observer,
) -> Result<(), EngineError> {
    if F::GRAVITY {
        end_of_bounces_early::<EVENTS>(state, i, time, observer);
    }
    let (contact, outcome) = collide_with_wall::<F>(&state.world, i, wall, time)?;
    apply_wall::<F, EVENTS>(state, &contact, &outcome, observer);
    Ok(())
}

/// Sets the anchor of a particle after its impact on a wall, and adds the energies of the impact.
#[inline(always)]
pub(crate) fn apply_wall<F: Features, const EVENTS: bool>(
    state: &mut State,
    contact: &WallContact,
    outcome: &WallOutcome,
    observer: &mut dyn Observer,
) {
    match outcome {
        WallOutcome::Bounce(bounce) => apply_bounce::<F, EVENTS>(state, contact, bounce, observer),
        WallOutcome::Reflection { velocity, spin } => {
            reflect::<EVENTS>(state, contact, (*velocity, *spin), Term::WallHeat, observer);
        }
    }
}

/// The contact of particle i with a wall at `time`: a function of its anchor.
///
/// # Errors
/// An overlap that is more than rounding.
#[inline(always)]
pub(crate) fn touch_wall<F: Features>(
    world: &World,
    i: u32,
    wall: u32,
    time: i64,
) -> Result<WallContact, EngineError> {
    let (mut position, velocity) = state_at_event::<F>(world, i, time);
    let class = *world.class(i);
    let (gap, _) = world.wall_approach(wall, class.radius, position, velocity, time);
    let depth = penetration_to_correct(-gap, position.abs(), class.radius);
    if depth > 0.0 {
        let coordinates =
            position.abs().max(world.coordinates(i)).max(world.walls[wall as usize].point.abs());
        check_penetration(world, depth, class.radius, coordinates, (i, None), time)?;
    }
    let normal = world.wall_normal(wall, position);
    if depth > 0.0 || world.is_level(wall) {
        position -= normal * gap;
    }
    let plane = &world.walls[wall as usize];
    let (n, wall_velocity) = (-normal, plane.motion.velocity(plane.normal, (&world.clock, time)));
    Ok(WallContact { i, wall, time, position, velocity, n, wall_velocity })
}

/// The impact of particle i on a wall at `time`: a function of its anchor.
///
/// # Errors
/// An overlap that is more than rounding, or a velocity that is not finite.
#[inline(always)]
pub(crate) fn collide_with_wall<F: Features>(
    world: &World,
    i: u32,
    wall: u32,
    time: i64,
) -> Result<(WallContact, WallOutcome), EngineError> {
    let contact = touch_wall::<F>(world, i, wall, time)?;
    let WallContact { n, wall_velocity, .. } = contact;
    let class = *world.class(i);
    let outcome = match world.wall_law(&class, wall) {
        WallLaw::Restitution(law) => WallOutcome::Bounce(bounce::<F>(world, &contact, law)),
        WallLaw::Thermal(law) => {
            let draw = Draw::new(world.seed, i, u64::from(world.particles[i as usize].count));
            match law.velocity(draw, class.mass, n, world.dimension) {
                Some(relative) => {
                    let spin = world.spin.as_deref().map(|spins| {
                        let moment = class.moment_of_inertia(&spins.inertia);
                        law.angular_velocity(draw, moment, world.dimension)
                    });
                    WallOutcome::Reflection { velocity: wall_velocity + relative, spin }
                }
                None => WallOutcome::Bounce(bounce::<F>(world, &contact, law.restitution)),
            }
        }
    };
    check_velocity(world, i, outcome.velocity(), time)?;
    Ok((contact, outcome))
}

impl PairImpact {
    /// The particles with their positions and velocities after the impact.
    #[inline(always)]
    pub fn after(&self) -> [(u32, DVec3, DVec3); 2] {
        [0, 1].map(|k| (self.bodies[k], self.positions[k], self.after[k]))
    }
}

impl WallOutcome {
    /// The velocity after the impact.
    pub fn velocity(&self) -> DVec3 {
        match self {
            Self::Bounce(bounce) => bounce.after,
            Self::Reflection { velocity, .. } => *velocity,
        }
    }
}

/// What a wall does with a particle.
#[derive(Debug, Clone, Copy)]
pub(crate) enum WallOutcome {
    Bounce(WallBounce),
    /// The particle leaves a thermal wall with this velocity and, if there is spin, this angular velocity.
    Reflection {
        velocity: DVec3,
        spin: Option<DVec3>,
    },
}

/// An impact on a wall by a law of restitution.
#[derive(Debug, Clone, Copy)]
pub(crate) struct WallBounce {
    law: Restitution,
    /// Velocity after the impact.
    after: DVec3,
    impact: Impact,
    /// Whether the impact repeats a recent one, see [`contact::is_repeated_wall_contact`].
    repeated: bool,
}

/// The impact of a particle on a wall by a law of restitution.
#[inline(always)]
fn bounce<F: Features>(world: &World, contact: &WallContact, law: Restitution) -> WallBounce {
    let &WallContact { i, wall, time, velocity, n, wall_velocity, .. } = contact;
    let class = world.class(i);
    let speed = haff_mechanics::approach_speed(velocity, wall_velocity, n);
    let e = coefficient::<F>(world, law, speed, time, [(i, class), (i, class)]);
    let mut repeated = false;
    // Resolved as for two spheres, without assuming |n| = 1: the length of a tilted normal has a rounding
    // error, which is the same at every impact.
    let (after, _, impact) = if F::REST {
        let acceleration = world.acceleration(i).dot(n);
        repeated = contact::is_repeated_wall_contact(world, i, wall, speed, acceleration, time);
        let separation =
            if repeated { contact::separation_speed(world, e, speed, acceleration, true) } else { e * speed };
        impact_with_separation([velocity, wall_velocity], [class.inverse_mass, 0.0], n, e, speed, separation)
    } else {
        resolve_contact(velocity, wall_velocity, class.inverse_mass, 0.0, n, e)
    };
    let after = if !F::ELASTIC && world.spin.is_some() {
        rough::wall_velocity::<F>(world, (i, wall, time), after, impact.impulse)
    } else {
        after
    };
    WallBounce { law, after, impact, repeated }
}

/// A contact of a particle with a wall, before its impact.
#[derive(Debug, Clone, Copy)]
pub(crate) struct WallContact {
    pub i: u32,
    pub wall: u32,
    /// [ticks]
    pub time: i64,
    pub position: DVec3,
    pub velocity: DVec3,
    /// Unit normal into the wall.
    pub n: DVec3,
    pub wall_velocity: DVec3,
}

/// Lets a particle leave a wall with a given velocity and spin. The energy that is not work of the moving
/// wall is added to `term`.
pub(crate) fn reflect<const EVENTS: bool>(
    state: &mut State,
    contact: &WallContact,
    (velocity, spin): (DVec3, Option<DVec3>),
    term: Term,
    observer: &mut dyn Observer,
) {
    let &WallContact { i, wall, time, position, n, wall_velocity, .. } = contact;
    let change = velocity - contact.velocity;
    let (before, after) = (contact.velocity - wall_velocity, velocity - wall_velocity);
    let class = *state.world.class(i);
    state.world.particles[i as usize].set_anchor(position, velocity, time);
    let now = state.world.clock.time(time);
    if let Some(spin) = spin {
        let energy = state.world.set_spin(i, spin);
        state.accumulators.add_rotation(term, energy);
        state.world.add_wall_heat(wall, energy);
    }
    let accumulators = &mut state.accumulators;
    accumulators.counters.wall_collisions += 1;
    accumulators.add_energy(term, now, 0.5 * class.mass * change.dot(before + after));
    if wall_velocity != DVec3::ZERO {
        accumulators.add_energy(Term::WallWork, now, class.mass * change.dot(wall_velocity));
    }
    accumulators.add_impulse(change * class.mass);
    state.world.add_wall_impulse(wall, change * class.mass);
    state.world.add_wall_heat(wall, 0.5 * class.mass * change.dot(before + after));
    if EVENTS {
        let changes = [VelocityChange { i, mass: class.mass, before: contact.velocity, after: velocity }];
        observer.exchange(&Exchange { time: now, changes: &changes, partner: Partner::Wall(wall) });
        // Only the normal components. The energy of `term` is not a loss by restitution.
        let approach_speed = before.dot(n);
        let impulse = -class.mass * change.dot(n);
        let impact = Impact { approach_speed, impulse, ..Impact::default() };
        let contact_point = state.world.periodicity.wrap(position + n * class.radius).0;
        let mut row = row(now, EventKind::Wall, [i, wall], &impact, n, contact_point);
        row.impulse_vector = change * -class.mass;
        observer.event(&row);
    }
    keep_support(state, i, time);
}

/// Sets the anchor of a particle after its impact on a wall, and adds the energies of the impact.
#[inline(always)]
fn apply_bounce<F: Features, const EVENTS: bool>(
    state: &mut State,
    contact: &WallContact,
    bounce: &WallBounce,
    observer: &mut dyn Observer,
) {
    let &WallContact { i, wall, time, position, velocity, n, wall_velocity } = contact;
    let &WallBounce { law, after, impact, repeated } = bounce;
    let tangential = if !F::ELASTIC && state.world.spin.is_some() {
        Some(rough::apply_wall::<F>(state, (i, wall, time), impact.impulse))
    } else {
        None
    };
    let world = &mut state.world;
    let class = *world.class(i);
    let before = if F::GRAVITY { (world.support(i), world.acceleration(i)) } else { Default::default() };
    world.particles[i as usize].set_anchor(position, after, time);
    if F::REST {
        world.particles[i as usize].set_recently_hit(repeated);
    }

    let now = world.clock.time(time);
    let accumulators = &mut state.accumulators;
    accumulators.counters.wall_collisions += 1;
    add_impact::<F>(accumulators, now, 0.0, &impact);
    accumulators.add_impulse(n * -impact.impulse);
    world.add_wall_impulse(wall, n * -impact.impulse);
    world.add_wall_heat(wall, -impact.energy_loss);
    if wall_velocity != DVec3::ZERO {
        accumulators.add_energy(Term::WallWork, now, work_of_moving_body(impact.impulse, n, wall_velocity));
    }
    if EVENTS {
        let changes = [VelocityChange { i, mass: class.mass, before: velocity, after }];
        observer.exchange(&Exchange { time: now, changes: &changes, partner: Partner::Wall(wall) });
        let contact_point = world.periodicity.wrap(position + n * class.radius).0;
        let mut row = row(now, EventKind::Wall, [i, wall], &impact, n, contact_point);
        if let Some(tangential) = &tangential {
            tangential.add_to(&mut row);
        }
        observer.event(&row);
    }
    if F::GRAVITY {
        keep_supporting_walls(state, i, time);
        // Supports have the normal of the wall: no grain rests on a partition.
        let can_rest = state.world.walls[wall as usize].partition.is_none();
        if can_rest && !repeated && state.world.wall_law(&class, wall).has_series() {
            let rest = match state.world.walls[wall as usize].motion {
                WallMotion::Fixed => come_to_rest(state, i, wall, law, before, time),
                WallMotion::Oscillating(_) => carried::start(state, i, wall, law, time),
                WallMotion::Constant(_) => None,
            };
            if let Some(rest) = rest {
                state.pending.insert(i, rest);
            }
            slide::begin(state, i, time);
        }
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
