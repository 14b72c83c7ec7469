//! A probe of another crate.

use crate::{
    measure::Measurement,
    model::probe::{NamedProbe, Probe},
    motion::view::View,
    numerics::{
        error::EngineError,
        words::{Words, fault, put_reals},
    },
    report::{Exchange, Sample},
    state::State,
};

/// Most numbers that a probe can save.
const MOST: u64 = 1 << 32;

/// A probe while a run goes on.
pub(super) struct Probing {
    name: &'static str,
    probe: Box<dyn Probe>,
    /// Number of components of all columns.
    components: usize,
    /// 2 or 3.
    dimension: usize,
}

impl Probing {
    pub fn new(named: &NamedProbe, dimension: usize) -> Self {
        let components = named.columns().iter().map(|column| column.components).sum();
        Self { name: named.name(), probe: named.start(), components, dimension }
    }
}

impl Measurement for Probing {
    fn exchange(&mut self, exchange: &Exchange) {
        self.probe.exchange(exchange);
    }

    fn complete(&mut self, state: &State, _time: f64, sample: &mut Sample) {
        let end = sample.probes.len() + self.components;
        sample.probes.extend(self.probe.sample(&View { world: &state.world, dimension: self.dimension }));
        // Columns keep their places, whatever the probe returns.
        sample.probes.resize(end, f64::NAN);
    }

    fn save(&self, words: &mut Vec<u64>) {
        let numbers = self.probe.save();
        words.push(numbers.len() as u64);
        put_reals(words, &numbers);
    }

    fn load(&mut self, words: &mut Words, _time: f64) -> Result<(), EngineError> {
        let count = words.count("the number of a probe's numbers", MOST)?;
        let numbers = words.reals(count as usize)?;
        if self.probe.load(&numbers) {
            return Ok(());
        }
        Err(fault(&format!("the probe \"{}\" cannot load its numbers", self.name)))
    }
}
