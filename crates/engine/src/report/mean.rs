//! Means of correlated series, with their standard errors.
//!
//! The error is that of means over blocks (Flyvbjerg and Petersen, J. Chem. Phys. 91, 461 (1989)) of a size
//! that balances what correlations between blocks leave out against the scatter of few blocks (Lee et al.,
//! Phys. Rev. E 83, 066706 (2011)): the smallest power of two with b³ > 2 N g², where g is the statistical
//! inefficiency. What comes before the stationary part is left out where that makes the error smaller
//! (White, Simulation 69, 323 (1997)).

/// Fewest values that have an error.
pub const FEWEST: usize = 16;
/// Fewest blocks.
const BLOCKS: usize = 8;
/// Parts of a series between which the start of its stationary part is looked for.
const PARTS: usize = 100;
/// A start is left out if the error without it is less than this part of that with it, squared: of series
/// that are stationary it is so by chance in a few per mille.
const WORTH: f64 = 0.7;
/// A slope of more standard errors than this is a drift.
const DRIFT: f64 = 4.0;
/// Most blocks between which the slope is measured.
const SLOPE_BLOCKS: usize = 20;

/// The mean of a correlated series over its stationary part.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Mean {
    /// The mean from `start` on.
    pub mean: f64,
    /// Its standard error; NaN of fewer than [`FEWEST`] values.
    pub error: f64,
    /// Index of the first value of the stationary part.
    pub start: usize,
    /// Number of independent values that would have the same error: that of values, divided by the
    /// statistical inefficiency. With fewer than [`Self::FEW`] the error is a lower bound.
    pub independent: f64,
    /// The slope of the stationary part, in its standard errors (as a normal variable).
    pub slope: f64,
    /// Whether the series is not stationary: its slope is larger than chance, or half of it is needed to
    /// reach the stationary part.
    pub drifts: bool,
}

impl Mean {
    /// Relative differences up to this are rounding.
    pub const ROUNDING: f64 = 1e-12;
    /// With fewer independent values an error is a lower bound.
    pub const FEW: f64 = 30.0;

    /// The mean of a series of values at equal intervals. Values that are not a number are left out before
    /// the first that is; `None` if there is no number, or another value later that is none.
    pub fn of(values: &[f64]) -> Option<Self> {
        let first = values.iter().position(|value| value.is_finite())?;
        let values = &values[first..];
        if !values.iter().all(|value| value.is_finite()) {
            return None;
        }
        if values.len() < FEWEST {
            let (error, slope) = (f64::NAN, f64::NAN);
            let mean = mean(values);
            return Some(Self { mean, error, start: first, independent: f64::NAN, slope, drifts: false });
        }
        if is_constant(values) {
            let (independent, mean) = (values.len() as f64, mean(values));
            return Some(Self { mean, error: 0.0, start: first, independent, slope: 0.0, drifts: false });
        }
        let start = stationary_from(values);
        let late = start >= values.len() / 2;
        let values = &values[start..];
        let Blocks { size, error, inefficiency } = Blocks::of(values);
        let slope = slope(values, size);
        Some(Self {
            mean: mean(values),
            error,
            start: first + start,
            independent: values.len() as f64 / inefficiency,
            slope,
            drifts: late || slope.abs() > DRIFT,
        })
    }
}

impl Mean {
    /// The mean of what has these values over the intervals that end at these times, as of samples that are
    /// taken at other times, too; and the time at which its stationary part begins. `None` as for
    /// [`Mean::of`].
    pub fn of_samples(times: &[f64], values: &[f64]) -> Option<(Self, f64)> {
        let intervals: Vec<f64> = times.windows(2).map(|pair| pair[1] - pair[0]).collect();
        let step = median(&intervals)?;
        // Over the first interval a mean need not exist yet.
        let first = values.get(1..)?.iter().position(|value| value.is_finite())?;
        let (values, intervals) = (&values[1 + first..], &intervals[first..]);
        let complete = values.len() == intervals.len() && values.iter().all(|value| value.is_finite());
        if step <= 0.0 || !complete {
            return None;
        }
        // Relative to one value: sums of constants then have no rounding error. What is left at the end is
        // left out.
        let level = values[0];
        let mut regular = Vec::new();
        let (mut sum, mut filled) = (0.0, 0.0);
        for (value, &interval) in values.iter().zip(intervals) {
            let mut left = interval;
            while filled + left >= step * (1.0 - 1e-6) {
                let part = (step - filled).min(left);
                regular.push(level + (sum + (value - level) * part) / (filled + part));
                left -= part;
                (sum, filled) = (0.0, 0.0);
                if left < step * 1e-6 {
                    left = 0.0;
                }
            }
            sum += (value - level) * left;
            filled += left;
        }
        let found = Self::of(&regular)?;
        Some((found, times[first] + step * found.start as f64))
    }
}

