/*!
Rest: grains in contact come to rest under gravity after finitely many events, cost nothing then, and wake
when hit.

Bounces that lose a constant part of their speed are infinitely many in a finite time. A flat wall under a
single grain completes them in closed form (`resolve::come_to_rest`); between grains nothing does. So a speed
v, `contact.rest_speed`, is stated:

* *Slow and soon*: contacts that follow the last one of either body sooner than 10 v/g are elastic below v/8,
  and take no more than down to it, so that impacts cannot accumulate. For walls that holds for grains that
  have met another grain, not for one that is alone with them. What is then left without height, because it
  has been let go where it touches, parts at least as fast as it falls in v/128g.
* *Census*: every v/g the largest set of grains is looked for that are slower than v/2 and stand, each on
  those of the set, on grains at rest, on fixed bodies and on walls that do not move: its weight lies in the
  cone of the normals of contacts narrower than v²/4g, twice what a speed of v/2 can rise. As the set is the
  largest, arches are found, whose stones stand only together; as its lowest grain must stand on something
  else, nothing floats.
* *Jams*: grains driven into a place without any room would collide without end. Too many contacts at what is
  nearly one time are a jam: those who had them lose the velocity with which they press on each other and on
  what cannot give way, in one plastic impact on all their contacts together, and a census follows at once.
* The grains of the set are *held*: velocity zero, infinite mass, no entry in the calendar.
* An impact faster than v, or any of a moving wall or driven body, *wakes* a grain, and with it those that no
  longer stand.

What is neglected: whether the contacts of all grains together can balance their weights. A grain at rest
holds any load, as with friction, until an impact shakes it.
*/

mod contact;
mod jam;
mod standing;

pub(crate) use contact::{is_among_grains, is_one_of_many, parting, push_apart, strike, wake};
pub(crate) use standing::{SettlingScan, contacts_of_held, scan};

use glam::DVec3;

use crate::{
    model::System,
    particles::{World, supported},
    state::State,
};

/// When grains are put to rest.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Thresholds {
    /// Slower grains are put to rest, if they stand [length/time].
    pub speed: f64,
    /// Faster impacts wake [length/time].
    pub wake: f64,
    /// Surfaces closer than this are in contact \[length\].
    pub gap: f64,
    /// Slower impacts are elastic, …
    pub elastic: f64,
    /// … if they follow another contact within this [time].
    pub soon: f64,
    /// Bodies that gravity presses together part at least as fast as they fall towards each other in this
    /// time [time].
    pub hop: f64,
    /// Slower approaches are none, and end by the law [length/time].
    pub nothing: f64,
    /// Between two censuses [time].
    pub period: f64,
}

/// A grain stands if what its contacts leave of gravity is less than this part of it.
const SLOPE: f64 = 1e-3;
/// A flight from a wall back to it has been undisturbed if it took this part of the time it takes by its end.
const UNDISTURBED: f64 = 1.0 - 1e-9;
/// A census that is due waits until there have been this many events for each grain that is not at rest…
const EVENTS_PER_GRAIN: f64 = 0.0625;
/// … but not longer than this many periods.
const PATIENCE: u64 = 16;
/// Of more contacts than this, and this for each grain that is not at rest, …
const CROWD: u64 = 200;
const CROWD_PER_GRAIN: u64 = 4;
/// … within this part of a period, some are of grains that are jammed.
const MOMENT: f64 = 1e-3;
/// Room of what is jammed [gaps that pass for contacts].
const ROOM: f64 = 1e-6;

impl Thresholds {
    /// Those of a system; `None` where no grain is put to rest.
    pub fn of(system: &System) -> Option<Self> {
        let (v, g) = (system.contacts.rest_speed, system.domain.gravity.length());
        (v > 0.0 && g > 0.0).then(|| Self {
            wake: v,
            speed: v / 2.0,
            gap: v * v / (4.0 * g),
            elastic: v / 8.0,
            soon: 10.0 * v / g,
            hop: v / (128.0 * g),
            nothing: 1e-6 * v,
            period: v / g,
        })
    }
}

/// What is known of grains at rest beside the world.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Heap {
    /// When the next census is due \[ticks\].
    pub next: i64,
    /// Events until the last census, `u64::MAX` before the first, and periods since.
    pub events: u64,
    pub waited: u64,
    /// Contacts since a time \[ticks\] that is a small part of a period ago at most.
    pub crowd: u64,
    pub crowd_since: i64,
    /// Of every held grain the held grains and fixed bodies it is in contact with, in order; a function of
    /// where they are.
    pub near: Vec<Vec<u32>>,
}

impl Default for Heap {
    fn default() -> Self {
        Self { next: 0, events: u64::MAX, waited: 0, crowd: 0, crowd_since: i64::MIN, near: Vec::new() }
    }
}

impl Heap {
    /// Counts a contact at `time` \[ticks\]; whether grains are jammed: without any room they hop without
    /// end.
    #[inline]
    pub fn watch(&mut self, world: &World, time: i64) -> bool {
        let Some(thresholds) = &world.thresholds else { return false };
        self.crowd += 1;
        if (time.saturating_sub(self.crowd_since)) as f64 * world.clock.tick > thresholds.period * MOMENT {
            (self.crowd, self.crowd_since) = (0, time);
        }
        let is_jammed = self.crowd > CROWD + CROWD_PER_GRAIN * (world.movable - world.held) as u64;
        if is_jammed {
            self.crowd = 0;
        }
        is_jammed
    }

    /// Whether the census that is due has something to look at, with these events so far and grains not at
    /// rest.
    fn is_worth_it(&self, events: u64, free: usize) -> bool {
        let first = self.events == u64::MAX;
        let new = events.wrapping_sub(self.events);
        let enough = new as f64 >= EVENTS_PER_GRAIN * free as f64 || self.waited + 1 >= PATIENCE;
        first || (new > 0 && enough)
    }

    /// The census that was due, with these events so far, has been taken or put off.
    fn after_census(&mut self, events: u64, taken: bool) {
        (self.events, self.waited) = if taken { (events, 0) } else { (self.events, self.waited + 1) };
    }
}

/// Normals, towards particle i, of its contacts with these particles and with walls that do not move, all of
/// them where they are now.
fn normals(world: &World, gap: f64, i: u32, near: impl Iterator<Item = u32>) -> Vec<DVec3> {
    let (position, _) = world.state(i, world.now);
    let mut normals: Vec<DVec3> = near
        .map(|j| -world.nearest_image(world.state(j, world.now).0 - position).normalize_or_zero())
        .collect();
    let radius = world.body(i).radius;
    for (wall, plane) in world.walls.iter().enumerate() {
        if !plane.motion.is_moving()
            && world.wall_approach(wall as u32, radius, position, DVec3::ZERO, world.now).0 <= gap
        {
            normals.push(plane.normal);
        }
    }
    normals
}

/// Whether particle i stands on these particles and on walls that do not move.
fn stands(world: &World, thresholds: &Thresholds, i: u32, near: impl Iterator<Item = u32>) -> bool {
    let normals = normals(world, thresholds.gap, i, near);
    supported(world.gravity, &normals.iter().copied()).length() <= SLOPE * world.gravity.length()
}

/// Whether body i holds others without being at rest by a census: of infinite mass, and not moving.
fn is_fixed(world: &World, i: u32) -> bool {
    world.body(i).inverse_mass == 0.0 && world.particles[i as usize].velocity == DVec3::ZERO
}

/// Sphere–sphere and wall collisions so far.
fn events(state: &State) -> u64 {
    state.book.counters.collisions + state.book.counters.wall_collisions
}
