//! The writer thread: the only owner of the file.

use std::{
    sync::mpsc::RecvTimeoutError,
    time::{Duration, Instant},
};

use glam::DVec3;
use haff_engine::{Correlation, EventRecord, Frame, Quantity, Sample};

use crate::{
    checkpoint::{Progress, Saved, SlotHeader},
    clock::text,
    datasets::{Datasets, Observables},
    entered,
    error::{Context, RecordError},
    events::EVENT_CHUNK,
    file::WritableFile,
    header::{EARLIER, SUMMARY},
    pack::Packer,
    queue::{CHECKPOINT_BYTES, Consumer, Message},
};

/// Time between flushes without a checkpoint.
const FLUSH_EVERY: Duration = Duration::from_secs(1);
/// Longest time for which a flush is put off while other processes read the file. A checkpoint is not written
/// if the next one has come by then.
const PUT_OFF: Duration = Duration::from_secs(1);
/// Time after which a flush that was put off is tried again.
const TRY_AGAIN: Duration = Duration::from_millis(1);
/// Size from which a checkpoint is not put off [bytes]: it would take too much memory.
const LARGE_CHECKPOINT: usize = 8 << 20;
/// Frames are collected up to this many bytes: many small ones are written at once.
const FRAME_BATCH: usize = 1 << 20;
/// Largest number of samples collected before they are written; a flush writes them earlier.
const SAMPLE_BATCH: usize = 4096;
const WRITE: &str = "write";

/// State of the writer thread.
#[derive(Debug)]
pub(crate) struct Writer {
    datasets: Datasets,
    file: WritableFile,
    progress: Progress,
    frames: Vec<Frame>,
    samples: Vec<Sample>,
    /// Events that do not fill a chunk.
    events: Vec<EventRecord>,
    packer: Packer,
    /// Steps and times of rows whose values have been written, but not flushed.
    frame_clock: Vec<(i64, f64)>,
    sample_clock: Vec<(i64, f64)>,
    event_times: Vec<f64>,
    /// Correlations that are not in the file. They replace those there in place, so they wait for a flush.
    correlations: Vec<Correlation>,
    /// A checkpoint that is not in the file.
    checkpoint: Option<Saved>,
    /// Number of the last checkpoint, and the slot of the next.
    sequence: u64,
    next_slot: usize,
    /// Whether data have been recorded since the last flush.
    dirty: bool,
    flushed: Instant,
    /// Since when a flush has been put off.
    put_off: Option<Instant>,
}

impl Writer {
    /// A writer at the beginning of a file.
    pub fn new(file: WritableFile, datasets: Datasets) -> Self {
        Self {
            datasets,
            file,
            progress: Progress::default(),
            frames: Vec::new(),
            samples: Vec::new(),
            events: Vec::new(),
            packer: Packer::new(),
            frame_clock: Vec::new(),
            sample_clock: Vec::new(),
            event_times: Vec::new(),
            correlations: Vec::new(),
            checkpoint: None,
            sequence: 0,
            next_slot: 0,
            dirty: false,
            flushed: Instant::now(),
            put_off: None,
        }
    }

    /// Continues after a checkpoint, of everything as long as it was when it was taken.
    pub fn resume(mut self, saved: &Saved, next_slot: usize, sequence: u64) -> Result<Self, RecordError> {
        if let Err(error) = self.file.begin_change().and_then(|()| self.truncate(saved)) {
            return Err(self.file.abandon().err().unwrap_or(error));
        }
        // Freed space must not be reused while the index on disk still points to it.
        self.file.flush()?;
        self.progress = saved.progress;
        self.events.clone_from(&saved.tail);
        self.next_slot = next_slot;
        self.sequence = sequence;
        Ok(self)
    }

    /// Drops all rows after a checkpoint.
    fn truncate(&mut self, saved: &Saved) -> Result<(), RecordError> {
        let path = self.file.path().to_owned();
        self.file.remember(&self.datasets.cut_chunks(saved).doing(&path, WRITE)?)?;
        self.datasets.truncate(saved).doing(&path, WRITE)?;
        let parameters = self.file.root().group("parameters").doing(&path, WRITE)?;
        if parameters.link_exists(SUMMARY) {
            if parameters.link_exists(EARLIER) {
                parameters.unlink(EARLIER).doing(&path, WRITE)?;
            }
            parameters.relink(SUMMARY, EARLIER).doing(&path, WRITE)?;
        }
        Ok(())
    }

