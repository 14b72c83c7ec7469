//! Correlations in time, as files have them.

use crate::model::Correlations;

/// A correlation as files have it.
#[derive(Debug, Clone, Copy)]
pub struct CorrelationKind {
    /// Name in files.
    pub name: &'static str,
    /// Unit of the value.
    pub unit: &'static str,
    /// Whether it is measured.
    pub exists: fn(&Correlations) -> bool,
    /// The species of its curves, as indices; empty for one curve that is not of a species.
    pub species: fn(&Correlations) -> &[u32],
}

/// All correlations, in the order of [`Correlation`]s.
pub const CORRELATIONS: [CorrelationKind; 4] = [
    kind("msd", "length^2", |c| c.msd.any(), |c| c.msd.species()),
    kind("vacf", "length^2/time^2", |c| c.vacf.any(), |c| c.vacf.species()),
    kind("stress", "energy^2/length^2d", |c| c.stress, |_| &[]),
    kind("helfand", "energy^2 time^2/length^2d", |c| c.stress, |_| &[]),
];

const fn kind(
    name: &'static str,
    unit: &'static str,
    exists: fn(&Correlations) -> bool,
    species: fn(&Correlations) -> &[u32],
) -> CorrelationKind {
    CorrelationKind { name, unit, exists, species }
}

/// A correlation so far.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Correlation {
    /// Name as in [`CORRELATIONS`].
    pub name: &'static str,
    /// The species of its curves, as indices; empty for one curve that is not of a species.
    pub species: Vec<u32>,
    /// Lags, in ascending order \[time\].
    pub lag: Vec<f64>,
    /// Value by lag: ⟨|r(t) − r(0)|²⟩, ⟨v(t)·v(0)⟩, ⟨P_xy(t) P_xy(0)⟩ or ⟨(∫P_xy dt)²⟩. With several
    /// curves one number for each of them at each lag, and so are the errors.
    pub value: Vec<f64>,
    /// Standard error of the value; NaN from less than eight pairs of states.
    pub error: Vec<f64>,
    /// Number of pairs of states by lag.
    pub count: Vec<u64>,
}
