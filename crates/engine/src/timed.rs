//! Actions at stated times: settling scans, thermostats, whatever acts on the particles other than by their
//! events.

use haff_neighbors::Geometry;

use crate::{error::EngineError, report::Observer, state::State};

/// An action at stated times. The event loop runs up to the earliest one, and every scheduler predicts again
/// what it has changed.
pub(crate) trait TimedAction: Send {
    /// When the action is due next \[ticks\]; `i64::MAX` for never.
    fn next(&self, state: &State) -> i64;

    /// Carries the action out at the present. Returns the particles whose anchors it has set.
    fn apply(
        &mut self,
        state: &mut State,
        geometry: &Geometry,
        observer: &mut dyn Observer,
    ) -> Result<Vec<u32>, EngineError>;

    /// Writes what a resumed run needs beside the state.
    fn save(&self, _put: &mut dyn FnMut(&str, u64)) {}

    /// Reads what [`Self::save`] has written in a run that is resumed at `time`.
    fn load(&mut self, _take: &mut dyn FnMut(&str) -> u64, _time: f64) -> Result<(), EngineError> {
        Ok(())
    }
}
