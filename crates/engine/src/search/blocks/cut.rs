//! How the grid is cut into blocks, in each of the rounds of a step.
//!
//! Along each axis that is cut, the faces of a round are those of the first round, or in the middle between
//! them. The second round is shifted along all axes, so that its blocks contain the edges and corners of the
//! first ones. What is left lies at faces of the first round along one axis and of the second round along
//! another one; further rounds are shifted along some of the axes. The last round is a single block.

use super::{
    Grid,
    front::{Bounds, Front, Metric},
};

/// One of the rounds of a step: blocks that fill the grid.
#[derive(Debug, Default)]
pub(crate) struct Round {
    pub fronts: Vec<Front>,
    /// For each axis, the part in which a cell is.
    part_of: [Vec<u16>; 3],
    /// Number of parts along each axis.
    parts: [usize; 3],
}

impl Round {
    /// A round with these faces along each axis, in the memory of another one.
    fn new(metric: Metric, grid: &Grid, faces: &[Vec<i32>; 3], other: &mut Self) -> Self {
        let parts = [0, 1, 2].map(|k| parts(&faces[k], grid.n[k], grid.wraps[k]));
        let mut part_of = std::mem::take(&mut other.part_of);
        for k in 0..3 {
            part_of[k].clear();
            part_of[k].resize(grid.n[k] as usize, 0);
            for (part, &(first, end, _)) in parts[k].iter().enumerate() {
                for c in first..end {
                    part_of[k][(c % grid.n[k]) as usize] = part as u16;
                }
            }
        }
        let mut others = other.fronts.drain(..);
        let mut fronts = Vec::new();
        for z in &parts[2] {
            for y in &parts[1] {
                for x in &parts[0] {
                    let bounds = Bounds::new(grid, [x.0, y.0, z.0], [x.1, y.1, z.1], [x.2, y.2, z.2]);
                    fronts.push(Front::new(metric, bounds, others.next()));
                }
            }
        }
        Self { fronts, part_of, parts: parts.map(|parts| parts.len()) }
    }

    /// The block that contains a place [cells].
    #[inline(always)]
    pub fn block_at(&self, x: [f32; 3]) -> usize {
        let part = |k: usize| {
            let parts = &self.part_of[k];
            usize::from(parts[(x[k].max(0.0) as usize).min(parts.len() - 1)])
        };
        (part(2) * self.parts[1] + part(1)) * self.parts[0] + part(0)
    }

    /// Whether an event of a later round can be at this place and time.
    pub fn expects(&self, x: [f32; 3], time: f32) -> bool {
        self.fronts[self.block_at(x)].expects(x, time)
    }
}

/// Cuts the grid into this number of blocks along each axis, with about the same number of particles in each
/// part of an axis. `up_to` are, for each axis that is cut, the numbers of particles in cells with a lower
/// index, for each cell and the end. `rounds` gives and receives memory.
pub(crate) fn cut(
    metric: Metric,
    grid: &Grid,
    blocks: [usize; 3],
    up_to: impl Fn(usize) -> Vec<u64>,
    rounds: &mut Vec<Round>,
) {
    let planes = [0, 1, 2].map(|k| if blocks[k] > 1 { up_to(k) } else { Vec::new() });
    let faces = |k: usize, is_shifted: bool| -> Vec<i32> {
        let (count, shift) = (blocks[k] as u64, u64::from(is_shifted));
        let particles = planes[k].last().copied().unwrap_or(0);
        let face = |part: u64| {
            let target = particles * (2 * part + shift) / (2 * count);
            planes[k].iter().position(|&sum| sum >= target).unwrap_or(0) as i32
        };
        if count > 1 { (0..count).map(face).collect() } else { Vec::new() }
    };
    let shifts = shifts(blocks);
    rounds.resize_with(shifts.len() + 1, Round::default);
    let all = shifts.iter().map(|shift| [0, 1, 2].map(|k| faces(k, shift[k])));
    for (round, faces) in rounds.iter_mut().zip(all.chain([Default::default()])) {
        *round = Round::new(metric, grid, &faces, round);
    }
}

