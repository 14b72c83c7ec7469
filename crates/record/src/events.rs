//! The columns of the event log.

use haff_engine::{EventKind, EventRecord};
use hdf5::{Group, H5Type};

use crate::series::{Series, Storage};

/// Rows per chunk of the event log's columns. Four times as many are no faster, and make a short log a large file.
pub const EVENT_CHUNK: usize = 1 << 12;

/// [`EventKind`] as it is written.
#[derive(Debug, Clone, Copy, PartialEq, Eq, H5Type)]
#[repr(u8)]
pub(crate) enum Kind {
    #[hdf5(rename = "collision")]
    Collision = 0,
    #[hdf5(rename = "wall")]
    Wall = 1,
    #[hdf5(rename = "rest")]
    Rest = 2,
}

impl From<EventKind> for Kind {
    fn from(kind: EventKind) -> Self {
        match kind {
            EventKind::Collision => Self::Collision,
            EventKind::Wall => Self::Wall,
            EventKind::Rest => Self::Rest,
        }
    }
}

impl From<Kind> for EventKind {
    fn from(kind: Kind) -> Self {
        match kind {
            Kind::Collision => Self::Collision,
            Kind::Wall => Self::Wall,
            Kind::Rest => Self::Rest,
        }
    }
}

/// An event as one compound row: how a checkpoint keeps the rows that do not fill a chunk.
#[derive(Debug, Clone, Copy, PartialEq, H5Type)]
#[repr(C)]
pub(crate) struct Row {
    time: f64,
    approach_speed: f64,
    impulse: f64,
    energy_loss: f64,
    carnot_energy: f64,
    normal: [f64; 3],
    position: [f64; 3],
    i: u32,
    j: u32,
    kind: u32,
}

impl From<&EventRecord> for Row {
    fn from(event: &EventRecord) -> Self {
        Self {
            time: event.time,
            approach_speed: event.approach_speed,
            impulse: event.impulse,
            energy_loss: event.energy_loss,
            carnot_energy: event.carnot_energy,
            normal: event.normal.to_array(),
            position: event.position.to_array(),
            i: event.i,
            j: event.j,
            kind: u32::from(Kind::from(event.kind) as u8),
        }
    }
}

impl Row {
    /// The event; `None` if its kind is unknown.
    pub fn event(&self) -> Option<EventRecord> {
        let kind = [EventKind::Collision, EventKind::Wall, EventKind::Rest];
        Some(EventRecord {
            time: self.time,
            kind: *kind.get(self.kind as usize)?,
            i: self.i,
            j: self.j,
            approach_speed: self.approach_speed,
            impulse: self.impulse,
            energy_loss: self.energy_loss,
            carnot_energy: self.carnot_energy,
            normal: self.normal.into(),
            position: self.position.into(),
        })
    }

    /// The row as bytes, for checksums.
    pub fn bytes(&self) -> impl Iterator<Item = u8> {
        let reals = [self.time, self.approach_speed, self.impulse, self.energy_loss, self.carnot_energy];
        let reals = reals.into_iter().chain(self.normal).chain(self.position);
        reals
            .flat_map(f64::to_le_bytes)
            .chain([self.i, self.j, self.kind].into_iter().flat_map(u32::to_le_bytes))
    }
}

/// A column's value in a row.
type Value<T> = fn(&EventRecord) -> T;

/// The columns of `events`.
#[derive(Debug)]
pub(crate) struct Columns {
    time: Series,
    kind: Series,
    i: Series,
    j: Series,
    reals: Vec<(Series, Value<f64>)>,
    vectors: Vec<(Series, Value<[f64; 3]>)>,
}

const REALS: [(&str, Value<f64>); 4] = [
    ("approach_speed", |event| event.approach_speed),
    ("impulse", |event| event.impulse),
    ("energy_loss", |event| event.energy_loss),
    ("carnot_energy", |event| event.carnot_energy),
];

const VECTORS: [(&str, Value<[f64; 3]>); 2] =
    [("normal", |event| event.normal.to_array()), ("position", |event| event.position.to_array())];

