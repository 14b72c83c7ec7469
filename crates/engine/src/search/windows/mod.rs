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
*/

mod axes;
pub(crate) mod block;
mod blocks;
mod cells;
mod filter;
mod narrow_phase;
mod opening;
pub(crate) mod scheduler;
mod shear;
mod space;
pub(crate) mod steps;
mod tune;
mod walls;
mod window_event;
mod worker;

pub(crate) use scheduler::{Windows, can_run, can_share, is_profitable};
