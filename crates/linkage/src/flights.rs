//! Flights of bodies that move together, from one event to the next.

use haff_engine::Instant;

use crate::{
    mechanism::{Mechanism, Motions},
    motion::Motion,
};

/// Bodies that move together, from one event to the next.
#[derive(Debug, Clone)]
pub(crate) struct Flight {
    pub start: Instant,
    /// Bodies in the order of the mechanism.
    pub bodies: Vec<usize>,
    pub mechanism: Mechanism,
    pub motion: Motion,
    /// Initial step of a numerical motion; 0 for the first one.
    pub hint: f64,
}

impl Flight {
    /// The index of a body; bodies are in ascending order.
    pub fn index_of(&self, body: usize) -> Option<usize> {
        self.bodies.binary_search(&body).ok()
    }

    /// End of the range of its motion.
    pub fn end(&self) -> Instant {
        self.start.after(self.motion.length())
    }

    /// States of its bodies at an event that ends it, corrected for errors in what the motion conserves.
    /// `start`: those at its start; `excess`: see [`Mechanism::restore_energy`]. Returns the new excess, too.
    pub fn states_at_event(&self, start: &Motions, at: Instant, excess: f64) -> (Motions, f64) {
        let tau = at.since(self.start);
        if tau == 0.0 {
            return (start.clone(), excess);
        }
        let mut states = self.states(at);
        if matches!(self.motion, Motion::Numeric(_)) {
            self.mechanism.project(tau, &mut states);
        }
        let work = self.motion.work(tau);
        let excess = self.mechanism.restore_energy(tau, start, &mut states, work, excess);
        (states, excess)
    }

    /// States of its bodies.
    pub fn states(&self, at: Instant) -> Motions {
        let tau = at.since(self.start);
        (0..self.bodies.len()).map(|k| self.motion.state(k, tau)).collect()
    }
}

/// All flights, by the first of their bodies.
#[derive(Debug, Clone)]
pub(crate) struct Flights(Vec<Option<Box<Flight>>>);

impl Flights {
    /// None yet, of this many bodies.
    pub fn of(bodies: usize) -> Self {
        Self((0..bodies).map(|_| None).collect())
    }

    pub fn get(&self, key: usize) -> Option<&Flight> {
        self.0[key].as_deref()
    }

    pub fn insert(&mut self, flight: Flight) {
        let key = flight.bodies[0];
        self.0[key] = Some(Box::new(flight));
    }

    pub fn remove(&mut self, key: usize) -> Option<Flight> {
        self.0[key].take().map(|flight| *flight)
    }

    pub fn iter(&self) -> impl Iterator<Item = &Flight> {
        self.0.iter().filter_map(|flight| flight.as_deref())
    }
}
