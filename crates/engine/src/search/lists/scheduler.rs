//! The scheduler for lists.

use std::marker::PhantomData;

use haff_neighbors::{Array, Geometry, with_huge_pages};

use crate::{
    laws::event::{AnyEvent, Collision, Impact, Pause, PhysicalEvent},
    model::{System, features::Features},
    numerics::tuning::particles::PREFETCH_LISTS,
    report::Observer,
    search::{
        batch::Kernel,
        blocks,
        case::Reason,
        compact::CompactParticle,
        event_loop::{Limit, Next, Scheduler},
        parallel,
        planes::Planes,
        queue::{Predictor, Queue},
        search_event::SearchEvent,
        summary::{LocalDensity, SystemSummary},
    },
    state::State,
};

use super::{
    Entry,
    filter::Bounds,
    neighbor_lists::Lists,
    plan::Plan,
    predictor::{FAR_AHEAD, ListPredictor, Work},
    step_data::Steps,
    vector_predictor::VectorPredictor,
};

/// Number of particles that are predicted in parallel at the start, before their entries are added to the
/// queue.
pub(super) const BLOCK: usize = 1 << 16;

/// The events of lists: [`Impact`]s, or [`AnyEvent`]s where grains can rest on walls.
pub(crate) trait ListedEvent: PhysicalEvent + From<Impact> {
    /// The event that ends what a wall under particle i does; `None` where no grain rests on walls.
    fn of_support(event: SearchEvent, i: u32) -> Option<Self>;
    /// The impact, or the only particle of another event.
    fn impact(self) -> Result<Impact, u32>;
}

impl ListedEvent for Impact {
    #[inline(always)]
    fn of_support(_: SearchEvent, _: u32) -> Option<Self> {
        None
    }

    #[inline(always)]
    fn impact(self) -> Result<Impact, u32> {
        Ok(self)
    }
}

impl ListedEvent for AnyEvent {
    #[inline(always)]
    fn of_support(event: SearchEvent, i: u32) -> Option<Self> {
        event.of_support(i)
    }

    #[inline(always)]
    fn impact(self) -> Result<Impact, u32> {
        match self {
            Self::Impact(impact) => Ok(impact),
            Self::EndOfBounces(i) | Self::Release(i) | Self::EndOfSlide(i) => Err(i),
        }
    }
}

/// The scheduler for one set of features and the events that can occur with them.
pub(crate) struct ListSearch<F, E = Impact> {
    pub(super) kernel: Kernel,
    pub(super) queue: Queue<SearchEvent>,
    pub(super) predictor: ListPredictor<F>,
    /// The events after this time [ticks] are taken in steps; those up to it are in the queue.
    pub(super) horizon: i64,
    pub(super) steps: Steps<F>,
    pub(super) bounds: [Bounds; 2],
    pub(super) work: Work,
    /// The part of `work` that has been added to the counters of the state.
    pub(super) counted: Work,
    events: PhantomData<fn() -> E>,
}

impl<F: Features, E: ListedEvent> ListSearch<F, E> {
    /// A scheduler for a system. Before a run it must be [built](Scheduler::rebuild).
    ///
    /// # Errors
    /// Why this scheduler cannot run the system ([`super::can_run`]).
    pub fn new(
        kernel: Kernel,
        system: &System,
        summary: &SystemSummary,
        density: &LocalDensity,
        blocks: Option<u16>,
    ) -> Result<Self, Reason> {
        let plan = Plan::new(system, summary, density)?;
        let count = summary.count;
        Ok(Self {
            kernel,
            queue: Queue::new(count, FAR_AHEAD),
            predictor: ListPredictor {
                plan,
                particles: Array::default(),
                lists: Lists::default(),
                fixed: Array::default(),
                fixed_count: 0,
                planes: Planes::default(),
                walls: (0..system.walls.len() as u16).collect(),
                prefetches: count >= PREFETCH_LISTS,
                features: PhantomData,
            },
            horizon: i64::MAX,
            steps: Steps::new(blocks),
            bounds: [Bounds::new(); 2],
            work: Work::default(),
            counted: Work::default(),
            events: PhantomData,
        })
    }

