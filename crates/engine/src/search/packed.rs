/*!
Pair predictions for candidates that the search stores as one slice.

The operations are those of a gathered [`batch`], in the same order, so that the bits are the same. But the
data of four candidates are loaded and transposed in registers, instead of gathered one by one through memory.
*/

use haff_neighbors::{Offsets, Packed};

use crate::{
    motion::pair_flight::TOUCHING,
    search::batch::{self, Kernel},
    state::particle::{ClassData, Particle},
};

/// Largest number of candidates per call.
pub(crate) const MOST: usize = 64;

/// The owner of a list, and its candidates.
#[derive(Clone, Copy)]
pub(crate) struct Query<'a> {
    pub owner: &'a Particle,
    /// Radius of the owner [length].
    pub radius: f64,
    /// At most [`MOST`] candidates.
    pub list: &'a [Packed],
    pub offsets: &'a Offsets,
    pub particles: &'a [Particle],
    pub classes: &'a [ClassData],
    /// Length of a tick [time].
    pub tick: f64,
    /// Number of ticks per time [1/time].
    pub per_time: f64,
}

/// Result of a [`Query`].
#[derive(Debug, Clone)]
#[repr(C, align(32))]
pub(crate) struct Delays {
    /// Time from the later anchor to the contact [time], infinite without a contact.
    pub delay: [f64; MOST],
    /// The same from the anchor of the owner, with rounding errors [ticks].
    rounded: [f64; MOST],
    /// Bit k is set if there is a contact with candidate k.
    pub hits: u64,
    /// The same for those contacts only that could be the earliest, given the rounding errors.
    pub first: u64,
    /// Whether a candidate of `hits` already touches the owner, within the rounding errors of positions.
    pub touching: bool,
}

impl Delays {
    pub fn new() -> Self {
        Self { delay: [0.0; MOST], rounded: [0.0; MOST], hits: 0, first: 0, touching: false }
    }
}

/// The latest rounded time [ticks] of events that could precede an event with the rounded time `least`.
#[inline(always)]
fn bound(least: f64) -> f64 {
    least * (1.0 + 4.0 * f64::EPSILON) + 2.0
}

/// Predicts all candidates. With `UNIFORM`, all have the radius of the owner. With `LATEST`, no anchor is
/// later than that of the owner.
#[inline(always)]
pub(crate) fn predict<const UNIFORM: bool, const LATEST: bool>(
    kernel: Kernel,
    query: &Query,
    out: &mut Delays,
) {
    match kernel {
        Kernel::Portable => portable::<UNIFORM>(query, out),
        #[cfg(target_arch = "x86_64")]
        // SAFETY: only `Kernel::choose` makes this variant, after it has detected the features.
        Kernel::Avx2 => unsafe { avx2::predict::<UNIFORM, LATEST>(query, out) },
    }
}

fn portable<const UNIFORM: bool>(query: &Query, out: &mut Delays) {
    let &Query { owner: a, radius, list, offsets, particles, classes, tick, per_time } = query;
    (out.hits, out.first, out.touching) = (0, 0, false);
    let mut least = f64::INFINITY;
    for (k, (entry, (delay, rounded))) in
        list.iter().zip(out.delay.iter_mut().zip(&mut out.rounded)).enumerate()
    {
        let b = &particles[entry.id() as usize];
        let lag = a.time.wrapping_sub(b.time);
        let (dt_a, dt_b) = ((-lag).max(0) as f64 * tick, lag.max(0) as f64 * tick);
        let sigma = radius + if UNIFORM { radius } else { classes[b.class()].radius };
        let ra = haff_mechanics::drift(a.position, a.velocity, dt_a);
        let rb = haff_mechanics::drift(b.position, b.velocity, dt_b);
        // The shift is zero without an image. Its addition can change the sign of a zero, which has no effect
        // on the result.
        let shift = offsets.0[entry.code()];
        let r = (rb - ra).to_array();
        let v = (b.velocity - a.velocity).to_array();
        let r = [r[0] + shift[0], r[1] + shift[1], r[2] + shift[2]];
        *delay = batch::delay(r, v, sigma * sigma);
        let hit = *delay < f64::INFINITY;
        out.hits |= u64::from(hit) << k;
        let rr = r[0] * r[0] + r[1] * r[1] + r[2] * r[2];
        out.touching |= hit && rr <= sigma * sigma * (1.0 + TOUCHING);
        *rounded = (-lag).max(0) as f64 + *delay * per_time;
        least = least.min(*rounded);
    }
    let bound = bound(least);
    for (k, rounded) in out.rounded[..list.len().min(MOST)].iter().enumerate() {
        out.first |= u64::from(*rounded <= bound) << k;
    }
    out.first &= out.hits;
}

