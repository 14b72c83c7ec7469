/*!
Bins of reference positions, stored and searched as whole vectors.

A bin is at least as wide as the range of a search, so that a search reads its own bin and the bins around it,
three along each axis. A bin is a chain of blocks of eight slots with ids and coordinates. An empty slot has
the id [`NONE`].
*/

use haff_neighbors::{Array, Elements, with_huge_pages};

use crate::search::blocks::Grid;

use super::sets::{LANES, position_in};

/// No particle, and no block.
const NONE: u32 = u32::MAX;
/// Bins are wider than needed by this factor, which covers the rounding of their width.
const MARGIN: f64 = 1.0 + 1e-6;
/// Least mean number of reference positions per bin. The first block of a bin has space for eight; with fewer
/// reference positions per bin more slots would be empty, which costs memory.
const PER_BIN: f64 = 4.5;
/// The number of bins is limited to the number of particles, but never to less than this.
const FEW_BINS: usize = 4096;
/// Number of spare blocks that are lent to an alias.
const LENT: usize = 64;
/// Largest number of bins along an axis.
const MAX_PER_AXIS: f64 = 65_536.0;

/// Eight slots of a bin.
#[derive(Debug, Clone, Copy)]
#[repr(C, align(64))]
struct Slots {
    x: [[i32; LANES]; 3],
    id: [u32; LANES],
}

const EMPTY: Slots = Slots { x: [[0; LANES]; 3], id: [NONE; LANES] };

/// Largest number of bins that a search reads, and length of the working space that holds the particles found
/// in their first blocks.
const MAX_SEARCHED: usize = 27;
const WORKING_SPACE: usize = (MAX_SEARCHED + 1) * LANES;

/// The layout of all bins [largest contact distances].
pub(super) struct Layout {
    /// Edges of the box, 0 along an axis without motion.
    pub edges: [f64; 3],
    /// Largest contact distances per coordinate.
    pub unit: [f32; 3],
    /// The tilt with which distances are measured in a sheared box.
    pub tilt: f64,
    /// Distance beyond contact at which particles are neighbors.
    pub skin: f64,
    /// Mean distance of neighbors.
    pub spacing: f64,
}

/// Bins of reference positions.
#[derive(Debug, Clone, Default)]
pub(super) struct Bins {
    /// Bins per axis; one along an axis without motion.
    n: [i64; 3],
    /// log₂ of the number of times that the box is folded onto the bins along each axis.
    fold: [u32; 3],
    /// Number of bins that a search reads along each axis.
    searched: [usize; 3],
    /// Largest contact distances per coordinate.
    unit: [f32; 3],
    /// The tilt with which distances are measured in a sheared box.
    tilt: f32,
    /// The first block of every bin in the order of the bins, then the continuations of full blocks.
    blocks: Array<Slots>,
    /// For each block the next one of its chain, or [`NONE`].
    next: Array<u32>,
    /// Blocks that no chain uses.
    spare: Vec<u32>,
    /// Whether this is an alias for one thread of several, which uses only the spare blocks lent to it.
    is_alias: bool,
}

impl Bins {
    /// Bins for the reference positions of `particles`, with a mean distance `spacing` of neighbors, and for
    /// searches up to `reach`. `edges` are those of the box, zero along an axis without motion. All lengths
    /// are in largest contact distances. If most bins would be empty, the box is folded onto fewer bins.
    pub fn new(layout: &Layout, reach: f64, spacing: f64, particles: usize) -> Self {
        let &Layout { mut edges, unit, tilt, .. } = layout;
        // Two positions at a distance of 1 are up to √(1 + k²) apart along the axis of the flow.
        edges[0] /= (1.0 + tilt * tilt).sqrt();
        let axes = edges.iter().filter(|edge| **edge > 0.0).count();
        let width = (reach * MARGIN).max(libm::pow(PER_BIN, 1.0 / axes as f64) * spacing);
        let most = particles.max(FEW_BINS) as f64;
        let mut n = edges.map(|edge| (edge / width).max(1.0).floor());
        let mut fold = [0; 3];
        while n.iter().product::<f64>() > most || n.iter().any(|&n| n > MAX_PER_AXIS) {
            let longest = (0..3).max_by(|&a, &b| n[a].total_cmp(&n[b])).unwrap_or(0);
            n[longest] = (0.5 * n[longest]).floor();
            fold[longest] += 1;
        }
        let n = n.map(|n| n as i64);
        // If an axis has two bins, a search reads each of them once.
        let searched = n.map(|n| n.min(3) as usize);
        let count = n.iter().product::<i64>() as usize;
        let mut blocks = with_huge_pages(count + count / 64);
        blocks.resize(count, EMPTY);
        let next = vec![NONE; count].into();
        Self {
            n,
            fold,
            searched,
            unit,
            tilt: tilt as f32,
            blocks: blocks.into(),
            next,
            spare: Vec::new(),
            is_alias: false,
        }
    }

