//! The periodic images of a place and of a pair, in one place: a boundary that displaces images or gives
//! them a velocity of their own changes this file.

use glam::DVec3;
use haff_neighbors::Shift;

use crate::model::{Boundary, Domain};

/// The edges of the box, and along which of them it repeats.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Periodicity {
    /// Edge lengths L [length].
    pub size: DVec3,
    /// Whether the box repeats along an axis.
    pub along: [bool; 3],
    /// 1/L along periodic axes, 0 along others.
    per_size: [f64; 3],
}

impl Periodicity {
    /// Of a domain.
    pub fn of(domain: &Domain) -> Self {
        let along = domain.boundary.map(|boundary| boundary == Boundary::Periodic);
        let per_size = [0, 1, 2].map(|axis| if along[axis] { 1.0 / domain.size[axis] } else { 0.0 });
        Self { size: domain.size, along, per_size }
    }

    /// Wraps a position into the box along periodic axes: (position, wraps).
    #[inline]
    pub fn wrap(&self, position: DVec3) -> (DVec3, [i32; 3]) {
        let mut p = position.to_array();
        let mut wraps = [0; 3];
        for axis in 0..3 {
            let length = self.size[axis];
            if self.along[axis] && !(0.0..length).contains(&p[axis]) {
                let turns = (p[axis] / length).floor();
                p[axis] -= turns * length;
                wraps[axis] = turns as i32;
                // Rounding can leave −ulp or exactly L.
                if p[axis] < 0.0 {
                    p[axis] += length;
                    wraps[axis] -= 1;
                }
                if p[axis] >= length {
                    p[axis] -= length;
                    wraps[axis] += 1;
                }
            }
        }
        (DVec3::from_array(p), wraps)
    }

    /// Whether a position is within the box along all axes, so that [`Self::wrap`] changes nothing.
    #[inline(always)]
    pub fn contains(&self, position: DVec3) -> bool {
        position.cmpge(DVec3::ZERO).all() && position.cmplt(self.size).all()
    }

    /// The nearest image of a difference of positions.
    #[inline]
    pub fn nearest(&self, r: DVec3) -> DVec3 {
        let mut r = r.to_array();
        for axis in 0..3 {
            let length = self.size[axis];
            if self.along[axis] && 2.0 * r[axis].abs() > length {
                // A shift is applied as one product, as predictions do it.
                r[axis] -= (r[axis] / length).round_ties_even() * length;
            }
        }
        DVec3::from_array(r)
    }

    /// What to add to a difference of positions, to have the image that is nearest when it is `apart`. A
    /// whole number of lengths as one product, as everywhere, and without a branch.
    #[inline(always)]
    pub fn offset(&self, apart: DVec3) -> DVec3 {
        let shift = |axis: usize| -round(apart[axis] * self.per_size[axis]) * self.size[axis];
        DVec3::new(shift(0), shift(1), shift(2))
    }

    /// A difference of positions for the image that a search has found.
    #[inline(always)]
    pub fn image(&self, r: DVec3, shift: Shift) -> DVec3 {
        if shift == [0; 3] {
            return r;
        }
        r + DVec3::new(f64::from(shift[0]), f64::from(shift[1]), f64::from(shift[2])) * self.size
    }
}

/// Nearest integer, by the rounding of an addition; |x| < 2^51.
#[inline(always)]
fn round(x: f64) -> f64 {
    const MAGIC: f64 = 6_755_399_441_055_744.0; // 1.5 · 2^52
    (x + MAGIC) - MAGIC
}
