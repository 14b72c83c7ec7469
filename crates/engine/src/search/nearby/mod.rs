/*!
The scheduler with neighbor lists for fluids without gravity in boxes with periodic or bounded axes.

Like [`CalendarScheduler`](crate::search::calendar_scheduler::CalendarScheduler), it keeps for every particle
its earliest event. It differs in two points. The lists contain no periodic images ([`lists`]). Most members
of a list are rejected in single precision, eight at a time ([`filter`]), from [compact
particles](crate::search::compact): only the pairs that can touch before the earliest event known so far are
predicted exactly ([`narrow_phase`]).
*/

mod bins;
mod block;
mod filter;
mod frame;
mod list_event;
mod lists;
mod narrow_phase;
mod plan;
mod predictor;
pub(crate) mod scheduler;
mod sets;
pub(crate) mod step_data;
mod steps;

pub(crate) use scheduler::Nearby;

pub(crate) use plan::{can_run, is_wide};
pub(crate) use steps::can_share;
