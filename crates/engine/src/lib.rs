//! Event-driven hard-sphere engine.
//!
//! A [`System`], validated by the caller, becomes a [`Simulation`]. It advances from event to event and
//! passes each event to an [`Observer`]. The engine does not depend on the formats of scene files and output
//! files.
//!
//! # As a library
//!
//! | to | begin with |
//! |---|---|
//! | describe a system | [`System`]; `haff_scene::parse` makes one of the text of a scene, with all checks |
//! | run it | [`Simulation::new`], [`Simulation::advance`] to a bound of [`Until`] |
//! | look at it | [`Simulation::frame`], [`Simulation::sample`], [`Simulation::ledger`]; each event by an [`Observer`] |
//! | change it on the way | [`Simulation::change`] |
//! | save and resume it | [`Simulation::checkpoint`], [`Simulation::restore`]; `haff_record` writes files |
//! | add a law of contact, a surface, a drive or a measurement | `ContactLaw` and [`model::Surface`] of `haff_mechanics`, [`Action`], [`Probe`] |
//! | the whole command with what you add | `haff_cli::main_with` |
//!
//! Equal systems give equal bits, whatever the search, the number of threads and the machine.

mod numerics;

pub mod model;

pub mod report;

mod state;

mod motion;

mod support;

mod laws;

mod actions;

mod measure;

mod search;

mod simulation;

#[cfg(test)]
mod examples;
#[cfg(test)]
extern crate self as haff_engine; // tests/suite/common builds its systems with the public interface

pub use laws::hop::hopping_walls;
pub use model::bounds::allowed_overlap;
pub use model::{
    Action, Body, Boundary, Class, Column, Compression, ConstantVelocity, Contacts, Correlations, Cuboid,
    Dimension, Domain, Drag, Drive, DriveKind, DrivenParticles, Flow, Followed, Grid, GridAxis, Group, Hole,
    Inlet, KickTimes, Measure, NamedAction, NamedProbe, NeighborChoice, Options, Oscillating, Outlet,
    Particles, Partition, Piston, Probe, Rotation, Shape, Shear, Shrinking, SimdChoice, Spin, Supply, System,
    ThermalWall, Wall, WallLaw, WallMotion, WallTime, bounds, common_velocity, conserved_momentum,
    named_action, rest_speed_of_diameter,
};
pub use numerics::{EngineError, Fault, Instant, ScalarReader, ScalarWriter, Sum, significant};
pub use report::{
    BlockCounts, CORRELATIONS, CellFields, Checkpoint, Compressed, Correlation, CorrelationKind, Counters,
    EventColumn, EventKind, EventRecord, Exchange, Frame, LARGEST_RESIDUAL, Ledger, Mean, NO_MEANS,
    NO_PARTNER, Observable, Observer, Partner, ProfileRow, Quantity, RUN_NUMBERS, Sample, SceneFeatures,
    Silent, Sizes, Stop, StressTensor, Term, Total, VelocityChange, counts, energies, observables,
    residual_warning, total_names, totals,
};
pub use simulation::{
    Change, NewParticle, SearchSupport, Simulation, Until, clustering_warning, critical_length,
    endless_bounces_warning, initial_temperature, searches, suitable_contact_duration, thermal_velocities,
    warnings,
};
pub use support::Overlap;

/// Version of the trajectories. A release that changes the trajectory of any scene raises it.
pub const TRAJECTORY_VERSION: u32 = 8;
