/*!
Numbers: time as integers, sums, limits that were measured, and errors.

*What is here.* [`clock`] and [`instant`] hold time as an integer number of ticks, [`exact_sum`] sums whose
value does not depend on the order of their terms, [`sum`] compensated ones, [`total`] sums over particles by
several threads, [`scalars`] and [`words`] what checkpoints store of all of them, [`tuning`] the numbers of
particles and the densities at which another search is faster, [`error`] what can go wrong in a run.

*What to change here.* A new error is a variant of `EngineError`. A limit in [`tuning`] follows from a
measurement, which its comment names. Nothing else changes with new physics.

*May import* other crates only: no particle, wall or system is known here.

*Begin with* [`clock`], then [`exact_sum`]: that runs with any number of threads have the same bits rests on
them.
*/

pub(crate) mod clock;
pub(crate) mod error;
pub(crate) mod exact_sum;
pub(crate) mod instant;
pub(crate) mod number;
pub(crate) mod scalars;
pub(crate) mod sum;
pub(crate) mod tensor;
pub(crate) mod total;
pub(crate) mod tuning;
pub(crate) mod words;

pub use error::{EngineError, Fault};
pub use instant::Instant;
pub use number::significant;
pub use scalars::{ScalarReader, ScalarWriter};
pub use sum::Sum;
