//! Continuing a file.

use std::path::Path;

use haff_engine::Checkpoint;

use crate::{
    checkpoint::{Saved, Slot, newest},
    datasets::{Datasets, Observables, Trajectory},
    error::{Context, RecordError},
    events::Columns,
    file::{self, WritableFile},
    info::{Parameters, READ},
    recorder::{Contents, Recorder},
    writer::Writer,
};

/// The data of a file needed to continue its run.
#[derive(Debug, Clone, PartialEq)]
pub struct Resumed {
    /// The resolved scene as TOML text.
    pub scene_toml: String,
    /// Seed of all random numbers.
    pub seed: u64,
    /// Version of haff that created the file.
    pub version: String,
    /// Version of its trajectory: if it is not [`haff_engine::TRAJECTORY_VERSION`], the bits after the
    /// checkpoint may differ from those of an uninterrupted run.
    pub trajectory_version: u32,
    /// The state to continue from.
    pub checkpoint: Checkpoint,
    /// Frames that are kept.
    pub frames: u64,
    /// Rows of observables that are kept.
    pub samples: u64,
    /// Event rows that are kept.
    pub event_rows: u64,
    /// Time of the last frame that is kept [time].
    pub last_frame: Option<f64>,
    /// Time of the last row of observables that is kept [time].
    pub last_sample: Option<f64>,
    /// Whether the run is complete: then the file is not changed, and nothing can be added.
    pub finished: bool,
    /// The summary (JSON text), if one was written.
    pub summary: Option<String>,
    /// The summary before the last resumption (JSON text), if there is one.
    pub earlier: Option<String>,
}

impl Recorder {
    /// Continues the file of a run that was stopped, killed, or failed.
    ///
    /// Uses the newest valid checkpoint and drops the frames, samples and events recorded after it. The file
    /// of a complete run is not changed, and the recorder accepts no data then.
    ///
    /// # Errors
    ///
    /// Those of [`crate::info`]; [`RecordError::InUse`] if another process is writing the file;
    /// [`RecordError::Missing`] if it holds no valid checkpoint.
    pub fn append(path: impl AsRef<Path>) -> Result<(Self, Resumed), RecordError> {
        let path = path.as_ref();
        let (parameters, datasets) = open(path)?;
        if parameters.complete {
            return Ok((Self::closed(path), resumed(parameters, &datasets, path)?));
        }
        // The file is not opened for writing while it is open for reading.
        drop(datasets);
        let file = WritableFile::append(path)?;
        let prepare = || {
            let datasets =
                Datasets::open(file.root(), parameters.particles, parameters.sizes()).doing(path, READ)?;
            let saved = newest_complete(&datasets, path)?;
            let resumed = describe(parameters.clone(), &datasets, &saved, path)?;
            let [first, second] = [&datasets.slots[0], &datasets.slots[1]].map(Slot::sequence);
            Ok((datasets, saved, resumed, [first.doing(path, READ)?, second.doing(path, READ)?]))
        };
        let (datasets, saved, resumed, [first, second]) = match prepare() {
            Ok(prepared) => prepared,
            Err(error) => {
                // Nothing has been changed, so closing is safe, and releases the lock.
                file.close(false)?;
                return Err(error);
            }
        };
        let contents = Contents {
            particles: parameters.particles,
            species: parameters.species_sampled,
            walls: parameters.walls_sampled,
            frames: datasets.trajectory.is_some(),
            observables: datasets.observables.is_some(),
            events: datasets.events.is_some(),
            profiles: datasets.profiles.count(),
            spin: datasets.slots[0].has_spin(),
        };
        // The slot of the checkpoint that is used stays; the other one is written next.
        let next_slot = usize::from(first == saved.sequence);
        let mut writer = Writer::new(file, datasets, parameters.box_size);
        writer.resume(&saved, next_slot, first.max(second))?;
        Ok((Self::start(path, writer, contents)?, resumed))
    }
}

/// What [`Recorder::append`] would continue from; the file is not changed.
///
/// # Errors
///
/// Those of [`crate::info`]; [`RecordError::Missing`] if it holds no valid checkpoint.
pub fn resumable(path: impl AsRef<Path>) -> Result<Resumed, RecordError> {
    let path = path.as_ref();
    let (parameters, datasets) = open(path)?;
    resumed(parameters, &datasets, path)
}

fn open(path: &Path) -> Result<(Parameters, Datasets), RecordError> {
    file::read(path, |file| {
        let parameters = Parameters::read(file, path)?;
        let datasets = Datasets::open(file, parameters.particles, parameters.sizes()).doing(path, READ)?;
        Ok((parameters, datasets))
    })
}

fn resumed(parameters: Parameters, datasets: &Datasets, path: &Path) -> Result<Resumed, RecordError> {
    let saved = newest_complete(datasets, path)?;
    describe(parameters, datasets, &saved, path)
}

/// The newest checkpoint whose rows are all in the file.
fn newest_complete(datasets: &Datasets, path: &Path) -> Result<Saved, RecordError> {
    let rows = || -> hdf5::Result<[usize; 3]> {
        Ok([
            datasets.trajectory.as_ref().map_or(Ok(usize::MAX), Trajectory::rows)?,
            datasets.observables.as_ref().map_or(Ok(usize::MAX), Observables::rows)?,
            datasets.events.as_ref().map_or(Ok(usize::MAX), Columns::rows)?,
        ])
    };
    let [frames, samples, events] = rows().doing(path, READ)?;
    let accept = |saved: &Saved| {
        saved.progress.frames <= frames
            && saved.progress.samples <= samples
            && saved.progress.events - saved.tail.len() <= events
    };
    newest(&datasets.slots, accept)
        .doing(path, READ)?
        .ok_or_else(|| RecordError::Missing { path: path.to_owned(), what: "valid checkpoint" })
}

fn describe(
    parameters: Parameters,
    datasets: &Datasets,
    saved: &Saved,
    path: &Path,
) -> Result<Resumed, RecordError> {
    let rows = saved.progress;
    let clocks = [
        (datasets.trajectory.as_ref().map(|trajectory| &trajectory.clock), rows.frames),
        (datasets.observables.as_ref().map(|observables| &observables.clock), rows.samples),
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
        earlier: parameters.earlier,
    })
}
