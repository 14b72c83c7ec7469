//! The simulation's side of the writer.

use std::{
    path::{Path, PathBuf},
    sync::mpsc::sync_channel,
    thread::{self, JoinHandle},
};

use haff_engine::{Checkpoint, Correlation, EventRecord, Frame, ProfileRow, Sample};

use crate::{
    checkpoint::mismatch,
    datasets::Datasets,
    entered::Entered,
    error::{Context, RecordError},
    file::WritableFile,
    header::Header,
    queue::{CHECKPOINT_BYTES, FRAME_BYTES, Message, Producer, queue},
    writer::Writer,
};

/// Writes a run to a file, on a separate thread.
///
/// Every call passes its data to the writer and returns; it waits only while the queue to the disk is full
/// (64 MiB). Errors of the disk are returned by the next call, at the latest by [`Recorder::finish`]; after
/// one, nothing more is written, and data flushed before stay readable. The file is flushed about once a
/// second, with every checkpoint, and on request. Rows that the [`Header`] does not include are dropped.
///
/// Dropping a recorder writes all data passed to it and closes the file, without a summary; the run can be
/// resumed.
#[derive(Debug)]
pub struct Recorder {
    producer: Option<Producer>,
    thread: Option<JoinHandle<()>>,
    path: PathBuf,
    contents: Contents,
}

/// The data that the file contains.
#[derive(Debug, Clone, Copy, Default)]
#[expect(clippy::struct_excessive_bools, reason = "each part is there or not")]
pub(crate) struct Contents {
    /// N.
    pub particles: usize,
    /// Number of species; `None` if their temperatures are not recorded.
    pub species: Option<usize>,
    /// Number of walls; `None` if the forces on them are not recorded.
    pub walls: Option<usize>,
    pub frames: bool,
    pub observables: bool,
    pub events: bool,
    /// Number of profiles.
    pub profiles: usize,
    /// Number of pistons.
    pub pistons: usize,
    /// Whether there are angular velocities.
    pub spin: bool,
    /// Whether particles come and go.
    pub flow: bool,
}

impl Recorder {
    /// Creates a file.
    ///
    /// The new file is created beside `path` and moved there with its first flush, which the first checkpoint
    /// causes: with `overwrite`, an old file stays until then.
    ///
    /// # Errors
    ///
    /// [`RecordError::Exists`] if there is a file and `overwrite` is false, [`RecordError::InUse`] if another
    /// process is writing it, [`RecordError::NotAFile`] if `path` is not a file, [`RecordError::Unfit`] if
    /// the header has no particles or its arrays differ in length, [`RecordError::Io`] and
    /// [`RecordError::Full`] for errors of the system.
    #[expect(clippy::needless_pass_by_value, reason = "created for this call, like the other data passed")]
    pub fn create(path: impl AsRef<Path>, header: Header, overwrite: bool) -> Result<Self, RecordError> {
        let path = path.as_ref();
        check(path, &header)?;
        let prepare = || {
            let mut file = WritableFile::create(path, overwrite)?;
            let datasets = Datasets::create(file.root(), &header).doing(path, "create the file")?;
            // Also before space freed by the creation of the datasets is reused.
            file.flush()?;
            Ok((file, datasets))
        };
        let (file, datasets) = prepare().map_err(RecordError::unpublished)?;
        let contents = Contents {
            particles: header.species.len(),
            species: Some(header.species_names.len()).filter(|&count| header.observables && count > 0),
            walls: Some(header.wall_names.len()).filter(|_| header.observables && header.present.wall_forces),
            frames: header.frames,
            observables: header.observables,
            events: !header.events.is_empty(),
            profiles: header.measure.profiles.len(),
            pistons: header.pistons.len(),
            spin: header.present.spin,
            flow: header.present.flow,
        };
        Self::start(path, Writer::new(file, datasets), contents)
    }

    /// A recorder with a running writer.
    pub(crate) fn start(path: &Path, writer: Writer, contents: Contents) -> Result<Self, RecordError> {
        let (producer, consumer) = queue();
        let thread = thread::Builder::new()
            .name("haff-record".to_owned())
            .spawn(move || writer.run(&consumer))
            .doing(path, "start the writer")?;
        Ok(Self { producer: Some(producer), thread: Some(thread), path: path.to_owned(), contents })
    }

    /// A recorder of a complete run, to which nothing can be added.
    pub(crate) fn closed(path: &Path) -> Self {
        Self { producer: None, thread: None, path: path.to_owned(), contents: Contents::default() }
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
        if self.producer.is_some() && lengths != [self.contents.particles; 3] {
            let [positions, velocities, images] = lengths;
            return Err(self.unfit(format!(
                "a frame of {positions} positions, {velocities} velocities and {images} images; the file has {} \
                 particles",
                self.contents.particles
            )));
        }
        if self.contents.spin && frame.angular_velocity.len() != self.contents.particles {
            let (found, expected) = (frame.angular_velocity.len(), self.contents.particles);
            return Err(self.unfit(format!("a frame of {found} angular velocities for {expected} particles")));
        }
        let expected = if self.contents.flow { self.contents.particles } else { 0 };
        if self.producer.is_some() && self.contents.frames && frame.present.len() != expected {
            let found = frame.present.len();
            return Err(self.unfit(format!("a frame that says of {found} particles whether they are there")));
        }
        if self.producer.is_some() && frame.pistons.len() != self.contents.pistons {
            let (found, expected) = (frame.pistons.len(), self.contents.pistons);
            return Err(self.unfit(format!("a frame of {found} pistons; the file has {expected}")));
        }
        if self.contents.frames || self.producer.is_none() {
            self.send(Message::Frame(frame))
        } else {
            Ok(())
        }
    }

