/*!
The filter: which pairs may touch within the window.

With r and v of a pair at the start of the window (v: displacement within it), f(θ) = |r + v θ|² − σ² for 0 ≤
θ ≤ 1. The pair may touch after θ₀ if f has a root at all and one of [θ₀, 1] lies between or beyond its roots:

```text
f(θ) = c + 2 b θ + v² θ²,   c = r² − σ²,  b = r·v
b² ≥ c v²                        there are roots
−b ≤ v²   or  f(1)  ≤ 0          the first is not after the end
−b ≥ θ₀v² or  f(θ₀) ≤ 0          the second is not before the beginning
```

σ is widened by a [`margin`] for all that single precision rounds. No pair is rejected by the sign of r·v
alone: whether a touching pair approaches is for the exact prediction to say.
*/

use super::{
    cells::{Candidates, Cells},
    tune::Work,
};
use crate::{
    compact::{CompactParticle, LANES},
    features::Features,
};

/// Part by which contact distances are widened at least: 10⁻³ costs 0.3 % more exact predictions.
const LEAST_MARGIN: f64 = 1e-3;
/// What the squares of long ways round off, in squares of the way: 1.5 of f32's ε. From ways of 150 on, the
/// least margin alone was seen to miss grazing contacts.
const ROUNDING: f64 = 1.8e-7;
/// The farthest that particles may go within a window [least contact distances]: the margin stays below 5 %,
/// …
pub(super) const FARTHEST: f64 = 250.0;
/// … and how far they may go at little more than the least margin.
pub(super) const NEAR: f64 = 25.0;

/// Factor by which contact distances are widened if no particle moves further than this within the window
/// [least contact distances], and coordinates are rounded by so much. Two come apart at twice the speed of
/// one.
pub(super) fn margin(farthest: f64, rounding: f64) -> f32 {
    let way = 2.0 * farthest;
    (1.0 + LEAST_MARGIN + ROUNDING * way * way + rounding) as f32
}

/// A particle whose partners are looked for.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Query {
    pub slot: u32,
    pub compact: CompactParticle,
    /// Where it is at the start of the search [coordinates].
    pub start: [i32; 3],
    /// Start of the search, as a part of the window.
    pub from: f32,
}

/// Working space of searches.
#[derive(Debug, Clone)]
pub(super) struct Scratch {
    candidates: Candidates,
    masks: Vec<u8>,
    /// Candidate pairs: the number of a search, and the slot that it has found.
    pub pairs: Vec<(u32, u32)>,
    /// What has been done so far.
    pub work: Work,
}

impl Scratch {
    pub fn new() -> Self {
        Self { candidates: Candidates::new(), masks: Vec::new(), pairs: Vec::new(), work: Work::default() }
    }

    /// Collects the pairs of so many vectors from their masks, which are followed by a word of zeros at least.
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
                // SAFETY: no vector beyond those counted has a bit, and there is room for a hit of every
                // slot.
                unsafe {
                    to.add(count).write((*owner.get_unchecked(k / LANES), *slots.get_unchecked(k)));
                }
                count += 1;
            }
        }
        // SAFETY: so many have been written.
        unsafe { pairs.set_len(count) };
    }
}

/// Finds all particles that the queries may touch in what is left of the window, each once per query. With the
/// `lowest` cell of every slot and `HALF` set, of two that may touch the one whose lowest cell comes first
/// finds the other, which is enough if all are searched.
///
/// With `VECTORS` set the caller must be compiled for AVX2 and FMA, and run where they exist.
#[inline(always)]
pub(super) fn search<F: Features, const HALF: bool, const VECTORS: bool>(
    particles: &[CompactParticle],
    cells: &Cells,
    lowest: &[u32],
    common_radius: f32,
    queries: &[Query],
    scratch: &mut Scratch,
) {
    scratch.pairs.clear();
    scratch.candidates.len = 0;
    for (search, query) in queries.iter().enumerate() {
        let Query { slot, start, from, compact: CompactParticle { v, radius, .. } } = *query;
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
        // SAFETY: the caller has the features.
        unsafe {
            avx2::filter::<F>(particles, cells.axes.unit, queries, scratch);
        }
    } else {
        let Candidates { slots, owner, len, .. } = &scratch.candidates;
        for k in 0..*len {
            let (search, slot) = (owner[k / LANES], slots[k]);
            let query = &queries[search as usize];
            if slot != query.slot && passes::<F>(&particles[slot as usize], cells.axes.unit, query) {
                scratch.pairs.push((search, slot));
            }
        }
    }
    // Who is registered in several cells has been met several times. Most of them are found among the last
    // few, without a branch; those who are not are predicted twice, which does no harm.
    let pairs = &mut scratch.pairs;
    let mut last = [u64::MAX; 4];
    let mut kept = 0;
    for k in 0..pairs.len() {
        let pair @ (search, slot) = pairs[k];
        let key = u64::from(search) << 32 | u64::from(slot);
        let known = last.iter().fold(0, |known, &before| known | u8::from(before == key));
        let own = queries[search as usize].slot;
        let below = HALF && (lowest[slot as usize], slot) < (lowest[own as usize], own);
        last[k % 4] = key;
        pairs[kept] = pair;
        kept += usize::from(known | u8::from(below) == 0);
    }
    pairs.truncate(kept);
}

