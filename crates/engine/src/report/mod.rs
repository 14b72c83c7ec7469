/*!
The output of a simulation as plain data: events, frames, samples, counters and checkpoints.

*What is here.* [`Observer`] receives events and changes of velocity; [`Frame`], [`Sample`] and
[`Checkpoint`] are what a caller asks for. `ledger` has the terms of the balance of energies, [`observables`]
names, units and formulas of all columns of samples, [`totals`] the numbers of a whole run, `mean` means of
series with their errors. The recorder, reports and Python take names, units and signs from these tables.

*What to change here.* A new observable is a row of [`observables`]; a value that [`Sample`] does not have
yet is a field of it, too, computed in `measure/sample.rs` and `linkage/src/simulation.rs` and read back in
`record/src/info.rs`. A new term of the balance is a variant of [`Term`]. A new kind of event is a variant of
[`EventKind`] with its place in `ALL` and its name, which files take from there; what causes it is in
`laws/event.rs`, its labels in `python/haff/figures` and `docs/format.md`.

*May import* `numerics` and `model`.

*Begin with* [`Observer`] and [`EventRecord`].
*/

pub(crate) mod checkpoint;
pub(crate) mod compressed;
pub(crate) mod correlation;
pub(crate) mod event;
pub(crate) mod ledger;
pub(crate) mod mean;
pub(crate) mod observables;
pub(crate) mod observer;
pub(crate) mod sample;
pub(crate) mod stress_tensor;
pub(crate) mod totals;

pub use crate::model::{Exchange, Partner, VelocityChange};
pub use checkpoint::Checkpoint;
pub use compressed::Compressed;
pub use correlation::{CORRELATIONS, Correlation, CorrelationKind};
pub(crate) use event::row;
pub use event::{EventColumn, EventKind, EventRecord, NO_PARTNER};
pub use mean::Mean;
pub(crate) use observer::with_ids;
pub use observer::{CellFields, Observer, ProfileRow, Silent};
pub use sample::{BlockCounts, Counters, Frame, Sample, Stop};

pub use ledger::{LARGEST_RESIDUAL, Ledger, Term, residual_warning};
pub use observables::{NO_MEANS, Observable, Quantity, SceneFeatures, Sizes, observables};
pub use stress_tensor::StressTensor;
pub use totals::{RUN_NUMBERS, Total, counts, energies, total_names, totals};
