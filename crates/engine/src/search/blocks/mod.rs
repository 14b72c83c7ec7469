/*!
Events on several threads: space is cut into blocks, and time into steps.

In a step, each block takes the events that nothing unknown can have changed ([`front`]) from its own queue,
in the order of time, and leaves the others over. In a second round, blocks that reach from the middle of one
to the middle of the next do the same with these, and so on ([`cut`]); in the last round, a single block takes
the rest. A block changes only particles that are inside of it, and reads only what no other block changes:
[`crate::search::windows`] and [`crate::search::nearby`] say why for their data.

A prediction depends only on the anchors of two particles, and an impact only on those of its partners.
Therefore every order of events that respects causes gives the same bits. If an event of a later round is
where the front of an earlier one has not expected it, or a limit is exceeded, the step is undone, and tried
again with wider fronts or taken one event after the other.
*/

mod awake;
mod cut;
mod front;
pub(crate) mod grid;
mod ownership;
mod part;
pub(crate) mod rounds;
mod rows;
pub(crate) mod step;

pub(crate) use awake::with_awake_threads;
pub(crate) use cut::{Round, cut, divide};
pub(crate) use front::{Bounds, Dilations, Metric};
pub(crate) use ownership::Ownership;
pub(crate) use part::{Part, Place, Present, wrap_place};

#[cfg(test)]
pub(crate) mod tests;

pub(crate) use grid::Grid;
pub(crate) use rounds::{
    Block, DILATIONS, NO_BLOCK, Outcome, Settings, WorkingSpace, can_share, count_undone, end_step, may_keep,
    run_rounds,
};
pub(crate) use step::Step;
