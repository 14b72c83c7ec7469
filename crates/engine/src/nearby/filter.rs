/*!
The filter: before when no contact of a pair can be.

With r and v of a pair now, in single precision, and σ the contact distance, widened by a margin, the pair comes within σ at

```text
t = c / (−b + √(b² − v² c)),   c = r² − σ²,  b = r·v,
```

if it does at all. The true contact comes later: the margin is wider than all that single precision and coordinates round until
one of the two has left the ball that makes them neighbors. What is added to the approach, −b, is more than the rounding of
r·v of a pair within σ: whether a touching pair approaches is for the exact prediction to say.
*/

use super::{
    frame::{Frame, Record},
    lists::LANES,
};
use crate::machine::Features;

/// Members of a list that are looked at at a time.
pub(super) const MOST: usize = 64;
/// The bound of a member that is not met at all; the greatest number whose last bits can name a lane.
pub(super) const NEVER: f32 = f32::from_bits(0x7f7f_ffff & !LANE);
/// The last bits of a bound name its lane, so that the least bound tells whose it is: they are far below the margin.
const LANE: u32 = MOST as u32 - 1;

/// Working space, and the answer.
#[derive(Debug, Clone, Copy)]
#[repr(C, align(32))]
pub(super) struct Bounds {
    /// Per member, a time from now before which there is no contact [spans], and the lane; [`NEVER`] or more where there is none.
    time: [f32; MOST],
}

impl Bounds {
    pub fn new() -> Self {
        Self { time: [NEVER; MOST] }
    }

    /// The lane of a bound.
    #[inline(always)]
    pub fn lane(bound: f32) -> usize {
        (bound.to_bits() & LANE) as usize
    }

    /// Which of the first `count` members have a bound no later than `limit`, which is less than [`NEVER`].
    #[inline(always)]
    pub fn up_to<const VECTORS: bool>(&self, count: usize, limit: f32) -> u64 {
        #[cfg(target_arch = "x86_64")]
        if VECTORS {
            // SAFETY: the caller has the features.
            return unsafe { avx2::up_to(self, count, limit) };
        }
        self.time[..count].iter().rev().fold(0, |bits, time| bits << 1 | u64::from(*time <= limit))
    }
}

/// Bounds for the members of `list`, whole groups and at most [`MOST`], that the particle on record `own` may meet from `part`
/// of the span on. Returns the least bound.
///
/// With `VECTORS` set the caller must be compiled for AVX2 and FMA, and run where they exist.
#[inline(always)]
pub(super) fn bounds<F: Features, const VECTORS: bool>(
    frame: &Frame,
    records: &[Record],
    own: &Record,
    part: f32,
    list: &[u32],
    out: &mut Bounds,
) -> f32 {
    let list = &list[..list.len().min(MOST)];
    #[cfg(target_arch = "x86_64")]
    if VECTORS {
        // SAFETY: the caller has the features.
        return unsafe { avx2::bounds::<F>(frame, records, own, part, list, out) };
    }
    let mut least = f32::INFINITY;
    for (lane, (time, &j)) in out.time.iter_mut().zip(list).enumerate() {
        let bound = bound::<F>(frame, own, &records[j as usize], part);
        *time = f32::from_bits(bound.to_bits() & !LANE | lane as u32);
        least = least.min(*time);
    }
    least
}

/// The bound for one pair: the plain twin of the vector filter.
#[inline(always)]
fn bound<F: Features>(frame: &Frame, own: &Record, other: &Record, part: f32) -> f32 {
    let (mut b, mut c, mut vv) = (-frame.noise, -frame.sigma2, 0.0);
    if !F::UNIFORM {
        let sigma = own.radius + other.radius;
        c = -(sigma * sigma);
    }
    for axis in 0..3 {
        let v = other.v[axis] - own.v[axis];
        let r = other.x[axis].wrapping_sub(own.x[axis]) as f32 * frame.unit[axis] + v * part;
        b += r * v;
        c += r * r;
        vv += v * v;
    }
    let disc = b * b - vv * c;
    // Who is on record as nobody has no number here.
    if b < 0.0 && disc >= 0.0 { (c.max(0.0) / (disc.sqrt() - b)).min(NEVER) } else { NEVER }
}

