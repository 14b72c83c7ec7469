//! Reading the content of a file.

use std::path::Path;

use glam::DVec3;
use haff_engine::{
    Checkpoint, Counters, Ledger, Mean, NO_MEANS, Quantity, Sample, Sizes, StressTensor, Term,
};
use hdf5::{Dataset, Group, H5Type, types::VarLenUnicode};

use crate::{
    checkpoint::newest,
    datasets::{Datasets, Observables},
    declared::{checked_text, elements, read_all, read_attribute, read_scalar},
    entered,
    error::{Context, READ, RecordError},
    events::Columns,
    file,
    header::{EARLIER, PISTONS, SCHEMA},
    heap::check_texts,
};

/// Summary of a file.
#[derive(Debug, Clone, PartialEq)]
pub struct Info {
    /// Title of the scene.
    pub title: String,
    /// The resolved scene as TOML text.
    pub scene_toml: String,
    /// Seed of all random numbers.
    pub seed: u64,
    /// Version of haff that created the file.
    pub version: String,
    /// Git revision it was built from; empty if unknown.
    pub git_revision: String,
    /// Version of the scene schema.
    pub schema: i64,
    /// Version of the trajectory.
    pub trajectory_version: u32,
    /// 2 or 3.
    pub dimension: usize,
    /// N.
    pub particles: u64,
    /// Names of the species, and the number of particles of each.
    pub species: Vec<(String, u64)>,
    /// Names of the walls.
    pub walls: Vec<String>,
    /// Edge lengths of the box [length].
    pub box_size: DVec3,
    /// Whether each axis is periodic.
    pub periodic: [bool; 3],
    /// Frames recorded; `None` if the scene records none.
    pub frames: Option<u64>,
    /// Rows of observables recorded; `None` if the scene records none.
    pub samples: Option<u64>,
    /// Rows of the event log, including those stored in the checkpoint; `None` if the scene records none.
    pub event_rows: Option<u64>,
    /// Names of the columns of the event log; empty if the scene records none.
    pub event_columns: Vec<String>,
    /// Times of the first and the last frame or sample [time].
    pub time_range: Option<(f64, f64)>,
    /// The last row of the observables, with the ledger. NaN where the file does not contain the observable.
    pub last_sample: Option<Sample>,
    /// Counters at the last checkpoint.
    pub counters: Option<Counters>,
    /// Time of the last checkpoint [time].
    pub checkpoint_time: Option<f64>,
    /// Whether the run is complete.
    pub finished: bool,
    /// Whether the run can be resumed: it is not complete, and there is a valid checkpoint.
    pub resumable: bool,
    /// The summary (JSON text), if one was written.
    pub summary: Option<String>,
    /// The summary before the last resumption (JSON text), if there is one.
    pub earlier: Option<String>,
    /// Size of the file [bytes].
    pub file_size: u64,
}

/// The fixed part of a file.
#[derive(Debug, Clone)]
pub(crate) struct Parameters {
    pub scene_toml: String,
    pub title: String,
    pub seed: u64,
    pub version: String,
    pub git_revision: String,
    pub schema: i64,
    pub trajectory_version: u32,
    pub dimension: usize,
    pub box_size: DVec3,
    pub particles: usize,
    pub species_names: Vec<String>,
    /// Number of species whose temperatures are recorded.
    pub species_sampled: Option<usize>,
    pub wall_names: Vec<String>,
    /// Number of walls that are pistons.
    pub pistons: usize,
    /// Number of walls on which the forces are recorded.
    pub walls_sampled: Option<usize>,
    pub summary: Option<String>,
    pub earlier: Option<String>,
    pub complete: bool,
}

impl Parameters {
    /// The numbers on which the shapes of observables depend.
    pub fn sizes(&self) -> Sizes {
        Sizes {
            species: self.species_names.len(),
            walls: self.wall_names.len(),
            pistons: self.pistons,
            dimension: self.dimension,
        }
    }