impl Columns {
    /// New, empty columns.
    pub fn create(group: &Group) -> hdf5::Result<Self> {
        let plain = Storage::plain(EVENT_CHUNK, &[]);
        let compressed = Storage { compressed: true, ..plain.clone() };
        // Deflate makes full mantissas 12 to 16 % smaller at about 60 MB/s, half the rate of a fast run's events:
        // only what it at least halves, or nearly, is compressed.
        let vector = Storage::plain(EVENT_CHUNK, &[3]);
        let mut reals = Vec::new();
        for (name, value) in REALS {
            reals.push((Series::create_real(group, name, &[], &plain)?, value));
        }
        let mut vectors = Vec::new();
        for (name, value) in VECTORS {
            vectors.push((Series::create_real(group, name, &[3], &vector)?, value));
        }
        Ok(Self {
            time: Series::create_real(group, "time", &[], &compressed)?,
            kind: Series::create::<Kind>(group, "kind", &[], &compressed)?,
            i: Series::create::<u32>(group, "i", &[], &compressed)?,
            j: Series::create::<u32>(group, "j", &[], &compressed)?,
            reals,
            vectors,
        })
    }

    /// The columns of a file.
    pub fn open(group: &Group) -> hdf5::Result<Self> {
        let mut reals = Vec::new();
        for (name, value) in REALS {
            reals.push((Series::open(group, name)?, value));
        }
        let mut vectors = Vec::new();
        for (name, value) in VECTORS {
            vectors.push((Series::open(group, name)?, value));
        }
        Ok(Self {
            time: Series::open(group, "time")?,
            kind: Series::open(group, "kind")?,
            i: Series::open(group, "i")?,
            j: Series::open(group, "j")?,
            reals,
            vectors,
        })
    }

    /// Number of rows that all columns have.
    pub fn rows(&self) -> hdf5::Result<usize> {
        let others = [&self.kind, &self.i, &self.j].into_iter();
        let reals = self.reals.iter().map(|(series, _)| series);
        let vectors = self.vectors.iter().map(|(series, _)| series);
        let rows = others.chain(reals).chain(vectors).map(Series::rows).fold(self.time.rows(), usize::min);
        self.time.known(rows)
    }

    /// Sets the number of rows of all columns.
    pub fn truncate(&mut self, rows: usize) -> hdf5::Result<()> {
        for series in [&mut self.time, &mut self.kind, &mut self.i, &mut self.j] {
            series.resize(rows)?;
        }
        self.reals.iter_mut().try_for_each(|(series, _)| series.resize(rows))?;
        self.vectors.iter_mut().try_for_each(|(series, _)| series.resize(rows))
    }

    /// Adds rows, but for their times: whole chunks, or the last ones of the file.
    pub fn append(&mut self, events: &[EventRecord]) -> hdf5::Result<()> {
        let column = |value: fn(&EventRecord) -> u32| -> Vec<u32> { events.iter().map(value).collect() };
        self.kind.append(&events.iter().map(|event| Kind::from(event.kind)).collect::<Vec<_>>())?;
        self.i.append(&column(|event| event.i))?;
        self.j.append(&column(|event| event.j))?;
        for (series, value) in &mut self.reals {
            series.append(&events.iter().map(*value).collect::<Vec<_>>())?;
        }
        for (series, value) in &mut self.vectors {
            series.append(&events.iter().flat_map(*value).collect::<Vec<_>>())?;
        }
        Ok(())
    }

    /// Adds the times of rows that are there, chunk by chunk: this makes them count.
    pub fn append_times(&mut self, times: &[f64]) -> hdf5::Result<()> {
        times.chunks(EVENT_CHUNK).try_for_each(|chunk| self.time.append(chunk))
    }

    /// Time of a row [time].
    pub fn time(&self, row: usize) -> hdf5::Result<f64> {
        self.time.read::<f64>(row, row + 1).map(|times| times[0])
    }
}
