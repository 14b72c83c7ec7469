//! The external force on the particles, and its impulse.
//!
//! In a box that is compressed the flow changes the total peculiar momentum P along an axis, so that P (1 +
//! a t) is constant between kicks, with the rate a of the edge: the impulse in a time is this constant
//! times the change of 1/(1 + a t).

use glam::DVec3;

use crate::numerics::sum::Sum;

/// A sum of vectors.
pub(crate) type Total = [Sum; 3];

/// Adds a vector to a sum.
#[inline]
pub(crate) fn add(total: &mut Total, term: DVec3) {
    for (sum, term) in total.iter_mut().zip(term.to_array()) {
        sum.add(term);
    }
}

/// The value of a sum.
pub(crate) fn value(total: &Total) -> DVec3 {
    DVec3::from_array(total.each_ref().map(Sum::value))
}

/// The total force Σ m a of gravity and of the walls that support particles [force], and its impulse.
///
/// Both are compensated sums: a grain in a wedge may start and end its rest tens of thousands of times. Each
/// time the impulse of the weight of all particles is added up, and its rounding error would accumulate.
#[derive(Debug, Clone, Default)]
pub(crate) struct Force {
    pub total: Total,
    /// Impulse [mass·length/time] until the time `until` [time].
    pub impulse: Total,
    pub until: f64,
    /// a along each axis [1/time]. Where it is not 0, `total` is P (1 + a t) instead of a force.
    pub rates: DVec3,
}

impl Force {
    /// Impulse until `time` [mass·length/time].
    pub fn impulse_until(&self, time: f64) -> DVec3 {
        let mut impulse = self.impulse;
        self.add_impulse(&mut impulse, time);
        value(&impulse)
    }

    /// Adds `change` to the force from `time` on.
    pub fn change(&mut self, change: DVec3, time: f64) {
        let mut impulse = self.impulse;
        self.add_impulse(&mut impulse, time);
        (self.impulse, self.until) = (impulse, time);
        add(&mut self.total, change);
    }

    /// Adds the impulse from `self.until` to `time` to a sum.
    fn add_impulse(&self, impulse: &mut Total, time: f64) {
        let (from, to) = (DVec3::ONE + self.rates * self.until, DVec3::ONE + self.rates * time);
        let stretched = self.rates * (self.until - time) / (from * to);
        for (axis, (impulse, total)) in impulse.iter_mut().zip(&self.total).enumerate() {
            let span = if self.rates[axis] == 0.0 { time - self.until } else { stretched[axis] };
            impulse.add(total.high * span);
            impulse.add(total.low * span);
        }
    }
}
