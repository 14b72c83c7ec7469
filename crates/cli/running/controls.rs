//! Controls and displays of a run in progress.

use crate::terminal::{progress::Progress, signals::Signals};

/// Signals and displays of a run.
pub struct Controls<'a> {
    /// Signals that end it.
    pub signals: &'a Signals,
    /// Shows the progress.
    pub progress: Progress,
    /// Whether to show samples.
    pub watch: bool,
}
