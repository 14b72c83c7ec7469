/*!
The filter: it selects the pairs that could touch within the window.

Let r be the relative position of a pair at the start of the window, v its relative displacement within the
window, and f(θ) = |r + v θ|² − σ² for 0 ≤ θ ≤ 1. The pair could touch at or after θ₀ if f has real roots, the
first root is not after θ = 1, and the second root is not before θ = θ₀:

```text
f(θ) = c + 2 b θ + v² θ²,   c = r² − σ²,  b = r·v
b² ≥ c v²                        f has real roots
−b ≤ v²   or  f(1)  ≤ 0          the first root is not after the end
−b ≥ θ₀v² or  f(θ₀) ≤ 0          the second root is not before the start
```

σ is widened by a [`margin`] that covers the rounding in single precision. No pair is rejected by the sign of
r·v alone: the exact prediction decides whether a touching pair approaches.
*/

use haff_neighbors::Array;

use crate::{
    model::features::Features,
    search::compact::{CompactParticle, LANES},
};

use super::{
    axes::{Axes, Tilt},
    cells::{Candidates, Cells},
    tune::Work,
};

/// Smallest relative widening of contact distances: 10⁻³ costs 0.3 % more exact predictions.
const MIN_MARGIN: f64 = 1e-3;
/// Rounding error of the squared relative displacement, relative to that square: 1.5 times the ε of `f32`.
/// Without this term the filter rejects grazing contacts beyond displacements of 150 contact distances
/// (benches/record/throughput.md).
const ROUNDING: f64 = 1.8e-7;
/// Largest displacement of a particle within a window [smallest contact distances]: up to here the margin
/// without the rounding of coordinates is below 5 %.
pub(super) const MAX_DISPLACEMENT: f64 = 250.0;
/// Displacement [smallest contact distances] up to which this margin is below 1.5 times [`MIN_MARGIN`].
pub(super) const SHORT_DISPLACEMENT: f64 = 25.0;

/// Factor by which contact distances are widened if no particle is displaced by more than `displacement`
/// within the window, and coordinates have a rounding error of up to `rounding` [both in smallest contact
/// distances].
pub(super) fn margin(displacement: f64, rounding: f64) -> f32 {
    // The relative displacement of two particles is up to twice that of one.
    let relative = 2.0 * displacement;
    (1.0 + MIN_MARGIN + ROUNDING * relative * relative + rounding) as f32
}

/// A particle whose partners are searched for.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct WindowQuery {
    pub slot: u32,
    pub compact: CompactParticle,
    /// Position at the start of the search [coordinates].
    pub start: [i32; 3],
    /// Start of the search, as a fraction of the window.
    pub from: f32,
}

/// Working space of searches.
#[derive(Debug, Clone)]
pub(super) struct Scratch {
    candidates: Candidates,
    masks: Vec<u8>,
    /// Pairs that have passed the filter: the index of a query, and the slot found by its search.
    pub pairs: Vec<(u32, u32)>,
    /// Work done so far.
    pub work: Work,
}

impl Scratch {
    pub fn new() -> Self {
        Self { candidates: Candidates::new(), masks: Vec::new(), pairs: Vec::new(), work: Work::default() }
    }

    /// Adds the pairs of this many vectors from their masks, which are followed by at least one word of
    /// zeros.
    #[cfg(target_arch = "x86_64")]
    #[inline(always)]
    fn collect(&mut self, vectors: usize) {
        let Self { candidates: Candidates { slots, owner, .. }, masks, pairs, .. } = self;
        let (slots, owner) = (&slots[..vectors * LANES], &owner[..vectors]);
        pairs.reserve(slots.len());
        let (to, mut count) = (pairs.as_mut_ptr(), pairs.len());
        for (word, bytes) in masks[..vectors.next_multiple_of(LANES)].chunks_exact(LANES).enumerate() {
            let mut bits = bytes.try_into().map_or(0, u64::from_le_bytes);
            while bits != 0 {
                let k = word * 64 + bits.trailing_zeros() as usize;
                bits &= bits - 1;
                debug_assert!(k < slots.len() && count < pairs.capacity());
                // SAFETY: no mask beyond these vectors has a bit set, so that `k` is an index of `slots` and
                // `k / LANES` an index of `owner`; `pairs` has capacity for one more pair per slot.
                unsafe {
                    to.add(count).write((*owner.get_unchecked(k / LANES), *slots.get_unchecked(k)));
                }
                count += 1;
            }
        }
        // SAFETY: the loop has written all pairs up to `count`.
        unsafe { pairs.set_len(count) };
    }
}

