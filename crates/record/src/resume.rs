//! Continuing a file.

use std::path::Path;

use haff_engine::Checkpoint;

use crate::{
    checkpoint::{Saved, Slot, newest},
    datasets::{Datasets, Observables, Trajectory},
    error::{Context, READ, RecordError},
    events::Columns,
    file::{self, WritableFile},
    header::Header,
    info::Parameters,
    measured::row_shapes,
    recorder::{Contents, Recorder},
    writer::Writer,
};

const CONTINUE: &str = "continue";

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
    /// What the rows of the file have been made for.
    made_for: MadeFor,
}

/// Numbers of a run on which the shapes of rows depend.
#[derive(Debug, Clone, PartialEq)]
struct MadeFor {
    particles: usize,
    species: usize,
    walls: usize,
    pistons: usize,
    spin: bool,
    /// Shapes of the fields of each profile.
    profiles: Vec<Vec<Vec<usize>>>,
}

impl Resumed {
    /// Fails if rows of the run that `header` describes do not fit the file: its scene is not the one that
    /// the file was made for.
    ///
    /// # Errors
    ///
    /// [`RecordError::Unfit`].
    pub fn require(&self, path: impl AsRef<Path>, header: &Header) -> Result<(), RecordError> {
        let MadeFor { particles, species, walls, pistons, spin, profiles } = &self.made_for;
        let of_scene = header.measure.profiles.iter().map(|grid| row_shapes(grid, header.dimension));
        let reason = [
            ("particles", *particles, header.species.len()),
            ("species", *species, header.species_names.len()),
            ("walls", *walls, header.wall_names.len()),
            ("pistons", *pistons, header.pistons.len()),
            ("angular velocities", usize::from(*spin), usize::from(header.present.spin)),
            ("profiles", profiles.len(), header.measure.profiles.len()),
        ]
        .into_iter()
        .find(|(_, found, expected)| found != expected)
        .map(|(what, found, expected)| format!("{expected} {what} of its scene; it was made for {found}"))
        .or_else(|| {
            (!of_scene.eq(profiles.iter().cloned()))
                .then(|| "the profiles of its scene; it was made for others".to_owned())
        });
        match reason {
            Some(reason) => Err(RecordError::Unfit { path: path.as_ref().to_owned(), reason }),
            None => Ok(()),
        }
    }
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
        let (parameters, resumed) = file::read(path, |file| {
            let (parameters, datasets) = parts(file, path)?;
            let saved = newest_complete(&datasets, path)?;
            if !parameters.complete {
                datasets.check_growth(file, &saved).doing(path, CONTINUE)?;
            }
            let resumed = describe(parameters.clone(), &datasets, &saved, path)?;
            Ok((parameters, resumed))
        })?;
        if parameters.complete {
            return Ok((Self::closed(path), resumed));
        }
        let file = WritableFile::append(path)?;
        let prepare = || {
            let datasets =
                Datasets::open(file.root(), parameters.particles, parameters.sizes()).doing(path, READ)?;
            let saved = newest_complete(&datasets, path)?;
            let [first, second] = [&datasets.slots[0], &datasets.slots[1]].map(Slot::sequence);
            if (saved.progress.frames as u64, &saved.state) != (resumed.frames, &resumed.checkpoint) {
                // Another process has resumed it since it was read.
                return Err(RecordError::InUse { path: path.to_owned() });
            }
            Ok((datasets, saved, [first.doing(path, READ)?, second.doing(path, READ)?]))
        };
        let (datasets, saved, [first, second]) = match prepare() {
            Ok(prepared) => prepared,
            Err(error) => return Err(file.abandon().err().unwrap_or(error)),
        };
        let contents = Contents {
            particles: parameters.particles,
            species: parameters.species_sampled,
            walls: parameters.walls_sampled,
            frames: datasets.trajectory.is_some(),
            observables: datasets.observables.is_some(),
            events: datasets.events.is_some(),
            profiles: datasets.profiles.count(),
            pistons: parameters.pistons,
            spin: datasets.slots[0].has_spin(),
            flow: datasets.trajectory.as_ref().is_some_and(|trajectory| trajectory.present.is_some()),
        };
        // The slot of the checkpoint that is used stays; the other one is written next.
        let next_slot = usize::from(first == saved.sequence);
        let writer = Writer::new(file, datasets);
        let writer = writer.resume(&saved, next_slot, first.max(second))?;
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
    file::read(path, |file| {
        let (parameters, datasets) = parts(file, path)?;
        let saved = newest_complete(&datasets, path)?;
        describe(parameters, &datasets, &saved, path)
    })
}

fn parts(file: &hdf5::File, path: &Path) -> Result<(Parameters, Datasets), RecordError> {
    let parameters = Parameters::read(file, path)?;
    let datasets = Datasets::open(file, parameters.particles, parameters.sizes()).doing(path, READ)?;
    Ok((parameters, datasets))
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
    let made_for = MadeFor {
        particles: parameters.particles,
        species: parameters.species_names.len(),
        walls: parameters.wall_names.len(),
        pistons: parameters.pistons,
        spin: datasets.slots[0].has_spin(),
        profiles: datasets.profiles.row_shapes(),
    };
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
        made_for,
    })
}
