/*!
Grains that an oscillating wall carries.

With e < 1 a grain bounces infinitely often on such a wall within a finite time. The series is completed as on
a wall at rest; then the wall carries the grain, which moves with it along its normal and freely along it,
until the wall falls faster than the grain would.

The anchor of a carried grain has its velocity along the wall only. Its energy and momentum along the normal,

 E = m (V²/2 − g·n s),   P = m V n,

follow from the velocity V and the shift s of the wall. What the wall has given since the grain is carried is
their change, so both are taken off the sums when the wall starts to carry the grain, and added when it is
left; samples in between add the present values of all carried grains.
*/

use glam::DVec3;
use haff_mechanics::{Impact, Restitution};

use crate::{
    laws::{
        bounces::{PLASTIC_END, REST_HEIGHT},
        contact,
    },
    motion::{carried::can_start, flights},
    numerics::{
        clock::{HORIZON, whole},
        error::EngineError,
    },
    report::{EventKind, Observer, ledger::Term, row},
    state::{Pending, State, particle::Particle},
};

/// A series of bounces is completed once the next bounce would rise by less than this multiple of the
/// rounding of a coordinate.
const RESOLVED: f64 = 64.0 * f64::EPSILON;
/// A released grain is faster than the wall by this fraction of the wall's largest speed, so that rounding
/// does not make an impact of the release.
const FASTER: f64 = 4.0 * f64::EPSILON;

/// Adds what a wall has given to particle i along its normal since it carries it, or takes the present values
/// off as it starts to (`sign` −1).
fn add_carried(state: &mut State, i: u32, wall: u32, speed: f64, time: i64, sign: f64) {
    let State { world, accumulators, .. } = state;
    let (energy, momentum) = world.carried_energy(wall, world.class(i).mass, speed, time);
    accumulators.add_energy(Term::WallWork, world.clock.shown(time), sign * energy);
    accumulators.add_impulse(sign * momentum);
    world.add_wall_impulse(wall, sign * momentum);
}

/// After an event of particle i, which has set its anchor with its whole velocity: the wall still carries it
/// if it moves along the wall, but for a rounding error of `noise` [length/time].
pub(crate) fn check_carried(state: &mut State, i: u32, wall: u32, noise: f64, time: i64) {
    let world = &mut state.world;
    let plane = &world.boundary.walls[wall as usize];
    let n = plane.normal;
    let speed = plane.motion.velocity(n, (&world.clock, time)).dot(n);
    let Particle { position, velocity, .. } = world.particles[i as usize];
    let relative = velocity.dot(n) - speed;
    let kept = keep_others(state, i, noise);
    let world = &mut state.world;
    if relative.abs() > noise {
        add_carried(state, i, wall, speed, time, 1.0);
        state.world.set_support(i, [kept[0], kept[1], None], time);
        return;
    }
    if kept != world.support_besides_carrier(i) {
        world.set_support(i, [Some(wall as u16), kept[0], kept[1]], time);
    }
    let (gap, _) = world.wall_approach(wall, world.class(i).radius, position, velocity, time);
    let particle = &mut world.particles[i as usize];
    particle.position -= n * gap;
    particle.velocity -= n * particle.velocity.dot(n);
    let mass = world.class(i).mass;
    world.add_wall_impulse(wall, n * (-mass * relative));
    state.accumulators.add_impulse(n * (-mass * relative));
}

/// Those of the walls that support particle i besides its carrier along which it still moves. Sets the speed
/// towards them, which is rounding error, to zero.
fn keep_others(state: &mut State, i: u32, noise: f64) -> [Option<u16>; 2] {
    let world = &mut state.world;
    let mut kept = [None; 2];
    let mut count = 0;
    for wall in world.support_besides_carrier(i).into_iter().flatten() {
        let normal = world.boundary.walls[usize::from(wall)].normal;
        let particle = &mut world.particles[i as usize];
        let speed = particle.velocity.dot(normal);
        if speed.abs() <= noise {
            particle.velocity -= normal * speed;
            let impulse = normal * (-speed * world.class(i).mass);
            world.add_wall_impulse(u32::from(wall), impulse);
            state.accumulators.add_impulse(impulse);
            kept[count] = Some(wall);
            count += 1;
        }
    }
    kept
}

