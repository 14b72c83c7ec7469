//! Errors of a linkage, and of its run.

use haff_engine::{EngineError, Fault};

/// An invalid linkage, or a run that cannot continue. Indices are rows of [`crate::Joints`] and of the
/// particles.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum LinkageError {
    /// A parameter out of its range.
    #[error("{element} {index}: {key} = {value} {allowed}")]
    Parameter {
        /// `pendulum`, `spring`, `rod` or `sticking`.
        element: &'static str,
        /// Row among its kind.
        index: usize,
        /// Name of the parameter.
        key: &'static str,
        /// Its value.
        value: f64,
        /// What is allowed, as the end of a sentence.
        allowed: &'static str,
    },
    /// A particle that does not exist.
    #[error("{element} {index}: there is no particle {particle}; there are {particles}")]
    NoParticle {
        /// Which kind of element.
        element: &'static str,
        /// Row among its kind.
        index: usize,
        /// The row that was given.
        particle: usize,
        /// Number of particles.
        particles: usize,
    },
    /// An element between a particle and itself, or between two points.
    #[error("{element} {index}: {what}")]
    Ends {
        /// Which kind of element.
        element: &'static str,
        /// Row among its kind.
        index: usize,
        /// What is wrong.
        what: &'static str,
    },
    /// Bodies that do not satisfy the constraint of their pendulum or rod.
    #[error("{element} {index}: its ends are {distance} apart, its length is {length}; {allowed}")]
    Distance {
        /// `pendulum` or `rod`.
        element: &'static str,
        /// Row among its kind.
        index: usize,
        /// Distance of its ends \[length\].
        distance: f64,
        /// Its length \[length\].
        length: f64,
        /// What is allowed.
        allowed: &'static str,
    },
    /// Velocities that violate the constraint of a pendulum or rod.
    #[error(
        "{element} {index}: its ends separate at {rate} [length/time]; the velocities must keep their distance"
    )]
    Stretching {
        /// `pendulum` or `rod`.
        element: &'static str,
        /// Row among its kind.
        index: usize,
        /// d(distance)/dt [length/time].
        rate: f64,
    },
    /// More constraints than the bodies have degrees of freedom.
    #[error(
        "{element} {index} holds what other pendulums and rods hold already: its bodies are over-constrained"
    )]
    OverConstrained {
        /// `pendulum` or `rod`.
        element: &'static str,
        /// Row among its kind.
        index: usize,
    },
    /// A pair of groups that is declared to stick twice.
    #[error("the contact of groups {0} and {1} is declared to stick twice")]
    Twice(u32, u32),
    /// A property of the system that linkages do not support.
    #[error("{0}")]
    Unsupported(&'static str),
    /// Infinitely many events in a finite time that no closed form completes.
    #[error(
        "{events} events at t = {time}, the last of particle {particle}: an impact among several bodies that does not come to an end"
    )]
    Collapse {
        /// Time of the last event [time].
        time: f64,
        /// Number of events.
        events: u64,
        /// A particle taking part.
        particle: usize,
    },
    /// Particles overlap by more than rounding: as in the granular engine.
    #[error(transparent)]
    Overlap(EngineError),
    /// No step of the integrator satisfies its tolerance.
    #[error("the motion of particle {particle} cannot be integrated at t = {time}: it is singular there")]
    Singular {
        /// Time of the failure [time].
        time: f64,
        /// A particle taking part.
        particle: usize,
    },
    /// A checkpoint of another system or version.
    #[error("the checkpoint does not fit: {0}")]
    Checkpoint(String),
}

impl LinkageError {
    /// The class of the error, for the caller.
    pub fn fault(&self) -> Fault {
        match self {
            Self::Collapse { .. } | Self::Overlap(_) | Self::Singular { .. } => Fault::Stopped,
            Self::Checkpoint(_) => Fault::Checkpoint,
            Self::Parameter { .. }
            | Self::NoParticle { .. }
            | Self::Ends { .. }
            | Self::Distance { .. }
            | Self::Stretching { .. }
            | Self::OverConstrained { .. }
            | Self::Twice(..)
            | Self::Unsupported(_) => Fault::Invalid,
        }
    }
}
