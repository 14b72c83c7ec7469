/*!
The engine of time windows: no crossings, and memory is streamed.

Time is cut into windows. At the start of one, every particle is registered in the cells along its path
through it ([`cells`]), and pairs that may touch before its end are found cell by cell ([`filter`]) and
predicted from their anchors ([`exact`]). Contacts within the window, all of them, go to the agenda. Events
run in order; particles that have had one are registered along their new paths and predicted anew, up to the
window's end. A stale event needs no successor: whatever else its particles may meet is in the agenda already.

Particles stand in *slots*, sorted by cell every few windows, so that what is near in space is near in memory.
How long windows are and how wide cells is tuned on the way ([`tune`]).
*/

mod axes;
mod cells;
mod due;
mod exact;
mod filter;
mod opening;
#[cfg(test)]
mod random;
mod space;
mod tune;

use std::marker::PhantomData;

use glam::DVec3;
use haff_calendar::WindowQueue;
use haff_neighbors::{Geometry, prefetch, prefetch_at};

use crate::{
    batch::Kernel,
    census::{Census, Crowd},
    event::{Collision, Impact, Pause},
    event_loop::{Limit, Next, Scheduler},
    features::Features,
    model::{Boundary, System},
    particles::World,
    rest::thresholds::Thresholds,
    state::State,
};
use cells::{Cells, Near};
use due::{Contact, Due};
use filter::{Probe, Record, Scratch};
use space::Space;
use tune::{Tuner, Work};

/// Up to this many particles the caches hold all that events need: beyond that, particles are asked for so
/// many events ahead, and what their slots hold so many.
const CACHED: usize = 20_000;
const PARTICLES: usize = 20;
const SLOTS: usize = 14;
/// From this many particles on, cells around events, and records in them, come from memory: so many events
/// ahead, and so many less.
const LARGE: usize = 100_000;
const CELLS: usize = 9;
const TURNS: usize = 5;
/// Part of the box that the widest pair may come apart within a window, so that the nearest image is the one
/// that may touch.
const NEAREST: f64 = 0.45;
/// Part of the least contact distance that the rounding of coordinates may come to.
const MOST_ROUNDING: f64 = 0.02;
/// Windows are chosen from this many particles on, with at most so many walls, …
const MANY: usize = 100;
const FEW_WALLS: usize = 16;
/// … where no particle is faster than the mean by more than this factor, which would make windows short, …
const OUTLIER: f64 = 30.0;
/// … and where the nearest image allows ways of so many mean distances of particles, so that the fastest do
/// not make windows short.
const ROOM: f64 = 0.5;

/// A window ends early after so many searches for each particle, and so many more: each event adds a particle
/// to the cells along its new path, and a few particles that collide very often would fill theirs with copies
/// of themselves.
const SEARCHES_PER_PARTICLE: u64 = 4;
const SEARCHES: u64 = 1000;

/// The scheduler for one set of features.
pub(crate) struct Windows<F> {
    kernel: Kernel,
    geometry: Geometry,
    /// Least radius [length].
    least: f64,
    /// Acceleration of all [length/time²].
    gravity: DVec3,
    space: Space<F>,
    /// Slot of every particle.
    slot_of: Vec<u32>,
    agenda: WindowQueue<Due>,
    /// Contacts found by the batch phase.
    found: Vec<Due>,
    /// When the window began [ticks], and its length [time].
    begin: i64,
    step: f64,
    /// Mean distance of particles where they are [length].
    spacing: f64,
    /// Mean path in the window [spacings], and the width that the cells were made for.
    path: f64,
    width: f64,
    /// Displacement in the window beyond which the nearest image may be the wrong one, or the margin too
    /// small [length].
    farthest: f32,
    tuner: Tuner,
    /// Searches after which the present window ends early.
    last_search: u64,
    /// Windows since the copies were made, and how many there shall be.
    opened: u64,
    last_window: u64,
    /// The cells around the events to come, one after the other, and whose turn it is.
    around: [Near; TURNS],
    turn: usize,
    scratch: Scratch,
    /// Work up to when the copies were made, before the present window's.
    judged: Work,
    /// Work since then that opening windows has taken.
    opening: Work,
    /// Work that has been added to the counters of the state.
    counted: Work,
}

