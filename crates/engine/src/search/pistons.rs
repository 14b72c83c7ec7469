//! Contacts with pistons, beside any scheduler for all other events.
//!
//! An impact changes the flight of a piston, and so its contacts with all particles. They are therefore not
//! events of the particles: each piston has its own contacts, in the order of their times. An event of a
//! particle replaces one of them, an impact on the piston all. Those up to a horizon are computed, a few
//! intervals between two impacts later; that others are not earlier takes neither a flight in space nor a
//! root. Contacts follow every other event of the same tick.

use std::collections::{BTreeMap, BTreeSet};

use glam::DVec3;
use haff_mechanics::time_to_plane;
use haff_neighbors::Geometry;

use crate::{
    laws::event::{AnyEvent, Impact, Pause, PhysicalEvent},
    model::{Piston, features::Features, wall_law::WallLaw},
    numerics::clock::{EPOCH, whole},
    search::{
        batch::Kernel,
        carried,
        earliest::Earliest,
        entry::Entry,
        event_loop::{Limit, Next, Scheduler},
        planes,
        search_event::SearchEvent,
    },
    state::{
        State,
        particle::{ClassData, Particle},
        world::World,
    },
};

/// Rounding of a distance from a piston is less than this part of the extent of the system.
const SLACK: f64 = 1e-9;
/// Longest time from a prediction of all contacts to their horizon [ticks]: in it a particle crosses the
/// system.
const LONGEST: i64 = EPOCH / 64;
/// No contact at any time [ticks].
const NEVER: i64 = i64::MAX;
/// A contact later than this is predicted again in a later epoch of the clock [ticks].
const LATER: i64 = i64::MAX - 1;

/// When a particle touches a piston.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Contact {
    /// [ticks]
    time: i64,
    /// The particle; none at the horizon.
    i: Option<u32>,
    /// It touches the piston by then, or is predicted again.
    touches: bool,
}

/// The contacts of a piston up to a horizon.
#[derive(Debug)]
struct Contacts {
    wall: u32,
    /// In the order of their times, and by particle.
    ordered: BTreeSet<Contact>,
    of: BTreeMap<u32, Contact>,
    /// When they were all predicted, and until when they are known; always, if that is never \[ticks\].
    made: i64,
    horizon: i64,
}

impl Contacts {
    fn new(wall: u32) -> Self {
        Self { wall, ordered: BTreeSet::new(), of: BTreeMap::new(), made: 0, horizon: NEVER }
    }

    /// The earliest one, or the horizon.
    fn first(&self) -> Contact {
        let end = Contact { time: self.horizon, i: None, touches: false };
        self.ordered.first().map_or(end, |&contact| contact.min(end))
    }

    /// Replaces the contact of a particle.
    fn replace(&mut self, i: u32, contact: Option<Contact>) {
        let old = match contact {
            Some(contact) => self.of.insert(i, contact),
            None => self.of.remove(&i),
        };
        if let Some(old) = old {
            self.ordered.remove(&old);
        }
        self.ordered.extend(contact);
    }

    /// Predicts the contacts of all particles within a time from now on [ticks].
    fn predict_all<F: Features>(&mut self, world: &World, window: i64) {
        (self.made, self.horizon) = (world.now, world.now.saturating_add(window));
        self.ordered.clear();
        self.of.clear();
        if let Some(target) = Target::of(world, self) {
            for i in 0..world.particles.len() as u32 {
                if let Some(contact) = target.contact::<F>(world, i) {
                    self.replace(i, Some(contact));
                }
            }
        }
    }

    /// Predicts the contacts of all particles up to another horizon: twice as far as the last one was needed,
    /// but not less than half as far as it was. No trajectory depends on it.
    fn go_on<F: Features>(&mut self, world: &World) {
        let (needed, last) = (world.now - self.made, self.horizon.saturating_sub(self.made));
        self.predict_all::<F>(world, needed.saturating_mul(2).max(last / 2).clamp(1, LONGEST));
    }

    /// Predicts the contacts of some particles.
    fn predict<F: Features>(&mut self, world: &World, bodies: &[u32]) {
        if let Some(target) = Target::of(world, self) {
            for &i in bodies {
                self.replace(i, target.contact::<F>(world, i));
            }
        }
    }
}

/// What contacts with a piston have in common.
struct Target<'a> {
    wall: u32,
    piston: &'a Piston,
    point: DVec3,
    normal: DVec3,
    /// Whether particles are on both sides.
    is_two_sided: bool,
    /// Start of its flight or of the epoch, to the tick, and displacement and speed there.
    start: i64,
    at_start: (f64, f64),
    /// Contacts later than this are not wanted \[ticks\]; the same from its start on, somewhat longer
    /// \[time\].
    horizon: i64,
    wanted: f64,
    /// Distances are rounded by less \[length\].
    slack: f64,
}