    /// Predicts every particle. The queue is empty, and the paths are those of the present span.
    fn predict_all(&mut self, state: &State) {
        let count = state.world.particles.len();
        let in_steps = self.begin_steps(state);
        let predictor = &self.predictor;
        let mut block = Vec::with_capacity(BLOCK.min(count));
        for start in (0..count).step_by(BLOCK) {
            let predict = |bounds: &mut Bounds, i: u32| {
                let mut work = Work::default();
                let entry = predictor.predict_portable(&state.world, &state.pending, i, bounds, &mut work);
                (entry, work)
            };
            let range = [start as u32, (start + BLOCK).min(count) as u32];
            parallel::map_particles(range, &Bounds::new, &predict, &mut block);
            if start == 0 {
                let entries: Vec<Entry> = block.iter().map(|(entry, _)| *entry).collect();
                if in_steps {
                    self.steps.prepare(&entries, count);
                } else {
                    self.queue.prepare(&entries, count);
                }
            }
            for (entry, work) in &block {
                if in_steps && entry.time > self.horizon {
                    self.steps.push(*entry, count);
                } else {
                    self.queue.push(*entry);
                }
                self.work.add(*work);
            }
        }
    }

    /// Updates and predicts particle i after a collision with a wall. Not inlined, so that the loop of
    /// particle collisions stays short.
    #[inline(never)]
    pub(super) fn update_after_wall<const VECTORS: bool>(&mut self, state: &mut State, i: u32) {
        let (queue, mut predictor) = self.split::<VECTORS>();
        state.world.wrap_anchor(i);
        predictor.predictor.update(&state.world, i);
        queue.push(predictor.predict(state, i));
    }

    /// Predicts the grains that an event has woken, besides its own particles.
    #[inline(always)]
    fn predict_woken(&mut self, state: &State, woken: &[u32], bodies: [u32; 2]) {
        if F::REST {
            let (queue, mut predictor) = self.split::<false>();
            queue.note_changed(woken);
            for &body in woken.iter().filter(|body| !bodies.contains(body)) {
                queue.push(predictor.predict(state, body));
            }
        }
    }

    /// The queue, and the predictor with or without vector instructions.
    #[inline(always)]
    pub(super) fn split<const VECTORS: bool>(
        &mut self,
    ) -> (&mut Queue<SearchEvent>, VectorPredictor<'_, F, VECTORS>) {
        let Self { queue, predictor, bounds, work, .. } = self;
        (queue, VectorPredictor { predictor, bounds, work })
    }
}

impl<F: Features, E: ListedEvent> Scheduler for ListSearch<F, E> {
    type Features = F;
    type Event = E;

    fn kernel(&self) -> Kernel {
        self.kernel
    }

    fn rebuild(&mut self, state: &mut State, geometry: &Geometry) {
        let count = state.world.particles.len();
        self.queue.clear();
        self.steps.clear();
        let predictor = &mut self.predictor;
        if predictor.particles.is_empty() {
            let mut particles = with_huge_pages(count + 1);
            particles.resize(count + 1, CompactParticle::SENTINEL);
            predictor.particles = particles.into();
        }
        predictor.planes = Planes::new(&state.world);
        predictor.begin_lists(&state.world);
        predictor.lists = Lists::default();
        predictor.lists = Lists::new::<F>(&predictor.plan, geometry, &predictor.particles);
        self.predict_all(state);
    }

    fn predict_again(&mut self, state: &mut State) -> bool {
        self.queue.clear();
        self.steps.clear();
        self.predictor.begin(&state.world);
        self.predict_all(state);
        true
    }

