//! Friction on a grain that a wall supports, as data; its physics is in [`crate::laws::slide`].

use glam::DVec3;

use crate::numerics::clock::Clock;

/// Friction on a grain since an event.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct Slide {
    pub wall: u32,
    /// \[ticks\]
    pub since: i64,
    /// End \[ticks\]; `None` if it has none by itself.
    pub end: Option<i64>,
    /// Whether the slip ends there.
    pub rolls: bool,
    /// Acceleration by friction [length/time²].
    pub friction: DVec3,
    /// Slip at `since` [length/time], and its rate of change.
    pub slip: DVec3,
    pub slip_rate: DVec3,
    /// Rate of change of the angular velocity [1/time²].
    pub spin_rate: DVec3,
    /// Energy by mass that friction took before `since` [length²/time²], and its impulse by mass.
    pub lost: f64,
    pub given: DVec3,
}

impl Slide {
    /// Its vectors with their names in checkpoints.
    pub fn vectors_mut(&mut self) -> [(&'static str, &mut DVec3); 5] {
        [
            ("friction", &mut self.friction),
            ("slip", &mut self.slip),
            ("slip_rate", &mut self.slip_rate),
            ("spin_rate", &mut self.spin_rate),
            ("given", &mut self.given),
        ]
    }

    /// See [`Self::vectors_mut`].
    pub fn vectors(mut self) -> [(&'static str, DVec3); 5] {
        self.vectors_mut().map(|(name, vector)| (name, *vector))
    }

    /// Whether the grain slips; otherwise it rolls.
    pub fn slips(&self) -> bool {
        self.slip != DVec3::ZERO || self.slip_rate != DVec3::ZERO
    }

    fn age(&self, clock: &Clock, ticks: i64) -> f64 {
        (ticks - self.since) as f64 * clock.tick
    }

    /// Change of the angular velocity since the slide began [1/time].
    pub fn spin_change(&self, clock: &Clock, ticks: i64) -> DVec3 {
        self.spin_rate * self.age(clock, ticks)
    }

    /// Energy by mass that friction has taken: the work of `friction` along the slip.
    pub fn loss(&self, clock: &Clock, ticks: i64) -> f64 {
        let t = self.age(clock, ticks);
        self.lost - self.friction.dot(self.slip * t + self.slip_rate * (0.5 * t * t))
    }

    /// Impulse by mass that friction has given to the grain.
    pub fn impulse(&self, clock: &Clock, ticks: i64) -> DVec3 {
        self.given + self.friction * self.age(clock, ticks)
    }

    /// The same slide, described from `ticks` on.
    pub fn moved_to(&self, clock: &Clock, ticks: i64) -> Self {
        let t = self.age(clock, ticks);
        let slip = self.slip + self.slip_rate * t;
        let given = self.impulse(clock, ticks);
        Self { since: ticks, slip, lost: self.loss(clock, ticks), given, ..*self }
    }
}
