//! One block of [`super::steps`]: takes the events and list updates of a round, or leaves them over.

use glam::DVec3;
use haff_calendar::WindowQueue;

use crate::{
    laws::{resolve, wall_impact},
    model::features::Features,
    search::{
        blocks::{Block, Bounds as FrontBounds, Grid, Ownership, Part, Place, RoundView, Step, wrap_place},
        compact::{CompactParticle, PERIOD},
        queue::Predictor,
        search_event::SearchEvent,
    },
    state::world::World,
};

use super::{
    Entry, UPDATE,
    filter::Bounds,
    moving::Motion,
    predictor::{FAR_AHEAD, ListPredictor, Work},
    vector_predictor::VectorPredictor,
};

/// What a thread has for one block.
pub(super) struct ListBlock<F> {
    pub part: Part<Entry>,
    pub predictor: ListPredictor<F>,
    bounds: [Bounds; 2],
    pub work: Work,
    queue: WindowQueue<Entry>,
    /// Entries after the end of the step.
    pub later: Vec<Entry>,
    /// Particles whose lists have been updated in the step, the time \[ticks\], and the reference position
    /// before.
    pub moved: Vec<(u32, i64, [i32; 3])>,
    /// Number of entries taken in the step.
    taken: usize,
    places: Places,
    /// For assertions: the particles whose lists a block changes.
    lists: Ownership,
}

/// Grid coordinates of particles.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Places {
    grid: Grid,
    /// Cells per coordinate.
    scale: [f64; 3],
    motion: Motion,
}

impl Places {
    pub fn new(grid: Grid, motion: Motion) -> Self {
        Self { grid, scale: grid.n.map(|n| f64::from(n) / PERIOD), motion }
    }

    /// The cell of a coordinate along an axis.
    pub fn cell(&self, axis: usize, x: i32) -> usize {
        (f64::from(x as u32) * self.scale[axis]) as usize
    }

    /// The place of a particle after a fraction of the span [cells].
    #[inline(always)]
    pub fn at<F: Features>(&self, particle: &CompactParticle, fraction: f32) -> [f32; 3] {
        let mut x = [0.0; 3];
        let path = if F::DEFORMS { self.motion.path(particle.v, fraction) } else { particle.v };
        for k in 0..3 {
            x[k] = (f64::from(particle.x[k] as u32) * self.scale[k]) as f32
                + if F::DEFORMS { path[k] } else { path[k] * fraction } * self.grid.cells[k];
        }
        wrap_place(&self.grid, &mut x);
        x
    }
}

impl<F: Features> ListBlock<F> {
    /// A block with the particles and lists of this predictor.
    pub fn new(
        predictor: ListPredictor<F>,
        world: &World,
        [ownership, lists]: [Ownership; 2],
        places: Places,
    ) -> Self {
        let mut queue = WindowQueue::default();
        queue.keep_sorted(FAR_AHEAD + 1);
        Self {
            part: Part::new(world, ownership),
            predictor,
            bounds: [Bounds::new(); 2],
            work: Work::default(),
            queue,
            later: Vec::new(),
            moved: Vec::new(),
            taken: 0,
            places,
            lists,
        }
    }

    /// Removes all that a step has left in the block.
    pub fn clear(&mut self) {
        self.part.clear();
        self.work = Work::default();
        self.later.clear();
        self.moved.clear();
        self.taken = 0;
    }

    /// Takes an entry or leaves it over. Returns false if the step must be undone.
    #[inline(always)]
    fn take_entry<const EVENTS: bool, const VECTORS: bool>(
        &mut self,
        round: &RoundView,
        entry: Entry,
    ) -> bool {
        let (step, i) = (round.step, entry.owner);
        self.part.ownership.read(i);
        let particles = &self.part.state.world.particles;
        if particles[i as usize].count != entry.own_count {
            self.part.state.accumulators.counters.dropped += 1;
            return true;
        }
        if self.has_simultaneous(&entry) {
            return false;
        }
        let time = step.fraction(entry.time);
        let updates = match entry.target.kind() {
            SearchEvent::Collision(j) => {
                self.part.ownership.read(j);
                if particles[j as usize].count == entry.partner_count {
                    return self.take_collision::<EVENTS, VECTORS>(round, entry, [i, j], time);
                }
                false
            }
            SearchEvent::Wall(wall) => {
                return self.take_wall_collision::<EVENTS, VECTORS>(round, entry, wall, time);
            }
            SearchEvent::Crossing(_) => true,
            SearchEvent::Prediction => false,
            // No grain rests on a wall.
            SearchEvent::EndOfBounces | SearchEvent::Release | SearchEvent::EndOfSlide => return false,
        };
        self.predict_again::<VECTORS>(round, entry, time, updates)
    }

