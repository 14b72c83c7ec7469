//! The force on each wall and the heat that it gives, as means over the time between samples.

use glam::DVec3;

use crate::{
    numerics::{
        error::EngineError,
        exact_sum::ExactSums,
        words::{Words, fault, put_exact_sums, put_reals, put_sums},
    },
    state::force::{self, Force, Total},
};

/// Sums for one wall since the previous sample.
#[derive(Debug, Clone, Default)]
pub(crate) struct WallSum {
    /// Impulse on the particles by impacts [mass·length/time], and the energy given to them in the frame of
    /// the wall: that of thermal reflections, minus the losses of impacts \[energy\]. Exact, so that they do
    /// not depend on the order in which blocks take events.
    pub given: ExactSums<4>,
    /// Force on the particles that rest on the wall.
    pub support: Force,
    /// Momentum that the wall had given to the grains that it carries, at the previous sample.
    pub carried: DVec3,
}

/// Sums for all walls.
#[derive(Debug, Clone)]
pub(crate) struct WallSums {
    pub walls: Vec<WallSum>,
    /// Time of the previous sample, if there was one.
    pub sampled_at: Option<f64>,
    /// Of a block: what walls have given in its step, (wall, impulse and energy). It has no walls.
    terms: Vec<(u32, [f64; 4])>,
}

impl WallSums {
    pub fn new(walls: usize) -> Self {
        Self { walls: vec![WallSum::default(); walls], sampled_at: None, terms: Vec::new() }
    }

    /// Those of a block, which keeps the terms of its step.
    pub fn of_block() -> Self {
        Self::new(0)
    }

    /// Adds an impulse on a particle, and an energy given to it in the frame of the wall.
    pub fn add(&mut self, wall: u32, impulse: DVec3, energy: f64) {
        self.add_terms(wall, [impulse.x, impulse.y, impulse.z, energy]);
    }

    fn add_terms(&mut self, wall: u32, terms: [f64; 4]) {
        match self.walls.get_mut(wall as usize) {
            Some(sum) => sum.given.add(terms),
            None => self.terms.push((wall, terms)),
        }
    }

    /// Adds what a block has noted in its step.
    pub fn take_from_block(&mut self, block: &mut Self) {
        for (wall, terms) in block.terms.drain(..) {
            self.add_terms(wall, terms);
        }
    }

    /// Of a block: forgets the terms of its step.
    pub fn clear(&mut self) {
        self.terms.clear();
    }

    /// Adds the force on a particle by the walls that support it from `time` on, or takes it off (`sign` −1).
    pub fn change_support(&mut self, shares: impl Iterator<Item = (u16, DVec3)>, sign: f64, time: f64) {
        for (wall, share) in shares {
            // A step of blocks in which a particle comes to rest is undone.
            if let Some(sum) = self.walls.get_mut(usize::from(wall)) {
                sum.support.change(sign * share, time);
            }
        }
    }

    /// Ends the forces on particles that rest on walls: from `time` on none do.
    pub fn end_support(&mut self, time: f64) {
        for wall in &mut self.walls {
            let force = force::value(&wall.support.total);
            wall.support.change(-force, time);
            wall.support.total = Total::default();
        }
    }

    pub fn save(&self, words: &mut Vec<u64>) {
        words.push(u64::from(self.sampled_at.is_some()));
        put_reals(words, &[self.sampled_at.unwrap_or(0.0)]);
        for wall in &self.walls {
            put_exact_sums(words, &wall.given);
            put_sums(words, &wall.support.total);
            put_sums(words, &wall.support.impulse);
            put_reals(words, &[wall.support.until]);
            put_reals(words, &wall.carried.to_array());
        }
    }

    pub fn load(&mut self, words: &mut Words, time: f64) -> Result<(), EngineError> {
        let sampled = words.count("the flag of the first sample", 1)? == 1;
        let at = words.real()?;
        self.sampled_at = sampled.then_some(at);
        for wall in &mut self.walls {
            words.exact_sums(&mut wall.given)?;
            words.sums(&mut wall.support.total)?;
            words.sums(&mut wall.support.impulse)?;
            wall.support.until = words.real()?;
            wall.carried = DVec3::from_slice(&words.reals(3)?);
        }
        if at > time {
            return Err(fault(&format!("a sample at {at}, after the time {time}")));
        }
        Ok(())
    }
}
