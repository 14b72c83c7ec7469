/*!
Coefficients of restitution that are drawn anew in each contact.

Measured coefficients scatter: real grains are not round, and the point of a contact on them is random.
*/

use crate::{
    law::{ContactLaw, NamedLaw, NormalContact},
    random::Draw,
    restitution::{Restitution, RestitutionError},
};

/// A distribution of coefficients of restitution.
#[derive(Debug, Clone, PartialEq)]
pub enum Scatter {
    /// Uniform between the two.
    Uniform([f64; 2]),
    /// A normal distribution with this mean and standard deviation, cut off outside of 0 to 1.
    Normal([f64; 2]),
    /// One of these, each as probable as another.
    Values(Vec<f64>),
}

/// The widest normal distribution: a third of its draws at least are between 0 and 1.
const WIDEST: f64 = 1.0;

impl Scatter {
    /// Checks that coefficients are between 0 and 1.
    ///
    /// # Errors
    /// The first parameter out of range (also NaN and infinities), and the allowed range.
    pub fn check(&self) -> Result<(), RestitutionError> {
        let error = |parameter, value, allowed| Err(RestitutionError { parameter, value, allowed });
        let unit = "must be in [0, 1]";
        let (parameter, coefficients) = match self {
            Self::Uniform(bounds) => ("uniform", &bounds[..]),
            Self::Normal(moments) => ("normal", &moments[..1]),
            Self::Values(values) => ("values", &values[..]),
        };
        if let Some(&value) = coefficients.iter().find(|value| !(0.0..=1.0).contains(*value)) {
            return error(parameter, value, unit);
        }
        match self {
            Self::Uniform([low, high]) if low > high => {
                error("uniform", *high, "must not be below the lower bound before it")
            }
            Self::Normal([_, deviation]) if !(*deviation >= 0.0 && *deviation <= WIDEST) => {
                error("normal", *deviation, "must be a standard deviation, from 0 to 1")
            }
            Self::Values(values) if values.is_empty() => error("values", 0.0, "must be at least one"),
            _ => Ok(()),
        }
    }

    /// The coefficient of a contact with these random bits.
    fn draw(&self, mut draw: Draw) -> f64 {
        match self {
            // By rounding, the sum could be outside of the two.
            Self::Uniform([low, high]) => (low + (high - low) * draw.uniform()).clamp(*low, *high),
            Self::Normal([mean, deviation]) => loop {
                let e = mean + deviation * draw.normal();
                if (0.0..=1.0).contains(&e) {
                    return e;
                }
            },
            Self::Values(values) => values[draw.index(values.len())],
        }
    }

    /// Whether no contact loses energy.
    fn is_elastic(&self) -> bool {
        match self {
            Self::Uniform([low, _]) => *low == 1.0,
            Self::Normal(moments) => *moments == [1.0, 0.0],
            Self::Values(values) => values.iter().all(|&e| e == 1.0),
        }
    }
}

impl ContactLaw for Scatter {
    fn separation_speed(&self, contact: &NormalContact) -> f64 {
        self.draw(Draw::from_bits(contact.random)) * contact.approach_speed
    }

    fn loses_energy(&self) -> bool {
        !self.is_elastic()
    }
}

