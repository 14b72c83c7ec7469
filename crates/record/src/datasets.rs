//! The groups and datasets of a file: created with it, or opened in an existing file.

use haff_engine::{Boundary, Observable, Quantity, SceneFeatures, Sizes, observables};
use hdf5::{
    Group, H5Type,
    types::{FixedAscii, VarLenUnicode},
};

use crate::{
    checkpoint::{Saved, Slot, Tail},
    clock::{Clock, text, write_text_attribute},
    entered,
    events::{Columns, has_tangential},
    growth::check_extents,
    handshake,
    header::{EARLIER, Header, PISTONS},
    measured::{CorrelationTables, Profiles},
    meshes,
    series::{SERIES_CHUNK, Series, Storage},
};

/// Largest chunk of a trajectory [rows of N]: larger frames are divided into blocks of nearly equal size.
const FRAME_BLOCK: usize = 1 << 16;
/// Positions of frames smaller than this share an uncompressed chunk of about this size [bytes].
const SMALL_FRAME: usize = 1 << 15;

/// One frame, or a block of it, per chunk, compressed and written once; several small frames per chunk,
/// uncompressed and in place.
pub(crate) fn frame_storage(particles: usize, compressed: bool) -> Storage {
    let frames = (SMALL_FRAME / (24 * particles.max(1))).max(1);
    let rows = particles.div_ceil(particles.div_ceil(FRAME_BLOCK).max(1)).max(1);
    Storage { chunk: vec![frames, rows, 3], compressed: compressed && frames == 1 }
}

/// Units of the trajectory in the words that MDAnalysis requires to read a file without being told not to
/// convert any; the numbers are in the units of the scene.
const UNITS: [(&str, &str); 4] = [
    ("position/value", "A"),
    ("position/time", "ps"),
    ("velocity/value", "A ps-1"),
    ("box/edges/value", "A"),
];

/// The trajectory.
#[derive(Debug)]
pub(crate) struct Trajectory {
    pub position: Series,
    pub velocity: Series,
    pub angular_velocity: Option<Series>,
    pub image: Series,
    /// Where particles come and go: whether each is there.
    pub present: Option<Series>,
    /// Positions and velocities of pistons, if there are any.
    pub pistons: Option<[Series; 2]>,
    pub edges: Series,
    pub clock: Clock,
}

impl Trajectory {
    fn create(
        all: &Group,
        (particles, pistons): (usize, usize),
        present: &SceneFeatures,
        compressed: bool,
    ) -> hdf5::Result<Self> {
        let storage = frame_storage(particles, compressed);
        let width = [particles, 3];
        // Lengths, or under shear the vectors, one a row.
        let edges: &[usize] = if present.shear { &[3, 3] } else { &[3] };
        let position = all.create_group("position")?;
        let clock = Clock::create(&position)?;
        let element = |path: &str| -> hdf5::Result<Group> {
            let group = all.create_group(path)?;
            for name in ["step", "time"] {
                all.link_hard(&format!("position/{name}"), &format!("{path}/{name}"))?;
            }
            Ok(group)
        };
        let trajectory = Self {
            position: Series::create_real(&position, "value", &width, &storage)?,
            velocity: Series::create_real(&element("velocity")?, "value", &width, &storage)?,
            angular_velocity: if present.spin {
                let group = element("angular_velocity")?;
                Some(Series::create_real(&group, "value", &width, &storage)?)
            } else {
                None
            },
            image: Series::create::<i32>(&element("image")?, "value", &width, &storage)?,
            present: if present.flow {
                let storage = Storage {
                    chunk: vec![storage.chunk[0], particles.max(1)],
                    compressed: storage.compressed,
                };
                Some(Series::create::<u8>(&element("present")?, "value", &[particles], &storage)?)
            } else {
                None
            },
            pistons: if pistons > 0 {
                let (width, storage) = ([pistons, 3], frame_storage(pistons, compressed));
                let create = |path| Series::create_real(&element(path)?, "value", &width, &storage);
                Some([create("pistons/position")?, create("pistons/velocity")?])
            } else {
                None
            },
            edges: Series::create_real(
                &element("box/edges")?,
                "value",
                edges,
                &Storage::plain(SERIES_CHUNK, edges),
            )?,
            clock,
        };
        for (path, unit) in UNITS {
            let dataset = all.dataset(path)?;
            write_text_attribute(&dataset, "unit", unit)?;
        }
        Ok(trajectory)
    }

