/*!
The loop: take the earliest event, resolve it, predict what comes next for those it changed.

Every particle has exactly one live entry in the calendar, its earliest event. An entry whose own particle has had
another event is void and dropped; one whose partner has is stale, and its particle is predicted afresh. So each live
entry leaves exactly one successor.
*/

use std::{collections::BTreeMap, marker::PhantomData};

use haff_calendar::{Calendar, Ladder};
use haff_neighbors::{Geometry, Search, prefetch};
use rayon::prelude::*;

use crate::{
    batch::Kernel,
    book::Book,
    entry::{Entry, Kind, Target},
    error::EngineError,
    particles::World,
    predict::{Memory, Scope, Scratch, flight, foresee},
    report::{Observer, Stop},
    resolve,
    stall::Stall,
};

/// What a scene asks of the engine; each combination is compiled on its own, so that nobody pays for the rest.
pub(crate) trait Features: Send + Sync + 'static {
    /// Bodies may be accelerated.
    const GRAVITY: bool;
    /// All particles share one radius and one finite mass.
    const UNIFORM: bool;
}

/// A combination of features.
pub(crate) struct With<const GRAVITY: bool, const UNIFORM: bool>;

impl<const GRAVITY: bool, const UNIFORM: bool> Features for With<GRAVITY, UNIFORM> {
    const GRAVITY: bool = GRAVITY;
    const UNIFORM: bool = UNIFORM;
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
    /// Whether no event is due at any time.
    fn is_idle(&self) -> bool;
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
}

/// The engine for one set of features and one search.
pub(crate) struct Machine<F, S> {
    pub(crate) search: S,
    calendar: Ladder<Entry>,
    /// Best physical event of the particles whose entry is a transfer.
    memory: Vec<Memory>,
    /// Entries of one and the same tick, latest rank first, while several of them are due.
    ties: Vec<Entry>,
    scratch: Scratch,
    stall: Stall,
    /// Whether the particles are too many for the cache.
    looks_ahead: bool,
    features: PhantomData<F>,
}

const NO_MEMORY: Memory = Memory { time: i64::MAX, target: Target::NONE, partner_count: 0 };

