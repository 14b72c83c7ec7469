/*!
Events on several threads: space is cut into blocks, and time into steps.

In a step, each block takes the events that nothing unknown can have changed ([`front`]) from its own queue,
in the order of time, and leaves the others over. In a second round, blocks that reach from the middle of one
to the middle of the next do the same with these, and so on ([`cut`]); in the last round, a single block takes
the rest. A block changes only particles that are inside of it, and reads only what no other block changes:
[`crate::search::windows`] and [`crate::search::lists`] say why for their data.

A prediction depends only on the anchors of two particles, and an impact only on those of its partners.
Therefore every order of events that respects causes gives the same bits. If an event of a later round is
where the front of an earlier one has not expected it, or a limit is exceeded, the step is undone, and tried
again with wider fronts or taken one event after the other.

Threads share what can be split without changing a bit: blocks of particles, cells and windows, put together
in order. The thread that runs the events is one of rayon's (`cli/commands/run.rs`; `sharing` decides from
measured rates whether it works alone): it does its part instead of waiting. No other thread may therefore
use this pool; the writer does not, and the runs of a sweep have pools of their own. In large systems windows
and lists take events on several threads (`search/blocks/`, docs/parallel.md): the grid is cut into blocks
(`search/blocks/cut.rs`), time into steps. A block takes the events that nothing unknown can have changed, by
a front that moves with the largest speed (`search/blocks/front.rs`), and leaves the others to blocks that
reach across its faces, then to a single one. What a search adds is a `Block` and its steps:
`search/windows/blocks.rs` (steps of a window; particles registered in none but a block's cells),
`search/lists/steps.rs` (a calendar for each block; updates of lists are left over like events). A
prediction depends on two anchors and an impact on those of its partners (`resolve::collide`), and sums over
events are exact (`ExactSums`), so that every order of events that respects causes has the same bits. Rows of
events are put in order at the end of a step (`search/blocks/rows.rs`). If an event of a later round is where
a front has not expected it, the step is undone and tried with wider fronts, then in order.
*/

mod awake;
mod cut;
mod driver;
mod front;
pub(crate) mod grid;
mod ownership;
mod part;
pub(crate) mod rounds;
mod rows;
pub(crate) mod step;

pub(crate) use awake::with_awake_threads;
pub(crate) use cut::{Round, cut, divide};
pub(crate) use driver::{NextStep, Stepping, part_before, take_steps};
pub(crate) use front::{Bounds, Dilations, Metric};
pub(crate) use ownership::Ownership;
pub(crate) use part::{Part, Place, RoundView, wrap_place};

#[cfg(test)]
pub(crate) mod tests;

pub(crate) use grid::Grid;
pub(crate) use rounds::{
    Block, DILATIONS, NO_BLOCK, Outcome, Settings, WorkingSpace, can_share, conclude, run_rounds,
};
pub(crate) use step::Step;
