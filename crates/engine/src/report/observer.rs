//! What receives the events of a run.

use std::sync::Arc;

use glam::DVec3;

use crate::{model::Exchange, report::event::EventRecord};

/// Receives events as they are resolved. Observers cannot change the simulation.
pub trait Observer {
    /// Whether the observer needs events. Called once per call of `Simulation::advance`.
    fn wants_events(&self) -> bool {
        false
    }
    /// Receives one event. Events are in the order of time.
    fn event(&mut self, _event: &EventRecord) {}
    /// Receives the changes of velocities of one event or kick, if the observer wants events.
    fn exchange(&mut self, _exchange: &Exchange) {}
    /// Receives a row of a profile, at the end of its interval.
    fn profile(&mut self, _row: ProfileRow) {}
}

/// One row of a profile, with values by cell of its [`Grid`](crate::Grid): means over the interval that ends
/// at its time. It dereferences to the fields of all particles.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ProfileRow {
    /// Index of the profile.
    pub profile: usize,
    /// End of the interval \[time\].
    pub time: f64,
    /// Collisions + wall collisions so far.
    pub step: u64,
    /// Of all particles.
    pub all: CellFields,
    /// Of each species of the grid. Densities, pressures and number densities times temperatures of all
    /// species of a scene add up to those of all particles.
    pub species: Vec<CellFields>,
}

impl std::ops::Deref for ProfileRow {
    type Target = CellFields;

    fn deref(&self) -> &CellFields {
        &self.all
    }
}

/// The fields of a row of a profile, by cell. u is the velocity of all particles in the cell.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct CellFields {
    /// Number density [1/length^d].
    pub density: Vec<f64>,
    /// Mass density [mass/length^d].
    pub mass_density: Vec<f64>,
    /// Momentum by mass [length/time]; NaN in an empty cell.
    pub velocity: Vec<DVec3>,
    /// Σ m|v − u|²/(d N) \[energy\]; NaN in an empty cell.
    pub temperature: Vec<f64>,
    /// Pressure tensor relative to u, d·d numbers a cell [energy/length^d]. Of a contact of two species each
    /// has half.
    pub pressure: Vec<f64>,
}

/// Calls `run` with an observer that has the ids of particles instead of their indices in the world, where
/// these differ.
pub(crate) fn with_ids<R>(
    ids: Option<Arc<[u32]>>,
    observer: &mut dyn Observer,
    run: impl FnOnce(&mut dyn Observer) -> R,
) -> R {
    match ids {
        None => run(observer),
        Some(ids) => run(&mut Identified { ids, observer }),
    }
}

/// Passes events on with the ids of particles.
struct Identified<'a> {
    ids: Arc<[u32]>,
    observer: &'a mut dyn Observer,
}

impl Observer for Identified<'_> {
    fn wants_events(&self) -> bool {
        self.observer.wants_events()
    }

    fn event(&mut self, event: &EventRecord) {
        let id = |i: u32| self.ids.get(i as usize).copied().unwrap_or(i);
        let j = if event.kind.is_of_two_particles() { id(event.j) } else { event.j };
        self.observer.event(&EventRecord { i: id(event.i), j, ..*event });
    }

    fn exchange(&mut self, exchange: &Exchange) {
        self.observer.exchange(exchange);
    }

    fn profile(&mut self, row: ProfileRow) {
        self.observer.profile(row);
    }
}

/// An observer that ignores all events.
#[derive(Debug, Clone, Copy, Default)]
pub struct Silent;

impl Observer for Silent {}
