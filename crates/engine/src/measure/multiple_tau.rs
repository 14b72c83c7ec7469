//! Correlations in time at lags that are spaced nearly logarithmically, computed while states come in.
//!
//! The multiple-tau correlator: the lags of the first level are multiples of the interval between states, and
//! each further level takes every second state of the one before (D. Frenkel, B. Smit, Understanding
//! Molecular Simulation, section 4.4.2), or the mean of two for noisy signals (J. Ramírez, S. K. Sukumaran,
//! B. Vorselaars, A. E. Likhtman, J. Chem. Phys. 133, 154103 (2010)). Errors of the means are those of blocks
//! of growing length (H. Flyvbjerg, H. G. Petersen, J. Chem. Phys. 91, 461 (1989)).

use std::collections::VecDeque;

use crate::numerics::{
    error::EngineError,
    words::{Words, put_reals},
};

/// Number of earlier states that a level keeps: the longest of its lags.
const POINTS: usize = 16;
/// Number of blocks from which an error is estimated, at least.
const BLOCKS: u64 = 8;
/// More levels than a run can fill.
const MAX_LEVELS: u64 = 60;

/// How two states are correlated.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Operation {
    /// Square of the difference.
    SquareDifference,
    /// Product.
    Product,
    /// Product; higher levels take means of states.
    ProductOfMeans,
}

/// The mean of a series of correlated numbers, and its error.
#[derive(Debug, Clone, Default)]
struct Blocks {
    levels: Vec<BlockLevel>,
}

/// Blocks of one length.
#[derive(Debug, Clone, Copy, Default)]
struct BlockLevel {
    count: u64,
    /// Mean of the blocks, and sum of the squares of their deviations from it.
    mean: f64,
    squares: f64,
    /// The first half of a block of the next level.
    pending: Option<f64>,
}

impl Blocks {
    fn add(&mut self, mut value: f64) {
        for level in 0.. {
            if level == self.levels.len() {
                self.levels.push(BlockLevel::default());
            }
            let block = &mut self.levels[level];
            // Welford's recurrence.
            block.count += 1;
            let deviation = value - block.mean;
            block.mean += deviation / block.count as f64;
            block.squares += deviation * (value - block.mean);
            if let Some(first) = block.pending.take() {
                value = 0.5 * (first + value);
            } else {
                block.pending = Some(value);
                return;
            }
        }
    }

    fn count(&self) -> u64 {
        self.levels.first().map_or(0, |level| level.count)
    }

    fn mean(&self) -> f64 {
        self.levels.first().map_or(f64::NAN, |level| level.mean)
    }

    /// The largest standard error of the mean over all lengths of blocks; NaN for too few blocks.
    fn error(&self) -> f64 {
        let errors = self
            .levels
            .iter()
            .filter(|level| level.count >= BLOCKS)
            .map(|level| (level.squares / (level.count as f64 * (level.count - 1) as f64)).sqrt());
        errors.fold(f64::NAN, f64::max)
    }

    fn save(&self, words: &mut Vec<u64>) {
        words.push(self.levels.len() as u64);
        for level in &self.levels {
            words.extend([level.count, u64::from(level.pending.is_some())]);
            put_reals(words, &[level.mean, level.squares, level.pending.unwrap_or(0.0)]);
        }
    }

    fn load(words: &mut Words) -> Result<Self, EngineError> {
        let levels = words.count("a number of blocks", 64)?;
        let level = |_| {
            let (count, has_pending) = (words.take()?, words.count("a flag", 1)? == 1);
            let (mean, squares, pending) = (words.real()?, words.real()?, words.real()?);
            Ok(BlockLevel { count, mean, squares, pending: has_pending.then_some(pending) })
        };
        Ok(Self { levels: (0..levels).map(level).collect::<Result<_, _>>()? })
    }
}

/// States at multiples of 2^level intervals.
#[derive(Debug, Clone)]
struct Level {
    /// The latest states, the newest last.
    states: VecDeque<Vec<f64>>,
    /// By lag.
    lags: Vec<Blocks>,
    /// Number of states so far.
    seen: u64,
    /// The first of two states whose mean the next level takes.
    pending: Option<Vec<f64>>,
}

impl Level {
    fn new(first: Option<Vec<f64>>) -> Self {
        let states = VecDeque::from_iter(first);
        Self { seen: states.len() as u64, states, lags: vec![Blocks::default(); POINTS + 1], pending: None }
    }
}

