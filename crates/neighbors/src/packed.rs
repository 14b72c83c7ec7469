//! Candidates of four bytes.

use glam::DVec3;

use crate::Shift;

/// Bits of the particle's index.
const ID_BITS: u32 = 27;

/**
A candidate and its periodic image in one word: the index in the lower 27 bits, the image code in the upper
five.

The image code is `sx + 3 sy + 9 sz`, −13 … 13, in two's complement. Without a shift it is 0.
*/
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
#[repr(transparent)]
pub struct Packed(u32);

impl Packed {
    /// Number of particles that an index can distinguish.
    pub const MAX_PARTICLES: usize = 1 << ID_BITS;

    /// Packs a candidate; `None` if its image is not among the 27 nearest to the box.
    #[inline]
    pub fn new(id: u32, shift: Shift) -> Option<Self> {
        debug_assert!((id as usize) < Self::MAX_PARTICLES);
        if shift.iter().any(|s| !(-1..=1).contains(s)) {
            return None;
        }
        let code = shift[0] + 3 * shift[1] + 9 * shift[2];
        Some(Self(id | (code as u32) << ID_BITS))
    }

    /// Index of the particle.
    #[inline(always)]
    pub fn id(self) -> u32 {
        self.0 & ((1 << ID_BITS) - 1)
    }

    /// Image code, which is the index in [`Offsets`]; 0 for the particle itself.
    #[inline(always)]
    pub fn code(self) -> usize {
        (self.0 >> ID_BITS) as usize
    }

    /// Whether any of four candidates is a shifted image.
    #[inline(always)]
    pub fn any_image([a, b, c, d]: [Self; 4]) -> bool {
        (a.0 | b.0 | c.0 | d.0) >> ID_BITS != 0
    }

    /// The periodic image.
    #[inline]
    pub fn shift(self) -> Shift {
        if self.code() == 0 {
            return [0; 3];
        }
        // The arithmetic shift keeps the sign of the code; adding 13 gives 0 … 26.
        let code = ((self.0 as i32) >> ID_BITS) + 13;
        [code % 3 - 1, code / 3 % 3 - 1, code / 9 - 1]
    }

    /// The word itself.
    #[inline(always)]
    pub(crate) fn word(self) -> u32 {
        self.0
    }

    #[inline(always)]
    pub(crate) fn from_word(word: u32) -> Self {
        Self(word)
    }
}

/// Shift vectors s·L of the image codes [length]. A fourth component of zero fills up a vector register.
#[derive(Debug, Clone, PartialEq)]
#[repr(C, align(32))]
pub struct Offsets(pub [[f64; 4]; 32]);

impl Offsets {
    /// The table for a box with the edges `size`.
    pub(crate) fn new(size: DVec3) -> Self {
        let mut table = [[0.0; 4]; 32];
        for z in -1..=1 {
            for y in -1..=1 {
                for x in -1..=1 {
                    let Some(packed) = Packed::new(0, [x, y, z]) else { continue };
                    let offset = DVec3::new(f64::from(x), f64::from(y), f64::from(z)) * size;
                    table[packed.code()] = [offset.x, offset.y, offset.z, 0.0];
                }
            }
        }
        Self(table)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn unpacking_inverts_packing() {
        let size = DVec3::new(2.0, 3.0, 5.0);
        let offsets = Offsets::new(size);
        for x in -2..=2 {
            for y in -2..=2 {
                for z in -2..=2 {
                    let (id, shift) = ((1 << ID_BITS) - 1, [x, y, z]);
                    let packed = Packed::new(id, shift);
                    assert_eq!(packed.is_some(), shift.iter().all(|s: &i32| s.abs() <= 1));
                    if let Some(packed) = packed {
                        assert_eq!((packed.id(), packed.shift()), (id, shift));
                        assert_eq!(packed.code() == 0, shift == [0; 3]);
                        let [x, y, z] = shift.map(f64::from);
                        assert_eq!(offsets.0[packed.code()], [2.0 * x, 3.0 * y, 5.0 * z, 0.0]);
                    }
                }
            }
        }
    }
}