/// The parts between these faces along an axis of `n` cells: the first cell, the end, and whether another
/// part is beyond each side.
fn parts(faces: &[i32], n: i32, wraps: bool) -> Vec<(i32, i32, [bool; 2])> {
    if faces.is_empty() {
        return vec![(0, n, [false; 2])];
    }
    if wraps {
        let ends = faces[1..].iter().copied().chain([faces[0] + n]);
        return faces.iter().zip(ends).map(|(&first, end)| (first, end, [true; 2])).collect();
    }
    let mut inner: Vec<i32> = faces.iter().copied().filter(|&face| face > 0 && face < n).collect();
    inner.dedup();
    let firsts = [0].into_iter().chain(inner.iter().copied());
    let ends = inner.iter().copied().chain([n]);
    firsts.zip(ends).map(|(first, end)| (first, end, [first > 0, end < n])).collect()
}

/// The numbers of blocks along each axis of a box of these lengths: at most `most` blocks, none thinner than
/// `thickness`, with the smallest faces in total.
pub(crate) fn divide(lengths: [f32; 3], most: usize, thickness: f32) -> [usize; 3] {
    let largest = lengths.map(|length| ((length / thickness) as usize).max(1));
    let faces = |blocks: [usize; 3]| -> f32 {
        (0..3).filter(|&k| blocks[k] > 1).map(|k| blocks[k] as f32 / lengths[k]).sum()
    };
    for count in (2..=most).rev() {
        let mut best: Option<[usize; 3]> = None;
        for z in (1..=count).filter(|z| count % z == 0) {
            for y in (1..=count / z).filter(|y| (count / z) % y == 0) {
                let blocks = [count / z / y, y, z];
                let fits = (0..3).all(|k| blocks[k] == 1 || blocks[k] <= largest[k]);
                // Of equal ones, the one with the fewest axes that are cut, and these the last ones.
                if fits && best.is_none_or(|best| faces(blocks) <= 1.0001 * faces(best)) {
                    best = Some(blocks);
                }
            }
        }
        if let Some(best) = best {
            return best;
        }
    }
    [1; 3]
}

/// Along which axes each round is shifted, but the last one, for these numbers of blocks.
fn shifts(blocks: [usize; 3]) -> Vec<[bool; 3]> {
    let all: Vec<[bool; 3]> = (0..8_u32)
        .map(|bits| [0, 1, 2].map(|k| bits >> k & 1 == 1))
        .filter(|shift| (0..3).all(|k| blocks[k] > 1 || !shift[k]))
        .collect();
    let (first, rest) = all.split_first().expect("a round without a shift");
    let Some((last, rest)) = rest.split_last() else { return vec![*first] };
    [*first, *last].into_iter().chain(rest.iter().copied()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blocks_are_thick_and_have_small_faces() {
        assert_eq!(divide([100.0; 3], 2, 20.0), [1, 1, 2]);
        assert_eq!(divide([100.0; 3], 4, 20.0), [1, 1, 4]);
        assert_eq!(divide([100.0; 3], 6, 20.0), [1, 2, 3]);
        assert_eq!(divide([300.0; 3], 16, 20.0), [1, 4, 4]);
        assert_eq!(divide([300.0; 3], 64, 20.0), [4, 4, 4]);
        // Seven blocks would need slabs that are too thin.
        assert_eq!(divide([100.0; 3], 7, 20.0), [1, 2, 3]);
        assert_eq!(divide([30.0; 3], 8, 20.0), [1; 3]);
        assert_eq!(divide([1000.0, 10.0, 10.0], 8, 20.0), [8, 1, 1]);
        assert_eq!(divide([1000.0, 1000.0, 0.0], 16, 20.0), [4, 4, 1]);
    }

    #[test]
    fn the_second_round_is_shifted_along_all_axes() {
        assert_eq!(shifts([1, 1, 2]), [[false; 3], [false, false, true]]);
        let two = shifts([1, 4, 4]);
        assert_eq!(two[..2], [[false; 3], [false, true, true]]);
        assert_eq!((two.len(), shifts([2, 2, 2]).len(), shifts([1; 3]).len()), (4, 8, 1));
    }

    #[test]
    fn parts_fill_an_axis() {
        assert_eq!(parts(&[], 9, true), [(0, 9, [false; 2])]);
        assert_eq!(parts(&[0, 5], 9, true), [(0, 5, [true; 2]), (5, 9, [true; 2])]);
        assert_eq!(parts(&[2, 7], 9, true), [(2, 7, [true; 2]), (7, 11, [true; 2])]);
        assert_eq!(parts(&[0, 5], 9, false), [(0, 5, [false, true]), (5, 9, [true, false])]);
        let three = [(0, 2, [false, true]), (2, 7, [true; 2]), (7, 9, [true, false])];
        assert_eq!(parts(&[2, 7], 9, false), three);
    }
}
