/*!
Measurements while a run goes on: the pressure tensor, the forces on walls, profiles, and correlations in
time.

A measurement receives every change of velocity ([`Exchange`]), takes states at its own times, and adds its
values to samples, rows of profiles or correlations. It never changes the state, so that no measurement
changes a trajectory. Without measurements none of this is called: the event loop then computes no
[`Exchange`].

A new measurement is one more field of [`Measure`] and a [`Measurement`] in a file of its own.
*/

mod correlations;
mod multiple_tau;
mod profiles;
mod stress;
mod walls;
mod words;

use crate::{
    error::EngineError,
    flights::{self, Moments},
    model::System,
    particles::World,
    report::{EventRecord, Exchange, Observer, ProfileRow, Sample},
    state::State,
};
pub use correlations::{CORRELATIONS, Correlation, CorrelationKind, Correlations};
pub use profiles::{Grid, GridAxis};
pub use stress::StressTensor;
pub(crate) use stress::{Tensor, product};
pub(crate) use walls::WallSums;
pub(crate) use words::{Words, fault};

/// What to measure while the run goes on. By default nothing.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Measure {
    /// The pressure tensor, in samples.
    pub stress: bool,
    /// The force and the heat of each wall, in samples.
    pub wall_forces: bool,
    /// Profiles.
    pub profiles: Vec<Grid>,
    /// Correlations in time.
    pub correlations: Correlations,
}

/// A measurement while the run goes on.
pub(crate) trait Measurement: Send {
    /// Receives changes of velocities, in the order of time.
    fn exchange(&mut self, _exchange: &Exchange) {}

    /// Receives the integrals over all flights since the previous call, before every sample and every state;
    /// only where particles accelerate between events.
    fn flights(&mut self, _integrals: &Moments) {}

    /// Goes on with the particles of another world, which has replaced the previous one at `time`.
    fn replace(&mut self, _world: &World, _time: f64) {}

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

/// The measurements of a system in its initial state. The system must still have its bodies.
pub(crate) fn measurements(system: &System, state: &State) -> Vec<Box<dyn Measurement>> {
    let measure = &system.measure;
    let mut measurements: Vec<Box<dyn Measurement>> = Vec::new();
    if measure.stress {
        measurements.push(Box::new(stress::Stress::new(system, &state.world)));
    }
    for (index, grid) in measure.profiles.iter().enumerate() {
        measurements.push(Box::new(profiles::Profile::new(system, index, grid)));
    }
    if measure.correlations.any() {
        measurements.push(Box::new(correlations::Correlator::new(system, state)));
    }
    measurements
}

/// Gives the integrals over the flights since the previous call to the measurements.
pub(crate) fn take_flights(measurements: &mut [Box<dyn Measurement>], state: &mut State) {
    if let Some(integrals) = flights::take(state) {
        for measurement in measurements {
            measurement.flights(&integrals);
        }
    }
}

/// Calls `run` with an observer that passes all it receives to the measurements, too.
pub(crate) fn observe<R>(
    measurements: &mut [Box<dyn Measurement>],
    observer: &mut dyn Observer,
    run: impl FnOnce(&mut dyn Observer) -> R,
) -> R {
    if measurements.is_empty() {
        run(observer)
    } else {
        let wants_events = observer.wants_events();
        run(&mut Measuring { measurements, observer, wants_events })
    }
}

/// Passes changes of velocities to measurements, and everything to the observer of the run.
struct Measuring<'a> {
    measurements: &'a mut [Box<dyn Measurement>],
    observer: &'a mut dyn Observer,
    wants_events: bool,
}

impl Observer for Measuring<'_> {
    fn wants_events(&self) -> bool {
        true
    }

    fn event(&mut self, event: &EventRecord) {
        if self.wants_events {
            self.observer.event(event);
        }
    }

    fn exchange(&mut self, exchange: &Exchange) {
        self.measurements.iter_mut().for_each(|measurement| measurement.exchange(exchange));
        self.observer.exchange(exchange);
    }

    fn profile(&mut self, row: ProfileRow) {
        self.observer.profile(row);
    }
}
