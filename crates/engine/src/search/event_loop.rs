//! The event loop of all schedulers: take the earliest event from the scheduler, resolve it, and let the
//! scheduler predict the changed particles.

use haff_neighbors::Geometry;

use crate::{
    laws::{
        contact::note_tie,
        event::{Pause, PhysicalEvent},
    },
    model::features::Features,
    numerics::error::EngineError,
    report::{Observer, Silent},
    search::batch::Kernel,
    state::State,
};

/// The bounds of one run of the event loop.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Limit {
    /// Up to and including this time [ticks].
    pub ticks: i64,
    /// Up to this total of collisions.
    pub collisions: u64,
    /// At most this many calendar entries; counted down.
    pub entries: u64,
}

/// The result of [`Scheduler::next`].
pub(crate) enum Next<E> {
    /// The earliest event, and its time \[ticks\].
    Event(i64, E),
    /// There is no event up to the limit of time.
    Nothing,
    /// Updates of the scheduler's own data have used up the limit of entries.
    Interrupted,
    /// [`Scheduler::take_steps`] must follow.
    Step,
}

/// Finds the events of a state in the order of time.
///
/// `VECTORS`: the caller is compiled for AVX2 and FMA, and the processor supports them.
pub(crate) trait Scheduler: Send {
    /// The features of the particles.
    type Features: Features;
    /// The events that can occur.
    type Event: PhysicalEvent;

    /// Whether rows of events are always computed, to compile one loop less: for searches of very few
    /// particles.
    const ALWAYS_ROWS: bool = false;

    /// The kernel of predictions.
    fn kernel(&self) -> Kernel;
    /// Predicts every particle from the present state.
    fn rebuild(&mut self, state: &mut State, geometry: &Geometry);
    /// Predicts every particle where only velocities have changed, and keeps the search's own data. Returns
    /// false, with nothing done, if this search cannot.
    fn predict_again(&mut self, _: &mut State) -> bool {
        false
    }
    /// Finds the earliest event up to `limit`, and carries out the updates of the scheduler's own data before
    /// it.
    fn next<const VECTORS: bool>(&mut self, state: &mut State, limit: &mut Limit) -> Next<Self::Event>;
    /// Takes several events at once, on several threads, after [`Next::Step`].
    fn take_steps(&mut self, _: &mut State, _: &mut Limit, _: &mut dyn Observer, _events: bool) {}
    /// Predicts the particles of an event that has been resolved, and the grains that it has `woken`.
    fn update<const VECTORS: bool>(
        &mut self,
        state: &mut State,
        event: Self::Event,
        woken: &[u32],
        limit: &mut Limit,
    ) -> Option<Pause>;
    /// Predicts these particles. Their anchors have been set to the present by something other than an event.
    fn reschedule(&mut self, state: &mut State, bodies: &[u32]);
    /// Why events are taken on one thread; `None` if they are taken on all.
    fn serial_reason(&self, _: &State) -> Option<&'static str> {
        Some("this search takes events on one thread")
    }
    /// Prepares for more threads than before.
    fn use_more_threads(&mut self, _: &State) {}
    /// Whether there is no further event at any time.
    fn is_idle(&self) -> bool;
    /// Adds the work done since the last call to the counters of the state.
    fn count_work(&mut self, state: &mut State);
}

/// A scheduler with its event loop, behind one virtual call per slice of events.
pub(crate) trait Engine: Send {
    /// Predicts every particle from the present state.
    fn rebuild(&mut self, state: &mut State, geometry: &Geometry);
    /// Predicts every particle where only velocities have changed, and keeps the search's own data. Returns
    /// false, with nothing done, if this search cannot.
    fn predict_again(&mut self, state: &mut State) -> bool;
    /// Predicts these particles. Their anchors have been set to the present by something other than an event.
    fn reschedule(&mut self, state: &mut State, bodies: &[u32]);
    /// Why events are taken on one thread; `None` if they are taken on all.
    fn serial_reason(&self, state: &State) -> Option<&'static str>;
    /// Prepares for more threads than before.
    fn use_more_threads(&mut self, state: &State);
    /// Whether there is no further event at any time.
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

    fn predict_again(&mut self, state: &mut State) -> bool {
        let done = Scheduler::predict_again(self, state);
        self.count_work(state);
        done
    }