    fn open(all: &Group, particles: usize, pistons: usize) -> hdf5::Result<Self> {
        let vectors = |path| Series::open(all, path)?.expect(&[particles, 3]);
        let of_pistons = |path| Series::open(all, path)?.expect(&[pistons, 3]);
        Ok(Self {
            position: vectors("position/value")?,
            velocity: vectors("velocity/value")?,
            angular_velocity: if all.link_exists("angular_velocity") {
                Some(vectors("angular_velocity/value")?)
            } else {
                None
            },
            image: vectors("image/value")?,
            present: if all.link_exists("present") {
                Some(Series::open(all, "present/value")?.expect(&[particles])?)
            } else {
                None
            },
            pistons: if pistons > 0 {
                Some([of_pistons("pistons/position/value")?, of_pistons("pistons/velocity/value")?])
            } else {
                None
            },
            edges: {
                let edges = Series::open(all, "box/edges/value")?;
                let width = if edges.width() == 9 { &[3, 3][..] } else { &[3] };
                edges.expect(width)?
            },
            clock: Clock::open(&all.group("position")?)?,
        })
    }

    /// Number of complete frames.
    pub fn rows(&self) -> hdf5::Result<usize> {
        let rows = [&self.position, &self.velocity, &self.image, &self.edges]
            .into_iter()
            .chain(&self.angular_velocity)
            .chain(&self.present)
            .chain(self.pistons.iter().flatten())
            .map(Series::rows)
            .fold(self.clock.rows(), usize::min);
        self.clock.time.without_trailing_nan(rows)
    }

    fn series(&self) -> impl Iterator<Item = &Series> {
        let Clock { step, time } = &self.clock;
        [&self.position, &self.velocity, &self.image, &self.edges, step, time]
            .into_iter()
            .chain(&self.angular_velocity)
            .chain(&self.present)
            .chain(self.pistons.iter().flatten())
    }

    fn check_growth(&self, kept: usize) -> hdf5::Result<()> {
        let reals = [&self.position, &self.velocity, &self.edges].into_iter();
        let mut reals = reals.chain(&self.angular_velocity).chain(self.pistons.iter().flatten());
        reals.try_for_each(|series| series.check_growth::<f64>(kept))?;
        self.image.check_growth::<i32>(kept)?;
        self.present.iter().try_for_each(|series| series.check_growth::<u8>(kept))?;
        self.clock.check_growth(kept)
    }

    pub fn truncate(&mut self, rows: usize) -> hdf5::Result<()> {
        self.clock.truncate(rows)?;
        let series = [&mut self.position, &mut self.velocity, &mut self.image, &mut self.edges];
        let others =
            self.pistons.iter_mut().flatten().chain(&mut self.angular_velocity).chain(&mut self.present);
        for series in series.into_iter().chain(others) {
            series.resize(rows)?;
        }
        Ok(())
    }
}

/// The observables.
/// Attribute of an observable that is a column of a probe: the index of its first number in
/// [`Sample::probes`](haff_engine::Sample::probes).
const PROBE: &str = "probe";

/// The columns of probes in a file, in the order of their numbers.
fn probe_columns(group: &Group) -> hdf5::Result<Vec<(Series, Quantity)>> {
    let mut columns = Vec::new();
    for name in group.member_names()? {
        let element = group.group(&name)?;
        let Ok(attribute) = element.attr(PROBE) else { continue };
        let first = attribute.read_scalar::<u64>()? as usize;
        let values = Series::open(group, &format!("{name}/value"))?;
        let components = values.width();
        columns.push((first, components, values));
    }
    columns.sort_by_key(|&(first, ..)| first);
    // Without gaps, so that a damaged file cannot ask for numbers that no probe has.
    let mut end = 0;
    for &(first, components, _) in &columns {
        if first != end || components == 0 {
            return Err(format!("the columns of probes have a gap: {first} after {end}").into());
        }
        end += components;
    }
    let series = |(first, components, values)| (values, Quantity::Probe { first, components });
    Ok(columns.into_iter().map(series).collect())
}

