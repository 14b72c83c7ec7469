//! Free flight under a linear drag, dv/dt = −v/τ.
//!
//! With the transformed time s = τ (1 − e^(−t/τ)) a flight is straight, r = r₀ + v₀ s, and so is every
//! relative flight of two bodies with one τ: contacts are found in s, and their times follow by a logarithm.
//! The velocity is v = v₀ e^(−t/τ) = v₀ (1 − s/τ), and a body that nothing meets stops at r₀ + v₀ τ.

/// Transformed time s = τ (1 − e^(−t/τ)) \[time\] of a flight of `duration` t \[time\] under a drag with the
/// time constant τ, `drag_time` \[time\].
///
/// ```
/// use haff_mechanics::drag::transformed_time;
/// // A body that flies for ever comes as far as one without drag in the time τ.
/// assert_eq!(transformed_time(f64::INFINITY, 3.0), 3.0);
/// ```
#[must_use]
pub fn transformed_time(duration: f64, drag_time: f64) -> f64 {
    -drag_time * libm::expm1(-duration / drag_time)
}

/// The duration t = −τ ln(1 − s/τ) \[time\] of a flight with this transformed time s \[time\]; infinite for
/// τ, not a number beyond.
///
/// ```
/// use haff_mechanics::drag::{flight_time, transformed_time};
/// // A ball of radius 0.5 at the speed 2 towards a wall 5.5 from its centre, with τ = 4.
/// let contact = flight_time((5.5 - 0.5) / 2.0, 4.0);
/// assert!((contact - 4.0 * (8.0_f64 / 3.0).ln()).abs() < 1e-15);
/// ```
#[must_use]
pub fn flight_time(transformed: f64, drag_time: f64) -> f64 {
    -drag_time * libm::log1p(-transformed / drag_time)
}
