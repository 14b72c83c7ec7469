//! Series of bounces under a constant acceleration, summed to their limit.

use crate::Restitution;

/// Below this loss `1 − e`, or after `MAX_BOUNCES` bounces, the remaining bounces are summed as a power law.
/// The sums are accurate to 10⁻⁵, and more accurate where the loss decreases quickly.
const SMALL_LOSS: f64 = 1e-3;
const MAX_BOUNCES: usize = 1000;

/// Sums over an infinite series of bounces with the approach speeds v₀ = u, v₁ = e(v₀) v₀, …
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bounces {
    /// Σ vₖ/u: under the acceleration a the bounces take 2u/a times that, with vₖ the speed at which each
    /// flight begins.
    pub speeds: f64,
    /// Σ (vₖ + vₖ₊₁)²/u²: ½ m u² times that is the sum of the energies of lost velocities.
    pub squares: f64,
}

impl Restitution {
    /// The sums over all bounces that follow when a body leaves its support at the speed `u` \[length/time\]
    /// and a constant acceleration returns it.
    ///
    /// `None` if they diverge, or may: if contacts are elastic, or become so too fast, or by a law of another
    /// crate. With `1 − e` ∝ v^p the speeds
    /// fall as k^{−1/p}, and their sum is finite only for p < 1. The constant law has Σ vₖ = u/(1 − e).
    ///
    /// ```
    /// use haff_mechanics::Restitution;
    /// let half = Restitution::Constant(0.5).bounces(1.0).unwrap();
    /// assert_eq!((half.speeds, half.squares), (2.0, 3.0)); // 1 + ½ + ¼ + …, (3/2)² + (3/4)² + …
    /// assert!(Restitution::Constant(1.0).bounces(1.0).is_none());
    /// ```
    #[must_use]
    pub fn bounces(&self, u: f64) -> Option<Bounces> {
        if self.is_elastic() {
            return None;
        }
        // 1 − e = c v^p − d v^{2p} + …; `second` is d/c².
        let (p, second) = match *self {
            Self::Constant(e) => {
                return Some(Bounces { speeds: 1.0 / (1.0 - e), squares: (1.0 + e) / (1.0 - e) });
            }
            Self::Viscoelastic { .. } => (0.2, 0.6),
            Self::Cutoff { exponent, .. } => (exponent, 0.0),
            Self::Table(table) => return self.bounces_to_constant(u, table.first_speed()),
            // Of a law of another crate the speeds need not fall.
            Self::Law(_) => return None,
        };
        if p >= 1.0 {
            return None;
        }
        // In units of u.
        let (mut v, mut speeds, mut squares) = (1.0, 0.0, 0.0);
        for _ in 0..MAX_BOUNCES {
            let e = self.coefficient(v * u);
            if 1.0 - e < SMALL_LOSS {
                break;
            }
            let next = e * v;
            speeds += v;
            squares += (v + next) * (v + next);
            v = next;
        }
        // Euler–Maclaurin sum over the flow whose unit step is the bounce: dv/dk = −c v^{1+p} + (d − ½ (1 +
        // p) c²) v^{1+2p}.
        let loss = 1.0 - self.coefficient(v * u);
        if loss > 0.0 {
            speeds += v * (1.0 / (loss * (1.0 - p)) - second * p / (1.0 - p) - 0.5 * p);
            let square = (1.0 / loss - second) / (2.0 - p) + 0.5 * second - 0.25 * (1.0 + p) + 0.5;
            squares += v * v * (4.0 * square - 2.0 - loss / (2.0 + p));
        }
        // Otherwise the remaining speed is zero in floating point.
        Some(Bounces { speeds, squares })
    }