    #[inline(always)]
    fn next<const VECTORS: bool>(&mut self, state: &mut State, limit: &mut Limit) -> Next<E> {
        let until = limit.ticks.min(self.horizon);
        let (queue, mut predictor) = self.split::<VECTORS>();
        loop {
            let Some(entry) = queue.next(state, &mut predictor, until) else {
                return if limit.ticks <= until || self.is_idle() { Next::Nothing } else { Next::Step };
            };
            let i = entry.owner;
            let updates = match entry.target.kind() {
                SearchEvent::Collision(j) => {
                    return Next::Event(entry.time, Impact::Pair(Collision([i, j])).into());
                }
                SearchEvent::Wall(wall) => return Next::Event(entry.time, Impact::Wall { i, wall }.into()),
                event @ (SearchEvent::EndOfBounces | SearchEvent::Release | SearchEvent::EndOfSlide) => {
                    let Some(event) = E::of_support(event, i) else { continue };
                    return Next::Event(entry.time, event);
                }
                SearchEvent::Crossing(_) => true,
                SearchEvent::Prediction => false,
            };
            limit.entries -= 1;
            state.world.now = state.world.now.max(entry.time);
            state.accumulators.counters.transfers += 1;
            if updates {
                predictor.predictor.update_list::<VECTORS>(&state.world, i);
            }
            queue.push(predictor.predict(state, i));
            if limit.entries == 0 {
                return Next::Interrupted;
            }
        }
    }

    #[inline(always)]
    fn update<const VECTORS: bool>(
        &mut self,
        state: &mut State,
        event: E,
        woken: &[u32],
        _limit: &mut Limit,
    ) -> Option<Pause> {
        if F::REST {
            // Before any prediction, because their classes and anchors have changed.
            for &body in woken {
                self.predictor.update(&state.world, body);
            }
        }
        let [i, j] = match event.impact() {
            Ok(Impact::Pair(Collision(bodies))) => bodies,
            Ok(Impact::Wall { i, .. }) | Err(i) => {
                self.update_after_wall::<VECTORS>(state, i);
                self.predict_woken(state, woken, [i, i]);
                return None;
            }
        };
        let (queue, mut predictor) = self.split::<VECTORS>();
        // Both anchors are updated before either particle is predicted.
        let bodies = [i.min(j), i.max(j)];
        for body in bodies {
            state.world.wrap_anchor(body);
            predictor.predictor.update(&state.world, body);
        }
        for entry in predictor.predict_both(&state.world, &state.pending, bodies) {
            // The collision has not changed a body of infinite mass: its own entry is still valid, unless it
            // is the one of this collision.
            if F::UNIFORM || entry.owner == i || state.world.class(entry.owner).inverse_mass != 0.0 {
                queue.push(entry);
            }
        }
        self.predict_woken(state, woken, bodies);
        None
    }

    fn reschedule(&mut self, state: &mut State, bodies: &[u32]) {
        let (queue, mut predictor) = self.split::<false>();
        queue.note_changed(bodies);
        for &body in bodies {
            state.world.wrap_anchor(body);
            predictor.predictor.update(&state.world, body);
        }
        for &body in bodies {
            queue.push(predictor.predict(state, body));
        }
    }

    fn is_idle(&self) -> bool {
        self.queue.is_empty() && self.steps.is_empty()
    }

    fn take_steps(
        &mut self,
        state: &mut State,
        limit: &mut Limit,
        observer: &mut dyn Observer,
        events: bool,
    ) {
        blocks::take_steps(self, state, limit, observer, events);
    }

    fn use_more_threads(&mut self, state: &State) {
        // The queue keeps its entries: steps take them from there.
        if self.horizon == i64::MAX {
            self.begin_steps(state);
        }
    }

    fn serial_reason(&self, state: &State) -> Option<&'static str> {
        ListSearch::serial_reason(self, &state.world)
    }

    fn count_work(&mut self, state: &mut State) {
        let counters = &mut state.accumulators.counters;
        counters.predictions += self.work.predictions - self.counted.predictions;
        counters.candidates += self.work.candidates - self.counted.candidates;
        self.counted = self.work;
    }
}
