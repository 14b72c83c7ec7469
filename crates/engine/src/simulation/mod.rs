/*!
The simulation: a state, an engine compiled for the features of the system, and the epochs of the clock.

*What is here.* [`Simulation`] is what callers use. [`epochs`] are those of its clock. [`choice`] decides
which search runs, [`change`] replaces particles, laws and walls on the way, [`checkpoint`] saves and
[`valid`] checks what is loaded. [`population`] is for particles that come and go. [`warnings`] says what a
scene will probably do.

*What to change here.* What the caller can ask of a run.

*May import* everything.

*Begin with* `Simulation::advance` in `run.rs`.
*/

pub(crate) mod bouncing;
pub(crate) mod change;
pub(crate) mod checkpoint;
pub(crate) mod choice;
pub(crate) mod clustering;
mod deforming;
mod epochs;
pub(crate) mod initial;
mod population;
mod present;
pub(crate) mod pressing;
pub(crate) mod run;
pub(crate) mod searches;
pub(crate) mod valid;
pub(crate) mod warnings;

pub use run::{Simulation, Until};
pub use searches::{SearchSupport, searches};

pub use bouncing::endless_bounces_warning;
pub use change::{Change, NewParticle};
pub use clustering::{clustering_warning, critical_length, suitable_contact_duration};
pub use initial::{initial_temperature, thermal_velocities};
pub use warnings::warnings;
