//! Time as an unevaluated sum of two numbers, so that durations keep all their digits however long the run
//! is.

/// An instant \[time\]: `high + low` with |low| at most half an ulp of `high`.
#[derive(Debug, Clone, Copy, PartialEq, PartialOrd, Default)]
pub struct Instant {
    /// The time, rounded.
    pub high: f64,
    /// What rounding has taken off.
    pub low: f64,
}

impl Instant {
    /// The start of a run.
    pub const ZERO: Self = Self { high: 0.0, low: 0.0 };
    /// Later than every event.
    pub const NEVER: Self = Self { high: f64::INFINITY, low: 0.0 };

    /// The instant at this time.
    pub fn at(time: f64) -> Self {
        Self { high: time, low: 0.0 }
    }

    /// The instant `duration` later.
    #[must_use]
    pub fn after(self, duration: f64) -> Self {
        if duration == f64::INFINITY {
            return Self::NEVER;
        }
        let (sum, error) = two_sum(self.high, duration);
        let (high, low) = two_sum(sum, error + self.low);
        Self { high, low }
    }

    /// Duration since an earlier instant \[time\], rounded once.
    pub fn since(self, earlier: Self) -> f64 {
        if self.high == f64::INFINITY {
            return f64::INFINITY;
        }
        let (difference, error) = two_sum(self.high, -earlier.high);
        difference + (error + (self.low - earlier.low))
    }

    /// The later one.
    #[must_use]
    pub fn max(self, other: Self) -> Self {
        if other > self { other } else { self }
    }

    /// The earlier one.
    #[must_use]
    pub fn min(self, other: Self) -> Self {
        if other < self { other } else { self }
    }

    /// As one number, rounded.
    pub fn time(self) -> f64 {
        self.high
    }

    /// `frequency` · time as whole cycles and a rest of about −½ to ½, with the error of a few ulp of one
    /// cycle.
    pub fn turns(self, frequency: f64) -> (f64, f64) {
        let product = frequency * self.high;
        // Exact: the product's rounding error is a number.
        let error = frequency.mul_add(self.high, -product);
        let whole = product.round_ties_even();
        (whole, (product - whole) + (error + frequency * self.low))
    }

    /// `frequency` · time in cycles, reduced to 0 ≤ u < 1: with the error of a few ulp of one cycle, however
    /// many have gone by.
    pub fn cycles(self, frequency: f64) -> f64 {
        let product = frequency * self.high;
        // Exact: the product's rounding error is a number.
        let error = frequency.mul_add(self.high, -product);
        let cycles = (product - product.floor()) + (error + frequency * self.low);
        let cycles = cycles - cycles.floor();
        if cycles < 1.0 { cycles } else { 0.0 }
    }
}

/// a + b as the rounded sum and its error.
pub(crate) fn two_sum(a: f64, b: f64) -> (f64, f64) {
    let sum = a + b;
    let part = sum - a;
    (sum, (a - (sum - part)) + (b - part))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn durations_keep_their_digits_late_in_a_run() {
        let late = Instant::at(1e9);
        let event = late.after(1e-9 / 3.0);
        assert_eq!(event.since(late), 1e-9 / 3.0);
        assert!(event > late && event < late.after(1e-9));
        assert_eq!(Instant::NEVER.since(late), f64::INFINITY);
    }

    /// f t with all its bits, as an integer times a power of two.
    fn exact_cycles(frequency: f64, time: f64) -> f64 {
        let parts = |x: f64| ((x.to_bits() & ((1 << 52) - 1)) | 1 << 52, (x.to_bits() >> 52) as i32 - 1075);
        let ((m, a), (n, b)) = (parts(frequency), parts(time));
        let shift = -(a + b);
        let product = u128::from(m) * u128::from(n);
        (product & ((1 << shift) - 1)) as f64 / libm::exp2(f64::from(shift))
    }

    #[test]
    fn phases_are_exact_after_a_thousand_million_periods() {
        for frequency in [1.0 / 3.0, 0.1, 7.3, 1.0, 123.456_789] {
            for time in [1e9 + 0.123_456_7, 3.333e9, 0.7, 1e12 / 7.0] {
                for low in [0.0, 1e-9 / 3.0, -1e-8 / 7.0] {
                    let found = Instant { high: time, low }.cycles(frequency);
                    let exact = exact_cycles(frequency, time) + frequency * low;
                    let error = found - exact;
                    let error = (error - error.round()).abs();
                    assert!((0.0..1.0).contains(&found) && error < 4e-16, "{frequency}, {time}: {error:e}");
                }
            }
        }
    }
}
