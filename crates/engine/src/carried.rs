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
use haff_mechanics::{Impact, Restitution, first_contact_bounded};
use haff_neighbors::{Crossing, Flight, Search, Shift};

use crate::{
    clock::{HORIZON, whole},
    entry::Target,
    error::EngineError,
    features::Features,
    flights,
    ledger::Term,
    measure::total,
    particles::{Particle, World},
    predict::Earliest,
    report::{EventKind, Observer},
    resolve,
    search_event::SearchEvent,
    series::{self, PLASTIC_END, REST_HEIGHT},
    state::{Pending, State},
    wall_motion::WallMotion,
};

/// A series of bounces is completed once the next bounce would rise by less than this multiple of the
/// rounding of a coordinate.
const RESOLVED: f64 = 64.0 * f64::EPSILON;
/// A released grain is faster than the wall by this fraction of the wall's largest speed, so that rounding
/// does not make an impact of the release.
const FASTER: f64 = 4.0 * f64::EPSILON;

impl World {
    /// The oscillating wall that carries particle i.
    #[inline]
    pub fn carrier(&self, i: u32) -> Option<u32> {
        if !self.carries || !self.particles[i as usize].rests() {
            return None;
        }
        let wall = self.support[i as usize][0]?;
        self.walls[usize::from(wall)].motion.carries().then_some(u32::from(wall))
    }

    /// Position and velocity at `ticks` of a particle that a wall carries, from its flight along the wall.
    pub fn carried(
        &self,
        i: u32,
        wall: u32,
        ticks: i64,
        (position, velocity): (DVec3, DVec3),
    ) -> (DVec3, DVec3) {
        let wall = &self.walls[wall as usize];
        let shift = |ticks: i64| wall.motion.displacement(wall.normal, (&self.clock, ticks));
        let since = self.particles[i as usize].time;
        (
            position + (shift(ticks) - shift(since)),
            velocity + wall.motion.velocity(wall.normal, (&self.clock, ticks)),
        )
    }

    /// Whether two walls are perpendicular, but for rounding: a grain that one of them moves along its normal
    /// keeps its distance from the other one.
    pub fn are_perpendicular(&self, a: u32, b: u32) -> bool {
        /// Cosine of walls that are perpendicular but for rounding.
        const PERPENDICULAR: f64 = 1e-15;
        self.walls[a as usize].normal.dot(self.walls[b as usize].normal).abs() <= PERPENDICULAR
    }

    /// The walls that support particle i besides the one that carries it, if there is one.
    fn support_besides_carrier(&self, i: u32) -> [Option<u16>; 2] {
        let [first, second, third] = self.support(i);
        match self.carrier(i) {
            Some(_) => [second, third],
            None => [first, second],
        }
    }

    /// Energy and momentum along the normal of a body of this mass that a wall carries, at its velocity along
    /// the normal.
    fn carried_energy(&self, wall: u32, mass: f64, speed: f64, ticks: i64) -> (f64, DVec3) {
        let wall = &self.walls[wall as usize];
        let height = wall.motion.displacement(wall.normal, (&self.clock, ticks)).dot(wall.normal);
        let weight = self.gravity.dot(wall.normal);
        (mass * (0.5 * speed * speed - weight * height), mass * speed * wall.normal)
    }

    /// Energy and momentum along the normals of all carried particles at the present.
    pub fn all_carried(&self) -> (f64, DVec3) {
        if !self.carries || self.resting == 0 {
            return (0.0, DVec3::ZERO);
        }
        let [energy, x, y, z] = total(self.particles.len(), |i| {
            let Some(wall) = self.carrier(i) else { return [0.0; 4] };
            let normal = self.walls[wall as usize].normal;
            let speed =
                self.walls[wall as usize].motion.velocity(normal, (&self.clock, self.now)).dot(normal);
            let (energy, momentum) = self.carried_energy(wall, self.class(i).mass, speed, self.now);
            [energy, momentum.x, momentum.y, momentum.z]
        });
        (energy, DVec3::new(x, y, z))
    }

    /// Time from the anchor of a carried particle until the wall is left \[ticks\].
    fn release(&self, i: u32, wall: u32) -> Option<f64> {
        let wall = &self.walls[wall as usize];
        let anchor = self.particles[i as usize].time;
        let delay = wall.motion.time_to_release(self.gravity.dot(wall.normal), (&self.clock, anchor))?;
        Some(delay * self.clock.per_time)
    }
}

/// Adds what a wall has given to particle i along its normal since it carries it, or takes the present values
/// off as it starts to (`sign` −1).
fn add_carried(state: &mut State, i: u32, wall: u32, speed: f64, time: i64, sign: f64) {
    let State { world, accumulators, .. } = state;
    let (energy, momentum) = world.carried_energy(wall, world.class(i).mass, speed, time);
    accumulators.add_energy(Term::WallWork, world.clock.time(time), sign * energy);
    accumulators.add_impulse(sign * momentum);
    world.add_wall_impulse(wall, sign * momentum);
}

