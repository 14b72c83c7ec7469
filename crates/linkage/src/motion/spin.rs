//! Two bodies on a rigid massless rod: uniform rotation about a center of mass in free flight.

use glam::DVec3;

/// The motion of a rod with a body at either end.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Spin {
    center: DVec3,
    velocity: DVec3,
    gravity: DVec3,
    /// From joint a to joint b.
    arm: DVec3,
    /// The arm after a quarter turn, of the same length.
    across: DVec3,
    omega: f64,
    /// Distances of the joints from the center of mass, in units of the arm: negative for a.
    lever: [f64; 2],
    /// From joint to body.
    offset: [DVec3; 2],
}

impl Spin {
    /// The motion from `bodies`, the offsets of the joints from them, their masses, and the rod's length.
    pub fn new(
        bodies: [(DVec3, DVec3); 2],
        offset: [DVec3; 2],
        mass: [f64; 2],
        length: f64,
        gravity: DVec3,
    ) -> Self {
        let total = mass[0] + mass[1];
        let (ra, rb) = (bodies[0].0 + offset[0], bodies[1].0 + offset[1]);
        let lever = [-mass[1] / total, mass[0] / total];
        let direction = (rb - ra).normalize();
        let relative = bodies[1].1 - bodies[0].1;
        let turning = relative - direction * relative.dot(direction);
        let omega = turning.length() / length;
        let across = if omega > 0.0 { turning.normalize() * length } else { DVec3::ZERO };
        Self {
            center: (ra * mass[0] + rb * mass[1]) / total,
            velocity: (bodies[0].1 * mass[0] + bodies[1].1 * mass[1]) / total,
            gravity,
            arm: direction * length,
            across,
            omega,
            lever,
            offset,
        }
    }

    /// State of body `k`.
    pub fn state(&self, k: usize, tau: f64) -> (DVec3, DVec3) {
        let (sin, cos) = libm::sincos(self.omega * tau);
        let arm = self.arm * cos + self.across * sin;
        let turn = (self.across * cos - self.arm * sin) * self.omega;
        (
            self.center + (self.velocity + self.gravity * (0.5 * tau)) * tau + arm * self.lever[k]
                - self.offset[k],
            self.velocity + self.gravity * tau + turn * self.lever[k],
        )
    }

    /// Acceleration of body `k`.
    pub fn acceleration(&self, k: usize, tau: f64) -> DVec3 {
        let (sin, cos) = libm::sincos(self.omega * tau);
        let arm = self.arm * cos + self.across * sin;
        self.gravity - arm * (self.omega * self.omega * self.lever[k])
    }

    /// Bound on the rate of change of that acceleration.
    pub fn jerk_bound(&self, k: usize) -> f64 {
        self.omega * self.omega * self.omega * self.arm.length() * self.lever[k].abs()
    }

    /// Bound on the acceleration of body `k`.
    pub fn acceleration_bound(&self, k: usize) -> f64 {
        self.gravity.length() + self.omega * self.omega * self.arm.length() * self.lever[k].abs()
    }

    /// Bound on the speed of body `k` up to `tau`.
    pub fn speed_bound(&self, k: usize, tau: f64) -> f64 {
        let center = self.velocity.length().max((self.velocity + self.gravity * tau).length());
        center + self.omega * self.arm.length() * self.lever[k].abs()
    }

    /// A time over which the motion changes.
    pub fn timescale(&self) -> f64 {
        1.0 / self.omega
    }
}
