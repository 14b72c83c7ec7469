/*!
The scheduler for time windows: it has no cell crossings, and it reads memory in order.

Time is divided into windows. At the start of a window, every particle is registered in all cells that its
path through the window touches ([`cells`]). Pairs that could touch before the window ends are found cell by
cell ([`filter`]) and predicted from their anchors ([`narrow_phase`]). All contacts within the window are
added to the queue. Events are resolved in the order of time. The particles of an event are registered along
their new paths and predicted again, up to the end of the window. An invalidated event needs no successor: all
other contacts of its particles are already in the queue.

Particles are stored in *slots*, which are sorted by cell every few windows, so that neighbors in space are
close in memory. The length of windows and the width of cells are tuned during the run ([`tune`]).
*/

mod axes;
mod cells;
mod filter;
mod narrow_phase;
mod opening;
mod space;
mod tune;
mod walls;
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
use filter::{MAX_DISPLACEMENT, Query, Scratch};
use space::Space;
use tune::{Tuner, Work};
use walls::Planes;
use window_event::{Contact, WindowEvent};

/// Particles are prefetched for the event that is this many events ahead.
const PARTICLES_AHEAD: usize = 20;
/// Slots are prefetched for the event that is this many events ahead.
const SLOTS_AHEAD: usize = 14;
/// Cells are prefetched for the event that is this many events ahead.
const CELLS_AHEAD: usize = 9;
/// Length of the ring of cells. The compact particles in a set of cells are prefetched when the set is the
/// oldest of the ring.
const RING: usize = 5;
/// Largest rounding error of coordinates, as a fraction of the smallest contact distance.
const MAX_ROUNDING: f64 = 0.02;
/// Windows are profitable with at most this many walls.
const MAX_WALLS: usize = 16;
/// Windows are profitable if no particle is faster than the mean speed by more than this factor: the fastest
/// particle limits the length of windows.
const MAX_SPEED_RATIO: f64 = 30.0;
/// Windows are profitable if the nearest image and the filter allow displacements of at least this many mean
/// distances between neighboring particles. With a smaller limit, windows would be short.
const MIN_DISPLACEMENT: f64 = 0.5;

/// A window ends early after this many searches per particle, plus [`SEARCHES`]. Each event registers a
/// particle again along its new path, so that a few particles that collide very often would fill their cells
/// with repeated entries.
const SEARCHES_PER_PARTICLE: u64 = 4;
/// See [`SEARCHES_PER_PARTICLE`].
const SEARCHES: u64 = 1000;

/// The scheduler for one set of features.
pub(crate) struct Windows<F> {
    kernel: Kernel,
    geometry: Geometry,
    /// Smallest radius [length].
    smallest_radius: f64,
    /// Acceleration of all particles [length/time²].
    gravity: DVec3,
    space: Space<F>,
    /// Slot of each particle.
    slot_of: Vec<u32>,
    queue: WindowQueue<WindowEvent>,
    /// Contacts found by the batch phase.
    found: Vec<WindowEvent>,
    /// Start of the window [ticks].
    begin: i64,
    /// Length of the window [time].
    step: f64,
    /// Mean distance between neighboring particles at the local density [length].
    spacing: f64,
    /// Mean length of a path in the window [spacings].
    path: f64,
    /// Width that the cells were made for [spacings].
    width: f64,
    /// Largest displacement in the window [length]. Beyond it the nearest image could be the wrong one, or
    /// the margin of the filter too small.
    max_displacement: f32,
    tuner: Tuner,
    /// Total number of searches after which the present window ends early.
    search_limit: u64,
    /// Number of windows since the slots were filled from the anchors.
    fill_age: u64,
    /// Number of windows after which the slots are filled again.
    fill_interval: u64,
    /// Ring buffer of the prefetched cells around coming events.
    cell_ring: [NearestCells; RING],
    /// Index of its oldest element.
    ring_position: usize,
    scratch: Scratch,
    /// Work up to the last update of the tuner.
    tuned_work: Work,
    /// The part of the work since then that was spent on opening windows.
    opening_work: Work,
    /// Work that has been added to the counters of the state.
    counted: Work,
}