/// Why windows cannot simulate a system, or nothing.
pub(crate) fn unsuitable(system: &System, census: &Census) -> Option<String> {
    let axes = system.dimension.count();
    let largest = census.largest;
    let gravity = system.domain.gravity;
    if gravity != DVec3::ZERO && !census.movable {
        return Some("there are gravity and bodies of infinite mass, which do not fall".to_owned());
    }
    if Thresholds::of(system).is_some() {
        return Some("grains may come to rest on each other (contact.rest_speed)".to_owned());
    }
    for axis in 0..axes {
        match system.domain.boundary[axis] {
            Boundary::Open => return Some("an axis is open".to_owned()),
            Boundary::Periodic if NEAREST * system.domain.size[axis] < 2.5 * largest => {
                return Some(format!(
                    "a periodic edge of {} is shorter than 5.6 of the largest radius, {largest}",
                    system.domain.size[axis]
                ));
            }
            Boundary::Periodic | Boundary::Wall => {}
        }
        let periodic = system.domain.boundary[axis] == Boundary::Periodic;
        if axes::rounding(system.domain.size[axis], periodic, census.least) > MOST_ROUNDING {
            return Some(format!(
                "an edge of {} is too long for the least radius, {}",
                system.domain.size[axis], census.least
            ));
        }
    }
    None
}

/// Whether windows support a state of a system that is not [unsuitable]: under gravity all particles have to
/// fall.
pub(crate) fn supports(world: &World) -> bool {
    world.gravity == DVec3::ZERO || world.resting == 0
}

/// Whether windows are likely to be the fastest for a state that they support and that is not dense.
pub(crate) fn is_profitable(system: &System, census: &Census, crowd: &Crowd) -> bool {
    let room = ROOM * census.spacing(crowd.packing);
    let is_roomy = |axis: usize| {
        system.domain.boundary[axis] != Boundary::Periodic
            || 0.5 * NEAREST * system.domain.size[axis] - census.largest >= room
    };
    census.count >= MANY
        && system.walls.len() <= FEW_WALLS
        && crowd.is_even(OUTLIER)
        && (0..system.dimension.count()).all(is_roomy)
}

impl<F: Features> Windows<F> {
    pub fn new(geometry: &Geometry, kernel: Kernel, system: &System, census: &Census, crowd: &Crowd) -> Self {
        let count = census.count;
        let mut agenda = WindowQueue::default();
        if count > CACHED {
            agenda.keep_sorted(PARTICLES + 1);
        }
        Self {
            kernel,
            geometry: geometry.clone(),
            least: census.least,
            gravity: system.domain.gravity,
            space: Space {
                cells: Cells::default(),
                records: Vec::new(),
                lowest: Vec::new(),
                rows: Vec::new(),
                ids: Vec::new(),
                anchors: Vec::new(),
                end: 0,
                common_radius: 0.0,
                contacts: 0,
                features: PhantomData,
            },
            slot_of: vec![0; count],
            agenda,
            found: Vec::new(),
            begin: 0,
            step: 0.0,
            spacing: census.spacing(crowd.packing),
            path: 0.0,
            width: 0.0,
            farthest: 0.0,
            tuner: Tuner::new(crowd.packing, system.dimension.count(), count),
            last_search: 0,
            opened: 0,
            last_window: 0,
            around: [Near::default(); TURNS],
            turn: 0,
            scratch: Scratch::new(),
            judged: Work::default(),
            opening: Work::default(),
            counted: Work::default(),
        }
    }

    /// Takes the new flight of a particle, and enters what it will meet. False if it has become too fast for
    /// the window.
    #[inline(always)]
    fn renew<const K: usize, const VECTORS: bool>(&mut self, world: &World, bodies: [u32; K]) -> bool {
        let mut probes = [Probe::default(); K];
        for (probe, body) in probes.iter_mut().zip(bodies) {
            *probe = self.update(world, body);
        }
        let too_fast = probes.iter().any(|probe| self.is_too_fast(probe));
        if too_fast {
            return false;
        }
        let agenda = &mut self.agenda;
        let mut entries = 0;
        let push = |entry| {
            entries += 1;
            agenda.push(entry);
        };
        self.space.predict::<false, VECTORS>(world, &probes, &mut self.scratch, push);
        // Register after searching: a search that reads a line just written in parts stalls on store
        // forwarding. At their present positions the particles are registered already, because their old
        // paths ended there.
        for probe in &probes {
            self.register(probe);
        }
        self.scratch.work.entries += entries;
        true
    }