    /// Runs until the other end is dropped, the run is finished, or an error occurs.
    pub fn run(mut self, queue: &Consumer) {
        let end = self.process_messages(queue);
        let exists = self.file.is_published();
        let fail = |error: RecordError| queue.shared.fail(if exists { error } else { error.unpublished() });
        match end {
            Ok(Some((summary, complete))) => {
                if let Err(error) = self.finish(Some(&summary), complete) {
                    fail(error);
                }
            }
            Ok(None) => {
                if let Err(error) = self.finish(None, false) {
                    fail(error);
                }
            }
            Err(error) => {
                fail(error);
                drop(self);
                // The sender gets the error with its next call; until then it must not block.
                while let Ok((_, bytes)) = queue.receiver.recv() {
                    queue.done(bytes);
                }
            }
        }
    }

    fn process_messages(&mut self, queue: &Consumer) -> Result<Option<(String, bool)>, RecordError> {
        loop {
            match queue.receiver.recv_timeout(self.until_flush()) {
                Ok((message, bytes)) => {
                    let result = match message {
                        Message::Finish { summary, complete } => return Ok(Some((summary, complete))),
                        Message::Flush(answer) => {
                            let result = self.flush().and_then(|()| self.file.publish());
                            match &result {
                                // The receiver may have stopped waiting.
                                Ok(()) => drop(answer.send(())),
                                // The error must be stored before the missing reply is noticed.
                                Err(error) => queue.shared.fail(error.clone()),
                            }
                            result
                        }
                        Message::Events(events) => {
                            let result = self.add_events(&events);
                            queue.shared.recycle(events);
                            result
                        }
                        message => self.process(message),
                    };
                    queue.done(bytes);
                    result?;
                }
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => return Ok(None),
            }
            if self.dirty && (self.checkpoint.is_some() || self.flushed.elapsed() >= FLUSH_EVERY) {
                let due = *self.put_off.get_or_insert_with(Instant::now);
                if self.file.is_free() || due.elapsed() >= PUT_OFF {
                    self.flush()?;
                    self.file.publish()?;
                }
            }
        }
    }

    /// Time until the next attempt to flush.
    fn until_flush(&self) -> Duration {
        match (self.dirty, self.put_off) {
            (false, _) => FLUSH_EVERY,
            (true, None) => FLUSH_EVERY.saturating_sub(self.flushed.elapsed()),
            (true, Some(_)) => TRY_AGAIN,
        }
    }

    fn process(&mut self, message: Message) -> Result<(), RecordError> {
        match message {
            Message::Frame(frame) => {
                self.dirty = true;
                self.progress.frames += 1;
                let bytes = 60 * frame.position.len() * (self.frames.len() + 1);
                self.frames.push(frame);
                if bytes >= FRAME_BATCH { self.write_frames() } else { Ok(()) }
            }
            Message::Sample(sample) => {
                self.dirty = true;
                self.progress.samples += 1;
                self.samples.push(*sample);
                if self.samples.len() >= SAMPLE_BATCH { self.write_samples() } else { Ok(()) }
            }
            Message::Checkpoint(state) => {
                let large = state.position.len() * CHECKPOINT_BYTES > LARGE_CHECKPOINT;
                let (progress, tail) = (self.progress, self.events.clone());
                self.checkpoint = Some(Saved { sequence: 0, progress, state: *state, tail });
                self.dirty = true;
                if large || !self.file.is_published() {
                    self.flush()?;
                    self.file.publish()?;
                }
                Ok(())
            }
            Message::Profile(row) => {
                self.dirty = true;
                self.datasets.profiles.append(&row).doing(self.file.path(), WRITE)
            }
            Message::Correlations(correlations) => {
                self.dirty = true;
                self.correlations = correlations;
                Ok(())
            }
            Message::Entered(particles) => {
                self.dirty = true;
                entered::write(self.file.root(), &particles).doing(self.file.path(), WRITE)
            }
            // Handled by `process_messages`.
            Message::Events(_) | Message::Flush(_) | Message::Finish { .. } => Ok(()),
        }
    }