#[derive(Debug)]
pub(crate) struct Observables {
    pub series: Vec<(Series, Quantity)>,
    pub clock: Clock,
    pub sizes: Sizes,
}

impl Observables {
    fn create(root: &Group, header: &Header) -> hdf5::Result<Self> {
        let group = root.create_group("observables")?;
        let mut clock = None;
        let mut series = Vec::new();
        for observable in observables(&header.present) {
            let Observable { name, unit, quantity, .. } = observable;
            let element = group.create_group(&name)?;
            write_text_attribute(&element, "unit", &unit)?;
            if let Quantity::Probe { first, .. } = quantity {
                element.new_attr::<u64>().create(PROBE)?.write_scalar(&(first as u64))?;
            }
            if let Quantity::Term(term) = quantity {
                write_text_attribute(&element, "label", term.label())?;
                element.new_attr::<f64>().create("balance")?.write_scalar(&term.sign())?;
            }
            let width = quantity.shape(header.sizes());
            let storage = Storage::plain((SERIES_CHUNK / width.iter().product::<usize>()).max(1), &width);
            series.push((
                match quantity {
                    Quantity::Count(_) => Series::create::<i64>(&element, "value", &width, &storage)?,
                    _ => Series::create_real(&element, "value", &width, &storage)?,
                },
                quantity,
            ));
            if clock.is_none() {
                clock = Some((Clock::create(&element)?, name));
            } else if let Some((_, first)) = &clock {
                for part in ["step", "time"] {
                    group.link_hard(&format!("{first}/{part}"), &format!("{name}/{part}"))?;
                }
            }
        }
        let Some((clock, _)) = clock else { return Err("no observables".into()) };
        Ok(Self { series, clock, sizes: header.sizes() })
    }

    fn open(root: &Group, sizes: Sizes) -> hdf5::Result<Self> {
        let group = root.group("observables")?;
        let mut series = Vec::new();
        let mut clock = None;
        for Observable { name, quantity, .. } in observables(&SceneFeatures::all()) {
            if group.link_exists(&name) {
                let width = quantity.shape(sizes);
                let values = Series::open(&group, &format!("{name}/value"))?.expect(&width)?;
                series.push((values, quantity));
                clock.get_or_insert(name);
            }
        }
        series.extend(probe_columns(&group)?);
        let Some(first) = clock else { return Err("no observables".into()) };
        Ok(Self { series, clock: Clock::open(&group.group(&first)?)?, sizes })
    }

    /// Number of complete samples.
    pub fn rows(&self) -> hdf5::Result<usize> {
        let rows = self.series.iter().map(|(series, _)| series.rows()).fold(self.clock.rows(), usize::min);
        self.clock.time.without_trailing_nan(rows)
    }

    fn check_growth(&self, kept: usize) -> hdf5::Result<()> {
        for (series, quantity) in &self.series {
            match quantity {
                Quantity::Count(_) => series.check_growth::<i64>(kept)?,
                _ => series.check_growth::<f64>(kept)?,
            }
        }
        self.clock.check_growth(kept)
    }

    pub fn truncate(&mut self, rows: usize) -> hdf5::Result<()> {
        self.clock.truncate(rows)?;
        self.series.iter_mut().try_for_each(|(series, _)| series.resize(rows))
    }
}

/// All growing datasets of a file.
#[derive(Debug)]
pub(crate) struct Datasets {
    pub trajectory: Option<Trajectory>,
    pub observables: Option<Observables>,
    pub events: Option<Columns>,
    pub profiles: Profiles,
    pub correlations: CorrelationTables,
    pub slots: [Slot; 2],
}

