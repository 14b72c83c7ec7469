//! Events happen: velocities change, anchors are set, losses are booked.

use glam::DVec3;
use haff_mechanics::{Bounces, Impact, Restitution, resolve_contact, work_of_moving_body};

use crate::{
    accumulators::Accumulators,
    clock::HORIZON,
    error::EngineError,
    features::Features,
    ledger::Term,
    overlap::allowed_overlap,
    pair_law::{self, PairContact, coefficient, impact_with_separation},
    particles::{Particle, Support, World},
    random::{Draw, mix},
    report::{EventKind, EventRecord, Observer},
    rest::contact,
    state::{Pending, State},
    wall_law::WallLaw,
};

/// A series of bounces is completed in closed form once the next one would rise by less than this part of the
/// radius: far below what a coordinate resolves at the size of a system, and far above what rounding does to
/// a bounce.
const REST_HEIGHT: f64 = 1e-13;
/// A series that ends with a plastic impact.
const LAST: Bounces = Bounces { speeds: 1.0, squares: 1.0 };
/// A velocity along the normal of a supporting wall below this part of the speed is rounding, not motion.
const SUPPORT_NOISE: f64 = 8.0 * f64::EPSILON;

/// A grain that has sunk into a wall or a body that cannot give way, by more than this part of its
/// coordinates, is put back.
const PENETRATION: f64 = 2.0 * f64::EPSILON;

/// How far a grain has to be put back that is `depth` deep in what it bounces on: not at all, unless that is
/// more than coordinates of this size resolve.
///
/// A bounce under gravity returns to the level that it has set out from, and like bounces are rounded the
/// same way each time: a million of them would be a million roundings deep. What sinking has taken of the
/// potential energy, this gives back. In a wedge there are as many without gravity, and ever shorter ones.
#[inline(always)]
fn excess_penetration(depth: f64, coordinates: DVec3, reach: f64) -> f64 {
    if depth > PENETRATION * (coordinates.max_element() + reach) { depth } else { 0.0 }
}

/// Position and velocity of particle i in its own event at `time`, from which it sets out anew.
#[inline(always)]
fn state_at_event<F: Features>(world: &World, i: u32, time: i64) -> (DVec3, DVec3) {
    if !F::GRAVITY {
        return world.flight::<F>(i, time);
    }
    let particle = &world.particles[i as usize];
    // A function of the particle and of the time: no search, no schedule and no resumed run rounds otherwise.
    let random = mix(time as u64 ^ u64::from(i).rotate_left(32) ^ u64::from(particle.count).rotate_right(16));
    haff_mechanics::free_flight_stochastic(
        particle.position,
        particle.velocity,
        world.acceleration(i),
        world.age(i, time),
        random,
    )
}

