//! Boxes that are compressed while a run goes on: the pressure that ends it, and what they are like when it
//! cannot go on.

use std::fmt;

use haff_engine::{Sample, significant};
use haff_linkage::AnySimulation;
use haff_scene::{GrowthEnd, GrowthRun};

/// A box that is compressed or expands, at a sample.
#[derive(Debug, Clone, Copy)]
pub struct Compressed {
    /// Time of the sample [time].
    pub time: f64,
    /// Whether an edge becomes shorter.
    pub shrinks: bool,
    packing_fraction: f64,
    dimension: f64,
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
            dimension: granular.system().dimension.count() as f64,
            reduced_pressure: pressure * sample.box_volume
                / (simulation.particles() as f64 * sample.temperature),
        })
    }
}

impl Compressed {
    /// The packing fraction of jamming, from p = d/(1 − φ/φ_J), which holds near it; `None` far from it.
    fn jamming(&self) -> Option<f64> {
        (self.reduced_pressure > JAMMING)
            .then(|| self.packing_fraction / (1.0 - self.dimension / self.reduced_pressure))
    }

    /// Why a growth ends at this sample, after so many collisions.
    pub fn end(&self, growth: &GrowthRun, collisions: u64) -> Option<Grown> {
        // Particles that have been pushed apart at the start nearly touch each other.
        if collisions <= FIRST * growth.step {
            return None;
        }
        match growth.end? {
            GrowthEnd::ReducedPressure(pressure) => {
                (self.reduced_pressure >= pressure).then_some(Grown::ReducedPressure)
            }
            GrowthEnd::PackingFraction(wanted) => {
                self.jamming().filter(|jamming| *jamming < wanted).map(|_| Grown::Jammed { wanted })
            }
        }
    }
}

/// Why a growth ends at a sample.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Grown {
    /// It has its reduced pressure.
    ReducedPressure,
    /// It jams before it has its packing fraction.
    Jammed { wanted: f64 },
}

/// Steps of a growth before its pressure counts.
const FIRST: u64 = 5;
/// Reduced pressure from which on the packing fraction of jamming follows from it.
const JAMMING: f64 = 1e3;

impl fmt::Display for Compressed {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [fraction, pressure] = [(self.packing_fraction, 6), (self.reduced_pressure, 4)]
            .map(|(x, digits)| significant(x, digits));
        write!(out, "jammed at φ = {fraction}, reduced pressure {pressure}")
    }
}
