/*!
Short lists of indices: the position of an index in a list, and the elements of one list that are in another.

Whole vectors are compared, without a branch for each element, which the processor could not predict.
*/

pub(super) use crate::search::compact::LANES;

/// Largest number of list elements for which a mask has bits.
pub(super) const MASK_BITS: usize = u64::BITS as usize;

/// The first position of `j` in a list of whole vectors.
///
/// With `VECTORS` set the caller must be compiled for AVX2, and run where it exists. This holds for all
/// functions of this module.
#[inline(always)]
pub(super) fn position_in<const VECTORS: bool>(list: &[u32], j: u32) -> Option<usize> {
    for (k, vector) in list.chunks_exact(LANES).enumerate() {
        let equal = equal::<VECTORS>(vector, j);
        if equal != 0 {
            return Some(k * LANES + equal.trailing_zeros() as usize);
        }
    }
    None
}

/// Mask of the elements equal to `j` in a vector of eight.
#[inline(always)]
fn equal<const VECTORS: bool>(vector: &[u32], j: u32) -> u32 {
    #[cfg(target_arch = "x86_64")]
    if VECTORS && let Some(vector) = vector.first_chunk() {
        // SAFETY: with `VECTORS` set the caller guarantees AVX2.
        return unsafe { avx2::equal(vector, j) };
    }
    vector.iter().rev().fold(0, |bits, &other| bits << 1 | u32::from(other == j))
}

/// Mask of the elements among the first `count` of a list that are in `among`. `count` is at most
/// [`MASK_BITS`], and the list is padded to whole vectors.
#[inline(always)]
pub(super) fn members<const VECTORS: bool>(list: &[u32], count: usize, among: &[u32]) -> u64 {
    debug_assert!(count <= MASK_BITS && count <= list.len());
    let mut found = 0;
    for (k, vector) in list[..count.next_multiple_of(LANES)].chunks_exact(LANES).enumerate() {
        found |= u64::from(equal_any::<VECTORS>(vector, among)) << (k * LANES);
    }
    found & low_bits(count)
}

/// Mask with the lowest `count` bits set.
pub(super) fn low_bits(count: usize) -> u64 {
    if count == 0 { 0 } else { u64::MAX >> (MASK_BITS - count) }
}

/// Mask of the elements in a vector of eight that are in `among`.
#[inline(always)]
fn equal_any<const VECTORS: bool>(vector: &[u32], among: &[u32]) -> u32 {
    #[cfg(target_arch = "x86_64")]
    if VECTORS && let Some(vector) = vector.first_chunk() {
        // SAFETY: with `VECTORS` set the caller guarantees AVX2.
        return unsafe { avx2::equal_any(vector, among) };
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
        // SAFETY: this loads the eight words of `vector`; the load needs no alignment.
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
    pub(super) fn equal_any(vector: &[u32; LANES], among: &[u32]) -> u32 {
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
    use haff_testing::Random;

    use super::*;

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2")]
    fn with_vectors(list: &[u32], count: usize, among: &[u32], j: u32) -> (u64, Option<usize>) {
        (members::<true>(list, count, among), position_in::<true>(list, j))
    }

    #[test]
    fn members_and_positions_match_plain_loops() {
        let mut generator = Random(1);
        let mut random = |n: usize| generator.index(n);
        let mut found = [0; 2];
        for _ in 0..20_000 {
            let count = random(MASK_BITS + 1);
            let list: Vec<u32> = (0..count.next_multiple_of(LANES)).map(|_| random(60) as u32).collect();
            let among: Vec<u32> = (0..random(40)).map(|_| random(60) as u32).collect();
            let j = random(60) as u32;
            let expected =
                (0..count).filter(|&k| among.contains(&list[k])).fold(0, |bits, k| bits | 1_u64 << k);
            let position = list.iter().position(|&other| other == j);
            assert_eq!(members::<false>(&list, count, &among), expected);
            assert_eq!(position_in::<false>(&list, j), position);
            #[cfg(target_arch = "x86_64")]
            if is_x86_feature_detected!("avx2") {
                // SAFETY: the feature has just been detected.
                assert_eq!(unsafe { with_vectors(&list, count, &among, j) }, (expected, position));
            }
            found[0] += usize::from(position.is_some());
            found[1] += expected.count_ones() as usize;
        }
        assert!(found[0] > 5000 && found[1] > 100_000, "{found:?}");
    }
}
