//! One block: takes the events of a round, or leaves them over.

use std::collections::BTreeMap;

use glam::DVec3;

use super::super::{
    axes::Axes,
    cells::path_span,
    front::{Depth, Front, Metric},
    tune::Work,
    window_event::{Contact, Entry, WindowEvent},
    worker::Worker,
};
use super::{cut::Round, ownership::Ownership, rows::Rows};
use crate::{
    accumulators::Accumulators,
    batch::Kernel,
    compact::CompactParticle,
    features::Features,
    particles::{Particle, World},
    report::BlockCounts,
    resolve,
    rest::state::SettlingState,
    stall::Stall,
    state::State,
};

/// What a thread has for one block.
pub(super) struct Block<F> {
    pub worker: Worker<F>,
    /// For assertions.
    pub ownership: Ownership,
    pub state: State,
    /// The front of the present round.
    pub front: Front,
    /// Contacts at the start of the round.
    pub contacts: Vec<WindowEvent>,
    /// Events that are left to the next round.
    pub left: Vec<WindowEvent>,
    pub undo: Vec<Undo>,
    /// Changes of the images of particles in a step.
    pub wraps: Vec<(u32, [i32; 3])>,
    pub rows: Rows,
    /// Times of the events \[ticks\], those of a round in order.
    pub times: Vec<i64>,
    /// Where the times of the present round begin.
    pub first_time: usize,
    /// Whether the step must be undone, and whether because of an event that an earlier front has not
    /// expected.
    pub is_failed: bool,
    pub is_unexpected: bool,
}

/// A particle before its first event in a step.
pub(super) struct Undo {
    pub i: u32,
    pub particle: Particle,
}

/// The place of a particle in its window after a fraction of it [cells].
#[inline(always)]
pub(super) fn place(axes: &Axes, particle: &CompactParticle, fraction: f32) -> [f32; 3] {
    let mut x = axes.grid_coordinates(particle.x);
    for k in 0..3 {
        x[k] += particle.v[k] * fraction * axes.cells[k];
        let n = axes.n[k] as f32;
        if axes.wraps(k) {
            if x[k] < 0.0 {
                x[k] += n;
            }
            if x[k] >= n {
                x[k] -= n;
            }
        }
    }
    [x[0], x[1], x[2]]
}

/// The present step, for all blocks.
pub(super) struct Step {
    pub metric: Metric,
    /// After `from`, up to and including `to` [ticks].
    pub from: i64,
    pub to: i64,
    /// Start of the window [ticks], and its length as fractions per tick.
    pub begin: i64,
    pub per_time: f64,
    /// Most events of a block: more are a collapse, which is found where events are taken in order.
    pub most: usize,
    /// Whether the longest displacement of all particles has been noted since the start of the window.
    pub has_noted: bool,
}

impl<F> Block<F> {
    /// A block with this worker, and with a world without particles.
    pub fn new(worker: Worker<F>, world: &World, ownership: Ownership) -> Self {
        Self {
            worker,
            ownership,
            front: Front::default(),
            state: State {
                world: world.without_particles(),
                accumulators: Accumulators::default(),
                pending: BTreeMap::new(),
                stall: Stall::default(),
                settling: SettlingState::default(),
                blocks: BlockCounts::default(),
            },
            contacts: Vec::new(),
            left: Vec::new(),
            undo: Vec::new(),
            wraps: Vec::new(),
            rows: Rows::default(),
            times: Vec::new(),
            first_time: 0,
            is_failed: false,
            is_unexpected: false,
        }
    }

    /// Removes all that a step has left in the block.
    pub fn clear(&mut self) {
        self.state.accumulators = Accumulators::default();
        self.state.pending.clear();
        self.state.world.resting = 0;
        self.state.world.longest_flight = 0.0;
        self.worker.scratch.work = Work::default();
        self.worker.later.clear();
        self.left.clear();
        self.undo.clear();
        self.wraps.clear();
        self.rows.clear();
        self.times.clear();
        self.first_time = 0;
        (self.is_failed, self.is_unexpected) = (false, false);
    }
}

