/*!
The scheduler for time windows: it has no cell crossings, and it reads memory in order.

Time is divided into windows. At the start of a window, every particle is registered in all cells that its
path through the window touches ([`cells`]). Pairs that could touch before the window ends are found cell by
cell ([`filter`]) and predicted from their anchors ([`narrow_phase`]). All contacts within the window are
added to the queue. Events are resolved in the order of time. The particles of an event are registered along
their new paths and predicted again, up to the end of the window. An invalidated event needs no successor: all
other contacts of its particles are already in the queue.

Particles are stored in *slots*, which are sorted by cell every few windows, so that neighbors in space are
close in memory. The length of windows and the width of cells are tuned during the run ([`tune`]).

Every particle is registered in all cells that its path through the window touches, so a search reads the
cells of its own path only. Coordinates (`search/windows/axes.rs`) are 32-bit integers, 2^32 to a periodic
edge: differences wrap to the nearest image. The filter rejects in single precision, eight candidates at a
time, pairs that cannot touch within the window; contact distances are widened by a margin for rounding,
which grows with the square of the longest displacement. Pairs that pass are predicted exactly, from anchors
(`search/windows/narrow_phase.rs`). Walls are predicted exactly only for particles whose distance bound
reaches them (`search/planes.rs`). What filters read of a particle, here and in `lists`, is a
`CompactParticle` (`compact`): 32-bit coordinates and a displacement in single precision. All contacts of the
window go into the `WindowQueue`: those known at its start sorted by counting, later ones in lists. An
event's particles are registered along their new paths and searched up to the window's end, so an invalidated
entry needs no successor. Particles stand in slots sorted by cell. The length of windows and the width of
cells are tuned by counted work, not by the clock: every run makes the same choices everywhere. A particle
that gets too fast for the window ends it early, and so do very many searches. Under gravity windows fall:
positions are relative to a frame that has been falling since the window began, so paths are straight. A
particle that comes to rest on a wall no longer falls: the scheduler then pauses as `Pause::Unsupported`, and
cells go on. There are never many more cells than particles: where a box is mostly empty, the grid is folded
onto itself (`Axes::fold`), and the filter rejects what is far away. The bins of `lists` are folded in the
same way.
*/

mod axes;
pub(crate) mod block;
mod blocks;
mod cells;
mod filter;
mod moving;
mod narrow_phase;
mod opening;
pub(crate) mod scheduler;
mod space;
pub(crate) mod steps;
mod tune;
mod window_event;
mod worker;

pub(crate) use scheduler::{Windows, can_run, can_share, is_profitable};
