//! Memory at its best: huge pages for large arrays, and cache lines asked for ahead of their use.

/// Arrays of at least this size are given huge pages \[bytes\], …
const LARGE: usize = 1 << 20;
/// … which are of this size, as a rule; arrays of up to so many of them get whole ones.
const HUGE: usize = 1 << 21;
const FEW: usize = 8;
/// Size of other pages: an allocator needs a little room for itself.
const PAGE: usize = 4096;

/// An empty vector with room for `capacity` elements or a few more, on huge pages if it is large and the system has them.
///
/// Random access to more than a few megabytes otherwise costs a walk through the page tables each time. What this gains
/// stands in the benchmark record.
pub fn roomy<T>(capacity: usize) -> Vec<T> {
    let bytes = capacity.saturating_mul(size_of::<T>());
    let few = cfg!(target_os = "linux") && (LARGE..FEW * HUGE - PAGE).contains(&bytes);
    // A mapping of whole huge pages is put where these begin.
    let capacity =
        if few { ((bytes + PAGE).next_multiple_of(HUGE) - PAGE) / size_of::<T>() } else { capacity };
    let mut vector: Vec<T> = Vec::with_capacity(capacity);
    #[cfg(target_os = "linux")]
    {
        let room = vector.spare_capacity_mut();
        let (start, bytes) = (room.as_mut_ptr().cast::<u8>(), size_of_val(room));
        if bytes >= LARGE {
            // With what the allocator keeps before it.
            let before = start as usize % PAGE;
            // SAFETY: the pages of an allocation; the advice changes nothing but how they are backed, for whoever else has a part of
            // them too, and whether it is taken does not matter.
            unsafe {
                libc::madvise(
                    start.wrapping_sub(before).cast(),
                    (before + bytes).next_multiple_of(PAGE),
                    libc::MADV_HUGEPAGE,
                );
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
        for capacity in [
            0,
            5,
            LARGE / 8 - 1,
            LARGE / 8,
            HUGE / 8 - 512,
            HUGE / 8,
            FEW * HUGE / 8 - 512,
            FEW * HUGE / 8,
            4 * HUGE + 3,
        ] {
            let mut vector: Vec<u64> = roomy(capacity);
            assert!(vector.is_empty() && vector.capacity() >= capacity);
            vector.extend((0..capacity as u64).map(|k| k * k));
            assert!((0..capacity).all(|k| vector[k] == (k * k) as u64));
        }
    }
}
