//! Compensated sums.

/// Neumaier's compensated sum: the error of a long sum is a few ulp of its largest partial sum.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Sum {
    /// The rounded sum.
    pub high: f64,
    /// What rounding has removed from it.
    pub low: f64,
}

impl Sum {
    /// Adds one term.
    #[inline]
    pub fn add(&mut self, term: f64) {
        let sum = self.high + term;
        // Knuth's two-sum: the exact rounding error, without a branch on which operand is larger.
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

/// Several [`Sum`]s in arrays, so that the compiler can vectorize the additions.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Sums<const K: usize> {
    high: [f64; K],
    low: [f64; K],
}

impl<const K: usize> Sums<K> {
    pub const ZERO: Self = Self { high: [0.0; K], low: [0.0; K] };

    /// Adds one term to each sum.
    #[inline]
    pub fn add(&mut self, terms: [f64; K]) {
        for k in 0..K {
            let mut sum = Sum { high: self.high[k], low: self.low[k] };
            sum.add(terms[k]);
            (self.high[k], self.low[k]) = (sum.high, sum.low);
        }
    }

    /// Adds other sums, each to the one with the same index.
    pub fn merge(&mut self, others: &Self) {
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
        // Small terms, and large terms that cancel: within four terms, and across the border of two blocks.
        let within = [1e17, 1.0, -1e17, 1.0];
        let across = |k: usize| match k {
            49 => 1e30,
            50 => -1e30,
            _ => 0.125,
        };
        let mut sums = Sums::ZERO;
        for block in 0..2 {
            let mut part = Sums::ZERO;
            for k in 50 * block..50 * (block + 1) {
                part.add([within[k % 4], across(k)]);
            }
            sums.merge(&part);
        }
        assert_eq!(sums.values(), [50.0, 98.0 * 0.125]);
    }
}
