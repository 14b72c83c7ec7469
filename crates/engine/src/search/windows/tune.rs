/*!
Tuning of the length of windows and the width of cells.

Long windows are opened less often, but their searches cover longer paths and predict more contacts that never
happen. Of wide cells fewer are read, but they contain more particles out of range. The best values depend on
the density and on the distribution of particles, and so they change when a gas clusters. Therefore both
values are tuned by small steps during the whole run. Their cost is computed from counts of the work done, not
measured by a clock, so that a run makes the same choices on every machine. No choice changes a trajectory.
The weights of the counts depend on the memory level that holds the data ([`Weights`]).
*/

use crate::numerics::tuning::{PerDimension, particles::WEIGHT_EVENTS};

/// Counts of the work done.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct Work {
    /// Searches for the partners of a particle.
    pub searches: u64,
    /// Blocks of cells read.
    pub blocks: u64,
    /// Candidates tested by the filter.
    pub candidates: u64,
    /// Exact predictions of pairs.
    pub predictions: u64,
    /// Entries added to the queue.
    pub entries: u64,
    /// Windows opened.
    pub windows: u64,
}

impl Work {
    /// The work done since `before`.
    pub fn since(&self, before: &Self) -> Self {
        Self {
            searches: self.searches - before.searches,
            blocks: self.blocks - before.blocks,
            candidates: self.candidates - before.candidates,
            predictions: self.predictions - before.predictions,
            entries: self.entries - before.entries,
            windows: self.windows - before.windows,
        }
    }

    /// Adds the work of another thread.
    pub fn add(&mut self, other: &Self) {
        self.searches += other.searches;
        self.blocks += other.blocks;
        self.candidates += other.candidates;
        self.predictions += other.predictions;
        self.entries += other.entries;
        self.windows += other.windows;
    }

    /// Instructions for this work, as counted by callgrind for each part. Those for blocks are multiplied by
    /// `blocks`.
    fn cost(&self, blocks: f64) -> f64 {
        250.0 * self.searches as f64
            + 25.0 * blocks * self.blocks as f64
            + 14.0 * self.candidates as f64
            + 150.0 * self.predictions as f64
            + 100.0 * self.entries as f64
            + 2000.0 * self.windows as f64
    }
}

/// Factors by which the length and the width are changed in a step.
const STEP: [f64; 2] = [1.25, 1.15];
/// Smallest relative gain for which a trial counts as better.
const GAIN: f64 = 0.005;
/// Number of successive failures after which the tuner waits.
const MAX_FAILURES: u32 = 4;
/// Number of trials that the first wait lasts. It doubles with each further wait, until a trial succeeds or
/// the cost changes.
const WAIT: u32 = 24;
/// Largest number of trials that a wait lasts.
const MAX_WAIT: u32 = 96;
/// A change of the cost by this factor ends a wait.
const COST_CHANGE: f64 = 1.15;

/// Weights of the work, which depend on the memory level that holds the data. The opening of windows reads
/// memory in order, whereas events read it in the order of time and wait for it, so that the same work costs
/// more there. The weights are fitted to rates that were measured at fixed lengths and widths
/// (benches/record/growth.md).
#[derive(Debug, Clone, Copy)]
struct Weights {
    /// Weight of the work of events, relative to that of opening windows.
    events: f64,
    /// Additional factor for the blocks that events read.
    blocks: f64,
    /// Initial length of windows at a packing fraction of 1 [mean spacings].
    start: PerDimension,
}

impl Weights {
    const IN_CACHE: Self =
        Self { events: 2.5, blocks: 1.0, start: PerDimension { disks: 0.3, spheres: 0.13 } };
    const IN_MEMORY: Self =
        Self { events: 6.0, blocks: 2.0, start: PerDimension { disks: 0.17, spheres: 0.113 } };

    fn of(particles: usize) -> Self {
        if particles <= WEIGHT_EVENTS { Self::IN_CACHE } else { Self::IN_MEMORY }
    }
}

/// The state of a tuner. Costs are per path.
#[derive(Debug, Clone, Copy)]
enum Phase {
    /// No cost is known yet.
    Start,
    /// A trial with another value is running. At the `previous` value, the cost was `cost`.
    Trying { which: usize, previous: f64, cost: f64 },
    /// The trial of the value `tried` has ended, and the previous value is measured again; its cost before
    /// the trial was `cost_previous`. This separates the gain of a value from the drift of the cost: in a gas
    /// that melts, falls or clusters, the cost changes from trial to trial, whatever the values are.
    Comparing { which: usize, tried: f64, cost_tried: f64, cost_previous: f64 },
    /// No better values were found; the cost was `cost`. The tuner waits for this many trials.
    Waiting { trials: u32, cost: f64 },
}

/// Tunes two values: the mean length of a path in a window, and the width of cells [mean spacings].
#[derive(Debug, Clone)]
pub(super) struct Tuner {
    pub values: [f64; 2],
    min: [f64; 2],
    max: [f64; 2],
    /// Whether the next step increases the value.
    up: [bool; 2],
    /// Failures in a row.
    failures: u32,
    /// Number of trials that the next wait lasts.
    wait: u32,
    phase: Phase,
    weights: Weights,
}

impl Tuner {
    /// A tuner with initial values for a system with these numbers of dimensions and particles.
    pub fn new(packing_fraction: f64, dimensions: usize, particles: usize) -> Self {
        let weights = Weights::of(particles);
        let start = weights.start.of(dimensions);
        let path = start * libm::pow(packing_fraction.max(1e-9), -0.43);
        Self {
            values: [path.clamp(0.02, 4.0), 1.15],
            min: [0.01, 0.5],
            max: [8.0, 4.0],
            up: [true, false],
            failures: 0,
            wait: WAIT,
            phase: Phase::Start,
            weights,
        }
    }