impl<F: Features, S: Search + 'static> Machine<F, S> {
    /// A machine for a state; it has to be [built](Engine::rebuild) before it runs.
    pub fn new(geometry: &Geometry, kernel: Kernel, particles: usize) -> Self {
        Self {
            search: S::new(geometry, &[]),
            calendar: Ladder::with_capacity(particles),
            memory: vec![NO_MEMORY; particles],
            ties: Vec::new(),
            scratch: Scratch::new(kernel),
            stall: Stall::default(),
            looks_ahead: particles >= MANY,
            features: PhantomData,
        }
    }

    /// Predicts particle i and enters its next event.
    #[inline(always)]
    fn schedule(&mut self, state: &State, i: u32, scope: Scope) {
        let memory = if scope == Scope::All { NO_MEMORY } else { self.memory[i as usize] };
        let (entry, memory) =
            foresee::<F, S>(&state.world, &self.search, &state.pending, i, scope, memory, &mut self.scratch);
        if let Some(memory) = memory {
            self.memory[i as usize] = memory;
        }
        if entry.time < i64::MAX {
            self.calendar.push(entry);
        }
    }

    /// The next entry that is neither void nor stale, up to `limit`.
    #[inline(always)]
    fn next(&mut self, state: &mut State, limit: i64) -> Option<Entry> {
        loop {
            if !self.ties.is_empty() {
                if let Some(entry) = self.next_tie(state, limit) {
                    return Some(entry);
                }
                if !self.ties.is_empty() {
                    return None;
                }
            }
            let entry = self.calendar.pop_until(limit)?;
            self.look_ahead(state);
            if state.world.particles[entry.owner as usize].count != entry.own_count {
                state.book.counters.dropped += 1;
                continue;
            }
            if let Some(next) = self.calendar.peek()
                && next.time == entry.time
            {
                // Usually the partner's entry for the same collision, and nothing else. It will be void, unless the partner
                // is a body of infinite mass, whose entry must find its successor.
                let movable = |i: u32| F::UNIFORM || state.world.class(i).inverse_mass != 0.0;
                if next.mirrors(&entry) && movable(entry.owner) && movable(next.owner) {
                    self.calendar.pop_until(limit);
                    self.look_ahead(state);
                    state.book.counters.dropped += 1;
                }
                if self.calendar.next_time() == Some(entry.time) {
                    self.ties.push(entry);
                    continue;
                }
            }
            if is_stale(&state.world, &entry) {
                self.renew(state, entry);
                continue;
            }
            return Some(entry);
        }
    }

    /// Of several entries at one tick, the first in rank. All that are stale are predicted afresh before, so that
    /// what is first does not depend on which of them had been predicted when.
    #[cold]
    fn next_tie(&mut self, state: &mut State, limit: i64) -> Option<Entry> {
        let time = self.ties[0].time;
        if time > limit {
            return None;
        }
        loop {
            let mut changed = false;
            while let Some(entry) = self.calendar.pop_until(time) {
                self.ties.push(entry);
                changed = true;
            }
            let mut stale = Vec::new();
            self.ties.retain(|entry| {
                if state.world.particles[entry.owner as usize].count != entry.own_count {
                    state.book.counters.dropped += 1;
                    return false;
                }
                if is_stale(&state.world, entry) {
                    stale.push(*entry);
                    return false;
                }
                true
            });
            if changed {
                self.ties.sort_unstable_by(|a, b| (b.rank(), b).cmp(&(a.rank(), a)));
            }
            if stale.is_empty() {
                break;
            }
            for entry in stale {
                self.renew(state, entry);
            }
        }
        self.ties.pop()
    }

    /// Predicts afresh the particle whose partner has collided since.
    #[inline(always)]
    fn renew(&mut self, state: &mut State, entry: Entry) {
        state.world.now = state.world.now.max(entry.time);
        state.book.counters.stale += 1;
        self.schedule(state, entry.owner, Scope::All);
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
        let predictions = self.scratch.predictions;
        let stop = loop {
            if state.book.counters.collisions >= limit.collisions {
                break Stop::Collisions;
            }
            if limit.entries == 0 {
                break Stop::Slice;
            }
            let Some(entry) = self.next(state, limit.ticks) else {
                state.world.now = state.world.now.max(limit.ticks);
                break Stop::Time;
            };
            limit.entries -= 1;
            state.world.now = state.world.now.max(entry.time);
            self.stall.watch(&state.world, &entry)?;
            let i = entry.owner;
            match entry.target.kind() {
                Kind::Collision(j) => {
                    resolve::collision::<F, EVENTS>(state, i, j, entry.time, observer)?;
                    // Both anchors are in place before either is looked at.
                    let bodies = [i.min(j), i.max(j)];
                    for body in bodies {
                        self.follow(state, body);
                    }
                    for body in bodies {
                        // A body of infinite mass has not changed: its own entry stands unless it is this one.
                        if body == i || state.world.class(body).inverse_mass != 0.0 {
                            self.schedule(state, body, Scope::All);
                        }
                    }
                }
                Kind::Wall(wall) => {
                    resolve::wall::<F, EVENTS>(state, i, wall, entry.time, observer)?;
                    self.follow(state, i);
                    self.schedule(state, i, Scope::All);
                }
                Kind::Rest => {
                    resolve::end_of_rest::<EVENTS>(state, i, entry.time, observer);
                    self.schedule(state, i, Scope::All);
                    if state.pending.is_empty() && state.world.is_at_rest() {
                        break Stop::Rest;
                    }
                }
                Kind::Transfer(code) => {
                    state.book.counters.transfers += 1;
                    let flight = flight::<F>(&state.world, i);
                    self.search.transfer(i, code, &flight);
                    self.schedule(state, i, Scope::New(code));
                }
                Kind::Renewal => {
                    state.book.counters.transfers += 1;
                    self.schedule(state, i, Scope::All);
                }
            }
        };
        state.book.counters.predictions += self.scratch.predictions - predictions;
        Ok(stop)
    }

    /// Asks for the memory of events to come: first the particles and their lists, later those that stand in these.
    #[inline(always)]
    fn look_ahead(&self, state: &State) {
        if !self.looks_ahead {
            return;
        }
        if let Some(entry) = self.calendar.upcoming(FAR_AHEAD) {
            prefetch(&state.world.particles[entry.owner as usize]);
            self.search.prefetch(entry.owner);
            if let Kind::Collision(j) = entry.target.kind() {
                prefetch(&state.world.particles[j as usize]);
                self.search.prefetch(j);
            }
        }
        if let Some(entry) = self.calendar.upcoming(NEARLY_DUE) {
            let neighbors = |i: u32| {
                for entry in self.search.packed(i).unwrap_or_default() {
                    prefetch(&state.world.particles[entry.id() as usize]);
                }
            };
            neighbors(entry.owner);
            if let Kind::Collision(j) = entry.target.kind()
                && !self.calendar.upcoming(NEARLY_DUE + 1).is_some_and(|next| next.mirrors(entry))
            {
                neighbors(j);
            }
        }
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

/// Whether the partner of an entry has had another event since.
#[inline]
fn is_stale(world: &World, entry: &Entry) -> bool {
    match entry.target.kind() {
        Kind::Collision(j) => world.particles[j as usize].count != entry.partner_count,
        Kind::Wall(_) | Kind::Rest | Kind::Transfer(_) | Kind::Renewal => false,
    }
}

impl<F: Features, S: Search + 'static> Engine for Machine<F, S> {
    fn rebuild(&mut self, state: &mut State, geometry: &Geometry) {
        let State { world, book, pending } = state;
        let (world, pending) = (&*world, &*pending);
        let count = world.particles.len();
        let positions: Vec<_> =
            (0..count as u32).into_par_iter().map(|i| world.flight::<F>(i, world.now).0).collect();
        self.search = S::new(geometry, &positions);
        self.calendar.clear();
        self.ties.clear();
        self.stall = Stall::default();
        let search = &self.search;
        let kernel = self.scratch.kernel();
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
                self.memory[entry.owner as usize] = memory;
            }
            if entry.time < i64::MAX {
                self.calendar.push(entry);
            }
        }
    }

    fn is_idle(&self) -> bool {
        self.calendar.is_empty() && self.ties.is_empty()
    }

    fn advance(
        &mut self,
        state: &mut State,
        limit: &mut Limit,
        observer: &mut dyn Observer,
    ) -> Result<Stop, EngineError> {
        match (observer.wants_events(), self.scratch.kernel()) {
            (true, _) => self.run::<true>(state, limit, observer),
            (false, Kernel::Portable) => self.run::<false>(state, limit, observer),
            #[cfg(target_arch = "x86_64")]
            // SAFETY: `Kernel::Avx2` is made by `Kernel::choose` alone, after it has found the feature.
            (false, Kernel::Avx2) => unsafe { self.run_avx2::<false>(state, limit, observer) },
        }
    }
}
