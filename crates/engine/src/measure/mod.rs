/*!
Measurements while a run goes on: the pressure tensor, the forces on walls, profiles, and correlations in
time.

A measurement receives every change of velocity ([`Exchange`]), takes states at its own times, and adds its
values to samples, rows of profiles or correlations. It never changes the state, so that no measurement
changes a trajectory. Without measurements none of this is called: the event loop then computes no
[`Exchange`].

*What is here.* [`totals`] are the energies and momenta of a state and their balance, [`sample`] a row of
observables, [`frame`] frames and the hash of a state; the other files are measurements.

*What to change here.* A new measurement is one more field of [`Measure`](crate::model::Measure) and a
[`Measurement`] in a file of its own.

*May import* all rooms below: `numerics` to `actions`.

*Begin with* [`Measurement`].
*/

mod correlations;
pub(crate) mod frame;
pub(crate) mod measurement;
pub(crate) mod measuring;
mod multiple_tau;
mod profiles;
pub(crate) mod sample;
mod stress;
pub(crate) mod totals;

pub(crate) use measurement::Measurement;
pub(crate) use measuring::{measurements, observe, take_flights};