/// After an event of particle i, which has set its anchor with its whole velocity: the wall still carries it
/// if it moves along the wall, but for a rounding error of `noise` [length/time].
pub(crate) fn keep_or_end(state: &mut State, i: u32, wall: u32, noise: f64, time: i64) {
    let world = &mut state.world;
    let plane = &world.walls[wall as usize];
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
        let normal = world.walls[usize::from(wall)].normal;
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
    if law.is_elastic() || world.thresholds.is_some() || !can_start(world, i, wall) {
        return None;
    }
    let (n, motion) = (world.walls[wall as usize].normal, world.walls[wall as usize].motion);
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
    let reach = particle.position.abs().max(world.walls[wall as usize].point.abs()).max_element() + radius;
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
    let now = world.clock.time(time);
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

/// Whether an oscillating wall can carry particle i: nothing else carries it, and at most two walls at rest
/// support it, perpendicular to this one.
pub(crate) fn can_start(world: &World, i: u32, wall: u32) -> bool {
    let [first, second, third] = world.support(i);
    let are_perpendicular =
        [first, second].into_iter().flatten().all(|other| world.are_perpendicular(wall, u32::from(other)));
    world.carrier(i).is_none() && third.is_none() && are_perpendicular
}

/// Particle i leaves the wall that carries it, which falls faster from now on.
pub(crate) fn release<const EVENTS: bool>(
    state: &mut State,
    i: u32,
    time: i64,
    observer: &mut dyn Observer,
) -> Result<(), EngineError> {
    series::end_of_bounces_early::<EVENTS>(state, i, time, observer);
    let world = &state.world;
    let Some(wall) = world.carrier(i) else { return Ok(()) };
    let plane = &world.walls[wall as usize];
    let n = plane.normal;
    let (position, velocity) = world.state(i, time);
    let speed = plane.motion.release_speed(n, (&world.clock, time)) + FASTER * plane.motion.max_speed();
    let velocity = velocity + n * (speed - velocity.dot(n));
    add_carried(state, i, wall, speed, time, 1.0);
    flights::end(state, i, time);
    let [first, second] = state.world.support_besides_carrier(i);
    state.world.set_support(i, [first, second, None], time);
    resolve::anchor(&mut state.world, i, position, velocity, time)?;
    state.world.note_contact(i, time);
    if EVENTS {
        let world = &state.world;
        observer.event(&resolve::row(
            world.clock.time(time),
            EventKind::Lift,
            [i, wall],
            &Impact::default(),
            -n,
            world.periodicity.wrap(position - n * world.class(i).radius).0,
        ));
    }
    Ok(())
}

/// Offers the time when particle i leaves the wall that carries it.
pub(crate) fn predict_release(world: &World, i: u32, wall: u32, earliest: &mut Earliest<SearchEvent>) {
    if let Some(delay) = world.release(i, wall) {
        earliest.offer_after(world.particles[i as usize].time, delay, SearchEvent::Release, 0);
    }
}

/// Offers the contact of two particles of which a wall carries one, or different walls carry both. `from` is
/// the later of their anchors \[ticks\].
pub(crate) fn predict_pair<F: Features>(
    world: &World,
    [i, j]: [u32; 2],
    shift: Shift,
    sigma: f64,
    from: i64,
    earliest: &mut Earliest<SearchEvent>,
) {
    let carrier = |k: u32| {
        let motion = world.carrier(k).map_or(WallMotion::Fixed, |wall| world.walls[wall as usize].motion);
        (world.acceleration(k), motion.max_acceleration(), motion.period())
    };
    let ((a, of_a, period_a), (b, of_b, period_b)) = (carrier(i), carrier(j));
    let distance = |ticks: i64| {
        let ((ra, va), (rb, vb)) = (world.flight::<F>(i, ticks), world.flight::<F>(j, ticks));
        let (r, v) = (world.periodicity.image(rb - ra, shift), vb - va);
        let length = r.length();
        ((r.length_squared() - sigma * sigma) / (length + sigma), r.dot(v) / length)
    };
    let path =
        Path { from, bound: (b - a).length() + (of_a + of_b), scale: sigma, period: period_a.min(period_b) };
    if let Some(time) = path.first_contact(world, earliest, distance) {
        let count = world.particles[j as usize].count;
        earliest.offer(time, Target::new(SearchEvent::Collision(j)), count);
    }
}

/// Offers the contact of a carried particle with another wall. Returns whether its motion along the normal of
/// its carrier matters for that.
pub(crate) fn predict_wall<F: Features>(
    world: &World,
    i: u32,
    carrier: u32,
    wall: u32,
    earliest: &mut Earliest<SearchEvent>,
) -> bool {
    if world.are_perpendicular(carrier, wall) {
        return false;
    }
    let (carrying, plane) = (&world.walls[carrier as usize], &world.walls[wall as usize]);
    let cosine = carrying.normal.dot(plane.normal);
    let radius = world.class(i).radius;
    let distance = |ticks: i64| {
        let (position, velocity) = world.flight::<F>(i, ticks);
        world.wall_approach(wall, radius, position, velocity, ticks)
    };
    let bound = world.acceleration(i).dot(plane.normal).abs()
        + cosine.abs() * carrying.motion.max_acceleration()
        + plane.motion.max_acceleration();
    let path = Path {
        from: world.particles[i as usize].time,
        bound,
        scale: radius,
        period: carrying.motion.period().min(plane.motion.period()),
    };
    if let Some(time) = path.first_contact(world, earliest, distance) {
        earliest.offer(time, Target::new(SearchEvent::Wall(wall)), 0);
    }
    true
}

/// A path of bounded acceleration.
struct Path {
    /// The later of the anchors \[ticks\].
    from: i64,
    /// Bound of the acceleration towards a contact [length/time²].
    bound: f64,
    /// Length that tolerances are relative to.
    scale: f64,
    /// Of the wall \[time\].
    period: f64,
}

impl Path {
    /// The first time \[ticks\] at which a distance falls to zero. It is searched for until the earliest
    /// event found so far, and for two periods at most, after which the particle is predicted again.
    ///
    /// The search starts anew at each multiple of the period after the anchors, so that its bits do not
    /// depend on the time of the prediction.
    fn first_contact(
        &self,
        world: &World,
        earliest: &mut Earliest<SearchEvent>,
        distance: impl Fn(i64) -> (f64, f64),
    ) -> Option<i64> {
        let per_time = world.clock.per_time;
        let period = whole((self.period * per_time).min(HORIZON)).max(1);
        let mut start = self.from + (world.now - self.from).max(0) / period * period;
        let again = start + 3 * period;
        let end = earliest.entry.time.min(again);
        // Also if that event is at the start itself: of simultaneous ones the lowest rank counts.
        while start <= end {
            let until = (end - start).min(period) + 1;
            let at = |time: f64| distance(start + whole(time * per_time));
            let found = first_contact_bounded(at, self.bound, self.scale, until as f64 * world.clock.tick);
            if let Some(delay) = found {
                return Some(start + whole(delay * per_time));
            }
            start += period;
        }
        if end == again {
            earliest.offer(again, Target::NONE, 0);
        }
        None
    }
}

/// The crossing of a carried particle into another cell, or out of its list, within a time.
///
/// The search knows flights of constant acceleration. Along the normal the acceleration of the wall has a
/// bound, so the earlier crossing of both signs of that bound is a time until which the particle stays; it is
/// repeated from there until the crossing is found.
pub(crate) fn next_crossing<F: Features, S: Search>(
    world: &World,
    search: &S,
    i: u32,
    wall: u32,
    within: f64,
) -> Option<Crossing> {
    let plane = &world.walls[wall as usize];
    let (along, bound) = (world.acceleration(i), plane.normal * plane.motion.max_acceleration());
    // In this time the bound moves the particle by no more than rounding.
    let strongest = plane.motion.max_acceleration();
    let least = if strongest > 0.0 { (2e-14 * world.class(i).radius / strongest).sqrt() } else { 0.0 };
    let (mut elapsed, mut at_face) = (0.0, false);
    loop {
        let ticks = world.now + whole(elapsed * world.clock.per_time);
        let (position, velocity) = world.flight::<F>(i, ticks);
        let [with, against] = [along + bound, along - bound].map(|acceleration| {
            search.next_crossing(
                i,
                &Flight { position, velocity, acceleration, now: world.now },
                within - elapsed,
            )
        });
        // A crossing that does not depend on the acceleration of the wall is exact.
        if let (Some(a), Some(b)) = (&with, &against)
            && a.delay == b.delay
        {
            return Some(Crossing { delay: elapsed + a.delay, ..*a });
        }
        let crossing = with.into_iter().chain(against).min_by(|a, b| a.delay.total_cmp(&b.delay))?;
        // A particle at a face may turn back: it crosses if it is still there a little later.
        if at_face && crossing.delay <= least {
            return Some(Crossing { delay: elapsed, ..crossing });
        }
        at_face = crossing.delay <= least;
        elapsed += crossing.delay.max(least);
        if elapsed > within {
            return None;
        }
        if elapsed * world.clock.per_time > HORIZON {
            return Some(Crossing { delay: elapsed, ..crossing });
        }
    }
}
