//! The columns of the event log.

use glam::DVec3;
use haff_engine::{EventColumn, EventKind, EventRecord};
use hdf5::{
    Group, H5Type,
    types::{EnumMember, EnumType, IntSize, TypeDescriptor},
};

use crate::{
    pack::{Number, Packer},
    series::{Series, Storage},
};

/// Rows per chunk of the event log's columns. Half as many waste 2 bytes a row more at the ends of pages;
/// twice as many are no faster, and make checkpoints and short logs larger.
pub const EVENT_CHUNK: usize = 1 << 13;

/// [`EventKind`] as stored in the file: an enumeration of its names.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(transparent)]
pub(crate) struct Kind(u8);

// SAFETY: a kind is one byte without padding, as its descriptor says, and any byte is a value of it.
unsafe impl H5Type for Kind {
    fn type_descriptor() -> TypeDescriptor {
        let member = |kind: EventKind| EnumMember { name: kind.name().to_owned(), value: kind as u64 };
        let members = EventKind::ALL.map(member).to_vec();
        TypeDescriptor::Enum(EnumType { size: IntSize::U1, signed: false, members })
    }
}

impl Number for Kind {
    const SIZE: usize = 1;

    fn bytes(self) -> [u8; 8] {
        u64::from(self.0).to_le_bytes()
    }
}

impl From<EventKind> for Kind {
    fn from(kind: EventKind) -> Self {
        Self(kind as u8)
    }
}

/// An event as one compound row, for the rows of a checkpoint that do not fill a chunk.
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
            kind: event.kind as u32,
        }
    }
}