    /// Whether another entry has the same time, so that their order has to be that of one queue. The
    /// partner's entry for the same collision does not count, and updates of lists do not, whose times are
    /// rounded to single precision: they change no contact.
    #[inline(always)]
    fn has_simultaneous(&self, entry: &Entry) -> bool {
        let is_update = |entry: &Entry| entry.target.kind() == UPDATE;
        let next = |k: usize| self.queue.upcoming(k).filter(|next| next.time == entry.time);
        next(0).is_some()
            && !is_update(entry)
            && (0..).map_while(next).any(|next| !is_update(next) && !next.mirrors(entry))
    }

    #[inline(always)]
    fn take_collision<const EVENTS: bool, const VECTORS: bool>(
        &mut self,
        round: &RoundView,
        entry: Entry,
        [i, j]: [u32; 2],
        time: f32,
    ) -> bool {
        let step = round.step;
        let places = [self.place(step, i, time), self.place(step, j, time)];
        if !self.is_known(&places, time) {
            return self.part.leave(step, entry, &places, time);
        }
        let mut rough = None;
        let Ok(impact) = resolve::collide::<F>(&self.part.state.world, [i, j], entry.time, &mut rough) else {
            return false;
        };
        let frame = &self.predictor.plan.frame;
        let world = &self.part.state.world;
        let allows = |&(_, position, velocity): &(u32, DVec3, DVec3)| {
            frame.allows::<F>(world, (position, world.anchor_velocity::<F>(velocity, entry.time)), entry.time)
        };
        if !impact.after().iter().all(allows) {
            return false;
        }
        if !round.is_expected(&self.part.state.world, &places, time) {
            return self.part.reject();
        }
        let bodies = [i.min(j), i.max(j)];
        for body in bodies {
            self.part.save(step, body);
        }
        self.part.start_event::<F, _, EVENTS>(&entry);
        resolve::apply::<F, EVENTS>(&mut self.part.state, &impact, &rough, entry.time, &mut self.part.rows);
        for body in bodies {
            self.part.wrap(body);
        }
        if self.has_resting() {
            return false;
        }
        for body in bodies {
            self.predictor.copy(&self.part.state.world, body);
        }
        for body in bodies {
            self.check_members(body);
        }
        let Self { predictor, bounds, work, .. } = self;
        let mut predictor = VectorPredictor::<F, VECTORS> { predictor, bounds, work };
        let state = &self.part.state;
        for entry in predictor.predict_both(&state.world, &state.pending, bodies) {
            self.push(step, entry);
        }
        true
    }

    #[inline(never)]
    fn take_wall_collision<const EVENTS: bool, const VECTORS: bool>(
        &mut self,
        round: &RoundView,
        entry: Entry,
        wall: u32,
        time: f32,
    ) -> bool {
        let (step, i) = (round.step, entry.owner);
        let places = [self.place(step, i, time)];
        if !self.is_known(&places, time) {
            return self.part.leave(step, entry, &places, time);
        }
        let mut rough = None;
        let Ok((contact, outcome)) =
            wall_impact::collide_with_wall::<F>(&self.part.state.world, i, wall, entry.time, &mut rough)
        else {
            return false;
        };
        let world = &self.part.state.world;
        let after =
            (contact.position, self.part.state.world.anchor_velocity::<F>(outcome.velocity(), entry.time));
        if !self.predictor.plan.frame.allows::<F>(world, after, entry.time) {
            return false;
        }
        if !round.is_expected(&self.part.state.world, &places, time) {
            return self.part.reject();
        }
        self.part.save(step, i);
        self.part.start_event::<F, _, EVENTS>(&entry);
        wall_impact::apply_wall::<F, EVENTS>(
            &mut self.part.state,
            &contact,
            &outcome,
            &rough,
            &mut self.part.rows,
        );
        self.part.wrap(i);
        if self.has_resting() {
            return false;
        }
        self.predictor.copy(&self.part.state.world, i);
        self.predict::<VECTORS>(step, i);
        true
    }

    /// Whether a wall supports a particle: blocks do not support this.
    #[inline(always)]
    fn has_resting(&self) -> bool {
        F::GRAVITY && (self.part.state.world.supported.resting != 0 || !self.part.state.pending.is_empty())
    }

