//! White noise: each component of a velocity gets normal random numbers whose variance grows by `strength`,
//! ξ₀², in a unit of time (D. R. M. Williams, F. C. MacKintosh, Phys. Rev. E 54, R9 (1996)).
//!
//! Kicks at the times of a Poisson process are exact in event time: they give each particle the mean power
//! d m ξ₀²/2. Kicks of all particles at intervals have their mean taken out, so that they keep the momentum.
//! A rotational drive changes the angular velocities, too: the variance of each component grows by ξ₀² m/I in
//! a unit of time, so that a rotation gets the mean power m ξ₀²/2 of one component of the velocity. The
//! numbers are hashes of the seed, the particle and its event count.

use glam::DVec3;
use haff_mechanics::random::Draw;
use haff_neighbors::Geometry;

use crate::{
    actions::timed::TimedAction,
    numerics::{error::EngineError, total::total},
    report::Observer,
    state::State,
};

use super::{
    driven::{Driven, kick},
    times::{Poisson, Regular},
};

/// Number of actions after which the interval is compared with the mean free time of the run so far.
const COMPARED_AFTER: u64 = 16;

/// The driven particles and the size of one kick.
#[derive(Debug)]
pub(super) struct Kicks {
    driven: Driven,
    /// Standard deviation of each component [length/time].
    spread: f64,
    seed: u64,
}

impl Kicks {
    pub fn new(driven: Driven, variance: f64, seed: u64) -> Self {
        Self { driven, spread: variance.sqrt(), seed }
    }

    /// The change of velocity of a particle in its next event.
    fn of(&self, state: &State, i: u32) -> DVec3 {
        let count = u64::from(state.world.particles[i as usize].count);
        self.spread * Draw::new(self.seed, i, count).normals(self.driven.dimension)
    }

    /// The angular velocity of a particle after its next event, if that is driven.
    fn spin(&self, state: &State, i: u32) -> Option<DVec3> {
        let turn = self.driven.turns(state, self.seed, i)?;
        Some(state.world.angular_velocity(i, state.world.now) + self.spread * turn)
    }
}

/// Kicks of one particle after the other.
#[derive(Debug)]
pub(super) struct PoissonNoise {
    pub times: Poisson,
    pub kicks: Kicks,
}

impl TimedAction for PoissonNoise {
    fn next(&self, state: &State) -> i64 {
        self.times.next(state)
    }

    fn apply(
        &mut self,
        state: &mut State,
        _geometry: &Geometry,
        observer: &mut dyn Observer,
    ) -> Result<Vec<u32>, EngineError> {
        let i = self.kicks.driven.particles[self.times.select()];
        let velocity = state.world.state(i, state.world.now).1 + self.kicks.of(state, i);
        let spin = self.kicks.spin(state, i);
        kick(state, i, velocity, spin, observer)?;
        Ok(vec![i])
    }

    fn save(&self, put: &mut dyn FnMut(&str, u64)) {
        self.times.save(put);
    }

    fn load(&mut self, take: &mut dyn FnMut(&str) -> u64, time: f64) -> Result<(), EngineError> {
        self.times.load(take, time)
    }
}

/// Kicks of all particles at intervals.
#[derive(Debug)]
pub(super) struct IntervalNoise {
    pub times: Regular,
    pub kicks: Kicks,
}

impl IntervalNoise {
    /// Between two kicks the velocities must not relax: kicks much rarer than collisions are not white noise.
    fn warn_if_rare(&self, state: &State) {
        let flights = state.accumulators.counters.ended_flights();
        let time = state.world.clock.shown(state.world.now);
        let mean_free_time = state.world.movable as f64 * time / flights as f64;
        if self.times.done == COMPARED_AFTER && self.times.interval > mean_free_time {
            tracing::warn!(
                "the interval {} of white noise is above the mean free time, {mean_free_time:.3e}: \
                 choose a shorter interval, or a rate",
                self.times.interval
            );
        }
    }
}

impl TimedAction for IntervalNoise {
    fn next(&self, state: &State) -> i64 {
        self.times.next(state)
    }

    fn apply(
        &mut self,
        state: &mut State,
        _geometry: &Geometry,
        observer: &mut dyn Observer,
    ) -> Result<Vec<u32>, EngineError> {
        self.times.advance();
        self.warn_if_rare(state);
        let particles = &self.kicks.driven.particles;
        let changes: Vec<DVec3> = particles.iter().map(|&i| self.kicks.of(state, i)).collect();
        let [m, px, py, pz] = total(particles.len(), |k| {
            let mass = state.world.class(particles[k as usize]).mass;
            let p = mass * changes[k as usize];
            [mass, p.x, p.y, p.z]
        });
        let mean = DVec3::new(px, py, pz) / m;
        for (&i, change) in particles.iter().zip(changes) {
            let velocity = state.world.state(i, state.world.now).1 + (change - mean);
            let spin = self.kicks.spin(state, i);
            kick(state, i, velocity, spin, observer)?;
        }
        Ok(particles.clone())
    }

    fn save(&self, put: &mut dyn FnMut(&str, u64)) {
        self.times.save(put);
    }

    fn load(&mut self, take: &mut dyn FnMut(&str) -> u64, time: f64) -> Result<(), EngineError> {
        self.times.load(take, time)
    }
}
