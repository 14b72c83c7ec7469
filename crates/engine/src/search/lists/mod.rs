/*!
The scheduler with neighbor lists, for dense systems.

Like [`CalendarScheduler`](crate::search::calendar_scheduler::CalendarScheduler), it keeps for every particle
its earliest event. It differs in two points. The lists contain no periodic images ([`neighbor_lists`]).
Most members of a list are rejected in single precision, eight at a time ([`filter`]), from [compact
particles](crate::search::compact): only the pairs that can touch before the earliest event known so far are
predicted exactly ([`narrow_phase`]).

In a box that deforms coordinates deform with it ([`moving`]). Under gravity the [frame] of the filter falls
with the particles, so that their paths in it are straight. Lists do not fall, and bound how far a path
bends. Grains that rest on walls or are carried by them, and bodies of infinite mass, do not fall: the
filter leaves them out, and their pairs are predicted exactly, by the function that all pairs use. Particles
of very different sizes are in bins of different widths ([`levels`]).
*/

mod bins;
mod block;
mod filter;
mod frame;
mod levels;
mod moving;
mod narrow_phase;
mod neighbor_lists;
mod plan;
mod predictor;
pub(crate) mod scheduler;
mod sets;
pub(crate) mod step_data;
mod steps;
mod vector_predictor;

use crate::search::{entry, search_event::SearchEvent};

pub(crate) use scheduler::{ListSearch, ListedEvent};

pub(crate) use plan::{can_run, is_profitable};
pub(crate) use steps::can_share;

/// A calendar entry of this scheduler.
type Entry = entry::Entry<SearchEvent>;
/// The update of a list, before its particle leaves its skin sphere.
const UPDATE: SearchEvent = SearchEvent::Crossing(0);
