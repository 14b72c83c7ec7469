//! The scheduler with one entry per particle in a calendar and any [search](haff_neighbors::Search) for
//! partners: cells or all pairs.
//!
//! The search (`neighbors::Search`) guarantees: two particles that could touch before either changes its
//! cell are candidates of each other. `Cells` keeps cell coordinates and never recomputes them. `AllPairs`
//! takes the two nearest images of each pair. Walls are listed per cell, so that interior
//! particles never test one.

use std::marker::PhantomData;

use haff_neighbors::{Geometry, Search, prefetch_at};

use crate::{
    laws::event::{AnyEvent, Collision, Impact, Pause},
    model::features::Features,
    numerics::tuning::particles::PREFETCH_CALENDAR,
    search::{
        batch::Kernel,
        entry::Entry,
        event_loop::{Limit, Next, Scheduler},
        parallel,
        predict::{BestEvent, Scope, Scratch, flight, predict},
        queue::{Predictor, Queue},
        search_event::SearchEvent,
    },
    state::State,
};

/// Particles are prefetched for the entry this many positions after the next one. There are two or three
/// entries per event.
const FAR_AHEAD: usize = 10;

/// The scheduler for one set of features and one search.
pub(crate) struct CalendarScheduler<F, S> {
    queue: Queue<SearchEvent>,
    predictor: SearchPredictor<F, S>,
    /// Number of predictions already added to the counters of the state.
    counted: u64,
}

/// The data of predictions besides the state.
struct SearchPredictor<F, S> {
    search: S,
    /// For each particle whose entry is a crossing, its earliest physical event.
    best: Vec<BestEvent>,
    scratch: Scratch,
    /// Whether prefetching is profitable: there are too many particles for the cache.
    prefetches: bool,
    features: PhantomData<F>,
}

impl<F: Features, S: Search + 'static> SearchPredictor<F, S> {
    /// The next event of particle i.
    #[inline(always)]
    fn next_event(&mut self, state: &State, i: u32, scope: Scope) -> Entry<SearchEvent> {
        let best = if scope == Scope::All { BestEvent::NONE } else { self.best[i as usize] };
        let (entry, best) =
            predict::<F, S>(&state.world, &self.search, &state.pending, i, scope, best, &mut self.scratch);
        if let Some(best) = best {
            self.best[i as usize] = best;
        }
        entry
    }

    /// Wraps the anchor of a particle, which has just been set, and updates the search.
    #[inline(always)]
    fn wrap_anchor(&mut self, state: &mut State, i: u32) {
        let wraps = state.world.wrap_anchor(i);
        if wraps != [0; 3] {
            self.search.rewrap(i, wraps);
        }
    }
}

impl<F: Features, S: Search + 'static> Predictor for SearchPredictor<F, S> {
    type Features = F;
    type Kind = SearchEvent;

    #[inline(always)]
    fn predict(&mut self, state: &State, i: u32) -> Entry<SearchEvent> {
        self.next_event(state, i, Scope::All)
    }

    /// Prefetches the particles.
    #[inline(always)]
    fn prefetch<'a>(&self, upcoming: impl Fn(usize) -> Option<&'a Entry<SearchEvent>>, state: &State) {
        if !self.prefetches {
            return;
        }
        if let Some(entry) = upcoming(FAR_AHEAD) {
            prefetch_at(&state.world.particles, entry.owner as usize);
            if let Some(j) = entry.target.partner() {
                prefetch_at(&state.world.particles, j as usize);
            }
        }
    }
}

impl<F: Features, S: Search + 'static> CalendarScheduler<F, S> {
    /// A scheduler for this number of particles. [`Scheduler::rebuild`] must be called before the first
    /// event.
    pub fn new(geometry: &Geometry, kernel: Kernel, particles: usize) -> Self {
        Self {
            queue: Queue::new(particles, FAR_AHEAD),
            predictor: SearchPredictor {
                search: S::new(geometry, &[]),
                best: vec![BestEvent::NONE; particles],
                scratch: Scratch::new(kernel),
                prefetches: particles >= PREFETCH_CALENDAR,
                features: PhantomData,
            },
            counted: 0,
        }
    }

    /// Predicts particle i and adds its next event to the queue.
    #[inline(always)]
    fn schedule(&mut self, state: &State, i: u32, scope: Scope) {
        let entry = self.predictor.next_event(state, i, scope);
        self.queue.push(entry);
    }
}

