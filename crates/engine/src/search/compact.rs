/*!
Compact particles: the data of a particle that the filters of windows and lists read, half a cache line.

Positions are integer coordinates. The period of the positions is 2^32 coordinates, so that the difference of
two coordinates modulo 2^32 is the difference to the nearest image. Displacements within a span of time (a
window, or a span of [`crate::search::lists`]) are in single precision. The filters widen contact distances
by a margin that covers these roundings; pairs that pass are predicted from their anchors in double precision.
*/

/// Number of particles in a vector.
pub(crate) const LANES: usize = 8;
/// Number of integer coordinates in a period.
pub(crate) const PERIOD: f64 = (1_u64 << 32) as f64;
/// Longest span of time \[ticks\]: its start and its end are far below 2^63.
pub(crate) const LONGEST_SPAN: f64 = (1_u64 << 59) as f64;
/// Factor by which particles can exceed the largest speed at the start of a span of time before this span has
/// to end early.
pub(crate) const HEADROOM: f64 = 1.5;
/// A distance below this fraction of a period is certain to be the one to the nearest image.
pub(crate) const NEAREST: f64 = 0.45;

/// The integer nearest to `x`, modulo 2^32, for |x| < 2^51. The addition of 1.5 · 2^52 rounds `x` to an
/// integer, whose lower bits are then the lower bits of the sum.
#[inline(always)]
pub(crate) fn coordinate(x: f64) -> i32 {
    (x + 6_755_399_441_055_744.0).to_bits() as i32
}

/// A particle as filters read it.
#[derive(Debug, Clone, Copy, Default)]
#[repr(C, align(32))]
pub(crate) struct CompactParticle {
    /// Position at the start of the span of time, extrapolated from the present flight \[coordinates\].
    pub x: [i32; 3],
    /// Radius with its margin [unit of length of the filter].
    pub radius: f32,
    /// Displacement within the span of time [unit of length of the filter].
    pub v: [f32; 3],
    /// In lists: the event counter of the particle. Windows read the counter of the anchor; there this is
    /// [`Self::longest`].
    pub count: u32,
}

impl CompactParticle {
    /// A sentinel for lists: their filter finds no contact with it.
    pub const SENTINEL: Self = Self { x: [0; 3], radius: 0.0, v: [f32::NAN; 3], count: 0 };

    /// Whether the square of the displacement is at most `limit2`; false for NaN.
    #[inline(always)]
    pub fn is_within(&self, limit2: f32) -> bool {
        let v = self.v;
        v[0] * v[0] + v[1] * v[1] + v[2] * v[2] <= limit2
    }

    /// In windows: the square of the longest displacement among the earlier paths in the window [length²], if
    /// these are [noted](Self::note_path).
    pub fn longest(&self) -> f32 {
        f32::from_bits(self.count)
    }

    /// Notes that the particle is about to leave its path.
    #[inline(always)]
    pub fn note_path(&mut self) {
        let v = self.v;
        let square = v[0] * v[0] + v[1] * v[1] + v[2] * v[2];
        self.count = self.longest().max(square).to_bits();
    }

    /// Copies the particle to `target` in two halves, as [`avx2::load_halves`] reads it: a load stalls on
    /// store forwarding if it covers several smaller stores that have just been made.
    #[inline(always)]
    pub fn store(self, target: &mut Self) {
        #[cfg(target_arch = "x86_64")]
        // SAFETY: the two stores of 16 bytes cover the 32 bytes of `target`, which is aligned to 32 bytes;
        // SSE2 is part of x86-64.
        unsafe {
            use std::arch::x86_64::{_mm_setr_epi32, _mm_setr_ps, _mm_store_ps, _mm_store_si128};
            let ([x, y, z], [u, v, w]) = (self.x, self.v);
            let half = std::ptr::from_mut(target).cast::<f32>();
            _mm_store_si128(half.cast(), _mm_setr_epi32(x, y, z, self.radius.to_bits() as i32));
            _mm_store_ps(half.add(4), _mm_setr_ps(u, v, w, f32::from_bits(self.count)));
        }
        #[cfg(not(target_arch = "x86_64"))]
        {
            *target = self;
        }
    }
}

#[cfg(target_arch = "x86_64")]
pub(crate) mod avx2 {
    use std::arch::x86_64::{
        __m256, __m256i, _mm_load_ps, _mm256_castps_si256, _mm256_castps128_ps256, _mm256_insertf128_ps,
        _mm256_load_ps, _mm256_permute2f128_ps, _mm256_shuffle_ps, _mm256_unpackhi_ps, _mm256_unpacklo_ps,
    };

    use haff_neighbors::{Array, Elements};

