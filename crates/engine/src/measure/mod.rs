/*!
What is measured: samples and frames, and, while a run goes on, the pressure tensor, profiles and
correlations in time. Forces on walls are sums of the state (`state/wall_sums.rs`).

A measurement receives the changes of velocity of impacts ([`Exchange`](crate::report::Exchange)), takes
states at its own times, and adds its values to samples, rows of profiles or correlations. It never changes
the state, so that no measurement changes a trajectory. Without measurements and observers of events the
event loop computes no exchange.

*What is here.* [`totals`] are the energies and momenta of a state and their balance, [`sample`] a row of
observables, [`frame`] frames and the hash of a state; [`measuring`] makes the measurements of a system,
`stress`, `profiles` and `correlations`, and passes events to them.

*What to change here.* A new measurement is a field of [`Measure`](crate::model::Measure), a [`Measurement`]
in a file here, and a line of `measurements` (`measuring.rs`). It receives exchanges and states, not rows of
the event log. One number for each sample: a field of `Sample`, set in `complete`, and a row of
`report/observables.rs`. Rows at its own times: a method of `Observer` as `profile` is, passed on in
`measuring.rs`, queued in `cli/running/session.rs`, written in `record/src/measured.rs`.

A measurement of another crate implements [`Probe`](crate::model::Probe), which adds columns to samples and
needs no edit here: `probing` calls it.

*May import* all rooms below: `numerics` to `actions`.

*Begin with* [`Measurement`].
*/

mod correlations;
pub(crate) mod frame;
pub(crate) mod measurement;
pub(crate) mod measuring;
mod multiple_tau;
mod pair_rates;
mod probing;
mod profiles;
pub(crate) mod sample;
mod stress;
pub(crate) mod totals;

pub(crate) use measurement::Measurement;
pub(crate) use measuring::{measurements, observe, take_flights};
