/*!
What acts at stated times: drives, and scans that put grains to rest.

*What is here.* [`timed`] is the seam: an action has a next time, and changes particles at it. [`drive`] has
one file for each drive, [`settling`] the scans.

*What to change here.* A new drive: its data in `model/drive.rs`, and a file here that implements
[`timed::TimedAction`].

*May import* all rooms below: `numerics` to `laws`.

*Begin with* [`timed`], then [`drive`].
*/

pub(crate) mod drive;
pub(crate) mod settling;
pub(crate) mod timed;