    /// Registers a particle along its new path.
    #[inline(always)]
    fn register(&mut self, probe: &Probe) {
        let Record { radius, v, .. } = probe.record;
        let extent = self.space.extent(radius);
        self.space.cells.register(probe.slot, probe.place, v, 1.0 - probe.from, extent);
    }

    /// Whether a particle is too fast for the window.
    #[inline(always)]
    #[expect(clippy::neg_cmp_op_on_partial_ord, reason = "not a number is too fast, too")]
    fn is_too_fast(&self, probe: &Probe) -> bool {
        let v = probe.record.v;
        !(v[0] * v[0] + v[1] * v[1] + v[2] * v[2] <= self.farthest * self.farthest)
    }

    /// Copies the new flight of particle i into its slot; how it is looked from now.
    #[inline(always)]
    fn update(&mut self, world: &World, i: u32) -> Probe {
        let particle = &world.particles[i as usize];
        let slot = self.slot_of[i as usize];
        let from = ((particle.time - self.begin) as f64 * (world.clock.tick / self.step)) as f32;
        let (mut position, mut velocity) = (particle.position, particle.velocity);
        if F::GRAVITY {
            // In the frame that has been falling since the window began all paths are straight.
            let fallen = (particle.time - self.begin) as f64 * world.clock.tick;
            position -= self.gravity * (0.5 * fallen * fallen);
            velocity -= self.gravity * fallen;
        }
        let (velocity, position) = (velocity.to_array(), position.to_array());
        let (mut v, mut place) = ([0.0; 3], [0; 3]);
        for axis in 0..3 {
            v[axis] = (velocity[axis] * self.step) as f32;
            place[axis] = self.space.cells.axes.coordinate(axis, position[axis]);
        }
        let back = self.space.cells.axes.way(v, from);
        self.space.anchors[slot as usize] = *particle;
        let record = &mut self.space.records[slot as usize];
        for axis in 0..3 {
            record.x[axis] = place[axis].wrapping_sub(back[axis]);
        }
        record.v = v;
        let record = *record;
        Probe { slot, record, place, from }
    }

    /// The bodies of the collision that is `ahead` events from now in the agenda, and its time [ticks].
    #[inline(always)]
    fn peek(&self, ahead: usize) -> Option<([u32; 2], i64)> {
        let Due(entry) = self.agenda.upcoming(ahead)?;
        Some(([entry.owner, entry.target.partner()?], entry.time))
    }

    /// Prefetches the particles of the next events, and their slots.
    #[inline(always)]
    fn prefetch_events(&self, world: &World) {
        if let Some((bodies, _)) = self.peek(PARTICLES) {
            for body in bodies {
                prefetch_at(&world.particles, body as usize);
                prefetch_at(&self.slot_of, body as usize);
            }
        }
        if let Some((bodies, _)) = self.peek(SLOTS) {
            for body in bodies {
                let slot = self.slot_of[body as usize] as usize;
                prefetch_at(&self.space.records, slot);
                prefetch_at(&self.space.anchors, slot);
            }
        }
    }

    /// Prefetches what the searches after the next events will read: the cells around them, later the records
    /// of the particles in these.
    #[inline(always)]
    fn prefetch_cells(&mut self, world: &World) {
        let Space { cells, records, .. } = &self.space;
        let turn = self.turn;
        self.turn = (turn + 1) % TURNS;
        if let Some(([body, _], time)) = self.peek(CELLS) {
            let record = &records[self.slot_of[body as usize] as usize];
            let part = ((time - self.begin) as f64 * (world.clock.tick / self.step)) as f32;
            let block = cells.around(record.x, record.v, part);
            cells.visit(&block, prefetch);
            self.around[turn] = block;
        }
        // Those of the event that was so far ahead `TURNS` events ago; others may have come between, which
        // does no harm.
        cells.visit(&self.around[self.turn], |cell| {
            for slot in cell.first() {
                prefetch_at(records, slot as usize);
            }
        });
    }

    /// Entries that opening a window counts as: it takes time, and the caller watches for signals.
    fn entries_of_opening(&self) -> u64 {
        1 + self.space.records.len() as u64 / 16
    }

    /// Whether so many events have been in the window that it shall end early.
    ///
    /// Tested where an event is dropped and after those of one particle: a few that collide very often have
    /// many of these, and the others cost nothing by it.
    #[inline(always)]
    fn is_crowded(&self) -> bool {
        self.scratch.work.searches > self.last_search
    }