impl<F: Features, S: Search + 'static> Scheduler for CalendarScheduler<F, S> {
    type Features = F;
    type Event = AnyEvent;

    const ALWAYS_ROWS: bool = S::IS_ALL_PAIRS;

    fn kernel(&self) -> Kernel {
        self.predictor.scratch.kernel()
    }

    fn rebuild(&mut self, state: &mut State, geometry: &Geometry) {
        let State { world, accumulators, pending, .. } = state;
        let (world, pending) = (&*world, &*pending);
        let count = world.particles.len();
        let all = [0, count as u32];
        let mut positions = Vec::with_capacity(count);
        parallel::map_particles(all, &|| (), &|(), i| world.flight::<F>(i, world.now).0, &mut positions);
        self.predictor.search = S::new(geometry, &positions);
        self.queue.clear();
        let search = &self.predictor.search;
        let kernel = self.predictor.scratch.kernel();
        let predict = |scratch: &mut Scratch, i: u32| {
            let before = scratch.predictions;
            let (entry, best) =
                predict::<F, S>(world, search, pending, i, Scope::All, BestEvent::NONE, scratch);
            (entry, best, scratch.predictions - before)
        };
        let mut predicted = Vec::with_capacity(count);
        parallel::map_particles(all, &|| Scratch::new(kernel), &predict, &mut predicted);
        for (entry, best, predictions) in predicted {
            accumulators.counters.predictions += predictions;
            if let Some(best) = best {
                self.predictor.best[entry.owner as usize] = best;
            }
            self.queue.push(entry);
        }
    }

    #[inline(always)]
    fn next<const VECTORS: bool>(&mut self, state: &mut State, limit: &mut Limit) -> Next<AnyEvent> {
        loop {
            let Some(entry) = self.queue.next(state, &mut self.predictor, limit.ticks) else {
                return Next::Nothing;
            };
            let i = entry.owner;
            let scope = match entry.target.kind() {
                SearchEvent::Collision(j) => {
                    return Next::Event(entry.time, AnyEvent::Impact(Impact::Pair(Collision([i, j]))));
                }
                SearchEvent::Wall(wall) => {
                    return Next::Event(entry.time, AnyEvent::Impact(Impact::Wall { i, wall }));
                }
                event @ (SearchEvent::EndOfBounces | SearchEvent::Release | SearchEvent::EndOfSlide) => {
                    let Some(event) = event.of_support(i) else { continue };
                    return Next::Event(entry.time, event);
                }
                SearchEvent::Crossing(code) => Scope::New(code),
                SearchEvent::Prediction => Scope::All,
            };
            limit.entries -= 1;
            state.world.now = state.world.now.max(entry.time);
            state.accumulators.counters.transfers += 1;
            if let Scope::New(code) = scope {
                let flight = flight::<F>(&state.world, i);
                self.predictor.search.cross(i, code, &flight);
            }
            self.schedule(state, i, scope);
            if limit.entries == 0 {
                return Next::Interrupted;
            }
        }
    }

    #[inline(always)]
    fn update<const VECTORS: bool>(
        &mut self,
        state: &mut State,
        event: AnyEvent,
        woken: &[u32],
        _limit: &mut Limit,
    ) -> Option<Pause> {
        let bodies = match event {
            AnyEvent::Impact(Impact::Pair(Collision([i, j]))) => {
                // Both anchors are wrapped before either particle is predicted.
                let bodies = [i.min(j), i.max(j)];
                for body in bodies {
                    self.predictor.wrap_anchor(state, body);
                }
                for body in bodies {
                    // A body of infinite mass has not changed: its own entry stays valid, unless it is the
                    // entry that has just been removed.
                    if body == i || state.world.class(body).inverse_mass != 0.0 {
                        self.schedule(state, body, Scope::All);
                    }
                }
                bodies
            }
            AnyEvent::Impact(Impact::Wall { i, .. }) | AnyEvent::Release(i) | AnyEvent::EndOfSlide(i) => {
                self.predictor.wrap_anchor(state, i);
                self.schedule(state, i, Scope::All);
                [i, i]
            }
            AnyEvent::EndOfBounces(i) => {
                if state.world.spin.is_some() {
                    // Friction that begins now has moved the anchor.
                    self.predictor.wrap_anchor(state, i);
                }
                self.schedule(state, i, Scope::All);
                [i, i]
            }
        };
        if F::REST {
            self.queue.note_changed(woken);
            for &body in woken.iter().filter(|body| !bodies.contains(body)) {
                self.schedule(state, body, Scope::All);
            }
        }
        None
    }

    fn reschedule(&mut self, state: &mut State, bodies: &[u32]) {
        self.queue.note_changed(bodies);
        for &body in bodies {
            self.predictor.wrap_anchor(state, body);
        }
        for &body in bodies {
            self.schedule(state, body, Scope::All);
        }
    }

    fn is_idle(&self) -> bool {
        self.queue.is_empty()
    }

    fn count_work(&mut self, state: &mut State) {
        let predictions = self.predictor.scratch.predictions;
        state.accumulators.counters.predictions += predictions - self.counted;
        self.counted = predictions;
    }
}
