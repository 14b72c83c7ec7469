//! The loop: take the earliest event of the [queue](crate::queue), resolve it, predict what comes next for those it changed.

use std::{collections::BTreeMap, marker::PhantomData};

use haff_calendar::{Calendar, Ladder};
use haff_neighbors::{Geometry, Search, prefetch_at};
use rayon::prelude::*;

use crate::{
    batch::Kernel,
    book::Book,
    entry::{Entry, Kind, Target},
    error::EngineError,
    particles::World,
    predict::{Memory, Scope, Scratch, flight, foresee},
    queue::{Prophet, Queue},
    report::{Observer, Stop},
    resolve,
    rest::{self, Heap},
    stall::Stall,
};

/// What a scene asks of the engine; each combination is compiled on its own, so that nobody pays for the rest.
pub(crate) trait Features: Send + Sync + 'static {
    /// Bodies may be accelerated.
    const GRAVITY: bool;
    /// All particles share one radius and one finite mass.
    const UNIFORM: bool;
    /// Grains may be put to rest; never where they are `UNIFORM`, as those at rest count as of infinite mass.
    const REST: bool;
    /// No contact loses energy: all laws are e = 1.
    const ELASTIC: bool;
}

/// A combination of features.
pub(crate) struct With<
    const GRAVITY: bool,
    const UNIFORM: bool,
    const REST: bool = false,
    const ELASTIC: bool = false,
>;

impl<const GRAVITY: bool, const UNIFORM: bool, const REST: bool, const ELASTIC: bool> Features
    for With<GRAVITY, UNIFORM, REST, ELASTIC>
{
    const GRAVITY: bool = GRAVITY;
    const UNIFORM: bool = UNIFORM;
    const REST: bool = REST;
    const ELASTIC: bool = ELASTIC;
}

/// A completed series of bounces, up to its end.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Pending {
    /// When the series ends [ticks].
    pub end: i64,
    pub wall: u32,
    /// Approach speed of the first bounce left out [length/time].
    pub speed: f64,
    /// Sums over the bounces left out.
    pub impulse: f64,
    pub energy_loss: f64,
    pub carnot_energy: f64,
}

/// How far to run.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Limit {
    /// Up to and with this time [ticks].
    pub ticks: i64,
    /// Up to this total of collisions.
    pub collisions: u64,
    /// At most this many calendar entries; counted down.
    pub entries: u64,
}

/// From this many particles on the memory of events to come is asked for ahead of time.
const MANY: usize = 10_000;
/// Of the event so many entries ahead, particles and lists are asked for, …
const FAR_AHEAD: usize = 10;
/// … and of this nearer one those in the lists. Two or three entries are taken for each event.
const NEARLY_DUE: usize = 4;

/// A compiled engine, behind one virtual call per slice of events.
pub(crate) trait Engine: Send {
    /// Searches and predicts everything afresh.
    fn rebuild(&mut self, state: &mut State, geometry: &Geometry);
    /// Predicts afresh these particles, which have been put to rest. Engines without gravity put nobody to rest.
    fn reschedule(&mut self, _state: &mut State, _bodies: &[u32]) {}
    /// Whether no event is due at any time.
    fn is_idle(&self) -> bool;
    /// Whether it cannot go on, because it does not serve what the state has become.
    fn is_outgrown(&self) -> bool {
        false
    }
    /// Runs events.
    fn advance(
        &mut self,
        state: &mut State,
        limit: &mut Limit,
        observer: &mut dyn Observer,
    ) -> Result<Stop, EngineError>;
}

/// What an engine works on: all but its machinery.
#[derive(Debug, Clone)]
pub(crate) struct State {
    pub world: World,
    pub book: Book,
    pub pending: BTreeMap<u32, Pending>,
    pub stall: Stall,
    pub heap: Heap,
}

/// The engine for one set of features and one search.
pub(crate) struct Machine<F, S> {
    queue: Queue,
    sight: Sight<F, S>,
}

/// All that predictions need besides the state.
struct Sight<F, S> {
    search: S,
    /// Best physical event of the particles whose entry is a transfer.
    memory: Vec<Memory>,
    scratch: Scratch,
    /// Whether the particles are too many for the cache.
    looks_ahead: bool,
    features: PhantomData<F>,
}

const NO_MEMORY: Memory = Memory { time: i64::MAX, target: Target::NONE, partner_count: 0 };

