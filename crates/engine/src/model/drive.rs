//! Drives: what acts on species at stated times.

use super::action::NamedAction;

/// A drive that acts on some species.
#[derive(Debug, Clone, PartialEq)]
pub struct Drive {
    /// How it acts.
    pub kind: DriveKind,
    /// Species that it acts on, as indices into [`System::species`]. It never acts on bodies of infinite
    /// mass.
    pub species: Vec<u32>,
    /// Whether it also acts on the angular velocities: each degree of freedom of the rotation gets what one
    /// of the translation gets. Only with spin, and not for a drive of another crate.
    pub rotational: bool,
}

/// How a drive acts.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum DriveKind {
    /// At regular times, all velocities relative to the center of mass of the driven particles are multiplied
    /// by one factor, so that their temperature becomes a given one; on all axes, also where the temperature
    /// of samples contains the motion of the center of mass.
    Rescale {
        /// Temperature after each action \[energy\].
        temperature: f64,
        /// Time between actions \[time\].
        interval: f64,
    },
    /// As `Rescale`, at intervals that follow the heating: short enough that the temperature changes by
    /// about a fifth of itself between two actions.
    Hold {
        /// Temperature after each action \[energy\].
        temperature: f64,
        /// Longest time between actions \[time\].
        longest: f64,
    },
    /// At the times of a Poisson process, each particle gets a velocity from a Maxwell distribution.
    Andersen {
        /// Temperature of the distribution \[energy\].
        temperature: f64,
        /// Mean number of kicks per particle and time [1/time].
        rate: f64,
    },
    /// Random changes of velocity: the variance of each component grows by `strength` in a unit of time.
    WhiteNoise {
        /// ξ₀² [length²/time³].
        strength: f64,
        /// When the kicks are.
        kicks: KickTimes,
    },
    /// A drive that another crate adds.
    Named(&'static NamedAction),
}

/// Times of the kicks of white noise.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum KickTimes {
    /// For each particle the times of a Poisson process.
    Poisson {
        /// Mean number of kicks per particle and time [1/time].
        rate: f64,
    },
    /// All particles at once. Their momentum is kept.
    Regular {
        /// Time between kicks \[time\].
        interval: f64,
    },
}
