//! Running sums over the events of a simulation. They are independent of the order of the events.

use glam::DVec3;

use crate::{
    exact_sum::{ExactSum, ExactSums},
    ledger::Term,
    report::Counters,
};

/// Names of the sums in checkpoints, besides the terms of the energy balance.
const IMPACTS: [&str; 4] = ["virial", "carnot", "dissipated", "loss_moment"];
const IMPULSE: [&str; 3] = ["impulse.x", "impulse.y", "impulse.z"];

/// Sums over events. The sums for the pressure cover the time since the previous sample.
#[derive(Debug, Clone, Default)]
pub(crate) struct Accumulators {
    /// Σ J |r₁₂| since the previous sample, Σ E'_c, Σ ΔT, and Σ (ΔT − W)(t − t_previous). Without gravity the
    /// last sum makes the mean kinetic energy of the interval exact.
    impacts: ExactSums<4>,
    /// The other terms of the energy balance, indexed by [`Term`].
    terms: [ExactSum; Term::ALL.len()],
    /// Impulse on the particles by walls, by bodies of infinite mass and by the support of resting particles.
    impulse: ExactSums<3>,
    pub counters: Counters,
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
    /// Sums of a simulation that starts with these energies, kinetic and potential; `sampled_kinetic` is that
    /// of translation alone.
    pub fn new(initial_energy: [f64; 2], sampled_kinetic: f64) -> Self {
        Self { initial_energy, sampled_kinetic, sampled_collisions: u64::MAX, ..Self::default() }
    }

    /// Names and sums, for checkpoints.
    pub fn sums_mut(&mut self) -> impl Iterator<Item = (&'static str, &mut ExactSum)> {
        let impacts = IMPACTS.into_iter().zip(self.impacts.sums_mut());
        let impulse = IMPULSE.into_iter().zip(self.impulse.sums_mut());
        let terms = Term::ALL.into_iter().map(Term::name).zip(&mut self.terms);
        terms.chain(impacts).chain(impulse)
    }

    /// Σ J |r₁₂| since the previous sample.
    pub fn virial(&self) -> f64 {
        self.impacts.value(0)
    }

    /// Σ E'_c.
    pub fn carnot(&self) -> f64 {
        self.impacts.value(1)
    }

    /// Σ ΔT.
    pub fn dissipated(&self) -> f64 {
        self.impacts.value(2)
    }

    /// Σ (ΔT − W)(t − t_previous) since the previous sample.
    pub fn loss_moment(&self) -> f64 {
        self.impacts.value(3)
    }

    /// The other terms of the energy balance, indexed by [`Term`].
    pub fn terms(&self) -> [f64; Term::ALL.len()] {
        self.terms.each_ref().map(ExactSum::value)
    }

    /// The impulse by walls, by bodies of infinite mass and by the support of resting particles.
    pub fn impulse(&self) -> DVec3 {
        DVec3::from_array([0, 1, 2].map(|axis| self.impulse.value(axis)))
    }

    /// Adds the sums and counters of another thread.
    pub fn merge(&mut self, other: &mut Self) {
        self.impacts.merge(&mut other.impacts);
        self.impulse.merge(&mut other.impulse);
        for (sum, other) in self.terms.iter_mut().zip(&other.terms) {
            sum.merge(other);
        }
        let counters = other.counters;
        self.counters.collisions += counters.collisions;
        self.counters.wall_collisions += counters.wall_collisions;
        self.counters.rests += counters.rests;
        self.counters.dropped += counters.dropped;
        self.counters.stale += counters.stale;
        self.counters.transfers += counters.transfers;
    }

    /// Starts the next interval between samples.
    pub fn start_interval(&mut self, time: f64, kinetic: f64) {
        let [virial, _, _, loss_moment] = self.impacts.sums_mut();
        (*virial, *loss_moment) = Default::default();
        self.sampled_at = time;
        self.sampled_collisions = self.counters.collisions;
        self.sampled_kinetic = kinetic;
    }

    /// Adds an external impulse.
    #[inline]
    pub fn add_impulse(&mut self, impulse: DVec3) {
        self.impulse.add(impulse.to_array());
    }

    /// Adds the virial J |r₁₂| of an impact at `time`, and its losses.
    #[inline(always)]
    pub fn add_impact(&mut self, time: f64, virial: f64, energy_loss: f64, carnot_energy: f64) {
        self.impacts.add([virial, carnot_energy, energy_loss, energy_loss * (time - self.sampled_at)]);
    }

    /// Adds the virial J |r₁₂| and the Carnot energy of an elastic impact.
    #[inline(always)]
    pub fn add_elastic_impact(&mut self, virial: f64, carnot_energy: f64) {
        self.impacts.add([virial, carnot_energy]);
    }

    /// Adds the tangential losses of a rough impact at `time`, of which `translational` is that of
    /// translation.
    #[inline]
    pub fn add_tangential(&mut self, time: f64, energy_loss: f64, carnot_energy: f64, translational: f64) {
        self.impacts.add([0.0, carnot_energy, energy_loss, translational * (time - self.sampled_at)]);
    }

    /// Adds energy that a term gives to rotation.
    #[inline]
    pub fn add_rotation(&mut self, term: Term, energy: f64) {
        self.terms[term as usize].add(energy);
    }

    /// Adds the losses of one event at `time`.
    #[inline]
    pub fn add_losses(&mut self, time: f64, energy_loss: f64, carnot_energy: f64) {
        self.add_impact(time, 0.0, energy_loss, carnot_energy);
    }

    /// Adds work that a term does in the course of a flight, and its moment ∫ (t − t_previous) dW.
    #[inline]
    pub fn add_work_in_flight(&mut self, term: Term, work: f64, moment: f64) {
        self.terms[term as usize].add(work);
        self.impacts.add([0.0, 0.0, 0.0, -moment]);
    }

    /// Adds the energy of a term at `time`: energy given to the particles, or taken from them if the sign of
    /// the term is negative.
    #[inline]
    pub fn add_energy(&mut self, term: Term, time: f64, energy: f64) {
        self.terms[term as usize].add(energy);
        self.impacts.add([0.0, 0.0, 0.0, -term.sign() * energy * (time - self.sampled_at)]);
    }
}
