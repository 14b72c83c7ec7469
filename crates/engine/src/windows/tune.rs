/*!
How long windows are, and how wide cells.

Long windows are opened less often, but their searches look further, and predict more that never happens; wide
cells are visited less often, but hold more that is out of reach. The best of both depends on the density, and
on how the particles are distributed: it moves as a gas clusters. So both are tuned all the time by small
steps, judged by what the searches have done, as counted, and not by the clock: the same run makes the same
choices everywhere. No choice changes a trajectory. What a count is worth depends on where the data are
([`Distance`]).
*/

use crate::tuning::{PerDimension, particles::WEIGHT_EVENTS};

/// What has been done, in counts.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct Work {
    pub searches: u64,
    pub blocks: u64,
    pub candidates: u64,
    pub predictions: u64,
    pub entries: u64,
    pub windows: u64,
}

impl Work {
    /// What has been done since `before`.
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

    /// Instructions, as counted for each part by callgrind; a block of cells counts as so many `blocks`.
    fn cost(&self, blocks: f64) -> f64 {
        250.0 * self.searches as f64
            + 25.0 * blocks * self.blocks as f64
            + 14.0 * self.candidates as f64
            + 150.0 * self.predictions as f64
            + 100.0 * self.entries as f64
            + 2000.0 * self.windows as f64
    }
}

/// Steps on the two scales.
const STEP: [f64; 2] = [1.25, 1.15];
/// A trial that makes less difference than this is no better.
const GAIN: f64 = 0.005;
/// Failures in a row after which the tuner rests, and for how many trials: twice as many each time that
/// nothing better is found again.
const PATIENCE: u32 = 4;
const REST: u32 = 24;
const LONGEST_REST: u32 = 96;
/// A change of the cost by this factor wakes it.
const WAKE: f64 = 1.15;

/// How far from the processor a system is. Windows are opened in the order of memory, events are taken in
/// that of time and wait for it: the same work weighs more there. Fitted to the rates at lengths and widths
/// set by hand, for which see the benchmark record.
#[derive(Debug, Clone, Copy)]
struct Distance {
    /// What the work of events weighs, in units of that of opening.
    events: f64,
    /// What their blocks of cells weigh beyond that.
    blocks: f64,
    /// What the length of windows starts from in two and in three dimensions, at a packing fraction of 1.
    start: PerDimension,
}

impl Distance {
    const NEAR: Self = Self { events: 2.5, blocks: 1.0, start: PerDimension { disks: 0.3, spheres: 0.13 } };
    const FAR: Self = Self { events: 6.0, blocks: 2.0, start: PerDimension { disks: 0.17, spheres: 0.113 } };

    fn of(particles: usize) -> Self {
        if particles <= WEIGHT_EVENTS { Self::NEAR } else { Self::FAR }
    }
}

/// What a tuner is doing. Costs are per path.
#[derive(Debug, Clone, Copy)]
enum Doing {
    /// It has not been told anything.
    Nothing,
    /// It tries another value than the one `left`, at which the cost was this.
    Trying { which: usize, left: f64, cost: f64 },
    /// It has gone back from the value `tried` to the one left, whose costs these are, to see what has
    /// changed by itself since: a gas that melts, falls or clusters costs more or less from trial to trial,
    /// whatever is tried.
    Comparing { which: usize, tried: f64, cost_tried: f64, cost_left: f64 },
    /// It has found nothing better at this cost, and waits for so many trials.
    Resting { trials: u32, cost: f64 },
}

/// Tunes two numbers: the mean path in a window and the width of cells, both in mean spacings of particles.
#[derive(Debug, Clone)]
pub(super) struct Tuner {
    pub values: [f64; 2],
    least: [f64; 2],
    most: [f64; 2],
    up: [bool; 2],
    failures: u32,
    /// Trials that the next rest takes.
    rest: u32,
    doing: Doing,
    distance: Distance,
}

impl Tuner {
    /// Starts from a guess for a system of so many dimensions and particles.
    pub fn new(packing_fraction: f64, dimensions: usize, particles: usize) -> Self {
        let distance = Distance::of(particles);
        let start = distance.start.of(dimensions);
        let path = start * libm::pow(packing_fraction.max(1e-9), -0.43);
        Self {
            values: [path.clamp(0.02, 4.0), 1.15],
            least: [0.01, 0.5],
            most: [8.0, 4.0],
            up: [true, false],
            failures: 0,
            rest: REST,
            doing: Doing::Nothing,
            distance,
        }
    }

