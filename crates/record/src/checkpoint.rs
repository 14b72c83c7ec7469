//! Checkpoints: two slots, written alternately, so that one of them is complete at any instant.
//!
//! A slot is valid when the checksum in its `header`, which is written last, fits its content. The header is
//! `[sequence, frames, samples, events, tail, scalars, resting, measured, checksum]`: a running number that
//! shows which slot is newer, the rows that trajectory, observables and event log have at that moment (those
//! of the event log including its `tail` rows that do not fill a chunk and are stored here), the number of
//! scalars, the number of entries of `resting`, the number of words of the measurements.

use glam::DVec3;
use haff_engine::{Checkpoint, EventRecord};
use hdf5::{Dataset, Group, H5Type};
use ndarray::{ArrayView1, ArrayView2, Ix2};
use xxhash_rust::xxh3::Xxh3;

use crate::{
    declared::{checked_text, read_all},
    events::{Row, Tangential, set_tangential, tangential},
    growth::check_fixed,
    series::{Name, Series, Storage},
};

/// Names of the entries of a slot's header, in order.
const HEADER: [&str; 9] =
    ["sequence", "frames", "samples", "events", "tail", "scalars", "resting", "measured", "checksum"];
/// The content of a slot's header.
pub(crate) type SlotHeader = [u64; HEADER.len()];
/// Rows per chunk of data of variable length.
const CHUNK: usize = 1024;
/// Bytes of the chunks that each slot begins with, whatever it holds: of the names and values of scalars, and
/// with an event log of its tail.
pub(crate) struct SlotChunks {
    pub names: u64,
    pub tail: u64,
    pub tail_tangential: u64,
}
pub(crate) const SLOT: SlotChunks = SlotChunks {
    names: (CHUNK * (size_of::<Name>() + size_of::<u64>())) as u64,
    tail: (CHUNK * size_of::<Row>()) as u64,
    tail_tangential: (CHUNK * size_of::<Tangential>()) as u64,
};
/// Vectors written at a time.
const VECTORS: usize = 1 << 15;

/// Number of rows in a file when a checkpoint is taken.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) struct Progress {
    /// Frames.
    pub frames: usize,
    /// Rows of the observables.
    pub samples: usize,
    /// Event rows, including those in `tail`.
    pub events: usize,
}

/// A checkpoint as read from a slot.
#[derive(Debug, Clone)]
pub(crate) struct Saved {
    pub sequence: u64,
    pub progress: Progress,
    pub state: Checkpoint,
    pub tail: Vec<EventRecord>,
}

impl Saved {
    /// Time of the state.
    pub fn time(&self) -> f64 {
        let time = self.state.scalars.iter().find(|(name, _)| name == "clock.time");
        time.map_or(f64::INFINITY, |(_, bits)| f64::from_bits(*bits))
    }
}

/// The columns of event rows in a slot.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Tail {
    /// No events.
    None,
    Plain,
    /// Also those of rough contacts and thermal walls.
    Tangential,
}

/// One of the two slots.
#[derive(Debug)]
pub(crate) struct Slot {
    header: Dataset,
    position: Dataset,
    velocity: Dataset,
    image: Dataset,
    anchor: Dataset,
    count: Dataset,
    resting: Dataset,
    /// With spin.
    angular_velocity: Option<Dataset>,
    names: Series,
    values: Series,
    measured: Series,
    tail: Option<Series>,
    tail_tangential: Option<Series>,
    particles: usize,
}

impl Slot {
    /// An empty slot.
    pub fn create(
        parent: &Group,
        name: &str,
        particles: usize,
        spin: bool,
        tail: Tail,
    ) -> hdf5::Result<Self> {
        let group = parent.create_group(name)?;
        let header = fixed::<u64>(&group, "header", &[HEADER.len()])?;
        header.write(&ndarray::Array1::<u64>::zeros(HEADER.len()))?;
        let names = HEADER.map(|name| Name::from_ascii(name).unwrap_or_default());
        header.new_attr::<Name>().shape(names.len()).create("names")?.write(&names)?;
        let plain = Storage::plain(CHUNK, &[]);
        Ok(Self {
            header,
            position: fixed::<f64>(&group, "position", &[particles, 3])?,
            velocity: fixed::<f64>(&group, "velocity", &[particles, 3])?,
            image: fixed::<i32>(&group, "image", &[particles, 3])?,
            anchor: fixed::<i64>(&group, "anchor", &[particles])?,
            count: fixed::<u32>(&group, "count", &[particles])?,
            resting: fixed::<u32>(&group, "resting", &[particles])?,
            angular_velocity: if spin {
                Some(fixed::<f64>(&group, "angular_velocity", &[particles, 3])?)
            } else {
                None
            },
            names: Series::create::<Name>(&group, "scalar_names", &[], &plain)?,
            values: Series::create::<u64>(&group, "scalars", &[], &plain)?,
            measured: Series::create::<u64>(&group, "measured", &[], &plain)?,
            tail: if tail == Tail::None {
                None
            } else {
                Some(Series::create::<Row>(&group, "tail", &[], &plain)?)
            },
            tail_tangential: if tail == Tail::Tangential {
                let storage = Storage::plain(CHUNK, &[4]);
                Some(Series::create::<f64>(&group, "tail_tangential", &[4], &storage)?)
            } else {
                None
            },
            particles,
        })
    }

