//! Contacts with pistons, beside any scheduler for all other events.
//!
//! An impact changes the flight of a piston, and so its contacts with all particles. They are therefore not
//! events of the particles: each piston has the times of its contacts with all particles in a tournament
//! tree, with the earliest one at its root. An event of a particle replaces one time, an impact on the piston
//! all of them. Contacts follow every other event of the same tick.

use haff_mechanics::time_to_plane;
use haff_neighbors::Geometry;

use crate::{
    laws::event::{AnyEvent, Impact, Pause, PhysicalEvent},
    model::{features::Features, wall_law::WallLaw},
    numerics::clock::whole,
    search::{
        batch::Kernel,
        carried,
        earliest::Earliest,
        entry::Entry,
        event_loop::{Limit, Next, Scheduler},
        search_event::SearchEvent,
    },
    state::{State, world::World},
};

/// No contact at any time [ticks].
const NEVER: i64 = i64::MAX;
/// A contact later than this is predicted again in a later epoch of the clock [ticks].
const LATER: i64 = i64::MAX - 1;

/// When a particle touches a piston.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Contact {
    /// [ticks]
    time: i64,
    /// The particle.
    i: u32,
    /// It touches the piston by then, or is predicted again.
    touches: bool,
}

/// The contacts of a piston with all particles; the earliest one is found at once.
#[derive(Debug)]
struct Contacts {
    wall: u32,
    /// A tree whose node k has the earlier one of its nodes 2k and 2k + 1; the particles are its last level.
    tree: Vec<Contact>,
    /// Number of nodes of the last level, a power of two.
    width: usize,
}

impl Contacts {
    fn new(wall: u32) -> Self {
        Self { wall, tree: Vec::new(), width: 0 }
    }

    fn first(&self) -> Contact {
        self.tree.get(1).copied().unwrap_or(Contact { time: NEVER, i: 0, touches: false })
    }

    /// Predicts the contacts of all particles.
    fn rebuild<F: Features>(&mut self, world: &World) {
        let count = world.particles.len();
        // At least two, so that the root is no particle.
        self.width = count.next_power_of_two().max(2);
        self.tree.clear();
        self.tree.resize(2 * self.width, Contact { time: NEVER, i: u32::MAX, touches: false });
        for i in 0..count {
            self.tree[self.width + i] = contact::<F>(world, i as u32, self.wall);
        }
        for k in (1..self.width).rev() {
            self.tree[k] = self.tree[2 * k].min(self.tree[2 * k + 1]);
        }
    }

    /// Predicts the contact of particle i.
    fn predict<F: Features>(&mut self, world: &World, i: u32) {
        let mut k = self.width + i as usize;
        self.tree[k] = contact::<F>(world, i, self.wall);
        while k > 1 {
            k /= 2;
            let earlier = self.tree[2 * k].min(self.tree[2 * k + 1]);
            if self.tree[k] == earlier {
                break;
            }
            self.tree[k] = earlier;
        }
    }
}

