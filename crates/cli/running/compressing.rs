//! Boxes that are compressed while a run goes on: what they are like when it ends.

use haff_engine::{Compressed, significant};
use haff_linkage::AnySimulation;

/// What a box that is compressed is like at the last sample, over the samples since the previous call.
pub fn take(simulation: &mut AnySimulation) -> Option<Compressed> {
    match simulation {
        AnySimulation::Granular(simulation) => simulation.take_compressed(),
        AnySimulation::Linkage(_) => None,
    }
}

/// Whether an edge of the box becomes shorter.
pub fn shrinks(simulation: &AnySimulation) -> bool {
    let AnySimulation::Granular(simulation) = simulation else { return false };
    simulation.system().domain.compression.is_some_and(|found| found.rates.max_element() > 0.0)
}

/// Where particles have jammed, as a clause.
pub fn jammed(last: &Compressed) -> String {
    let [fraction, pressure] =
        [(last.packing_fraction, 6), (last.reduced_pressure, 4)].map(|(x, digits)| significant(x, digits));
    format!("jammed at φ = {fraction}, reduced pressure {pressure}")
}