impl Datasets {
    /// Creates all groups and datasets, and writes all fixed data.
    pub fn create(root: &Group, header: &Header) -> hdf5::Result<Self> {
        write_h5md(root, header)?;
        write_parameters(root, header)?;
        let particles = header.species.len();
        let all = root.create_group("particles")?.create_group("all")?;
        let box_group = all.create_group("box")?;
        box_group.new_attr::<i32>().create("dimension")?.write_scalar(&3)?;
        let boundary = header.boundary.map(|boundary| match boundary {
            Boundary::Periodic => "periodic",
            Boundary::Wall | Boundary::Open => "none",
        });
        let boundary = boundary.map(|name| FixedAscii::<8>::from_ascii(name).unwrap_or_default());
        box_group.new_attr::<FixedAscii<8>>().shape(3).create("boundary")?.write(&boundary)?;
        let ids: Vec<u32> = (0..particles as u32).collect();
        write_array(&all, "id", &ids)?;
        write_array(&all, "species", &header.species)?;
        write_array(&all, "mass", &header.mass)?;
        write_array(&all, "radius", &header.radius)?;
        let spin = header.present.spin;
        entered::begin(&all, header.used)?;
        if spin {
            write_array(&all, "inertia", &header.inertia)?;
        }
        let trajectory = if header.frames {
            let sizes = (particles, header.pistons.len());
            Some(Trajectory::create(&all, sizes, &header.present, header.compressed)?)
        } else {
            write_array(&box_group, "edges", &header.box_size.to_array())?;
            None
        };
        let observables = if header.observables { Some(Observables::create(root, header)?) } else { None };
        let events = if header.events.is_empty() {
            None
        } else {
            Some(Columns::create(&root.create_group("events")?, &header.events, header.compressed)?)
        };
        let checkpoint = root.group(handshake::GROUP)?;
        let tail = match (header.events.is_empty(), has_tangential(&header.events)) {
            (true, _) => Tail::None,
            (false, false) => Tail::Plain,
            (false, true) => Tail::Tangential,
        };
        let slot = |name| Slot::create(&checkpoint, name, particles, spin, tail);
        Ok(Self {
            trajectory,
            observables,
            events,
            profiles: Profiles::create(root, &header.measure.profiles, header.dimension)?,
            correlations: CorrelationTables::create(root, &header.measure.correlations)?,
            slots: [slot("0")?, slot("1")?],
        })
    }

    /// Opens all growing datasets, and checks the shapes of their rows.
    pub fn open(root: &Group, particles: usize, sizes: Sizes) -> hdf5::Result<Self> {
        let all = root.group("particles/all")?;
        let trajectory = if all.link_exists("position") {
            Some(Trajectory::open(&all, particles, sizes.pistons)?)
        } else {
            None
        };
        let observables =
            if root.link_exists("observables") { Some(Observables::open(root, sizes)?) } else { None };
        let events =
            if root.link_exists("events") { Some(Columns::open(&root.group("events")?)?) } else { None };
        let checkpoint = root.group(handshake::GROUP)?;
        let slots = [Slot::open(&checkpoint, "0", particles)?, Slot::open(&checkpoint, "1", particles)?];
        let profiles = Profiles::open(root)?;
        let correlations = CorrelationTables::open(root)?;
        Ok(Self { trajectory, observables, events, profiles, correlations, slots })
    }

    /// Drops all rows after a checkpoint.
    pub fn truncate(&mut self, saved: &Saved) -> hdf5::Result<()> {
        let rows = saved.progress;
        if let Some(trajectory) = &mut self.trajectory {
            trajectory.truncate(rows.frames)?;
        }
        if let Some(observables) = &mut self.observables {
            observables.truncate(rows.samples)?;
        }
        if let Some(events) = &mut self.events {
            // Back to whole chunks; the remaining rows are in the checkpoint.
            events.truncate(rows.events - saved.tail.len())?;
        }
        self.profiles.truncate(saved.time())
    }

