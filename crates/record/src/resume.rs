//! Going on with a file.

use std::path::Path;

use haff_engine::Checkpoint;

use crate::{
    checkpoint::{Saved, Slot, newest},
    error::{Context, RecordError},
    events::Columns,
    file::{self, WritableFile},
    info::{Parameters, READ},
    recorder::{Recorder, Wants},
    skeleton::{Observables, Skeleton, Trajectory},
    writer::Writer,
};

/// What a file tells whoever goes on with its run.
#[derive(Debug, Clone, PartialEq)]
pub struct Resumed {
    /// The resolved scene as TOML text.
    pub scene_toml: String,
    /// Seed of all random numbers.
    pub seed: u64,
    /// Version of haff that began the file.
    pub version: String,
    /// Version of its trajectory: if it is not [`haff_engine::TRAJECTORY_VERSION`], the bits after the checkpoint
    /// may differ from those of an uninterrupted run.
    pub trajectory_version: u32,
    /// The state to go on from.
    pub checkpoint: Checkpoint,
    /// Frames that stay.
    pub frames: u64,
    /// Rows of observables that stay.
    pub samples: u64,
    /// Event rows that stay.
    pub event_rows: u64,
    /// Time of the last frame that stays [time].
    pub last_frame: Option<f64>,
    /// Time of the last row of observables that stays [time].
    pub last_sample: Option<f64>,
    /// Whether the run is complete: then the file is left as it is, and nothing can be added.
    pub finished: bool,
    /// The summary (JSON text), if one was written.
    pub summary: Option<String>,
}

impl Recorder {
    /// Goes on with the file of a run that was stopped, killed, or failed.
    ///
    /// Takes the newest valid checkpoint and drops the frames, samples and events recorded after it. The file of a
    /// complete run is not touched, and the recorder takes nothing then.
    ///
    /// # Errors
    ///
    /// Those of [`crate::info`]; [`RecordError::InUse`] if another process is writing the file;
    /// [`RecordError::Missing`] if it holds no valid checkpoint.
    pub fn append(path: impl AsRef<Path>) -> Result<(Self, Resumed), RecordError> {
        let path = path.as_ref();
        let (parameters, skeleton) = look(path)?;
        if parameters.complete {
            return Ok((Self::closed(path), resumed(parameters, &skeleton, path)?));
        }
        // The file is not opened for writing while it is open for reading.
        drop(skeleton);
        let file = WritableFile::append(path)?;
        let prepare = || {
            let skeleton = Skeleton::open(file.root(), parameters.particles, parameters.species_names.len())
                .doing(path, READ)?;
            let saved = choose(&skeleton, path)?;
            let resumed = tell(parameters.clone(), &skeleton, &saved, path)?;
            let [first, second] = [&skeleton.slots[0], &skeleton.slots[1]].map(Slot::sequence);
            Ok((skeleton, saved, resumed, [first.doing(path, READ)?, second.doing(path, READ)?]))
        };
        let (skeleton, saved, resumed, [first, second]) = match prepare() {
            Ok(prepared) => prepared,
            Err(error) => {
                // Nothing has been changed, so closing is safe, and frees the lock.
                file.close(false)?;
                return Err(error);
            }
        };
        let wants = Wants {
            particles: parameters.particles,
            species: parameters.species_sampled,
            frames: skeleton.trajectory.is_some(),
            observables: skeleton.observables.is_some(),
            events: skeleton.events.is_some(),
        };
        // The slot of the checkpoint that was taken stays; the other one is next.
        let next_slot = usize::from(first == saved.sequence);
        let mut writer = Writer::new(file, skeleton, parameters.box_size);
        writer.resume(&saved, next_slot, first.max(second))?;
        Ok((Self::start(path, writer, wants)?, resumed))
    }
}

/// What [`Recorder::append`] would go on with; the file is left as it is.
///
/// # Errors
///
/// Those of [`crate::info`]; [`RecordError::Missing`] if it holds no valid checkpoint.
pub fn resumable(path: impl AsRef<Path>) -> Result<Resumed, RecordError> {
    let path = path.as_ref();
    let (parameters, skeleton) = look(path)?;
    resumed(parameters, &skeleton, path)
}

fn look(path: &Path) -> Result<(Parameters, Skeleton), RecordError> {
    file::read(path, |file| {
        let parameters = Parameters::read(file, path)?;
        let skeleton =
            Skeleton::open(file, parameters.particles, parameters.species_names.len()).doing(path, READ)?;
        Ok((parameters, skeleton))
    })
}

fn resumed(parameters: Parameters, skeleton: &Skeleton, path: &Path) -> Result<Resumed, RecordError> {
    let saved = choose(skeleton, path)?;
    tell(parameters, skeleton, &saved, path)
}

/// The newest checkpoint all of whose rows are in the file.
fn choose(skeleton: &Skeleton, path: &Path) -> Result<Saved, RecordError> {
    let rows = || -> hdf5::Result<[usize; 3]> {
        Ok([
            skeleton.trajectory.as_ref().map_or(Ok(usize::MAX), Trajectory::rows)?,
            skeleton.observables.as_ref().map_or(Ok(usize::MAX), Observables::rows)?,
            skeleton.events.as_ref().map_or(Ok(usize::MAX), Columns::rows)?,
        ])
    };
    let [frames, samples, events] = rows().doing(path, READ)?;
    let accept = |saved: &Saved| {
        saved.progress.frames <= frames
            && saved.progress.samples <= samples
            && saved.progress.events - saved.tail.len() <= events
    };
    newest(&skeleton.slots, accept)
        .doing(path, READ)?
        .ok_or_else(|| RecordError::Missing { path: path.to_owned(), what: "valid checkpoint" })
}

fn tell(
    parameters: Parameters,
    skeleton: &Skeleton,
    saved: &Saved,
    path: &Path,
) -> Result<Resumed, RecordError> {
    let rows = saved.progress;
    let clocks = [
        (skeleton.trajectory.as_ref().map(|trajectory| &trajectory.clock), rows.frames),
        (skeleton.observables.as_ref().map(|observables| &observables.clock), rows.samples),
    ];
    let mut last = [None; 2];
    for ((clock, rows), last) in clocks.into_iter().zip(&mut last) {
        if let (Some(clock), Some(row)) = (clock, rows.checked_sub(1)) {
            *last = Some(clock.time.read::<f64>(row, row + 1).doing(path, READ)?[0]);
        }
    }
    Ok(Resumed {
        scene_toml: parameters.scene_toml,
        seed: parameters.seed,
        version: parameters.version,
        trajectory_version: parameters.trajectory_version,
        checkpoint: saved.state.clone(),
        frames: rows.frames as u64,
        samples: rows.samples as u64,
        event_rows: rows.events as u64,
        last_frame: last[0],
        last_sample: last[1],
        finished: parameters.complete,
        summary: parameters.summary,
    })
}
