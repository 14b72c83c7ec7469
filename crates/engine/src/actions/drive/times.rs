//! Times of the actions of drives: a Poisson process, or regular intervals. Both are saved and resumed.

use haff_mechanics::random::Draw;

use crate::{numerics::error::EngineError, state::State};

/// The times of a Poisson process for each of some particles, and the particles that it selects.
///
/// N processes of rate ν form one of rate N ν, whose events select every particle with equal probability.
/// Times and particles are hashes of the seed and the number of the event.
#[derive(Debug)]
pub(super) struct Poisson {
    name: String,
    index: u32,
    count: usize,
    /// Mean time between two events of any particles, 1/(N ν) \[time\].
    mean: f64,
    seed: u64,
    /// Number of events so far, and the time of the next.
    events: u64,
    next: f64,
}

impl Poisson {
    /// The process of the drive `index` on `count` particles.
    pub fn new(index: usize, count: usize, rate: f64, seed: u64) -> Self {
        let (name, mean) = (format!("drive.{index}"), 1.0 / (rate * count as f64));
        let mut process = Self { name, index: index as u32, count, mean, seed, events: 0, next: 0.0 };
        process.next = process.interval().0;
        process
    }

    /// Time between the last event and the next, and the index of the particle that the next one selects.
    fn interval(&self) -> (f64, usize) {
        // The complement of the seed: the seed itself is used for velocities, so that these are independent.
        let mut draw = Draw::new(!self.seed, self.index, self.events);
        let interval = self.mean * draw.exponential();
        (interval, draw.index(self.count.max(1)))
    }

    /// Time of the next event \[ticks\].
    pub fn next(&self, state: &State) -> i64 {
        if self.count == 0 { i64::MAX } else { state.world.clock.ticks(self.next) }
    }

    /// The index of the particle that the present event selects. The process goes on to the next event.
    pub fn select(&mut self) -> usize {
        let selected = self.interval().1;
        self.events += 1;
        self.next += self.interval().0;
        selected
    }

    pub fn save(&self, put: &mut dyn FnMut(&str, u64)) {
        put(&format!("{}.kicks", self.name), self.events);
        put(&format!("{}.next", self.name), self.next.to_bits());
    }

    pub fn load(&mut self, take: &mut dyn FnMut(&str) -> u64, time: f64) -> Result<(), EngineError> {
        self.events = take(&format!("{}.kicks", self.name));
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

/// Multiples of an interval.
#[derive(Debug)]
pub(super) struct Regular {
    name: String,
    pub interval: f64,
    /// Number of actions so far.
    pub done: u64,
}

impl Regular {
    /// The times of the drive `index`.
    pub fn new(index: usize, interval: f64) -> Self {
        Self { name: format!("drive.{index}.done"), interval, done: 0 }
    }

    /// Time of the next action \[ticks\].
    pub fn next(&self, state: &State) -> i64 {
        state.world.clock.ticks((self.done + 1) as f64 * self.interval)
    }

    /// The present action is done.
    pub fn advance(&mut self) {
        self.done += 1;
    }

    pub fn save(&self, put: &mut dyn FnMut(&str, u64)) {
        put(&self.name, self.done);
    }

    pub fn load(&mut self, take: &mut dyn FnMut(&str) -> u64, time: f64) -> Result<(), EngineError> {
        self.done = take(&self.name);
        let last = self.done as f64 * self.interval;
        if (last - time).abs() <= self.interval * (1.0 + f64::EPSILON * self.done as f64) {
            return Ok(());
        }
        Err(EngineError::Checkpoint(format!(
            "{} = {} actions every {} do not fit to the time {time}",
            self.name, self.done, self.interval
        )))
    }
}
