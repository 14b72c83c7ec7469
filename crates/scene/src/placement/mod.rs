/*!
Where particles are at the start, and how fast: random numbers, packings, velocities, states of other
programs.

*What is here.* [`random`] has a stream of random numbers for each purpose, species and particle, [`packing`]
lattices and random packings, [`velocity`] velocities, [`grid`] tests of gaps, [`import`] which files are
read.

*What to change here.* A new packing or distribution.

*May import* `source`, `config` and `model`.

*Begin with* [`packing`].
*/

pub(crate) mod grid;
pub mod import;
pub(crate) mod packing;
pub(crate) mod random;
pub(crate) mod velocity;
