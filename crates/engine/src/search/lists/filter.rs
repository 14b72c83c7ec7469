/*!
The filter. For each pair of a list it computes, in single precision, a time before which the pair cannot
touch.

With the present r and v of a pair, and σ the contact distance, widened by a margin, the pair comes within σ
at

```text
t = c / (−b + √(b² − v² c)),   c = r² − σ²,  b = r·v,
```

if it does so at all. The true contact is not earlier than this bound: the margin is larger than all rounding
errors of single precision and of the coordinates, until one of the two particles leaves its skin sphere.

−b is increased by more than the rounding error of r·v of a pair within σ. So the filter keeps every touching
pair that possibly approaches, and the exact prediction decides whether it does.
*/

use haff_neighbors::Array;

use crate::{model::features::Features, search::compact::CompactParticle};

use super::{
    frame::FilterFrame,
    moving::Motion,
    sets::{LANES, MASK_BITS},
};

/// The bound of a member without contact: the largest number whose last bits can hold a lane.
pub(super) const NEVER: f32 = f32::from_bits(0x7f7f_ffff & !LANE);
/// Mask of the last bits of a bound. They hold its lane, so that the least bound also gives its member. This
/// changes a bound by far less than the margin.
const LANE: u32 = MASK_BITS as u32 - 1;

/// Factor by which a time is increased before bounds are compared with it. It covers the rounding of both.
const TIME_MARGIN: f32 = 1.0 + 1e-6;

/// The largest bound that can belong to a contact at most `time` from now [spans]. It is above zero for a
/// time of zero, too: the lane makes a bound of zero a small positive number.
#[inline(always)]
pub(super) fn limit(time: f64) -> f32 {
    time as f32 * TIME_MARGIN + f32::MIN_POSITIVE
}

/// Bounds of up to [`MASK_BITS`] members of a list, aligned for vector loads.
#[derive(Debug, Clone, Copy)]
#[repr(C, align(32))]
pub(super) struct Bounds {
    /// For each member a time from now before which there is no contact [spans], with the lane in its last
    /// bits. At least [`NEVER`] if there is no contact.
    time: [f32; MASK_BITS],
}

impl Bounds {
    pub fn new() -> Self {
        Self { time: [NEVER; MASK_BITS] }
    }

    /// The lane of a bound.
    #[inline(always)]
    pub fn lane(bound: f32) -> usize {
        (bound.to_bits() & LANE) as usize
    }

    /// Mask of the members among the first `count` whose bound is at most `limit`. `limit` must be less than
    /// [`NEVER`].
    #[inline(always)]
    pub fn up_to<const VECTORS: bool>(&self, count: usize, limit: f32) -> u64 {
        #[cfg(target_arch = "x86_64")]
        if VECTORS {
            // SAFETY: with `VECTORS` set the caller guarantees AVX2 and FMA.
            return unsafe { avx2::up_to(self, count, limit) };
        }
        self.time[..count].iter().rev().fold(0, |bits, time| bits << 1 | u64::from(*time <= limit))
    }
}

/// Computes bounds for the contacts of the particle `own` with the members of `list`, and returns the least
/// bound. `fraction` is the fraction of the span that has passed. `list` is padded to whole vectors; members
/// beyond the first [`MASK_BITS`] are ignored.
///
/// With `VECTORS` set the caller must be compiled for AVX2 and FMA, and run where they exist.
#[inline(always)]
pub(super) fn bounds<F: Features, const VECTORS: bool>(
    frame: &FilterFrame,
    particles: &Array<CompactParticle>,
    own: &CompactParticle,
    fraction: f32,
    list: &[u32],
    out: &mut Bounds,
) -> f32 {
    let list = &list[..list.len().min(MASK_BITS)];
    #[cfg(target_arch = "x86_64")]
    if VECTORS {
        // SAFETY: with `VECTORS` set the caller guarantees AVX2 and FMA.
        return unsafe { avx2::bounds::<F>(frame, particles, own, fraction, list, out) };
    }
    let mut least = f32::INFINITY;
    for (lane, (time, &j)) in out.time.iter_mut().zip(list).enumerate() {
        let bound = bound::<F>(frame, own, &particles[j as usize], fraction);
        *time = f32::from_bits(bound.to_bits() & !LANE | lane as u32);
        least = least.min(*time);
    }
    least
}

