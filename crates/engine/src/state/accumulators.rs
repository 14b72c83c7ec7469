//! Running sums over the events of a simulation. They are independent of the order of the events.

use glam::DVec3;

use crate::{
    numerics::{
        exact_sum::{ExactSum, ExactSums},
        sum::Sum,
    },
    report::{Counters, ledger::Term},
    state::{
        center::Center,
        flight_sums::{FlightSums, Summed},
        world::World,
    },
};

/// Names of the sums in checkpoints, besides the terms of the energy balance.
const IMPACTS: [&str; 4] = ["virial", "carnot", "dissipated", "loss_moment"];
const IMPULSE: [&str; 3] = ["impulse.x", "impulse.y", "impulse.z"];

/// Sums over events. The sums for the pressure cover the time since the previous sample.
#[derive(Debug, Clone, Default)]
pub(crate) struct Accumulators {
    /// Σ J |r₁₂| since the previous sample, Σ E'_c, Σ ΔT, and Σ (ΔT − W)(t − t_previous). Where particles do
    /// not accelerate in their flights, the last sum makes the mean kinetic energy of the interval exact.
    impacts: ExactSums<4>,
    /// The other terms of the energy balance, indexed by [`Term`].
    terms: [ExactSum; Term::ALL.len()],
    /// Impulse on the particles by walls, by bodies of infinite mass and by the support of resting particles.
    impulse: ExactSums<3>,
    pub counters: Counters,
    /// Time of the previous sample [time], and the numbers of collisions and of flights that they had ended
    /// until then.
    pub sampled_at: f64,
    pub sampled_collisions: u64,
    pub sampled_flights: u64,
    /// The center of mass since then.
    pub center: Center,
    /// In a box that is compressed, Σ J |r₁₂| and ∫ Σ m c² dt of the samples since they were taken, less the
    /// parts of the present interval between samples that were taken.
    pub compressed: [f64; 2],
    /// Flights that have ended, where particles accelerate.
    pub flights: Option<Box<FlightSums>>,
    /// Kinetic and potential energy at the start.
    pub initial_energy: [f64; 2],
    /// Largest overlap found so far [contact distances].
    pub max_overlap: f64,
}

impl Accumulators {
    /// Sums of a simulation that starts with this world and these energies, kinetic and potential.
    pub fn new(world: &World, initial_energy: [f64; 2]) -> Self {
        Self {
            initial_energy,
            center: Center::of(world, 0.0),
            flights: (world.flights != Summed::Nothing).then(Box::default),
            sampled_collisions: u64::MAX,
            ..Self::default()
        }
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
        if let Some(flights) = &other.flights {
            self.flights.get_or_insert_default().merge(flights);
        }
        let counters = other.counters;
        self.counters.collisions += counters.collisions;
        self.counters.fixed_collisions += counters.fixed_collisions;
        self.counters.wall_collisions += counters.wall_collisions;
        self.counters.simultaneous += counters.simultaneous;
        self.counters.rests += counters.rests;
        self.counters.dropped += counters.dropped;
        self.counters.stale += counters.stale;
        self.counters.transfers += counters.transfers;
    }

    /// Σ J |r₁₂| and ∫ Σ m c² dt since the previous call, in a box that is compressed; of flights that go on,
    /// only up to the last sample. `None` if there has been no flight, in a collapse.
    pub fn take_compressed(&mut self) -> Option<[f64; 2]> {
        let ended = self.flights.as_ref().map_or(0.0, |flights| flights.ended());
        let present = [self.virial(), ended];
        let [virial, thermal] = [0, 1].map(|k| self.compressed[k] + present[k]);
        (thermal > 0.0).then(|| {
            self.compressed = present.map(|sum| 0.0 - sum);
            [virial, thermal]
        })
    }

    /// Starts the next interval between samples.
    pub fn start_interval(&mut self, time: f64) {
        let [virial, _, _, loss_moment] = self.impacts.sums_mut();
        (*virial, *loss_moment) = Default::default();
        self.sampled_at = time;
        self.sampled_collisions = self.counters.collisions;
        self.sampled_flights = self.counters.ended_flights();
        if let Some(flights) = &mut self.flights {
            flights.sampled = Sum::default();
        }
    }

    /// ∫ Σ m c² dt since the previous sample up to `time`, when the kinetic energy of translation is
    /// `kinetic`.
    ///
    /// Without acceleration the energy is constant between events: the integral is the one at the end times
    /// the interval, plus the loss of each event times the time before it.
    pub fn twice_kinetic(&self, kinetic: f64, time: f64) -> f64 {
        match &self.flights {
            Some(flights) => flights.sampled.value(),
            None => 2.0 * (kinetic * (time - self.sampled_at) + self.loss_moment()),
        }
    }

    /// Goes on with another world from `time` on, after [`Self::twice_kinetic`]; `kinetic` is its kinetic
    /// energy of translation.
    pub fn go_on_with(&mut self, world: &World, twice_kinetic: f64, kinetic: f64, time: f64) {
        if world.flights == Summed::Nothing {
            self.flights = None;
            let [_, _, _, loss_moment] = self.impacts.sums_mut();
            *loss_moment = [0.5 * twice_kinetic, -kinetic * (time - self.sampled_at)].into_iter().collect();
        } else {
            let until = world.clock.instant(world.now);
            let sampled = [twice_kinetic].into_iter().collect();
            self.flights = Some(Box::new(FlightSums { until, sampled, ..FlightSums::default() }));
        }
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

    /// Adds work that a term does in the course of a flight.
    #[inline]
    pub fn add_work_in_flight(&mut self, term: Term, work: f64) {
        self.terms[term as usize].add(work);
    }

    /// Adds the energy of a term at `time`: energy given to the particles, or taken from them if the sign of
    /// the term is negative.
    #[inline]
    pub fn add_energy(&mut self, term: Term, time: f64, energy: f64) {
        self.add_work(term, time, energy, 0.0);
    }

    /// [`Self::add_energy`], and [`Self::add_work_in_flight`] for the flights that end at the same time.
    #[inline]
    pub fn add_work(&mut self, term: Term, time: f64, energy: f64, in_flights: f64) {
        self.terms[term as usize].add(energy + in_flights);
        self.impacts.add([0.0, 0.0, 0.0, -term.sign() * energy * (time - self.sampled_at)]);
    }
}
