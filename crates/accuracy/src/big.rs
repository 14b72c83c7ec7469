//! Numbers and vectors of hundreds of bits.

use dashu_float::{FBig, round::mode::HalfEven};
use glam::DVec3;

/// A binary floating-point number; a result has the larger precision of its two operands.
pub type Big = FBig<HalfEven, 2>;

/// The exact value of a finite `x`, for arithmetic with `bits` significant bits (≥ 53).
///
/// # Panics
///
/// If `x` is not finite.
pub fn big(x: f64, bits: usize) -> Big {
    Big::try_from(x).expect("a finite number").with_precision(bits).value()
}

/// The nearest f64.
pub fn nearest(x: &Big) -> f64 {
    x.to_f64().value()
}

/// 2x
pub fn twice(x: &Big) -> Big {
    x.clone() << 1
}

/// A vector of three.
#[derive(Debug, Clone, PartialEq)]
pub struct BigVec(pub [Big; 3]);

impl BigVec {
    /// The exact value of a finite vector.
    pub fn new(v: DVec3, bits: usize) -> Self {
        Self(v.to_array().map(|x| big(x, bits)))
    }

    /// The nearest f64 of each component.
    pub fn nearest(&self) -> DVec3 {
        let [x, y, z] = &self.0;
        DVec3::new(nearest(x), nearest(y), nearest(z))
    }

    /// Scalar product.
    pub fn dot(&self, other: &Self) -> Big {
        let ([a, b, c], [x, y, z]) = (&self.0, &other.0);
        a * x + b * y + c * z
    }

    /// self − other
    #[must_use]
    pub fn minus(&self, other: &Self) -> Self {
        let ([a, b, c], [x, y, z]) = (&self.0, &other.0);
        Self([a - x, b - y, c - z])
    }

    /// self + other · factor
    #[must_use]
    pub fn plus(&self, other: &Self, factor: &Big) -> Self {
        let ([a, b, c], [x, y, z]) = (&self.0, &other.0);
        Self([a + x * factor, b + y * factor, c + z * factor])
    }

    /// Each component rounded to the nearest f64.
    pub fn round_to_double(&mut self, bits: usize) {
        *self = Self::new(self.nearest(), bits);
    }
}
