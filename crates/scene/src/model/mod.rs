/*!
What a valid scene is: system, plans of the run and its output, and states that it starts from.

*What is here.* [`scene`] is the result of this crate; [`state`] where recorded states come from, [`present`]
the one that a changed run goes on from, [`schedule`] has the times of records.

*What to change here.* A checked value that the command needs.

*May import* other crates only.

*Begin with* [`scene::Scene`].
*/

pub(crate) mod present;
pub(crate) mod scene;
pub(crate) mod schedule;
pub(crate) mod state;
