//! Predictions for grains that an oscillating wall carries.

use haff_mechanics::first_contact_bounded;
use haff_neighbors::{Crossing, Flight, Search, Shift};

use crate::{
    model::{features::Features, wall_motion::WallMotion},
    numerics::clock::{HORIZON, whole},
    search::{earliest::Earliest, entry::Target, search_event::SearchEvent},
    state::world::World,
};

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
        let motion =
            world.carrier(k).map_or(WallMotion::Fixed, |wall| world.boundary.walls[wall as usize].motion);
        (world.acceleration(k), motion.max_acceleration(), motion.period())
    };
    let ((a, of_a, period_a), (b, of_b, period_b)) = (carrier(i), carrier(j));
    let distance = |ticks: i64| {
        let ((ra, va), (rb, vb)) = (world.flight::<F>(i, ticks), world.flight::<F>(j, ticks));
        let (r, v) = (world.boundary.periodicity.image(rb - ra, shift), vb - va);
        let length = r.length();
        ((r.length_squared() - sigma * sigma) / (length + sigma), r.dot(v) / length)
    };
    let path =
        Path { from, bound: (b - a).length() + (of_a + of_b), scale: sigma, period: period_a.min(period_b) };
    let jump = |ticks: i64| {
        let of = |k: u32| {
            world.carrier(k).map_or(f64::INFINITY, |wall| {
                world.boundary.walls[wall as usize].motion.time_to_jump((&world.clock, ticks))
            })
        };
        of(i).min(of(j))
    };
    if let Some(time) = path.first_contact(world, earliest, distance, jump) {
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
    (wall, from): (u32, i64),
    earliest: &mut Earliest<SearchEvent>,
) -> bool {
    if world.are_perpendicular(carrier, wall) {
        return false;
    }
    let (carrying, plane) = (&world.boundary.walls[carrier as usize], &world.boundary.walls[wall as usize]);
    let cosine = carrying.normal.dot(plane.normal);
    let radius = world.class(i).radius;
    let distance = |ticks: i64| {
        let (position, velocity) = world.flight::<F>(i, ticks);
        world.wall_approach(wall, radius, position, velocity, ticks)
    };
    let bound = world.acceleration(i).dot(plane.normal).abs()
        + cosine.abs() * carrying.motion.max_acceleration()
        + plane.motion.max_acceleration();
    let path =
        Path { from, bound, scale: radius, period: carrying.motion.period().min(plane.motion.period()) };
    let jump = |ticks: i64| plane.motion.time_to_jump((&world.clock, ticks));
    if let Some(time) = path.first_contact(world, earliest, distance, jump) {
        earliest.offer(time, Target::new(SearchEvent::Wall(wall)), 0);
    }
    true
}

/// A path whose acceleration is bounded between jumps of the velocity.
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
    /// depend on the time of the prediction, and at each jump of the velocity, to which `time_to_jump` is the
    /// time from a tick \[time\].
    fn first_contact(
        &self,
        world: &World,
        earliest: &mut Earliest<SearchEvent>,
        distance: impl Fn(i64) -> (f64, f64),
        time_to_jump: impl Fn(i64) -> f64,
    ) -> Option<i64> {
        let per_time = world.clock.per_time;
        let period = whole((self.period * per_time).min(HORIZON)).max(1);
        let mut start = self.from + (world.now - self.from).max(0) / period * period;
        let again = start + 3 * period;
        let end = earliest.entry.time.min(again);
        // Also if that event is at the start itself: of simultaneous ones the lowest rank counts.
        let mut anew = start + period;
        while start <= end {
            let jump = start.saturating_add(whole((time_to_jump(start) * per_time).min(HORIZON)) + 1);
            let next = anew.min(jump);
            let [until, stop] = [next, end.min(next)].map(|to| (to - start + 1) as f64 * world.clock.tick);
            let at = |time: f64| distance(start + whole(time * per_time));
            let found = first_contact_bounded(at, self.bound, self.scale, until, stop);
            if let Some(delay) = found {
                return Some(start + whole(delay * per_time));
            }
            start = next;
            if start == anew {
                anew += period;
            }
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
    let plane = &world.boundary.walls[wall as usize];
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
