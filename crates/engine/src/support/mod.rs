/*!
Which bodies touch: contacts, gaps and overlaps of a whole state, by grids of its own.

*What is here.* [`grid`] finds all pairs within a distance, independently of the searches of a run;
[`contacts`] says which grains support each other; [`overlap`] finds the deepest overlap, and the bound that
rounding allows; [`geometry`] is the input of all searches for partners, with open axes
bounded by containers ([`enclosure`]).

*What to change here.* The condition under which a grain is supported.

*May import* `numerics`, `model`, `report`, `state` and `motion`.

*Begin with* [`grid`].
*/

pub(crate) mod contacts;
pub(crate) mod enclosure;
pub(crate) mod geometry;
pub(crate) mod grid;
pub(crate) mod overlap;

pub use overlap::Overlap;