    fn write_frames(&mut self) -> Result<(), RecordError> {
        let frames = std::mem::take(&mut self.frames);
        let Some(trajectory) = &mut self.datasets.trajectory else { return Ok(()) };
        if frames.is_empty() {
            return Ok(());
        }
        let path = self.file.path();
        let (rows, packer) = (frames.iter(), &mut self.packer);
        let positions = rows.clone().map(|frame| frame.position.as_slice());
        trajectory.position.append_vectors(positions, |r| r.to_array(), packer).doing(path, WRITE)?;
        let velocities = rows.clone().map(|frame| frame.velocity.as_slice());
        trajectory.velocity.append_vectors(velocities, |v| v.to_array(), packer).doing(path, WRITE)?;
        if let Some(series) = &mut trajectory.angular_velocity {
            let spins = rows.clone().map(|frame| frame.angular_velocity.as_slice());
            series.append_vectors(spins, |spin| spin.to_array(), packer).doing(path, WRITE)?;
        }
        if let Some(series) = &mut trajectory.present {
            let present = rows.clone().map(|frame| frame.present.iter().map(|&present| u8::from(present)));
            series.append_rows(present, packer).doing(path, WRITE)?;
        }
        for (k, series) in trajectory.pistons.iter_mut().flatten().enumerate() {
            let states = rows.clone().map(|frame| frame.pistons.iter().flat_map(|state| state[k].to_array()));
            series.append_rows(states, packer).doing(path, WRITE)?;
        }
        let images = rows.map(|frame| frame.image.as_slice());
        trajectory.image.append_vectors(images, |image| image, packer).doing(path, WRITE)?;
        let sheared = trajectory.edges.width() == 9;
        let numbers = |frame: &Frame| match frame.edges {
            edges if sheared => edges.iter().flat_map(DVec3::to_array).collect(),
            [x, y, z] => vec![x.x, y.y, z.z],
        };
        let edges: Vec<f64> = frames.iter().flat_map(numbers).collect();
        trajectory.edges.append(&edges).doing(path, WRITE)?;
        self.frame_clock.extend(frames.iter().map(|frame| (frame.step as i64, frame.time)));
        Ok(())
    }

    fn write_samples(&mut self) -> Result<(), RecordError> {
        let samples = std::mem::take(&mut self.samples);
        let Some(Observables { series, sizes, .. }) = &mut self.datasets.observables else { return Ok(()) };
        for (series, quantity) in series {
            if let Quantity::Count(value) = *quantity {
                series.append(&samples.iter().map(|sample| value(sample) as i64).collect::<Vec<_>>())
            } else {
                let mut numbers = Vec::new();
                for sample in &samples {
                    quantity.append(sample, *sizes, &mut numbers);
                }
                series.append(&numbers)
            }
            .doing(self.file.path(), WRITE)?;
        }
        self.sample_clock.extend(samples.iter().map(|sample| (sample.step as i64, sample.time)));
        Ok(())
    }

    /// Writes whole chunks of events, and stores the rest.
    fn add_events(&mut self, mut events: &[EventRecord]) -> Result<(), RecordError> {
        self.dirty = true;
        self.progress.events += events.len();
        if !self.events.is_empty() {
            let (head, rest) = events.split_at(events.len().min(EVENT_CHUNK - self.events.len()));
            self.events.extend_from_slice(head);
            events = rest;
            if self.events.len() < EVENT_CHUNK {
                return Ok(());
            }
            let chunk = std::mem::take(&mut self.events);
            self.write_events(&chunk)?;
            self.events = chunk;
            self.events.clear();
        }
        let (chunks, rest) = events.as_chunks::<EVENT_CHUNK>();
        for chunk in chunks {
            self.write_events(chunk)?;
        }
        self.events.extend_from_slice(rest);
        Ok(())
    }

    /// Writes a chunk of events, or the last ones.
    fn write_events(&mut self, events: &[EventRecord]) -> Result<(), RecordError> {
        if let Some(columns) = &mut self.datasets.events {
            columns.append(events).doing(self.file.path(), WRITE)?;
            self.event_times.extend(events.iter().map(|event| event.time));
        }
        Ok(())
    }

    /// Writes everything except events that do not fill a chunk to the file: values first, then the times
    /// that complete the rows, then the header that makes a checkpoint valid, which must not count rows that
    /// are not in the file.
    fn flush(&mut self) -> Result<(), RecordError> {
        self.write_frames()?;
        self.write_samples()?;
        let header = self.fill_slot()?;
        self.file.begin_change()?;
        let correlations = std::mem::take(&mut self.correlations);
        self.datasets.correlations.write(&correlations).doing(self.file.path(), WRITE)?;
        self.file.write_out()?;
        if self.append_times()? {
            self.file.write_out()?;
        }
        if let Some(header) = header {
            self.datasets.slots[self.next_slot].seal(header).doing(self.file.path(), WRITE)?;
            self.file.write_out()?;
            self.next_slot = 1 - self.next_slot;
        }
        self.file.end_change()?;
        self.dirty = false;
        self.flushed = Instant::now();
        self.put_off = None;
        tracing::debug!(file = %self.file.path().display(), checkpoint = self.sequence, "flushed");
        Ok(())
    }