    /// Computes the cost of the present values from the work of `opening` windows and that of `events`, over
    /// a `path` [mean spacings], and chooses the next values.
    pub fn update(&mut self, opening: &Work, events: &Work, path: f64) {
        if path <= 0.0 {
            return;
        }
        let cost = (opening.cost(1.0) + self.weights.events * events.cost(self.weights.blocks)) / path;
        match self.phase {
            Phase::Start => self.try_step(0, cost),
            Phase::Trying { which, previous, cost: cost_previous } => {
                let tried = std::mem::replace(&mut self.values[which], previous);
                self.phase = Phase::Comparing { which, tried, cost_tried: cost, cost_previous };
            }
            Phase::Comparing { which, tried, cost_tried, cost_previous } => {
                if cost_tried < 0.5 * (cost_previous + cost) * (1.0 - GAIN) {
                    self.values[which] = tried;
                    self.failures = 0;
                    self.wait = WAIT;
                    return self.try_step(which, cost_tried);
                }
                self.up[which] = !self.up[which];
                self.failures += 1;
                if self.failures < MAX_FAILURES {
                    return self.try_step(1 - which, cost);
                }
                self.failures = 0;
                self.phase = Phase::Waiting { trials: self.wait, cost };
                self.wait = MAX_WAIT.min(2 * self.wait);
            }
            Phase::Waiting { trials, cost: cost_before } => {
                let has_changed = cost > cost_before * COST_CHANGE || cost * COST_CHANGE < cost_before;
                if has_changed {
                    self.wait = WAIT;
                }
                if has_changed || trials == 1 {
                    self.try_step(0, cost);
                } else {
                    self.phase = Phase::Waiting { trials: trials - 1, cost: cost_before };
                }
            }
        }
    }

    /// Starts a trial of another value of number `which`. At the present values, the cost is `cost`.
    fn try_step(&mut self, which: usize, cost: f64) {
        let previous = self.values[which];
        let factor = if self.up[which] { STEP[which] } else { 1.0 / STEP[which] };
        self.values[which] = (previous * factor).clamp(self.min[which], self.max[which]);
        self.phase = Phase::Trying { which, previous, cost };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Work with the lowest cost per path at the values `best`.
    fn work(values: [f64; 2], best: [f64; 2]) -> Work {
        let deviation = |k: usize| libm::log(values[k] / best[k]);
        let cost = 1e6 * values[0] * (1.0 + deviation(0) * deviation(0) + deviation(1) * deviation(1));
        Work { candidates: cost as u64, ..Work::default() }
    }

    #[test]
    fn the_tuner_finds_the_least_cost_and_follows_it() {
        let mut tuner = Tuner::new(0.1, 3, 1000);
        let near = |tuner: &Tuner, best: [f64; 2]| {
            (0..2).all(|k| libm::log(tuner.values[k] / best[k]).abs() < 1.6 * libm::log(STEP[k]))
        };
        for best in [[1.0, 1.5], [0.1, 0.8]] {
            for _ in 0..120 {
                tuner.update(&work(tuner.values, best), &Work::default(), tuner.values[0]);
            }
            assert!(near(&tuner, best), "{:?} for {best:?}", tuner.values);
        }
    }

    /// The cost of opening is constant, that of events grows with the square of the length: the best length
    /// is known.
    #[test]
    fn windows_are_shorter_if_events_weigh_more() {
        for particles in [WEIGHT_EVENTS, WEIGHT_EVENTS + 1] {
            let mut tuner = Tuner::new(0.1, 3, particles);
            let weights = tuner.weights;
            let (opening, events) = (1e6, 1e5);
            for _ in 0..60 {
                let path = tuner.values[0];
                let opening = Work { candidates: opening as u64, ..Work::default() };
                let events = Work { candidates: (events * path * path) as u64, ..Work::default() };
                tuner.update(&opening, &events, path);
            }
            let best = libm::sqrt(opening / (weights.events * events));
            let off = libm::log(tuner.values[0] / best) / libm::log(STEP[0]);
            // From deviations above this, a step gains more than `GAIN`.
            assert!(off.abs() < 0.7, "{:?} for {weights:?}, best {best}", tuner.values);
        }
    }

    /// The cost drifts from trial to trial, whatever the values are.
    #[test]
    fn a_drifting_cost_is_not_taken_for_a_gain_or_a_loss() {
        for drift in [0.95_f64, 1.05] {
            let mut tuner = Tuner::new(0.1, 3, 1000);
            let mut scale = 1e3;
            for _ in 0..60 {
                let Work { candidates, .. } = work(tuner.values, [1.0, 1.5]);
                let work = Work { candidates: (candidates as f64 * scale) as u64, ..Work::default() };
                tuner.update(&work, &Work::default(), tuner.values[0]);
                scale *= drift;
            }
            let off = [0, 1].map(|k| libm::log(tuner.values[k] / [1.0, 1.5][k]).abs() / libm::log(STEP[k]));
            assert!(off.iter().all(|&off| off < 1.6), "{:?}", tuner.values);
        }
    }

    #[test]
    fn no_work_changes_nothing() {
        let mut tuner = Tuner::new(0.1, 3, 1000);
        let before = tuner.values;
        tuner.update(&Work::default(), &Work::default(), 0.0);
        assert_eq!(tuner.values, before);
    }
}