impl<F: Features, S: Search + 'static> Sight<F, S> {
    /// The next event of particle i.
    #[inline(always)]
    fn next_event(&mut self, state: &State, i: u32, scope: Scope) -> Entry {
        let memory = if scope == Scope::All { NO_MEMORY } else { self.memory[i as usize] };
        let (entry, memory) =
            foresee::<F, S>(&state.world, &self.search, &state.pending, i, scope, memory, &mut self.scratch);
        if let Some(memory) = memory {
            self.memory[i as usize] = memory;
        }
        entry
    }

    /// Wraps the anchor of a particle that has just collided, and tells the search.
    #[inline(always)]
    fn follow(&mut self, state: &mut State, i: u32) {
        let wraps = state.world.wrap_anchor(i);
        if wraps != [0; 3] {
            self.search.rewrap(i, wraps);
        }
    }
}

impl<F: Features, S: Search + 'static> Prophet for Sight<F, S> {
    type Features = F;

    #[inline(always)]
    fn foresee(&mut self, state: &State, i: u32) -> Entry {
        self.next_event(state, i, Scope::All)
    }

    /// First the particles and their lists, later those that stand in these.
    #[inline(always)]
    fn look_ahead(&self, calendar: &Ladder<Entry>, state: &State) {
        if !self.looks_ahead {
            return;
        }
        if let Some(entry) = calendar.upcoming(FAR_AHEAD) {
            prefetch_at(&state.world.particles, entry.owner as usize);
            self.search.prefetch(entry.owner);
            if let Kind::Collision(j) = entry.target.kind() {
                prefetch_at(&state.world.particles, j as usize);
                self.search.prefetch(j);
            }
        }
        if let Some(entry) = calendar.upcoming(NEARLY_DUE) {
            let neighbors = |i: u32| {
                for entry in self.search.packed(i).unwrap_or_default() {
                    prefetch_at(&state.world.particles, entry.id() as usize);
                }
            };
            neighbors(entry.owner);
            if let Kind::Collision(j) = entry.target.kind()
                && !calendar.upcoming(NEARLY_DUE + 1).is_some_and(|next| next.mirrors(entry))
            {
                neighbors(j);
            }
        }
    }
}

impl<F: Features, S: Search + 'static> Machine<F, S> {
    /// A machine for a state; it has to be [built](Engine::rebuild) before it runs.
    pub fn new(geometry: &Geometry, kernel: Kernel, particles: usize) -> Self {
        Self {
            queue: Queue::new(particles, FAR_AHEAD),
            sight: Sight {
                search: S::new(geometry, &[]),
                memory: vec![NO_MEMORY; particles],
                scratch: Scratch::new(kernel),
                looks_ahead: particles >= MANY,
                features: PhantomData,
            },
        }
    }

    /// Predicts particle i and enters its next event.
    #[inline(always)]
    fn schedule(&mut self, state: &State, i: u32, scope: Scope) {
        let entry = self.sight.next_event(state, i, scope);
        self.queue.push(entry);
    }

    /// [`Self::run`], compiled with 256-bit vectors, so that the kernel is entered without a change of instruction set
    /// and scalar code has three-operand instructions.
    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2")]
    fn run_avx2<const EVENTS: bool>(
        &mut self,
        state: &mut State,
        limit: &mut Limit,
        observer: &mut dyn Observer,
    ) -> Result<Stop, EngineError> {
        self.run::<EVENTS>(state, limit, observer)
    }

    /// Runs the events; `EVENTS` tells whether the observer wants rows.
    #[inline(always)]
    fn run<const EVENTS: bool>(
        &mut self,
        state: &mut State,
        limit: &mut Limit,
        observer: &mut dyn Observer,
    ) -> Result<Stop, EngineError> {
        let predictions = self.sight.scratch.predictions;
        let stop = loop {
            if state.book.counters.collisions >= limit.collisions {
                break Stop::Collisions;
            }
            if limit.entries == 0 {
                break Stop::Slice;
            }
            let Some(entry) = self.queue.next(state, &mut self.sight, limit.ticks) else {
                state.world.now = state.world.now.max(limit.ticks);
                break Stop::Time;
            };
            limit.entries -= 1;
            state.world.now = state.world.now.max(entry.time);
            let i = entry.owner;
            match entry.target.kind() {
                Kind::Collision(j) => {
                    state.stall.watch(&state.world, &entry)?;
                    let woken = if F::REST { rest::strike(state, i, j, entry.time) } else { Vec::new() };
                    resolve::collision::<F, EVENTS>(state, i, j, entry.time, observer)?;
                    // Both anchors are in place before either is looked at.
                    let bodies = [i.min(j), i.max(j)];
                    for body in bodies {
                        self.sight.follow(state, body);
                    }
                    for body in bodies {
                        // A body of infinite mass has not changed: its own entry stands unless it is this one.
                        if body == i || state.world.class(body).inverse_mass != 0.0 {
                            self.schedule(state, body, Scope::All);
                        }
                    }
                    if F::REST {
                        self.schedule_woken(state, &woken, bodies);
                        if state.heap.watch(&state.world, entry.time) {
                            break Stop::Slice;
                        }
                    }
                }
                Kind::Wall(wall) => {
                    state.stall.watch(&state.world, &entry)?;
                    let held = F::REST && state.world.is_held(i);
                    let woken = if held { rest::wake(state, i, entry.time) } else { Vec::new() };
                    resolve::wall::<F, EVENTS>(state, i, wall, entry.time, observer)?;
                    self.sight.follow(state, i);
                    self.schedule(state, i, Scope::All);
                    if F::REST {
                        self.schedule_woken(state, &woken, [i, i]);
                        if state.heap.watch(&state.world, entry.time) {
                            break Stop::Slice;
                        }
                    }
                }
                Kind::Rest => {
                    state.stall.watch(&state.world, &entry)?;
                    resolve::end_of_rest::<EVENTS>(state, i, entry.time, observer);
                    self.schedule(state, i, Scope::All);
                    if state.pending.is_empty() && state.world.is_at_rest() {
                        break Stop::Rest;
                    }
                }
                Kind::Transfer(code) => {
                    state.book.counters.transfers += 1;
                    let flight = flight::<F>(&state.world, i);
                    self.sight.search.transfer(i, code, &flight);
                    self.schedule(state, i, Scope::New(code));
                }
                Kind::Renewal => {
                    state.book.counters.transfers += 1;
                    self.schedule(state, i, Scope::All);
                }
            }
        };
        state.book.counters.predictions += self.sight.scratch.predictions - predictions;
        Ok(stop)
    }

    /// Predicts those that have woken, without the two whose turn it has been.
    fn schedule_woken(&mut self, state: &State, woken: &[u32], done: [u32; 2]) {
        for &body in woken.iter().filter(|body| !done.contains(body)) {
            self.schedule(state, body, Scope::All);
        }
    }
}

