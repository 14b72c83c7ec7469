//! Simple shear of a system.

/// Simple shear.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Shear {
    /// Axis of the flow: 0, 1 or 2.
    pub flow: usize,
    /// Axis along which the velocity of the flow grows; another one than `flow`.
    pub gradient: usize,
    /// γ̇, the velocity of the flow per length [1/time].
    pub rate: f64,
    /// Displacement along the flow of the image across the upper face at time 0 \[length\].
    pub offset: f64,
}
