/*!
The engine of time windows: no crossings, and memory is streamed.

Time is cut into windows. At the start of one, every particle is registered in the cells along its path
through it ([`cells`]), and pairs that may touch before its end are found cell by cell ([`filter`]) and
predicted from their anchors ([`exact`]). Contacts within the window, all of them, go to the queue. Events
run in order; particles that have had one are registered along their new paths and predicted anew, up to the
window's end. A stale event needs no successor: whatever else its particles may meet is in the queue already.

Particles stand in *slots*, sorted by cell every few windows, so that what is near in space is near in memory.
How long windows are and how wide cells is tuned on the way ([`tune`]).
*/

mod axes;
mod cells;
mod filter;
mod narrow_phase;
mod opening;
#[cfg(test)]
mod random;
mod space;
mod tune;
mod window_event;

use std::marker::PhantomData;

use glam::DVec3;
use haff_calendar::WindowQueue;
use haff_neighbors::{Geometry, prefetch, prefetch_at};

use crate::{
    batch::Kernel,
    compact::{CompactParticle, NEAREST},
    event::{Collision, Impact, Pause},
    event_loop::{Limit, Next, Scheduler},
    features::Features,
    model::{Boundary, System},
    particles::World,
    rest::thresholds::Thresholds,
    state::State,
    summary::{LocalDensity, SystemSummary},
    tuning::particles,
};
use cells::{Cells, NearestCells};
use filter::{Query, Scratch};
use space::Space;
use tune::{Tuner, Work};
use window_event::{Contact, WindowEvent};