    /// A slot of an existing file.
    pub fn open(parent: &Group, name: &str, particles: usize) -> hdf5::Result<Self> {
        let group = parent.group(name)?;
        let dataset = |name: &str, shape: &[usize]| -> hdf5::Result<Dataset> {
            let dataset = group.dataset(name)?;
            let found = dataset.get_shape()?;
            if found == shape {
                Ok(dataset)
            } else {
                Err(format!("{} has shape {found:?} instead of {shape:?}", dataset.name()).into())
            }
        };
        Ok(Self {
            header: dataset("header", &[HEADER.len()])?,
            particles,
            position: dataset("position", &[particles, 3])?,
            velocity: dataset("velocity", &[particles, 3])?,
            image: dataset("image", &[particles, 3])?,
            anchor: dataset("anchor", &[particles])?,
            count: dataset("count", &[particles])?,
            resting: dataset("resting", &[particles])?,
            angular_velocity: if group.link_exists("angular_velocity") {
                Some(dataset("angular_velocity", &[particles, 3])?)
            } else {
                None
            },
            names: Series::open(&group, "scalar_names")?.expect(&[])?,
            values: Series::open(&group, "scalars")?.expect(&[])?,
            measured: Series::open(&group, "measured")?.expect(&[])?,
            tail: if group.link_exists("tail") {
                Some(Series::open(&group, "tail")?.expect(&[])?)
            } else {
                None
            },
            tail_tangential: if group.link_exists("tail_tangential") {
                Some(Series::open(&group, "tail_tangential")?.expect(&[4])?)
            } else {
                None
            },
        })
    }

    /// Fails unless another checkpoint can be written here.
    pub fn check_growth(&self) -> hdf5::Result<()> {
        check_fixed::<u64>(&self.header)?;
        [&self.position, &self.velocity]
            .into_iter()
            .chain(&self.angular_velocity)
            .try_for_each(check_fixed::<f64>)?;
        check_fixed::<i32>(&self.image)?;
        check_fixed::<i64>(&self.anchor)?;
        [&self.count, &self.resting].into_iter().try_for_each(check_fixed::<u32>)?;
        self.names.check_growth::<Name>(0)?;
        [&self.values, &self.measured].into_iter().try_for_each(|series| series.check_growth::<u64>(0))?;
        self.tail.iter().try_for_each(|series| series.check_growth::<Row>(0))?;
        self.tail_tangential.iter().try_for_each(|series| series.check_growth::<f64>(0))
    }

    /// Writes the content of the slot; after a flush, [`Slot::seal`] makes it valid. Returns the header.
    pub fn fill(&mut self, saved: &Saved) -> hdf5::Result<SlotHeader> {
        let state = &saved.state;
        write_vectors(&self.position, &state.position)?;
        write_vectors(&self.velocity, &state.velocity)?;
        if let Some(dataset) = &self.angular_velocity {
            write_vectors(dataset, &state.angular_velocity)?;
        }
        self.image.write(matrix(state.image.as_flattened())?)?;
        self.anchor.write(ArrayView1::from(&state.anchor))?;
        self.count.write(ArrayView1::from(&state.count))?;
        if state.resting.len() == self.particles {
            self.resting.write(ArrayView1::from(&state.resting))?;
        }
        let (names, values): (Vec<Name>, Vec<u64>) = state
            .scalars
            .iter()
            .map(|(name, bits)| (Name::from_ascii(name.as_str()).unwrap_or_default(), *bits))
            .unzip();
        overwrite(&mut self.names, &names)?;
        overwrite(&mut self.values, &values)?;
        overwrite(&mut self.measured, &state.measured)?;
        if let Some(tail) = &mut self.tail {
            overwrite(tail, &saved.tail.iter().map(Row::from).collect::<Vec<_>>())?;
        }
        if let Some(series) = &mut self.tail_tangential {
            let rows: Vec<Tangential> = saved.tail.iter().map(tangential).collect();
            if saved.tail.len() > series.rows() {
                series.resize(saved.tail.len())?;
            }
            if !rows.is_empty() {
                series.write(0, rows.as_flattened())?;
            }
        }
        Ok(self.header(saved))
    }