impl<'a> Target<'a> {
    fn of(world: &'a World, contacts: &Contacts) -> Option<Self> {
        let wall = &world.boundary.walls[contacts.wall as usize];
        let piston = world.piston(contacts.wall)?;
        // Not before this epoch of the clock, in which all contacts are predicted anew. It is up to a tick
        // from the start of the flight: both flights go on through it.
        let since = piston.since.since(world.clock.instant(0)).max(0.0);
        let start = whole(since * world.clock.per_time);
        Some(Self {
            wall: contacts.wall,
            piston,
            point: wall.point,
            normal: wall.normal,
            is_two_sided: wall.shape.is_some(),
            start,
            at_start: piston.at(world.clock.instant(start)),
            horizon: contacts.horizon,
            // Also for anchors that are later: their way to the horizon is shorter.
            wanted: planes::searched(
                contacts.horizon.saturating_sub(start) as f64 * world.clock.tick,
                world.clock.tick,
            ),
            slack: SLACK * world.resolution.extent.max(wall.point.abs().max_element()),
        })
    }

    /// The next contact of particle i, a function of the anchors of both; perhaps none, if it is later than
    /// the horizon.
    #[inline]
    fn contact<F: Features>(&self, world: &World, i: u32) -> Option<Contact> {
        let particle = &world.particles[i as usize];
        let class = world.class(i);
        if !particle.rests() && self.is_later(world, particle, class) {
            return None;
        }
        self.exact_contact::<F>(world, i, class)
    }

    /// Whether a particle on its way that is not at rest certainly touches the piston later than the horizon.
    #[inline]
    fn is_later(&self, world: &World, particle: &Particle, class: &ClassData) -> bool {
        if self.horizon == NEVER {
            return false;
        }
        let gravity = if class.inverse_mass == 0.0 { 0.0 } else { world.gravity.dot(self.normal) };
        let age = (self.start - particle.time) as f64 * world.clock.tick;
        let speed = particle.velocity.dot(self.normal);
        let height = (particle.position - self.point).dot(self.normal) - self.at_start.0
            + (speed + 0.5 * gravity * age) * age;
        let (rate, acceleration) =
            (speed + gravity * age - self.at_start.1, gravity - self.piston.acceleration);
        let side = if self.is_two_sided { 1.0_f64.copysign(height) } else { 1.0 };
        let approach = (-side * rate).max(0.0) + 0.5 * (-side * acceleration).max(0.0) * self.wanted;
        side * height - class.radius > approach * self.wanted + self.slack
    }

    fn exact_contact<F: Features>(&self, world: &World, i: u32, class: &ClassData) -> Option<Contact> {
        let &Self { wall, piston, point, normal, is_two_sided, start, at_start, .. } = self;
        if world.laws.has_passages && world.wall_law(class, wall) == WallLaw::Passes {
            return None;
        }
        // From the later one of the anchors on.
        let anchor = world.particles[i as usize].time;
        let (start, (displacement, speed)) = if anchor <= start {
            (start, at_start)
        } else {
            (anchor, piston.at(world.clock.instant(anchor)))
        };
        if let Some(carrier) = world.carrier(i) {
            let mut earliest = Earliest { entry: Entry::none(i, 0), far: false };
            if carried::predict_wall::<F>(world, i, carrier, (wall, start), &mut earliest) {
                let Entry { time, target, .. } = earliest.entry;
                let touches = matches!(target.kind(), SearchEvent::Wall(_));
                return (time < NEVER).then_some(Contact { time, i: Some(i), touches });
            }
        }
        let (position, velocity) = world.flight::<F>(i, start);
        let height = (position - (point + normal * displacement)).dot(normal);
        let side = if is_two_sided { 1.0_f64.copysign(height) } else { 1.0 };
        let rate = side * (velocity - normal * speed).dot(normal);
        let acceleration = side * (world.acceleration(i).dot(normal) - piston.acceleration);
        let delay = time_to_plane(side * height - class.radius, rate, acceleration)?;
        Some(Contact { time: later(start, delay * world.clock.per_time), i: Some(i), touches: true })
    }
}

/// The tick that is `delay` [ticks] after `start`.
fn later(start: i64, delay: f64) -> i64 {
    if delay < LATER as f64 / 4.0 { start + whole(delay) } else { LATER }
}

/// A scheduler for all events but contacts with pistons, and these contacts.
pub(crate) struct WithPistons<S> {
    inner: S,
    pistons: Vec<Contacts>,
}

impl<S: Scheduler> WithPistons<S> {
    /// The contacts of these pistons, beside a scheduler.
    pub fn new(inner: S, pistons: impl Iterator<Item = usize>) -> Self {
        Self { inner, pistons: pistons.map(|wall| Contacts::new(wall as u32)).collect() }
    }

