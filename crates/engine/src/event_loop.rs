//! The event loop, one for all schedulers: take the earliest event, resolve it, have the scheduler predict
//! what it has changed.

use haff_neighbors::Geometry;

use crate::{
    batch::Kernel,
    error::EngineError,
    event::{Pause, PhysicalEvent},
    features::Features,
    report::Observer,
    state::State,
};

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

/// What a scheduler has found.
pub(crate) enum Next<E> {
    /// The earliest event, and its time \[ticks\].
    Event(i64, E),
    /// No event up to the limit of time.
    Nothing,
    /// Updates of the scheduler's own data have used up the limit of entries.
    Interrupted,
}

/// Finds the events of a state in the order of time.
///
/// `VECTORS` tells that the caller is compiled for AVX2 and FMA, and runs where they exist.
pub(crate) trait Scheduler: Send {
    /// What the particles are like.
    type Features: Features;
    /// The events that there can be.
    type Event: PhysicalEvent;

    /// The kernel that predictions run on.
    fn kernel(&self) -> Kernel;
    /// Predicts every particle from the present state.
    fn rebuild(&mut self, state: &mut State, geometry: &Geometry);
    /// The earliest event up to `limit`, with updates of the scheduler's own data that are due before.
    fn next<const VECTORS: bool>(&mut self, state: &mut State, limit: &mut Limit) -> Next<Self::Event>;
    /// Predicts the particles of an event that has been resolved, and those that it has `woken`.
    fn update<const VECTORS: bool>(
        &mut self,
        state: &mut State,
        event: Self::Event,
        woken: &[u32],
        limit: &mut Limit,
    ) -> Option<Pause>;
    /// Predicts these particles, whose anchors something other than an event has set to the present.
    fn reschedule(&mut self, state: &mut State, bodies: &[u32]);
    /// Whether no event is due at any time.
    fn is_idle(&self) -> bool;
    /// Adds the work done since the last call to the counters of the state.
    fn count_work(&mut self, state: &mut State);
}

/// A scheduler with its event loop, behind one virtual call per slice of events.
pub(crate) trait Engine: Send {
    /// Predicts every particle from the present state.
    fn rebuild(&mut self, state: &mut State, geometry: &Geometry);
    /// Predicts these particles, whose anchors something other than an event has set to the present.
    fn reschedule(&mut self, state: &mut State, bodies: &[u32]);
    /// Whether no event is due at any time.
    fn is_idle(&self) -> bool;
    /// Runs events.
    fn advance(
        &mut self,
        state: &mut State,
        limit: &mut Limit,
        observer: &mut dyn Observer,
    ) -> Result<Pause, EngineError>;
}

impl<S: Scheduler> Engine for S {
    fn rebuild(&mut self, state: &mut State, geometry: &Geometry) {
        Scheduler::rebuild(self, state, geometry);
        self.count_work(state);
    }

    fn reschedule(&mut self, state: &mut State, bodies: &[u32]) {
        Scheduler::reschedule(self, state, bodies);
        self.count_work(state);
    }

    fn is_idle(&self) -> bool {
        Scheduler::is_idle(self)
    }

    fn advance(
        &mut self,
        state: &mut State,
        limit: &mut Limit,
        observer: &mut dyn Observer,
    ) -> Result<Pause, EngineError> {
        let pause = match (self.kernel(), observer.wants_events()) {
            (Kernel::Portable, false) => run::<S, false, false>(self, state, limit, observer),
            (Kernel::Portable, true) => run::<S, true, false>(self, state, limit, observer),
            #[cfg(target_arch = "x86_64")]
            // SAFETY: made by `Kernel::choose` alone, after it has found the instructions.
            (Kernel::Avx2, false) => unsafe { run_avx2::<S, false>(self, state, limit, observer) },
            #[cfg(target_arch = "x86_64")]
            // SAFETY: as above.
            (Kernel::Avx2, true) => unsafe { run_avx2::<S, true>(self, state, limit, observer) },
        };
        self.count_work(state);
        pause
    }
}

/// [`run`], compiled as a whole for processors with 256-bit vectors. Rust neither fuses nor reorders
/// floating-point operations by itself, so the bits are the same; only the filters in single precision use
/// fused operations.
#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt,popcnt")]
fn run_avx2<S: Scheduler, const EVENTS: bool>(
    scheduler: &mut S,
    state: &mut State,
    limit: &mut Limit,
    observer: &mut dyn Observer,
) -> Result<Pause, EngineError> {
    run::<S, EVENTS, true>(scheduler, state, limit, observer)
}

/// Runs events up to `limit`; `EVENTS` tells whether the observer wants rows.
#[inline(always)]
fn run<S: Scheduler, const EVENTS: bool, const VECTORS: bool>(
    scheduler: &mut S,
    state: &mut State,
    limit: &mut Limit,
    observer: &mut dyn Observer,
) -> Result<Pause, EngineError> {
    loop {
        if state.accumulators.counters.collisions >= limit.collisions {
            return Ok(Pause::Collisions);
        }
        if limit.entries == 0 {
            return Ok(Pause::Entries);
        }
        let (time, event) = match scheduler.next::<VECTORS>(state, limit) {
            Next::Event(time, event) => (time, event),
            Next::Nothing => {
                state.world.now = state.world.now.max(limit.ticks);
                return Ok(Pause::Time);
            }
            Next::Interrupted => return Ok(Pause::Entries),
        };
        limit.entries -= 1;
        state.world.now = state.world.now.max(time);
        state.stall.watch(&state.world, time, || event.participants())?;
        let woken = event.resolve::<S::Features, EVENTS>(state, time, observer)?;
        if let Some(pause) = scheduler.update::<VECTORS>(state, event, &woken, limit) {
            return Ok(pause);
        }
        if let Some(pause) = event.pause::<S::Features>(state, time) {
            return Ok(pause);
        }
    }
}
