//! Errors of a measurement.

use haff_engine::EngineError;

/// Reason why a measurement failed.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The method or the reference does not support a feature of the scene.
    #[error("{method} does not support {feature}")]
    Unsupported {
        /// Name of the method.
        method: String,
        /// The unsupported feature.
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
        /// Description of the failure.
        what: String,
    },
    /// The caller requested a stop.
    #[error("interrupted")]
    Interrupted,
}
