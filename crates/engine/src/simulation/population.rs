//! A simulation in which particles come and go.

use glam::DVec3;

use crate::{
    numerics::error::EngineError,
    simulation::{choice::Choice, run::Simulation},
    support::geometry::{geometry, present_system},
};

impl Simulation {
    /// Number of particles of the system, which frames have: with those that have left or are still to come.
    pub fn rows(&self) -> usize {
        self.state.population.as_ref().map_or(self.particles(), |population| population.all())
    }

    /// Numbers of particles that have come in and have been taken out so far; `None` without inlets and
    /// outlets.
    pub fn passages(&self) -> Option<[u64; 2]> {
        self.state.population.as_ref().map(|population| population.passages())
    }

    /// Builds the engine for the particles that are there now, after some have come or gone.
    pub(super) fn repopulate(&mut self) -> Result<(), EngineError> {
        let system = present_system(&self.system, &self.state.world);
        self.choice = Choice::of_passing(self.options, self.choice.kernel, &system, &self.state.world)?;
        self.geometry = geometry(&system, &self.state.world, self.choice.filled());
        self.engine = self.choice.compile(&system, &self.geometry);
        drop(system);
        let world = &self.state.world;
        self.measurements.iter_mut().for_each(|measurement| measurement.renumber(&self.species, world));
        let fastest = world
            .particles
            .iter()
            .map(|particle| particle.velocity)
            .filter(|&velocity| !world.is_resolved(velocity))
            .map(DVec3::length)
            .reduce(f64::max);
        match fastest {
            Some(speed) => self.start_epoch(self.state.world.now, speed),
            None => self.rebuild(),
        }
        Ok(())
    }

    /// An error with the ids of particles instead of their indices in the world.
    pub(super) fn with_ids(&self, mut error: EngineError) -> EngineError {
        let world = &self.state.world;
        match &mut error {
            EngineError::Overlap { i, partner, .. } => {
                *i = world.id(*i);
                *partner = partner.map(|j| world.id(j));
            }
            EngineError::Overflow { i, .. } => *i = world.id(*i),
            EngineError::Collapse { particles, .. } => {
                for i in particles {
                    *i = world.id(*i);
                }
            }
            _ => {}
        }
        error
    }
}