#[cfg(target_arch = "x86_64")]
mod avx2 {
    use std::arch::x86_64::{
        __m256d, _CMP_GE_OQ, _CMP_GT_OQ, _CMP_LE_OQ, _CMP_LT_OQ, _CMP_NGT_UQ, _mm_loadu_pd, _mm256_add_pd,
        _mm256_and_pd, _mm256_andnot_pd, _mm256_blend_epi32, _mm256_blendv_pd, _mm256_castpd_si256,
        _mm256_castpd128_pd256, _mm256_castsi256_pd, _mm256_cmp_pd, _mm256_cmpgt_epi64, _mm256_cvtsd_f64,
        _mm256_div_pd, _mm256_insertf128_pd, _mm256_load_pd, _mm256_max_pd, _mm256_min_pd,
        _mm256_movemask_pd, _mm256_mul_pd, _mm256_or_pd, _mm256_or_si256, _mm256_permute_pd,
        _mm256_permute2f128_pd, _mm256_set_pd, _mm256_set1_epi64x, _mm256_set1_pd, _mm256_setzero_pd,
        _mm256_setzero_si256, _mm256_sqrt_pd, _mm256_srli_epi64, _mm256_store_pd, _mm256_sub_epi64,
        _mm256_sub_pd, _mm256_unpackhi_pd, _mm256_unpacklo_pd, _mm256_xor_pd, _mm256_xor_si256,
    };

    use haff_neighbors::Packed;

    use super::{Delays, MOST, Query, TOUCHING, bound};
    use crate::state::particle::Particle;

    /// Loads words 2k and 2k + 1 of four records, and transposes them.
    ///
    /// # Safety
    ///
    /// Each pointer must point to 2k + 2 readable `f64`.
    #[inline]
    #[target_feature(enable = "avx2")]
    unsafe fn columns(records: [*const f64; 4], k: usize) -> (__m256d, __m256d) {
        // SAFETY: the caller guarantees that words 2k and 2k + 1 are readable.
        let [a, b, c, d] = unsafe { records.map(|record| _mm_loadu_pd(record.add(2 * k))) };
        let ac = _mm256_insertf128_pd::<1>(_mm256_castpd128_pd256(a), c);
        let bd = _mm256_insertf128_pd::<1>(_mm256_castpd128_pd256(b), d);
        (_mm256_unpacklo_pd(ac, bd), _mm256_unpackhi_pd(ac, bd))
    }

