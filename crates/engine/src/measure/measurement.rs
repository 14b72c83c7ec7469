//! What a measurement is, and how it receives events and states.

use crate::{
    measure::sample::Species,
    model::Exchange,
    numerics::{error::EngineError, words::Words},
    report::Correlation,
    report::{observer::Observer, sample::Sample},
    state::{flight_sums::Moments, whole::State, world::World},
};

/// A measurement while the run goes on.
pub(crate) trait Measurement: Send {
    /// Receives changes of velocities, in the order of time.
    fn exchange(&mut self, _exchange: &Exchange) {}

    /// Receives the integrals over all flights since the previous call, before every sample and every state;
    /// only where particles accelerate between events.
    fn flights(&mut self, _integrals: &Moments) {}

    /// Goes on with the particles of another world, which has replaced the previous one at `time`.
    fn replace(&mut self, _world: &World, _time: f64) {}

    /// The particles of the world have other indices, since some have come or gone.
    fn renumber(&mut self, _species: &Species, _world: &World) {}

    /// The next time of a state \[ticks\]; `i64::MAX` for never.
    fn next(&self, _state: &State) -> i64 {
        i64::MAX
    }

    /// Takes the present state, after all events of its time.
    fn take(&mut self, _state: &State, _observer: &mut dyn Observer) {}

    /// Adds values to a sample at `time`. What is a mean over time covers the time since the previous sample.
    fn complete(&mut self, _state: &State, _time: f64, _sample: &mut Sample) {}

    /// The correlations so far.
    fn correlations(&self) -> Vec<Correlation> {
        Vec::new()
    }

    /// Saves all data, which a resumed run needs.
    fn save(&self, words: &mut Vec<u64>);

    /// Loads what [`Self::save`] has saved, in a run that is resumed at `time`.
    fn load(&mut self, words: &mut Words, time: f64) -> Result<(), EngineError>;
}
