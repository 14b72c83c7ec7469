//! The pressure tensor of a sample.

use crate::numerics::tensor::Tensor;

/// A pressure tensor, or one of its parts [energy/length^d]. Its components beyond the dimension are zero.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct StressTensor {
    /// Momentum that particles carry in their flights.
    pub kinetic: Tensor,
    /// Momentum that contacts transfer over the distance of the centers.
    pub collisional: Tensor,
}

impl StressTensor {
    /// The sum of both parts.
    #[must_use]
    pub fn total(&self) -> Tensor {
        std::array::from_fn(|k| self.kinetic[k] + self.collisional[k])
    }
}
