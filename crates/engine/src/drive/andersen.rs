//! The Andersen thermostat: at the times of a Poisson process, particles get velocities from a Maxwell
//! distribution.
//!
//! N particles that are kicked at the rate ν each form one Poisson process of rate N ν. Its k-th kick acts on
//! every particle with equal probability. Times and particles are hashes of the seed and k, velocities of the
//! seed, the particle and its event count.

use glam::DVec3;
use haff_neighbors::Geometry;

use super::{Driven, kick};
use crate::{error::EngineError, random::Draw, report::Observer, state::State, timed::TimedAction};

#[derive(Debug)]
pub(super) struct Andersen {
    name: String,
    index: u32,
    driven: Driven,
    temperature: f64,
    /// Mean time between two kicks of any particles, 1/(N ν) \[time\].
    mean: f64,
    seed: u64,
    /// Number of kicks so far, and the time of the next.
    kicks: u64,
    next: f64,
}

impl Andersen {
    pub fn new(index: usize, driven: Driven, temperature: f64, rate: f64, seed: u64) -> Self {
        let mean = 1.0 / (rate * driven.particles.len() as f64);
        let name = format!("drive.{index}");
        let mut action =
            Self { name, index: index as u32, driven, temperature, mean, seed, kicks: 0, next: 0.0 };
        action.next = action.interval().0;
        action
    }

    /// Time between the last kick and the next, and the index of the particle that the next kick acts on.
    fn interval(&self) -> (f64, usize) {
        // The complement of the seed: the seed itself is used for velocities, so that these are independent.
        let mut draw = Draw::new(!self.seed, self.index, self.kicks);
        let interval = self.mean * draw.exponential();
        (interval, draw.index(self.driven.particles.len().max(1)))
    }
}

impl TimedAction for Andersen {
    fn next(&self, state: &State) -> i64 {
        if self.driven.particles.is_empty() { i64::MAX } else { state.world.clock.ticks(self.next) }
    }

    fn apply(
        &mut self,
        state: &mut State,
        _geometry: &Geometry,
        observer: &mut dyn Observer,
    ) -> Result<Vec<u32>, EngineError> {
        let i = self.driven.particles[self.interval().1];
        self.kicks += 1;
        self.next += self.interval().0;
        let (count, mass) = (state.world.particles[i as usize].count, state.world.class(i).mass);
        let mut draw = Draw::new(self.seed, i, u64::from(count));
        let spread = (self.temperature / mass).sqrt();
        let mut component =
            |axis: usize| if axis < self.driven.dimension { spread * draw.normal() } else { 0.0 };
        let velocity = DVec3::new(component(0), component(1), component(2));
        kick(state, i, velocity, observer)?;
        Ok(vec![i])
    }

    fn save(&self, put: &mut dyn FnMut(&str, u64)) {
        put(&format!("{}.kicks", self.name), self.kicks);
        put(&format!("{}.next", self.name), self.next.to_bits());
    }

    fn load(&mut self, take: &mut dyn FnMut(&str) -> u64, time: f64) -> Result<(), EngineError> {
        self.kicks = take(&format!("{}.kicks", self.name));
        self.next = f64::from_bits(take(&format!("{}.next", self.name)));
        // An interval is at most 37 times the mean, since the smallest random number is 2⁻⁵³.
        let latest = time + 40.0 * self.mean;
        if (time * (1.0 - 1e-15)..=latest).contains(&self.next) {
            return Ok(());
        }
        Err(EngineError::Checkpoint(format!(
            "{}.next = {} must be between the time {time} and {latest}",
            self.name, self.next
        )))
    }
}
