//! Memory at its best: huge pages for large arrays, and cache lines asked for ahead of their use.

/// Arrays of at least this size are given huge pages \[bytes\]: a few of them must fit.
const HUGE: usize = 1 << 22;

/// An empty vector with room for `capacity` elements, on huge pages if it is large and the system has them.
///
/// Random access to hundreds of megabytes otherwise costs a walk through the page tables each time. What this gains
/// stands in the benchmark record.
pub fn roomy<T>(capacity: usize) -> Vec<T> {
    let mut vector: Vec<T> = Vec::with_capacity(capacity);
    #[cfg(target_os = "linux")]
    {
        const PAGE: usize = 4096;
        let room = vector.spare_capacity_mut();
        let (start, bytes) = (room.as_mut_ptr().cast::<u8>(), size_of_val(room));
        let skip = start.align_offset(PAGE);
        if bytes >= HUGE && skip < bytes {
            // SAFETY: whole pages inside an allocation that is ours alone; the advice changes nothing but how they are
            // backed, and whether it is taken does not matter.
            unsafe {
                libc::madvise(start.add(skip).cast(), (bytes - skip) / PAGE * PAGE, libc::MADV_HUGEPAGE);
            }
        }
    }
    vector
}

/// Asks the processor to bring the cache line of `place` near; nothing else happens. What this gains stands in the
/// benchmark record; on other processors than x86-64 it is nothing at all.
#[inline(always)]
pub fn prefetch<T>(place: &T) {
    prefetch_address(place);
}

/// [`prefetch`] of an element, whether there is one or not: nobody has to look whether the index is within bounds.
#[inline(always)]
pub fn prefetch_at<T>(elements: &[T], index: usize) {
    prefetch_address(elements.as_ptr().wrapping_add(index));
}

#[inline(always)]
fn prefetch_address<T>(place: *const T) {
    #[cfg(target_arch = "x86_64")]
    // SAFETY: a prefetch reads nothing that the program could see and cannot fault at any address; SSE is part of x86-64.
    unsafe {
        use std::arch::x86_64::{_MM_HINT_T0, _mm_prefetch};
        _mm_prefetch::<_MM_HINT_T0>(place.cast());
    }
    #[cfg(not(target_arch = "x86_64"))]
    let _ = place;
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn large_and_small_vectors_are_vectors() {
        for capacity in [0, 5, HUGE / 8 - 1, HUGE / 8, HUGE + 3] {
            let mut vector: Vec<u64> = roomy(capacity);
            assert!(vector.is_empty() && vector.capacity() >= capacity);
            vector.extend((0..capacity as u64).map(|k| k * k));
            assert!((0..capacity).all(|k| vector[k] == (k * k) as u64));
        }
    }
}
