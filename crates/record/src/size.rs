//! How large a file will be.

use crate::{
    events::EVENT_CHUNK,
    skeleton::{QUANTITIES, Quantity},
};

/// What a run is going to record.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct FileSize {
    /// N.
    pub particles: u64,
    /// Frames.
    pub frames: u64,
    /// Rows of observables.
    pub samples: u64,
    /// Event rows.
    pub events: u64,
}

/// Expected size of a file [bytes], to about a tenth beyond a megabyte; trajectories of disks come out a third
/// smaller.
pub fn estimate_file_size(size: &FileSize) -> u64 {
    let FileSize { particles, frames, samples, events } = *size;
    // Groups, headers and the first chunk of every small series.
    let fixed = 250_000;
    // id, species, mass, radius; two checkpoint slots of 76 bytes.
    let per_particle = 4 + 4 + 8 + 8 + 2 * 76;
    // Positions and velocities as they are; images shrink by about 4.
    let per_frame_particle = 24 + 24 + 3;
    let per_frame = 8 + 8 + 24;
    let per_sample = 16
        + QUANTITIES
            .iter()
            .map(|(_, quantity)| match quantity {
                Quantity::Real(_) | Quantity::Count(_) | Quantity::PerSpecies => 8,
                Quantity::Vector(_) => 24,
            })
            .sum::<u64>();
    // Four reals and two vectors as they are, in whole chunks; time shrinks by 1.5, i and j by 2, kind to nothing.
    let per_event = 4 * 8 + 2 * 24;
    let per_event_compressed = 5 + 4;
    let frame = particles.saturating_mul(per_frame_particle).saturating_add(per_frame);
    [
        particles.saturating_mul(per_particle),
        frames.saturating_mul(frame),
        samples.saturating_mul(per_sample),
        events.div_ceil(EVENT_CHUNK as u64).saturating_mul(EVENT_CHUNK as u64 * per_event),
        events.saturating_mul(per_event_compressed),
    ]
    .into_iter()
    .fold(fixed, u64::saturating_add)
}