    /// Allocates the spare blocks of this number of aliases.
    pub fn reserve(&mut self, aliases: usize) {
        while self.spare.len() < aliases * LENT {
            self.add_block();
        }
    }

    /// The same bins for another thread, with [reserved](Self::reserve) spare blocks until they are
    /// [taken back](Self::take_back).
    ///
    /// # Safety
    ///
    /// As for [`Array::alias`]: no thread changes bins that another one uses.
    pub unsafe fn alias(&mut self) -> Self {
        let spare = self.spare.split_off(self.spare.len().saturating_sub(LENT));
        // SAFETY: guaranteed by the caller.
        unsafe {
            Self { blocks: self.blocks.alias(), next: self.next.alias(), spare, is_alias: true, ..*self }
        }
    }

    /// Takes back the blocks that an alias has not used.
    pub fn take_back(&mut self, alias: &mut Self) {
        self.spare.append(&mut alias.spare);
    }

    /// Adds a spare block.
    fn add_block(&mut self) {
        self.spare.push(self.blocks.len() as u32);
        self.blocks.change(|blocks| blocks.push(EMPTY));
        self.next.change(|next| next.push(NONE));
    }

    /// Width of the widest bins [largest contact distances].
    pub fn widest(&self, unit: [f32; 3]) -> f32 {
        let width = |k: usize| if self.n[k] > 1 { length(unit[k]) / self.n[k] as f32 } else { 0.0 };
        width(0).max(width(1)).max(width(2))
    }

    /// The grid of bins, in largest contact distances; `None` if the box is folded onto them. All axes are
    /// periodic: beyond the last bins of a bounded axis are the first ones, too.
    pub fn grid(&self, unit: [f32; 3]) -> Option<Grid> {
        (self.fold == [0; 3]).then(|| Grid {
            n: self.n.map(|n| n as i32),
            cells: [0, 1, 2].map(|k| if self.n[k] > 1 { self.n[k] as f32 / length(unit[k]) } else { 0.0 }),
            wraps: self.n.map(|n| n > 1),
        })
    }

    /// Index along an axis of the bin of a coordinate.
    #[inline(always)]
    fn cell(&self, axis: usize, x: i32) -> i64 {
        (i64::from((x as u32) << self.fold[axis]) * self.n[axis]) >> 32
    }

    /// Index of the bin of a position.
    #[inline(always)]
    fn bin(&self, x: [i32; 3]) -> usize {
        let [cx, cy, cz] = [self.cell(0, x[0]), self.cell(1, x[1]), self.cell(2, x[2])];
        ((cz * self.n[1] + cy) * self.n[0] + cx) as usize
    }

    /// Inserts the reference position x of particle i. Returns false if an alias has no space for it. For
    /// `VECTORS` see [`Self::near`].
    #[inline(always)]
    pub fn insert<const VECTORS: bool>(&mut self, i: u32, x: [i32; 3]) -> bool {
        let mut at = self.bin(x);
        loop {
            let block = &mut self.blocks[at];
            if let Some(slot) = position_in::<VECTORS>(&block.id, NONE) {
                block.id[slot] = i;
                for axis in 0..3 {
                    block.x[axis][slot] = x[axis];
                }
                return true;
            }
            if self.next[at] == NONE {
                if self.spare.is_empty() && !self.is_alias {
                    self.add_block();
                }
                let Some(block) = self.spare.pop() else { return false };
                self.next[at] = block;
            }
            at = self.next[at] as usize;
        }
    }

    /// Removes the reference position x of particle i.
    #[inline(always)]
    pub fn remove<const VECTORS: bool>(&mut self, i: u32, x: [i32; 3]) {
        let mut at = self.bin(x);
        loop {
            let block = &mut self.blocks[at];
            if let Some(slot) = position_in::<VECTORS>(&block.id, i) {
                block.id[slot] = NONE;
                return;
            }
            if self.next[at] == NONE {
                return;
            }
            at = self.next[at] as usize;
        }
    }