    /// Writes the content of a checkpoint; the result makes it valid.
    fn fill_slot(&mut self) -> Result<Option<SlotHeader>, RecordError> {
        let Some(mut saved) = self.checkpoint.take() else { return Ok(None) };
        self.sequence += 1;
        saved.sequence = self.sequence;
        self.datasets.slots[self.next_slot].fill(&saved).doing(self.file.path(), WRITE).map(Some)
    }

    /// Adds the times of the rows whose values have been flushed. Returns whether there were any.
    fn append_times(&mut self) -> Result<bool, RecordError> {
        let mut appended = false;
        let frames = self.datasets.trajectory.as_mut().map(|trajectory| &mut trajectory.clock);
        let samples = self.datasets.observables.as_mut().map(|observables| &mut observables.clock);
        // Samples first: MDAnalysis requires at least as many as frames.
        for (clock, rows) in [(samples, &mut self.sample_clock), (frames, &mut self.frame_clock)] {
            let Some(clock) = clock.filter(|_| !rows.is_empty()) else { continue };
            let (steps, times): (Vec<i64>, Vec<f64>) = rows.drain(..).unzip();
            clock.step.append(&steps).doing(self.file.path(), WRITE)?;
            clock.time.append(&times).doing(self.file.path(), WRITE)?;
            appended = true;
        }
        if let Some(columns) = &mut self.datasets.events
            && !self.event_times.is_empty()
        {
            columns.append_times(&self.event_times).doing(self.file.path(), WRITE)?;
            self.event_times.clear();
            appended = true;
        }
        appended |= self.datasets.profiles.append_times().doing(self.file.path(), WRITE)?;
        Ok(appended)
    }

    /// Writes all remaining data, and closes the file.
    fn finish(mut self, summary: Option<&str>, complete: bool) -> Result<(), RecordError> {
        if summary.is_none() && !self.file.is_published() && !self.dirty {
            // Nothing was recorded: the file is never published.
            return Ok(());
        }
        let events = std::mem::take(&mut self.events);
        if !events.is_empty() {
            self.write_events(&events)?;
        }
        self.flush()?;
        if let Some(summary) = summary {
            write_summary(self.file.root(), summary, complete).doing(self.file.path(), WRITE)?;
            self.file.flush()?;
        }
        self.file.publish()?;
        let Self { datasets, file, .. } = self;
        drop(datasets);
        file.close(summary.is_some())
    }
}

fn write_summary(root: &hdf5::Group, summary: &str, complete: bool) -> hdf5::Result<()> {
    let dataset = root
        .group("parameters")?
        .new_dataset::<hdf5::types::VarLenUnicode>()
        .obj_track_times(false)
        .create(SUMMARY)?;
    dataset.write_scalar(&text(summary)?)?;
    dataset.new_attr::<u8>().create("complete")?.write_scalar(&u8::from(complete))
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;
    use crate::{checkpoint::newest, common, info::Parameters, recorder::Recorder};

    /// Everything that a resumption changes before its first flush is put back if it fails.
    #[test]
    fn a_resumption_that_is_abandoned_leaves_the_file_as_it_was() {
        let directory = tempfile::tempdir().expect("a directory for the test");
        let path = directory.path().join("run.h5");
        // Small frames, samples and rows of profiles share chunks, which are cut where the checkpoint is.
        let recorder = Recorder::create(&path, common::header(5), false).expect("a file");
        for k in 0..7 {
            if k == 4 {
                recorder.checkpoint(common::checkpoint(1, 5)).expect("a checkpoint");
            }
            recorder.frame(common::frame(k, 5)).expect("a frame");
            recorder.sample(common::sample(k)).expect("a sample");
            recorder.profile(common::profile_row(0, 2 * k, 3)).expect("a row of a profile");
            recorder.events(common::events(3000 * k, 3000 * (k + 1))).expect("events");
        }
        recorder.finish("{}", false).expect("a stopped run");
        let before = fs::read(&path).expect("the file");

        let file = WritableFile::append(&path).expect("the file opens");
        let parameters = Parameters::read(file.root(), &path).expect("parameters");
        let datasets = Datasets::open(file.root(), 5, parameters.sizes()).expect("datasets");
        let saved = newest(&datasets.slots, |_| true).expect("slots").expect("a checkpoint");
        assert_eq!(saved.progress, Progress { frames: 4, samples: 4, events: 12_000 });
        let mut writer = Writer::new(file, datasets);
        writer.file.begin_change().expect("a change");
        writer.truncate(&saved).expect("rows are dropped");
        assert!(
            before != fs::read(&path).expect("the file"),
            "HDF5 has changed nothing: the test is inconclusive"
        );
        writer.file.abandon().expect("the file is put back");
        assert!(before == fs::read(&path).expect("the file"));
    }
}