    /// Reads them; fails for files that haff has not written, or not this version of it.
    pub fn read(file: &Group, path: &Path) -> Result<Self, RecordError> {
        for part in ["h5md", "parameters", "parameters/schema"] {
            if !file.link_exists(part) {
                return Err(RecordError::NotHaff { path: path.to_owned(), missing: part.to_owned() });
            }
        }
        let group = file.group("parameters").doing(path, READ)?;
        let schema: i64 = scalar(&group, "schema").doing(path, READ)?;
        if schema != SCHEMA {
            return Err(RecordError::Schema { path: path.to_owned(), found: schema, expected: SCHEMA });
        }
        for part in ["parameters/scene", "particles", "particles/all", "particles/all/mass", "checkpoint"] {
            if !file.link_exists(part) {
                return Err(RecordError::NotHaff { path: path.to_owned(), missing: part.to_owned() });
            }
        }
        Self::read_all(file, &group, path).doing(path, READ)
    }

    fn read_all(file: &Group, group: &Group, path: &Path) -> hdf5::Result<Self> {
        let summary = if group.link_exists("summary") { Some(group.dataset("summary")?) } else { None };
        let sampled = "observables/species_temperature";
        let species_names = texts(group, "species_names", path)?;
        let wall_names = texts(group, "wall_names", path)?;
        let count = |name: &str| -> hdf5::Result<u64> {
            Ok(elements(&file.dataset(&format!("particles/all/{name}"))?.get_shape()?))
        };
        let particles = count("mass")?;
        // Four fixed columns, uncompressed: a larger number of particles is damage.
        for name in ["species", "radius", "id"] {
            let found = count(name)?;
            if found != particles {
                return Err(format!("{particles} masses, but {found} entries of {name}").into());
            }
        }
        let size = file.file()?.size();
        if particles == 0 || particles > size / 24 {
            return Err(format!(
                "/particles/all/mass declares {particles} particles in a file of {size} bytes"
            )
            .into());
        }
        let particles = particles as usize;
        let dimension = scalar::<u32>(group, "dimension")? as usize;
        if !(2..=3).contains(&dimension) {
            return Err(format!("/parameters/dimension = {dimension} must be 2 or 3").into());
        }
        Ok(Self {
            scene_toml: string(group, "scene", path)?,
            title: string(group, "title", path)?,
            seed: scalar(group, "seed")?,
            version: string(group, "version", path)?,
            git_revision: string(group, "git_revision", path)?,
            schema: scalar(group, "schema")?,
            trajectory_version: scalar(group, "trajectory_version")?,
            dimension,
            box_size: vectors(&read_all(&group.dataset("box_size")?)?).first().copied().unwrap_or(DVec3::NAN),
            particles,
            species_sampled: (file.link_exists("observables") && file.link_exists(sampled))
                .then_some(species_names.len()),
            species_names,
            walls_sampled: (file.link_exists("observables") && file.link_exists("observables/wall_force"))
                .then_some(wall_names.len()),
            pistons: if group.link_exists(PISTONS) {
                elements(&group.dataset(PISTONS)?.get_shape()?) as usize
            } else {
                0
            },
            wall_names,
            complete: match &summary {
                Some(summary) => read_attribute::<u8>(&summary.attr("complete")?, 1)? != [0],
                None => false,
            },
            summary: match &summary {
                Some(summary) => Some(text(summary, path)?),
                None => None,
            },
            earlier: if group.link_exists(EARLIER) { Some(string(group, EARLIER, path)?) } else { None },
        })
    }
}

fn scalar<T: H5Type>(group: &Group, name: &str) -> hdf5::Result<T> {
    read_scalar(&group.dataset(name)?)
}

fn text(dataset: &Dataset, path: &Path) -> hdf5::Result<String> {
    check_texts(dataset, path)?;
    checked_text(read_scalar::<VarLenUnicode>(dataset)?.as_bytes(), &dataset.name())
}

