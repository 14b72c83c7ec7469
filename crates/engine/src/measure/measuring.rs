//! The measurements of a system, and the observer that passes events to them.
//!
//! Measurements receive the velocities that each event changes (`Exchange`) and take states at their own
//! times; rows of profiles go to the `Observer`, `Simulation::correlations` returns the correlations. They
//! run the event loop that computes rows of events, so that the other one has no branch for them, and never
//! change the state. Profiles take states at random times of their interval, which depend on the seed and
//! the row alone (`profiles`). A checkpoint has their numbers (`Checkpoint::measured`). Forces on walls are
//! sums in `WallSums`, which follow `World::set_support`. On which axes the velocity of the center of mass
//! is no part of temperatures and pressures is one function of the system (`model::conserved_momentum`; with
//! joints `Joints::conserved_momentum`). Files have its result, and Python takes it from there
//! (`Frame.thermal_velocity`). Where particles accelerate in their flights, `flights` adds each one's ∫ Σ m
//! c ⊗ c dt to exact sums when it ends: what sets an anchor or changes an acceleration calls `flights::end`
//! before.

use crate::{
    measure::{
        correlations, measurement::Measurement, pair_rates, probing, profiles, sample::Species, stress,
    },
    model::System,
    motion::flights,
    report::{EventRecord, Exchange, Observer, ProfileRow},
    state::State,
};

/// The measurements of a system in its initial state. The system must still have its bodies.
pub(crate) fn measurements(system: &System, state: &State) -> Vec<Box<dyn Measurement>> {
    let measure = &system.measure;
    let species = Species::new(system);
    let mut measurements: Vec<Box<dyn Measurement>> = Vec::new();
    if measure.stress {
        measurements.push(Box::new(stress::Stress::new(system, &state.world)));
    }
    for (index, grid) in measure.profiles.iter().enumerate() {
        measurements.push(Box::new(profiles::Profile::new(system, index, grid, &species, &state.world)));
    }
    if measure.correlations.any() {
        measurements.push(Box::new(correlations::Correlator::new(system, state)));
    }
    if measure.pair_collisions {
        measurements.push(Box::new(pair_rates::PairRates::new(system, &species, &state.world)));
    }
    for probe in &measure.probes {
        measurements.push(Box::new(probing::Probing::new(probe, system.dimension.count())));
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
pub(crate) struct Measuring<'a> {
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