impl<F: Features, S: Search + 'static> Engine for Machine<F, S> {
    fn rebuild(&mut self, state: &mut State, geometry: &Geometry) {
        let State { world, book, pending, .. } = state;
        let (world, pending) = (&*world, &*pending);
        let count = world.particles.len();
        let positions: Vec<_> =
            (0..count as u32).into_par_iter().map(|i| world.flight::<F>(i, world.now).0).collect();
        self.sight.search = S::new(geometry, &positions);
        self.queue.clear();
        let search = &self.sight.search;
        let kernel = self.sight.scratch.kernel();
        let foreseen: Vec<(Entry, Option<Memory>, u64)> = (0..count as u32)
            .into_par_iter()
            .map_init(
                || Scratch::new(kernel),
                |scratch, i| {
                    let before = scratch.predictions;
                    let (entry, memory) =
                        foresee::<F, S>(world, search, pending, i, Scope::All, NO_MEMORY, scratch);
                    (entry, memory, scratch.predictions - before)
                },
            )
            .collect();
        for (entry, memory, predictions) in foreseen {
            book.counters.predictions += predictions;
            if let Some(memory) = memory {
                self.sight.memory[entry.owner as usize] = memory;
            }
            self.queue.push(entry);
        }
    }

    fn reschedule(&mut self, state: &mut State, bodies: &[u32]) {
        for &body in bodies {
            self.sight.follow(state, body);
        }
        for &body in bodies {
            self.schedule(state, body, Scope::All);
        }
    }

    fn is_idle(&self) -> bool {
        self.queue.is_empty()
    }

    fn advance(
        &mut self,
        state: &mut State,
        limit: &mut Limit,
        observer: &mut dyn Observer,
    ) -> Result<Stop, EngineError> {
        match (observer.wants_events(), self.sight.scratch.kernel()) {
            (true, _) => self.run::<true>(state, limit, observer),
            (false, Kernel::Portable) => self.run::<false>(state, limit, observer),
            #[cfg(target_arch = "x86_64")]
            // SAFETY: made by `Kernel::choose` alone, after it has found the features.
            (false, Kernel::Avx2) => unsafe { self.run_avx2::<false>(state, limit, observer) },
        }
    }
}
