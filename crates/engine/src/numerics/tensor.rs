//! Tensors of three dimensions.

use glam::DVec3;

/// A tensor, row by row.
pub(crate) type Tensor = [f64; 9];

/// The product a ⊗ b.
#[inline]
pub(crate) fn product(a: DVec3, b: DVec3) -> Tensor {
    let (a, b) = (a.to_array(), b.to_array());
    std::array::from_fn(|k| a[k / 3] * b[k % 3])
}