/// Finds all particles that the queries could touch in the rest of the window.
///
/// With `HALF`, a pair is found only by the query of its particle with the lower cell in `lowest`, the lowest
/// cell that each slot is registered in. Every pair is found if all particles are queried.
///
/// With `VECTORS`, the caller must be compiled for AVX2 and FMA, and run on a processor that has them.
#[inline(always)]
pub(super) fn search<F: Features, const HALF: bool, const VECTORS: bool>(
    particles: &Array<CompactParticle>,
    cells: &Cells,
    lowest: &[u32],
    common_radius: f32,
    queries: &[WindowQuery],
    scratch: &mut Scratch,
) {
    scratch.pairs.clear();
    scratch.candidates.len = 0;
    for (search, query) in queries.iter().enumerate() {
        let WindowQuery { slot, start, from, compact: CompactParticle { v, radius, .. } } = *query;
        let v = if F::DEFORMS { cells.axes.tilt.chord(v, from) } else { v };
        let extent = if F::UNIFORM { 0.0 } else { radius - common_radius };
        let reach = [radius + common_radius, extent];
        let low = if HALF { lowest[slot as usize] } else { 0 };
        cells.gather::<HALF>(search as u32, slot, start, v, 1.0 - from, reach, low, &mut scratch.candidates);
    }
    scratch.work.searches += queries.len() as u64;
    scratch.work.candidates += scratch.candidates.len as u64;
    scratch.work.blocks += std::mem::take(&mut scratch.candidates.blocks);
    if VECTORS {
        #[cfg(target_arch = "x86_64")]
        // SAFETY: the caller guarantees that the processor has AVX2 and FMA.
        unsafe {
            avx2::filter::<F>(particles, &cells.axes, queries, scratch);
        }
    } else {
        let Candidates { slots, owner, len, .. } = &scratch.candidates;
        for k in 0..*len {
            let (search, slot) = (owner[k / LANES], slots[k]);
            let query = &queries[search as usize];
            if slot != query.slot && passes::<F>(&particles[slot as usize], &cells.axes, query) {
                scratch.pairs.push((search, slot));
            }
        }
    }
    // A particle that is registered in several cells can be found several times. Most repetitions are among
    // the last four pairs and are removed here without a branch. The others are predicted twice, which is
    // harmless: the second event is dropped as invalidated.
    let pairs = &mut scratch.pairs;
    let mut last = [u64::MAX; 4];
    let mut kept = 0;
    for k in 0..pairs.len() {
        let pair @ (search, slot) = pairs[k];
        let key = u64::from(search) << 32 | u64::from(slot);
        let repeated = last.iter().fold(0, |repeated, &before| repeated | u8::from(before == key));
        let own = queries[search as usize].slot;
        let below = HALF && (lowest[slot as usize], slot) < (lowest[own as usize], own);
        last[k % 4] = key;
        pairs[kept] = pair;
        kept += usize::from(repeated | u8::from(below) == 0);
    }
    pairs.truncate(kept);
}

/// The filter for one candidate: the scalar reference of the vector filter.
#[expect(clippy::neg_cmp_op_on_partial_ord, reason = "NaN passes")]
#[inline(always)]
fn passes<F: Features>(other: &CompactParticle, axes: &Axes, query: &WindowQuery) -> bool {
    let own = &query.compact;
    let sigma = own.radius + if F::UNIFORM { own.radius } else { other.radius };
    let (mut r, mut v) = ([0.0; 3], [0.0; 3]);
    for axis in 0..3 {
        r[axis] = other.x[axis].wrapping_sub(own.x[axis]) as f32 * axes.unit[axis];
        v[axis] = other.v[axis] - own.v[axis];
    }
    if F::DEFORMS {
        let Tilt { start, change, stretch, .. } = axes.tilt;
        r[0] += start * r[1];
        v[0] += start * v[1] + change * r[1];
        for axis in 0..3 {
            v[axis] += stretch[axis] * r[axis];
        }
    }
    let (mut b, mut rr, mut vv) = (0.0, 0.0, 0.0);
    for axis in 0..3 {
        b += r[axis] * v[axis];
        rr += r[axis] * r[axis];
        vv += v[axis] * v[axis];
    }
    let c = rr - sigma * sigma;
    let two = b + b;
    let end = c + (two + vv);
    let begin = c + query.from * (two + query.from * vv);
    let first = (-b - vv).min(end);
    let second = (query.from * vv + b).min(begin);
    // An overflow leads to NaN, which is not greater than zero: the pair passes.
    let largest = (c * vv - b * b).max(first).max(second);
    !(largest > 0.0)
}

#[cfg(target_arch = "x86_64")]
mod avx2 {
    use std::arch::x86_64::{
        __m256, _CMP_NGT_UQ, _mm256_add_ps, _mm256_andnot_ps, _mm256_castsi256_ps, _mm256_cmp_ps,
        _mm256_cmpeq_epi32, _mm256_cvtepi32_ps, _mm256_fmadd_ps, _mm256_fmsub_ps, _mm256_fnmadd_ps,
        _mm256_loadu_si256, _mm256_max_ps, _mm256_min_ps, _mm256_movemask_ps, _mm256_mul_ps,
        _mm256_set1_epi32, _mm256_set1_ps, _mm256_setzero_ps, _mm256_sub_epi32, _mm256_sub_ps,
    };

    use haff_neighbors::{Array, Elements};

    use super::{Axes, Features, LANES, Scratch, WindowQuery};
    use crate::search::compact::{
        CompactParticle,
        avx2::{Eight, load_whole},
    };