impl<F: Features> Block<F> {
    /// Takes the events of a round.
    pub fn run(&mut self, kernel: Kernel, step: &Step, earlier: &[Round], events: bool) {
        let present = Present { step, earlier };
        match (kernel, events) {
            (Kernel::Portable, false) => self.take::<false, false>(&present),
            (Kernel::Portable, true) => self.take::<true, false>(&present),
            #[cfg(target_arch = "x86_64")]
            // SAFETY: only `Kernel::choose` makes this variant, after it has detected the features.
            (Kernel::Avx2, false) => unsafe { self.take_avx2::<false>(&present) },
            #[cfg(target_arch = "x86_64")]
            // SAFETY: as above.
            (Kernel::Avx2, true) => unsafe { self.take_avx2::<true>(&present) },
        }
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt,popcnt")]
    fn take_avx2<const EVENTS: bool>(&mut self, present: &Present) {
        self.take::<EVENTS, true>(present);
    }

    #[inline(always)]
    fn take<const EVENTS: bool, const VECTORS: bool>(&mut self, present: &Present) {
        let (from, to) = (present.step.from, present.step.to);
        self.worker.horizon = to;
        self.worker.queue.open(from, to, &self.contacts);
        while let Some(event) = self.worker.queue.pop_until(to) {
            let bounds = self.front.bounds;
            let contains = |axis: usize, c: i32| bounds.contains_cells(axis, c, 1);
            self.worker.prefetch(&self.state.world, contains);
            let is_endless = self.times.len() > present.step.most;
            if is_endless || !self.take_event::<EVENTS, VECTORS>(present, event) {
                self.is_failed = true;
                return;
            }
        }
    }

    /// Takes an event or leaves it over. Returns false if the step must be undone.
    #[inline(always)]
    fn take_event<const EVENTS: bool, const VECTORS: bool>(
        &mut self,
        present: &Present,
        event: WindowEvent,
    ) -> bool {
        match event.0.target.kind() {
            Contact::Collision(j) => self.take_collision::<EVENTS, VECTORS>(present, event, j),
            Contact::Wall(wall) => self.take_wall_collision::<EVENTS, VECTORS>(present, event, wall),
        }
    }

    #[inline(always)]
    fn take_collision<const EVENTS: bool, const VECTORS: bool>(
        &mut self,
        present: &Present,
        event: WindowEvent,
        j: u32,
    ) -> bool {
        let entry = event.0;
        let i = entry.owner;
        let (world, step) = (&self.state.world, present.step);
        self.ownership.read(i);
        let (a, b) = (&world.particles[i as usize], &world.particles[j as usize]);
        // In this order: the partner of a particle with another path can be in another block.
        if a.count != entry.own_count {
            self.state.accumulators.counters.dropped += 1;
            return true;
        }
        self.ownership.read(j);
        if b.count != entry.partner_count {
            self.state.accumulators.counters.dropped += 1;
            return true;
        }
        let time = step.fraction(entry.time);
        let places = [self.place(step, i, time), self.place(step, j, time)];
        if !self.is_known(present, &places, time) {
            return self.leave(present, event, &places, time);
        }
        let Ok(impact) = resolve::collide::<F>(world, [i, j], entry.time) else { return false };
        for (k, (_, position, velocity)) in impact.after().into_iter().enumerate() {
            // In the order of the indices.
            let k = if i < j { k } else { 1 - k };
            match self.stays(present, &places[k], (position, velocity), entry.time) {
                Stays::Inside => {}
                Stays::Outside => return self.leave(present, event, &places, time),
                Stays::TooFast => return false,
            }
        }
        if !present.is_expected(&places, time) {
            self.is_unexpected = true;
            return false;
        }
        for place in &places {
            self.ownership.change(place.body);
            self.save(step, place.body);
            self.worker.space.particles[place.slot].note_path();
        }
        self.start_event::<EVENTS>(&entry);
        resolve::apply::<F, EVENTS>(&mut self.state, &impact, entry.time, &mut self.rows);
        self.wrap(i);
        self.wrap(j);
        if self.has_resting() {
            return false;
        }
        let world = &self.state.world;
        let movable = |body: u32| F::UNIFORM || world.class(body).inverse_mass != 0.0;
        match (movable(i), movable(j)) {
            (true, true) => self.worker.predict_again::<2, VECTORS>(world, [i.min(j), i.max(j)]),
            (true, false) => self.worker.predict_again::<1, VECTORS>(world, [i]),
            (false, _) => self.worker.predict_again::<1, VECTORS>(world, [j]),
        }
    }

    #[inline(never)]
    fn take_wall_collision<const EVENTS: bool, const VECTORS: bool>(
        &mut self,
        present: &Present,
        event: WindowEvent,
        wall: u32,
    ) -> bool {
        let entry = event.0;
        let i = entry.owner;
        let (world, step) = (&self.state.world, present.step);
        if world.particles[i as usize].count != entry.own_count {
            self.state.accumulators.counters.dropped += 1;
            return true;
        }
        let time = step.fraction(entry.time);
        let places = [self.place(step, i, time)];
        if !self.is_known(present, &places, time) {
            return self.leave(present, event, &places, time);
        }
        let Ok((contact, outcome)) = resolve::collide_with_wall::<F>(world, i, wall, entry.time) else {
            return false;
        };
        let after = (contact.position, outcome.velocity());
        match self.stays(present, &places[0], after, entry.time) {
            Stays::Inside => {}
            Stays::Outside => return self.leave(present, event, &places, time),
            Stays::TooFast => return false,
        }
        if !present.is_expected(&places, time) {
            self.is_unexpected = true;
            return false;
        }
        self.ownership.change(i);
        self.save(step, i);
        self.worker.space.particles[places[0].slot].note_path();
        self.start_event::<EVENTS>(&entry);
        resolve::apply_wall::<F, EVENTS>(&mut self.state, &contact, &outcome, &mut self.rows);
        self.wrap(i);
        !self.has_resting() && self.worker.predict_again::<1, VECTORS>(&self.state.world, [i])
    }

    /// The place of a particle after a fraction of the window.
    #[inline(always)]
    fn place(&self, step: &Step, body: u32, time: f32) -> Place {
        let slot = self.worker.slot_of[body as usize] as usize;
        let space = &self.worker.space;
        let x = place(&space.cells.axes, &space.particles[slot], time);
        Place { body, slot, x, depth: step.metric.depth(&self.front.bounds, x) }
    }

    /// Whether nothing unknown can have changed an event, and its particles are registered in no cells but
    /// those of this block.
    #[inline(always)]
    fn is_known<const K: usize>(&self, present: &Present, places: &[Place; K], time: f32) -> bool {
        if self.front.bounds.is_whole {
            return true;
        }
        // A loop instead of `Iterator::all`, which can remain a call compiled for the baseline instruction
        // set.
        for place in places {
            let is_clear = self.front.is_clear(place.depth, place.x, time);
            if !is_clear || !self.is_registered_inside(present, place) {
                return false;
            }
        }
        true
    }

    /// Whether a particle is registered in cells of this block only.
    #[inline(always)]
    fn is_registered_inside(&self, present: &Present, place: &Place) -> bool {
        let (space, step) = (&self.worker.space, present.step);
        let compact = &space.particles[place.slot];
        let extent = space.extent(compact.radius);
        // Of a particle with an event in this window, only the last of its paths is stored. It is registered
        // along the earlier ones up to the end of the window: from an event at a place b, up to a
        // displacement of the window away from b, and the present place is up to another one away from b.
        // After a step that was undone, it is registered along paths that it does not take.
        let has_turned =
            self.state.world.particles[place.body as usize].time > step.begin || compact.longest() > 0.0;
        let displacement = if !step.has_noted {
            step.metric.speed
        } else if has_turned {
            let mut last = *compact;
            last.note_path();
            last.longest().sqrt()
        } else {
            return self.contains(path_span(&space.cells.axes, compact.x, compact.v, 1.0, extent));
        };
        place.depth.of_cells >= 2.0 * displacement + extent
    }

    /// Whether these cells, the first one and their number along each axis, are in this block.
    fn contains(&self, (low, count): ([i32; 4], [i32; 3])) -> bool {
        let mut is_inside = true;
        for k in 0..3 {
            is_inside &= self.front.bounds.contains_cells(k, low[k], count[k]);
        }
        is_inside
    }

    /// Whether the cells along a new path, and those that a search around it reads, are in this block.
    #[inline(always)]
    fn stays(
        &self,
        present: &Present,
        place: &Place,
        (mut position, mut velocity): (DVec3, DVec3),
        ticks: i64,
    ) -> Stays {
        let step = present.step;
        let metric = &step.metric;
        let world = &self.state.world;
        if !F::UNIFORM && world.class(place.body).inverse_mass == 0.0 {
            return Stays::Inside;
        }
        if F::GRAVITY {
            let elapsed = (ticks - step.begin) as f64 * world.clock.tick;
            position -= self.worker.gravity * (0.5 * elapsed * elapsed);
            velocity -= self.worker.gravity * elapsed;
        }
        let square = velocity.length_squared() * (self.worker.step * self.worker.step);
        if square > f64::from(metric.speed) * f64::from(metric.speed) {
            return Stays::TooFast;
        }
        let space = &self.worker.space;
        let reach = space.particles[place.slot].radius + space.common_radius;
        if place.depth.of_cells >= metric.speed + reach {
            return Stays::Inside;
        }
        let axes = &space.cells.axes;
        let (p, u) = (position.to_array(), velocity.to_array());
        let (mut start, mut v) = ([0; 3], [0.0; 3]);
        for k in 0..3 {
            start[k] = axes.coordinate(k, p[k]);
            v[k] = (u[k] * self.worker.step) as f32;
        }
        if self.contains(path_span(axes, start, v, 1.0 - step.fraction(ticks), reach)) {
            Stays::Inside
        } else {
            Stays::Outside
        }
    }

    /// Begins an event.
    #[inline(always)]
    fn start_event<const EVENTS: bool>(&mut self, entry: &Entry) {
        self.state.world.now = entry.time;
        if EVENTS {
            let world = &self.state.world;
            let is_movable = |body: &u32| F::UNIFORM || world.class(*body).inverse_mass != 0.0;
            let changed = [Some(entry.owner), entry.target.partner()].map(|body| body.filter(is_movable));
            self.rows.begin_event(entry.time, entry.rank(), changed);
        }
        self.times.push(entry.time);
    }

    /// Whether a wall supports a particle: windows do not support this.
    #[inline(always)]
    fn has_resting(&self) -> bool {
        F::GRAVITY && (self.state.world.resting != 0 || !self.state.pending.is_empty())
    }

    /// Wraps the anchor of a particle into the box.
    #[inline(always)]
    fn wrap(&mut self, i: u32) {
        let wraps = self.state.world.wrap_anchor(i);
        if wraps != [0; 3] {
            self.wraps.push((i, wraps));
        }
    }

    /// Saves a particle before its first event in a step.
    #[inline(always)]
    fn save(&mut self, step: &Step, i: u32) {
        let particle = self.state.world.particles[i as usize];
        if particle.time <= step.from {
            self.undo.push(Undo { i, particle });
        }
    }

    /// Leaves an event to the next round.
    #[cold]
    #[inline(never)]
    fn leave(&mut self, present: &Present, event: WindowEvent, places: &[Place], time: f32) -> bool {
        let step = present.step;
        self.left.push(event);
        // One source for both particles of a pair: each is half a contact distance from it.
        let (first, last) = (places[0].x, places[places.len() - 1].x);
        self.front.add(step.metric.middle(first, last), time, step.fraction(step.to));
        true
    }
}

/// The place of a particle at an event.
struct Place {
    body: u32,
    slot: usize,
    /// Grid coordinates [cells].
    x: [f32; 3],
    depth: Depth,
}

/// Where a new path leads.
enum Stays {
    Inside,
    Outside,
    /// The particle is faster than the front.
    TooFast,
}

/// What a block uses in a round besides its own data.
struct Present<'a> {
    step: &'a Step,
    earlier: &'a [Round],
}

impl Present<'_> {
    /// Whether the fronts of all earlier rounds expect an event at these places.
    #[inline(always)]
    fn is_expected(&self, places: &[Place], time: f32) -> bool {
        self.earlier.iter().all(|round| places.iter().all(|place| round.expects(place.x, time)))
    }
}

impl Step {
    /// A time as a fraction of the window.
    #[inline(always)]
    pub fn fraction(&self, ticks: i64) -> f32 {
        ((ticks - self.begin) as f64 * self.per_time) as f32
    }
}