    /// Adds the frame returned by `take`, when there is space for it: a large system then has at most one
    /// frame in memory at a time. `take` is not called if frames are not recorded.
    pub fn frame_with(&self, take: impl FnOnce() -> Frame) -> Result<(), RecordError> {
        match &self.producer {
            Some(producer) if self.contents.frames => {
                producer.wait(FRAME_BYTES * self.contents.particles)?;
                self.frame(take())
            }
            Some(_) => Ok(()),
            None => self.send(Message::Frame(Frame::default())),
        }
    }

    /// Tells what particles are that take places kept for them: rows of the header without a particle so far,
    /// in a file of particles that come and go.
    pub fn enter(&self, particles: Vec<Entered>) -> Result<(), RecordError> {
        let rows = self.contents.particles;
        if let Some(wrong) = particles.iter().find(|one| one.row as usize >= rows || !self.contents.flow) {
            return Err(self.unfit(format!("a particle enters row {}; the file has {rows}", wrong.row)));
        }
        if particles.is_empty() { Ok(()) } else { self.send(Message::Entered(particles)) }
    }

    /// Adds a row of observables.
    pub fn sample(&self, sample: Sample) -> Result<(), RecordError> {
        let found = sample.species_temperature.len();
        if let Some(species) = self.contents.species.filter(|&species| species != found) {
            return Err(self.unfit(format!("temperatures of {found} species; the file has {species}")));
        }
        let found = sample.wall_force.len();
        if let Some(walls) = self.contents.walls.filter(|&walls| walls != found) {
            return Err(self.unfit(format!("forces on {found} walls; the file has {walls}")));
        }
        if self.contents.observables || self.producer.is_none() {
            self.send(Message::Sample(Box::new(sample)))
        } else {
            Ok(())
        }
    }

    /// An empty buffer for rows of [`Recorder::events`], reused if possible, so that its memory is mapped.
    pub fn event_buffer(&self) -> Vec<EventRecord> {
        self.producer.as_ref().map_or_else(Vec::new, Producer::buffer)
    }

    /// Adds rows to the event log.
    pub fn events(&self, events: Vec<EventRecord>) -> Result<(), RecordError> {
        if self.contents.events || self.producer.is_none() {
            self.send(Message::Events(events))
        } else {
            Ok(())
        }
    }

    /// Adds a row to a profile.
    pub fn profile(&self, row: ProfileRow) -> Result<(), RecordError> {
        if row.profile < self.contents.profiles || self.producer.is_none() {
            self.send(Message::Profile(row))
        } else {
            Err(self
                .unfit(format!("a row of profile {}; the file has {}", row.profile, self.contents.profiles)))
        }
    }

    /// Replaces the correlations in time.
    pub fn correlations(&self, correlations: Vec<Correlation>) -> Result<(), RecordError> {
        if correlations.is_empty() { Ok(()) } else { self.send(Message::Correlations(correlations)) }
    }

    /// Stores a checkpoint beside the previous one, and flushes the file. A resumed run continues from here:
    /// frames, samples and events passed before this call stay, later ones are dropped.
    pub fn checkpoint(&self, state: Checkpoint) -> Result<(), RecordError> {
        if self.producer.is_some()
            && let Some(reason) = mismatch(&state, self.contents.particles, self.contents.spin)
        {
            return Err(self.unfit(reason));
        }
        self.send(Message::Checkpoint(Box::new(state)))
    }

    /// Stores the checkpoint returned by `take`, when there is space for it; see [`Recorder::checkpoint`].
    pub fn checkpoint_with(&self, take: impl FnOnce() -> Checkpoint) -> Result<(), RecordError> {
        if let Some(producer) = &self.producer {
            producer.wait(CHECKPOINT_BYTES * self.contents.particles)?;
        }
        self.checkpoint(take())
    }

    /// Returns when all data passed so far are in the file, except for events that do not fill a chunk.
    pub fn flush(&self) -> Result<(), RecordError> {
        let (answer, done) = sync_channel(1);
        self.send(Message::Flush(answer))?;
        done.recv().map_err(|_| match &self.producer {
            Some(producer) => producer.ended(&self.path),
            None => RecordError::Complete { path: self.path.clone() },
        })
    }

    /// Writes everything, with a summary of the run (JSON text), and closes the file after it is stored on
    /// the disk.
    ///
    /// `complete`: the run has reached its end; otherwise it was stopped and can be resumed from its last
    /// checkpoint.
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
        // Errors are returned only by `finish`.
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
    } else if header.present.spin && header.inertia.len() != particles {
        format!("{} moments of inertia for {particles} particles with spin", header.inertia.len())
    } else if let Some(text) = texts.find(|text| text.contains('\0')) {
        format!("text with a NUL character: {text:?}")
    } else {
        return Ok(());
    };
    Err(RecordError::Unfit { path: path.to_owned(), reason })
}
