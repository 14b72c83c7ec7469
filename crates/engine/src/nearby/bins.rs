/*!
Bins of centers, whole vectors of them.

A bin is at least as wide as a search reaches, so that a search looks at a bin and those around it, three
along each axis. It is a chain of blocks of eight places, with the coordinates of the centers in them; places
without one hold the sentinel.
*/

use haff_neighbors::with_huge_pages;

use super::sets::{LANES, place_of};

/// No particle, and no block.
const NONE: u32 = u32::MAX;
/// Bins are a little wider than they have to be, because of the rounding of their own width.
const WIDER: f64 = 1.0 + 1e-6;
/// Centers that a bin shall have at least: eight find room in its first block, and empty places cost memory.
const PER_BIN: f64 = 4.5;
/// There are no more bins than particles, unless they are few in all.
const FEW: usize = 4096;
/// Most bins along an axis.
const MOST: f64 = 65_536.0;

/// Eight places.
#[derive(Debug, Clone, Copy)]
#[repr(C, align(64))]
struct Block {
    x: [[i32; LANES]; 3],
    id: [u32; LANES],
}

const EMPTY: Block = Block { x: [[0; LANES]; 3], id: [NONE; LANES] };

/// Bins that a search reads, at most, and the room for the particles that it may find in their first blocks.
const AROUND: usize = 27;
const ROOM: usize = (AROUND + 1) * LANES;

/// Bins of centers.
#[derive(Debug, Clone, Default)]
pub(super) struct Bins {
    /// Bins per axis; one where nothing moves.
    n: [i64; 3],
    /// Halvings that fold the box onto the bins.
    fold: [u32; 3],
    /// How many a search looks at along each axis.
    span: [usize; 3],
    /// Largest contact distances per coordinate.
    unit: [f32; 3],
    /// Those of the bins in order, and then others that full ones go on in.
    blocks: Vec<Block>,
    /// The block that goes on.
    next: Vec<u32>,
}

impl Bins {
    /// Bins of `particles` centers at this mean `spacing` for searches up to `reach` in a box with these
    /// edges, zero along an axis without motion [largest contact distances]. Where most of them would be
    /// empty, the box is folded onto fewer.
    pub fn new(edges: [f64; 3], unit: [f32; 3], reach: f64, spacing: f64, particles: usize) -> Self {
        let axes = edges.iter().filter(|edge| **edge > 0.0).count();
        let width = (reach * WIDER).max(libm::pow(PER_BIN, 1.0 / axes as f64) * spacing);
        let most = particles.max(FEW) as f64;
        let mut n = edges.map(|edge| (edge / width).max(1.0).floor());
        let mut fold = [0; 3];
        while n.iter().product::<f64>() > most || n.iter().any(|&n| n > MOST) {
            let longest = (0..3).max_by(|&a, &b| n[a].total_cmp(&n[b])).unwrap_or(0);
            n[longest] = (0.5 * n[longest]).floor();
            fold[longest] += 1;
        }
        let n = n.map(|n| n as i64);
        // Two bins along an axis are both looked at, each once.
        let span = n.map(|n| n.min(3) as usize);
        let count = n.iter().product::<i64>() as usize;
        let mut blocks = with_huge_pages(count + count / 64);
        blocks.resize(count, EMPTY);
        Self { n, fold, span, unit, blocks, next: vec![NONE; count] }
    }

    /// The bin of a center along an axis.
    #[inline(always)]
    fn cell(&self, axis: usize, x: i32) -> i64 {
        (i64::from((x as u32) << self.fold[axis]) * self.n[axis]) >> 32
    }

    #[inline(always)]
    fn bin(&self, x: [i32; 3]) -> usize {
        let [cx, cy, cz] = [self.cell(0, x[0]), self.cell(1, x[1]), self.cell(2, x[2])];
        ((cz * self.n[1] + cy) * self.n[0] + cx) as usize
    }

    /// Enters a center. Of `VECTORS` here and below the same holds as of [`Self::near`].
    #[inline(always)]
    pub fn enter<const VECTORS: bool>(&mut self, i: u32, x: [i32; 3]) {
        let mut at = self.bin(x);
        loop {
            let block = &mut self.blocks[at];
            if let Some(place) = place_of::<VECTORS>(&block.id, NONE) {
                block.id[place] = i;
                for axis in 0..3 {
                    block.x[axis][place] = x[axis];
                }
                return;
            }
            if self.next[at] == NONE {
                self.next[at] = self.blocks.len() as u32;
                self.blocks.push(EMPTY);
                self.next.push(NONE);
            }
            at = self.next[at] as usize;
        }
    }

