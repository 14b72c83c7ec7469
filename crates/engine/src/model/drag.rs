//! A linear drag.

/// A drag on all bodies of finite mass: dv/dt = −v/τ between collisions. All other bodies and all walls are
/// at rest, and there is neither gravity nor a box that deforms.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Drag {
    /// τ > 0 \[time\].
    pub time: f64,
    /// Whether angular velocities decay in the same way. Only with spin.
    pub rotational: bool,
}
