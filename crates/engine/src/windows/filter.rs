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
    cells::{Candidates, Cells, LANES},
    tune::Work,
};
use crate::features::Features;

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

/// What a window knows of a particle: half a cache line.
#[derive(Debug, Clone, Copy, Default)]
#[repr(C, align(32))]
pub(super) struct Record {
    /// Where its path of now would have started the window [coordinates].
    pub x: [i32; 3],
    /// Radius, widened [length].
    pub radius: f32,
    /// Displacement within the window [length].
    pub v: [f32; 3],
    /// Fills the record up: filters load it whole.
    pub filler: u32,
}

/// A particle whose partners are looked for.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Probe {
    pub slot: u32,
    pub record: Record,
    /// Where it is at the start of the search [coordinates].
    pub place: [i32; 3],
    /// Start of the search, as a part of the window.
    pub from: f32,
}

/// Working space of searches.
#[derive(Debug, Clone)]
pub(super) struct Scratch {
    candidates: Candidates,
    masks: Vec<u8>,
    /// Candidate pairs: the number of a search, and the slot that it has found.
    pub hits: Vec<(u32, u32)>,
    /// What has been done so far.
    pub work: Work,
}

impl Scratch {
    pub fn new() -> Self {
        Self { candidates: Candidates::new(), masks: Vec::new(), hits: Vec::new(), work: Work::default() }
    }

    /// Collects the hits of so many vectors from their masks, which are followed by a word of zeros at least.
    #[cfg(target_arch = "x86_64")]
    #[inline(always)]
    fn collect(&mut self, vectors: usize) {
        let Self { candidates: Candidates { slots, owner, .. }, masks, hits, .. } = self;
        let (slots, owner) = (&slots[..vectors * LANES], &owner[..vectors]);
        hits.reserve(slots.len());
        let (to, mut count) = (hits.as_mut_ptr(), hits.len());
        for (word, bytes) in masks[..vectors.next_multiple_of(LANES)].chunks_exact(LANES).enumerate() {
            let mut bits = bytes.try_into().map_or(0, u64::from_le_bytes);
            while bits != 0 {
                let k = word * 64 + bits.trailing_zeros() as usize;
                bits &= bits - 1;
                debug_assert!(k < slots.len() && count < hits.capacity());
                // SAFETY: no vector beyond those counted has a bit, and there is room for a hit of every
                // slot.
                unsafe {
                    to.add(count).write((*owner.get_unchecked(k / LANES), *slots.get_unchecked(k)));
                }
                count += 1;
            }
        }
        // SAFETY: so many have been written.
        unsafe { hits.set_len(count) };
    }
}

/// Finds all particles that the probes may touch in what is left of the window, each once per probe. With the
/// `lowest` cell of every slot and `HALF` set, of two that may touch the one whose lowest cell comes first
/// finds the other, which is enough if all are searched.
///
/// With `VECTORS` set the caller must be compiled for AVX2 and FMA, and run where they exist.
#[inline(always)]
pub(super) fn search<F: Features, const HALF: bool, const VECTORS: bool>(
    records: &[Record],
    cells: &Cells,
    lowest: &[u32],
    common_radius: f32,
    probes: &[Probe],
    scratch: &mut Scratch,
) {
    scratch.hits.clear();
    scratch.candidates.len = 0;
    for (search, probe) in probes.iter().enumerate() {
        let Probe { slot, place, from, record: Record { v, radius, .. } } = *probe;
        let extent = if F::UNIFORM { 0.0 } else { radius - common_radius };
        let reach = [radius + common_radius, extent];
        let low = if HALF { lowest[slot as usize] } else { 0 };
        cells.gather::<HALF>(search as u32, slot, place, v, 1.0 - from, reach, low, &mut scratch.candidates);
    }
    scratch.work.searches += probes.len() as u64;
    scratch.work.candidates += scratch.candidates.len as u64;
    scratch.work.blocks += std::mem::take(&mut scratch.candidates.blocks);
    if VECTORS {
        #[cfg(target_arch = "x86_64")]
        // SAFETY: the caller has the features.
        unsafe {
            avx2::filter::<F>(records, cells.axes.unit, probes, scratch);
        }
    } else {
        let Candidates { slots, owner, len, .. } = &scratch.candidates;
        for k in 0..*len {
            let (search, slot) = (owner[k / LANES], slots[k]);
            let probe = &probes[search as usize];
            if slot != probe.slot && passes::<F>(&records[slot as usize], cells.axes.unit, probe) {
                scratch.hits.push((search, slot));
            }
        }
    }
    // Who is registered in several cells has been met several times. Most of them are found among the last
    // few, without a branch; those who are not are predicted twice, which does no harm.
    let hits = &mut scratch.hits;
    let mut last = [u64::MAX; 4];
    let mut kept = 0;
    for k in 0..hits.len() {
        let hit @ (search, slot) = hits[k];
        let key = u64::from(search) << 32 | u64::from(slot);
        let known = last.iter().fold(0, |known, &before| known | u8::from(before == key));
        let own = probes[search as usize].slot;
        let below = HALF && (lowest[slot as usize], slot) < (lowest[own as usize], own);
        last[k % 4] = key;
        hits[kept] = hit;
        kept += usize::from(known | u8::from(below) == 0);
    }
    hits.truncate(kept);
}