    fn rebuild_contacts(&mut self, world: &World) {
        self.pistons.iter_mut().for_each(|contacts| contacts.predict_all::<S::Features>(world, LONGEST));
    }

    fn predict(&mut self, world: &World, bodies: &[u32]) {
        self.pistons.iter_mut().for_each(|contacts| contacts.predict::<S::Features>(world, bodies));
    }
}

impl<S: Scheduler<Event = AnyEvent>> Scheduler for WithPistons<S> {
    const ALWAYS_ROWS: bool = S::ALWAYS_ROWS;

    type Features = S::Features;
    type Event = AnyEvent;

    fn kernel(&self) -> Kernel {
        self.inner.kernel()
    }

    fn rebuild(&mut self, state: &mut State, geometry: &Geometry) {
        self.inner.rebuild(state, geometry);
        self.rebuild_contacts(&state.world);
    }

    fn next<const VECTORS: bool>(&mut self, state: &mut State, limit: &mut Limit) -> Next<AnyEvent> {
        loop {
            let firsts = self.pistons.iter().zip(0..).map(|(contacts, k)| (contacts.first(), k));
            let (first, k) = firsts.min().unwrap_or((Contact { time: NEVER, i: None, touches: false }, 0));
            let due = first.time.max(state.world.now);
            let bound = limit.ticks;
            limit.ticks = bound.min(due);
            let next = self.inner.next::<VECTORS>(state, limit);
            limit.ticks = bound;
            if !matches!(next, Next::Nothing) || due > bound || first.time >= LATER {
                return next;
            }
            let contacts = &mut self.pistons[k];
            if let (Some(i), true) = (first.i, first.touches) {
                return Next::Event(due, AnyEvent::Impact(Impact::Wall { i, wall: contacts.wall }));
            }
            state.world.now = due;
            match first.i {
                Some(i) => contacts.predict::<S::Features>(&state.world, &[i]),
                // Nothing else can happen: whether there is a contact at any time.
                None if self.inner.is_idle() => contacts.predict_all::<S::Features>(&state.world, NEVER),
                None => contacts.go_on::<S::Features>(&state.world),
            }
            limit.entries -= 1;
            if limit.entries == 0 {
                return Next::Interrupted;
            }
        }
    }

    fn update<const VECTORS: bool>(
        &mut self,
        state: &mut State,
        event: AnyEvent,
        woken: &[u32],
        limit: &mut Limit,
    ) -> Option<Pause> {
        let ([i, j], wall) = event.participants();
        let Some(wall) = wall.filter(|&wall| state.world.is_piston(wall)) else {
            let pause = self.inner.update::<VECTORS>(state, event, woken, limit);
            // No grain wakes: none is put to rest beside a piston.
            let bodies = [i, j];
            self.predict(&state.world, &bodies[usize::from(i == j)..]);
            return pause;
        };
        // A body of infinite mass keeps its flight, and all other events that are predicted for it.
        if state.world.class(i).inverse_mass != 0.0 {
            self.inner.reschedule(state, &[i]);
        }
        for contacts in &mut self.pistons {
            if contacts.wall == wall {
                contacts.go_on::<S::Features>(&state.world);
            } else {
                contacts.predict::<S::Features>(&state.world, &[i]);
            }
        }
        None
    }

    fn reschedule(&mut self, state: &mut State, bodies: &[u32]) {
        self.inner.reschedule(state, bodies);
        self.predict(&state.world, bodies);
    }

    fn is_idle(&self) -> bool {
        self.inner.is_idle() && self.pistons.iter().all(|contacts| contacts.first().time == NEVER)
    }

    fn count_work(&mut self, state: &mut State) {
        self.inner.count_work(state);
    }
}

#[cfg(test)]
mod tests {
    use haff_testing::Random;

    use super::*;

    #[test]
    fn the_first_contact_is_the_earliest_one_or_the_horizon() {
        let mut random = Random(3);
        let mut contacts = Contacts::new(0);
        let mut expected: Vec<Option<Contact>> = vec![None; 13];
        for (step, horizon) in [NEVER, 2, NEVER].into_iter().cycle().enumerate().take(3000) {
            contacts.horizon = horizon;
            let i = step % expected.len();
            // Many at one time, and some never.
            let time = [Some(1), Some(2), Some(3), None][random.index(4)];
            expected[i] = time.map(|time| Contact { time, i: Some(i as u32), touches: true });
            contacts.replace(i as u32, expected[i]);
            let end = Contact { time: horizon, i: None, touches: false };
            let least = expected.iter().flatten().copied().min().map_or(end, |least| least.min(end));
            assert_eq!(contacts.first(), least, "step {step}");
            assert_eq!(contacts.of.len(), contacts.ordered.len());
        }
    }
}
