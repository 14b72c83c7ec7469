/*!
The searches for the next event, and the loop that takes events from them.

*What is here.* [`event_loop`] is the loop, the same for all searches; a search implements its `Scheduler`.
[`calendar_scheduler`] runs everything, with the cells or all pairs of `haff_neighbors`; [`windows`] and
[`lists`] (of neighbors) are faster and support less. [`blocks`] shares steps of windows and lists among
threads, [`sharing`] decides how many threads are worth it, and [`parallel`] has their loops. [`matrix`]
says what each search can run.
[`predict`] and [`batch`] are the predictions of pairs, [`planes`] filters walls, [`queue`] keeps one
[`entry`] for each particle, with the [`search_event`] that it stands for, and [`ties`] those of one tick;
[`pistons`] adds contacts with pistons to the calendar; [`moving`] has the axes of frames that deform with the
box; [`summary`] and [`case`] describe a state and a scene to a search.

*What to change here.* How fast an event is found, and which images of a new boundary a search visits. No
search may change which event is found: all give the same bits, since predictions are pure functions of two
anchors, and ties have one order.

*May import* `numerics` to `laws`, not `actions` and `measure`.

*Begin with* [`event_loop`], then [`calendar_scheduler`].
*/

pub(crate) mod batch;
pub(crate) mod blocks;
pub(crate) mod calendar_scheduler;
pub(crate) mod carried;
pub(crate) mod case;
pub(crate) mod compact;
pub(crate) mod earliest;
pub(crate) mod entry;
pub(crate) mod event_loop;
pub(crate) mod lists;
pub(crate) mod matrix;
pub(crate) mod moving;
pub(crate) mod parallel;
pub(crate) mod pistons;
pub(crate) mod planes;
pub(crate) mod predict;
pub(crate) mod queue;
pub(crate) mod search_event;
pub(crate) mod sharing;
pub(crate) mod summary;
mod ties;
pub(crate) mod windows;