    /// Takes a center out.
    #[inline(always)]
    pub fn leave<const VECTORS: bool>(&mut self, i: u32, x: [i32; 3]) {
        let mut at = self.bin(x);
        loop {
            let block = &mut self.blocks[at];
            if let Some(place) = place_of::<VECTORS>(&block.id, i) {
                block.id[place] = NONE;
                return;
            }
            if self.next[at] == NONE {
                return;
            }
            at = self.next[at] as usize;
        }
    }

    /// Finds all centers nearer to `x` than the root of `reach2` [largest contact distances], which is no
    /// more than bins are wide. `found` is working space, in which they stand first; returns their number.
    ///
    /// With `VECTORS` set the caller must be compiled for AVX2 and FMA, and run where they exist.
    #[inline(always)]
    pub fn near<const VECTORS: bool>(&self, x: [i32; 3], reach2: f32, found: &mut Vec<u32>) -> usize {
        let mut cells = [[0_i64; 3]; 3];
        for axis in 0..3 {
            let (n, home) = (self.n[axis], self.cell(axis, x[axis]));
            let before = if home == 0 { n - 1 } else { home - 1 };
            let after = if home == n - 1 { 0 } else { home + 1 };
            cells[axis] = if n == 2 { [home, 1 - home, home] } else { [home, before, after] };
        }
        if found.len() < ROOM {
            found.resize(ROOM, 0);
        }
        let here = Here { x, unit: self.unit, reach2 };
        let mut longer = [NONE; AROUND + 1];
        let (mut count, mut chains) = (0, 0);
        let (blocks, next) = (&self.blocks[..], &self.next[..]);
        for &z in &cells[2][..self.span[2]] {
            for &y in &cells[1][..self.span[1]] {
                let row = (z * self.n[1] + y) * self.n[0];
                for &cell in &cells[0][..self.span[0]] {
                    let at = (row + cell) as usize;
                    debug_assert!(at < next.len() && count + LANES <= found.len() && chains < longer.len());
                    // SAFETY: cells along each axis are fewer than `n`, of whose product there are blocks;
                    // there is room for all of `AROUND` blocks, and one more chain than these.
                    unsafe {
                        let room = &mut *found.as_mut_ptr().add(count).cast::<[u32; LANES]>();
                        count += here.pick::<VECTORS>(blocks.get_unchecked(at), room);
                        // Counted without a branch: it cannot be predicted.
                        let next = *next.get_unchecked(at);
                        *longer.get_unchecked_mut(chains) = next;
                        chains += usize::from(next != NONE);
                    }
                }
            }
        }
        for &first in &longer[..chains] {
            let mut at = first;
            while at != NONE {
                if found.len() < count + LANES {
                    found.resize(2 * found.len(), 0);
                }
                if let Some(room) = found[count..].first_chunk_mut() {
                    count += here.pick::<VECTORS>(&blocks[at as usize], room);
                }
                at = next[at as usize];
            }
        }
        count
    }
}

/// What bins are searched for.
#[derive(Clone, Copy)]
struct Here {
    x: [i32; 3],
    unit: [f32; 3],
    reach2: f32,
}

impl Here {
    /// Copies those of a block that are near enough into `room`; their number.
    #[inline(always)]
    fn pick<const VECTORS: bool>(&self, block: &Block, room: &mut [u32; LANES]) -> usize {
        #[cfg(target_arch = "x86_64")]
        if VECTORS {
            // SAFETY: the caller has the features.
            return unsafe { avx2::pick(block, self, room) };
        }
        let mut count = 0;
        for k in 0..LANES {
            let there = [0, 1, 2].map(|axis| block.x[axis][k]);
            if block.id[k] != NONE && distance2(there, self.x, self.unit) < self.reach2 {
                room[count] = block.id[k];
                count += 1;
            }
        }
        count
    }
}