    /// Whether checkpoints have angular velocities.
    pub fn has_spin(&self) -> bool {
        self.angular_velocity.is_some()
    }

    /// The header of a checkpoint in this slot.
    fn header(&self, saved: &Saved) -> SlotHeader {
        header(saved, self.tail_tangential.is_some())
    }

    /// Writes the header.
    pub fn seal(&self, header: SlotHeader) -> hdf5::Result<()> {
        self.header.write(ArrayView1::from(&header[..]))
    }

    /// The sequence number in the header, whether the slot is valid or not; 0 if it was never used.
    pub fn sequence(&self) -> hdf5::Result<u64> {
        Ok(read_all::<u64>(&self.header)?.first().copied().unwrap_or(0))
    }

    /// The checkpoint in the slot; `None` if it was never used, or is not complete.
    pub fn read(&self) -> hdf5::Result<Option<Saved>> {
        let found = read_all::<u64>(&self.header)?;
        let Ok(found) = SlotHeader::try_from(found) else { return Ok(None) };
        let [sequence, frames, samples, events, tail, scalars, resting, measured, _] =
            found.map(|value| value as usize);
        let fits = scalars <= self.names.rows().min(self.values.rows())
            && tail <= self.tail.as_ref().map_or(0, Series::rows)
            && tail <= events
            && self.tail_tangential.as_ref().is_none_or(|series| tail <= series.rows())
            && resting <= self.particles
            && measured <= self.measured.rows();
        if sequence == 0 || !fits {
            return Ok(None);
        }
        let vectors = |dataset: &Dataset| -> hdf5::Result<Vec<DVec3>> {
            let flat = read_all::<f64>(dataset)?;
            Ok(flat.chunks_exact(3).map(DVec3::from_slice).collect())
        };
        let mut names = Vec::new();
        for name in self.names.read::<Name>(0, scalars)? {
            let Ok(name) = checked_text(name.as_bytes(), "") else { return Ok(None) };
            names.push(name);
        }
        let rows = match &self.tail {
            Some(series) => series.read::<Row>(0, tail)?,
            None => Vec::new(),
        };
        let Some(mut tail) = rows.iter().map(Row::event).collect::<Option<Vec<_>>>() else { return Ok(None) };
        if let Some(series) = &self.tail_tangential {
            let values = series.read::<f64>(0, tail.len())?;
            for (event, values) in tail.iter_mut().zip(values.chunks_exact(4)) {
                set_tangential(event, values);
            }
        }
        let mut stopped = read_all::<u32>(&self.resting)?;
        stopped.truncate(resting);
        let state = Checkpoint {
            position: vectors(&self.position)?,
            velocity: vectors(&self.velocity)?,
            angular_velocity: self.angular_velocity.as_ref().map_or(Ok(Vec::new()), vectors)?,
            anchor: read_all(&self.anchor)?,
            image: read_all::<i32>(&self.image)?.as_chunks().0.to_vec(),
            count: read_all(&self.count)?,
            resting: stopped,
            measured: self.measured.read(0, measured)?,
            scalars: names.into_iter().zip(self.values.read::<u64>(0, scalars)?).collect(),
        };
        let saved = Saved { sequence: found[0], progress: Progress { frames, samples, events }, state, tail };
        Ok((self.header(&saved) == found).then_some(saved))
    }
}

/// The part of a checkpoint that does not fit N particles, if there is one.
pub(crate) fn mismatch(state: &Checkpoint, particles: usize, spin: bool) -> Option<String> {
    let spins = if spin { state.angular_velocity.len() } else { particles };
    let lengths = [
        ("angular velocities", spins),
        ("positions", state.position.len()),
        ("velocities", state.velocity.len()),
        ("images", state.image.len()),
        ("anchors", state.anchor.len()),
        ("counts", state.count.len()),
    ];
    if let Some((what, length)) = lengths.into_iter().find(|(_, length)| *length != particles) {
        return Some(format!("a checkpoint with {length} {what}; the file has {particles} particles"));
    }
    if !matches!(state.resting.len(), 0) && state.resting.len() != particles {
        return Some(format!(
            "a checkpoint with {} resting particles' walls; the file has {particles} particles",
            state.resting.len()
        ));
    }
    let name =
        state.scalars.iter().map(|(name, _)| name).find(|name| Name::from_ascii(name.as_str()).is_err())?;
    Some(format!("a checkpoint with a scalar named {name:?}: names are ASCII of up to 63 characters"))
}

