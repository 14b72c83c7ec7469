//! What can go wrong in a measurement.

use haff_engine::EngineError;

/// Why a measurement could not be made.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The method or the reference does not know a feature of the scene.
    #[error("{method} does not know {feature}")]
    Unsupported {
        /// Who cannot.
        method: String,
        /// What it cannot.
        feature: &'static str,
    },
    /// The engine has stopped.
    #[error(transparent)]
    Engine(#[from] EngineError),
    /// Another program has failed.
    #[error("{name}: {what}")]
    Peer {
        /// The peer's name.
        name: String,
        /// What it did.
        what: String,
    },
    /// The caller has asked to stop.
    #[error("interrupted")]
    Interrupted,
}
