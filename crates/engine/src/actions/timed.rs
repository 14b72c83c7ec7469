//! Actions at stated times: settling scans, thermostats, and whatever else changes particles outside of their
//! own events.

use haff_neighbors::Geometry;

use crate::{numerics::error::EngineError, report::Observer, state::State};

/// An action at stated times. The event loop runs up to the earliest one. The scheduler then predicts again
/// the particles that the action has changed.
///
/// The order within one tick is: events that are already known, actions, the events that follow from them,
/// and so on until no action and no event is left; then measurements; then the caller takes samples and
/// frames.
pub(crate) trait TimedAction: Send {
    /// The next time of the action \[ticks\]; `i64::MAX` for never.
    fn next(&self, state: &State) -> i64;

    /// Applies the action at the present, with the ids of particles in events (`report::with_ids`). Returns
    /// the particles whose anchors it has set.
    fn apply(
        &mut self,
        state: &mut State,
        geometry: &Geometry,
        observer: &mut dyn Observer,
    ) -> Result<Vec<u32>, EngineError>;

    /// Whether it will set something in motion, so that a system at rest goes on.
    fn brings(&self) -> bool {
        false
    }

    /// Saves the action's own data, which a resumed run needs beside the state.
    fn save(&self, _put: &mut dyn FnMut(&str, u64)) {}

    /// Loads what [`Self::save`] has saved, in a run that is resumed at `time`.
    fn load(&mut self, _take: &mut dyn FnMut(&str) -> u64, _time: f64) -> Result<(), EngineError> {
        Ok(())
    }
}