    /// Judges the work done for `opening` windows and by their `events` over a `path` [mean spacings], and
    /// chooses the next values.
    pub fn judge(&mut self, opening: &Work, events: &Work, path: f64) {
        if path <= 0.0 {
            return;
        }
        let cost = (opening.cost(1.0) + self.distance.events * events.cost(self.distance.blocks)) / path;
        match self.doing {
            Doing::Nothing => self.try_step(0, cost),
            Doing::Trying { which, left, cost: cost_left } => {
                let tried = std::mem::replace(&mut self.values[which], left);
                self.doing = Doing::Comparing { which, tried, cost_tried: cost, cost_left };
            }
            Doing::Comparing { which, tried, cost_tried, cost_left } => {
                if cost_tried < 0.5 * (cost_left + cost) * (1.0 - GAIN) {
                    self.values[which] = tried;
                    self.failures = 0;
                    self.rest = REST;
                    return self.try_step(which, cost_tried);
                }
                self.up[which] = !self.up[which];
                self.failures += 1;
                if self.failures < PATIENCE {
                    return self.try_step(1 - which, cost);
                }
                self.failures = 0;
                self.doing = Doing::Resting { trials: self.rest, cost };
                self.rest = LONGEST_REST.min(2 * self.rest);
            }
            Doing::Resting { trials, cost: found } => {
                let woken = cost > found * WAKE || cost * WAKE < found;
                if woken {
                    self.rest = REST;
                }
                if woken || trials == 1 {
                    self.try_step(0, cost);
                } else {
                    self.doing = Doing::Resting { trials: trials - 1, cost: found };
                }
            }
        }
    }

    /// Tries another of the two values; at that of now the cost is this.
    fn try_step(&mut self, which: usize, cost: f64) {
        let left = self.values[which];
        let factor = if self.up[which] { STEP[which] } else { 1.0 / STEP[which] };
        self.values[which] = (left * factor).clamp(self.least[which], self.most[which]);
        self.doing = Doing::Trying { which, left, cost };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A cost with its least value at `best`.
    fn work(values: [f64; 2], best: [f64; 2]) -> Work {
        let far = |k: usize| libm::log(values[k] / best[k]);
        let cost = 1e6 * values[0] * (1.0 + far(0) * far(0) + far(1) * far(1));
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
                tuner.judge(&work(tuner.values, best), &Work::default(), tuner.values[0]);
            }
            assert!(near(&tuner, best), "{:?} for {best:?}", tuner.values);
        }
    }

    /// Opening takes so much per window and events so much per squared length: the best length is known.
    #[test]
    fn windows_get_the_shorter_the_more_the_work_of_events_weighs() {
        for particles in [WEIGHT_EVENTS, WEIGHT_EVENTS + 1] {
            let mut tuner = Tuner::new(0.1, 3, particles);
            let distance = tuner.distance;
            let (opening, events) = (1e6, 1e5);
            for _ in 0..60 {
                let path = tuner.values[0];
                let opening = Work { candidates: opening as u64, ..Work::default() };
                let events = Work { candidates: (events * path * path) as u64, ..Work::default() };
                tuner.judge(&opening, &events, path);
            }
            let best = libm::sqrt(opening / (distance.events * events));
            let off = libm::log(tuner.values[0] / best) / libm::log(STEP[0]);
            // Steps from further off gain more than `GAIN`.
            assert!(off.abs() < 0.7, "{:?} for {distance:?}, best {best}", tuner.values);
        }
    }

    /// Of a gas that costs more, or less, from trial to trial whatever is tried.
    #[test]
    fn what_changes_by_itself_is_not_taken_for_a_gain_or_a_loss() {
        for drift in [0.95_f64, 1.05] {
            let mut tuner = Tuner::new(0.1, 3, 1000);
            let mut scale = 1e3;
            for _ in 0..60 {
                let Work { candidates, .. } = work(tuner.values, [1.0, 1.5]);
                let work = Work { candidates: (candidates as f64 * scale) as u64, ..Work::default() };
                tuner.judge(&work, &Work::default(), tuner.values[0]);
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
        tuner.judge(&Work::default(), &Work::default(), 0.0);
        assert_eq!(tuner.values, before);
    }
}
