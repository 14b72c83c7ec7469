//! The coefficient of restitution `e` as a function of the approach speed.

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
}
