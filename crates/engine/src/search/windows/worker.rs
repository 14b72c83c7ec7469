//! What runs the events of a window: the particles in their cells, and a queue of their contacts.

use std::marker::PhantomData;

use glam::DVec3;
use haff_calendar::WindowQueue;
use haff_neighbors::{Array, prefetch, prefetch_at};

use crate::{
    model::features::Features,
    numerics::tuning::particles,
    search::{compact::CompactParticle, planes::Planes},
    state::world::World,
};

use super::{
    cells::{Cells, NearestCells},
    filter::{Scratch, WindowQuery},
    moving::MovingFrame,
    space::Space,
    window_event::WindowEvent,
};

/// Particles are prefetched for the event that is this many events ahead.
const PARTICLES_AHEAD: usize = 20;
/// Slots are prefetched for the event that is this many events ahead.
const SLOTS_AHEAD: usize = 14;
/// Cells are prefetched for the event that is this many events ahead.
const CELLS_AHEAD: usize = 9;
/// Length of the ring of cells. The compact particles in a set of cells are prefetched when the set is the
/// oldest of the ring.
const RING: usize = 5;
/// The data of a window that its events read and change.
pub(super) struct Worker<F> {
    /// Acceleration of all particles [length/time²].
    pub gravity: DVec3,
    /// The frame of a box that deforms.
    pub moving: Option<MovingFrame>,
    pub space: Space<F>,
    /// Slot of each particle.
    pub slot_of: Array<u32>,
    pub queue: WindowQueue<WindowEvent>,
    /// Contacts up to this time are added to the queue [ticks], others to `later`.
    pub horizon: i64,
    pub later: Vec<WindowEvent>,
    /// Start of the window [ticks].
    pub begin: i64,
    /// Length of the window [time].
    pub step: f64,
    /// Largest displacement in the window [length]. Beyond it the nearest image could be the wrong one, or
    /// the margin of the filter too small.
    pub max_displacement: f32,
    /// Ring buffer of the prefetched cells around coming events.
    cell_ring: [NearestCells; RING],
    /// Index of its oldest element.
    ring_position: usize,
    pub scratch: Scratch,
}

impl<F: Features> Worker<F> {
    /// A worker without a window, for this number of particles.
    pub fn new(gravity: DVec3, count: usize) -> Self {
        let mut queue = WindowQueue::default();
        if count > particles::PREFETCH_WINDOWS {
            queue.keep_sorted(PARTICLES_AHEAD + 1);
        }
        Self {
            gravity,
            moving: None,
            space: Space {
                cells: Cells::default(),
                particles: Array::default(),
                lowest: Vec::new(),
                rows: Vec::new(),
                ids: Array::default(),
                anchors: Array::default(),
                end: 0,
                common_radius: 0.0,
                contacts: 0,
                planes: Planes::default(),
                features: PhantomData,
            },
            slot_of: vec![0; count].into(),
            queue,
            horizon: i64::MAX,
            later: Vec::new(),
            begin: 0,
            step: 0.0,
            max_displacement: 0.0,
            cell_ring: [NearestCells::default(); RING],
            ring_position: 0,
            scratch: Scratch::new(),
        }
    }

    /// A worker for other particles of the same window, with an empty queue.
    ///
    /// # Safety
    ///
    /// That of [`Space::alias`].
    pub unsafe fn alias(&mut self) -> Self {
        let mut worker = Self::new(self.gravity, 0);
        if self.slot_of.len() > particles::PREFETCH_WINDOWS {
            worker.queue.keep_sorted(PARTICLES_AHEAD + 1);
        }
        // SAFETY: guaranteed by the caller.
        (worker.space, worker.slot_of) = unsafe { (self.space.alias(), self.slot_of.alias()) };
        (worker.begin, worker.step, worker.moving) = (self.begin, self.step, self.moving);
        worker.max_displacement = self.max_displacement;
        worker
    }

    /// Prefetches what coming events will read, if the system is large.
    #[inline(always)]
    pub fn prefetch(&mut self, world: &World, contains: impl Fn(&NearestCells) -> bool) {
        if self.space.particles.len() > particles::PREFETCH_WINDOWS {
            self.prefetch_events(world);
        }
        if self.space.particles.len() > particles::PREFETCH_CELLS {
            self.prefetch_cells(world, contains);
        }
    }