/// Square of the distance of two places; the same bits from either side [largest contact distances].
#[inline(always)]
fn distance2(a: [i32; 3], b: [i32; 3], unit: [f32; 3]) -> f32 {
    let mut sum = 0.0;
    for axis in 0..3 {
        let d = a[axis].wrapping_sub(b[axis]) as f32 * unit[axis];
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

    use super::{Block, Here, LANES};

    /// Per mask of lanes the lanes that are set, first.
    static FIRST: [[u8; LANES]; 256] = {
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

    /// The arithmetic of `super::distance2`, eight centers at a time; nothing depends on a branch.
    #[target_feature(enable = "avx2,fma")]
    #[inline]
    pub(super) fn pick(block: &Block, here: &Here, room: &mut [u32; LANES]) -> usize {
        let square = |axis: usize| {
            // SAFETY: eight words; blocks are aligned to 64 bytes.
            let there = unsafe { _mm256_load_si256(block.x[axis].as_ptr().cast()) };
            let d = _mm256_cvtepi32_ps(_mm256_sub_epi32(there, _mm256_set1_epi32(here.x[axis])));
            let d = _mm256_mul_ps(d, _mm256_set1_ps(here.unit[axis]));
            _mm256_mul_ps(d, d)
        };
        let d2 = _mm256_add_ps(_mm256_add_ps(square(0), square(1)), square(2));
        // SAFETY: as above.
        let id = unsafe { _mm256_load_si256(block.id.as_ptr().cast()) };
        let empty = _mm256_castsi256_ps(_mm256_cmpeq_epi32(id, _mm256_set1_epi32(-1)));
        let near = _mm256_cmp_ps::<_CMP_LT_OQ>(d2, _mm256_set1_ps(here.reach2));
        let mask = _mm256_movemask_ps(_mm256_andnot_ps(empty, near)) as usize;
        // SAFETY: eight bytes of the table.
        let first = unsafe { _mm_loadl_epi64(FIRST[mask].as_ptr().cast()) };
        let picked = _mm256_permutevar8x32_epi32(id, _mm256_cvtepu8_epi32(first));
        // SAFETY: there is room for eight words.
        unsafe { _mm256_storeu_si256(room.as_mut_ptr().cast(), picked) };
        mask.count_ones() as usize
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A linear congruential generator, whose upper half is random enough for places.
    fn next(state: &mut u64) -> i32 {
        *state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (*state >> 32) as i32
    }

    /// Bins of one, two and many along an axis, of which some overflow, and bins that a large box with a
    /// clump in it is folded onto; centers move about.
    #[test]
    fn all_that_are_near_are_found_once() {
        let mut state = 1;
        for edges in
            [[8.0, 8.0, 8.0], [4.1, 12.0, 6.5], [5.0, 9.0, 0.0], [30.0, 6.0, 5.0], [640.0, 5000.0, 320.0]]
        {
            let unit = edges.map(|edge| if edge > 0.0 { (edge / 2.0_f64.powi(32)) as f32 } else { 1.0 });
            let reach = 2.0_f32;
            let mut bins = Bins::new(edges, unit, f64::from(reach), 1.0, 600);
            let mut place = |axis: usize| {
                // Clumps of about ten.
                let empty = (edges[axis] / 10.0).max(1.0).log2() as u32;
                if edges[axis] > 0.0 { next(&mut state) >> empty } else { 0 }
            };
            let mut centers: Vec<[i32; 3]> = (0..600).map(|_| [0, 1, 2].map(&mut place)).collect();
            for (i, x) in centers.iter().enumerate() {
                bins.enter::<false>(i as u32, *x);
            }
            let mut total = 0;
            for i in 0..centers.len() {
                bins.leave::<false>(i as u32, centers[i]);
                centers[i] = [0, 1, 2].map(&mut place);
                bins.enter::<false>(i as u32, centers[i]);
                let x = centers[i];
                let mut expected: Vec<u32> =
                    (0..600).filter(|&j| distance2(centers[j as usize], x, unit) < reach * reach).collect();
                expected.sort_unstable();
                let mut found = Vec::new();
                let count = bins.near::<false>(x, reach * reach, &mut found);
                found.truncate(count);
                found.sort_unstable();
                assert_eq!(found, expected, "{edges:?}, {i}");
                #[cfg(target_arch = "x86_64")]
                if is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma") {
                    let mut found = Vec::new();
                    // SAFETY: the features have just been found.
                    let count = unsafe { near_avx2(&bins, x, reach * reach, &mut found) };
                    found.truncate(count);
                    found.sort_unstable();
                    assert_eq!(found, expected, "{edges:?}, {i}, vectors");
                }
                total += expected.len();
            }
            assert!(total > 3 * 600, "{edges:?}: {total}");
        }
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2,fma")]
    fn near_avx2(bins: &Bins, x: [i32; 3], reach2: f32, found: &mut Vec<u32>) -> usize {
        bins.near::<true>(x, reach2, found)
    }
}
