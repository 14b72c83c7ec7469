//! What can be wrong with a linkage, and what can stop its run.

use haff_engine::{EngineError, Fault};

/// A linkage that cannot be, or a run that cannot go on. Indices are rows of [`crate::Joints`] and of the particles.
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
        /// The row that was asked for.
        particle: usize,
        /// How many there are.
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
    /// Bodies that are not where their pendulum or rod would hold them.
    #[error("{element} {index}: its ends are {distance} apart, its length is {length}; {allowed}")]
    Distance {
        /// `pendulum` or `rod`.
        element: &'static str,
        /// Row among its kind.
        index: usize,
        /// How far its ends are apart \[length\].
        distance: f64,
        /// Its length \[length\].
        length: f64,
        /// What is allowed.
        allowed: &'static str,
    },
    /// Velocities that a pendulum or rod does not allow.
    #[error(
        "{element} {index}: its ends part at {rate} [length/time]; the velocities must keep their distance"
    )]
    Stretching {
        /// `pendulum` or `rod`.
        element: &'static str,
        /// Row among its kind.
        index: usize,
        /// d(distance)/dt [length/time].
        rate: f64,
    },
    /// More constraints than the bodies have freedom.
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
    /// Something of the system that linkages do not know.
    #[error("{0}")]
    Unsupported(&'static str),
    /// Infinitely many events in a finite time that no closed form completes.
    #[error(
        "{events} events at t = {time}, the last of particle {particle}: an impact among several bodies that does not come to an end"
    )]
    Collapse {
        /// When [time].
        time: f64,
        /// How many events.
        events: u64,
        /// A particle taking part.
        particle: usize,
    },
    /// Particles overlap by more than rounding comes to: as in the granular engine.
    #[error(transparent)]
    Overlap(EngineError),
    /// No step of the integrator meets its tolerance.
    #[error("the motion of particle {particle} cannot be integrated at t = {time}: it is singular there")]
    Singular {
        /// When [time].
        time: f64,
        /// A particle taking part.
        particle: usize,
    },
    /// A checkpoint of another system or version.
    #[error("the checkpoint does not fit: {0}")]
    Checkpoint(String),
}

impl LinkageError {
    /// What the error means for whoever asked.
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