/// The filter for one candidate: the scalar reference of the vector filter.
#[expect(clippy::neg_cmp_op_on_partial_ord, reason = "what is not a number passes")]
#[inline(always)]
fn passes<F: Features>(other: &CompactParticle, unit: [f32; 3], query: &Query) -> bool {
    let own = &query.compact;
    let sigma = own.radius + if F::UNIFORM { own.radius } else { other.radius };
    let (mut b, mut rr, mut vv) = (0.0, 0.0, 0.0);
    for axis in 0..3 {
        let r = other.x[axis].wrapping_sub(own.x[axis]) as f32 * unit[axis];
        let v = other.v[axis] - own.v[axis];
        b += r * v;
        rr += r * r;
        vv += v * v;
    }
    let c = rr - sigma * sigma;
    let two = b + b;
    let end = c + (two + vv);
    let begin = c + query.from * (two + query.from * vv);
    let first = (-b - vv).min(end);
    let second = (query.from * vv + b).min(begin);
    // Overflow makes a NaN: not greater than zero, so it passes.
    let worst = (c * vv - b * b).max(first).max(second);
    !(worst > 0.0)
}

#[cfg(target_arch = "x86_64")]
mod avx2 {
    use std::arch::x86_64::{
        __m256, _CMP_NGT_UQ, _mm256_add_ps, _mm256_andnot_ps, _mm256_castsi256_ps, _mm256_cmp_ps,
        _mm256_cmpeq_epi32, _mm256_cvtepi32_ps, _mm256_fmadd_ps, _mm256_fmsub_ps, _mm256_fnmadd_ps,
        _mm256_loadu_si256, _mm256_max_ps, _mm256_min_ps, _mm256_movemask_ps, _mm256_mul_ps,
        _mm256_set1_epi32, _mm256_set1_ps, _mm256_setzero_ps, _mm256_sub_epi32, _mm256_sub_ps,
    };

    use super::{Features, LANES, Query, Scratch};
    use crate::compact::{CompactParticle, avx2::load_whole};

    /// Eight candidates at a time: their particles are loaded whole and transposed in registers. What has
    /// passed is looked at after all are tested, so that no test waits for a branch on the one before.
    #[target_feature(enable = "avx2,fma")]
    #[inline]
    pub(super) fn filter<F: Features>(
        particles: &[CompactParticle],
        unit: [f32; 3],
        queries: &[Query],
        scratch: &mut Scratch,
    ) {
        let candidates = &scratch.candidates;
        let vectors = candidates.len / LANES;
        let masks = &mut scratch.masks;
        if masks.len() < vectors + LANES {
            masks.resize(2 * vectors + LANES, 0);
        }
        let unit = unit.map(|unit| _mm256_set1_ps(unit));
        let owner = &candidates.owner[..vectors];
        for ((slots, &owner), mask) in
            candidates.slots[..candidates.len].chunks_exact(LANES).zip(owner).zip(&mut masks[..vectors])
        {
            *mask = test::<F>(particles, unit, &queries[owner as usize], slots);
        }
        masks[vectors..vectors + LANES].fill(0);
        scratch.collect(vectors);
    }

    /// Which of eight slots pass.
    #[target_feature(enable = "avx2,fma")]
    #[inline]
    fn test<F: Features>(
        particles: &[CompactParticle],
        unit: [__m256; 3],
        query: &Query,
        slots: &[u32],
    ) -> u8 {
        let own = &query.compact;
        // SAFETY: what is registered in cells is a slot; `slots` are eight.
        let others = unsafe { load_whole(particles, slots) };
        let difference = |axis: usize| {
            let r = _mm256_sub_epi32(others.x[axis], _mm256_set1_epi32(own.x[axis]));
            _mm256_mul_ps(_mm256_cvtepi32_ps(r), unit[axis])
        };
        let (x, y, z) = (difference(0), difference(1), difference(2));
        let u = _mm256_sub_ps(others.v[0], _mm256_set1_ps(own.v[0]));
        let v = _mm256_sub_ps(others.v[1], _mm256_set1_ps(own.v[1]));
        let w = _mm256_sub_ps(others.v[2], _mm256_set1_ps(own.v[2]));
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
        let minus = _mm256_sub_ps(zero, _mm256_add_ps(b, vv));
        let first = _mm256_min_ps(minus, end);
        let begin = _mm256_fmadd_ps(from, _mm256_fmadd_ps(from, vv, two), c);
        let second = _mm256_min_ps(_mm256_fmadd_ps(from, vv, b), begin);
        let none = _mm256_fmsub_ps(c, vv, _mm256_mul_ps(b, b));
        let worst = _mm256_max_ps(_mm256_max_ps(first, second), none);
        let pass = _mm256_cmp_ps::<_CMP_NGT_UQ>(worst, zero);
        // SAFETY: `slots` are eight.
        let slots = unsafe { _mm256_loadu_si256(slots.as_ptr().cast()) };
        let me = _mm256_castsi256_ps(_mm256_cmpeq_epi32(slots, _mm256_set1_epi32(query.slot as i32)));
        _mm256_movemask_ps(_mm256_andnot_ps(me, pass)) as u8
    }
}

#[cfg(test)]
mod tests;