#[cfg(target_arch = "x86_64")]
mod avx2 {
    use std::arch::x86_64::{
        __m256, _CMP_GE_OQ, _CMP_LE_OQ, _CMP_LT_OQ, _mm_cvtss_f32, _mm_load_ps, _mm_min_ps, _mm_movehdup_ps,
        _mm_movehl_ps, _mm256_add_epi32, _mm256_add_ps, _mm256_and_ps, _mm256_blendv_ps, _mm256_castps_si256, _mm256_castsi256_ps,
        _mm256_castps128_ps256, _mm256_castps256_ps128, _mm256_cmp_ps, _mm256_cvtepi32_ps, _mm256_div_ps,
        _mm256_extractf128_ps, _mm256_fmadd_ps, _mm256_fmsub_ps, _mm256_insertf128_ps, _mm256_load_ps,
        _mm256_max_ps, _mm256_min_ps, _mm256_movemask_ps, _mm256_mul_ps, _mm256_or_ps, _mm256_set1_epi32, _mm256_set1_ps,
        _mm256_setr_epi32, _mm256_setzero_ps, _mm256_shuffle_ps, _mm256_sqrt_ps, _mm256_store_ps, _mm256_sub_epi32,
        _mm256_sub_ps, _mm256_unpackhi_ps, _mm256_unpacklo_ps,
    };

    use super::{Bounds, Features, Frame, LANE, LANES, MOST, NEVER, Record};