/// The valid checkpoint with the greatest sequence number that satisfies `accept`.
pub(crate) fn newest(slots: &[Slot; 2], accept: impl Fn(&Saved) -> bool) -> hdf5::Result<Option<Saved>> {
    let mut best: Option<Saved> = None;
    for slot in slots {
        if let Some(saved) = slot.read()?
            && best.as_ref().is_none_or(|best| best.sequence < saved.sequence)
            && accept(&saved)
        {
            best = Some(saved);
        }
    }
    Ok(best)
}

/// A dataset of fixed size whose space in the file is allocated at once.
fn fixed<T: H5Type>(group: &Group, name: &str, shape: &[usize]) -> hdf5::Result<Dataset> {
    group
        .new_dataset::<T>()
        .layout(hdf5::dataset::Layout::Contiguous)
        .alloc_time(Some(hdf5::dataset::AllocTime::Early))
        .fill_time(hdf5::dataset::FillTime::Never)
        .obj_track_times(false)
        .shape(shape.to_vec())
        .create(name)
}

/// Replaces the first rows of a series, which never shrinks.
fn overwrite<T: H5Type>(series: &mut Series, data: &[T]) -> hdf5::Result<()> {
    if data.len() > series.rows() {
        series.resize(data.len())?;
    }
    if data.is_empty() { Ok(()) } else { series.write(0, data) }
}

/// Writes [N][3], in parts: a flat copy of everything would add a third of the memory that a checkpoint
/// takes.
fn write_vectors(dataset: &Dataset, vectors: &[DVec3]) -> hdf5::Result<()> {
    let mut start = 0;
    for part in vectors.chunks(VECTORS) {
        let flat: Vec<f64> = part.iter().flat_map(DVec3::to_array).collect();
        dataset.write_slice(matrix(&flat)?, ndarray::s![start..start + part.len(), ..])?;
        start += part.len();
    }
    Ok(())
}

fn matrix<T>(flat: &[T]) -> hdf5::Result<ndarray::ArrayView<'_, T, Ix2>> {
    Ok(ArrayView2::from_shape((flat.len() / 3, 3), flat)?)
}

/// The header of a checkpoint, with the checksum of all its content.
fn header(saved: &Saved, has_tangential: bool) -> SlotHeader {
    let Saved { sequence, progress, state, tail } = saved;
    let mut header = [
        *sequence,
        progress.frames as u64,
        progress.samples as u64,
        progress.events as u64,
        tail.len() as u64,
        state.scalars.len() as u64,
        state.resting.len() as u64,
        state.measured.len() as u64,
        0,
    ];
    let mut sum = Xxh3::new();
    // In blocks: the hash is slow for a few bytes at a time.
    let mut block: Vec<u8> = Vec::with_capacity(1 << 16);
    let mut put = |bytes: &mut dyn Iterator<Item = u8>| {
        block.clear();
        block.extend(bytes);
        sum.update(&block);
    };
    put(&mut header.iter().flat_map(|value| value.to_le_bytes()));
    for vectors in [&state.position, &state.velocity, &state.angular_velocity] {
        for part in vectors.chunks(1024) {
            put(&mut part.iter().flat_map(DVec3::to_array).flat_map(f64::to_le_bytes));
        }
    }
    for part in state.image.chunks(1024) {
        put(&mut part.iter().flatten().flat_map(|image| image.to_le_bytes()));
    }
    for part in state.anchor.chunks(1024) {
        put(&mut part.iter().flat_map(|anchor| anchor.to_le_bytes()));
    }
    for values in [&state.count, &state.resting] {
        for part in values.chunks(1024) {
            put(&mut part.iter().flat_map(|value| value.to_le_bytes()));
        }
    }
    for (name, bits) in &state.scalars {
        put(&mut name.bytes().chain([0]).chain(bits.to_le_bytes()));
    }
    for part in state.measured.chunks(1024) {
        put(&mut part.iter().flat_map(|word| word.to_le_bytes()));
    }
    for event in tail {
        put(&mut Row::from(event).bytes());
        if has_tangential {
            put(&mut tangential(event).into_iter().flat_map(f64::to_le_bytes));
        }
    }
    header[HEADER.len() - 1] = sum.digest();
    header
}
