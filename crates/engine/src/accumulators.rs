//! The running account of a simulation: what its events have added up to.

use glam::DVec3;

use crate::{
    force::{self, Total},
    ledger::Term,
    report::Counters,
    sum::Sum,
};

/// Sums over events. The pressure's sums cover the time since the previous sample.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct Accumulators {
    /// Σ ΔT, Σ E'_c.
    pub dissipated: Sum,
    pub carnot: Sum,
    /// The other terms of the balance of energies, by [`Term`].
    pub terms: [Sum; Term::ALL.len()],
    /// Impulse of walls and bodies of infinite mass on the particles, and of the support of resting ones.
    pub impulse: Total,
    pub counters: Counters,
    /// Σ J |r₁₂| since the previous sample.
    pub virial: Sum,
    /// Σ (ΔT − W)(t − t_previous): with it the mean kinetic energy of the interval is exact without gravity.
    pub loss_moment: Sum,
    /// Time of the previous sample [time], and collisions until then.
    pub sampled_at: f64,
    pub sampled_collisions: u64,
    pub sampled_kinetic: f64,
    /// Kinetic and potential energy at the start, gravity's impulse per time.
    pub initial_energy: [f64; 2],
    /// Largest overlap found so far [contact distances].
    pub max_overlap: f64,
}

impl Accumulators {
    /// Adds an impulse of the outer world.
    #[inline]
    pub fn add_impulse(&mut self, impulse: DVec3) {
        force::add(&mut self.impulse, impulse);
    }

    /// Books a collision and its J |r₁₂|.
    #[inline(always)]
    pub fn add_collision(&mut self, virial: f64) {
        self.counters.collisions += 1;
        self.virial.add(virial);
    }

    /// Books losses of one event at `time`.
    #[inline]
    pub fn add_losses(&mut self, time: f64, energy_loss: f64, carnot_energy: f64) {
        self.dissipated.add(energy_loss);
        self.carnot.add(carnot_energy);
        self.loss_moment.add(energy_loss * (time - self.sampled_at));
    }

    /// Adds energy that the particles get, or lose by a term of negative sign, at `time`.
    #[inline]
    pub fn add_energy(&mut self, term: Term, time: f64, energy: f64) {
        self.terms[term as usize].add(energy);
        self.loss_moment.add(-term.sign() * energy * (time - self.sampled_at));
    }
}
