//! Powers of two as units: scaling by them is exact, so that kernels can avoid the limits of the f64 range.

use glam::DVec3;

/// Largest magnitude of the components.
pub(crate) fn magnitude(x: DVec3) -> f64 {
    x.abs().max_element()
}

/// Binary exponent of a positive finite number: `2^k ≤ x < 2^(k+1)`.
pub(crate) fn exponent(x: f64) -> i32 {
    libm::ilogb(x)
}

/// `x · 2^k`, exact except for overflow and underflow.
pub(crate) fn scaled(x: f64, k: i32) -> f64 {
    libm::scalbn(x, k)
}

/// `x · 2^k` per component.
pub(crate) fn scaled_vector(x: DVec3, k: i32) -> DVec3 {
    DVec3::new(scaled(x.x, k), scaled(x.y, k), scaled(x.z, k))
}