/// Events ahead for which particles are prefetched, and the contents of their slots.
const PARTICLES: usize = 20;
const SLOTS: usize = 14;
/// Events ahead for which cells are prefetched, and by how many fewer the compact particles in them.
const CELLS: usize = 9;
const TURNS: usize = 5;
/// Part of the least contact distance that the rounding of coordinates may come to.
const MOST_ROUNDING: f64 = 0.02;
/// Windows are chosen with at most so many walls, …
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
    queue: WindowQueue<WindowEvent>,
    /// Contacts found by the batch phase.
    found: Vec<WindowEvent>,
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
    around: [NearestCells; TURNS],
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
pub(crate) fn unsuitable(system: &System, summary: &SystemSummary) -> Option<String> {
    let axes = system.dimension.count();
    let largest = summary.largest;
    let gravity = system.domain.gravity;
    if gravity != DVec3::ZERO && !summary.movable {
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
        if axes::rounding(system.domain.size[axis], periodic, summary.least) > MOST_ROUNDING {
            return Some(format!(
                "an edge of {} is too long for the least radius, {}",
                system.domain.size[axis], summary.least
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
pub(crate) fn is_profitable(system: &System, summary: &SystemSummary, density: &LocalDensity) -> bool {
    let room = ROOM * summary.spacing(density.packing);
    let is_roomy = |axis: usize| {
        system.domain.boundary[axis] != Boundary::Periodic
            || 0.5 * NEAREST * system.domain.size[axis] - summary.largest >= room
    };
    summary.count >= particles::WINDOWS
        && system.walls.len() <= FEW_WALLS
        && density.is_even(OUTLIER)
        && (0..system.dimension.count()).all(is_roomy)
}

impl<F: Features> Windows<F> {
    pub fn new(
        geometry: &Geometry,
        kernel: Kernel,
        system: &System,
        summary: &SystemSummary,
        density: &LocalDensity,
    ) -> Self {
        let count = summary.count;
        let mut queue = WindowQueue::default();
        if count > particles::PREFETCH_WINDOWS {
            queue.keep_sorted(PARTICLES + 1);
        }
        Self {
            kernel,
            geometry: geometry.clone(),
            least: summary.least,
            gravity: system.domain.gravity,
            space: Space {
                cells: Cells::default(),
                particles: Vec::new(),
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
            queue,
            found: Vec::new(),
            begin: 0,
            step: 0.0,
            spacing: summary.spacing(density.packing),
            path: 0.0,
            width: 0.0,
            farthest: 0.0,
            tuner: Tuner::new(density.packing, system.dimension.count(), count),
            last_search: 0,
            opened: 0,
            last_window: 0,
            around: [NearestCells::default(); TURNS],
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
        let mut queries = [Query::default(); K];
        for (query, body) in queries.iter_mut().zip(bodies) {
            *query = self.update(world, body);
        }
        let too_fast = queries.iter().any(|query| self.is_too_fast(query));
        if too_fast {
            return false;
        }
        let queue = &mut self.queue;
        let mut entries = 0;
        let push = |entry| {
            entries += 1;
            queue.push(entry);
        };
        self.space.predict::<false, VECTORS>(world, &queries, &mut self.scratch, push);
        // Register after searching: a search that reads a line just written in parts stalls on store
        // forwarding. At their present positions the particles are registered already, because their old
        // paths ended there.
        for query in &queries {
            self.register(query);
        }
        self.scratch.work.entries += entries;
        true
    }

    /// Registers a particle along its new path.
    #[inline(always)]
    fn register(&mut self, query: &Query) {
        let CompactParticle { radius, v, .. } = query.compact;
        let extent = self.space.extent(radius);
        self.space.cells.register(query.slot, query.start, v, 1.0 - query.from, extent);
    }

    /// Whether a particle is too fast for the window.
    #[inline(always)]
    fn is_too_fast(&self, query: &Query) -> bool {
        !query.compact.is_within(self.farthest * self.farthest)
    }

    /// Copies the new flight of particle i into its slot; how it is looked from now.
    #[inline(always)]
    fn update(&mut self, world: &World, i: u32) -> Query {
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
        let back = self.space.cells.axes.displacement(v, from);
        self.space.anchors[slot as usize] = *particle;
        let compact = &mut self.space.particles[slot as usize];
        for axis in 0..3 {
            compact.x[axis] = place[axis].wrapping_sub(back[axis]);
        }
        compact.v = v;
        let compact = *compact;
        Query { slot, compact, start: place, from }
    }

    /// The bodies of the collision that is `ahead` events from now in the queue, and its time [ticks].
    #[inline(always)]
    fn peek(&self, ahead: usize) -> Option<([u32; 2], i64)> {
        let WindowEvent(entry) = self.queue.upcoming(ahead)?;
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
                prefetch_at(&self.space.particles, slot);
                prefetch_at(&self.space.anchors, slot);
            }
        }
    }

    /// Prefetches what the searches after the next events will read: the cells around them, later the compact particles
    /// of the particles in these.
    #[inline(always)]
    fn prefetch_cells(&mut self, world: &World) {
        let Space { cells, particles, .. } = &self.space;
        let turn = self.turn;
        self.turn = (turn + 1) % TURNS;
        if let Some(([body, _], time)) = self.peek(CELLS) {
            let compact = &particles[self.slot_of[body as usize] as usize];
            let part = ((time - self.begin) as f64 * (world.clock.tick / self.step)) as f32;
            let block = cells.around(compact.x, compact.v, part);
            cells.visit(&block, prefetch);
            self.around[turn] = block;
        }
        // Those of the event that was so far ahead `TURNS` events ago; others may have come between, which
        // does no harm.
        cells.visit(&self.around[self.turn], |cell| {
            for slot in cell.first() {
                prefetch_at(particles, slot as usize);
            }
        });
    }

    /// Entries that opening a window counts as: it takes time, and the caller watches for signals.
    fn entries_of_opening(&self) -> u64 {
        1 + self.space.particles.len() as u64 / 16
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
            let Some(WindowEvent(entry)) = self.queue.pop_until(limit.ticks.min(self.space.end)) else {
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
            if self.space.particles.len() > particles::PREFETCH_WINDOWS {
                self.prefetch_events(&state.world);
            }
            if self.space.particles.len() > particles::PREFETCH_CELLS {
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
            state.accumulators.counters.dropped += 1;
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
                // A body of infinite mass has not changed: its entries in the queue are valid.
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
        let counters = &mut state.accumulators.counters;
        counters.predictions += work.predictions;
        counters.candidates += work.candidates;
        counters.windows += work.windows;
    }
}