/// The bound for one pair: the scalar reference of the vector filter.
#[inline(always)]
fn bound<F: Features>(
    frame: &FilterFrame,
    own: &CompactParticle,
    other: &CompactParticle,
    fraction: f32,
) -> f32 {
    let (mut b, mut c, mut vv) = (-frame.noise, -frame.sigma2, 0.0);
    if !F::UNIFORM {
        let sigma = own.radius + other.radius;
        c = -(sigma * sigma);
    }
    let mut rs = [0.0; 3];
    let mut vs = [0.0; 3];
    for axis in 0..3 {
        vs[axis] = other.v[axis] - own.v[axis];
        rs[axis] = other.x[axis].wrapping_sub(own.x[axis]) as f32 * frame.unit[axis];
    }
    if F::DEFORMS {
        let Motion { tilt, shear, stretch, .. } = frame.motion;
        rs[0] += tilt * rs[1];
        vs[0] += tilt * vs[1] + shear * rs[1];
        for axis in 0..3 {
            vs[axis] += stretch[axis] * rs[axis];
        }
    }
    for axis in 0..3 {
        let v = vs[axis];
        let r = rs[axis] + v * fraction;
        b += r * v;
        c += r * r;
        vv += v * v;
    }
    let disc = b * b - vv * c;
    // For the sentinel b and `disc` are NaN, so both comparisons are false.
    if b < 0.0 && disc >= 0.0 { (c.max(0.0) / (disc.sqrt() - b)).min(NEVER) } else { NEVER }
}

#[cfg(target_arch = "x86_64")]
mod avx2 {
    use std::arch::x86_64::{
        _CMP_GE_OQ, _CMP_LE_OQ, _CMP_LT_OQ, _mm_cvtss_f32, _mm_min_ps, _mm_movehdup_ps, _mm_movehl_ps,
        _mm256_add_epi32, _mm256_add_ps, _mm256_and_ps, _mm256_blendv_ps, _mm256_castps256_ps128,
        _mm256_castsi256_ps, _mm256_cmp_ps, _mm256_cvtepi32_ps, _mm256_div_ps, _mm256_extractf128_ps,
        _mm256_fmadd_ps, _mm256_fmsub_ps, _mm256_load_ps, _mm256_max_ps, _mm256_min_ps, _mm256_movemask_ps,
        _mm256_mul_ps, _mm256_or_ps, _mm256_set1_epi32, _mm256_set1_ps, _mm256_setr_epi32, _mm256_setzero_ps,
        _mm256_sqrt_ps, _mm256_store_ps, _mm256_sub_epi32, _mm256_sub_ps,
    };

    use super::{Array, Bounds, Features, FilterFrame, LANE, LANES, MASK_BITS, Motion, NEVER};
    use crate::search::compact::{CompactParticle, avx2::load_halves};

