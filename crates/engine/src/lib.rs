//! Event-driven hard-sphere engine.
//!
//! A [`System`] (validated elsewhere) becomes a [`Simulation`], which runs from event to event and hands what
//! happens to an [`Observer`]. The engine knows neither scene files nor output files.

pub mod model;
pub mod report;

pub use model::{Body, Boundary, Class, Contacts, Dimension, Domain, Group, NeighborChoice, Options, SimdChoice, System, Wall};
pub use report::{Checkpoint, Counters, EventKind, EventRecord, Frame, Ledger, Observer, Sample, Stop};