/// The filter for one candidate: the plain twin of the vector filter.
#[expect(clippy::neg_cmp_op_on_partial_ord, reason = "what is not a number passes")]
#[inline(always)]
fn passes<F: Features>(other: &Record, unit: [f32; 3], probe: &Probe) -> bool {
    let own = &probe.record;
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
    let begin = c + probe.from * (two + probe.from * vv);
    let first = (-b - vv).min(end);
    let second = (probe.from * vv + b).min(begin);
    // Overflow makes a NaN: not greater than zero, so it passes.
    let worst = (c * vv - b * b).max(first).max(second);
    !(worst > 0.0)
}

#[cfg(target_arch = "x86_64")]
mod avx2 {
    use std::arch::x86_64::{
        __m256, _CMP_NGT_UQ, _mm256_add_ps, _mm256_andnot_ps, _mm256_castps_si256, _mm256_castsi256_ps,
        _mm256_cmp_ps, _mm256_cmpeq_epi32, _mm256_cvtepi32_ps, _mm256_fmadd_ps, _mm256_fmsub_ps,
        _mm256_fnmadd_ps, _mm256_load_ps, _mm256_loadu_si256, _mm256_max_ps, _mm256_min_ps,
        _mm256_movemask_ps, _mm256_mul_ps, _mm256_permute2f128_ps, _mm256_set1_epi32, _mm256_set1_ps,
        _mm256_setzero_ps, _mm256_shuffle_ps, _mm256_sub_epi32, _mm256_sub_ps, _mm256_unpackhi_ps,
        _mm256_unpacklo_ps,
    };

    use super::{Features, LANES, Probe, Record, Scratch};

    /// Eight candidates at a time: their records are loaded whole and transposed in registers. What has
    /// passed is looked at after all are tested, so that no test waits for a branch on the one before.
    #[target_feature(enable = "avx2,fma")]
    #[inline]
    pub(super) fn filter<F: Features>(
        records: &[Record],
        unit: [f32; 3],
        probes: &[Probe],
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
            *mask = test::<F>(records, unit, &probes[owner as usize], slots);
        }
        masks[vectors..vectors + LANES].fill(0);
        scratch.collect(vectors);
    }

    /// Which of eight slots pass.
    #[target_feature(enable = "avx2,fma")]
    #[inline]
    fn test<F: Features>(records: &[Record], unit: [__m256; 3], probe: &Probe, slots: &[u32]) -> u8 {
        let own = &probe.record;
        let row = |k: usize| {
            debug_assert!((slots[k] as usize) < records.len());
            // SAFETY: what is registered in cells is a slot; a record is 32 bytes, aligned to 32.
            unsafe { _mm256_load_ps(records.as_ptr().add(slots[k] as usize).cast()) }
        };
        let (r0, r1, r2, r3) = (row(0), row(1), row(2), row(3));
        let (r4, r5, r6, r7) = (row(4), row(5), row(6), row(7));
        // Rows k and k + 4 side by side: positions, then velocities.
        let (a0, a1) = (_mm256_permute2f128_ps::<0x20>(r0, r4), _mm256_permute2f128_ps::<0x20>(r1, r5));
        let (a2, a3) = (_mm256_permute2f128_ps::<0x20>(r2, r6), _mm256_permute2f128_ps::<0x20>(r3, r7));
        let (b0, b1) = (_mm256_permute2f128_ps::<0x31>(r0, r4), _mm256_permute2f128_ps::<0x31>(r1, r5));
        let (b2, b3) = (_mm256_permute2f128_ps::<0x31>(r2, r6), _mm256_permute2f128_ps::<0x31>(r3, r7));
        let (t0, t1) = (_mm256_unpacklo_ps(a0, a1), _mm256_unpacklo_ps(a2, a3));
        let (t2, t3) = (_mm256_unpackhi_ps(a0, a1), _mm256_unpackhi_ps(a2, a3));
        let (s0, s1) = (_mm256_unpacklo_ps(b0, b1), _mm256_unpacklo_ps(b2, b3));
        let (s2, s3) = (_mm256_unpackhi_ps(b0, b1), _mm256_unpackhi_ps(b2, b3));
        let difference = |x: __m256, axis: usize| {
            let r = _mm256_sub_epi32(_mm256_castps_si256(x), _mm256_set1_epi32(own.x[axis]));
            _mm256_mul_ps(_mm256_cvtepi32_ps(r), unit[axis])
        };
        let x = difference(_mm256_shuffle_ps::<0x44>(t0, t1), 0);
        let y = difference(_mm256_shuffle_ps::<0xee>(t0, t1), 1);
        let z = difference(_mm256_shuffle_ps::<0x44>(t2, t3), 2);
        let u = _mm256_sub_ps(_mm256_shuffle_ps::<0x44>(s0, s1), _mm256_set1_ps(own.v[0]));
        let v = _mm256_sub_ps(_mm256_shuffle_ps::<0xee>(s0, s1), _mm256_set1_ps(own.v[1]));
        let w = _mm256_sub_ps(_mm256_shuffle_ps::<0x44>(s2, s3), _mm256_set1_ps(own.v[2]));
        let sigma = if F::UNIFORM {
            _mm256_set1_ps(own.radius + own.radius)
        } else {
            _mm256_add_ps(_mm256_shuffle_ps::<0xee>(t2, t3), _mm256_set1_ps(own.radius))
        };
        let from = _mm256_set1_ps(probe.from);
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
        let me = _mm256_castsi256_ps(_mm256_cmpeq_epi32(slots, _mm256_set1_epi32(probe.slot as i32)));
        _mm256_movemask_ps(_mm256_andnot_ps(me, pass)) as u8
    }
}

#[cfg(test)]
mod tests;
