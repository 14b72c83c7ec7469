//! Boxes that are compressed while a run goes on: the pressure that ends it, and what they are like when it
//! cannot go on.

use std::fmt;

use haff_engine::{Sample, significant};
use haff_linkage::AnySimulation;
use haff_scene::Schedule;

/// The schedule of the tests of the reduced pressure: samples, or times of its own where there are none.
pub fn tests(samples: Schedule, interval: f64) -> Schedule {
    if samples == Schedule::Off { Schedule::Every(interval) } else { samples }
}

/// A box that is compressed or expands, at a sample.
#[derive(Debug, Clone, Copy)]
pub struct Compressed {
    /// Time of the sample [time].
    pub time: f64,
    /// Whether an edge becomes shorter.
    pub shrinks: bool,
    packing_fraction: f64,
    /// P V/(N T); NaN in the first sample, and without motion.
    pub reduced_pressure: f64,
}

impl Compressed {
    /// The box at a sample of a simulation; `None` if it is not compressed.
    pub fn of(simulation: &AnySimulation, sample: &Sample) -> Option<Self> {
        let AnySimulation::Granular(granular) = simulation else { return None };
        let compression = granular.system().domain.compression?;
        let pressure = sample.pressure.unwrap_or(f64::NAN);
        Some(Self {
            time: sample.time,
            shrinks: compression.rates.max_element() > 0.0,
            packing_fraction: sample.packing_fraction,
            reduced_pressure: pressure * sample.box_volume
                / (simulation.particles() as f64 * sample.temperature),
        })
    }
}

impl fmt::Display for Compressed {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [fraction, pressure] = [(self.packing_fraction, 6), (self.reduced_pressure, 4)]
            .map(|(x, digits)| significant(x, digits));
        write!(out, "jammed at φ = {fraction}, reduced pressure {pressure}")
    }
}