/// A correlation of a vector with itself.
#[derive(Debug, Clone)]
pub(crate) struct MultipleTau {
    operation: Operation,
    /// Numbers in a state, and what their sum is divided by.
    width: usize,
    divisor: f64,
    levels: Vec<Level>,
}

/// One lag of a correlation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Lag {
    /// In intervals.
    pub steps: u64,
    pub value: f64,
    pub error: f64,
    /// Number of pairs of states.
    pub count: u64,
}

impl MultipleTau {
    /// A correlation of states of `width` numbers: the sum over all numbers, divided by `divisor`.
    pub fn new(operation: Operation, width: usize, divisor: f64) -> Self {
        Self { operation, width, divisor, levels: Vec::new() }
    }

    /// Adds the state of the next interval.
    pub fn add(&mut self, mut state: Vec<f64>) {
        for k in 0.. {
            if k == self.levels.len() {
                // The first state of all is the first of each level.
                let first = k.checked_sub(1).and_then(|below| self.levels[below].states.front().cloned());
                let first = first.filter(|_| self.operation != Operation::ProductOfMeans);
                self.levels.push(Level::new(first));
            }
            let level = &mut self.levels[k];
            let correlate = |other: &[f64]| combine(self.operation, &state, other) / self.divisor;
            // Shorter lags are those of the level before.
            let shortest = if k == 0 { 1 } else { POINTS / 2 + 1 };
            if k == 0 && self.operation != Operation::SquareDifference {
                level.lags[0].add(correlate(&state));
            }
            for (lag, earlier) in (1..).zip(level.states.iter().rev()).skip(shortest - 1) {
                level.lags[lag].add(correlate(earlier));
            }
            if level.states.len() == POINTS {
                level.states.pop_front();
            }
            level.states.push_back(state.clone());
            level.seen += 1;
            if self.operation == Operation::ProductOfMeans {
                let Some(first) = level.pending.take() else {
                    level.pending = Some(state);
                    return;
                };
                state.iter_mut().zip(first).for_each(|(later, first)| *later = 0.5 * (first + *later));
            } else if level.seen.is_multiple_of(2) || level.seen == 1 {
                return;
            }
        }
    }

    /// All lags for which there is a pair of states, in order.
    pub fn lags(&self) -> Vec<Lag> {
        let of_level = |(k, level): (usize, &Level)| {
            let lag = |(lag, blocks): (usize, &Blocks)| Lag {
                steps: (lag as u64) << k,
                value: blocks.mean(),
                error: blocks.error(),
                count: blocks.count(),
            };
            level.lags.iter().enumerate().map(lag).filter(|lag| lag.count > 0).collect::<Vec<_>>()
        };
        self.levels.iter().enumerate().flat_map(of_level).collect()
    }

    pub fn save(&self, words: &mut Vec<u64>) {
        words.push(self.levels.len() as u64);
        for level in &self.levels {
            words.extend([level.states.len() as u64, level.seen, u64::from(level.pending.is_some())]);
            level.states.iter().chain(&level.pending).for_each(|state| put_reals(words, state));
            level.lags.iter().for_each(|lag| lag.save(words));
        }
    }

    pub fn load(&mut self, words: &mut Words) -> Result<(), EngineError> {
        let levels = words.count("a number of levels", MAX_LEVELS)?;
        self.levels.clear();
        for _ in 0..levels {
            let states = words.count("a number of states", POINTS as u64)?;
            let (seen, has_pending) = (words.take()?, words.count("a flag", 1)? == 1);
            let states = (0..states).map(|_| words.reals(self.width)).collect::<Result<_, _>>()?;
            let pending = if has_pending { Some(words.reals(self.width)?) } else { None };
            let lags = (0..=POINTS).map(|_| Blocks::load(words)).collect::<Result<_, _>>()?;
            self.levels.push(Level { states, lags, seen, pending });
        }
        Ok(())
    }
}