    /// Tests eight candidates at a time: their particles are loaded whole and transposed in registers. The
    /// masks are evaluated after all tests: with a branch on each mask windows reached 0.86 instead of 1.09
    /// million collisions per second (benches/record/throughput.md).
    #[target_feature(enable = "avx2,fma")]
    #[inline]
    pub(super) fn filter<F: Features>(
        particles: &Array<CompactParticle>,
        axes: &Axes,
        queries: &[WindowQuery],
        scratch: &mut Scratch,
    ) {
        let candidates = &scratch.candidates;
        let vectors = candidates.len / LANES;
        let masks = &mut scratch.masks;
        if masks.len() < vectors + LANES {
            masks.resize(2 * vectors + LANES, 0);
        }
        let unit = axes.unit.map(|unit| _mm256_set1_ps(unit));
        let [a, b, c] = axes.tilt.stretch;
        let tilt = [axes.tilt.start, axes.tilt.change, a, b, c].map(|tilt| _mm256_set1_ps(tilt));
        let owner = &candidates.owner[..vectors];
        let start = particles.start();
        for ((slots, &owner), mask) in
            candidates.slots[..candidates.len].chunks_exact(LANES).zip(owner).zip(&mut masks[..vectors])
        {
            debug_assert!(slots.iter().all(|&slot| (slot as usize) < particles.len()));
            // SAFETY: cells hold only indices of slots, which are indices of `particles`; `slots` has eight
            // elements.
            let others = unsafe { load_whole(start, slots) };
            *mask = test::<F>(&others, unit, tilt, &queries[owner as usize], slots);
        }
        masks[vectors..vectors + LANES].fill(0);
        scratch.collect(vectors);
    }

    /// The mask of those of eight slots that pass.
    #[target_feature(enable = "avx2,fma")]
    #[inline]
    fn test<F: Features>(
        others: &Eight,
        unit: [__m256; 3],
        tilt: [__m256; 5],
        query: &WindowQuery,
        slots: &[u32],
    ) -> u8 {
        let own = &query.compact;
        let difference = |axis: usize| {
            let r = _mm256_sub_epi32(others.x[axis], _mm256_set1_epi32(own.x[axis]));
            _mm256_mul_ps(_mm256_cvtepi32_ps(r), unit[axis])
        };
        let (mut x, y, z) = (difference(0), difference(1), difference(2));
        let mut u = _mm256_sub_ps(others.v[0], _mm256_set1_ps(own.v[0]));
        let mut v = _mm256_sub_ps(others.v[1], _mm256_set1_ps(own.v[1]));
        let mut w = _mm256_sub_ps(others.v[2], _mm256_set1_ps(own.v[2]));
        if F::DEFORMS {
            let [start, change, a, b, c] = tilt;
            x = _mm256_fmadd_ps(start, y, x);
            u = _mm256_fmadd_ps(change, y, _mm256_fmadd_ps(start, v, u));
            u = _mm256_fmadd_ps(a, x, u);
            v = _mm256_fmadd_ps(b, y, v);
            w = _mm256_fmadd_ps(c, z, w);
        }
        let sigma = if F::UNIFORM {
            _mm256_set1_ps(own.radius + own.radius)
        } else {
            _mm256_add_ps(others.radius, _mm256_set1_ps(own.radius))
        };
        let from = _mm256_set1_ps(query.from);
        let zero = _mm256_setzero_ps();
        let b = _mm256_fmadd_ps(z, w, _mm256_fmadd_ps(y, v, _mm256_mul_ps(x, u)));
        let vv = _mm256_fmadd_ps(w, w, _mm256_fmadd_ps(v, v, _mm256_mul_ps(u, u)));
        let rr = _mm256_fmadd_ps(z, z, _mm256_fmadd_ps(y, y, _mm256_mul_ps(x, x)));
        let c = _mm256_fnmadd_ps(sigma, sigma, rr);
        let two = _mm256_add_ps(b, b);
        let end = _mm256_add_ps(c, _mm256_add_ps(two, vv));
        let minus_slope = _mm256_sub_ps(zero, _mm256_add_ps(b, vv));
        let first = _mm256_min_ps(minus_slope, end);
        let begin = _mm256_fmadd_ps(from, _mm256_fmadd_ps(from, vv, two), c);
        let second = _mm256_min_ps(_mm256_fmadd_ps(from, vv, b), begin);
        let no_root = _mm256_fmsub_ps(c, vv, _mm256_mul_ps(b, b));
        let largest = _mm256_max_ps(_mm256_max_ps(first, second), no_root);
        let pass = _mm256_cmp_ps::<_CMP_NGT_UQ>(largest, zero);
        // SAFETY: `slots` has eight elements.
        let slots = unsafe { _mm256_loadu_si256(slots.as_ptr().cast()) };
        let own_slot = _mm256_castsi256_ps(_mm256_cmpeq_epi32(slots, _mm256_set1_epi32(query.slot as i32)));
        _mm256_movemask_ps(_mm256_andnot_ps(own_slot, pass)) as u8
    }
}

#[cfg(test)]
mod tests;
