/*!
Random numbers as hashes.

A number that belongs to an event is a function of what the event is, and not of how many numbers were drawn
before: so it does not depend on the search or the number of threads, and is the same in a resumed run.
*/

use std::f64::consts::TAU;

use glam::DVec3;

/// The sequence of independent random numbers of one event.
#[derive(Debug, Clone, Copy)]
pub struct Draw {
    state: u64,
}

impl Draw {
    /// The sequence of the `count`-th event of a `particle`.
    #[inline]
    #[must_use]
    pub fn new(seed: u64, particle: u32, count: u64) -> Self {
        // Mixed after each part, so that similar pairs (particle, count) have different states.
        Self { state: mix(mix(mix(seed ^ 0x6861_6666_2064_7261) ^ u64::from(particle)) ^ count) }
    }

    /// The sequence that belongs to these bits.
    #[inline]
    #[must_use]
    pub fn from_bits(bits: u64) -> Self {
        Self { state: bits }
    }

    /// The next number, uniform in the open interval (0, 1).
    #[inline]
    pub fn uniform(&mut self) -> f64 {
        self.state = self.state.wrapping_add(0x9E37_79B9_7F4A_7C15);
        ((mix(self.state) >> 12) as f64 + 0.5) / (1_u64 << 52) as f64
    }

    /// The next index below `count`.
    #[inline]
    pub fn index(&mut self, count: usize) -> usize {
        ((self.uniform() * count as f64) as usize).min(count - 1)
    }

    /// The next number, from an exponential distribution of mean 1.
    #[inline]
    pub fn exponential(&mut self) -> f64 {
        -libm::log(self.uniform())
    }

    /// The next number, from a normal distribution of mean 0 and variance 1 (Box and Muller).
    #[inline]
    pub fn normal(&mut self) -> f64 {
        let (radius, angle) = ((2.0 * self.exponential()).sqrt(), TAU * self.uniform());
        radius * libm::cos(angle)
    }

    /// A vector with a normal number in each of the first `dimension` components.
    #[inline]
    pub fn normals(&mut self, dimension: usize) -> DVec3 {
        let mut component = |axis: usize| if axis < dimension { self.normal() } else { 0.0 };
        DVec3::new(component(0), component(1), component(2))
    }
}

/// A hash of `x`: every bit depends on all bits of `x` (finalizer of SplitMix64).
#[inline(always)]
#[must_use]
pub fn mix(x: u64) -> u64 {
    let x = (x ^ (x >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    let x = (x ^ (x >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    x ^ (x >> 31)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_of_many_events_have_the_variance_of_their_distribution() {
        let (mut sum, mut n) = (0.0, 0.0);
        for particle in 0..400 {
            for count in 0..300 {
                let mut draw = Draw::new(11, particle, count);
                for _ in 0..3 {
                    sum += draw.normal().powi(2);
                    n += 1.0;
                }
            }
        }
        let z = (sum / n - 1.0) / (2.0_f64 / n).sqrt();
        assert!(z.abs() < 4.0, "{}: z = {z}", sum / n);
    }

    #[test]
    fn numbers_have_the_moments_of_their_distributions_and_are_independent() {
        let n = 100_000;
        let (mut sums, mut cross) = ([0.0; 4], 0.0);
        for particle in 0..n {
            let mut draw = Draw::new(7, particle, 3);
            let (a, b) = (draw.normal(), draw.normal());
            let (e, u) = (draw.exponential(), draw.uniform());
            for (sum, term) in sums.iter_mut().zip([a, a * a, e, u]) {
                *sum += term;
            }
            cross += a * b + a * Draw::new(7, particle, 4).normal() + a * Draw::new(8, particle, 3).normal();
        }
        let n = f64::from(n);
        // Expectation and variance of one term of each sum.
        let expected = [(0.0, 1.0), (1.0, 2.0), (1.0, 1.0), (0.5, 1.0 / 12.0)];
        for (sum, (mean, variance)) in sums.into_iter().zip(expected) {
            let z = (sum / n - mean) / (variance / n).sqrt();
            assert!(z.abs() < 4.0, "{mean}: z = {z}");
        }
        let z = cross / (3.0 * n).sqrt();
        assert!(z.abs() < 4.0, "correlation: z = {z}");
    }
}
