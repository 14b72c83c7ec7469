//! Exact sums: the same bits for any order of the terms.

use std::fmt;

/// Bins of one sign: one for each 32 binary exponents of `f64`.
const BINS: usize = 64;
/// Digits of 32 bits of the sum of all bins: the bits of the largest term, and of 2¹²⁶ such terms.
const DIGITS: usize = BINS + 5;
/// Bits of the significand of an `f64` without the first one.
const FRACTION: u32 = 52;
/// The first bit of a significand.
const FIRST: u64 = 1 << FRACTION;
/// Exponent of the unit of the first bin.
const UNIT: i32 = -1075;

/// A sum of `f64` numbers without rounding (R. M. Neal, arXiv:1505.05571 (2015)).
///
/// A bin is an integer. It holds the terms of one sign with 32 exponents: 53 bits, shifted by 1 to 32, so
/// that a bin has room for 2⁴² terms until [`Self::normalize`].
#[derive(Clone)]
pub(crate) struct ExactSum {
    /// Magnitudes: terms ≥ 0, then terms < 0. Bin k has the unit 2^(32 k − 1075).
    bins: [[u128; BINS]; 2],
    /// Whether a term was infinite or not a number.
    invalid: bool,
}

impl Default for ExactSum {
    fn default() -> Self {
        Self { bins: [[0; BINS]; 2], invalid: false }
    }
}

impl ExactSum {
    /// Adds one term.
    #[inline(always)]
    pub fn add(&mut self, term: f64) {
        let bits = term.to_bits();
        // The exponent less one: then a term of any exponent is shifted by at least one bit, so that its
        // upper word is a shift, too, by less than 64 bits.
        let reduced = bits.wrapping_sub(FIRST);
        if reduced << 1 >= 0x7fe << (FRACTION + 1) {
            self.add_special(term);
            return;
        }
        let significand = bits & (FIRST - 1) | FIRST;
        let shift = (reduced >> FRACTION) & 31;
        let (low, high) = (significand << (shift + 1), significand >> (shift ^ 63));
        let bin = &mut self.bins.as_flattened_mut()[(reduced >> (FRACTION + 5)) as usize];
        *bin = bin.wrapping_add(u128::from(high) << 64 | u128::from(low));
    }

    /// Adds a term that is zero, subnormal, infinite or not a number.
    #[cold]
    #[inline(never)]
    fn add_special(&mut self, term: f64) {
        if term.is_finite() {
            let bin = &mut self.bins[usize::from(term.is_sign_negative())][0];
            *bin += u128::from(term.to_bits() & (FIRST - 1)) << 1;
        } else {
            self.invalid = true;
        }
    }

    /// Adds another sum.
    pub fn merge(&mut self, other: &Self) {
        for (bin, other) in self.bins.as_flattened_mut().iter_mut().zip(other.bins.as_flattened()) {
            *bin += other;
        }
        self.invalid |= other.invalid;
    }

    /// Makes room for 2⁴² further terms.
    pub fn normalize(&mut self) {
        let parts = self.parts();
        *self = parts.into_iter().collect();
    }

    /// The sum, rounded to the nearest number; NaN if a term was infinite or not a number.
    pub fn value(&self) -> f64 {
        if self.invalid { f64::NAN } else { rounded(&self.digits()) }
    }

    /// Numbers of decreasing magnitude, each the rest of the sum rounded to the nearest number: their sum is
    /// this one. At least one.
    pub fn parts(&self) -> Vec<f64> {
        let mut rest = self.clone();
        let mut parts = vec![self.value()];
        loop {
            let last = parts[parts.len() - 1];
            if !last.is_finite() {
                return parts;
            }
            rest.add(-last);
            let part = rest.value();
            if part == 0.0 {
                return parts;
            }
            parts.push(part);
        }
    }

