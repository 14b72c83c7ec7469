/*!
How accurate the engine is, and what other methods pay for their accuracy.

* [`reference`]: the same physics in arithmetic of hundreds of bits, all pairs, no cleverness: what every trajectory is
  judged by. [`closed`] has scenes whose end is known in closed form, by which the reference is judged.
* [`methods`]: ways to integrate a scene behind one trait: the engine, a fixed-step hard-sphere stepper, a soft-sphere
  integrator, and other programs.
* [`trial`]: run time against error of one method on one scene.
* [`growth`]: how fast rounding errors grow in a chaotic gas, and what of them is the engine's own.
* [`statistics`]: pressure and Haff's cooling rate from a fixed budget of time.
*/

pub mod closed;
pub mod growth;
pub mod methods;
pub mod reference;
pub mod scenes;
pub mod statistics;
pub mod trial;

mod big;
mod error;

pub use big::{Big, BigVec, big};
pub use error::Error;