    use super::CompactParticle;

    /// Eight compact particles, one lane each.
    pub(crate) struct Eight {
        pub x: [__m256i; 3],
        pub radius: __m256,
        pub v: [__m256; 3],
    }

    // These functions have `inline(always)`, which excludes `target_feature`: as calls they take 10 % more
    // instructions per collision with windows. Their callers must therefore be compiled for AVX2.

    /// Loads the eight particles with these indices, each by one load.
    ///
    /// # Safety
    ///
    /// The caller must be compiled for AVX2; `indices` has eight elements, which are indices of the particles
    /// that begin at `start`.
    #[inline(always)]
    pub(crate) unsafe fn load_whole(start: *const CompactParticle, indices: &[u32]) -> Eight {
        // SAFETY: the caller guarantees AVX2 and eight valid indices; a particle has 32 bytes and is aligned
        // to 32 bytes.
        unsafe {
            let row = |k: usize| _mm256_load_ps(start.add(*indices.get_unchecked(k) as usize).cast());
            let (r0, r1, r2, r3) = (row(0), row(1), row(2), row(3));
            let (r4, r5, r6, r7) = (row(4), row(5), row(6), row(7));
            transpose(
                [
                    _mm256_permute2f128_ps::<0x20>(r0, r4),
                    _mm256_permute2f128_ps::<0x20>(r1, r5),
                    _mm256_permute2f128_ps::<0x20>(r2, r6),
                    _mm256_permute2f128_ps::<0x20>(r3, r7),
                ],
                [
                    _mm256_permute2f128_ps::<0x31>(r0, r4),
                    _mm256_permute2f128_ps::<0x31>(r1, r5),
                    _mm256_permute2f128_ps::<0x31>(r2, r6),
                    _mm256_permute2f128_ps::<0x31>(r3, r7),
                ],
            )
        }
    }

    /// Like [`load_whole`], but with two loads per particle: faster for particles that have just been
    /// [stored](CompactParticle::store).
    ///
    /// # Safety
    ///
    /// That of [`load_whole`].
    #[inline(always)]
    pub(crate) unsafe fn load_halves(particles: &Array<CompactParticle>, indices: &[u32]) -> Eight {
        debug_assert!(indices[..8].iter().all(|&index| (index as usize) < particles.len()));
        // SAFETY: as in `load_whole`; the two halves of a particle have 16 bytes each and are aligned to 16
        // bytes.
        unsafe {
            let half = |k: usize, half: usize| {
                let particle = particles.start().add(*indices.get_unchecked(k) as usize);
                _mm_load_ps(particle.cast::<f32>().add(4 * half))
            };
            let rows = |k: usize, part: usize| {
                _mm256_insertf128_ps::<1>(_mm256_castps128_ps256(half(k, part)), half(k + 4, part))
            };
            transpose(
                [rows(0, 0), rows(1, 0), rows(2, 0), rows(3, 0)],
                [rows(0, 1), rows(1, 1), rows(2, 1), rows(3, 1)],
            )
        }
    }

    /// Transposes eight particles. `a` holds their first halves and `b` their second ones, with particles k
    /// and k + 4 in element k.
    ///
    /// # Safety
    ///
    /// The caller must be compiled for AVX2.
    #[inline(always)]
    unsafe fn transpose(a: [__m256; 4], b: [__m256; 4]) -> Eight {
        // SAFETY: the caller guarantees AVX2.
        unsafe {
            let (t0, t1) = (_mm256_unpacklo_ps(a[0], a[1]), _mm256_unpacklo_ps(a[2], a[3]));
            let (t2, t3) = (_mm256_unpackhi_ps(a[0], a[1]), _mm256_unpackhi_ps(a[2], a[3]));
            let (s0, s1) = (_mm256_unpacklo_ps(b[0], b[1]), _mm256_unpacklo_ps(b[2], b[3]));
            let (s2, s3) = (_mm256_unpackhi_ps(b[0], b[1]), _mm256_unpackhi_ps(b[2], b[3]));
            Eight {
                x: [
                    _mm256_castps_si256(_mm256_shuffle_ps::<0x44>(t0, t1)),
                    _mm256_castps_si256(_mm256_shuffle_ps::<0xee>(t0, t1)),
                    _mm256_castps_si256(_mm256_shuffle_ps::<0x44>(t2, t3)),
                ],
                radius: _mm256_shuffle_ps::<0xee>(t2, t3),
                v: [
                    _mm256_shuffle_ps::<0x44>(s0, s1),
                    _mm256_shuffle_ps::<0xee>(s0, s1),
                    _mm256_shuffle_ps::<0x44>(s2, s3),
                ],
            }
        }
    }
}
