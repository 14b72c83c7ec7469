//! The Andersen thermostat: at the times of a Poisson process, particles get velocities from a Maxwell
//! distribution, which are hashes of the seed, the particle and its event count.

use haff_mechanics::random::Draw;
use haff_neighbors::Geometry;

use crate::{actions::timed::TimedAction, numerics::error::EngineError, report::Observer, state::State};

use super::{
    driven::{Driven, kick},
    times::Poisson,
};

#[derive(Debug)]
pub(super) struct Andersen {
    times: Poisson,
    driven: Driven,
    temperature: f64,
    seed: u64,
}

impl Andersen {
    pub fn new(times: Poisson, driven: Driven, temperature: f64, seed: u64) -> Self {
        Self { times, driven, temperature, seed }
    }
}

impl TimedAction for Andersen {
    fn next(&self, state: &State) -> i64 {
        self.times.next(state)
    }

    fn apply(
        &mut self,
        state: &mut State,
        _geometry: &Geometry,
        observer: &mut dyn Observer,
    ) -> Result<Vec<u32>, EngineError> {
        let i = self.driven.particles[self.times.select()];
        let (count, mass) = (state.world.particles[i as usize].count, state.world.class(i).mass);
        let spread = (self.temperature / mass).sqrt();
        let peculiar = spread * Draw::new(self.seed, i, u64::from(count)).normals(self.driven.dimension);
        let flow = state.world.flow_velocity(state.world.state(i, state.world.now).0, state.world.now);
        let spin = self.driven.turns(state, self.seed, i).map(|turn| spread * turn);
        kick(state, i, flow + peculiar, spin, observer)?;
        Ok(vec![i])
    }

    fn save(&self, put: &mut dyn FnMut(&str, u64)) {
        self.times.save(put);
    }

    fn load(&mut self, take: &mut dyn FnMut(&str) -> u64, time: f64) -> Result<(), EngineError> {
        self.times.load(take, time)
    }
}