/// Sum over the numbers of two states, in eight sums that the compiler can keep in vectors.
fn combine(operation: Operation, a: &[f64], b: &[f64]) -> f64 {
    const WIDTH: usize = 8;
    let term = |a: f64, b: f64| match operation {
        Operation::SquareDifference => (a - b) * (a - b),
        Operation::Product | Operation::ProductOfMeans => a * b,
    };
    let mut sums = [0.0; WIDTH];
    let (head_a, tail_a) = a.as_chunks::<WIDTH>();
    let (head_b, tail_b) = b.as_chunks::<WIDTH>();
    for (a, b) in head_a.iter().zip(head_b) {
        for k in 0..WIDTH {
            sums[k] += term(a[k], b[k]);
        }
    }
    for (k, (&a, &b)) in tail_a.iter().zip(tail_b).enumerate() {
        sums[k] += term(a, b);
    }
    sums.iter().sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn signal(count: usize) -> Vec<f64> {
        let mut random = haff_testing::Random(5);
        let mut value = 0.0;
        (0..count)
            .map(|_| {
                value = 0.8 * value + random.uniform(-0.5, 0.5);
                value
            })
            .collect()
    }

    fn direct(values: &[f64], lag: usize, every: usize, term: impl Fn(f64, f64) -> f64) -> f64 {
        let kept: Vec<f64> = values.iter().step_by(every).copied().collect();
        let terms: Vec<f64> = kept.iter().zip(&kept[lag / every..]).map(|(a, b)| term(*a, *b)).collect();
        terms.iter().sum::<f64>() / terms.len() as f64
    }

    #[test]
    fn lags_have_the_values_of_direct_sums() {
        let values = signal(1000);
        for operation in [Operation::SquareDifference, Operation::Product] {
            let mut correlation = MultipleTau::new(operation, 1, 1.0);
            for &value in &values {
                correlation.add(vec![value]);
            }
            let lags = correlation.lags();
            let first = u64::from(operation != Operation::Product);
            assert_eq!(lags[0].steps, first);
            assert_eq!(lags.last().map(|lag| lag.steps), Some(960), "15 · 64 of 1000 states");
            assert!(lags.windows(2).all(|pair| pair[0].steps < pair[1].steps));
            for lag in lags {
                let every = (lag.steps.max(1).div_ceil(16) as usize).next_power_of_two();
                let exact = direct(&values, lag.steps as usize, every, |a, b| match operation {
                    Operation::SquareDifference => (a - b).powi(2),
                    _ => a * b,
                });
                assert!((lag.value - exact).abs() < 1e-12, "lag {}: {} and {exact}", lag.steps, lag.value);
            }
        }
    }

    #[test]
    fn means_of_states_keep_the_integral_of_a_correlation() {
        let values = signal(1 << 14);
        let mut correlation = MultipleTau::new(Operation::ProductOfMeans, 1, 1.0);
        for &value in &values {
            correlation.add(vec![value]);
        }
        // For the autoregressive signal: variance (1/12)/(1 − 0.64) and correlation 0.8^lag.
        for lag in correlation.lags().iter().filter(|lag| lag.steps <= 16) {
            let exact = 0.8_f64.powi(lag.steps as i32) / 12.0 / 0.36;
            assert!((lag.value - exact).abs() < 4.0 * lag.error, "{lag:?}, exactly {exact}");
        }
    }

    #[test]
    fn errors_of_correlated_numbers_are_those_of_independent_runs() {
        let (runs, length) = (200, 1 << 12);
        let values = signal(runs * length);
        let (mut means, mut errors) = (Vec::new(), 0.0);
        for run in values.chunks(length) {
            let mut blocks = Blocks::default();
            for &value in run {
                blocks.add(value);
            }
            means.push(blocks.mean());
            errors += blocks.error() / runs as f64;
        }
        let mean = means.iter().sum::<f64>() / runs as f64;
        let spread = (means.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / (runs - 1) as f64).sqrt();
        // The largest of several estimates is too large on average, but not by much.
        let ratio = errors / spread;
        assert!((0.95..1.4).contains(&ratio), "{ratio}");
    }

    #[test]
    fn a_saved_correlation_goes_on_with_the_same_bits() {
        let values = signal(500);
        for operation in [Operation::SquareDifference, Operation::ProductOfMeans] {
            let mut whole = MultipleTau::new(operation, 2, 2.0);
            let mut part = whole.clone();
            let states: Vec<Vec<f64>> = values.chunks_exact(2).map(<[f64]>::to_vec).collect();
            for state in &states {
                whole.add(state.clone());
            }
            for state in &states[..101] {
                part.add(state.clone());
            }
            let mut words = Vec::new();
            part.save(&mut words);
            let mut resumed = MultipleTau::new(operation, 2, 2.0);
            let mut reader = Words::new(&words);
            assert!(resumed.load(&mut reader).is_ok() && reader.finish().is_ok());
            for state in &states[101..] {
                resumed.add(state.clone());
            }
            assert_eq!(format!("{:?}", resumed.lags()), format!("{:?}", whole.lags()));
            for end in 0..words.len() {
                assert!(MultipleTau::new(operation, 2, 2.0).load(&mut Words::new(&words[..end])).is_err());
            }
        }
    }
}
