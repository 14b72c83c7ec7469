//! The steps of a search by blocks, one after the other.

use crate::{
    report::Observer,
    search::{
        blocks::{DILATIONS, Metric, Outcome, with_awake_threads},
        event_loop::Limit,
    },
    state::State,
};

/// A search whose events blocks take in steps. It chooses the steps and keeps their events; [`take_steps`]
/// takes them by blocks, with wider fronts if that is needed, or leaves them to its queue.
pub(crate) trait Stepping {
    /// Chooses the next step and collects its events. `None` if there are no more steps: all events are
    /// then in the queue.
    fn begin_step(&mut self, state: &mut State, limit: &Limit) -> Option<NextStep>;

    /// Takes the events of the step by blocks with these fronts. If it is not taken, it has been undone.
    fn run_step(
        &mut self,
        state: &mut State,
        metric: Metric,
        limit: &mut Limit,
        observer: &mut dyn Observer,
        events: bool,
    ) -> Outcome;

    /// Ends the step. If it is not taken, its events are left to the queue.
    fn end_step(&mut self, is_taken: bool);

    /// Whether another step can follow before a limit of time.
    fn goes_on(&self, ticks: i64) -> bool;
}

/// A step that has been chosen.
pub(crate) struct NextStep {
    /// Its fronts, if blocks can take its events.
    pub(crate) metric: Option<Metric>,
    /// Whether it has no events.
    pub(crate) is_empty: bool,
}

/// Takes the events of the next steps, or leaves those of one step to the queue.
#[cold]
#[inline(never)]
pub(crate) fn take_steps(
    search: &mut impl Stepping,
    state: &mut State,
    limit: &mut Limit,
    observer: &mut dyn Observer,
    events: bool,
) {
    with_awake_threads(|| {
        while take_step(search, state, limit, observer, events)
            && search.goes_on(limit.ticks)
            && state.accumulators.counters.collisions < limit.collisions
            && limit.entries > 0
        {}
    });
}

/// Takes the events of the next step. Returns false if they have to be taken one after the other.
fn take_step(
    search: &mut impl Stepping,
    state: &mut State,
    limit: &mut Limit,
    observer: &mut dyn Observer,
    events: bool,
) -> bool {
    let Some(step) = search.begin_step(state, limit) else { return false };
    let mut outcome = if step.is_empty { Outcome::Taken } else { Outcome::Unexpected };
    for factor in DILATIONS {
        let Some(metric) = step.metric.filter(|_| outcome == Outcome::Unexpected) else { break };
        outcome = search.run_step(state, metric.widened(factor), limit, observer, events);
    }
    let is_taken = outcome == Outcome::Taken;
    search.end_step(is_taken);
    is_taken
}

/// Near a limit of collisions, how many events of a step are less than what is expected up to it.
pub(crate) fn part_before(limit: &Limit, state: &State) -> usize {
    let remaining = limit.collisions.saturating_sub(state.accumulators.counters.collisions);
    usize::try_from(remaining / 4 * 3).unwrap_or(usize::MAX)
}