/// Whether the values are equal to rounding, as an energy that is conserved.
fn is_constant(values: &[f64]) -> bool {
    let (least, most) =
        values.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), &x| (a.min(x), b.max(x)));
    most - least <= Mean::ROUNDING * least.abs().max(most.abs())
}

/// The median of numbers; `None` of none.
fn median(values: &[f64]) -> Option<f64> {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted.get(sorted.len() / 2).copied()
}

/// The mean, without loss of digits by a common large part.
fn mean(values: &[f64]) -> f64 {
    let first = values[0];
    first + values.iter().map(|value| value - first).sum::<f64>() / values.len() as f64
}

/// The variance of values, with n − 1.
fn variance(values: &[f64]) -> f64 {
    let mean = mean(values);
    values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / (values.len() - 1) as f64
}

/// Means over blocks of this size at the end of the series.
fn block_means(values: &[f64], size: usize) -> Vec<f64> {
    values[values.len() % size..].chunks(size).map(mean).collect()
}

struct Blocks {
    size: usize,
    error: f64,
    inefficiency: f64,
}

impl Blocks {
    fn of(values: &[f64]) -> Self {
        let (count, single) = (values.len() as f64, variance(values));
        let mut found = Self { size: 1, error: 0.0, inefficiency: 1.0 };
        if single == 0.0 {
            return found;
        }
        let mut size = 1;
        while values.len() / size >= BLOCKS {
            let means = block_means(values, size);
            let of_means = variance(&means);
            let inefficiency = size as f64 * of_means / single;
            found = Self { size, error: (of_means / means.len() as f64).sqrt(), inefficiency };
            if (size as f64).powi(3) > 2.0 * count * inefficiency.powi(2) {
                break;
            }
            size *= 2;
        }
        found
    }
}

/// Index of the first value of the stationary part, at most half of the series: where the squared error of
/// the rest, if it were not correlated, is smallest.
fn stationary_from(values: &[f64]) -> usize {
    let size = (values.len() / PARTS).max(1);
    let means = block_means(values, size);
    let offset = values.len() % size;
    let middle = mean(&means);
    let (mut sum, mut squares) = (0.0, 0.0);
    let mut squared_errors: Vec<f64> = means
        .iter()
        .rev()
        .zip(1..)
        .map(|(value, count)| {
            sum += value - middle;
            squares += (value - middle).powi(2);
            let count = f64::from(count);
            (squares - sum * sum / count).max(0.0) / (count * count)
        })
        .collect();
    squared_errors.reverse();
    let half = &squared_errors[..=means.len() / 2];
    let (start, least) = half
        .iter()
        .enumerate()
        .fold((0, f64::INFINITY), |best, (k, &x)| if x < best.1 { (k, x) } else { best });
    if start > 0 && least < WORTH * half[0] { offset + start * size } else { 0 }
}

/// The slope of a series in its standard errors, from means over at most [`SLOPE_BLOCKS`] blocks of at least
/// this size; the distribution of Student is made normal.
fn slope(values: &[f64], size: usize) -> f64 {
    let means = block_means(values, size.max(values.len().div_ceil(SLOPE_BLOCKS)));
    let count = means.len() as f64;
    if means.len() < 4 {
        return f64::NAN;
    }
    let (middle, level) = (0.5 * (count - 1.0), mean(&means));
    let place = |k: usize| k as f64 - middle;
    let spread: f64 = (0..means.len()).map(|k| place(k).powi(2)).sum();
    let slope = means.iter().enumerate().map(|(k, value)| place(k) * (value - level)).sum::<f64>() / spread;
    let off = |(k, value): (usize, &f64)| (value - level - slope * place(k)).powi(2);
    let left: f64 = means.iter().enumerate().map(off).sum();
    let freedom = count - 2.0;
    if left == 0.0 {
        return if slope == 0.0 { 0.0 } else { slope.signum() * f64::INFINITY };
    }
    let t = slope / (left / freedom / spread).sqrt();
    // Wallace, Ann. Math. Stat. 30, 1121 (1959).
    let normal = (8.0 * freedom + 1.0) / (8.0 * freedom + 3.0) * (freedom * (t * t / freedom).ln_1p()).sqrt();
    normal.copysign(t)
}

#[cfg(test)]
mod tests {
    use haff_testing::Random;

    use super::*;

    /// x ← φ x + ξ, which starts in its stationary state.
    fn correlated(coefficient: f64, count: usize, random: &mut Random) -> Vec<f64> {
        let mut value = random.normal() / (1.0 - coefficient * coefficient).sqrt();
        (0..count)
            .map(|_| {
                value = coefficient * value + random.normal();
                value
            })
            .collect()
    }