fn string(group: &Group, name: &str, path: &Path) -> hdf5::Result<String> {
    text(&group.dataset(name)?, path)
}

fn texts(group: &Group, name: &str, path: &Path) -> hdf5::Result<Vec<String>> {
    let dataset = group.dataset(name)?;
    check_texts(&dataset, path)?;
    let texts = read_all::<VarLenUnicode>(&dataset)?;
    texts.iter().map(|text| checked_text(text.as_bytes(), &dataset.name())).collect()
}

pub(crate) fn vectors(flat: &[f64]) -> Vec<DVec3> {
    flat.chunks_exact(3).map(DVec3::from_slice).collect()
}

/// Summary of the content of a file. Also works for runs in progress: it shows the data flushed so far.
///
/// # Errors
///
/// [`RecordError::NotFound`], [`RecordError::NotAFile`], [`RecordError::NotHdf5`], [`RecordError::NotHaff`],
/// [`RecordError::Truncated`], [`RecordError::Schema`], or [`RecordError::Io`] with the message of HDF5.
pub fn info(path: impl AsRef<Path>) -> Result<Info, RecordError> {
    let path = path.as_ref();
    file::read(path, |file| {
        let parameters = Parameters::read(file, path)?;
        read_info(file, parameters, path)
    })
}

/// The mean of one observable.
#[derive(Debug, Clone, PartialEq)]
pub struct NamedMean {
    /// Name of the observable.
    pub name: String,
    /// The mean over its stationary part.
    pub mean: Mean,
    /// Time from which on it is stationary [time].
    pub from: f64,
}

/// The means of all observables of a file that are one real number, and neither sums since the start nor an
/// error. None without observables.
///
/// # Errors
/// As [`info`].
pub fn means(path: impl AsRef<Path>) -> Result<Vec<NamedMean>, RecordError> {
    let path = path.as_ref();
    file::read(path, |file| {
        let parameters = Parameters::read(file, path)?;
        let datasets = Datasets::open(file, parameters.particles, parameters.sizes()).doing(path, READ)?;
        let Some(observables) = &datasets.observables else { return Ok(Vec::new()) };
        read_means(observables).doing(path, READ)
    })
}

fn read_means(observables: &Observables) -> hdf5::Result<Vec<NamedMean>> {
    let rows = observables.rows()?;
    let times = observables.clock.time.read::<f64>(0, rows)?;
    let mut found = Vec::new();
    for (series, quantity) in &observables.series {
        // …/observables/NAME/value
        let path = series.name();
        let name = path.rsplit('/').nth(1).unwrap_or_default();
        if !matches!(quantity, Quantity::Real(_)) || NO_MEANS.contains(&name) {
            continue;
        }
        let values = series.read::<f64>(0, rows)?;
        if let Some((mean, from)) = Mean::of_samples(&times, &values) {
            found.push(NamedMean { name: name.to_owned(), mean, from });
        }
    }
    Ok(found)
}

