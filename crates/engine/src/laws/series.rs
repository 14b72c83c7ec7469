//! Series of bounces that end in a finite time, and the walls that support a grain after them.
//!
//! A grain whose next bounce would rise by less than 1e-13 of its radius has its infinite series of bounces
//! completed in closed form, or summed where e depends on the speed (`mechanics::bounces`;
//! `series::come_to_rest`): it is *supported* by the wall and has only the part of gravity along it, until
//! an impact takes it off. The losses are booked, and the `rest` row written, when the series ends. Where no
//! closed form exists, on curved surfaces and walls of constant velocity, slow bounces are elastic (`hop`).
//! For grains on grains a speed is stated, `contact.rest_speed`, and a settling scan (`rest`) regularly puts
//! to rest all grains that are slow and supported by each other, by walls or by fixed bodies: they are
//! *asleep*, of a class with infinite mass, until an impact wakes them. A scan uses grids of its own, so
//! that it does not depend on the search. Where rest is off, such a heap is reported as a collapse.

use glam::DVec3;
use haff_mechanics::{Impact, Restitution};

use crate::{
    laws::{
        bounces::{PLASTIC_END, REST_HEIGHT},
        carried, rough, slide,
    },
    numerics::clock::HORIZON,
    report::{EventKind, Observer, row},
    state::{
        Pending, State,
        particle::{Particle, Support},
    },
};

/// A velocity along the normal of a supporting wall below this fraction of the speed is rounding error.
const SUPPORT_NOISE: f64 = 8.0 * f64::EPSILON;

/// Completes the series of bounces of particle i on a wall, if the next bounce is low enough. Returns the
/// rest of the series, whose losses are added at its end.
///
/// Under the acceleration a towards the wall, flights with the outgoing speeds u, eu, e²u, … follow. Each
/// ends with an impact. The sums over the series are
///
/// * duration: 2u/a + 2eu/a + … = 2u/(a(1 − e)),
/// * impulses: (1 + e) m u/(1 − e),
/// * losses: the remaining energy ½ m u²,
/// * Carnot energies: ½ m u² (1 + e)/(1 − e).
///
/// If e depends on the speed, v₀ = u, v₁ = e(v₀) v₀, …, the same sums are 2 Σ vₖ/a, m (2 Σ vₖ − u), ½ m u²
/// and ½ m Σ (vₖ + vₖ₊₁)². If e tends to 1 so fast that the bounces never end, the next bounce is made the
/// last: no tick is short enough to resolve the later ones.
///
/// A particle that slides along other walls into this one leaves those walls at the bounce, falls back to
/// them, and so on. That series is completed once it is low enough for the acceleration along the slide.
/// `before` is the support and the acceleration before the bounce.
pub(crate) fn come_to_rest(
    state: &mut State,
    i: u32,
    wall: u32,
    law: Restitution,
    before: (Support, DVec3),
    time: i64,
) -> Option<Pending> {
    let world = &mut state.world;
    let normal = world.boundary.walls[wall as usize].normal;
    let (sliding_support, acceleration_before) = before;
    let (acceleration, sliding_acceleration) =
        (-world.acceleration(i).dot(normal), -acceleration_before.dot(normal));
    // An oscillating wall that carried it does not let it fall back in the same way.
    let was_carried =
        sliding_support[0].is_some_and(|wall| world.boundary.walls[usize::from(wall)].motion.carries());
    let sliding = sliding_support != [None; 3] && !was_carried && sliding_acceleration > 0.0;
    let acceleration = if sliding { sliding_acceleration } else { acceleration };
    let is_carried_along = world.carrier(i).is_none_or(|carrier| world.are_perpendicular(carrier, wall));
    if law.is_elastic() || acceleration <= 0.0 || !is_carried_along {
        return None;
    }
    let class = *world.class(i);
    let Particle { position, velocity, .. } = world.particles[i as usize];
    let u = velocity.dot(normal).max(0.0);
    let rises = u * u > 2.0 * acceleration * REST_HEIGHT * class.radius;
    if rises
        && !is_loss_below_rounding(
            &law,
            u,
            acceleration,
            velocity,
            position.abs().max_element() + class.radius,
        )
    {
        return None;
    }
    let mut support = if sliding { sliding_support } else { world.support(i) };
    let slot = support.iter_mut().find(|wall| wall.is_none())?;
    let bounces = law.bounces(u).unwrap_or(PLASTIC_END);
    let ticks = 2.0 * u * bounces.speeds / acceleration * world.clock.per_time;
    if ticks > HORIZON {
        return None;
    }
    *slot = Some(wall as u16);
    let normals = support.into_iter().flatten().map(|wall| world.boundary.walls[usize::from(wall)].normal);
    let remaining = tangential_velocity(velocity, normals);
    world.set_support(i, support, time);
    world.particles[i as usize].velocity = remaining;
    let lost = velocity - remaining;
    let energy = 0.5 * class.mass * lost.dot(velocity + remaining);
    let mut rest = Pending {
        end: time + crate::numerics::clock::whole(ticks),
        wall,
        speed: u,
        impulse: class.mass * u * (2.0 * bounces.speeds - 1.0),
        energy_loss: energy,
        carnot_energy: energy * bounces.squares,
        tangential: DVec3::ZERO,
        tangential_loss: 0.0,
    };
    if support[1].is_none() && state.world.spin.is_some() {
        rough::end_series(state, i, remaining, &mut rest);
    }
    // From now on the support balances gravity. Beyond that, the rest of the series only removes the velocity
    // towards the wall.
    state.accumulators.add_impulse(lost * -class.mass);
    state.world.add_support_impulse(support, lost * -class.mass);
    Some(rest)
}