    /// Eight members at a time: their records are loaded by halves and transposed in registers.
    #[target_feature(enable = "avx2,fma")]
    #[inline]
    pub(super) fn bounds<F: Features>(
        frame: &Frame,
        records: &[Record],
        own: &Record,
        part: f32,
        list: &[u32],
        out: &mut Bounds,
    ) -> f32 {
        let [x, y, z] = own.x.map(|x| _mm256_set1_epi32(x));
        let [u, v, w] = own.v.map(|v| _mm256_set1_ps(v));
        let unit = frame.unit.map(|unit| _mm256_set1_ps(unit));
        let part = _mm256_set1_ps(part);
        let noise = _mm256_set1_ps(-frame.noise);
        let uniform = _mm256_set1_ps(-frame.sigma2);
        let zero = _mm256_setzero_ps();
        let never = _mm256_set1_ps(NEVER);
        let mut least = _mm256_set1_ps(f32::INFINITY);
        let all_but_lane = _mm256_castsi256_ps(_mm256_set1_epi32(!LANE as i32));
        let mut lanes = _mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7);
        for (slots, time) in list.chunks_exact(LANES).zip(out.time.chunks_exact_mut(LANES)) {
            let half = |k: usize, half: usize| {
                debug_assert!((slots[k] as usize) < records.len());
                // SAFETY: lists name particles and nobody, who are all on record, in 32 bytes each, aligned to 32.
                unsafe { _mm_load_ps(records.as_ptr().add(slots[k] as usize).cast::<f32>().add(4 * half)) }
            };
            // Rows k and k + 4 side by side: positions, then velocities.
            let rows = |k: usize, part: usize| {
                _mm256_insertf128_ps::<1>(_mm256_castps128_ps256(half(k, part)), half(k + 4, part))
            };
            let (a0, a1, a2, a3) = (rows(0, 0), rows(1, 0), rows(2, 0), rows(3, 0));
            let (b0, b1, b2, b3) = (rows(0, 1), rows(1, 1), rows(2, 1), rows(3, 1));
            let (t0, t1) = (_mm256_unpacklo_ps(a0, a1), _mm256_unpacklo_ps(a2, a3));
            let (t2, t3) = (_mm256_unpackhi_ps(a0, a1), _mm256_unpackhi_ps(a2, a3));
            let (s0, s1) = (_mm256_unpacklo_ps(b0, b1), _mm256_unpacklo_ps(b2, b3));
            let (s2, s3) = (_mm256_unpackhi_ps(b0, b1), _mm256_unpackhi_ps(b2, b3));
            let u = _mm256_sub_ps(_mm256_shuffle_ps::<0x44>(s0, s1), u);
            let v = _mm256_sub_ps(_mm256_shuffle_ps::<0xee>(s0, s1), v);
            let w = _mm256_sub_ps(_mm256_shuffle_ps::<0x44>(s2, s3), w);
            let apart = |there: __m256, here, unit, v| {
                let r = _mm256_cvtepi32_ps(_mm256_sub_epi32(_mm256_castps_si256(there), here));
                _mm256_fmadd_ps(r, unit, _mm256_mul_ps(v, part))
            };
            let x = apart(_mm256_shuffle_ps::<0x44>(t0, t1), x, unit[0], u);
            let y = apart(_mm256_shuffle_ps::<0xee>(t0, t1), y, unit[1], v);
            let z = apart(_mm256_shuffle_ps::<0x44>(t2, t3), z, unit[2], w);
            let sigma2 = if F::UNIFORM {
                uniform
            } else {
                let sigma = _mm256_add_ps(_mm256_shuffle_ps::<0xee>(t2, t3), _mm256_set1_ps(own.radius));
                _mm256_sub_ps(zero, _mm256_mul_ps(sigma, sigma))
            };
            let b = _mm256_fmadd_ps(z, w, _mm256_fmadd_ps(y, v, _mm256_fmadd_ps(x, u, noise)));
            let vv = _mm256_fmadd_ps(w, w, _mm256_fmadd_ps(v, v, _mm256_mul_ps(u, u)));
            let c = _mm256_fmadd_ps(z, z, _mm256_fmadd_ps(y, y, _mm256_fmadd_ps(x, x, sigma2)));
            let disc = _mm256_fmsub_ps(b, b, _mm256_mul_ps(vv, c));
            let den = _mm256_sub_ps(_mm256_sqrt_ps(disc), b);
            let t = _mm256_div_ps(_mm256_max_ps(c, zero), den);
            let meets = _mm256_and_ps(
                _mm256_cmp_ps::<_CMP_LT_OQ>(b, zero),
                _mm256_cmp_ps::<_CMP_GE_OQ>(disc, zero),
            );
            let t = _mm256_min_ps(_mm256_blendv_ps(never, t, meets), never);
            let t = _mm256_or_ps(_mm256_and_ps(t, all_but_lane), _mm256_castsi256_ps(lanes));
            lanes = _mm256_add_epi32(lanes, _mm256_set1_epi32(LANES as i32));
            least = _mm256_min_ps(least, t);
            // SAFETY: eight words; `Bounds` is aligned to 32 bytes, and the chunks are of 32.
            unsafe { _mm256_store_ps(time.as_mut_ptr(), t) };
        }
        let least = _mm_min_ps(_mm256_castps256_ps128(least), _mm256_extractf128_ps::<1>(least));
        let least = _mm_min_ps(least, _mm_movehl_ps(least, least));
        _mm_cvtss_f32(_mm_min_ps(least, _mm_movehdup_ps(least)))
    }

    #[target_feature(enable = "avx2,fma")]
    #[inline]
    pub(super) fn up_to(bounds: &Bounds, count: usize, limit: f32) -> u64 {
        let limit = _mm256_set1_ps(limit);
        let mut bits = 0;
        for (k, time) in bounds.time[..count.min(MOST)].chunks_exact(LANES).enumerate() {
            // SAFETY: eight words, aligned as above.
            let time = unsafe { _mm256_load_ps(time.as_ptr()) };
            bits |= (_mm256_movemask_ps(_mm256_cmp_ps::<_CMP_LE_OQ>(time, limit)) as u64) << (k * LANES);
        }
        bits
    }
}