impl Row {
    /// The event; `None` if its kind is unknown.
    pub fn event(&self) -> Option<EventRecord> {
        Some(EventRecord {
            time: self.time,
            kind: *EventKind::ALL.get(self.kind as usize)?,
            i: self.i,
            j: self.j,
            approach_speed: self.approach_speed,
            impulse: self.impulse,
            energy_loss: self.energy_loss,
            carnot_energy: self.carnot_energy,
            normal: self.normal.into(),
            position: self.position.into(),
            impulse_vector: DVec3::from(self.normal) * self.impulse,
            tangential_loss: 0.0,
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

/// The columns of a row that rough contacts and thermal walls add: the impulse vector and the tangential
/// loss.
pub(crate) type Tangential = [f64; 4];

/// These columns of an event.
pub(crate) fn tangential(event: &EventRecord) -> Tangential {
    let [x, y, z] = event.impulse_vector.to_array();
    [x, y, z, event.tangential_loss]
}

/// Sets these columns of an event.
pub(crate) fn set_tangential(event: &mut EventRecord, values: &[f64]) {
    event.impulse_vector = DVec3::from_slice(&values[..3]);
    event.tangential_loss = values[3];
}

/// Whether a log has such columns.
pub(crate) fn has_tangential(columns: &[EventColumn]) -> bool {
    columns.contains(&EventColumn::ImpulseVector) || columns.contains(&EventColumn::TangentialLoss)
}

/// A column of the log, in the file.
#[derive(Debug)]
struct Column {
    field: EventColumn,
    series: Series,
}

impl Column {
    fn create(group: &Group, field: EventColumn, compressed: bool) -> hdf5::Result<Self> {
        let width: &[usize] = if is_vector(field) { &[3] } else { &[] };
        let storage = Storage { compressed, ..Storage::plain(EVENT_CHUNK, width) };
        let name = field.name();
        let series = match field {
            EventColumn::Kind => Series::create::<Kind>(group, name, width, &storage)?,
            EventColumn::I | EventColumn::J => Series::create::<u32>(group, name, width, &storage)?,
            _ => Series::create_real(group, name, width, &storage)?,
        };
        Ok(Self { field, series })
    }

    /// Appends the column's values of some rows: a whole chunk, or the last rows of the file.
    fn append(&mut self, events: &[EventRecord], packer: &mut Packer) -> hdf5::Result<()> {
        let (count, rows) = (events.len(), events.iter());
        let series = &mut self.series;
        match self.field {
            EventColumn::Time => series.append_chunk(count, rows.map(|event| event.time), packer),
            EventColumn::Kind => series.append_chunk(count, rows.map(|event| Kind::from(event.kind)), packer),
            EventColumn::I => series.append_chunk(count, rows.map(|event| event.i), packer),
            EventColumn::J => series.append_chunk(count, rows.map(|event| event.j), packer),
            EventColumn::ApproachSpeed => {
                series.append_chunk(count, rows.map(|event| event.approach_speed), packer)
            }
            EventColumn::Impulse => series.append_chunk(count, rows.map(|event| event.impulse), packer),
            EventColumn::EnergyLoss => {
                series.append_chunk(count, rows.map(|event| event.energy_loss), packer)
            }
            EventColumn::CarnotEnergy => {
                series.append_chunk(count, rows.map(|event| event.carnot_energy), packer)
            }
            EventColumn::Normal => {
                series.append_chunk(count, rows.flat_map(|event| event.normal.to_array()), packer)
            }
            EventColumn::Position => {
                series.append_chunk(count, rows.flat_map(|event| event.position.to_array()), packer)
            }
            EventColumn::ImpulseVector => {
                series.append_chunk(count, rows.flat_map(|event| event.impulse_vector.to_array()), packer)
            }
            EventColumn::TangentialLoss => {
                series.append_chunk(count, rows.map(|event| event.tangential_loss), packer)
            }
        }
    }
}

fn is_vector(field: EventColumn) -> bool {
    matches!(field, EventColumn::Normal | EventColumn::Position | EventColumn::ImpulseVector)
}

/// The columns of `events`.
#[derive(Debug)]
pub(crate) struct Columns {
    time: Series,
    others: Vec<Column>,
    packer: Packer,
}

impl Columns {
    /// New, empty columns: those of `fields`, and always the time.
    pub fn create(group: &Group, fields: &[EventColumn], compressed: bool) -> hdf5::Result<Self> {
        let time = Column::create(group, EventColumn::Time, compressed)?.series;
        let mut others = Vec::new();
        for field in EventColumn::ALL.into_iter().skip(1).filter(|field| fields.contains(field)) {
            others.push(Column::create(group, field, compressed)?);
        }
        Ok(Self { time, others, packer: Packer::new() })
    }

    /// The columns of an existing file.
    pub fn open(group: &Group) -> hdf5::Result<Self> {
        let mut others = Vec::new();
        for field in EventColumn::ALL.into_iter().skip(1).filter(|field| group.link_exists(field.name())) {
            let width: &[usize] = if is_vector(field) { &[3] } else { &[] };
            let series = Series::open(group, field.name())?.expect(width)?;
            others.push(Column { field, series });
        }
        Ok(Self { time: Series::open(group, "time")?.expect(&[])?, others, packer: Packer::new() })
    }

    /// Names of the columns.
    pub fn names(&self) -> Vec<String> {
        let others = self.others.iter().map(|column| column.field);
        [EventColumn::Time].into_iter().chain(others).map(|field| field.name().to_owned()).collect()
    }

    /// Number of rows present in all columns.
    pub fn rows(&self) -> hdf5::Result<usize> {
        let rows = self.others.iter().map(|column| column.series.rows()).fold(self.time.rows(), usize::min);
        self.time.without_trailing_nan(rows)
    }

    pub fn series(&self) -> impl Iterator<Item = &Series> {
        std::iter::once(&self.time).chain(self.others.iter().map(|column| &column.series))
    }

    /// Fails unless whole chunks of rows can be added after the first `kept` ones.
    pub fn check_growth(&self, kept: usize) -> hdf5::Result<()> {
        self.time.check_growth::<f64>(kept)?;
        for Column { field, series } in &self.others {
            match field {
                EventColumn::Kind => series.check_growth::<Kind>(kept)?,
                EventColumn::I | EventColumn::J => series.check_growth::<u32>(kept)?,
                _ => series.check_growth::<f64>(kept)?,
            }
        }
        match self.series().find(|series| series.is_off(EVENT_CHUNK)) {
            Some(series) => Err(format!("{} has no chunks of {EVENT_CHUNK} rows", series.name()).into()),
            None => Ok(()),
        }
    }

    /// Sets the number of rows of all columns.
    pub fn truncate(&mut self, rows: usize) -> hdf5::Result<()> {
        self.time.resize(rows)?;
        self.others.iter_mut().try_for_each(|column| column.series.resize(rows))
    }

    /// Appends rows, except for their times: a whole chunk, or the last ones of the file.
    pub fn append(&mut self, events: &[EventRecord]) -> hdf5::Result<()> {
        self.others.iter_mut().try_for_each(|column| column.append(events, &mut self.packer))
    }

    /// Appends the times of rows that are already written, chunk by chunk: only then do these rows exist.
    pub fn append_times(&mut self, times: &[f64]) -> hdf5::Result<()> {
        for chunk in times.chunks(EVENT_CHUNK) {
            self.time.append_chunk(chunk.len(), chunk.iter().copied(), &mut self.packer)?;
        }
        Ok(())
    }

    /// Time of a row [time].
    pub fn time(&self, row: usize) -> hdf5::Result<f64> {
        self.time.read::<f64>(row, row + 1).map(|times| times[0])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_preserve_the_kinds_of_events() {
        for (number, kind) in EventKind::ALL.into_iter().enumerate() {
            assert_eq!((kind as usize, Kind::from(kind)), (number, Kind(number as u8)), "{kind:?}");
        }
        let TypeDescriptor::Enum(stored) = Kind::type_descriptor() else { panic!("kinds are an enum") };
        let names: Vec<&str> = stored.members.iter().map(|member| member.name.as_str()).collect();
        assert_eq!(names, EventKind::ALL.map(EventKind::name), "files name kinds as the engine does");
        let row = Row {
            time: 1.0,
            approach_speed: 0.0,
            impulse: 0.0,
            energy_loss: 0.0,
            carnot_energy: 0.0,
            normal: [0.0; 3],
            position: [0.0; 3],
            i: 0,
            j: 1,
            kind: 0,
        };
        let kind = |kind: usize| Row { kind: kind as u32, ..row }.event().map(|event| event.kind);
        assert_eq!(EventKind::ALL.map(|each| kind(each as usize)), EventKind::ALL.map(Some));
        assert_eq!(kind(EventKind::ALL.len()), None, "an unknown kind is not an event");
    }
}