    /// The sums for a law that is constant up to the speed `constant` \[length/time\]. `None` if that speed
    /// is not reached.
    fn bounces_to_constant(&self, u: f64, constant: f64) -> Option<Bounces> {
        let (mut v, mut speeds, mut squares) = (1.0, 0.0, 0.0);
        for _ in 0..MAX_BOUNCES {
            let e = self.coefficient(v * u);
            if v * u <= constant {
                let rest = Self::Constant(e).bounces(v * u)?;
                return Some(Bounces {
                    speeds: speeds + v * rest.speeds,
                    squares: squares + v * v * rest.squares,
                });
            }
            let next = e * v;
            speeds += v;
            squares += (v + next) * (v + next);
            v = next;
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bounces_by_a_table_end_as_those_of_its_first_value() {
        let table = |speeds: &[f64], values: &[f64]| {
            Restitution::Table(crate::RestitutionTable::of(speeds, values).unwrap())
        };
        let law = table(&[0.1, 1.0], &[0.5, 0.8]);
        for u in [1e-3, 0.1, 0.7, 3.0, 50.0] {
            let (found, expected) = (law.bounces(u).unwrap(), one_by_one(law, 0.0, u));
            let close = |a: f64, b: f64| (a - b).abs() <= 1e-13 * b;
            assert!(
                close(found.speeds, expected.speeds / u) && close(found.squares, expected.squares / (u * u)),
                "{u}: {found:?}, {expected:?}"
            );
        }
        // Elastic at low speeds; and a speed that is not passed.
        assert!(table(&[0.1, 1.0], &[1.0, 0.8]).bounces(3.0).is_none());
        assert!(table(&[0.0, 1.0, 2.0], &[0.5, 1.0, 0.5]).bounces(3.0).is_none());
    }

    /// Bounce by bounce; the remainder is then its leading integral, with a relative error below 10⁻⁵.
    fn one_by_one(law: Restitution, p: f64, u: f64) -> Bounces {
        let (mut v, mut speeds, mut squares) = (u, 0.0, 0.0);
        for _ in 0..1_000_000 {
            let next = law.coefficient(v) * v;
            speeds += v;
            squares += (v + next) * (v + next);
            if next <= 0.0 || next >= v {
                return Bounces { speeds, squares };
            }
            v = next;
        }
        let loss = 1.0 - law.coefficient(v);
        Bounces {
            speeds: speeds + v / (loss * (1.0 - p)),
            squares: squares + 4.0 * v * v / (loss * (2.0 - p)),
        }
    }

    #[test]
    fn sums_of_velocity_dependent_laws_agree_with_bounce_by_bounce_sums() {
        let viscoelastic = |coefficient| (Restitution::Viscoelastic { coefficient }, 0.2);
        let cutoff =
            |restitution, speed, exponent| (Restitution::Cutoff { restitution, speed, exponent }, exponent);
        for (law, p) in [
            viscoelastic(0.01),
            viscoelastic(0.1),
            viscoelastic(0.5),
            cutoff(0.0, 1.0, 0.3),
            cutoff(0.5, 1.0, 0.5),
            cutoff(0.9, 1e-3, 0.3),
        ] {
            for u in [1e-8, 1e-4, 1.0] {
                let (sums, expected) = (law.bounces(u).unwrap(), one_by_one(law, p, u));
                let off = |a: f64, b: f64| (a / b - 1.0).abs();
                assert!(off(u * sums.speeds, expected.speeds) < 1e-5, "{law:?}, {u}: {sums:?}, {expected:?}");
                assert!(
                    off(u * u * sums.squares, expected.squares) < 1e-5,
                    "{law:?}, {u}: {sums:?}, {expected:?}"
                );
            }
        }
    }

    #[test]
    fn sums_of_the_constant_law_are_geometric() {
        for e in [0.0, 0.3, 0.99] {
            let sums = Restitution::Constant(e).bounces(2.0).unwrap();
            let (mut v, mut speeds, mut squares) = (1.0, 0.0, 0.0);
            while v > 1e-30 {
                speeds += v;
                squares += v * v * (1.0 + e) * (1.0 + e);
                v *= e;
            }
            assert!(
                (sums.speeds / speeds - 1.0).abs() < 1e-12 && (sums.squares / squares - 1.0).abs() < 1e-12
            );
        }
    }

    #[test]
    fn sums_diverge_for_laws_that_become_elastic_too_fast() {
        for exponent in [1.0, 1.5] {
            let law = Restitution::Cutoff { restitution: 0.5, speed: 1.0, exponent };
            assert_eq!(law.bounces(0.1), None);
        }
        assert_eq!(Restitution::Viscoelastic { coefficient: 0.0 }.bounces(0.1), None);
        assert_eq!(Restitution::Cutoff { restitution: 1.0, speed: 1.0, exponent: 0.5 }.bounces(0.1), None);
        for u in [0.0, 1e-300] {
            let rest = Restitution::Viscoelastic { coefficient: 0.1 }.bounces(u).unwrap();
            assert!(rest.speeds.is_finite() && rest.squares.is_finite(), "{u}: {rest:?}");
        }
    }
}