    /// Finds the ids of all reference positions that are closer to `x` than the root of `reach2` [largest
    /// contact distances], which must not exceed the width of a bin. Writes the ids to the start of `found`,
    /// which may grow, and returns their number.
    ///
    /// With `VECTORS` set the caller must be compiled for AVX2 and FMA, and run where they exist.
    #[inline(always)]
    pub fn near<const VECTORS: bool, const TILTED: bool>(
        &self,
        x: [i32; 3],
        reach2: f32,
        found: &mut Vec<u32>,
    ) -> usize {
        let mut cells = [[0_i64; 3]; 3];
        for axis in 0..3 {
            let (n, own) = (self.n[axis], self.cell(axis, x[axis]));
            let before = if own == 0 { n - 1 } else { own - 1 };
            let after = if own == n - 1 { 0 } else { own + 1 };
            cells[axis] = if n == 2 { [own, 1 - own, own] } else { [own, before, after] };
        }
        if found.len() < WORKING_SPACE {
            found.resize(WORKING_SPACE, 0);
        }
        let range = Range { x, unit: self.unit, tilt: if TILTED { self.tilt } else { 0.0 }, reach2 };
        let mut continuations = [NONE; MAX_SEARCHED + 1];
        let (mut count, mut chains) = (0, 0);
        let (blocks, next) = (self.blocks.start(), self.next.start());
        for &z in &cells[2][..self.searched[2]] {
            for &y in &cells[1][..self.searched[1]] {
                let row = (z * self.n[1] + y) * self.n[0];
                for &cell in &cells[0][..self.searched[0]] {
                    let at = (row + cell) as usize;
                    debug_assert!(
                        at < self.next.len() && count + LANES <= found.len() && chains < continuations.len()
                    );
                    // SAFETY: the index of a cell along each axis is less than its `n`, and there are at
                    // least as many `blocks`, each with its `next`, as the product of the three `n`. At most
                    // `MAX_SEARCHED` bins are read: `found` has space for eight ids from each of them, and
                    // `continuations` for one chain of each.
                    unsafe {
                        let target = &mut *found.as_mut_ptr().add(count).cast::<[u32; LANES]>();
                        count += range.select::<VECTORS, TILTED>(&*blocks.add(at), target);
                        // Counted without a branch, which the processor could not predict.
                        let next = *next.add(at);
                        *continuations.get_unchecked_mut(chains) = next;
                        chains += usize::from(next != NONE);
                    }
                }
            }
        }
        for &first in &continuations[..chains] {
            let mut at = first;
            while at != NONE {
                if found.len() < count + LANES {
                    found.resize(2 * found.len(), 0);
                }
                if let Some(target) = found[count..].first_chunk_mut() {
                    count += range.select::<VECTORS, TILTED>(&self.blocks[at as usize], target);
                }
                at = self.next[at as usize];
            }
        }
        count
    }

    /// [`Self::near`] for any `reach`. Adds the ids to `found`.
    #[cold]
    #[inline(never)]
    pub fn add_near(&self, x: [i32; 3], reach: f32, found: &mut Vec<u32>) {
        let cells = [0, 1, 2].map(|axis| {
            let n = self.n[axis];
            let stretch = if axis == 0 { (1.0 + self.tilt * self.tilt).sqrt() } else { 1.0 };
            let width = length(self.unit[axis]) / (n << self.fold[axis]) as f32 / stretch;
            // Rounded up, and one more: the position is anywhere in its bin.
            let around = if n == 1 { 0 } else { (reach / width) as i64 + 1 };
            let own = self.cell(axis, x[axis]);
            if 2 * around + 1 >= n { (0, n) } else { (own - around + n, 2 * around + 1) }
        });
        let range = Range { x, unit: self.unit, tilt: self.tilt, reach2: reach * reach };
        let along = |axis: usize| {
            let ((first, count), n) = (cells[axis], self.n[axis]);
            (first..first + count).map(move |cell| cell % n)
        };
        let mut near = [0; LANES];
        for z in along(2) {
            for y in along(1) {
                for cell in along(0) {
                    let mut at = ((z * self.n[1] + y) * self.n[0] + cell) as u32;
                    while at != NONE {
                        let count = range.select::<false, true>(&self.blocks[at as usize], &mut near);
                        found.extend_from_slice(&near[..count]);
                        at = self.next[at as usize];
                    }
                }
            }
        }
    }
}

/// The length after which coordinates repeat, from that of one coordinate [largest contact distances].
fn length(unit: f32) -> f32 {
    unit * 2.0_f32.powi(32)
}

/// The sphere that a search covers: its center in coordinates, the length of a coordinate, and the square of
/// its radius [largest contact distances].
#[derive(Clone, Copy)]
struct Range {
    x: [i32; 3],
    unit: [f32; 3],
    tilt: f32,
    reach2: f32,
}