fn read_info(file: &hdf5::File, parameters: Parameters, path: &Path) -> Result<Info, RecordError> {
    let datasets = Datasets::open(file, parameters.particles, parameters.sizes()).doing(path, READ)?;
    let checkpoint = newest(&datasets.slots, |_| true).doing(path, READ)?;
    let mut range: Option<(f64, f64)> = None;
    let frames = match &datasets.trajectory {
        Some(trajectory) => Some((&trajectory.clock, trajectory.rows().doing(path, READ)?)),
        None => None,
    };
    let samples = match &datasets.observables {
        Some(observables) => Some((&observables.clock, observables.rows().doing(path, READ)?)),
        None => None,
    };
    for (clock, rows) in [frames, samples].into_iter().flatten() {
        if rows > 0 {
            let first = clock.time.read::<f64>(0, 1).doing(path, READ)?[0];
            let last = clock.time.read::<f64>(rows - 1, rows).doing(path, READ)?[0];
            range = Some(range.map_or((first, last), |(low, high)| (low.min(first), high.max(last))));
        }
    }
    let event_rows = match &datasets.events {
        Some(columns) => {
            let rows = columns.rows().doing(path, READ)?;
            // The checkpoint's count is larger only as long as its tail is not in the columns.
            let counted = checkpoint.as_ref().map_or(0, |saved| saved.progress.events).max(rows);
            if rows > 0 {
                let last = columns.time(rows - 1).doing(path, READ)?;
                range = range.map(|(low, high)| (low, high.max(last)));
            }
            Some(counted as u64)
        }
        None => None,
    };
    let last_sample = match (&datasets.observables, samples) {
        (Some(observables), Some((_, rows))) if rows > 0 => {
            Some(read_sample(file, observables, rows - 1).doing(path, READ)?)
        }
        _ => None,
    };
    let species = file.dataset("particles/all/species").doing(path, READ)?;
    let used = entered::used(&species).doing(path, READ)?;
    let species: Vec<u32> = read_all(&species).doing(path, READ)?;
    let mut counts = vec![0_u64; parameters.species_names.len()];
    for index in species.into_iter().take(used) {
        if let Some(count) = counts.get_mut(index as usize) {
            *count += 1;
        }
    }
    let boundary = file
        .group("particles/all/box")
        .and_then(|group| read_attribute::<hdf5::types::FixedAscii<8>>(&group.attr("boundary")?, 3))
        .doing(path, READ)?;
    let mut periodic = [false; 3];
    for (periodic, name) in periodic.iter_mut().zip(&boundary) {
        *periodic = name.as_bytes() == b"periodic";
    }
    let state = checkpoint.as_ref().map(|saved| &saved.state);
    Ok(Info {
        title: parameters.title,
        scene_toml: parameters.scene_toml,
        seed: parameters.seed,
        version: parameters.version,
        git_revision: parameters.git_revision,
        schema: parameters.schema,
        trajectory_version: parameters.trajectory_version,
        dimension: parameters.dimension,
        particles: used as u64,
        species: parameters.species_names.into_iter().zip(counts).collect(),
        walls: parameters.wall_names,
        box_size: parameters.box_size,
        periodic,
        frames: frames.map(|(_, rows)| rows as u64),
        samples: samples.map(|(_, rows)| rows as u64),
        event_rows,
        event_columns: datasets.events.as_ref().map(Columns::names).unwrap_or_default(),
        time_range: range,
        last_sample,
        counters: state.map(counters),
        checkpoint_time: state.and_then(|state| bits(state, "clock.time")).map(f64::from_bits),
        finished: parameters.complete,
        resumable: !parameters.complete && checkpoint.is_some(),
        summary: parameters.summary,
        earlier: parameters.earlier,
        file_size: path.metadata().doing(path, READ)?.len(),
    })
}

fn bits(state: &Checkpoint, name: &str) -> Option<u64> {
    state.scalars.iter().find(|(found, _)| found == name).map(|(_, bits)| *bits)
}

fn counters(state: &Checkpoint) -> Counters {
    let count = |name| bits(state, name).unwrap_or(0);
    Counters {
        collisions: count("collisions"),
        fixed_collisions: count("fixed_collisions"),
        wall_collisions: count("wall_collisions"),
        simultaneous: count("simultaneous"),
        rests: count("rests"),
        wakes: count("wakes"),
        predictions: count("predictions"),
        dropped: count("dropped"),
        stale: count("stale"),
        transfers: count("transfers"),
        candidates: count("candidates"),
        windows: count("windows"),
        epochs: count("epochs"),
    }
}

