//! The force of the outer world, and its impulse.

use glam::DVec3;

use crate::sum::Sum;

/// A vector that is added up.
pub(crate) type Total = [Sum; 3];

/// Adds a vector.
#[inline]
pub(crate) fn add(total: &mut Total, term: DVec3) {
    for (sum, term) in total.iter_mut().zip(term.to_array()) {
        sum.add(term);
    }
}

/// The value of a total.
pub(crate) fn value(total: &Total) -> DVec3 {
    DVec3::from_array(total.each_ref().map(Sum::value))
}

/// Σ m a of gravity and of the walls that hold particles [force], and its impulse until a time.
///
/// Both are compensated sums: a grain in a wedge rests and hops on for ten thousands of times while the
/// impulse of all the others' weight grows, and each time would leave the rounding of that behind.
#[derive(Debug, Clone, Default)]
pub(crate) struct Force {
    pub total: Total,
    /// [mass·length/time], until that [time].
    pub impulse: Total,
    pub until: f64,
}

impl Force {
    /// Impulse until `time` [mass·length/time].
    pub fn impulse_until(&self, time: f64) -> DVec3 {
        let mut impulse = self.impulse;
        self.add_impulse(&mut impulse, time);
        value(&impulse)
    }

    /// From `time` on it is another one.
    pub fn change(&mut self, change: DVec3, time: f64) {
        let mut impulse = self.impulse;
        self.add_impulse(&mut impulse, time);
        (self.impulse, self.until) = (impulse, time);
        add(&mut self.total, change);
    }

    fn add_impulse(&self, impulse: &mut Total, time: f64) {
        let span = time - self.until;
        for (impulse, total) in impulse.iter_mut().zip(&self.total) {
            impulse.add(total.high * span);
            impulse.add(total.low * span);
        }
    }
}