    /// Parts of the file, as places and sizes, that [`Datasets::truncate`] changes.
    pub fn cut_chunks(&self, saved: &Saved) -> hdf5::Result<Vec<(u64, usize)>> {
        let rows = saved.progress;
        let mut growing = self.profiles.series(saved.time())?;
        if let Some(trajectory) = &self.trajectory {
            growing.extend(trajectory.series().map(|series| (series, rows.frames)));
        }
        if let Some(Observables { series, clock, .. }) = &self.observables {
            let all = series.iter().map(|(series, _)| series).chain([&clock.step, &clock.time]);
            growing.extend(all.map(|series| (series, rows.samples)));
        }
        if let Some(events) = &self.events {
            growing.extend(events.series().map(|series| (series, rows.events - saved.tail.len())));
        }
        let mut found = Vec::new();
        for (series, kept) in growing {
            found.extend(series.cut_chunks(kept)?);
        }
        Ok(found)
    }

    /// Fails unless the run can go on from a checkpoint: rows can be added after those that it counts.
    pub fn check_growth(&self, root: &hdf5::File, saved: &Saved) -> hdf5::Result<()> {
        let rows = saved.progress;
        if let Some(trajectory) = &self.trajectory {
            trajectory.check_growth(rows.frames)?;
        }
        if let Some(observables) = &self.observables {
            observables.check_growth(rows.samples)?;
        }
        if let Some(events) = &self.events {
            events.check_growth(rows.events - saved.tail.len())?;
        }
        self.profiles.check_growth(saved.time())?;
        self.correlations.check_growth()?;
        self.slots.iter().try_for_each(Slot::check_growth)?;
        check_extents(root, root.size())
    }
}

fn write_h5md(root: &Group, header: &Header) -> hdf5::Result<()> {
    let h5md = root.create_group("h5md")?;
    h5md.new_attr::<i32>().shape(2).create("version")?.write(&[1, 1])?;
    let author = h5md.create_group("author")?;
    write_text_attribute(&author, "name", "N/A")?;
    let creator = h5md.create_group("creator")?;
    write_text_attribute(&creator, "name", "haff")?;
    write_text_attribute(&creator, "version", &header.version)
}

fn write_parameters(root: &Group, header: &Header) -> hdf5::Result<()> {
    let group = root.create_group("parameters")?;
    write_text(&group, "scene", &header.scene_toml)?;
    write_text(&group, "title", &header.title)?;
    write_text(&group, "version", &header.version)?;
    write_text(&group, "git_revision", &header.git_revision)?;
    write_scalar(&group, "seed", &header.seed)?;
    write_scalar(&group, "schema", &header.schema)?;
    write_scalar(&group, "trajectory_version", &header.trajectory_version)?;
    write_scalar(&group, "dimension", &(header.dimension as u32))?;
    write_array(&group, "box_origin", &header.box_origin.to_array())?;
    write_array(&group, "box_size", &header.box_size.to_array())?;
    write_array(&group, "conserved_momentum", &header.conserved_momentum.map(u8::from))?;
    if !header.earlier.is_empty() {
        write_text(&group, EARLIER, &header.earlier)?;
    }
    write_array(&group, "species_names", &texts(&header.species_names)?)?;
    if !header.pistons.is_empty() {
        write_array(&group, PISTONS, &header.pistons)?;
    }
    meshes::write(&group, &header.meshes)?;
    write_array(&group, "wall_names", &texts(&header.wall_names)?)
}

fn texts(names: &[String]) -> hdf5::Result<Vec<VarLenUnicode>> {
    names.iter().map(|name| text(name)).collect()
}

/// Writes a string dataset.
pub(crate) fn write_text(group: &Group, name: &str, value: &str) -> hdf5::Result<()> {
    write_scalar(group, name, &text(value)?)
}

fn write_scalar<T: H5Type>(group: &Group, name: &str, value: &T) -> hdf5::Result<()> {
    group.new_dataset::<T>().obj_track_times(false).create(name)?.write_scalar(value)
}

fn write_array<T: H5Type>(group: &Group, name: &str, values: &[T]) -> hdf5::Result<()> {
    let dataset = group.new_dataset::<T>().obj_track_times(false).shape(values.len()).create(name)?;
    if values.is_empty() { Ok(()) } else { dataset.write(values) }
}