impl Restitution {
    /// A coefficient that is drawn anew in each contact, from a hash of the bodies and the time.
    ///
    /// # Errors
    /// A parameter out of range, see [`Scatter::check`].
    pub fn random(scatter: Scatter) -> Result<Self, RestitutionError> {
        scatter.check()?;
        if scatter.is_elastic() {
            return Ok(Self::Constant(1.0));
        }
        // Bits, since texts of numbers that differ could be the same.
        let numbers = match &scatter {
            Scatter::Uniform(numbers) | Scatter::Normal(numbers) => &numbers[..],
            Scatter::Values(numbers) => &numbers[..],
        };
        let bits: Vec<u64> = numbers.iter().map(|number| number.to_bits()).collect();
        let parameters = format!("{scatter:?}, {bits:x?}");
        Ok(Self::Law(NamedLaw::of("random", &parameters, Box::new(scatter))))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Mean and second moment of draws, against those of the distribution, by z-scores.
    #[test]
    fn coefficients_have_the_moments_of_their_distribution() {
        // Moments 1, 2 and 4: of the normal one, cut off at 1.25 standard deviations above and far below,
        // from the recursion of its moments: m_k = µ m_{k−1} + (k − 1) σ² m_{k−2} − σ² φ(b) b^{k−1}/Z, with
        // the normal density φ(b) at the cut b = 1.
        let (mean, sd) = (0.9_f64, 0.08_f64);
        let cut = (1.0 - mean) / sd;
        let density = libm::exp(-0.5 * cut * cut) / (sd * (2.0 * std::f64::consts::PI).sqrt());
        let part = 0.5 * libm::erfc(-cut / std::f64::consts::SQRT_2);
        let edge = sd * sd * density / part;
        let mut moments = [1.0, mean - edge, 0.0, 0.0, 0.0];
        for k in 2..5 {
            moments[k] = mean * moments[k - 1] + (k - 1) as f64 * sd * sd * moments[k - 2] - edge;
        }
        let values = [0.5, 0.5, 0.9];
        let of_values = |k: i32| values.iter().map(|e: &f64| e.powi(k)).sum::<f64>() / 3.0;
        let of_uniform = |k: i32| (0.8_f64.powi(k + 1) - 0.6_f64.powi(k + 1)) / (0.2 * f64::from(k + 1));
        for (scatter, expected) in [
            (Scatter::Uniform([0.6, 0.8]), [of_uniform(1), of_uniform(2), of_uniform(4)]),
            (Scatter::Normal([mean, sd]), [moments[1], moments[2], moments[4]]),
            (Scatter::Values(values.to_vec()), [of_values(1), of_values(2), of_values(4)]),
        ] {
            let law = Restitution::random(scatter.clone()).unwrap();
            let (n, speed) = (200_000_u64, 3.0);
            let mut sums = [0.0; 2];
            for k in 0..n {
                let contact = NormalContact {
                    approach_speed: speed,
                    reduced_mass: 1.0,
                    reduced_radius: 1.0,
                    random: crate::random::mix(k),
                };
                let e = law.coefficient_in(&contact);
                assert!((0.0..=1.0).contains(&e));
                sums[0] += e;
                sums[1] += e * e;
            }
            let n = n as f64;
            let z = [
                (sums[0] / n - expected[0]) / ((expected[1] - expected[0].powi(2)) / n).sqrt(),
                (sums[1] / n - expected[1]) / ((expected[2] - expected[1].powi(2)) / n).sqrt(),
            ];
            assert!(z.iter().all(|z| z.abs() < 4.0), "{scatter:?}: {z:?}");
        }
    }

    #[test]
    fn what_is_no_distribution_of_coefficients_is_refused() {
        for (scatter, message) in [
            (Scatter::Uniform([0.5, 1.2]), "uniform = 1.2 must be in [0, 1]"),
            (Scatter::Uniform([0.9, 0.5]), "uniform = 0.5 must not be below the lower bound before it"),
            (Scatter::Normal([f64::NAN, 0.1]), "normal = NaN must be in [0, 1]"),
            (Scatter::Normal([0.5, -0.1]), "normal = -0.1 must be a standard deviation, from 0 to 1"),
            (Scatter::Normal([0.5, f64::INFINITY]), "normal = inf must be a standard deviation, from 0 to 1"),
            (Scatter::Values(vec![0.5, -0.1]), "values = -0.1 must be in [0, 1]"),
            (Scatter::Values(vec![]), "values = 0 must be at least one"),
        ] {
            assert_eq!(Restitution::random(scatter).unwrap_err().to_string(), message);
        }
        let elastic = Restitution::random(Scatter::Uniform([1.0, 1.0])).unwrap();
        assert_eq!(elastic, Restitution::Constant(1.0));
        let law = Restitution::random(Scatter::Normal([0.5, 0.0])).unwrap();
        assert!((law.coefficient(2.0) - 0.5).abs() < 1e-15 && law.loses_energy());
        assert!(!law.with_added_speed(0.1).loses_energy());
    }
}
