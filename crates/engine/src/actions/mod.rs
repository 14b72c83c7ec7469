/*!
What acts at stated times: drives, inlets and outlets, and scans that put grains to rest.

*What is here.* [`timed`] is the seam: an action has a next time, and changes particles at it. [`drive`] has
one file for each drive, [`flow`] inlets and outlets, [`settling`] the scans.

*What to change here.* A new drive: its data in `model/drive.rs`, and a file in `drive/` that implements
[`timed::TimedAction`] (copy `rescale.rs`), with its arm in `drive/actions.rs`. An action that is no drive is
added in `actions` of `simulation/run.rs`. A drive of another crate implements
[`Action`](crate::model::Action), and needs no edit here: `drive/action.rs` calls it.

*May import* all rooms below: `numerics` to `laws`.

*Begin with* [`timed`], then [`drive`].
*/

pub(crate) mod drive;
pub(crate) mod flow;
pub(crate) mod settling;
pub(crate) mod timed;