    #[test]
    fn errors_are_those_of_independent_series() {
        const SERIES: usize = 1000;
        let mut random = Random(1);
        for (coefficient, count) in [(0.0, 200), (0.0, 4000), (0.5, 1000), (0.9, 2000), (0.98, 10_000)] {
            let all: Vec<Mean> = (0..SERIES)
                .map(|_| Mean::of(&correlated(coefficient, count, &mut random)).unwrap())
                .collect();
            let scatter = variance(&all.iter().map(|one| one.mean).collect::<Vec<_>>()).sqrt();
            let stated = (all.iter().map(|one| one.error * one.error).sum::<f64>() / SERIES as f64).sqrt();
            let ratio = stated / scatter;
            // The scatter of 1000 series has an error of 2.2 %.
            assert!((ratio - 1.0).abs() < 0.1, "φ = {coefficient}, n = {count}: {ratio}");
            let drifting = all.iter().filter(|one| one.drifts).count();
            let cut = all.iter().filter(|one| one.start > 0).count();
            assert!(drifting <= 5 && cut <= 10, "φ = {coefficient}: {drifting} drift, {cut} are cut");
        }
    }

    #[test]
    fn relaxation_is_left_out_and_drifts_are_told() {
        let mut random = Random(2);
        let noise = correlated(0.8, 4000, &mut random);
        let relaxing: Vec<f64> =
            noise.iter().zip(0..).map(|(x, k)| x + 40.0 * (-f64::from(k) / 200.0).exp()).collect();
        let found = Mean::of(&relaxing).unwrap();
        assert!((500..1600).contains(&found.start) && !found.drifts, "{found:?}");
        assert!(found.mean.abs() < 4.0 * found.error, "{found:?}");
        let drifting: Vec<f64> = noise.iter().zip(0..).map(|(x, k)| x + 1e-3 * f64::from(k)).collect();
        assert!(Mean::of(&drifting).unwrap().drifts);
        let growing: Vec<f64> = (0..100).map(f64::from).collect();
        assert!(Mean::of(&growing).unwrap().drifts);
    }

    #[test]
    fn samples_count_by_the_intervals_that_end_at_them() {
        let mut random = Random(4);
        let (mut times, mut values, mut regular) = (vec![0.0], vec![f64::NAN], Vec::new());
        for k in 0..500 {
            // Every fourth interval is cut in two by a sample of another kind.
            let (end, value) = (0.5 * f64::from(k + 1), random.normal());
            if k % 4 == 0 {
                times.push(end - 0.2);
                values.push(value + 0.2);
                values.push(value - 0.3);
            } else {
                values.push(value);
            }
            times.push(end);
            regular.push(value);
        }
        // A shorter rest at the end.
        times.push(250.1);
        values.push(100.0);
        let expected = Mean::of(&regular).unwrap();
        let (found, from) = Mean::of_samples(&times, &values).unwrap();
        assert!(
            (found.mean - expected.mean).abs() < 1e-12 && (found.error / expected.error - 1.0).abs() < 1e-9
        );
        assert_eq!((found.start, from), (0, 0.0));
        let (constant, _) = Mean::of_samples(&times, &vec![3.1; times.len()]).unwrap();
        assert_eq!((constant.mean, constant.error), (3.1, 0.0));
        assert_eq!(Mean::of_samples(&[0.0], &[1.0]), None);
        assert_eq!(Mean::of_samples(&[0.0, 1.0, 2.0], &[1.0, 1.0, f64::NAN]), None);
        assert_eq!(Mean::of_samples(&[0.0, 0.0], &[1.0, 1.0]), None);
    }

    #[test]
    fn values_without_scatter_and_short_series() {
        let found = Mean::of(&[3.0; 100]).unwrap();
        assert_eq!((found.mean, found.error, found.start, found.drifts), (3.0, 0.0, 0, false));
        let rounded: Vec<f64> = (0..100).map(|k| 6000.0 + 1e-12 * f64::from(k * k % 7)).collect();
        assert_eq!(Mean::of(&rounded).unwrap().error, 0.0);
        let found = Mean::of(&[f64::NAN, 1.0, 2.0]).unwrap();
        assert_eq!((found.mean, found.start), (1.5, 1));
        assert!(found.error.is_nan() && !found.drifts);
        assert_eq!(Mean::of(&[]), None);
        assert_eq!(Mean::of(&[f64::NAN]), None);
        assert_eq!(Mean::of(&[1.0, f64::INFINITY]), None);
        // A large common part costs no digits.
        let mut random = Random(3);
        let small = correlated(0.0, 100, &mut random);
        let [a, b] = [0.0, 1e9].map(|shift| {
            Mean::of(&small.iter().map(|x| (x * 1024.0).round() / 1024.0 + shift).collect::<Vec<_>>())
                .unwrap()
        });
        assert!((a.error / b.error - 1.0).abs() < 1e-6, "{} {}", a.error, b.error);
    }
}