    /// The sum as an integer in units of the first bin, in digits of 32 bits; all but the last one are in
    /// [0, 2³²).
    fn digits(&self) -> [i128; DIGITS] {
        let mut digits = [0; DIGITS];
        let mut carry = 0_i128;
        for (k, digit) in digits.iter_mut().enumerate() {
            if k < BINS {
                // Each is less than 2¹²⁷.
                carry += self.bins[0][k] as i128 - self.bins[1][k] as i128;
            }
            if k + 1 < DIGITS {
                *digit = carry & 0xffff_ffff;
                carry >>= 32;
            } else {
                *digit = carry;
            }
        }
        digits
    }
}

/// The nearest number to an integer in digits of 32 bits, in units of the first bin.
fn rounded(digits: &[i128; DIGITS]) -> f64 {
    let negative = digits[DIGITS - 1] < 0;
    let mut magnitude = [0_u128; DIGITS];
    let mut carry = 0_i128;
    for (k, digit) in magnitude.iter_mut().enumerate() {
        carry += if negative { -digits[k] } else { digits[k] };
        *digit = (carry & 0xffff_ffff) as u128;
        carry >>= 32;
    }
    let Some(top) = magnitude.iter().rposition(|&digit| digit != 0) else { return 0.0 };
    // At least 65 bits; a bit beyond them decides where the rest is half a unit in the last place.
    let low = top.saturating_sub(2);
    let leading = magnitude[low..=top].iter().rev().fold(0, |sum, digit| sum << 32 | digit);
    let sticky = u128::from(magnitude[..low].iter().any(|&digit| digit != 0));
    let value = libm::scalbn((leading | sticky) as f64, 32 * low as i32 + UNIT);
    if negative { -value } else { value }
}

impl FromIterator<f64> for ExactSum {
    fn from_iter<I: IntoIterator<Item = f64>>(terms: I) -> Self {
        let mut sum = Self::default();
        terms.into_iter().for_each(|term| sum.add(term));
        sum
    }
}

impl fmt::Debug for ExactSum {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("ExactSum").field(&self.parts()).finish()
    }
}

impl PartialEq for ExactSum {
    fn eq(&self, other: &Self) -> bool {
        !self.invalid && !other.invalid && self.digits() == other.digits()
    }
}

/// Terms of [`ExactSums`] of this range of exponents are split without a remainder.
const RANGE: std::ops::Range<f64> = 1e-200..1e290;
/// Binary exponents between the units of leading and of following bits.
const STEP: i32 = 46;
/// Number of remainders after which the units are chosen anew.
const MAX_REMAINDERS: u32 = 16;

/// Several exact sums, to which terms are added in rows.
///
/// The leading bits of a term and the bits after them are added to sums in double precision, without
/// rounding: both are multiples of a unit, of which a sum has room for 2⁵³ (S. M. Rump, T. Ogita, S. Oishi,
/// SIAM J. Sci. Comput. 31, 189 (2008), algorithm 3.2). That costs fewer instructions than adding every term
/// to its bin.
#[derive(Clone)]
pub(crate) struct ExactSums<const K: usize> {
    sums: [ExactSum; K],
    /// Sums of leading and of following bits, at most as large as their bounds.
    leading: [f64; K],
    following: [f64; K],
    /// Bounds: powers of two, 2⁵³ units.
    bounds: [f64; K],
    /// Number of remainders since the bounds were chosen.
    remainders: u32,
}

impl<const K: usize> Default for ExactSums<K> {
    fn default() -> Self {
        Self {
            sums: std::array::from_fn(|_| ExactSum::default()),
            leading: [0.0; K],
            following: [0.0; K],
            bounds: [1.0; K],
            remainders: 0,
        }
    }
}