impl Range {
    /// Copies the ids of a block that are within range to `target`, and returns their number.
    #[inline(always)]
    fn select<const VECTORS: bool, const TILTED: bool>(
        &self,
        block: &Slots,
        target: &mut [u32; LANES],
    ) -> usize {
        #[cfg(target_arch = "x86_64")]
        if VECTORS {
            // SAFETY: with `VECTORS` set the caller guarantees AVX2 and FMA.
            return unsafe { avx2::select::<TILTED>(block, self, target) };
        }
        let mut count = 0;
        for k in 0..LANES {
            let other = [0, 1, 2].map(|axis| block.x[axis][k]);
            if block.id[k] != NONE && distance2::<TILTED>(other, self.x, self.unit, self.tilt) < self.reach2 {
                target[count] = block.id[k];
                count += 1;
            }
        }
        count
    }
}

/// Square of the distance of two positions [largest contact distances]; the same bits for both orders.
#[inline(always)]
fn distance2<const TILTED: bool>(a: [i32; 3], b: [i32; 3], unit: [f32; 3], tilt: f32) -> f32 {
    let mut d = [0.0; 3];
    for axis in 0..3 {
        d[axis] = a[axis].wrapping_sub(b[axis]) as f32 * unit[axis];
    }
    if TILTED {
        d[0] += tilt * d[1];
    }
    let mut sum = 0.0;
    for d in d {
        sum += d * d;
    }
    sum
}

#[cfg(target_arch = "x86_64")]
mod avx2 {
    use std::arch::x86_64::{
        _CMP_LT_OQ, _mm_loadl_epi64, _mm256_add_ps, _mm256_andnot_ps, _mm256_castsi256_ps, _mm256_cmp_ps,
        _mm256_cmpeq_epi32, _mm256_cvtepi32_ps, _mm256_cvtepu8_epi32, _mm256_load_si256, _mm256_movemask_ps,
        _mm256_mul_ps, _mm256_permutevar8x32_epi32, _mm256_set1_epi32, _mm256_set1_ps, _mm256_storeu_si256,
        _mm256_sub_epi32,
    };

    use super::{LANES, Range, Slots};

    /// For every mask of eight lanes the indices of the lanes that are set, then zeros.
    static SET_LANES: [[u8; LANES]; 256] = {
        let mut table = [[0; LANES]; 256];
        let mut mask = 0;
        while mask < 256 {
            let (mut lane, mut count) = (0, 0);
            while lane < LANES {
                if mask >> lane & 1 == 1 {
                    table[mask][count] = lane as u8;
                    count += 1;
                }
                lane += 1;
            }
            mask += 1;
        }
        table
    };

    /// [`Range::select`] for eight slots at a time, with the arithmetic of `super::distance2` and without
    /// branches.
    #[target_feature(enable = "avx2,fma")]
    #[inline]
    pub(super) fn select<const TILTED: bool>(
        block: &Slots,
        range: &Range,
        target: &mut [u32; LANES],
    ) -> usize {
        let difference = |axis: usize| {
            // SAFETY: this loads eight words, and blocks are aligned to 64 bytes.
            let other = unsafe { _mm256_load_si256(block.x[axis].as_ptr().cast()) };
            let d = _mm256_cvtepi32_ps(_mm256_sub_epi32(other, _mm256_set1_epi32(range.x[axis])));
            _mm256_mul_ps(d, _mm256_set1_ps(range.unit[axis]))
        };
        let (mut x, y, z) = (difference(0), difference(1), difference(2));
        if TILTED {
            x = _mm256_add_ps(x, _mm256_mul_ps(_mm256_set1_ps(range.tilt), y));
        }
        let square = |d| _mm256_mul_ps(d, d);
        let d2 = _mm256_add_ps(_mm256_add_ps(square(x), square(y)), square(z));
        // SAFETY: as above.
        let id = unsafe { _mm256_load_si256(block.id.as_ptr().cast()) };
        let empty = _mm256_castsi256_ps(_mm256_cmpeq_epi32(id, _mm256_set1_epi32(-1)));
        let near = _mm256_cmp_ps::<_CMP_LT_OQ>(d2, _mm256_set1_ps(range.reach2));
        let mask = _mm256_movemask_ps(_mm256_andnot_ps(empty, near)) as usize;
        // SAFETY: this loads eight bytes, a whole row of the table.
        let lanes = unsafe { _mm_loadl_epi64(SET_LANES[mask].as_ptr().cast()) };
        let selected = _mm256_permutevar8x32_epi32(id, _mm256_cvtepu8_epi32(lanes));
        // SAFETY: `target` has space for eight words.
        unsafe { _mm256_storeu_si256(target.as_mut_ptr().cast(), selected) };
        mask.count_ones() as usize
    }
}

#[cfg(test)]
mod tests;