fn read_sample(file: &Group, observables: &Observables, row: usize) -> hdf5::Result<Sample> {
    let group = file.group("observables")?;
    let read = |name: &str| -> hdf5::Result<Vec<f64>> {
        if !group.link_exists(name) {
            return Ok(Vec::new());
        }
        let series = crate::series::Series::open(&group, &format!("{name}/value"))?;
        series.read::<f64>(row, row + 1)
    };
    let real = |name: &str| -> hdf5::Result<f64> { Ok(read(name)?.first().copied().unwrap_or(f64::NAN)) };
    let count = |name: &str| -> hdf5::Result<u64> {
        let series = crate::series::Series::open(&group, &format!("{name}/value"))?;
        Ok(series.read::<i64>(row, row + 1)?.first().map_or(0, |&count| count as u64))
    };
    let count_if_present = |name: &str| if group.link_exists(name) { count(name) } else { Ok(0) };
    let mut terms = [0.0; Term::ALL.len()];
    for term in Term::ALL {
        if group.link_exists(term.name()) {
            terms[term as usize] = real(term.name())?;
        }
    }
    let mut probes = Vec::new();
    for (series, _) in observables.series.iter().filter(|(_, q)| matches!(q, Quantity::Probe { .. })) {
        probes.extend(series.read::<f64>(row, row + 1)?);
    }
    let dimension = observables.sizes.dimension;
    let tensor = |name: &str| -> hdf5::Result<Option<[f64; 9]>> {
        let found = read(name)?;
        let mut tensor = [0.0; 9];
        for (k, &component) in found.iter().enumerate().take(dimension * dimension) {
            tensor[3 * (k / dimension) + k % dimension] = component;
        }
        Ok((!found.is_empty()).then_some(tensor))
    };
    let vector = |name: &str| -> hdf5::Result<Option<DVec3>> { Ok(vectors(&read(name)?).first().copied()) };
    Ok(Sample {
        time: observables.clock.time.read::<f64>(row, row + 1)?[0],
        step: observables.clock.step.read::<i64>(row, row + 1)?[0] as u64,
        ledger: Ledger {
            kinetic: real("kinetic_energy")?,
            rotational: read("rotational_energy")?.first().copied().unwrap_or(0.0),
            pistons: read("piston_energy")?.first().copied().unwrap_or(0.0),
            potential: real("potential_energy")?,
            spring: real("spring_energy")?,
            dissipated: real("dissipated_energy")?,
            carnot: real("carnot_energy")?,
            terms,
            residual: real("ledger_residual")?,
        },
        temperature: real("temperature")?,
        species_temperature: read("species_temperature")?,
        rotational_temperature: read("rotational_temperature")?.first().copied().unwrap_or(0.0),
        species_rotational_temperature: read("species_rotational_temperature")?,
        sonine_a2: real("sonine_a2")?,
        pressure: read("pressure")?.first().copied(),
        box_volume: real("box_volume")?,
        packing_fraction: real("packing_fraction")?,
        stress: match (tensor("pressure_tensor_kinetic")?, tensor("pressure_tensor_collisional")?) {
            (Some(kinetic), Some(collisional)) => Some(StressTensor { kinetic, collisional }),
            _ => None,
        },
        pair_collision_rate: read("pair_collision_rate")?,
        species_mean_free_time: read("species_mean_free_time")?,
        wall_force: vectors(&read("wall_force")?),
        wall_heat_flow: read("wall_heat_flow")?,
        piston_position: vectors(&read("piston_position")?),
        piston_velocity: vectors(&read("piston_velocity")?),
        probes,
        momentum: vector("momentum")?.unwrap_or(DVec3::NAN),
        external_impulse: vector("external_impulse")?.unwrap_or(DVec3::NAN),
        angular_momentum: vector("angular_momentum")?,
        collisions: count("collisions")?,
        wall_collisions: count("wall_collisions")?,
        collision_rate: real("collision_rate")?,
        mean_free_time: real("mean_free_time")?,
        particles: count_if_present("particles")?,
        particles_in: count_if_present("particles_in")?,
        particles_out: count_if_present("particles_out")?,
        discharge_rate: real("discharge_rate")?,
    })
}
