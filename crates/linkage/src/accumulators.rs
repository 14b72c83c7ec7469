//! Sums accumulated over a run.

use glam::DVec3;
use haff_engine::{Counters, Sum};

/// Energies and momenta accumulated since the start.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(crate) struct Accumulators {
    pub initial_kinetic: f64,
    pub initial_potential: f64,
    pub dissipated: Sum,
    pub carnot: Sum,
    pub work: Sum,
    /// External impulses, and their moments about the origin.
    pub impulse: [Sum; 3],
    pub moment: [Sum; 3],
    pub counters: Counters,
    pub max_overlap: f64,
    pub sampled_at: f64,
    /// `u64::MAX` before the first sample.
    pub sampled_collisions: u64,
    pub sampled_flights: u64,
}

impl Accumulators {
    /// Adds an external impulse on a particle at `x`.
    pub fn add_impulse(&mut self, x: DVec3, impulse: DVec3) {
        self.add_momentum(impulse, x.cross(impulse));
    }

    /// Adds external changes of momentum and of angular momentum.
    pub fn add_momentum(&mut self, momentum: DVec3, moment: DVec3) {
        for axis in 0..3 {
            self.impulse[axis].add(momentum[axis]);
            self.moment[axis].add(moment[axis]);
        }
    }

    /// External impulse since the start.
    pub fn impulse(&self) -> DVec3 {
        DVec3::from_array(self.impulse.map(|sum| sum.value()))
    }

    /// Its moment about the origin.
    pub fn moment(&self) -> DVec3 {
        DVec3::from_array(self.moment.map(|sum| sum.value()))
    }
}
