//! The coefficient of restitution `e` as a function of the approach speed.

use std::sync::Mutex;

use thiserror::Error;

use crate::law::{NamedLaw, NormalContact};

/// A law for the coefficient of restitution, the ratio of the restitution to the compression impulse (2.11).
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Restitution {
    /// The same `e` ∈ [0, 1] at every approach speed.
    Constant(f64),
    /// Viscoelastic spheres: `e(v) = 1 − 1.15344 δ + 0.79826 δ² − …` with `δ = coefficient · v^{1/5}`,
    /// summed as its [1/4] Padé approximant so that it stays within (0, 1] at every speed.
    Viscoelastic {
        /// `δ` at unit approach speed [(time/length)^{1/5}], ≥ 0.
        coefficient: f64,
    },
    /// `e` above the cut-off speed; below it `1 − (1 − e)(v/speed)^exponent`, which tends to 1 at rest.
    Cutoff {
        /// Value at and above the cut-off speed, in [0, 1].
        restitution: f64,
        /// Cut-off approach speed [length/time], > 0.
        speed: f64,
        /// Power law below the cut-off, > 0; 3/4 by default.
        exponent: f64,
    },
    /// Measured values.
    Table(&'static RestitutionTable),
    /// A law in a file of its own ([`added_speed`](crate::added_speed), [`scatter`](crate::scatter)) or of
    /// another crate; its coefficient may be above 1.
    Law(&'static NamedLaw),
}

/// Measured coefficients of restitution: linear between the approach speeds, constant beyond them.
#[derive(Debug, PartialEq)]
pub struct RestitutionTable {
    /// Increasing approach speeds [length/time].
    speeds: Vec<f64>,
    /// The coefficient at each of them, in [0, 1].
    values: Vec<f64>,
}

/// All tables, for the whole process: laws are copied for every contact, so that a table is never freed.
/// Equal tables are kept once.
static TABLES: Mutex<Vec<&'static RestitutionTable>> = Mutex::new(Vec::new());

impl RestitutionTable {
    /// The table with these approach speeds [length/time] and coefficients, as many as speeds.
    ///
    /// # Errors
    /// No values, other numbers of speeds than of values, speeds that do not increase or are negative, and
    /// values outside [0, 1].
    pub fn of(speeds: &[f64], values: &[f64]) -> Result<&'static Self, RestitutionError> {
        let error = |parameter, value, allowed| Err(RestitutionError { parameter, value, allowed });
        if let Some(&value) = values.iter().find(|value| !(0.0..=1.0).contains(*value)) {
            return error("values", value, "must be in [0, 1]");
        }
        if let Some(&speed) = speeds.iter().find(|speed| !(speed.is_finite() && **speed >= 0.0)) {
            return error("speeds", speed, "must be zero or positive, and finite");
        }
        if let Some(pair) = speeds.windows(2).find(|pair| pair[0] >= pair[1]) {
            return error("speeds", pair[1], "must be above the speed before it");
        }
        if values.is_empty() || values.len() != speeds.len() {
            return error("values", values.len() as f64, "must be as many as speeds, and at least one");
        }
        let table = Self { speeds: speeds.to_vec(), values: values.to_vec() };
        // A panic elsewhere cannot leave the list incomplete.
        let mut tables = TABLES.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        if let Some(known) = tables.iter().find(|known| ***known == table) {
            return Ok(known);
        }
        let table: &'static Self = Box::leak(Box::new(table));
        tables.push(table);
        Ok(table)
    }

    /// The coefficient at an approach speed [length/time].
    #[must_use]
    pub fn coefficient(&self, speed: f64) -> f64 {
        let Self { speeds, values } = self;
        let next = speeds.partition_point(|other| *other <= speed);
        let Some(&after) = values.get(next) else { return values[values.len() - 1] };
        let Some(k) = next.checked_sub(1) else { return after };
        let part = (speed - speeds[k]) / (speeds[next] - speeds[k]);
        // By rounding, the sum can be outside of the two values.
        (values[k] + (after - values[k]) * part).clamp(values[k].min(after), values[k].max(after))
    }

    /// The speed up to which the coefficient is constant [length/time].
    pub(crate) fn first_speed(&self) -> f64 {
        self.speeds[0]
    }
}

/// A parameter of a [`Restitution`] outside its range.
#[derive(Debug, Clone, Copy, PartialEq, Error)]
#[error("{parameter} = {value} {allowed}")]
pub struct RestitutionError {
    /// Name of the parameter: `restitution`, `coefficient`, `speed` or `exponent`.
    pub parameter: &'static str,
    /// The value it has.
    pub value: f64,
    /// What is allowed, as the end of a sentence: `must be in [0, 1]`.
    pub allowed: &'static str,
}

/// Coefficients of the [1/4] Padé approximant of `e` in `x = √δ` (Müller and Pöschel, Phys. Rev. E 84,
/// 021302, 2011), numerator `1 + B1 x`, denominator `1 + B1 x + B2 x² + B3 x³ + B4 x⁴`.
const B1: f64 = 0.501_086;
const B2: f64 = 1.153_44;
const B3: f64 = 0.577_977;
const B4: f64 = 0.532_178;

impl Restitution {
    /// The coefficient of restitution `e` ∈ [0, 1] at the approach speed `v_n` [length/time], (2.11), (2.12).
    ///
    /// A negative approach speed counts as zero. A law of another crate is that of bodies with a reduced mass
    /// and a reduced radius of 1, and a random one has one of its draws; [`Self::coefficient_in`] is for
    /// others.
    ///
    /// ```
    /// use haff_mechanics::Restitution;
    /// assert_eq!(Restitution::Constant(0.5).coefficient(40.0), 0.5);
    /// // Below the cut-off contacts become more elastic: 1 − 0.5 · (1/16)^{3/4} = 1 − 1/16.
    /// let e = Restitution::Cutoff { restitution: 0.5, speed: 16.0, exponent: 0.75 };
    /// assert_eq!(e.coefficient(1.0), 0.9375);
    /// assert_eq!(e.coefficient(16.0), 0.5);
    /// ```
    #[inline]
    #[must_use]
    pub fn coefficient(&self, approach_speed: f64) -> f64 {
        self.coefficient_of(approach_speed, || NormalContact { approach_speed, ..NormalContact::default() })
    }

    /// The coefficient of restitution in a contact.
    #[must_use]
    pub fn coefficient_in(&self, contact: &NormalContact) -> f64 {
        self.coefficient_of(contact.approach_speed, || *contact)
    }

    /// The coefficient of restitution at an approach speed [length/time]; the rest of the `contact` is
    /// computed if the law needs it.
    #[inline(always)]
    #[must_use]
    pub fn coefficient_of(&self, approach_speed: f64, contact: impl FnOnce() -> NormalContact) -> f64 {
        match *self {
            Self::Constant(e) => e,
            Self::Viscoelastic { coefficient } => viscoelastic(coefficient, approach_speed.max(0.0)),
            Self::Cutoff { restitution, speed, exponent } => {
                if approach_speed >= speed {
                    restitution
                } else {
                    1.0 - (1.0 - restitution) * libm::pow(approach_speed.max(0.0) / speed, exponent)
                }
            }
            Self::Table(table) => table.coefficient(approach_speed),
            Self::Law(law) => law.coefficient(&contact()),
        }
    }

    /// Whether contacts conserve kinetic energy at every approach speed: `e = 1`.
    #[must_use]
    pub fn is_elastic(&self) -> bool {
        match *self {
            Self::Constant(e) => e == 1.0,
            Self::Viscoelastic { coefficient } => coefficient == 0.0,
            Self::Cutoff { restitution, .. } => restitution == 1.0,
            Self::Table(table) => table.values.iter().all(|&e| e == 1.0),
            Self::Law(_) => false,
        }
    }

    /// Whether contacts lose energy in general, and never gain it.
    #[must_use]
    pub fn loses_energy(&self) -> bool {
        match *self {
            Self::Law(law) => law.get().loses_energy(),
            _ => !self.is_elastic(),
        }
    }

    /// Whether contacts may add energy.
    #[must_use]
    pub fn may_add_energy(&self) -> bool {
        matches!(self, Self::Law(_)) && !self.loses_energy()
    }

    /// Checks every parameter against its range.
    ///
    /// # Errors
    /// The first parameter out of range (also NaN and infinities), its value and the allowed range.
    ///
    /// ```
    /// use haff_mechanics::Restitution;
    /// let error = Restitution::Constant(1.2).check().unwrap_err();
    /// assert_eq!(error.to_string(), "restitution = 1.2 must be in [0, 1]");
    /// ```
    pub fn check(&self) -> Result<(), RestitutionError> {
        let unit = |value: f64| {
            let allowed = "must be in [0, 1]";
            if (0.0..=1.0).contains(&value) {
                Ok(())
            } else {
                Err(RestitutionError { parameter: "restitution", value, allowed })
            }
        };
        let positive = |parameter: &'static str, value: f64| {
            let allowed = "must be positive and finite";
            if value > 0.0 && value.is_finite() {
                Ok(())
            } else {
                Err(RestitutionError { parameter, value, allowed })
            }
        };
        match *self {
            Self::Constant(e) => unit(e),
            Self::Viscoelastic { coefficient: value } => {
                if value >= 0.0 && value.is_finite() {
                    Ok(())
                } else {
                    let allowed = "must be zero or positive, and finite";
                    Err(RestitutionError { parameter: "coefficient", value, allowed })
                }
            }
            Self::Cutoff { restitution, speed, exponent } => {
                unit(restitution)?;
                positive("speed", speed)?;
                positive("exponent", exponent)
            }
            // Checked when they were made.
            Self::Table(_) | Self::Law(_) => Ok(()),
        }
    }
}