    /// [`super::bounds`] for eight members at a time.
    #[target_feature(enable = "avx2,fma")]
    #[inline]
    pub(super) fn bounds<F: Features>(
        frame: &FilterFrame,
        particles: &Array<CompactParticle>,
        own: &CompactParticle,
        fraction: f32,
        list: &[u32],
        out: &mut Bounds,
    ) -> f32 {
        let [x, y, z] = own.x.map(|x| _mm256_set1_epi32(x));
        let [u, v, w] = own.v.map(|v| _mm256_set1_ps(v));
        let unit = frame.unit.map(|unit| _mm256_set1_ps(unit));
        let fraction = _mm256_set1_ps(fraction);
        let noise = _mm256_set1_ps(-frame.noise);
        let uniform = _mm256_set1_ps(-frame.sigma2);
        let zero = _mm256_setzero_ps();
        let never = _mm256_set1_ps(NEVER);
        let mut least = _mm256_set1_ps(f32::INFINITY);
        let all_but_lane = _mm256_castsi256_ps(_mm256_set1_epi32(!LANE as i32));
        let mut lanes = _mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7);
        for (indices, time) in list.chunks_exact(LANES).zip(out.time.chunks_exact_mut(LANES)) {
            // SAFETY: this code is compiled for AVX2. The eight `indices` are of a list, and a list contains
            // only indices of particles and of the sentinel, which are all in `particles`.
            let others = unsafe { load_halves(particles, indices) };
            let mut u = _mm256_sub_ps(others.v[0], u);
            let mut v = _mm256_sub_ps(others.v[1], v);
            let mut w = _mm256_sub_ps(others.v[2], w);
            let (x, y, z) = if F::DEFORMS {
                let Motion { tilt, shear, stretch, .. } = frame.motion;
                let begin = |axis: usize, own| {
                    let r = _mm256_cvtepi32_ps(_mm256_sub_epi32(others.x[axis], own));
                    _mm256_mul_ps(r, unit[axis])
                };
                let (y, z) = (begin(1, y), begin(2, z));
                let x = _mm256_fmadd_ps(_mm256_set1_ps(tilt), y, begin(0, x));
                u = _mm256_fmadd_ps(_mm256_set1_ps(tilt), v, u);
                u = _mm256_fmadd_ps(_mm256_set1_ps(shear), y, u);
                u = _mm256_fmadd_ps(_mm256_set1_ps(stretch[0]), x, u);
                v = _mm256_fmadd_ps(_mm256_set1_ps(stretch[1]), y, v);
                w = _mm256_fmadd_ps(_mm256_set1_ps(stretch[2]), z, w);
                (
                    _mm256_fmadd_ps(u, fraction, x),
                    _mm256_fmadd_ps(v, fraction, y),
                    _mm256_fmadd_ps(w, fraction, z),
                )
            } else {
                let separation = |axis: usize, own, v| {
                    let r = _mm256_cvtepi32_ps(_mm256_sub_epi32(others.x[axis], own));
                    _mm256_fmadd_ps(r, unit[axis], _mm256_mul_ps(v, fraction))
                };
                (separation(0, x, u), separation(1, y, v), separation(2, z, w))
            };
            let sigma2 = if F::UNIFORM {
                uniform
            } else {
                let sigma = _mm256_add_ps(others.radius, _mm256_set1_ps(own.radius));
                _mm256_sub_ps(zero, _mm256_mul_ps(sigma, sigma))
            };
            let b = _mm256_fmadd_ps(z, w, _mm256_fmadd_ps(y, v, _mm256_fmadd_ps(x, u, noise)));
            let vv = _mm256_fmadd_ps(w, w, _mm256_fmadd_ps(v, v, _mm256_mul_ps(u, u)));
            let c = _mm256_fmadd_ps(z, z, _mm256_fmadd_ps(y, y, _mm256_fmadd_ps(x, x, sigma2)));
            let disc = _mm256_fmsub_ps(b, b, _mm256_mul_ps(vv, c));
            let den = _mm256_sub_ps(_mm256_sqrt_ps(disc), b);
            let t = _mm256_div_ps(_mm256_max_ps(c, zero), den);
            let collides =
                _mm256_and_ps(_mm256_cmp_ps::<_CMP_LT_OQ>(b, zero), _mm256_cmp_ps::<_CMP_GE_OQ>(disc, zero));
            let t = _mm256_min_ps(_mm256_blendv_ps(never, t, collides), never);
            let t = _mm256_or_ps(_mm256_and_ps(t, all_but_lane), _mm256_castsi256_ps(lanes));
            lanes = _mm256_add_epi32(lanes, _mm256_set1_epi32(LANES as i32));
            least = _mm256_min_ps(least, t);
            // SAFETY: this stores eight words, the length of `time`. `Bounds` is aligned to 32 bytes, and
            // every chunk of it is 32 bytes long, so `time` is aligned to 32 bytes, too.
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
        for (k, time) in bounds.time[..count.min(MASK_BITS)].chunks_exact(LANES).enumerate() {
            // SAFETY: this loads the eight words of `time`, which is aligned as in `bounds`.
            let time = unsafe { _mm256_load_ps(time.as_ptr()) };
            bits |= (_mm256_movemask_ps(_mm256_cmp_ps::<_CMP_LE_OQ>(time, limit)) as u64) << (k * LANES);
        }
        bits
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;
    use haff_neighbors::Axis;
    use haff_testing::Random;

    use super::*;
    use crate::{
        model::{System, features::With},
        search::lists::frame::Extent,
        state::world::World,
    };

    fn number(random: &mut Random) -> f64 {
        random.uniform(-1.0, 1.0)
    }

    fn direction(random: &mut Random) -> DVec3 {
        DVec3::new(number(random), number(random), number(random)).normalize()
    }

    const EDGE: f64 = 40.0;

    /// A frame in a box of edge [`EDGE`], and a world of two particles whose speeds are up to one.
    fn frame<F: Features>(radii: [f64; 2]) -> (FilterFrame, World) {
        let gravity = if F::GRAVITY { DVec3::new(0.1, 0.0, -0.6) } else { DVec3::ZERO };
        let body = |class| crate::model::Body {
            position: DVec3::ZERO,
            velocity: DVec3::X,
            image: [0; 3],
            class,
            species: 0,
        };
        let system = System {
            spin: None,
            drag: None,
            drives: Vec::new(),
            measure: crate::Measure::default(),
            flow: None,
            seed: 0,
            dimension: crate::model::Dimension::Three,
            domain: crate::model::Domain {
                size: DVec3::splat(EDGE),
                boundary: [crate::model::Boundary::Periodic; 3],
                gravity,
                shear: None,
                compression: None,
            },
            bodies: vec![body(0), body(1)],
            classes: radii.map(|radius| crate::model::Class { radius, mass: 1.0, group: 0 }).to_vec(),
            groups: Vec::new(),
            species: Vec::new(),
            walls: Vec::new(),
            contacts: crate::model::Contacts { pair: Vec::new(), wall: Vec::new(), tc: 0.0, rest_speed: 0.0 },
        };
        let world = World::new(&system, -52);
        let extent = Extent {
            axes: [Axis::Periodic; 3],
            size: DVec3::splat(EDGE),
            beyond: [[0.0; 2]; 3],
            contact: [1.0, 2.0 * radii[1]],
            reach: 2.2,
            gravity,
            bend: 0.05,
            moving: None,
        };
        let mut frame = FilterFrame::new(&extent).expect("the box is large enough");
        frame.begin::<F>(&world, world.now, true);
        (frame, world)
    }

    /// Bounds of one pair, without and with vector instructions. The pair is in one lane of a vector; the
    /// other lanes contain the sentinel.
    fn both<F: Features>(
        frame: &FilterFrame,
        own: &CompactParticle,
        other: &CompactParticle,
        fraction: f32,
        lane: usize,
    ) -> [f32; 2] {
        let particles: Array<_> = [*own, *other, CompactParticle::SENTINEL].into_iter().collect();
        let mut list = [2; LANES];
        list[lane] = 1;
        let mut out = Bounds::new();
        let mut found = [0.0; 2];
        found[0] = bounds::<F, false>(frame, &particles, own, fraction, &list, &mut out);
        found[1] = found[0];
        #[cfg(target_arch = "x86_64")]
        if is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma") {
            // SAFETY: the features have just been detected.
            unsafe {
                found[1] = avx2::bounds::<F>(frame, &particles, own, fraction, &list, &mut out);
                assert_eq!(avx2::up_to(&out, LANES, 0.9 * NEVER) == 1 << lane, found[1] < 0.9 * NEVER);
            }
        }
        for bound in found {
            assert!(bound >= NEVER || Bounds::lane(bound) == lane, "lane {lane}: {bound}");
        }
        found
    }

