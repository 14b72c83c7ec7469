//! The periodic images of positions and of pairs in double precision. Searches visit images by whole edges,
//! and coordinates of compact particles repeat with the box: a boundary with other images changes these, too
//! (CONTRIBUTING.md).

use glam::DVec3;
use haff_neighbors::Shift;

use crate::model::{Boundary, Domain};

/// The edge lengths of the box, and its periodic axes.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Periodicity {
    /// Edge lengths L [length]; of a box that is compressed those at time 0.
    pub size: DVec3,
    /// Positions below these along each axis are in the box, and differences of less than half of these are
    /// those of the nearest image [length]. The edges; of a box that is compressed the shortest ones that
    /// it has while a search is used.
    pub certain: DVec3,
    /// Whether the box is periodic along each axis.
    pub is_periodic: [bool; 3],
    /// 1/L along periodic axes, 0 along others.
    inverse_size: [f64; 3],
}

impl Periodicity {
    /// The periodicity of a domain.
    pub fn of(domain: &Domain) -> Self {
        let is_periodic = domain.boundary.map(|boundary| boundary == Boundary::Periodic);
        let inverse_size =
            [0, 1, 2].map(|axis| if is_periodic[axis] { 1.0 / domain.size[axis] } else { 0.0 });
        Self { size: domain.size, certain: domain.size, is_periodic, inverse_size }
    }

    /// The same axes with other edges along the periodic ones.
    #[inline]
    pub fn with_edges(&self, edges: DVec3) -> Self {
        let (mut size, mut inverse_size) = (self.size, self.inverse_size);
        for axis in (0..3).filter(|&axis| self.is_periodic[axis]) {
            (size[axis], inverse_size[axis]) = (edges[axis], 1.0 / edges[axis]);
        }
        Self { size, certain: size, inverse_size, ..*self }
    }

    /// Wraps a position into the box along periodic axes. Returns the position and the number of box lengths
    /// that have been subtracted.
    #[inline]
    pub fn wrap(&self, position: DVec3) -> (DVec3, [i32; 3]) {
        let mut p = position.to_array();
        let mut wraps = [0; 3];
        for axis in 0..3 {
            let length = self.size[axis];
            if self.is_periodic[axis] && !(0.0..length).contains(&p[axis]) {
                let turns = (p[axis] / length).floor();
                p[axis] -= turns * length;
                wraps[axis] = turns as i32;
                // By rounding, the result may be slightly negative or exactly L.
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
        position.cmpge(DVec3::ZERO).all() && position.cmplt(self.certain).all()
    }

    /// The nearest image of a difference of positions.
    #[inline]
    pub fn nearest(&self, r: DVec3) -> DVec3 {
        let mut r = r.to_array();
        for axis in 0..3 {
            let length = self.size[axis];
            if self.is_periodic[axis] && 2.0 * r[axis].abs() > length {
                // The shift is computed as one product, with the same bits as in predictions.
                r[axis] -= (r[axis] / length).round_ties_even() * length;
            }
        }
        DVec3::from_array(r)
    }

    /// The shift to the nearest image of a difference of positions.
    pub fn nearest_shift(&self, r: DVec3) -> Shift {
        [0, 1, 2].map(|axis| {
            let length = self.size[axis];
            let is_far = self.is_periodic[axis] && 2.0 * r[axis].abs() > length;
            if is_far { -(r[axis] / length).round_ties_even() as i32 } else { 0 }
        })
    }

    /// The number of edges nearest to a difference of coordinates along an axis; 0 if it is not periodic.
    #[inline(always)]
    pub fn turns(&self, difference: f64, axis: usize) -> f64 {
        round(difference * self.inverse_size[axis])
    }

    /// The offset of the nearest image, for a pair with this `difference` of positions: the vector to be
    /// added to the difference. A whole number of lengths as one product, as elsewhere, but without a branch.
    #[inline(always)]
    pub fn offset(&self, difference: DVec3) -> DVec3 {
        let shift = |axis: usize| -self.turns(difference[axis], axis) * self.size[axis];
        DVec3::new(shift(0), shift(1), shift(2))
    }

    /// The difference of positions `r` for the image `shift`, which a search has found.
    #[inline(always)]
    pub fn image(&self, r: DVec3, shift: Shift) -> DVec3 {
        if shift == [0; 3] {
            return r;
        }
        r + DVec3::new(f64::from(shift[0]), f64::from(shift[1]), f64::from(shift[2])) * self.size
    }
}

/// The nearest integers of components below 2^51.
#[inline(always)]
pub(crate) fn nearest_integers(v: DVec3) -> DVec3 {
    DVec3::new(round(v.x), round(v.y), round(v.z))
}

/// Nearest integer for |x| < 2^51, by the rounding of an addition.
#[inline(always)]
fn round(x: f64) -> f64 {
    const MAGIC: f64 = 6_755_399_441_055_744.0; // 1.5 · 2^52
    (x + MAGIC) - MAGIC
}
