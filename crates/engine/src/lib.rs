//! Event-driven hard-sphere engine.
//!
//! A [`System`], validated by the caller, becomes a [`Simulation`]. It advances from event to event and
//! passes each event to an [`Observer`]. The engine does not depend on the formats of scene files and output
//! files.

pub mod bounds;
pub mod model;
pub mod report;

#[cfg(test)]
extern crate self as haff_engine; // tests/common builds its systems with the public interface

mod accumulators;
mod batch;
mod blocks;
mod bouncing;
mod calendar_scheduler;
mod carried;
mod center;
mod change;
mod checkpoint;
mod choice;
mod clock;
mod clustering;
mod compact;
mod contact_times;
mod drive;
mod entry;
mod error;
mod event;
mod event_loop;
mod exact_sum;
#[cfg(test)]
mod examples;
mod features;
mod flights;
mod force;
mod grid;
mod hop;
mod initial;
mod instant;
mod ledger;
mod measure;
mod measurements;
mod nearby;
mod number;
mod observables;
mod overlap;
mod packed;
mod pair_flight;
mod pair_law;
mod particles;
mod periodicity;
mod predict;
mod queue;
mod random;
mod resolve;
mod rest;
mod rough;
mod scalars;
mod search_event;
mod series;
mod sharing;
mod shear;
mod simulation;
mod slide;
mod spin;
mod stall;
mod state;
mod sum;
mod summary;
mod thermal;
mod timed;
mod totals;
mod tuning;
mod valid;
mod wall_change;
mod wall_impact;
mod wall_law;
mod wall_motion;
mod warnings;
mod windows;

pub use bouncing::endless_bounces_warning;
pub use center::{common_velocity, conserved_momentum, initial_temperature};
pub use change::{Change, NewParticle};
pub use clustering::{
    clustering_warning, critical_length, rest_speed_of_diameter, suitable_contact_duration,
};
pub use error::{EngineError, Fault};
pub use initial::thermal_velocities;
pub use instant::Instant;
pub use ledger::{LARGEST_RESIDUAL, Ledger, Term, residual_warning};
pub use measurements::{
    CORRELATIONS, Correlation, CorrelationKind, Correlations, Grid, GridAxis, Measure, StressTensor,
};
pub use model::{
    Body, Boundary, Class, Contacts, Dimension, Domain, Drive, DriveKind, Group, Hole, KickTimes,
    NeighborChoice, Options, Oscillating, Partition, SimdChoice, Spin, System, Wall, WallLaw, WallMotion,
};
pub use number::significant;
pub use observables::{Observable, Present, Quantity, Sizes, observables};
pub use overlap::{Overlap, allowed_overlap};
pub use report::{
    BlockCounts, Checkpoint, Counters, EventColumn, EventKind, EventRecord, Exchange, Frame, NO_PARTNER,
    Observer, Partner, ProfileRow, Sample, Silent, Stop, VelocityChange,
};
pub use scalars::{ScalarReader, ScalarWriter};
pub use shear::Shear;
pub use simulation::{Simulation, Until};
pub use sum::Sum;
pub use thermal::ThermalWall;
pub use totals::{RUN_NUMBERS, Total, counts, energies, total_names, totals};
pub use wall_motion::{ConstantVelocity, WallTime};
pub use warnings::warnings;

/// Version of the trajectories. A release that changes the trajectory of any scene raises it.
pub const TRAJECTORY_VERSION: u32 = 6;
