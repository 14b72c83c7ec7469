//! Polynomials on [0, h] in Chebyshev form, with rigorous bounds on their derivatives.

use std::sync::OnceLock;

/// Most nodes of a polynomial.
const MOST_NODES: usize = 16;

/// A polynomial on [0, h].
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Polynomial {
    coefficients: Vec<f64>,
    /// 2/h.
    scale: f64,
}

impl Polynomial {
    /// Positions on [0, 1] of the values of [`Self::through`].
    pub fn nodes(count: usize) -> Vec<f64> {
        (0..count)
            .map(|k| 0.5 - 0.5 * libm::cos(std::f64::consts::PI * (k as f64 + 0.5) / count as f64))
            .collect()
    }

    /// The polynomial through values at the [`Self::nodes`] of [0, h].
    pub fn through(values: &[f64], h: f64) -> Self {
        let n = values.len();
        let cosines = cosines(n);
        let coefficients = (0..n)
            .map(|j| {
                // Node k is at −cos(π (k + ½)/n) of [−1, 1].
                let sum: f64 = (0..n).map(|k| values[k] * cosines[(j * (2 * (n - k) - 1)) % (4 * n)]).sum();
                sum * if j == 0 { 1.0 } else { 2.0 } / n as f64
            })
            .collect();
        Self { coefficients, scale: 2.0 / h }
    }

    /// Value at `tau`.
    pub fn value(&self, tau: f64) -> f64 {
        let x = self.scale * tau - 1.0;
        let (mut t, mut t1) = (1.0, x);
        let mut value = self.coefficients[0];
        for c in &self.coefficients[1..] {
            value += c * t1;
            (t, t1) = (t1, 2.0 * x * t1 - t);
        }
        value
    }

    /// Value and slope at `tau`.
    pub fn at(&self, tau: f64) -> (f64, f64) {
        let x = self.scale * tau - 1.0;
        let (mut t, mut t1) = (1.0, x);
        let (mut u, mut u1) = (0.0, 1.0);
        let (mut value, mut slope) = (self.coefficients[0], 0.0);
        for (j, c) in self.coefficients.iter().enumerate().skip(1) {
            value += c * t1;
            // T_j' = j U_{j−1}.
            slope += c * j as f64 * u1;
            (t, t1) = (t1, 2.0 * x * t1 - t);
            (u, u1) = (u1, 2.0 * x * u1 - u);
        }
        (value, slope * self.scale)
    }

    /// Bounds on the first and second derivative over the whole range.
    pub fn derivative_bounds(&self) -> (f64, f64) {
        let (mut first, mut second) = (0.0, 0.0);
        for (j, c) in self.coefficients.iter().enumerate() {
            let j2 = (j * j) as f64;
            first += c.abs() * j2;
            second += c.abs() * j2 * (j2 - 1.0) / 3.0;
        }
        (first * self.scale, second * self.scale * self.scale)
    }
}

/// cos(½π m/n) for m < 4n, of angles reduced exactly: rounded multiples of π would cost a digit. For every n
/// once.
fn cosines(n: usize) -> &'static [f64] {
    static TABLES: [OnceLock<Vec<f64>>; MOST_NODES + 1] = [const { OnceLock::new() }; MOST_NODES + 1];
    TABLES[n].get_or_init(|| {
        let cos = |m: usize| libm::cos(std::f64::consts::FRAC_PI_2 * m as f64 / n as f64);
        (0..4 * n).map(|m| m.min(4 * n - m)).map(|m| if m > n { -cos(2 * n - m) } else { cos(m) }).collect()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn polynomials_interpolate_within_their_derivative_bounds() {
        let h = 0.7;
        let nodes = Polynomial::nodes(16);
        let p = Polynomial::through(&nodes.iter().map(|s| (3.0 * s * h).sin()).collect::<Vec<_>>(), h);
        let (first, second) = p.derivative_bounds();
        for k in 0..=100 {
            let t = h * f64::from(k) / 100.0;
            let (value, slope) = p.at(t);
            assert!((value - (3.0 * t).sin()).abs() < 1e-14);
            assert!((slope - 3.0 * (3.0 * t).cos()).abs() < 1e-12);
            assert!(slope.abs() <= first && 9.0 * (3.0 * t).sin().abs() <= second);
        }
    }
}
