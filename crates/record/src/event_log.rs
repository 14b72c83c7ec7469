//! What a run hands to the writer between its records: rows of events, in batches, and rows of profiles.

use haff_engine::{EventRecord, Observer, ProfileRow};

use crate::{error::RecordError, recorder::Recorder};

/// Event rows sent to the writer at once.
const BATCH: usize = 1 << 13;

/// An observer that passes what it receives to a recorder, events in batches.
#[derive(Debug)]
pub struct EventLog<'a> {
    recorder: Option<&'a Recorder>,
    enabled: bool,
    rows: Vec<EventRecord>,
    error: Option<RecordError>,
}

impl<'a> EventLog<'a> {
    /// Without a recorder nothing is kept. `enabled`: rows of events are wanted.
    pub fn new(recorder: Option<&'a Recorder>, enabled: bool) -> Self {
        Self { recorder, enabled: enabled && recorder.is_some(), rows: Vec::new(), error: None }
    }

    /// Sends all rows to the writer.
    ///
    /// # Errors
    /// The file cannot be written any more.
    pub fn hand_over(&mut self) -> Result<(), RecordError> {
        if let (Some(recorder), false) = (self.recorder, self.rows.is_empty()) {
            // A buffer whose memory is already mapped; it is sent when full, so it never grows.
            let mut empty = recorder.event_buffer();
            empty.reserve(BATCH);
            recorder.events(std::mem::replace(&mut self.rows, empty))?;
        }
        self.check()
    }

    /// Returns an error of sending rows that occurred while events ran.
    ///
    /// # Errors
    /// The file cannot be written any more.
    pub fn check(&mut self) -> Result<(), RecordError> {
        self.error.take().map_or(Ok(()), Err)
    }
}

impl Observer for EventLog<'_> {
    fn wants_events(&self) -> bool {
        self.enabled
    }

    fn profile(&mut self, row: ProfileRow) {
        if let Some(recorder) = self.recorder
            && self.error.is_none()
        {
            self.error = recorder.profile(row).err();
        }
    }

    fn event(&mut self, event: &EventRecord) {
        self.rows.push(*event);
        if self.rows.len() >= BATCH
            && self.error.is_none()
            && let Err(error) = self.hand_over()
        {
            self.error = Some(error);
        }
    }
}