    fn reschedule(&mut self, state: &mut State, bodies: &[u32]) {
        Scheduler::reschedule(self, state, bodies);
        self.count_work(state);
    }

    fn serial_reason(&self, state: &State) -> Option<&'static str> {
        Scheduler::serial_reason(self, state)
    }

    fn use_more_threads(&mut self, state: &State) {
        Scheduler::use_more_threads(self, state);
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
            #[cfg(not(target_arch = "x86_64"))]
            (Kernel::Portable, false) => run::<S, false, false>(self, state, limit, observer),
            #[cfg(not(target_arch = "x86_64"))]
            (Kernel::Portable, true) => run::<S, true, false>(self, state, limit, observer),
            #[cfg(target_arch = "x86_64")]
            (Kernel::Portable, false) => run_portable(self, state, limit, &mut Silent),
            #[cfg(target_arch = "x86_64")]
            (Kernel::Portable, true) => run_portable(self, state, limit, observer),
            #[cfg(target_arch = "x86_64")]
            // SAFETY: only `Kernel::choose` makes this kernel, after it has found that the processor supports
            // the instructions.
            (Kernel::Avx2, false) => unsafe { run_without_rows(self, state, limit, observer) },
            #[cfg(target_arch = "x86_64")]
            // SAFETY: as above.
            (Kernel::Avx2, true) => unsafe { run_avx2::<S, true>(self, state, limit, observer) },
        };
        self.count_work(state);
        pause
    }
}

/// [`run`] for the portable kernel, compiled less often: it is rare on x86-64, so that it always computes
/// rows of events, and there are no engines of it for particles of one size.
#[cfg(target_arch = "x86_64")]
fn run_portable<S: Scheduler>(
    scheduler: &mut S,
    state: &mut State,
    limit: &mut Limit,
    observer: &mut dyn Observer,
) -> Result<Pause, EngineError> {
    if S::Features::UNIFORM {
        unreachable!("`Choice::is_uniform` excludes it");
    }
    run::<S, true, false>(scheduler, state, limit, observer)
}

/// [`run`], compiled as a whole for processors with 256-bit vectors. The bits are the same, because Rust
/// neither fuses nor reorders floating-point operations. Only the filters in single precision use fused
/// operations.
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

/// [`run_avx2`] where no rows are asked for.
///
/// # Safety
/// The processor supports the features of [`run_avx2`].
#[cfg(target_arch = "x86_64")]
unsafe fn run_without_rows<S: Scheduler>(
    scheduler: &mut S,
    state: &mut State,
    limit: &mut Limit,
    observer: &mut dyn Observer,
) -> Result<Pause, EngineError> {
    if S::ALWAYS_ROWS {
        // SAFETY: guaranteed by the caller.
        return unsafe { run_avx2::<S, true>(scheduler, state, limit, &mut Silent) };
    }
    // SAFETY: as above.
    unsafe { run_avx2::<S, false>(scheduler, state, limit, observer) }
}

/// Counts an event at `time`, which is also that of the event before or of an action, if it is a simultaneous
/// contact.
#[cold]
#[inline(never)]
fn look_for_tie<E: PhysicalEvent>(state: &mut State, event: E, time: i64) {
    if event.is_contact() {
        note_tie(state, &event.participants().0, time);
    }
}

/// Runs events up to `limit`. `EVENTS`: the observer receives them.
#[inline(always)]
fn run<S: Scheduler, const EVENTS: bool, const VECTORS: bool>(
    scheduler: &mut S,
    state: &mut State,
    limit: &mut Limit,
    observer: &mut dyn Observer,
) -> Result<Pause, EngineError> {
    // Of the event before, or of an action.
    let mut last = state.world.now;
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
            Next::Step => {
                scheduler.take_steps(state, limit, observer, EVENTS);
                continue;
            }
        };
        limit.entries -= 1;
        state.world.now = state.world.now.max(time);
        state.stall.count_event(&state.world, time, || event.participants())?;
        if time == last {
            look_for_tie(state, event, time);
        }
        last = time;
        let woken = event.resolve::<S::Features, EVENTS>(state, time, observer)?;
        if let Some(pause) = scheduler.update::<VECTORS>(state, event, &woken, limit) {
            return Ok(pause);
        }
        if let Some(pause) = event.pause::<S::Features>(state, time) {
            return Ok(pause);
        }
    }
}
