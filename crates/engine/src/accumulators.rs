//! Running sums over the events of a simulation.

use glam::DVec3;

use crate::{
    force::{self, Total},
    ledger::Term,
    report::Counters,
    sum::Sum,
};

/// Sums over events. The sums for the pressure cover the time since the previous sample.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct Accumulators {
    /// Σ ΔT, Σ E'_c.
    pub dissipated: Sum,
    pub carnot: Sum,
    /// The other terms of the energy balance, indexed by [`Term`].
    pub terms: [Sum; Term::ALL.len()],
    /// Impulse on the particles by walls, by bodies of infinite mass and by the support of resting particles.
    pub impulse: Total,
    pub counters: Counters,
    /// Σ J |r₁₂| since the previous sample.
    pub virial: Sum,
    /// Σ (ΔT − W)(t − t_previous). Without gravity it makes the mean kinetic energy of the interval exact.
    pub loss_moment: Sum,
    /// Time of the previous sample [time], the number of collisions until then, and the kinetic energy then.
    pub sampled_at: f64,
    pub sampled_collisions: u64,
    pub sampled_kinetic: f64,
    /// Kinetic and potential energy at the start.
    pub initial_energy: [f64; 2],
    /// Largest overlap found so far [contact distances].
    pub max_overlap: f64,
}

impl Accumulators {
    /// Adds an external impulse.
    #[inline]
    pub fn add_impulse(&mut self, impulse: DVec3) {
        force::add(&mut self.impulse, impulse);
    }

    /// Counts a collision and adds its virial, J |r₁₂|.
    #[inline(always)]
    pub fn add_collision(&mut self, virial: f64) {
        self.counters.collisions += 1;
        self.virial.add(virial);
    }

    /// Adds the losses of one event at `time`.
    #[inline]
    pub fn add_losses(&mut self, time: f64, energy_loss: f64, carnot_energy: f64) {
        self.dissipated.add(energy_loss);
        self.carnot.add(carnot_energy);
        self.loss_moment.add(energy_loss * (time - self.sampled_at));
    }

    /// Adds the energy of a term at `time`: energy given to the particles, or taken from them if the sign of
    /// the term is negative.
    #[inline]
    pub fn add_energy(&mut self, term: Term, time: f64, energy: f64) {
        self.terms[term as usize].add(energy);
        self.loss_moment.add(-term.sign() * energy * (time - self.sampled_at));
    }
}
