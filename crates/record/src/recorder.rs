//! The simulation's side of the writer.

use std::{
    path::{Path, PathBuf},
    sync::mpsc::sync_channel,
    thread::{self, JoinHandle},
};

use haff_engine::{Checkpoint, EventRecord, Frame, Sample};

use crate::{
    checkpoint::misfit,
    error::{Context, RecordError},
    file::WritableFile,
    header::Header,
    queue::{CHECKPOINT_BYTES, FRAME_BYTES, Message, Producer, queue},
    skeleton::Skeleton,
    writer::Writer,
};

/// Writes a run to a file, on a thread of its own.
///
/// Every call hands its data over and returns; it waits only while the queue to the disk is full (64 MiB). Errors of
/// the disk show at the next call, and at the latest in [`Recorder::finish`]; after one, nothing more is written, and
/// what had been flushed stays readable. The file is flushed about once a second, with every checkpoint, and on
/// request. Rows that the [`Header`] does not ask for are dropped.
///
/// Dropping a recorder writes everything handed over and closes the file, without a summary; the run can be resumed.
#[derive(Debug)]
pub struct Recorder {
    producer: Option<Producer>,
    thread: Option<JoinHandle<()>>,
    path: PathBuf,
    wants: Wants,
}

/// What the file has a place for.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Wants {
    /// N.
    pub particles: usize,
    /// Number of species; `None` if their temperatures are not recorded.
    pub species: Option<usize>,
    pub frames: bool,
    pub observables: bool,
    pub events: bool,
}