/// Completes the series of bounces of particle i on an oscillating wall, if the next bounce is low enough and
/// the wall presses until the end of the series; then the wall carries it. Returns the rest of the series, as
/// on a wall at rest. Walls at rest that support it already must be perpendicular to this one.
pub(crate) fn start(state: &mut State, i: u32, wall: u32, law: Restitution, time: i64) -> Option<Pending> {
    let world = &mut state.world;
    if law.is_elastic() || world.laws.thresholds.is_some() || !can_start(world, i, wall) {
        return None;
    }
    let (n, motion) =
        (world.boundary.walls[wall as usize].normal, world.boundary.walls[wall as usize].motion);
    let mass = world.class(i).mass;
    let pressing = |ticks: i64| motion.acceleration((&world.clock, ticks)) - world.gravity.dot(n);
    let particle = world.particles[i as usize];
    let acceleration = pressing(time);
    if acceleration <= 0.0 {
        return None;
    }
    let speed = motion.velocity(n, (&world.clock, time)).dot(n);
    let u = (particle.velocity.dot(n) - speed).max(0.0);
    let radius = world.class(i).radius;
    let reach =
        particle.position.abs().max(world.boundary.walls[wall as usize].point.abs()).max_element() + radius;
    if u * u > 2.0 * acceleration * (REST_HEIGHT * radius).max(RESOLVED * reach) {
        return None;
    }
    let bounces = law.bounces(u).unwrap_or(PLASTIC_END);
    let ticks = 2.0 * u * bounces.speeds / acceleration * world.clock.per_time;
    if ticks > HORIZON || pressing(time + whole(ticks)) <= 0.0 {
        return None;
    }
    let (gap, _) = world.wall_approach(wall, radius, particle.position, particle.velocity, time);
    let [first, second] = world.support_besides_carrier(i);
    world.set_support(i, [Some(wall as u16), first, second], time);
    let particle = &mut world.particles[i as usize];
    particle.position -= n * gap;
    particle.velocity -= n * particle.velocity.dot(n);
    let energy = 0.5 * mass * u * u;
    let now = world.clock.shown(time);
    // The bounces end at the speed of the wall, whose work that is.
    state.accumulators.add_energy(Term::WallWork, now, -mass * u * speed);
    world.add_wall_impulse(wall, n * (-mass * u));
    state.accumulators.add_impulse(n * (-mass * u));
    add_carried(state, i, wall, speed, time, -1.0);
    Some(Pending {
        end: time + whole(ticks),
        wall,
        speed: u,
        impulse: mass * u * (2.0 * bounces.speeds - 1.0),
        energy_loss: energy,
        carnot_energy: energy * bounces.squares,
        tangential: DVec3::ZERO,
        tangential_loss: 0.0,
    })
}

/// Particle i leaves the wall that carries it, which falls faster from now on.
pub(crate) fn release<const EVENTS: bool>(
    state: &mut State,
    i: u32,
    time: i64,
    observer: &mut dyn Observer,
) -> Result<(), EngineError> {
    let world = &state.world;
    let Some(wall) = world.carrier(i) else { return Ok(()) };
    let plane = &world.boundary.walls[wall as usize];
    let n = plane.normal;
    let (position, velocity) = world.state(i, time);
    let speed = plane.motion.release_speed(n, (&world.clock, time)) + FASTER * plane.motion.max_speed();
    let velocity = velocity + n * (speed - velocity.dot(n));
    add_carried(state, i, wall, speed, time, 1.0);
    flights::end(state, i, time);
    let [first, second] = state.world.support_besides_carrier(i);
    state.world.set_support(i, [first, second, None], time);
    contact::anchor(&mut state.world, i, position, velocity, time)?;
    state.world.note_contact(i, time);
    if EVENTS {
        let world = &state.world;
        observer.event(&row(
            world.clock.shown(time),
            EventKind::Lift,
            [i, wall],
            &Impact::default(),
            -n,
            world.boundary.periodicity.wrap(position - n * world.class(i).radius).0,
        ));
    }
    Ok(())
}