    /// Ends the window, and opens another at the present.
    #[cold]
    fn reopen(&mut self, world: &World, limit: &mut Limit) {
        limit.entries = limit.entries.saturating_sub(self.entries_of_opening());
        self.start_afresh(world);
        self.open(world);
    }
}

impl<F: Features> Scheduler for Windows<F> {
    type Features = F;
    type Event = Impact;

    fn kernel(&self) -> Kernel {
        self.kernel
    }

    fn rebuild(&mut self, state: &mut State, _geometry: &Geometry) {
        self.start_afresh(&state.world);
        self.open(&state.world);
    }

    #[inline(always)]
    fn next<const VECTORS: bool>(&mut self, state: &mut State, limit: &mut Limit) -> Next<Impact> {
        loop {
            let Some(Due(entry)) = self.agenda.pop_until(limit.ticks.min(self.space.end)) else {
                if limit.ticks <= self.space.end {
                    return Next::Nothing;
                }
                limit.entries = limit.entries.saturating_sub(self.entries_of_opening());
                self.next_window(state);
                if limit.entries == 0 {
                    return Next::Interrupted;
                }
                continue;
            };
            if self.space.records.len() > CACHED {
                self.prefetch_events(&state.world);
            }
            if self.space.records.len() > LARGE {
                self.prefetch_cells(&state.world);
            }
            let world = &state.world;
            let i = entry.owner;
            let (is_valid, event) = match entry.target.kind() {
                Contact::Collision(j) => (
                    world.particles[j as usize].count == entry.partner_count,
                    Impact::Pair(Collision([i, j])),
                ),
                Contact::Wall(wall) => (true, Impact::Wall { i, wall }),
            };
            if is_valid && world.particles[i as usize].count == entry.own_count {
                return Next::Event(entry.time, event);
            }
            state.book.counters.dropped += 1;
            if self.is_crowded() {
                self.reopen(&state.world, limit);
                if limit.entries == 0 {
                    return Next::Interrupted;
                }
            }
        }
    }

    #[inline(always)]
    fn update<const VECTORS: bool>(
        &mut self,
        state: &mut State,
        event: Impact,
        _woken: &[u32],
        limit: &mut Limit,
    ) -> Option<Pause> {
        let one = match event {
            Impact::Pair(Collision([i, j])) => {
                state.world.wrap_anchor(i);
                state.world.wrap_anchor(j);
                let world = &state.world;
                // A body of infinite mass has not changed: its entries in the agenda are valid.
                let movable = |body: u32| F::UNIFORM || world.class(body).inverse_mass != 0.0;
                match (movable(i), movable(j)) {
                    (true, true) => {
                        if !self.renew::<2, VECTORS>(world, [i.min(j), i.max(j)]) {
                            self.reopen(world, limit);
                        }
                        return None;
                    }
                    (true, false) => i,
                    (false, _) => j,
                }
            }
            Impact::Wall { i, .. } => {
                state.world.wrap_anchor(i);
                if F::GRAVITY && !supports(&state.world) {
                    return Some(Pause::Unsupported);
                }
                i
            }
        };
        if !self.renew::<1, VECTORS>(&state.world, [one]) || self.is_crowded() {
            self.reopen(&state.world, limit);
        }
        None
    }

    fn reschedule(&mut self, state: &mut State, bodies: &[u32]) {
        for &body in bodies {
            state.world.wrap_anchor(body);
        }
        // Each renewed particle is registered once more, so that for many a new window costs less.
        let few = bodies.len() as u64 <= SEARCHES;
        let renewed = few && bodies.iter().all(|&body| self.renew::<1, false>(&state.world, [body]));
        if !renewed || self.is_crowded() {
            self.start_afresh(&state.world);
            self.open(&state.world);
        }
    }

    fn is_idle(&self) -> bool {
        // In a closed box there is always a next contact, unless nothing moves, which is tested elsewhere.
        false
    }

    fn count_work(&mut self, state: &mut State) {
        let work = self.scratch.work.since(&self.counted);
        self.counted = self.scratch.work;
        let counters = &mut state.book.counters;
        counters.predictions += work.exact;
        counters.candidates += work.candidates;
        counters.windows += work.windows;
    }
}