impl Recorder {
    /// Begins a file.
    ///
    /// The new file is begun beside `path` and moved there with its first flush, which the first checkpoint causes:
    /// with `overwrite`, an old file stays until then.
    ///
    /// # Errors
    ///
    /// [`RecordError::Exists`] if there is a file and `overwrite` is false, [`RecordError::InUse`] if another process
    /// is writing it, [`RecordError::NotAFile`] if `path` is something else, [`RecordError::Unfit`] if the header
    /// names no particles or its arrays differ in length, [`RecordError::Io`] and [`RecordError::Full`] if the
    /// system refuses.
    #[expect(
        clippy::needless_pass_by_value,
        reason = "made for this one call, like the other data handed over"
    )]
    pub fn create(path: impl AsRef<Path>, header: Header, overwrite: bool) -> Result<Self, RecordError> {
        let path = path.as_ref();
        check(path, &header)?;
        let mut file = WritableFile::create(path, overwrite)?;
        let skeleton = Skeleton::create(file.root(), &header).doing(path, "create the file")?;
        // Also before space that the making of the datasets has freed is used again.
        file.flush()?;
        let wants = Wants {
            particles: header.species.len(),
            species: Some(header.species_names.len()).filter(|&count| header.observables && count > 0),
            frames: header.frames,
            observables: header.observables,
            events: !header.events.is_empty(),
        };
        Self::start(path, Writer::new(file, skeleton, header.box_size), wants)
    }

    /// A recorder whose writer works.
    pub(crate) fn start(path: &Path, writer: Writer, wants: Wants) -> Result<Self, RecordError> {
        let (producer, consumer) = queue();
        let thread = thread::Builder::new()
            .name("haff-record".to_owned())
            .spawn(move || writer.work(&consumer))
            .doing(path, "start the writer")?;
        Ok(Self { producer: Some(producer), thread: Some(thread), path: path.to_owned(), wants })
    }

    /// A recorder of a complete run, to which nothing can be added.
    pub(crate) fn closed(path: &Path) -> Self {
        Self { producer: None, thread: None, path: path.to_owned(), wants: Wants::default() }
    }

    /// The path of the file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    fn send(&self, message: Message) -> Result<(), RecordError> {
        match &self.producer {
            Some(producer) => producer.send(message, &self.path),
            None => Err(RecordError::Complete { path: self.path.clone() }),
        }
    }

    fn unfit(&self, reason: String) -> RecordError {
        RecordError::Unfit { path: self.path.clone(), reason }
    }

    /// Adds a frame of all N particles.
    pub fn frame(&self, frame: Frame) -> Result<(), RecordError> {
        let lengths = [frame.position.len(), frame.velocity.len(), frame.image.len()];
        if self.producer.is_some() && lengths != [self.wants.particles; 3] {
            let [positions, velocities, images] = lengths;
            return Err(self.unfit(format!(
                "a frame of {positions} positions, {velocities} velocities and {images} images; the file has {} \
                 particles",
                self.wants.particles
            )));
        }
        if self.wants.frames || self.producer.is_none() { self.send(Message::Frame(frame)) } else { Ok(()) }
    }

    /// Adds the frame that `take` makes, when there is room for it: a large system then has no more than one frame in
    /// memory at a time. It is not made if frames are not recorded.
    pub fn frame_with(&self, take: impl FnOnce() -> Frame) -> Result<(), RecordError> {
        match &self.producer {
            Some(producer) if self.wants.frames => {
                producer.wait(FRAME_BYTES * self.wants.particles)?;
                self.frame(take())
            }
            Some(_) => Ok(()),
            None => self.send(Message::Frame(Frame::default())),
        }
    }

    /// Adds a row of observables.
    pub fn sample(&self, sample: Sample) -> Result<(), RecordError> {
        let found = sample.species_temperature.len();
        if let Some(species) = self.wants.species.filter(|&species| species != found) {
            return Err(self.unfit(format!("temperatures of {found} species; the file has {species}")));
        }
        if self.wants.observables || self.producer.is_none() {
            self.send(Message::Sample(sample))
        } else {
            Ok(())
        }
    }

    /// An empty buffer for rows of [`Recorder::events`]: one that has been written before, where there is one, so that
    /// its memory is warm.
    pub fn event_buffer(&self) -> Vec<EventRecord> {
        self.producer.as_ref().map_or_else(Vec::new, Producer::spare)
    }

    /// Adds rows to the event log.
    pub fn events(&self, events: Vec<EventRecord>) -> Result<(), RecordError> {
        if self.wants.events || self.producer.is_none() { self.send(Message::Events(events)) } else { Ok(()) }
    }

    /// Keeps a checkpoint beside the one before it, and flushes the file. A resumed run goes on from here: frames,
    /// samples and events handed over before this call stay, later ones are dropped then.
    pub fn checkpoint(&self, state: Checkpoint) -> Result<(), RecordError> {
        if self.producer.is_some()
            && let Some(reason) = misfit(&state, self.wants.particles)
        {
            return Err(self.unfit(reason));
        }
        self.send(Message::Checkpoint(Box::new(state)))
    }

    /// Keeps the checkpoint that `take` makes, when there is room for it; see [`Recorder::checkpoint`].
    pub fn checkpoint_with(&self, take: impl FnOnce() -> Checkpoint) -> Result<(), RecordError> {
        if let Some(producer) = &self.producer {
            producer.wait(CHECKPOINT_BYTES * self.wants.particles)?;
        }
        self.checkpoint(take())
    }

    /// Returns when everything handed over so far is in the file, but for events that do not fill a chunk.
    pub fn flush(&self) -> Result<(), RecordError> {
        let (answer, done) = sync_channel(1);
        self.send(Message::Flush(answer))?;
        done.recv().map_err(|_| match &self.producer {
            Some(producer) => producer.ended(&self.path),
            None => RecordError::Complete { path: self.path.clone() },
        })
    }

    /// Writes everything, with a summary of the run (JSON text), and closes the file once the disk has it.
    ///
    /// `complete`: the run has come to its end; otherwise it was stopped and can be resumed from its last checkpoint.
    pub fn finish(mut self, summary: &str, complete: bool) -> Result<(), RecordError> {
        self.send(Message::Finish { summary: summary.to_owned(), complete })?;
        self.join()
    }

    /// Waits for the writer to end.
    fn join(&mut self) -> Result<(), RecordError> {
        let shared = self.producer.take();
        let Some(thread) = self.thread.take() else { return Ok(()) };
        let shared = shared.map(Producer::close);
        let ended = thread.join();
        match (shared.and_then(|shared| shared.error()), ended) {
            (Some(error), _) => Err(error),
            (None, Ok(())) => Ok(()),
            (None, Err(_)) => Err(RecordError::Io {
                path: self.path.clone(),
                action: "write",
                reason: "the writer failed".to_owned(),
            }),
        }
    }
}

impl Drop for Recorder {
    fn drop(&mut self) {
        // Whoever wants to know of errors calls `finish`.
        let _ = self.join();
    }
}

fn check(path: &Path, header: &Header) -> Result<(), RecordError> {
    let particles = header.species.len();
    let lengths = [particles, header.mass.len(), header.radius.len()];
    let texts = [&header.scene_toml, &header.title, &header.version, &header.git_revision];
    let mut texts = texts.into_iter().chain(&header.species_names).chain(&header.wall_names);
    let reason = if particles == 0 {
        "a run without particles".to_owned()
    } else if u32::try_from(particles).is_err() {
        format!("{particles} particles; at most {} can be", u32::MAX)
    } else if lengths != [particles; 3] {
        format!(
            "{} species, {} masses and {} radii: one of each per particle",
            lengths[0], lengths[1], lengths[2]
        )
    } else if let Some(text) = texts.find(|text| text.contains('\0')) {
        format!("text with a NUL character: {text:?}")
    } else {
        return Ok(());
    };
    Err(RecordError::Unfit { path: path.to_owned(), reason })
}