/// `e` of viscoelastic spheres with `δ = coefficient · v^{1/5}`.
fn viscoelastic(coefficient: f64, speed: f64) -> f64 {
    // √δ = √coefficient · v^{1/10}; `libm`, because the power function of the system library differs between
    // machines.
    let x = coefficient.sqrt() * libm::pow(speed, 0.1);
    let linear = 1.0 + B1 * x;
    // e = 1 / (1 + rest/linear) cannot exceed 1 by rounding, and is exactly 1 at rest.
    1.0 / (1.0 + x * x * (B2 + x * (B3 + x * B4)) / linear)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use proptest::test_runner::RngSeed;

    #[test]
    fn a_table_is_linear_between_its_speeds_and_constant_beyond() {
        let table = RestitutionTable::of(&[1.0, 2.0, 4.0], &[0.9, 0.7, 0.8]).unwrap();
        for (speed, expected) in
            [(-1.0, 0.9), (0.0, 0.9), (1.0, 0.9), (1.5, 0.8), (2.0, 0.7), (3.0, 0.75), (4.0, 0.8), (1e9, 0.8)]
        {
            let e = Restitution::Table(table).coefficient(speed);
            assert!((e - expected).abs() < 1e-15, "{speed}: {e}");
        }
        let again = RestitutionTable::of(&[1.0, 2.0, 4.0], &[0.9, 0.7, 0.8]).unwrap();
        assert!(std::ptr::eq(table, again));
        assert!(!Restitution::Table(table).is_elastic());
        assert!(Restitution::Table(RestitutionTable::of(&[0.0, 3.0], &[1.0, 1.0]).unwrap()).is_elastic());
        for (speeds, values, message) in [
            (&[][..], &[][..], "values = 0 must be as many as speeds"),
            (&[1.0], &[0.5, 0.6], "values = 2 must be as many as speeds"),
            (&[1.0, 1.0], &[0.5, 0.6], "speeds = 1 must be above the speed before it"),
            (&[2.0, 1.0], &[0.5, 0.6], "speeds = 1 must be above"),
            (&[-1.0, 1.0], &[0.5, 0.6], "speeds = -1 must be zero or positive"),
            (&[0.0, f64::NAN], &[0.5, 0.6], "speeds = NaN must be"),
            (&[0.0, 1.0], &[0.5, 1.1], "values = 1.1 must be in [0, 1]"),
        ] {
            let error = RestitutionTable::of(speeds, values).unwrap_err().to_string();
            assert!(error.starts_with(message), "{error}");
        }
    }

    /// The quotient as printed by Müller and Pöschel.
    fn pade(x: f64) -> f64 {
        (1.0 + B1 * x) / (1.0 + B1 * x + B2 * x * x + B3 * x.powi(3) + B4 * x.powi(4))
    }

    #[test]
    fn viscoelastic_law_is_the_pade_approximant() {
        for k in -60..=60 {
            let v = 10f64.powf(f64::from(k) / 10.0);
            let e = Restitution::Viscoelastic { coefficient: 0.3 }.coefficient(v);
            let reference = pade((0.3 * v.powf(0.2)).sqrt());
            assert!((e - reference).abs() <= 8.0 * f64::EPSILON, "v = {v}: {e} against {reference}");
        }
    }

    #[test]
    fn viscoelastic_law_agrees_with_its_series_at_low_speed() {
        // e = 1 − 1.15344 δ + 0.79826 δ² + O(δ^{5/2}) at v = 1, where δ = coefficient. In x = √δ the
        // approximant has the terms −4.4e-6 x³, 0.798248 x⁴ and 0.27 x⁵, from its printed digits; they bound
        // the difference.
        for delta in [1e-6, 1e-5, 1e-4, 1e-3, 1e-2] {
            let e = Restitution::Viscoelastic { coefficient: delta }.coefficient(1.0);
            let series = 1.0 - 1.15344 * delta + 0.79826 * delta * delta;
            let x = f64::sqrt(delta);
            let bound = 5e-6 * x.powi(3) + 2e-5 * x.powi(4) + 0.3 * x.powi(5) + 4.0 * f64::EPSILON;
            assert!((e - series).abs() <= bound, "δ = {delta}: {e} against {series}, bound {bound:e}");
        }
    }

    #[test]
    fn coefficient_tends_to_one_at_low_speed_and_falls_at_high_speed() {
        let law = Restitution::Viscoelastic { coefficient: 0.5 };
        assert_eq!(law.coefficient(0.0), 1.0);
        assert_eq!(law.coefficient(-1.0), 1.0);
        assert!(law.coefficient(1e12) < 0.02, "{}", law.coefficient(1e12));
        let law = Restitution::Cutoff { restitution: 0.7, speed: 2.0, exponent: 0.75 };
        assert_eq!(law.coefficient(0.0), 1.0);
        assert_eq!(law.coefficient(-1.0), 1.0);
        assert_eq!(law.coefficient(2.0), 0.7);
    }

    #[test]
    fn is_elastic_is_true_for_laws_without_loss_only() {
        let cutoff = |restitution| Restitution::Cutoff { restitution, speed: 1.0, exponent: 0.75 };
        let elastic =
            [Restitution::Constant(1.0), Restitution::Viscoelastic { coefficient: 0.0 }, cutoff(1.0)];
        for law in elastic {
            assert!(law.is_elastic(), "{law:?}");
            for v in [0.0, 1e-9, 0.5, 1.0, 1e6] {
                assert_eq!(law.coefficient(v), 1.0, "{law:?} at {v}");
            }
        }
        for law in
            [Restitution::Constant(0.999), Restitution::Viscoelastic { coefficient: 1e-9 }, cutoff(0.9)]
        {
            assert!(!law.is_elastic(), "{law:?}");
        }
    }

    #[test]
    fn errors_name_the_parameter_out_of_range() {
        let cutoff = |restitution, speed, exponent| Restitution::Cutoff { restitution, speed, exponent };
        let bad = [
            (Restitution::Constant(-0.1), "restitution"),
            (Restitution::Constant(1.0 + f64::EPSILON), "restitution"),
            (Restitution::Constant(f64::NAN), "restitution"),
            (Restitution::Viscoelastic { coefficient: -1.0 }, "coefficient"),
            (Restitution::Viscoelastic { coefficient: f64::INFINITY }, "coefficient"),
            (Restitution::Viscoelastic { coefficient: f64::NAN }, "coefficient"),
            (cutoff(1.5, 1.0, 0.75), "restitution"),
            (cutoff(0.5, 0.0, 0.75), "speed"),
            (cutoff(0.5, f64::INFINITY, 0.75), "speed"),
            (cutoff(0.5, 1.0, 0.0), "exponent"),
            (cutoff(0.5, 1.0, f64::NAN), "exponent"),
        ];
        for (law, parameter) in bad {
            let error = law.check().expect_err("must be refused");
            assert_eq!(error.parameter, parameter, "{law:?}: {error}");
        }
        for law in [Restitution::Constant(0.0), Restitution::Constant(1.0), cutoff(0.0, 1e-9, 2.0)] {
            assert_eq!(law.check(), Ok(()), "{law:?}");
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig {
            cases: 2000, rng_seed: RngSeed::Fixed(7), failure_persistence: None, ..ProptestConfig::default()
        })]

        #[test]
        fn restitution_stays_between_zero_and_one_and_falls_with_speed(
            log_v in -12.0..12.0f64, step in 0.0..3.0f64, coefficient in 0.0..10.0f64,
            restitution in 0.0..=1.0f64, exponent in 0.1..3.0f64,
        ) {
            let (slow, fast) = (10f64.powf(log_v), 10f64.powf(log_v + step));
            for law in [
                Restitution::Viscoelastic { coefficient },
                Restitution::Cutoff { restitution, speed: 1.0, exponent },
            ] {
                let (a, b) = (law.coefficient(slow), law.coefficient(fast));
                prop_assert!((0.0..=1.0).contains(&a) && (0.0..=1.0).contains(&b), "{law:?}: {a}, {b}");
                prop_assert!(b <= a + 4.0 * f64::EPSILON, "{law:?}: e({fast}) = {b} > e({slow}) = {a}");
            }
        }
    }
}