    /// Predicts the particle of an entry again, after an update of its list if `updates` is set.
    #[inline(always)]
    fn predict_again<const VECTORS: bool>(
        &mut self,
        round: &RoundView,
        entry: Entry,
        time: f32,
        updates: bool,
    ) -> bool {
        let (step, i) = (round.step, entry.owner);
        let places = [self.place(step, i, time)];
        if !self.is_known(&places, time) {
            return self.part.leave(step, entry, &places, time);
        }
        if !round.is_expected(&self.part.state.world, &places, time) {
            return self.part.reject();
        }
        self.part.state.world.now = entry.time;
        if updates {
            let before = self.predictor.lists.reference(i);
            self.check_lists(i);
            if !self.predictor.renew_list::<VECTORS>(&self.part.state.world, i) {
                return self.part.leave(step, entry, &places, time);
            }
            self.moved.push((i, entry.time, before));
            self.check_lists(i);
            self.part.state.accumulators.counters.transfers += 1;
        } else {
            self.part.state.accumulators.counters.stale += 1;
        }
        self.predict::<VECTORS>(step, i);
        true
    }

    /// Predicts the next event of a particle at the present time.
    #[inline(always)]
    fn predict<const VECTORS: bool>(&mut self, step: &Step, i: u32) {
        self.check_members(i);
        let Self { predictor, bounds, work, .. } = self;
        let entry = VectorPredictor::<F, VECTORS> { predictor, bounds, work }.predict(&self.part.state, i);
        self.push(step, entry);
    }

    /// Asserts that no other block changes what a prediction of i reads: its list, and the particles in it.
    #[inline(always)]
    fn check_members(&self, i: u32) {
        if cfg!(debug_assertions) {
            self.lists.read(i);
            let count = self.part.state.world.particles.len() as u32;
            let members = self.predictor.lists.of(i).iter().filter(|&&j| j < count);
            members.for_each(|&j| self.part.ownership.read(j));
        }
    }

    /// Asserts that no other block reads or changes the lists that an update of the list of i changes.
    #[inline(always)]
    fn check_lists(&self, i: u32) {
        if cfg!(debug_assertions) {
            self.lists.change(i);
            let count = self.part.state.world.particles.len() as u32;
            let members = self.predictor.lists.of(i).iter().filter(|&&j| j < count);
            members.for_each(|&j| self.lists.change(j));
        }
    }

    /// Adds an entry to the queue, or to those after the end of the step.
    #[inline(always)]
    fn push(&mut self, step: &Step, entry: Entry) {
        if entry.time <= step.to {
            self.queue.push(entry);
        } else if entry.time < i64::MAX {
            self.later.push(entry);
        }
    }

    /// The place of a particle after a fraction of the span.
    #[inline(always)]
    fn place(&self, step: &Step, body: u32, time: f32) -> Place {
        let slot = body as usize;
        let x = self.places.at::<F>(&self.predictor.particles[slot], time);
        Place { body, slot, x, depth: step.metric.depth(&self.part.front.bounds, x) }
    }

    /// Whether nothing unknown can have changed an event.
    #[inline(always)]
    fn is_known<const K: usize>(&self, places: &[Place; K], time: f32) -> bool {
        if self.part.front.bounds.is_whole {
            return true;
        }
        // A loop instead of `Iterator::all`, which can remain a call compiled for the baseline instruction
        // set.
        for place in places {
            if !self.part.front.is_clear(place.depth, place.x, time) {
                return false;
            }
        }
        true
    }
}

impl<F: Features> Block for ListBlock<F> {
    const UNIFORM: bool = F::UNIFORM;
    type Event = Entry;

    fn part(&mut self) -> &mut Part<Entry> {
        &mut self.part
    }

    fn begin_round(&mut self, _: FrontBounds) {
        self.lists.begin_as(&self.part.ownership);
    }

    #[inline(always)]
    fn take<const EVENTS: bool, const VECTORS: bool>(&mut self, round: &RoundView) {
        let (from, to) = (round.step.from, round.step.to);
        self.queue.open(from, to, &self.part.known);
        while let Some(entry) = self.queue.pop_until(to) {
            let Self { predictor, bounds, work, queue, part, .. } = self;
            VectorPredictor::<F, VECTORS> { predictor, bounds, work }
                .prefetch(|ahead| queue.upcoming(ahead), &part.state);
            self.taken += 1;
            let is_endless = self.taken > round.step.most;
            if is_endless || !self.take_entry::<EVENTS, VECTORS>(round, entry) {
                self.part.is_failed = true;
                return;
            }
        }
    }
}
