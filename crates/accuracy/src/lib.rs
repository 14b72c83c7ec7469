/*!
Accuracy of the engine, and cost of accuracy in other methods.

* [`reference`]: the same physics in arithmetic of hundreds of bits, for all pairs, as simple as possible: the
  standard for every trajectory. [`closed`] has scenes with closed-form solutions, which are the standard for
  the reference.
* [`methods`]: integration methods behind one trait: the engine, a fixed-step hard-sphere stepper, a
  soft-sphere integrator, and other programs.
* [`trial`]: run time against error of one method on one scene.
* [`growth`]: growth of rounding errors in a chaotic gas, and the part due to the engine.
* [`statistics`]: pressure and Haff's cooling rate from a fixed budget of time.
*/

pub mod closed;
pub mod growth;
pub mod methods;
pub mod reference;
pub mod scenes;
mod series;
pub mod statistics;
pub mod trial;

mod big;
mod error;

pub use big::{Big, BigVec, big};
pub use error::Error;