    /// Checks the bounds of `count` random pairs at distances within a list, at random times of a span: pairs
    /// that graze, that touch, that collide head on, and that do not collide; slow pairs and fast pairs.
    /// Returns the number of pairs that collide, and the number of bounds that are earlier than the contact
    /// by at most 1 % and 10⁻³ time units.
    fn check_bounds<F: Features>(radii: [f64; 2], count: usize) -> [usize; 2] {
        let (frame, mut world) = frame::<F>(radii);
        let sigma = radii[0] + radii[1];
        let tick = world.clock.tick;
        let span = (frame.end - frame.begin) as f64 * tick;
        let mut random = Random(7);
        let mut found = [0; 2];
        for k in 0..count {
            let fraction = (0.5 + 0.5 * number(&mut random)).min(0.99);
            world.now = frame.begin + (fraction * (frame.end - frame.begin) as f64) as i64;
            // Often the velocities are nearly equal: their difference is then far smaller than they are.
            let common = direction(&mut random) * number(&mut random).abs();
            let slow = libm::pow(10.0, -2.0 - 2.0 * number(&mut random));
            let v = direction(&mut random) * slow.min(1.0);
            let edge = [1.0 - 1e-9, 1.0 - 1e-6, 1.0 - 1e-3, 1.0, 1.0 + 1e-9, 1.2][k % 6];
            let r = match k % 4 {
                // A grazing contact at a later time.
                0 => {
                    direction(&mut random).cross(v).normalize() * (edge * sigma)
                        - v.normalize() * number(&mut random)
                }
                1 => direction(&mut random) * (edge.max(1.0) * sigma),
                2 => v.normalize() * -(edge.max(1.0) * sigma),
                _ => direction(&mut random) * (sigma * (1.6 + 0.55 * number(&mut random))),
            };
            let position = (direction(&mut random) + 1.0) * (0.5 * EDGE);
            let velocities = [common * 0.5, common * 0.5 + v * 0.5];
            for (i, (position, velocity)) in
                [(position, velocities[0]), (position + r, velocities[1])].into_iter().enumerate()
            {
                let particle = &mut world.particles[i];
                particle.position = position;
                particle.velocity = velocity;
                particle.time = world.now;
                world.wrap_anchor(i as u32);
            }
            let (own, other) = (frame.compact::<F>(&world, 0), frame.compact::<F>(&world, 1));
            let bounds = both::<F>(&frame, &own, &other, frame.fraction(world.now), k % LANES);
            let expected = haff_mechanics::time_to_contact(r, velocities[1] - velocities[0], sigma);
            // After this time one of the two particles has possibly left its skin sphere.
            let listed = 0.6 / velocities[0].length().max(velocities[1].length());
            if let Some(time) = expected.filter(|time| *time <= listed) {
                found[0] += 1;
                for bound in bounds {
                    assert!(bound <= limit(time / span), "{k}: bound {bound} of {time}; r = {r}, v = {v}");
                }
                found[1] += usize::from(f64::from(bounds[0]) * span > 0.99 * time - 1e-3);
            } else if expected.is_none()
                && r.length() > 1.001 * sigma
                && r.dot(v) > 1e-2 * r.length() * v.length()
                && slow > 0.1
            {
                assert!(
                    bounds[0] >= NEVER && bounds[1] >= NEVER,
                    "{k}: {bounds:?} for a pair that separates"
                );
            }
        }
        found
    }

    #[test]
    fn no_bound_is_later_than_the_contact() {
        for found in [
            check_bounds::<With<false, true>>([0.5, 0.5], 200_000),
            check_bounds::<With<false, false>>([0.5, 0.3], 200_000),
            check_bounds::<With<true, true>>([0.5, 0.5], 200_000),
            check_bounds::<With<true, false>>([0.5, 0.3], 200_000),
        ] {
            assert!(found[0] > 30_000 && 2 * found[1] > found[0], "{found:?}");
        }
    }

    #[test]
    fn sentinel_has_no_contact() {
        let (frame, world) = frame::<With<false, true>>([0.5; 2]);
        let own = frame.compact::<With<false, true>>(&world, 0);
        for lane in 0..LANES {
            let found = both::<With<false, true>>(&frame, &own, &CompactParticle::SENTINEL, 0.5, lane);
            assert!(found.iter().all(|bound| *bound >= NEVER), "{found:?}");
        }
    }
}