impl<const K: usize> ExactSums<K> {
    /// Adds one term to each of the first `N` sums.
    #[inline(always)]
    #[expect(clippy::needless_bitwise_bool, reason = "one branch for all comparisons")]
    pub fn add<const N: usize>(&mut self, terms: [f64; N]) {
        let (mut leading, mut following, mut remainder) = ([0.0; N], [0.0; N], [0.0; N]);
        for k in 0..N {
            let (term, first) = (terms[k], self.bounds[k]);
            let second = first * Self::SECOND;
            let high = (first + term) - first;
            let low = term - high;
            let middle = (second + low) - second;
            leading[k] = self.leading[k] + high;
            following[k] = self.following[k] + middle;
            remainder[k] = low - middle;
        }
        let mut exact = true;
        for k in 0..N {
            let (first, second) = (self.bounds[k], self.bounds[k] * Self::SECOND);
            exact &= (leading[k].abs() <= first) & (following[k].abs() <= second) & (remainder[k] == 0.0);
        }
        if exact {
            self.leading[..N].copy_from_slice(&leading);
            self.following[..N].copy_from_slice(&following);
        } else {
            let mut all = [0.0; K];
            all[..N].copy_from_slice(&terms);
            self.add_unsplit(all);
        }
    }

    /// Ratio of the bounds of following and leading bits.
    const SECOND: f64 = 1.0 / (1_u64 << STEP) as f64;

    /// Adds terms of which at least one does not fit in the present bounds.
    #[cold]
    #[inline(never)]
    fn add_unsplit(&mut self, terms: [f64; K]) {
        for (sum, term) in self.sums.iter_mut().zip(terms) {
            sum.add(term);
        }
        self.remainders += 1;
        let exceeds = |k: usize| terms[k].abs() > self.bounds[k] / 128.0;
        if self.remainders < MAX_REMAINDERS && !(0..K).any(exceeds) {
            self.empty();
            return;
        }
        self.empty();
        self.remainders = 0;
        for (bound, term) in self.bounds.iter_mut().zip(terms) {
            if RANGE.contains(&term.abs()) {
                // |term| < 2^e: room for 128 such terms.
                *bound = f64::from_bits(((term.abs().to_bits() >> FRACTION) + 8) << FRACTION);
            }
        }
    }

    /// Adds the sums of bits to the sums of terms.
    fn empty(&mut self) {
        for k in 0..K {
            self.sums[k].add(std::mem::take(&mut self.leading[k]));
            self.sums[k].add(std::mem::take(&mut self.following[k]));
        }
    }

    /// The sums, each to be changed by itself.
    pub fn sums_mut(&mut self) -> &mut [ExactSum; K] {
        self.empty();
        &mut self.sums
    }

    /// Adds other sums.
    pub fn merge(&mut self, other: &mut Self) {
        for (sum, other) in self.sums_mut().iter_mut().zip(other.sums_mut()) {
            sum.merge(other);
        }
    }

    /// Sum k.
    pub fn value(&self, k: usize) -> f64 {
        let mut sum = self.sums[k].clone();
        sum.add(self.leading[k]);
        sum.add(self.following[k]);
        sum.value()
    }
}

impl<const K: usize> fmt::Debug for ExactSums<K> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_list().entries((0..K).map(|k| self.value(k))).finish()
    }
}

#[cfg(test)]
mod tests {
    use haff_testing::Random;

    use super::*;

    /// Numbers of all exponents and both signs.
    fn terms(count: usize, seed: u64) -> Vec<f64> {
        let mut random = Random(seed);
        let number = || loop {
            let x = f64::from_bits(random.bits());
            // Below 2^960, so that sums of the terms are finite.
            if x.is_finite() && x.abs() < 1e289 {
                return x;
            }
        };
        std::iter::repeat_with(number).take(count).collect()
    }

