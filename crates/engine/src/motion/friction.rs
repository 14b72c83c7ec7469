//! Friction on grains that slide or roll on a wall, at a time.

use glam::DVec3;

use crate::{
    numerics::total::total,
    state::{slide::Slide, world::World},
};

impl World {
    /// The acceleration of particle i by friction.
    pub fn friction(&self, i: u32) -> DVec3 {
        let slide = self.spin.as_ref().and_then(|spins| spins.slides.get(&i));
        slide.map_or(DVec3::ZERO, |slide| slide.friction)
    }

    /// The particles with friction on them, in ascending order.
    pub fn sliding(&self) -> Vec<u32> {
        self.spin.as_ref().map_or(Vec::new(), |spins| spins.slides.keys().copied().collect())
    }

    /// Energy that friction has taken at the present, in slides that have not ended.
    pub fn friction_loss(&self) -> f64 {
        let Some(spins) = self.spin.as_ref().filter(|spins| !spins.slides.is_empty()) else { return 0.0 };
        let slides: Vec<(u32, &Slide)> = spins.slides.iter().map(|(&i, slide)| (i, slide)).collect();
        let [energy] = total(slides.len(), |k| {
            let (i, slide) = slides[k as usize];
            [self.class(i).mass * slide.loss(&self.clock, self.now)]
        });
        energy
    }
}
