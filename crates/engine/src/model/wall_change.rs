//! Walls whose motion changes while a run goes on.

use haff_mechanics::{Oscillation, Shape};

use crate::{
    model::{
        Wall,
        wall_motion::{ConstantVelocity, Oscillating, WallMotion},
    },
    numerics::instant::Instant,
};

impl Wall {
    /// This wall with another motion from `at` on. It goes on from where it is then: no change of its
    /// motion displaces it.
    ///
    /// * A fixed wall stays at that position, and a constant velocity starts there.
    /// * An oscillation keeps the phase that the wall has, at another frequency, too. A wall that did not
    ///   oscillate begins at phase 0. With another amplitude or waveform the mean position moves along the
    ///   normal, by the difference of the shifts at this phase; otherwise it stays.
    /// * The phase and the reference time of `motion` are not read: they follow from `at`.
    ///
    /// A wall whose motion stays the same is returned as it is, to the last bit.
    #[must_use]
    pub fn going_on(&self, motion: &WallMotion, at: Instant) -> Self {
        let shift = |motion: &WallMotion| motion.displacement(self.normal, at).dot(self.normal);
        let (motion, shift_after) = match (&self.motion, motion) {
            (WallMotion::Oscillating(old), WallMotion::Oscillating(new)) => {
                let (old, new) = (*old, new.oscillation);
                let cycles = if new.frequency == old.oscillation.frequency {
                    old.cycles
                } else {
                    reduced(old.at(at) - at.cycles(new.frequency))
                };
                let motion = WallMotion::Oscillating(Oscillating { oscillation: new, cycles });
                let shape = |wave: &Oscillation| (wave.waveform, wave.amplitude);
                if shape(&new) == shape(&old.oscillation) {
                    return Self { motion, ..self.clone() };
                }
                (motion, shift(&motion))
            }
            (_, WallMotion::Oscillating(new)) => {
                let oscillation = new.oscillation;
                let cycles = reduced(-at.cycles(oscillation.frequency));
                (WallMotion::Oscillating(Oscillating { oscillation, cycles }), 0.0)
            }
            (WallMotion::Constant(old), WallMotion::Constant(new)) if old.velocity == new.velocity => {
                return self.clone();
            }
            // No wall becomes a piston on the way.
            (WallMotion::Fixed, WallMotion::Fixed) | (_, WallMotion::Piston(_)) => return self.clone(),
            (_, WallMotion::Constant(new)) => {
                let velocity = new.velocity;
                // Where the wall moves within its plane, its position does not depend on the time.
                let is_plane = !matches!(self.shape, Some(Shape::Named(_)));
                let is_same = is_plane && velocity.dot(self.normal) == 0.0;
                let reference_time = if is_same { 0.0 } else { at.high };
                let motion = WallMotion::Constant(ConstantVelocity { velocity, reference_time });
                (motion, shift(&motion))
            }
            (_, WallMotion::Fixed | WallMotion::Rotating(_) | WallMotion::Shrinking(_)) => (*motion, 0.0),
        };
        let point = if matches!(self.shape, Some(Shape::Named(_))) {
            // In any direction, not along a normal.
            let shift = |motion: &WallMotion| motion.displacement(self.normal, at);
            self.point + shift(&self.motion) - shift(&motion)
        } else {
            self.point + self.normal * (shift(&self.motion) - shift_after)
        };
        Self { point, motion, ..self.clone() }
    }
}

/// A phase in cycles reduced to 0 ≤ u < 1.
fn reduced(cycles: f64) -> f64 {
    let cycles = cycles - cycles.floor();
    if cycles < 1.0 { cycles } else { 0.0 }
}