    #[test]
    fn sums_are_independent_of_order_and_parts_have_nothing_left() {
        for seed in 0..50 {
            let terms = terms(200, seed);
            let sum: ExactSum = terms.iter().copied().collect();
            let reversed: ExactSum = terms.iter().rev().copied().collect();
            let mut merged: ExactSum = terms[..77].iter().copied().collect();
            merged.merge(&terms[77..].iter().copied().collect());
            assert_eq!(sum.value().to_bits(), reversed.value().to_bits());
            assert_eq!(sum.parts(), merged.parts());
            assert_eq!(sum, merged);
            let mut normal = sum.clone();
            normal.normalize();
            assert_eq!(normal, sum);
            // Without its terms nothing is left.
            let mut rest = sum.clone();
            for term in &terms {
                rest.add(-term);
            }
            assert_eq!(rest.parts(), [0.0]);
        }
    }

    #[test]
    fn values_are_rounded_to_nearest_with_ties_to_even() {
        let value = |terms: &[f64]| terms.iter().copied().collect::<ExactSum>().value();
        let ulp = f64::EPSILON;
        assert_eq!(value(&[]), 0.0);
        assert_eq!(value(&[1.0, 1e100, 1.0, -1e100]), 2.0);
        assert_eq!(value(&[1.0, 0.5 * ulp]), 1.0);
        assert_eq!(value(&[1.0, 0.5 * ulp, f64::from_bits(1)]), 1.0 + ulp);
        assert_eq!(value(&[1.0, 1.5 * ulp]), 1.0 + 2.0 * ulp);
        assert_eq!(value(&[-1.0, -0.5 * ulp, -1e-300]), -1.0 - ulp);
        assert_eq!(value(&[f64::MAX, f64::MAX]), f64::INFINITY);
        assert_eq!(value(&[f64::MAX, f64::MAX, -f64::MAX]), f64::MAX);
        let tiny = f64::from_bits(5);
        assert_eq!(value(&[tiny, tiny, f64::MIN_POSITIVE]), f64::MIN_POSITIVE + 2.0 * tiny);
        assert_eq!(value(&[tiny, -f64::MIN_POSITIVE]), tiny - f64::MIN_POSITIVE);
        assert!(value(&[1.0, f64::INFINITY]).is_nan() && value(&[f64::NAN]).is_nan());
        for pair in terms(2000, 3).chunks_exact(2) {
            assert_eq!(value(pair), pair[0] + pair[1], "{pair:?}");
        }
    }

    #[test]
    fn sums_of_rows_are_those_of_their_terms() {
        let mut random = Random(5);
        // All exponents; a wide range below a common scale; like terms, some of them zero; very large ones.
        let scaled = |scale: f64, range: f64, random: &mut Random| {
            scale * libm::exp2(random.uniform(-range, 0.0)) * random.uniform(-1.0, 1.0)
        };
        let mut sums = ExactSums::<4>::default();
        let mut columns = [const { Vec::new() }; 4];
        let wild = terms(1000, 7);
        for (k, &term) in wild.iter().enumerate() {
            let like = if k % 3 == 0 { 0.0 } else { scaled(2.0, 3.0, &mut random) };
            let row = [term, scaled(1e5, 150.0, &mut random), like, scaled(1e290, 20.0, &mut random)];
            sums.add(row);
            for (column, term) in columns.iter_mut().zip(row) {
                column.push(term);
            }
            if k % 100 == 77 {
                for (j, column) in columns.iter().enumerate() {
                    let expected: ExactSum = column.iter().copied().collect();
                    assert_eq!(sums.value(j).to_bits(), expected.value().to_bits(), "{k}, {j}");
                }
            }
        }
        for (sum, column) in sums.sums_mut().iter().zip(&columns) {
            assert_eq!(*sum, column.iter().copied().collect());
        }
        for invalid in [f64::NAN, f64::INFINITY] {
            let mut sums = ExactSums::<1>::default();
            sums.add([invalid]);
            sums.add([1.0]);
            sums.sums_mut();
            assert!(sums.value(0).is_nan());
        }
    }

    #[test]
    fn parts_restore_the_sum() {
        for seed in 100..120 {
            let sum: ExactSum = terms(9, seed).into_iter().collect();
            let restored: ExactSum = sum.parts().into_iter().collect();
            assert_eq!(restored, sum);
        }
    }
}