/// The next contact of particle i with a piston: a function of the anchors of both.
fn contact<F: Features>(world: &World, i: u32, wall: u32) -> Contact {
    let never = Contact { time: NEVER, i, touches: false };
    let class = world.class(i);
    let Some(piston) = world.piston(wall) else { return never };
    if world.laws.has_passages && world.wall_law(class, wall) == WallLaw::Passes {
        return never;
    }
    // From the later one of the anchors on, of which none is older than some epochs.
    let anchor = world.particles[i as usize].time;
    let later = piston.since.since(world.clock.instant(anchor)).max(0.0) * world.clock.per_time;
    let start = anchor + whole(later);
    if F::GRAVITY
        && let Some(carrier) = world.carrier(i)
    {
        let entry = Entry::none(i, 0);
        let mut earliest = Earliest { entry, far: false };
        if carried::predict_wall::<F>(world, i, carrier, (wall, start), &mut earliest) {
            let touches = matches!(earliest.entry.target.kind(), SearchEvent::Wall(_));
            return Contact { time: earliest.entry.time, i, touches };
        }
    }
    let (position, velocity) = world.flight::<F>(i, start);
    let (distance, rate) = world.wall_approach(wall, class.radius, position, velocity, start);
    let towards = world.contact_normal(i, wall, (position, velocity), start);
    let acceleration = if F::GRAVITY { world.acceleration(i).dot(towards) } else { 0.0 };
    let of_piston = piston.acceleration * world.boundary.walls[wall as usize].normal.dot(towards);
    let Some(delay) = time_to_plane(distance, rate, acceleration - of_piston) else { return never };
    let delay = delay * world.clock.per_time;
    let time = if delay < LATER as f64 / 4.0 { start + whole(delay) } else { LATER };
    Contact { time, i, touches: true }
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

    fn predict_all(&mut self, world: &World) {
        for contacts in &mut self.pistons {
            contacts.rebuild::<S::Features>(world);
        }
    }

    fn predict(&mut self, world: &World, bodies: &[u32]) {
        for contacts in &mut self.pistons {
            for &i in bodies {
                contacts.predict::<S::Features>(world, i);
            }
        }
    }
}

impl<S: Scheduler<Event = AnyEvent>> Scheduler for WithPistons<S> {
    type Features = S::Features;
    type Event = AnyEvent;

    fn kernel(&self) -> Kernel {
        self.inner.kernel()
    }

    fn rebuild(&mut self, state: &mut State, geometry: &Geometry) {
        self.inner.rebuild(state, geometry);
        self.predict_all(&state.world);
    }

    fn next<const VECTORS: bool>(&mut self, state: &mut State, limit: &mut Limit) -> Next<AnyEvent> {
        loop {
            let firsts = self.pistons.iter().zip(0..).map(|(contacts, k)| (contacts.first(), k));
            let (first, k) = firsts.min().unwrap_or((Contact { time: NEVER, i: 0, touches: false }, 0));
            let due = first.time.max(state.world.now);
            let bound = limit.ticks;
            limit.ticks = bound.min(due);
            let next = self.inner.next::<VECTORS>(state, limit);
            limit.ticks = bound;
            if !matches!(next, Next::Nothing) || due > bound || first.time >= LATER {
                return next;
            }
            if first.touches {
                let wall = self.pistons[k].wall;
                return Next::Event(due, AnyEvent::Impact(Impact::Wall { i: first.i, wall }));
            }
            state.world.now = due;
            self.predict(&state.world, &[first.i]);
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
            self.predict(&state.world, &[i, j]);
            self.predict(&state.world, woken);
            return pause;
        };
        // A body of infinite mass keeps its flight, and all other events that are predicted for it.
        if state.world.class(i).inverse_mass != 0.0 {
            self.inner.reschedule(state, &[i]);
        }
        for contacts in &mut self.pistons {
            if contacts.wall == wall {
                contacts.rebuild::<S::Features>(&state.world);
            } else {
                contacts.predict::<S::Features>(&state.world, i);
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
    use super::*;

    #[test]
    fn the_root_is_the_earliest_contact() {
        let width = 8;
        let never = Contact { time: NEVER, i: u32::MAX, touches: false };
        let mut contacts = Contacts { wall: 0, tree: vec![never; 2 * width], width };
        assert_eq!(contacts.first().time, NEVER);
        for (i, time) in [(0, 7), (1, 3), (2, 3), (3, 9), (4, 2)] {
            contacts.tree[width + i as usize] = Contact { time, i, touches: true };
        }
        for k in (1..width).rev() {
            contacts.tree[k] = contacts.tree[2 * k].min(contacts.tree[2 * k + 1]);
        }
        assert_eq!(contacts.first(), Contact { time: 2, i: 4, touches: true });
    }
}
