//! Rates of collisions by pair of species, and mean free times by species.

use crate::{
    model::System,
    numerics::{
        error::EngineError,
        words::{Words, fault, put_reals},
    },
    report::{Exchange, Partner, Sample},
    state::{State, world::World},
};

use super::{Measurement, sample::Species};

pub(crate) struct PairRates {
    /// Number of species.
    species: usize,
    /// Species of each particle of the world.
    of: Vec<u32>,
    /// Bodies of finite mass of each species.
    movable: Vec<u64>,
    /// Start of the interval \[time\].
    since: f64,
    /// Collisions in the interval by pair of species, symmetric.
    counts: Vec<u64>,
    /// Flights that they have ended, by species.
    flights: Vec<u64>,
}

impl PairRates {
    pub fn new(system: &System, table: &Species, world: &World) -> Self {
        let species = system.species.len();
        let mut rates = Self {
            species,
            of: Vec::new(),
            movable: Vec::new(),
            since: 0.0,
            counts: vec![0; species * species],
            flights: vec![0; species],
        };
        rates.renumber(table, world);
        rates
    }
}

impl Measurement for PairRates {
    fn exchange(&mut self, exchange: &Exchange) {
        if let Partner::Particle { bodies, .. } = exchange.partner {
            let [a, b] = bodies.map(|i| self.of[i as usize] as usize);
            self.counts[a * self.species + b] += 1;
            if a != b {
                self.counts[b * self.species + a] += 1;
            }
            // Of bodies of finite mass.
            for change in exchange.changes {
                self.flights[self.of[change.i as usize] as usize] += 1;
            }
        }
    }

    fn renumber(&mut self, species: &Species, world: &World) {
        let indices = 0..world.particles.len() as u32;
        self.of = indices.clone().map(|i| species.of(world, i)).collect();
        self.movable = vec![0; self.species];
        for i in indices.filter(|&i| world.body(i).inverse_mass != 0.0) {
            self.movable[self.of[i as usize] as usize] += 1;
        }
    }

    fn complete(&mut self, _state: &State, time: f64, sample: &mut Sample) {
        let span = time - self.since;
        // NaN in the first sample.
        let span = if span > 0.0 { span } else { f64::NAN };
        sample.pair_collision_rate = self.counts.iter().map(|&count| count as f64 / span).collect();
        // No bodies of finite mass have no flights.
        let movable = |a: usize| if self.movable[a] == 0 { f64::NAN } else { self.movable[a] as f64 };
        sample.species_mean_free_time =
            self.flights.iter().enumerate().map(|(a, &flights)| movable(a) * span / flights as f64).collect();
        self.since = time;
        self.counts.fill(0);
        self.flights.fill(0);
    }

    fn save(&self, words: &mut Vec<u64>) {
        put_reals(words, &[self.since]);
        words.extend(self.counts.iter().chain(&self.flights));
    }

    fn load(&mut self, words: &mut Words, time: f64) -> Result<(), EngineError> {
        self.since = words.real()?;
        for count in self.counts.iter_mut().chain(&mut self.flights) {
            *count = words.take()?;
        }
        let fits = (0.0..=time).contains(&self.since);
        if fits { Ok(()) } else { Err(fault("rates of pairs of species that begin after the present")) }
    }
}
