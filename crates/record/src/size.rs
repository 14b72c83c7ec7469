//! Estimate of the size of a file.

use haff_engine::{EventColumn, Grid, SceneFeatures, Sizes, observables};

use crate::{
    checkpoint::SLOT,
    datasets::frame_storage,
    events::EVENT_CHUNK,
    measured::{chunk, row_shapes},
    series::SERIES_CHUNK,
};

/// The amount of data that a run is going to record.
#[derive(Debug, Clone, Copy, Default)]
pub struct FileSize<'a> {
    /// N.
    pub particles: u64,
    /// 2 or 3.
    pub dimension: usize,
    /// Whether there are angular velocities.
    pub spin: bool,
    /// Number of pistons.
    pub pistons: usize,
    /// Frames.
    pub frames: u64,
    /// Rows of observables.
    pub samples: u64,
    /// Event rows.
    pub events: u64,
    /// Columns of the event log; empty: events are not recorded.
    pub columns: &'a [EventColumn],
    /// Whether frames and the event log are compressed.
    pub compressed: bool,
    /// Numbers that measurements add to rows of observables.
    pub measured: u64,
    /// What measurements keep for a resumed run \[bytes\].
    pub kept: u64,
    /// Profiles, with their numbers of rows.
    pub profiles: &'a [(u64, &'a Grid)],
}

/// A double with a random mantissa, compressed [bytes].
const PACKED: f64 = 6.95;
/// The same in the vectors of disks: their third component, zero, stands between the others.
const PACKED_FLAT: f64 = 10.2;
/// Groups, headers and indices of a file \[bytes\].
const GROUPS: u64 = 270_000;

/// Bytes of an event row: measured if compressed, plus half a page lost for each chunk.
fn event_row(column: EventColumn, size: &FileSize) -> f64 {
    let components = size.dimension as f64;
    let (whole, packed) = match column {
        EventColumn::Time => (8.0, 5.1),
        EventColumn::Kind => (1.0, 0.0),
        EventColumn::I | EventColumn::J => (4.0, f64::from(size.particles.max(2).ilog2() + 1) / 8.0),
        EventColumn::ApproachSpeed
        | EventColumn::Impulse
        | EventColumn::EnergyLoss
        | EventColumn::CarnotEnergy
        | EventColumn::TangentialLoss => (8.0, PACKED),
        EventColumn::Normal | EventColumn::Position | EventColumn::ImpulseVector => {
            (24.0, components * PACKED)
        }
    };
    if size.compressed { packed + 2048.0 / EVENT_CHUNK as f64 } else { whole }
}

/// Expected size of a file [bytes], to about a tenth beyond a megabyte.
pub fn estimate_file_size(size: &FileSize) -> u64 {
    let FileSize { particles, dimension, spin, frames, samples, events, measured, .. } = *size;
    let recorded = !size.columns.is_empty();
    let slot =
        SLOT.names + if recorded { SLOT.tail + if spin { SLOT.tail_tangential } else { 0 } } else { 0 };
    let fixed = GROUPS + 2 * slot + 2 * size.kept;
    // id, species, mass, radius; two checkpoint slots of 76 bytes. With spin, inertia and 24 bytes more.
    let per_particle = 4 + 4 + 8 + 8 + 2 * 76 + if spin { 8 + 2 * 24 } else { 0 };
    let storage = frame_storage(particles as usize, size.compressed);
    let compressed = storage.compressed;
    let component = if dimension == 2 { PACKED_FLAT } else { PACKED };
    // Images, small numbers, shrink to about 3 bytes.
    let vectors = if compressed { 2.0 * dimension as f64 * component + 3.0 } else { 24.0 + 24.0 + 12.0 };
    let axes = if dimension == 2 { 1.0 } else { 3.0 };
    // Uncompressed chunks are whole.
    let whole = |rows: u64, chunk: usize| rows.next_multiple_of(chunk as u64);
    let frame_rows = if compressed { frames } else { whole(frames, storage.chunk[0]) };
    let spins = match (spin, compressed) {
        (false, _) => 0.0,
        (true, true) => axes * PACKED,
        (true, false) => 24.0,
    };
    let per_frame = 8 + 8 + 24 + 48 * size.pistons as u64;
    let sizes = Sizes { species: 1, walls: 0, pistons: size.pistons, dimension };
    let per_sample = 16
        + observables(&SceneFeatures {
            stress: false,
            wall_forces: false,
            pair_collisions: false,
            compression: false,
            flow: false,
            pistons: size.pistons > 0,
            spin,
            ..SceneFeatures::all()
        })
        .iter()
        .map(|observable| 8 * observable.quantity.shape(sizes).iter().product::<usize>() as u64)
        .sum::<u64>();
    let event: f64 = size.columns.iter().map(|&column| event_row(column, size)).sum();
    let rows = if size.compressed { events } else { whole(events, EVENT_CHUNK) };
    let of_profile = |&(rows, grid): &(u64, &Grid)| {
        let of_field = |width: &Vec<usize>| {
            let numbers = width.iter().product::<usize>() as u64;
            whole(rows, chunk(width)[0]).saturating_mul(8 * numbers)
        };
        row_shapes(grid, dimension).iter().map(of_field).sum::<u64>()
    };
    let profiles = size.profiles.iter().map(of_profile).sum();
    [
        profiles,
        particles.saturating_mul(per_particle),
        whole(frames, SERIES_CHUNK).saturating_mul(per_frame),
        (frame_rows as f64 * particles as f64 * (vectors + spins)) as u64,
        whole(samples, SERIES_CHUNK).saturating_mul(per_sample),
        measured.saturating_mul(8),
        (rows as f64 * event) as u64,
    ]
    .into_iter()
    .fold(fixed, u64::saturating_add)
}
