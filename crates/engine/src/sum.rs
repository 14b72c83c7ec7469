//! Compensated sums.

/// Neumaier's compensated sum: the error of a long sum stays at a few ulp of its largest partial sum.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(crate) struct Sum {
    pub high: f64,
    pub low: f64,
}

impl Sum {
    /// Adds one term.
    #[inline]
    pub fn add(&mut self, term: f64) {
        let sum = self.high + term;
        // Knuth's error of the sum, which is exact: no branch on which of the two is larger.
        let added = sum - self.high;
        self.low += (self.high - (sum - added)) + (term - added);
        self.high = sum;
    }

    /// The sum so far.
    #[inline]
    pub fn value(&self) -> f64 {
        self.high + self.low
    }
}

/// Several [`Sum`]s side by side, such that the compiler adds to two or more at once.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Sums<const K: usize> {
    high: [f64; K],
    low: [f64; K],
}

impl<const K: usize> Sums<K> {
    pub const ZERO: Self = Self { high: [0.0; K], low: [0.0; K] };

    /// Adds a term to each.
    #[inline]
    pub fn add(&mut self, terms: [f64; K]) {
        for k in 0..K {
            let mut sum = Sum { high: self.high[k], low: self.low[k] };
            sum.add(terms[k]);
            (self.high[k], self.low[k]) = (sum.high, sum.low);
        }
    }

    /// Adds other sums to them.
    pub fn join(&mut self, others: &Self) {
        self.add(others.high);
        self.add(others.low);
    }

    pub fn values(&self) -> [f64; K] {
        std::array::from_fn(|k| self.high[k] + self.low[k])
    }
}

impl FromIterator<f64> for Sum {
    fn from_iter<I: IntoIterator<Item = f64>>(terms: I) -> Self {
        let mut sum = Self::default();
        terms.into_iter().for_each(|term| sum.add(term));
        sum
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn small_terms_are_not_lost() {
        let sum: Sum = [1.0, 1e100, 1.0, -1e100].into_iter().collect();
        assert_eq!(sum.value(), 2.0);
    }

    #[test]
    fn sums_side_by_side_and_in_blocks_lose_nothing() {
        // What is large cancels, in the same block or in the next.
        let terms: Vec<[f64; 3]> = (0..100)
            .map(|k| {
                let large = if k % 2 == 0 { 1e17 } else { -1e17 };
                [
                    1.0,
                    large + if k % 2 == 0 { 64.0 } else { 0.0 },
                    if k == 49 {
                        1e30
                    } else if k == 50 {
                        -1e30
                    } else {
                        0.1
                    },
                ]
            })
            .collect();
        let mut sums = Sums::ZERO;
        for block in terms.chunks(50) {
            let mut part = Sums::ZERO;
            for &terms in block {
                part.add(terms);
            }
            sums.join(&part);
        }
        let alone = |k: usize| terms.iter().map(|terms| terms[k]).collect::<Sum>().value();
        assert_eq!(sums.values(), [100.0, 50.0 * 64.0, alone(2)]);
        assert!((alone(2) - 9.8).abs() < 4e-15, "{}", alone(2));
    }
}