/// Stops where bodies are `depth` deep in each other, with the contact distance `sigma` and these
/// coordinates, and that is more than rounding.
#[cold]
fn check_depth(
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

/// Sets the anchor of particle i.
#[inline(always)]
fn anchor(world: &mut World, i: u32, position: DVec3, velocity: DVec3, time: i64) -> Result<(), EngineError> {
    world.particles[i as usize].set_anchor(position, velocity, time);
    if velocity.is_finite() {
        return Ok(());
    }
    Err(EngineError::Overflow { time: world.clock.time(time), i, velocity: velocity.to_array() })
}

/// Books what an impact at `now` takes. A hop of what rests on each other takes no energy but gives some.
#[inline(always)]
fn add_impact<F: Features>(accumulators: &mut Accumulators, now: f64, impact: &Impact) {
    if F::ELASTIC {
        accumulators.carnot.add(impact.carnot_energy);
        return;
    }
    let taken = if F::REST { impact.energy_loss.max(0.0) } else { impact.energy_loss };
    accumulators.add_losses(now, taken, impact.carnot_energy);
    if F::REST {
        accumulators.add_energy(Term::Rest, now, impact.energy_loss.min(0.0));
    }
}

/// Two particles collide at `time`.
#[inline(always)]
pub(crate) fn collision<F: Features, const EVENTS: bool>(
    state: &mut State,
    i: u32,
    j: u32,
    time: i64,
    observer: &mut dyn Observer,
) -> Result<(), EngineError> {
    // The lesser first, so that the bits do not depend on which of the two was predicted.
    let (i, j) = (i.min(j), i.max(j));
    if F::GRAVITY {
        end_of_bounces_early::<EVENTS>(state, i, time, observer);
        end_of_bounces_early::<EVENTS>(state, j, time, observer);
    }
    let world = &mut state.world;
    let (mut ri, wi) = state_at_event::<F>(world, i, time);
    let (mut rj, wj) = state_at_event::<F>(world, j, time);
    let r = world.periodicity.nearest(rj - ri);
    let distance = r.length();
    let n = r / distance;
    let (a, b) = (*world.class(i), *world.class(j));
    if (!F::UNIFORM || F::GRAVITY) && world.puts_back {
        let sigma = a.radius + b.radius;
        let depth = excess_penetration(sigma - distance, ri.abs().max(rj.abs()), sigma);
        if depth > 0.0 {
            let places = ri.abs().max(rj.abs()).max(world.coordinates(i)).max(world.coordinates(j));
            check_depth(world, depth, sigma, places, (i, Some(j)), time)?;
            // By halves, whatever the masses: a light grain that a heavy one presses against a wall cannot
            // move the heavy one by its share of their momentum, and would be pressed into the wall ever
            // deeper.
            let [back, on] = match (a.inverse_mass == 0.0, b.inverse_mass == 0.0) {
                // Where grains are put to rest, `resolve_jam` stops jams; putting back ended a heap of the tests
                // in a collapse.
                (false, false) if F::REST => [0.0; 2],
                (false, false) => [0.5 * depth; 2],
                (false, true) => [depth, 0.0],
                (true, _) => [0.0, depth],
            };
            ri -= n * back;
            rj += n * on;
        }
    }
    let contact = PairContact { bodies: [i, j], classes: [a, b], velocities: [wi, wj], r, distance, n, time };
    let (ui, uj, impact) = pair_law::resolve::<F>(world, &contact);
    // A body of infinite mass keeps its anchor: its flight has not changed, and neither have predictions with
    // it.
    if a.inverse_mass != 0.0 {
        anchor(world, i, ri, ui, time)?;
    }
    if b.inverse_mass != 0.0 {
        anchor(world, j, rj, uj, time)?;
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
    accumulators.add_collision(impact.impulse * distance);
    add_impact::<F>(accumulators, now, &impact);
    if !F::UNIFORM {
        // The impulse on i is −J n, on j +J n.
        if a.inverse_mass == 0.0 {
            accumulators.add_impulse(n * impact.impulse);
            accumulators.add_energy(Term::WallWork, now, work_of_moving_body(impact.impulse, -n, wi));
        } else if b.inverse_mass == 0.0 {
            accumulators.add_impulse(n * -impact.impulse);
            accumulators.add_energy(Term::WallWork, now, work_of_moving_body(impact.impulse, n, wj));
        }
    }
    if EVENTS {
        let contact = state.world.periodicity.wrap(ri + n * a.radius).0;
        observer.event(&row(now, EventKind::Collision, [i, j], &impact, n, contact));
    }
    Ok(())
}

/// Particle i meets a wall at `time`.
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
    let world = &mut state.world;
    let (mut position, velocity) = state_at_event::<F>(world, i, time);
    let class = *world.class(i);
    let (gap, _) = world.wall_approach(wall, class.radius, position, velocity, time);
    let depth = excess_penetration(-gap, position.abs(), class.radius);
    if depth > 0.0 {
        let places = position.abs().max(world.coordinates(i)).max(world.walls[wall as usize].point.abs());
        check_depth(world, depth, class.radius, places, (i, None), time)?;
    }
    if depth > 0.0 || world.is_level(wall) {
        position -= world.walls[wall as usize].normal * gap;
    }
    let plane = &world.walls[wall as usize];
    let (n, wall_velocity) = (-plane.normal, plane.motion.velocity());
    let contact = WallContact { i, wall, time, position, velocity, n, wall_velocity };
    match world.wall_law(&class, wall) {
        WallLaw::Restitution(law) => bounce::<F, EVENTS>(state, &contact, law, observer),
        WallLaw::Thermal(law) => {
            let draw = Draw::new(world.seed, i, u64::from(world.particles[i as usize].count));
            match law.velocity(draw, class.mass, n, world.dimension) {
                Some(relative) => {
                    reflect::<EVENTS>(state, &contact, wall_velocity + relative, Term::WallHeat, observer)
                }
                None => bounce::<F, EVENTS>(state, &contact, law.restitution, observer),
            }
        }
    }
}

/// A contact of a particle with a wall, before its impact.
struct WallContact {
    i: u32,
    wall: u32,
    /// [ticks]
    time: i64,
    position: DVec3,
    velocity: DVec3,
    /// Unit normal into the wall.
    n: DVec3,
    wall_velocity: DVec3,
}

/// A particle leaves a wall with a given velocity. What is not work of a moving wall is energy of `term`.
fn reflect<const EVENTS: bool>(
    state: &mut State,
    contact: &WallContact,
    velocity: DVec3,
    term: Term,
    observer: &mut dyn Observer,
) -> Result<(), EngineError> {
    let &WallContact { i, wall, time, position, n, wall_velocity, .. } = contact;
    let change = velocity - contact.velocity;
    let (before, after) = (contact.velocity - wall_velocity, velocity - wall_velocity);
    let class = *state.world.class(i);
    anchor(&mut state.world, i, position, velocity, time)?;
    let now = state.world.clock.time(time);
    let accumulators = &mut state.accumulators;
    accumulators.counters.wall_collisions += 1;
    accumulators.add_energy(term, now, 0.5 * class.mass * change.dot(before + after));
    if wall_velocity != DVec3::ZERO {
        accumulators.add_energy(Term::WallWork, now, class.mass * change.dot(wall_velocity));
    }
    accumulators.add_impulse(change * class.mass);
    if EVENTS {
        // Along the normal; energy of a term is no loss by restitution.
        let approach_speed = before.dot(n);
        let impulse = -class.mass * change.dot(n);
        let impact = Impact { approach_speed, impulse, ..Impact::default() };
        let place = state.world.periodicity.wrap(position + n * class.radius).0;
        observer.event(&row(now, EventKind::Wall, [i, wall], &impact, n, place));
    }
    keep_support(state, i, time);
    Ok(())
}

/// A particle meets a wall with a law of restitution.
#[inline(always)]
fn bounce<F: Features, const EVENTS: bool>(
    state: &mut State,
    &WallContact { i, wall, time, position, velocity, n, wall_velocity }: &WallContact,
    law: Restitution,
    observer: &mut dyn Observer,
) -> Result<(), EngineError> {
    let world = &mut state.world;
    let class = *world.class(i);
    let before = if F::GRAVITY { (world.support(i), world.acceleration(i)) } else { Default::default() };
    let speed = haff_mechanics::approach_speed(velocity, wall_velocity, n);
    let e = coefficient::<F>(world, law, speed, time, [(i, &class), (i, &class)]);
    let mut among_grains = false;
    // As for two spheres: a tilted normal is a unit vector only to rounding, and always off the same way.
    let (after, _, impact) = if F::REST {
        let acceleration = world.acceleration(i).dot(n);
        among_grains = contact::is_among_grains(world, i, wall, speed, acceleration, time);
        let separation = if among_grains {
            contact::separation_speed(world, e, speed, acceleration, true)
        } else {
            e * speed
        };
        impact_with_separation([velocity, wall_velocity], [class.inverse_mass, 0.0], n, e, speed, separation)
    } else {
        resolve_contact(velocity, wall_velocity, class.inverse_mass, 0.0, n, e)
    };
    anchor(world, i, position, after, time)?;
    if F::REST {
        world.particles[i as usize].set_recently_hit(among_grains);
    }

    let now = world.clock.time(time);
    let accumulators = &mut state.accumulators;
    accumulators.counters.wall_collisions += 1;
    add_impact::<F>(accumulators, now, &impact);
    accumulators.add_impulse(n * -impact.impulse);
    if wall_velocity != DVec3::ZERO {
        accumulators.add_energy(Term::WallWork, now, work_of_moving_body(impact.impulse, n, wall_velocity));
    }
    if EVENTS {
        let contact = world.periodicity.wrap(position + n * class.radius).0;
        observer.event(&row(now, EventKind::Wall, [i, wall], &impact, n, contact));
    }
    if F::GRAVITY {
        keep_support(state, i, time);
        if !among_grains
            && wall_velocity == DVec3::ZERO
            && state.world.wall_law(&class, wall).has_series()
            && let Some(rest) = come_to_rest(state, i, wall, law, before, time)
        {
            state.pending.insert(i, rest);
        }
    }
    Ok(())
}

/// Completes the series of bounces of particle i on a wall if it is over but for its tail, which is still to
/// be booked.
///
/// From the outgoing speed u under the acceleration a towards the wall, bounces follow at u, eu, e²u, … and take
/// 2u/a, 2eu/a, …: together 2u/(a(1 − e)). Their impulses add up to (1 + e) m u/(1 − e), their losses to all
/// that is left, ½ m u², and their Carnot energies to ½ m u² (1 + e)/(1 − e). Where e depends on the speed,
/// v₀ = u, v₁ = e(v₀) v₀, …, the sums are 2 Σ vₖ/a, m (2 Σ vₖ − u), ½ m u² and ½ m Σ (vₖ + vₖ₊₁)². Where e
/// tends to 1 so soon that bounces never end, the next one is the last: the tick of no clock could tell what
/// would follow.
///
/// A particle that slides along other walls into this one is thrown off those by the bounce, falls back on
/// them, and so on: that series is complete when it is over as seen along the slide. `before` is the support
/// and acceleration of the slide.
fn come_to_rest(
    state: &mut State,
    i: u32,
    wall: u32,
    law: Restitution,
    before: (Support, DVec3),
    time: i64,
) -> Option<Pending> {
    let world = &mut state.world;
    let normal = world.walls[wall as usize].normal;
    let (slid_on, slide) = before;
    let (acceleration, acceleration_of_slide) = (-world.acceleration(i).dot(normal), -slide.dot(normal));
    let sliding = slid_on != [None; 3] && acceleration_of_slide > 0.0;
    let acceleration = if sliding { acceleration_of_slide } else { acceleration };
    if law.is_elastic() || acceleration <= 0.0 {
        return None;
    }
    let class = *world.class(i);
    let Particle { position, velocity, .. } = world.particles[i as usize];
    let u = velocity.dot(normal).max(0.0);
    let rises = u * u > 2.0 * acceleration * REST_HEIGHT * class.radius;
    if rises
        && !is_rounding_of_bounces(
            &law,
            u,
            acceleration,
            velocity,
            position.abs().max_element() + class.radius,
        )
    {
        return None;
    }
    let mut support = if sliding { slid_on } else { world.support(i) };
    let free = support.iter_mut().find(|place| place.is_none())?;
    let bounces = law.bounces(u).unwrap_or(LAST);
    let ticks = 2.0 * u * bounces.speeds / acceleration * world.clock.per_time;
    if ticks > HORIZON {
        return None;
    }
    *free = Some(wall as u16);
    let normals = support.into_iter().flatten().map(|wall| world.walls[usize::from(wall)].normal);
    let settled = along(velocity, normals);
    world.set_support(i, support, time);
    world.particles[i as usize].velocity = settled;
    let lost = velocity - settled;
    let energy = 0.5 * class.mass * lost.dot(velocity + settled);
    let rest = Pending {
        end: time + crate::clock::whole(ticks),
        wall,
        speed: u,
        impulse: class.mass * u * (2.0 * bounces.speeds - 1.0),
        energy_loss: energy,
        carnot_energy: energy * bounces.squares,
    };
    // From here on the support balances gravity; what the tail does beyond that is to take the last of the
    // velocity.
    state.accumulators.add_impulse(lost * -class.mass);
    Some(rest)
}

/// Whether the next bounce, from the outgoing speed `u` under the `acceleration` towards the wall, takes no more
/// energy than half an ulp of the velocity and of coordinates up to `reach` are worth.
///
/// A law that tends to 1 at low speed takes ever less. Further bounces would then be as high as rounding
/// makes them, and never end.
fn is_rounding_of_bounces(law: &Restitution, u: f64, acceleration: f64, velocity: DVec3, reach: f64) -> bool {
    let e = law.coefficient(u);
    (1.0 - e) * (1.0 + e) * u * u <= f64::EPSILON * (acceleration * reach + u * velocity.abs().max_element())
}

/// The part of a velocity along walls with these normals.
fn along(velocity: DVec3, mut normals: impl Iterator<Item = DVec3>) -> DVec3 {
    match (normals.next(), normals.next(), normals.next()) {
        (Some(n), None, _) => velocity - n * velocity.dot(n),
        (Some(n), Some(m), None) => {
            let edge = n.cross(m);
            if edge == DVec3::ZERO {
                velocity - n * velocity.dot(n)
            } else {
                edge * (velocity.dot(edge) / edge.length_squared())
            }
        }
        (None, ..) => velocity,
        (Some(_), Some(_), Some(_)) => DVec3::ZERO,
    }
}

/// Lets go of the supporting walls that particle i now moves away from, or into: it flies again. Those that
/// keep it push back what rounding has left of its speed towards them.
pub(crate) fn keep_support(state: &mut State, i: u32, time: i64) {
    let world = &mut state.world;
    if !world.particles[i as usize].rests() {
        return;
    }
    let before = world.particles[i as usize].velocity;
    let mut velocity = before;
    let noise = SUPPORT_NOISE * velocity.length();
    let mut support: Support = [None; 3];
    let mut kept = 0;
    for wall in world.support(i).into_iter().flatten() {
        let normal = world.walls[usize::from(wall)].normal;
        let speed = velocity.dot(normal);
        if speed.abs() <= noise {
            velocity -= normal * speed;
            support[kept] = Some(wall);
            kept += 1;
        }
    }
    world.particles[i as usize].velocity = velocity;
    world.set_support(i, support, time);
    let mass = world.class(i).mass;
    state.accumulators.add_impulse((velocity - before) * mass);
}

/// The completed series of particle i has come to its end.
pub(crate) fn end_of_rest<const EVENTS: bool>(
    state: &mut State,
    i: u32,
    time: i64,
    observer: &mut dyn Observer,
) {
    let Some(rest) = state.pending.remove(&i) else { return };
    let world = &state.world;
    let n = -world.walls[rest.wall as usize].normal;
    let now = world.clock.time(time);
    state.accumulators.counters.rests += 1;
    state.accumulators.add_losses(now, rest.energy_loss, rest.carnot_energy);
    if EVENTS {
        let (position, _) = world.state(i, time);
        let impact = Impact {
            approach_speed: rest.speed,
            impulse: rest.impulse,
            energy_loss: rest.energy_loss,
            carnot_energy: rest.carnot_energy,
            ..Impact::default()
        };
        let contact = world.periodicity.wrap(position + n * world.class(i).radius).0;
        observer.event(&row(now, EventKind::Rest, [i, rest.wall], &impact, n, contact));
    }
}

/// Another event ends the tail of a series of bounces before its time: the tail is booked now.
#[inline]
pub(crate) fn end_of_bounces_early<const EVENTS: bool>(
    state: &mut State,
    i: u32,
    time: i64,
    observer: &mut dyn Observer,
) {
    if state.world.particles[i as usize].rests() && state.pending.contains_key(&i) {
        end_of_rest::<EVENTS>(state, i, time, observer);
    }
}

fn row(
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
    }
}
