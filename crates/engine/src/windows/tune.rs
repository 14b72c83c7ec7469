/*!
How long windows are, and how wide cells.

Long windows are opened less often, but their searches look further, and predict more that never happens; wide cells are visited
less often, but hold more that is out of reach. The best of both depends on the density, and on how the particles are distributed:
it moves as a gas clusters. So both are tuned all the time by small steps, judged by what the searches have done, as
counted, and not by the clock: the same run makes the same choices everywhere. No choice changes a trajectory.
*/

/// What has been done, in counts.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct Work {
    pub searches: u64,
    pub blocks: u64,
    pub candidates: u64,
    pub exact: u64,
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
            exact: self.exact - before.exact,
            entries: self.entries - before.entries,
            windows: self.windows - before.windows,
        }
    }

    /// Adds the work of another thread.
    pub fn add(&mut self, other: &Self) {
        self.searches += other.searches;
        self.blocks += other.blocks;
        self.candidates += other.candidates;
        self.exact += other.exact;
        self.entries += other.entries;
        self.windows += other.windows;
    }

    /// Instructions, as counted for each part by callgrind.
    fn cost(&self) -> f64 {
        250.0 * self.searches as f64
            + 25.0 * self.blocks as f64
            + 14.0 * self.candidates as f64
            + 150.0 * self.exact as f64
            + 100.0 * self.entries as f64
            + 2000.0 * self.windows as f64
    }
}

/// Steps on the two scales.
const STEP: [f64; 2] = [1.25, 1.15];
/// A trial that makes less difference than this is no better.
const GAIN: f64 = 0.005;
/// Failures in a row after which the tuner rests, and for how many trials.
const PATIENCE: u32 = 4;
const REST: u32 = 24;
/// A change of the cost by this factor wakes it.
const WAKE: f64 = 1.15;

/// Tunes two numbers: the mean path in a window and the width of cells, both in mean spacings of particles.
#[derive(Debug, Clone)]
pub(super) struct Tuner {
    pub values: [f64; 2],
    least: [f64; 2],
    most: [f64; 2],
    /// Cost per path at the accepted values, if known.
    accepted: Option<f64>,
    /// The value under trial, and what it was before.
    trial: Option<(usize, f64)>,
    up: [bool; 2],
    failures: u32,
    rest: u32,
}

impl Tuner {
    /// Starts from a guess for a packing fraction.
    pub fn new(packing_fraction: f64) -> Self {
        let path = 0.13 * libm::pow(packing_fraction.max(1e-9), -0.43);
        Self {
            values: [path.clamp(0.02, 4.0), 1.15],
            least: [0.01, 0.5],
            most: [8.0, 4.0],
            accepted: None,
            trial: None,
            up: [true, false],
            failures: 0,
            rest: 0,
        }
    }

    /// Judges the `work` done over a `path` [mean spacings], and chooses the next values.
    pub fn judge(&mut self, work: &Work, path: f64) {
        if path <= 0.0 {
            return;
        }
        let cost = work.cost() / path;
        match (self.trial.take(), self.accepted) {
            (Some((which, before)), Some(accepted)) => {
                if cost < accepted * (1.0 - GAIN) {
                    self.accepted = Some(cost);
                    self.failures = 0;
                    self.try_step(which);
                } else {
                    self.values[which] = before;
                    self.up[which] = !self.up[which];
                    self.failures += 1;
                    if self.failures >= PATIENCE {
                        self.rest = REST;
                        self.failures = 0;
                        self.accepted = None;
                    } else {
                        self.try_step(1 - which);
                    }
                }
            }
            (_, Some(accepted)) if self.rest > 0 => {
                self.rest -= 1;
                if cost > accepted * WAKE || cost * WAKE < accepted || self.rest == 0 {
                    self.rest = 0;
                    self.accepted = Some(cost);
                    self.try_step(0);
                }
            }
            (_, None) if self.rest > 0 => self.accepted = Some(cost),
            _ => {
                self.accepted = Some(cost);
                self.try_step(0);
            }
        }
    }

    fn try_step(&mut self, which: usize) {
        let before = self.values[which];
        let factor = if self.up[which] { STEP[which] } else { 1.0 / STEP[which] };
        self.values[which] = (before * factor).clamp(self.least[which], self.most[which]);
        self.trial = Some((which, before));
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
        let mut tuner = Tuner::new(0.1);
        let near = |tuner: &Tuner, best: [f64; 2]| {
            (0..2).all(|k| libm::log(tuner.values[k] / best[k]).abs() < 1.6 * libm::log(STEP[k]))
        };
        for best in [[1.0, 1.5], [0.1, 0.8]] {
            for _ in 0..120 {
                tuner.judge(&work(tuner.values, best), tuner.values[0]);
            }
            assert!(near(&tuner, best), "{:?} for {best:?}", tuner.values);
        }
    }

    #[test]
    fn no_work_changes_nothing() {
        let mut tuner = Tuner::new(0.1);
        let before = tuner.values;
        tuner.judge(&Work::default(), 0.0);
        assert_eq!(tuner.values, before);
    }
}
