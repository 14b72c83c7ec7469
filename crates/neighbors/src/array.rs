//! Arrays of which several threads can change different elements.

use std::{
    fmt,
    mem::ManuallyDrop,
    ops::{Deref, DerefMut, Index, IndexMut, Range},
    ptr::NonNull,
};

use crate::memory::Elements;

/// A vector whose elements are accessed one by one by their index.
///
/// An index never borrows the whole array, so that the [aliases](Self::alias) of an array can be used by
/// different threads, each for other elements. As a slice it must be used by one thread alone.
pub struct Array<T> {
    start: NonNull<T>,
    len: usize,
    /// Capacity of the vector that owns the elements; `None` for an alias.
    capacity: Option<usize>,
}

// SAFETY: an owner is a vector. The caller of `alias` guarantees that no two threads use the same element if
// one of them changes it.
unsafe impl<T: Send> Send for Array<T> {}
// SAFETY: shared references only read.
unsafe impl<T: Sync> Sync for Array<T> {}

impl<T> Array<T> {
    /// An array of the same elements, of the same length.
    ///
    /// # Safety
    ///
    /// The alias is not used once its owner has been dropped or has another length. As long as one thread
    /// changes an element through one of them, no other thread reads or changes this element.
    #[must_use]
    pub unsafe fn alias(&mut self) -> Self {
        Self { start: self.start, len: self.len, capacity: None }
    }

    /// Number of elements. Unlike the length of a slice, it borrows no elements.
    #[inline(always)]
    #[must_use]
    pub fn len(&self) -> usize {
        self.len
    }

    /// Whether there are no elements.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// The elements of a range. Only these are borrowed.
    #[inline(always)]
    #[must_use]
    pub fn part(&self, range: Range<usize>) -> &[T] {
        if range.start > range.end || range.end > self.len {
            out_of_bounds(range.end, self.len);
        }
        // SAFETY: the range has been checked.
        unsafe { std::slice::from_raw_parts(self.start.add(range.start).as_ptr(), range.len()) }
    }

    /// The same, to change them.
    #[inline(always)]
    pub fn part_mut(&mut self, range: Range<usize>) -> &mut [T] {
        if range.start > range.end || range.end > self.len {
            out_of_bounds(range.end, self.len);
        }
        // SAFETY: the range has been checked.
        unsafe { std::slice::from_raw_parts_mut(self.start.add(range.start).as_ptr(), range.len()) }
    }

    /// Changes the vector.
    ///
    /// # Panics
    ///
    /// If this is an alias.
    pub fn change<R>(&mut self, change: impl FnOnce(&mut Vec<T>) -> R) -> R {
        let mut vector = std::mem::take(self).into_vec();
        let result = change(&mut vector);
        *self = vector.into();
        result
    }

    fn into_vec(self) -> Vec<T> {
        let this = ManuallyDrop::new(self);
        let capacity = this.capacity.expect("an alias has no vector");
        // SAFETY: these are the parts of the vector that this array was made from.
        unsafe { Vec::from_raw_parts(this.start.as_ptr(), this.len, capacity) }
    }
}

impl<T> From<Vec<T>> for Array<T> {
    fn from(vector: Vec<T>) -> Self {
        let mut vector = ManuallyDrop::new(vector);
        let (len, capacity) = (vector.len(), vector.capacity());
        // SAFETY: the pointer of a vector is never null.
        let start = unsafe { NonNull::new_unchecked(vector.as_mut_ptr()) };
        Self { start, len, capacity: Some(capacity) }
    }
}

impl<T> Drop for Array<T> {
    fn drop(&mut self) {
        if let Some(capacity) = self.capacity {
            // SAFETY: as in `into_vec`.
            drop(unsafe { Vec::from_raw_parts(self.start.as_ptr(), self.len, capacity) });
        }
    }
}

impl<T> Default for Array<T> {
    fn default() -> Self {
        Vec::new().into()
    }
}

impl<T> FromIterator<T> for Array<T> {
    fn from_iter<I: IntoIterator<Item = T>>(elements: I) -> Self {
        elements.into_iter().collect::<Vec<T>>().into()
    }
}

impl<T: Clone> Clone for Array<T> {
    fn clone(&self) -> Self {
        self.to_vec().into()
    }
}

impl<T: fmt::Debug> fmt::Debug for Array<T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Debug::fmt(&**self, f)
    }
}

impl<T> Index<usize> for Array<T> {
    type Output = T;

    #[inline(always)]
    fn index(&self, index: usize) -> &T {
        if index >= self.len {
            out_of_bounds(index, self.len);
        }
        // SAFETY: the index has been checked.
        unsafe { self.start.add(index).as_ref() }
    }
}

impl<T> IndexMut<usize> for Array<T> {
    #[inline(always)]
    fn index_mut(&mut self, index: usize) -> &mut T {
        if index >= self.len {
            out_of_bounds(index, self.len);
        }
        // SAFETY: the index has been checked.
        unsafe { self.start.add(index).as_mut() }
    }
}

impl<T> Deref for Array<T> {
    type Target = [T];

    #[inline(always)]
    fn deref(&self) -> &[T] {
        // SAFETY: the elements belong to a vector of this length.
        unsafe { std::slice::from_raw_parts(self.start.as_ptr(), self.len) }
    }
}

impl<T> DerefMut for Array<T> {
    #[inline(always)]
    fn deref_mut(&mut self) -> &mut [T] {
        // SAFETY: as above.
        unsafe { std::slice::from_raw_parts_mut(self.start.as_ptr(), self.len) }
    }
}

impl<'a, T> IntoIterator for &'a Array<T> {
    type Item = &'a T;
    type IntoIter = std::slice::Iter<'a, T>;

    fn into_iter(self) -> Self::IntoIter {
        self.iter()
    }
}

impl<T> Elements for Array<T> {
    type Element = T;

    #[inline(always)]
    fn start(&self) -> *const T {
        self.start.as_ptr()
    }
}

#[cold]
#[inline(never)]
#[track_caller]
fn out_of_bounds(index: usize, len: usize) -> ! {
    panic!("index {index} of an array of {len}");
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn threads_change_different_elements() {
        let mut array: Array<u64> = (0..1000).collect();
        // SAFETY: both are dropped before the array, and each thread changes its own elements.
        let aliases = [0, 1].map(|_| unsafe { array.alias() });
        std::thread::scope(|scope| {
            for (first, mut alias) in aliases.into_iter().enumerate() {
                scope.spawn(move || (first..1000).step_by(2).for_each(|k| alias[k] += 1000 * first as u64));
            }
        });
        assert!((0..1000).all(|k| array[k] == k as u64 + 1000 * (k as u64 % 2)));
        array.change(|vector| vector.push(7));
        assert_eq!((array.len(), array[1000], array.clone().iter().count()), (1001, 7, 1001));
        array.part_mut(3..5).fill(9);
        assert_eq!(array.part(2..6), [2, 9, 9, 1005]);
    }

    #[test]
    #[should_panic(expected = "index 3 of an array of 3")]
    fn an_index_is_checked() {
        let array: Array<u8> = vec![1, 2, 3].into();
        assert_eq!(array[3], 0);
    }
}