/// Whether the energy loss of the next bounce, from the outgoing speed `u` under the `acceleration` towards
/// the wall, is at most the energy of half an ulp of the velocity and of coordinates up to `reach`.
///
/// With a law that tends to 1 at low speed the losses become smaller and smaller. Rounding would then
/// determine the height of further bounces, and they would never end.
fn is_loss_below_rounding(law: &Restitution, u: f64, acceleration: f64, velocity: DVec3, reach: f64) -> bool {
    // Of a law that draws its coefficient, or of another crate, the next loss is not known: all of the energy
    // counts.
    let e = if matches!(law, Restitution::Law(_)) { 0.0 } else { law.coefficient(u) };
    (1.0 - e) * (1.0 + e) * u * u <= f64::EPSILON * (acceleration * reach + u * velocity.abs().max_element())
}

/// The component of a velocity that is tangential to all walls with these normals.
fn tangential_velocity(velocity: DVec3, mut normals: impl Iterator<Item = DVec3>) -> DVec3 {
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

/// After an event of particle i: keeps its supporting walls ([`keep_supporting_walls`]), and begins the
/// friction on it.
pub(crate) fn keep_support(state: &mut State, i: u32, time: i64) {
    if state.world.particles[i as usize].rests() {
        keep_supporting_walls(state, i, time);
        slide::begin(state, i, time);
    }
}

/// Keeps only those supporting walls of particle i along which it now moves. The others no longer support it.
/// Sets the speed towards the kept walls, which is rounding error, to zero.
pub(crate) fn keep_supporting_walls(state: &mut State, i: u32, time: i64) {
    let world = &mut state.world;
    if !world.particles[i as usize].rests() {
        return;
    }
    let before = world.particles[i as usize].velocity;
    let mut velocity = before;
    let noise = SUPPORT_NOISE * velocity.length();
    let mut support: Support = [None; 3];
    let mut kept = 0;
    if let Some(wall) = world.carrier(i) {
        carried::check_carried(state, i, wall, noise, time);
        return;
    }
    for wall in world.support(i).into_iter().flatten() {
        let normal = world.boundary.walls[usize::from(wall)].normal;
        let speed = velocity.dot(normal);
        if speed.abs() <= noise {
            velocity -= normal * speed;
            support[kept] = Some(wall);
            kept += 1;
        }
    }
    world.particles[i as usize].velocity = velocity;
    world.set_support(i, support, time);
    let impulse = (velocity - before) * world.class(i).mass;
    world.add_support_impulse(support, impulse);
    state.accumulators.add_impulse(impulse);
}

/// Ends the completed series of bounces of particle i, and records its losses.
pub(crate) fn end_of_bounces<const EVENTS: bool>(
    state: &mut State,
    i: u32,
    time: i64,
    observer: &mut dyn Observer,
) {
    let Some(rest) = state.pending.remove(&i) else { return };
    let world = &state.world;
    let n = -world.boundary.walls[rest.wall as usize].normal;
    let now = world.clock.shown(time);
    state.accumulators.counters.rests += 1;
    state.accumulators.add_losses(now, rest.energy_loss, rest.carnot_energy);
    state.world.add_wall_heat(rest.wall, -rest.energy_loss);
    let world = &state.world;
    if EVENTS {
        let (position, _) = world.state(i, time);
        let impact = Impact {
            approach_speed: rest.speed,
            impulse: rest.impulse,
            energy_loss: rest.energy_loss,
            carnot_energy: rest.carnot_energy,
            ..Impact::default()
        };
        let contact_point = world.boundary.periodicity.wrap(position + n * world.class(i).radius).0;
        let mut row = row(now, EventKind::Rest, [i, rest.wall], &impact, n, contact_point);
        row.impulse_vector += rest.tangential;
        row.tangential_loss = rest.tangential_loss;
        observer.event(&row);
    }
}

/// Before another event of particle i: ends its completed series of bounces and its slide now, if there are
/// any.
#[inline]
pub(crate) fn end_of_bounces_early<const EVENTS: bool>(
    state: &mut State,
    i: u32,
    time: i64,
    observer: &mut dyn Observer,
) {
    if state.world.particles[i as usize].rests() {
        if state.pending.contains_key(&i) {
            end_of_bounces::<EVENTS>(state, i, time, observer);
        }
        if state.world.spin.is_some() {
            slide::interrupt::<EVENTS>(state, i, time, observer);
        }
    }
}
