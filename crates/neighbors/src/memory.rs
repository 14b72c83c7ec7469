//! Huge pages for large arrays, and prefetching of cache lines.

/// Arrays of at least this size are allocated on huge pages \[bytes\].
const LARGE: usize = 1 << 20;
/// Usual size of a huge page \[bytes\].
const HUGE: usize = 1 << 21;
/// The size of an array that needs at most this number of huge pages is rounded up to whole pages.
const FEW: usize = 8;
/// Size of other pages \[bytes\]. It also covers the header that an allocator stores before the array.
const PAGE: usize = 4096;

/// An empty vector with space for at least `capacity` elements, on huge pages if it is large and the system
/// has them.
///
/// Without huge pages each random access to an array of more than a few megabytes costs a walk through the
/// page tables. The gain is in the benchmark record.
pub fn with_huge_pages<T>(capacity: usize) -> Vec<T> {
    let bytes = capacity.saturating_mul(size_of::<T>());
    let few = cfg!(target_os = "linux") && (LARGE..FEW * HUGE - PAGE).contains(&bytes);
    // A mapping of whole huge pages is aligned to them.
    let capacity =
        if few { ((bytes + PAGE).next_multiple_of(HUGE) - PAGE) / size_of::<T>() } else { capacity };
    let mut vector: Vec<T> = Vec::with_capacity(capacity);
    #[cfg(target_os = "linux")]
    {
        let spare = vector.spare_capacity_mut();
        let (start, bytes) = (spare.as_mut_ptr().cast::<u8>(), size_of_val(spare));
        if bytes >= LARGE {
            // The advice must begin at a page, so it includes the allocator's header.
            let before = start as usize % PAGE;
            // SAFETY: the pages belong to an allocation. The advice changes only which physical memory backs
            // them. This is also true for other allocations on the same pages. If the call fails, nothing
            // changes.
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

/// Prefetches the cache line of `value`, without any other effect. On processors other than x86-64 this does
/// nothing. The gain is in the benchmark record.
#[inline(always)]
pub fn prefetch<T>(value: &T) {
    prefetch_address(value);
}

/// Elements in memory, one after the other.
pub trait Elements {
    /// The type of the elements.
    type Element;
    /// The address of the first element.
    fn start(&self) -> *const Self::Element;
}

impl<T> Elements for [T] {
    type Element = T;

    #[inline(always)]
    fn start(&self) -> *const T {
        self.as_ptr()
    }
}

impl<T> Elements for Vec<T> {
    type Element = T;

    #[inline(always)]
    fn start(&self) -> *const T {
        self.as_ptr()
    }
}

/// [`prefetch`] of an element. The index is not checked: it can be out of bounds.
#[inline(always)]
pub fn prefetch_at<E: Elements + ?Sized>(elements: &E, index: usize) {
    prefetch_address(elements.start().wrapping_add(index));
}

#[inline(always)]
fn prefetch_address<T>(address: *const T) {
    #[cfg(target_arch = "x86_64")]
    // SAFETY: a prefetch has no visible effect and cannot fault at any address; SSE is part of x86-64.
    unsafe {
        use std::arch::x86_64::{_MM_HINT_T0, _mm_prefetch};
        _mm_prefetch::<_MM_HINT_T0>(address.cast());
    }
    #[cfg(not(target_arch = "x86_64"))]
    let _ = address;
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn vectors_of_all_sizes_have_capacity_and_keep_their_elements() {
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
            let mut vector: Vec<u64> = with_huge_pages(capacity);
            assert!(vector.is_empty() && vector.capacity() >= capacity);
            vector.extend((0..capacity as u64).map(|k| k * k));
            assert!((0..capacity).all(|k| vector[k] == (k * k) as u64));
        }
    }
}