/// The reason why windows cannot simulate a system; `None` if they can.
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
        if axes::rounding(system.domain.size[axis], periodic, summary.least) > MAX_ROUNDING {
            return Some(format!(
                "an edge of {} is too long for the least radius, {}",
                system.domain.size[axis], summary.least
            ));
        }
    }
    None
}

/// Whether windows support this state of a system for which [`unsuitable`] returns `None`: no wall
/// may support a particle.
pub(crate) fn supports(world: &World) -> bool {
    world.resting == 0
}

/// Whether windows are likely to be the fastest scheduler for a state that they support and that is not
/// dense.
pub(crate) fn is_profitable(system: &System, summary: &SystemSummary, density: &LocalDensity) -> bool {
    let displacement = MIN_DISPLACEMENT * summary.spacing(density.packing);
    let allows_displacement = |axis: usize| {
        system.domain.boundary[axis] != Boundary::Periodic
            || 0.5 * NEAREST * system.domain.size[axis] - summary.largest >= displacement
    };
    summary.count >= particles::WINDOWS
        && system.walls.len() <= MAX_WALLS
        && density.speeds_are_within(MAX_SPEED_RATIO)
        && MAX_DISPLACEMENT * 2.0 * summary.least >= displacement
        && (0..system.dimension.count()).all(allows_displacement)
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
            queue.keep_sorted(PARTICLES_AHEAD + 1);
        }
        Self {
            kernel,
            geometry: geometry.clone(),
            smallest_radius: summary.least,
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
                planes: Planes::default(),
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
            max_displacement: 0.0,
            tuner: Tuner::new(density.packing, system.dimension.count(), count),
            search_limit: 0,
            fill_age: 0,
            fill_interval: 0,
            cell_ring: [NearestCells::default(); RING],
            ring_position: 0,
            scratch: Scratch::new(),
            tuned_work: Work::default(),
            opening_work: Work::default(),
            counted: Work::default(),
        }
    }

    /// Updates particles after a change of their flights, and adds their contacts to the queue. Returns false
    /// if one of them has become too fast for the window.
    #[inline(always)]
    fn predict_again<const K: usize, const VECTORS: bool>(
        &mut self,
        world: &World,
        bodies: [u32; K],
    ) -> bool {
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
        // forwarding. In the cells of their present positions the particles are already registered, because
        // their old paths ended there.
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
        !query.compact.is_within(self.max_displacement * self.max_displacement)
    }

    /// Copies the new flight of particle i to its slot. Returns the query for its partners from now on.
    #[inline(always)]
    fn update(&mut self, world: &World, i: u32) -> Query {
        let particle = &world.particles[i as usize];
        let slot = self.slot_of[i as usize];
        let from = ((particle.time - self.begin) as f64 * (world.clock.tick / self.step)) as f32;
        let (mut position, mut velocity) = (particle.position, particle.velocity);
        if F::GRAVITY {
            // In the frame that has been falling since the window began, all paths are straight.
            let elapsed = (particle.time - self.begin) as f64 * world.clock.tick;
            position -= self.gravity * (0.5 * elapsed * elapsed);
            velocity -= self.gravity * elapsed;
        }
        let (velocity, position) = (velocity.to_array(), position.to_array());
        let (mut v, mut start) = ([0.0; 3], [0; 3]);
        for axis in 0..3 {
            v[axis] = (velocity[axis] * self.step) as f32;
            start[axis] = self.space.cells.axes.coordinate(axis, position[axis]);
        }
        let displacement = self.space.cells.axes.displacement(v, from);
        self.space.anchors[slot as usize] = *particle;
        let compact = &mut self.space.particles[slot as usize];
        for axis in 0..3 {
            compact.x[axis] = start[axis].wrapping_sub(displacement[axis]);
        }
        compact.v = v;
        let compact = *compact;
        Query { slot, compact, start, from }
    }

    /// The particles of the collision that is `ahead` events from now in the queue, and its time [ticks].
    #[inline(always)]
    fn peek(&self, ahead: usize) -> Option<([u32; 2], i64)> {
        let WindowEvent(entry) = self.queue.upcoming(ahead)?;
        Some(([entry.owner, entry.target.partner()?], entry.time))
    }

    /// Prefetches the particles of coming events, and later the contents of their slots.
    #[inline(always)]
    fn prefetch_events(&self, world: &World) {
        if let Some((bodies, _)) = self.peek(PARTICLES_AHEAD) {
            for body in bodies {
                prefetch_at(&world.particles, body as usize);
                prefetch_at(&self.slot_of, body as usize);
            }
        }
        if let Some((bodies, _)) = self.peek(SLOTS_AHEAD) {
            for body in bodies {
                let slot = self.slot_of[body as usize] as usize;
                prefetch_at(&self.space.particles, slot);
                prefetch_at(&self.space.anchors, slot);
            }
        }
    }

    /// Prefetches what the searches after coming events will read: the cells around these events, and later
    /// the compact particles in these cells.
    #[inline(always)]
    fn prefetch_cells(&mut self, world: &World) {
        let Space { cells, particles, .. } = &self.space;
        let position = self.ring_position;
        self.ring_position = (position + 1) % RING;
        if let Some(([body, _], time)) = self.peek(CELLS_AHEAD) {
            let compact = &particles[self.slot_of[body as usize] as usize];
            let fraction = ((time - self.begin) as f64 * (world.clock.tick / self.step)) as f32;
            let nearest = cells.nearest(compact.x, compact.v, fraction);
            cells.visit(&nearest, prefetch);
            self.cell_ring[position] = nearest;
        }
        // The oldest cells of the ring. Contacts that were added to the queue since then can have delayed
        // their event, which is harmless.
        cells.visit(&self.cell_ring[self.ring_position], |block| {
            for slot in block.first_entries() {
                prefetch_at(particles, slot as usize);
            }
        });
    }

    /// Number of entries that opening a window counts as: opening takes time, and the caller checks for
    /// signals whenever the limit of entries is used up.
    fn entries_of_opening(&self) -> u64 {
        1 + self.space.particles.len() as u64 / 16
    }

    /// Whether the window has to end early because of too many searches.
    ///
    /// Tested only after invalidated events and after events that change a single particle: a few particles
    /// that collide very often cause many of these. For other events the test costs nothing.
    #[inline(always)]
    fn exceeds_search_limit(&self) -> bool {
        self.scratch.work.searches > self.search_limit
    }

    /// Ends the window early, and opens the next one at the present.
    #[cold]
    fn reopen(&mut self, world: &World, limit: &mut Limit) {
        limit.entries = limit.entries.saturating_sub(self.entries_of_opening());
        self.start_from_anchors(world);
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
        self.space.planes = Planes::new(&state.world);
        self.start_from_anchors(&state.world);
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
            if self.exceeds_search_limit() {
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
        let changed = match event {
            Impact::Pair(Collision([i, j])) => {
                state.world.wrap_anchor(i);
                state.world.wrap_anchor(j);
                let world = &state.world;
                // A collision does not change a body of infinite mass: its entries in the queue stay valid.
                let movable = |body: u32| F::UNIFORM || world.class(body).inverse_mass != 0.0;
                match (movable(i), movable(j)) {
                    (true, true) => {
                        if !self.predict_again::<2, VECTORS>(world, [i.min(j), i.max(j)]) {
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
        if !self.predict_again::<1, VECTORS>(&state.world, [changed]) || self.exceeds_search_limit() {
            self.reopen(&state.world, limit);
        }
        None
    }

    fn reschedule(&mut self, state: &mut State, bodies: &[u32]) {
        for &body in bodies {
            state.world.wrap_anchor(body);
        }
        // Each particle that is predicted again is registered once more, so that for many particles a new
        // window costs less.
        let few = bodies.len() as u64 <= SEARCHES;
        let is_predicted =
            few && bodies.iter().all(|&body| self.predict_again::<1, false>(&state.world, [body]));
        if !is_predicted || self.exceeds_search_limit() {
            self.start_from_anchors(&state.world);
            self.open(&state.world);
        }
    }

    fn is_idle(&self) -> bool {
        // In a closed box there is always a next contact, unless nothing moves; the simulation tests that.
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