    /// Updates particles after a change of their flights, and adds their contacts to the queue. Returns false
    /// if one of them has become too fast for the window.
    #[inline(always)]
    pub fn predict_again<const K: usize, const VECTORS: bool>(
        &mut self,
        world: &World,
        bodies: [u32; K],
    ) -> bool {
        let mut queries = [WindowQuery::default(); K];
        let mut is_too_fast = false;
        for (query, body) in queries.iter_mut().zip(bodies) {
            let is_slow;
            (*query, is_slow) = self.update(world, body);
            is_too_fast |= !is_slow;
        }
        if is_too_fast {
            return false;
        }
        let (queue, later, horizon) = (&mut self.queue, &mut self.later, self.horizon);
        let mut entries = 0;
        let push = |entry: WindowEvent| {
            entries += 1;
            if entry.0.time <= horizon {
                queue.push(entry);
            } else {
                later.push(entry);
            }
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

    /// [`Self::predict_again`] of one particle, after walls and bodies of infinite mass. Compiled once, not
    /// for each loop of events: these are rarer than collisions.
    #[inline(always)]
    pub fn predict_one<const VECTORS: bool>(&mut self, world: &World, body: u32) -> bool {
        #[cfg(target_arch = "x86_64")]
        if VECTORS {
            // SAFETY: with `VECTORS` set the caller guarantees the features of `predict_one_avx2`.
            return unsafe { self.predict_one_avx2(world, body) };
        }
        self.predict_one_portable(world, body)
    }

    #[inline(never)]
    fn predict_one_portable(&mut self, world: &World, body: u32) -> bool {
        self.predict_again::<1, false>(world, [body])
    }

    #[cfg(target_arch = "x86_64")]
    #[inline(never)]
    #[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt,popcnt")]
    fn predict_one_avx2(&mut self, world: &World, body: u32) -> bool {
        self.predict_again::<1, true>(world, [body])
    }

    /// Sets the path of a particle in the window from its anchor.
    pub fn set_path(&mut self, world: &World, i: u32) {
        let (position, velocity) = world.flight::<F>(i, self.begin);
        let (start, displacement) = self.grid_flight(position, velocity, 0.0);
        let compact = &mut self.space.particles[self.slot_of[i as usize] as usize];
        for axis in 0..3 {
            compact.x[axis] = self.space.cells.axes.coordinate(axis, start[axis]);
            compact.v[axis] = displacement[axis] as f32;
        }
    }

    /// A position and a velocity `elapsed` \[time\] after the start of the window, in the coordinates of the
    /// grid: the position, and the displacement in the window \[length\].
    #[inline(always)]
    pub fn grid_flight(&self, position: DVec3, velocity: DVec3, elapsed: f64) -> ([f64; 3], [f64; 3]) {
        if F::DEFORMS
            && let Some(frame) = &self.moving
        {
            let flight = frame.flight(position, velocity, elapsed, self.step);
            return (flight.position, flight.displacement);
        }
        let (mut position, mut velocity) = (position, velocity);
        if F::GRAVITY {
            // In the frame that has been falling since the window began, all paths are straight.
            position -= self.gravity * (0.5 * elapsed * elapsed);
            velocity -= self.gravity * elapsed;
        }
        (position.to_array(), (velocity * self.step).to_array())
    }

    /// Registers a particle along its new path.
    #[inline(always)]
    fn register(&mut self, query: &WindowQuery) {
        let CompactParticle { radius, v, .. } = query.compact;
        let v = if F::DEFORMS { self.space.cells.axes.tilt.chord(v, query.from) } else { v };
        let extent = self.space.extent(radius);
        self.space.cells.register(query.slot, query.start, v, 1.0 - query.from, extent);
    }

    /// Copies the new flight of particle i to its slot. Returns the query for its partners from now on, and
    /// whether the particle is slow enough for the window.
    #[inline(always)]
    fn update(&mut self, world: &World, i: u32) -> (WindowQuery, bool) {
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
        let axes = &self.space.cells.axes;
        let mut displacement = axes.displacement(v, from);
        if F::DEFORMS
            && let Some(frame) = &self.moving
        {
            let elapsed = (particle.time - self.begin) as f64 * world.clock.tick;
            let flight = frame.flight(particle.position, particle.velocity, elapsed, self.step);
            v = flight.displacement.map(|displacement| displacement as f32);
            for axis in 0..3 {
                start[axis] = axes.coordinate(axis, flight.position[axis]);
                displacement[axis] = start[axis].wrapping_sub(axes.coordinate(axis, flight.start[axis]));
            }
        }
        self.space.anchors[slot as usize] = *particle;
        let stored = &mut self.space.particles[slot as usize];
        let mut compact = CompactParticle { x: [0; 3], radius: stored.radius, v, count: stored.count };
        for axis in 0..3 {
            compact.x[axis] = start[axis].wrapping_sub(displacement[axis]);
        }
        compact.store(stored);
        // Tested here, where the components are in registers: a load stalls on store forwarding if it covers
        // parts of two stores that have just been made.
        let is_slow = compact.is_within(self.max_displacement * self.max_displacement);
        (WindowQuery { slot, compact, start, from }, is_slow)
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
    fn prefetch_cells(&mut self, world: &World, contains: impl Fn(&NearestCells) -> bool) {
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
        let oldest = &self.cell_ring[self.ring_position];
        if !contains(oldest) {
            return;
        }
        cells.visit(oldest, |block| {
            for slot in block.first_entries() {
                prefetch_at(particles, slot as usize);
            }
        });
    }
}
