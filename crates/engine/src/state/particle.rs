//! A particle: its anchor, one cache line, and the properties of its class.
//!
//! A particle is one cache line (`Particle`, 64 bytes): its *anchor*, which is position, velocity and time
//! at its last own event, with an event counter and a class. Radius, mass and contact group are in a table
//! by class. Between own events it does not change: frames, samples, cell crossings and checkpoints read
//! copies.

use glam::DVec3;

/// The *anchor* of a particle: its state at its own last event. One cache line.
#[derive(Debug, Clone, Copy, PartialEq)]
#[repr(C, align(64))]
pub(crate) struct Particle {
    pub position: DVec3,
    pub velocity: DVec3,
    /// Time of the anchor [ticks].
    pub time: i64,
    /// Number of own events so far; it invalidates older calendar entries.
    pub count: u32,
    /// Index of the class, and flags in the highest bits.
    class: u32,
}

/// Flag: walls support the particle.
const RESTING: u32 = 1 << 31;

/// Flag: the last contact of the particle was with another particle, or was repeated
/// ([`crate::laws::repeated::is_repeated_wall_contact`]).
const RECENTLY_HIT: u32 = 1 << 30;

const FLAGS: u32 = RESTING | RECENTLY_HIT;

impl Particle {
    /// A particle with its anchor at `time` [ticks], without support by walls and without events.
    pub fn at(position: DVec3, velocity: DVec3, time: i64, class: u32) -> Self {
        Self { position, velocity, time, count: 0, class }
    }

    /// Sets the anchor at `time` [ticks], and counts an own event.
    #[inline(always)]
    pub fn set_anchor(&mut self, position: DVec3, velocity: DVec3, time: i64) {
        (self.position, self.velocity, self.time) = (position, velocity, time);
        self.count = self.count.wrapping_add(1);
    }

    #[inline(always)]
    pub fn class(&self) -> usize {
        (self.class & !FLAGS) as usize
    }

    #[inline(always)]
    pub fn rests(&self) -> bool {
        self.class & RESTING != 0
    }

    #[inline(always)]
    pub fn is_recently_hit(&self) -> bool {
        self.class & RECENTLY_HIT != 0
    }

    /// Notes whether walls support the particle.
    pub fn set_rests(&mut self, rests: bool) {
        self.class = if rests { self.class | RESTING } else { self.class & !RESTING };
    }

    /// Changes the class, and keeps the flags.
    pub fn set_class(&mut self, class: usize) {
        self.class = class as u32 | self.class & FLAGS;
    }

    pub fn set_recently_hit(&mut self, recently_hit: bool) {
        self.class = if recently_hit { self.class | RECENTLY_HIT } else { self.class & !RECENTLY_HIT };
    }
}

/// Radius, mass and contact group of a class.
#[derive(Debug, Clone, Copy)]
pub(crate) struct ClassData {
    pub radius: f64,
    pub mass: f64,
    pub inverse_mass: f64,
    pub group: usize,
}

/// The walls that support a particle, at most three.
pub(crate) type Support = [Option<u16>; 3];

impl ClassData {
    /// Moment of inertia I = q m R² [mass·length²], for the number q of its group.
    pub fn moment_of_inertia(&self, inertia: &[f64]) -> f64 {
        inertia[self.group] * self.mass * self.radius * self.radius
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_particle_is_one_cache_line() {
        assert_eq!((size_of::<Particle>(), align_of::<Particle>()), (64, 64));
    }
}
