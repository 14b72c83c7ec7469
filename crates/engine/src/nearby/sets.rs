/*!
Short lists of particles: the place of a particle in one, and the members of one that are in another.

Whole vectors are compared, without a branch on each element: it could not be predicted.
*/

pub(super) use crate::compact::LANES;

/// Most elements of a list that are told as bits.
pub(super) const MOST: usize = u64::BITS as usize;

/// The first place of `j` in a list of whole vectors.
///
/// With `VECTORS` set the caller must be compiled for AVX2, and run where it exists; so for all of this
/// module.
#[inline(always)]
pub(super) fn place_of<const VECTORS: bool>(list: &[u32], j: u32) -> Option<usize> {
    for (k, vector) in list.chunks_exact(LANES).enumerate() {
        let equal = equal::<VECTORS>(vector, j);
        if equal != 0 {
            return Some(k * LANES + equal.trailing_zeros() as usize);
        }
    }
    None
}

/// Which of eight are `j`.
#[inline(always)]
fn equal<const VECTORS: bool>(vector: &[u32], j: u32) -> u32 {
    #[cfg(target_arch = "x86_64")]
    if VECTORS && let Some(vector) = vector.first_chunk() {
        // SAFETY: the caller has the features.
        return unsafe { avx2::equal(vector, j) };
    }
    vector.iter().rev().fold(0, |bits, &other| bits << 1 | u32::from(other == j))
}

/// Which of a list's first `count` elements, [`MOST`] at most, stand in `among`. The list goes on to whole
/// vectors.
#[inline(always)]
pub(super) fn members<const VECTORS: bool>(list: &[u32], count: usize, among: &[u32]) -> u64 {
    debug_assert!(count <= MOST && count <= list.len());
    let mut found = 0;
    for (k, vector) in list[..count.next_multiple_of(LANES)].chunks_exact(LANES).enumerate() {
        found |= u64::from(any::<VECTORS>(vector, among)) << (k * LANES);
    }
    found & all(count)
}

/// As many bits as there are elements.
pub(super) fn all(count: usize) -> u64 {
    if count == 0 { 0 } else { u64::MAX >> (MOST - count) }
}

/// Which of eight stand in `among`.
#[inline(always)]
fn any<const VECTORS: bool>(vector: &[u32], among: &[u32]) -> u32 {
    #[cfg(target_arch = "x86_64")]
    if VECTORS && let Some(vector) = vector.first_chunk() {
        // SAFETY: the caller has the features.
        return unsafe { avx2::any(vector, among) };
    }
    among.iter().fold(0, |found, &j| found | equal::<false>(vector, j))
}

#[cfg(target_arch = "x86_64")]
mod avx2 {
    use std::arch::x86_64::{
        __m256i, _mm256_castsi256_ps, _mm256_cmpeq_epi32, _mm256_loadu_si256, _mm256_movemask_ps,
        _mm256_or_si256, _mm256_set1_epi32, _mm256_setzero_si256,
    };

    use super::LANES;

    #[target_feature(enable = "avx2")]
    #[inline]
    fn load(vector: &[u32; LANES]) -> __m256i {
        // SAFETY: eight words.
        unsafe { _mm256_loadu_si256(vector.as_ptr().cast()) }
    }

    #[target_feature(enable = "avx2")]
    #[inline]
    fn bits(mask: __m256i) -> u32 {
        _mm256_movemask_ps(_mm256_castsi256_ps(mask)) as u32
    }

    #[target_feature(enable = "avx2")]
    #[inline]
    pub(super) fn equal(vector: &[u32; LANES], j: u32) -> u32 {
        bits(_mm256_cmpeq_epi32(load(vector), _mm256_set1_epi32(j as i32)))
    }

    #[target_feature(enable = "avx2")]
    #[inline]
    pub(super) fn any(vector: &[u32; LANES], among: &[u32]) -> u32 {
        let vector = load(vector);
        let mut found = _mm256_setzero_si256();
        for &j in among {
            found = _mm256_or_si256(found, _mm256_cmpeq_epi32(vector, _mm256_set1_epi32(j as i32)));
        }
        bits(found)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2")]
    fn with_vectors(list: &[u32], count: usize, among: &[u32], j: u32) -> (u64, Option<usize>) {
        (members::<true>(list, count, among), place_of::<true>(list, j))
    }

    #[test]
    fn members_and_places_are_those_of_plain_loops() {
        let mut seed = 1_u64;
        let mut random = |n: u64| {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (seed >> 33) % n
        };
        let mut found = [0; 2];
        for _ in 0..20_000 {
            let count = random(MOST as u64 + 1) as usize;
            let list: Vec<u32> = (0..count.next_multiple_of(LANES)).map(|_| random(60) as u32).collect();
            let among: Vec<u32> = (0..random(40)).map(|_| random(60) as u32).collect();
            let j = random(60) as u32;
            let expected =
                (0..count).filter(|&k| among.contains(&list[k])).fold(0, |bits, k| bits | 1_u64 << k);
            let place = list.iter().position(|&other| other == j);
            assert_eq!(members::<false>(&list, count, &among), expected);
            assert_eq!(place_of::<false>(&list, j), place);
            #[cfg(target_arch = "x86_64")]
            if is_x86_feature_detected!("avx2") {
                // SAFETY: the feature has just been found.
                assert_eq!(unsafe { with_vectors(&list, count, &among, j) }, (expected, place));
            }
            found[0] += usize::from(place.is_some());
            found[1] += expected.count_ones() as usize;
        }
        assert!(found[0] > 5000 && found[1] > 100_000, "{found:?}");
    }
}