    /// The operations of `super::portable` for four candidates at a time.
    #[target_feature(enable = "avx2")]
    pub fn predict<const UNIFORM: bool, const LATEST: bool>(query: &Query, out: &mut Delays) {
        // AVX2 has no conversion of 64-bit integers to `f64`. The two halves of an integer become the lower
        // bits of the significands of 2^52 and 2^84. The constants are subtracted, and only the last addition
        // rounds.
        /// 2^52.
        const LOW: f64 = 4_503_599_627_370_496.0;
        /// 2^84 + 2^52.
        const HIGH: f64 = 19_342_813_118_337_666_422_669_312.0;
        /// 2^84.
        const HIGH_ALONE: f64 = 19_342_813_113_834_066_795_298_816.0;
        let &Query { owner, radius, list, offsets, particles, classes, tick, per_time } = query;
        let [ax, ay, az] = owner.position.to_array().map(|x| _mm256_set1_pd(x));
        let [ux, uy, uz] = owner.velocity.to_array().map(|x| _mm256_set1_pd(x));
        let own_time = _mm256_set1_epi64x(owner.time);
        let (tick, per_time) = (_mm256_set1_pd(tick), _mm256_set1_pd(per_time));
        let zero = _mm256_setzero_pd();
        let infinity = _mm256_set1_pd(f64::INFINITY);
        let sign = _mm256_set1_pd(-0.0);
        let sigma = radius + radius;
        let uniform = _mm256_set1_pd(sigma * sigma);
        let (low_bits, high_bits) =
            (_mm256_castpd_si256(_mm256_set1_pd(LOW)), _mm256_castpd_si256(_mm256_set1_pd(HIGH_ALONE)));
        let high = _mm256_set1_pd(HIGH);
        let touch = _mm256_set1_pd(1.0 + TOUCHING);
        let (mut hits, mut touching, mut least) = (0, zero, infinity);
        let list = &list[..list.len().min(MOST)];
        let mut start = 0;
        while start < list.len() {
            let entries: [Packed; 4] = if let Some(group) = list[start..].first_chunk() {
                *group
            } else {
                // The last group is padded with its first candidate; results of the copies are not read.
                std::array::from_fn(|k| list[if start + k < list.len() { start + k } else { start }])
            };
            let records = entries.map(|entry| &particles[entry.id() as usize]);
            let pointers = records.map(|record| std::ptr::from_ref::<Particle>(record).cast::<f64>());
            // SAFETY: a `Particle` is `repr(C)` and has eight words of 8 bytes: position, velocity, time, and
            // one word for count and class.
            let ((bx, by), (bz, vx), (vy, vz), (time, _)) = unsafe {
                (columns(pointers, 0), columns(pointers, 1), columns(pointers, 2), columns(pointers, 3))
            };
            let lag = _mm256_sub_epi64(own_time, _mm256_castpd_si256(time));
            let later =
                if LATEST { _mm256_setzero_si256() } else { _mm256_cmpgt_epi64(_mm256_setzero_si256(), lag) };
            let ticks = _mm256_sub_epi64(_mm256_xor_si256(lag, later), later);
            let upper = _mm256_or_si256(_mm256_srli_epi64::<32>(ticks), high_bits);
            let lower = _mm256_blend_epi32::<0b1010_1010>(ticks, low_bits);
            let ticks =
                _mm256_add_pd(_mm256_sub_pd(_mm256_castsi256_pd(upper), high), _mm256_castsi256_pd(lower));
            let dt = _mm256_mul_pd(ticks, tick);
            let later = _mm256_castsi256_pd(later);
            let (dt_a, dt_b) = (_mm256_and_pd(later, dt), _mm256_andnot_pd(later, dt));
            let separation = |a, u, b, v| {
                let from = if LATEST { a } else { _mm256_add_pd(a, _mm256_mul_pd(u, dt_a)) };
                _mm256_sub_pd(_mm256_add_pd(b, _mm256_mul_pd(v, dt_b)), from)
            };
            let mut rx = separation(ax, ux, bx, vx);
            let mut ry = separation(ay, uy, by, vy);
            let mut rz = separation(az, uz, bz, vz);
            if Packed::any_image(entries) {
                let shifts = entries.map(|entry| offsets.0[entry.code()].as_ptr());
                // SAFETY: each offset has four words.
                let ((sx, sy), (sz, _)) = unsafe { (columns(shifts, 0), columns(shifts, 1)) };
                rx = _mm256_add_pd(rx, sx);
                ry = _mm256_add_pd(ry, sy);
                rz = _mm256_add_pd(rz, sz);
            }
            let (vx, vy, vz) = (_mm256_sub_pd(vx, ux), _mm256_sub_pd(vy, uy), _mm256_sub_pd(vz, uz));
            let sigma2 = if UNIFORM {
                uniform
            } else {
                let [a, b, c, d] = records.map(|record| {
                    let sigma = radius + classes[record.class()].radius;
                    sigma * sigma
                });
                _mm256_set_pd(d, c, b, a)
            };
            let dot = |ax, ay, az, bx, by, bz| {
                _mm256_add_pd(
                    _mm256_add_pd(_mm256_mul_pd(ax, bx), _mm256_mul_pd(ay, by)),
                    _mm256_mul_pd(az, bz),
                )
            };
            let minor = |a, b, c, d| _mm256_sub_pd(_mm256_mul_pd(a, b), _mm256_mul_pd(c, d));
            let b = dot(rx, ry, rz, vx, vy, vz);
            let rr = dot(rx, ry, rz, rx, ry, rz);
            let vv = dot(vx, vy, vz, vx, vy, vz);
            let (cx, cy, cz) = (minor(ry, vz, vy, rz), minor(rz, vx, vz, rx), minor(rx, vy, vx, ry));
            let cc = dot(cx, cy, cz, cx, cy, cz);
            let gap = _mm256_sub_pd(rr, sigma2);
            let disc = _mm256_sub_pd(_mm256_mul_pd(vv, sigma2), cc);
            let approach = _mm256_xor_pd(b, sign);
            let den = _mm256_sub_pd(_mm256_sqrt_pd(_mm256_max_pd(disc, zero)), b);
            let beyond = _mm256_cmp_pd::<_CMP_GT_OQ>(_mm256_mul_pd(gap, vv), _mm256_mul_pd(approach, den));
            let time =
                _mm256_div_pd(_mm256_blendv_pd(gap, approach, beyond), _mm256_blendv_pd(den, vv, beyond));
            let inside = _mm256_cmp_pd::<_CMP_NGT_UQ>(gap, zero);
            let contact = _mm256_or_pd(_mm256_cmp_pd::<_CMP_GE_OQ>(disc, zero), inside);
            let contact = _mm256_and_pd(_mm256_cmp_pd::<_CMP_LT_OQ>(b, zero), contact);
            let delay = _mm256_blendv_pd(infinity, _mm256_andnot_pd(inside, time), contact);
            // SAFETY: the slice has four words; `Delays` is aligned to 32 bytes, and `start` is a multiple of
            // four.
            unsafe { _mm256_store_pd(out.delay[start..start + 4].as_mut_ptr(), delay) };
            let hit = _mm256_cmp_pd::<_CMP_LT_OQ>(delay, infinity);
            hits |= (_mm256_movemask_pd(hit) as u64) << start;
            let close = _mm256_cmp_pd::<_CMP_LE_OQ>(rr, _mm256_mul_pd(sigma2, touch));
            touching = _mm256_or_pd(touching, _mm256_and_pd(hit, close));
            let rounded = _mm256_mul_pd(delay, per_time);
            let rounded = if LATEST { rounded } else { _mm256_add_pd(_mm256_and_pd(later, ticks), rounded) };
            least = _mm256_min_pd(least, rounded);
            // SAFETY: as above; `out.rounded` follows the 64 words of `out.delay`.
            unsafe { _mm256_store_pd(out.rounded[start..start + 4].as_mut_ptr(), rounded) };
            start += 4;
        }
        out.touching = _mm256_movemask_pd(touching) != 0;
        let least = _mm256_min_pd(least, _mm256_permute2f128_pd::<1>(least, least));
        let least = _mm256_min_pd(least, _mm256_permute_pd::<0b0101>(least));
        let bound = _mm256_set1_pd(bound(_mm256_cvtsd_f64(least)));
        let mut first = 0;
        for start in (0..list.len()).step_by(4) {
            // SAFETY: as above.
            let rounded = unsafe { _mm256_load_pd(out.rounded[start..start + 4].as_ptr()) };
            first |= (_mm256_movemask_pd(_mm256_cmp_pd::<_CMP_LE_OQ>(rounded, bound)) as u64) << start;
        }
        out.hits = if list.len() < MOST { hits & ((1 << list.len()) - 1) } else { hits };
        out.first = first & out.hits;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::SimdChoice;
    use glam::DVec3;
    use haff_mechanics::time_to_contact;
    use haff_neighbors::{Axis, Geometry, Lists, Search};
    use haff_testing::Random;

    fn uniform(random: &mut Random) -> f64 {
        random.uniform(-1.0, 1.0)
    }

    /// A random gas: particles with three radii, some of them touching, with anchors of very different ages.
    fn gas(random: &mut Random) -> (Vec<Particle>, Vec<ClassData>, Vec<f64>) {
        let radii = [0.5, 0.4, 0.3];
        let classes = radii.map(|radius| ClassData { radius, mass: 1.0, inverse_mass: 1.0, group: 0 });
        let particles: Vec<Particle> = (0..120)
            .map(|k| {
                let mut vector = || DVec3::new(uniform(random), uniform(random), uniform(random));
                let (position, velocity) = (vector() * 2.5 + 2.5, vector());
                let age = (uniform(random).abs() * f64::from(1_u32 << (k % 31)) * 1e9) as i64;
                Particle::at(position, velocity, 1_000 - age, k % 3)
            })
            .collect();
        let sizes = particles.iter().map(|particle| radii[particle.class()]).collect();
        (particles, classes.to_vec(), sizes)
    }

    fn check<const UNIFORM: bool, const LATEST: bool>(random: &mut Random) -> usize {
        let (mut particles, classes, sizes) = gas(random);
        let (tick, size) = (2.0_f64.powi(-40), DVec3::splat(5.0));
        let geometry = Geometry {
            size,
            axes: [Axis::Periodic; 3],
            reach: 1.0,
            crowding: 1.0,
            radius: 0.5,
            radii: if UNIFORM { Vec::new() } else { sizes },
            planes: Vec::new(),
            sliding: None,
        };
        let positions: Vec<DVec3> = particles.iter().map(|particle| particle.position).collect();
        let search = Lists::new(&geometry, &positions);
        let mut hits = 0;
        for i in 0..particles.len() as u32 {
            if LATEST {
                particles[i as usize].time = 1_000;
            }
            let (Some(list), Some(offsets)) = (search.packed(i), search.offsets()) else { continue };
            let owner = &particles[i as usize];
            let radius = if UNIFORM { 0.5 } else { classes[owner.class()].radius };
            let list = &list[..list.len().min(MOST)];
            let query = Query {
                owner,
                radius,
                list,
                offsets,
                particles: &particles,
                classes: &classes,
                tick,
                per_time: 1.0 / tick,
            };
            let results: Vec<Delays> = [SimdChoice::Portable, SimdChoice::Avx2]
                .into_iter()
                .filter_map(Kernel::choose)
                .map(|kernel| {
                    let mut out = Delays::new();
                    predict::<UNIFORM, LATEST>(kernel, &query, &mut out);
                    out
                })
                .collect();
            for out in &results {
                assert_eq!((out.hits, out.first), (results[0].hits, results[0].first));
                assert_eq!(out.touching, results[0].touching);
                let mut earliest = (f64::INFINITY, 0);
                for (k, entry) in list.iter().enumerate() {
                    let partner = &particles[entry.id() as usize];
                    let later = owner.time.max(partner.time);
                    let at = |p: &Particle| {
                        haff_mechanics::drift(p.position, p.velocity, (later - p.time) as f64 * tick)
                    };
                    let shift = DVec3::from_array(entry.shift().map(f64::from)) * size;
                    let sigma = radius + if UNIFORM { 0.5 } else { classes[partner.class()].radius };
                    let expected = time_to_contact(
                        at(partner) - at(owner) + shift,
                        partner.velocity - owner.velocity,
                        sigma,
                    );
                    assert_eq!(out.hits >> k & 1 == 1, expected.is_some(), "candidate {k} of {i}");
                    if let Some(delay) = expected {
                        assert_eq!(out.delay[k].to_bits(), delay.to_bits(), "candidate {k} of {i}");
                        let time = (later - owner.time) as f64 * tick + delay;
                        earliest = if time < earliest.0 { (time, k) } else { earliest };
                        hits += 1;
                    }
                }
                assert!(earliest.0 == f64::INFINITY || out.first >> earliest.1 & 1 == 1, "{i}");
            }
        }
        hits
    }

    #[test]
    fn every_kernel_has_the_bits_of_the_reference() {
        let mut random = Random(11);
        let mut hits = [0; 4];
        for _ in 0..40 {
            hits[0] += check::<true, true>(&mut random);
            hits[1] += check::<true, false>(&mut random);
            hits[2] += check::<false, true>(&mut random);
            hits[3] += check::<false, false>(&mut random);
        }
        assert!(hits.iter().all(|&hits| hits > 1000), "{hits:?}");
    }
}
