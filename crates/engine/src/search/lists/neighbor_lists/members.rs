//! The members of the lists: rows of a table, and longer lists beside it.

use haff_neighbors::Array;

use super::{
    super::sets::{LANES, MASK_BITS, low_bits, members, position_in},
    Lists,
};

/// Inverse of the fraction of lists in `overflow` above which all lists are lengthened.
const OVERFLOW_PART: usize = 32;

impl Lists {
    /// Makes the first `length` of `new` the list of i, and updates the lists of the partners lost and
    /// gained. Returns false, and changes nothing, if an alias would need memory for it.
    #[inline(always)]
    pub(super) fn replace<const VECTORS: bool>(&mut self, i: u32, new: &[u32], length: usize) -> bool {
        let before = self.references[i as usize].members as usize;
        if before.max(length) > self.stride || self.stride > MASK_BITS {
            if self.is_alias && self.free_overflow.len() <= length {
                return false;
            }
            self.replace_long(i, &new[..length]);
            return true;
        }
        let start = i as usize * self.stride;
        let mut old = [0; MASK_BITS];
        old[..self.stride].copy_from_slice(self.words.part(start..start + self.stride));
        let mut lost = low_bits(before) & !members::<VECTORS>(&old, before, &new[..length]);
        let mut gained = low_bits(length) & !members::<VECTORS>(new, length, &old[..before]);
        if self.is_alias && self.free_overflow.len() < MASK_BITS {
            return false;
        }
        while lost != 0 {
            self.remove::<VECTORS>(old[lost.trailing_zeros() as usize], i);
            lost &= lost - 1;
        }
        let mut overflow = false;
        while gained != 0 {
            overflow |= self.add(new[gained.trailing_zeros() as usize], i);
            gained &= gained - 1;
        }
        let sentinel = self.sentinel();
        let (own, rest) = self.words.part_mut(start..start + self.stride).split_at_mut(length);
        own.copy_from_slice(&new[..length]);
        rest.fill(sentinel);
        self.references[i as usize].members = length as u32;
        if overflow {
            self.grow();
        }
        true
    }

    /// [`Self::replace`] for lists of any length.
    #[cold]
    fn replace_long(&mut self, i: u32, new: &[u32]) {
        let old = self.of(i)[..self.references[i as usize].members as usize].to_vec();
        for j in old.iter().filter(|j| !new.contains(j)) {
            self.remove::<false>(*j, i);
        }
        for j in new.iter().filter(|j| !old.contains(j)) {
            self.add(*j, i);
        }
        self.set(i, new);
        self.grow();
    }

    /// Makes `list` the list of i.
    fn set(&mut self, i: u32, list: &[u32]) {
        let (sentinel, start) = (self.sentinel(), i as usize * self.stride);
        if self.references[i as usize].members as usize > self.stride {
            self.free_overflow.push(self.words[start]);
        }
        self.references[i as usize].members = list.len() as u32;
        if list.len() > self.stride {
            self.move_to_overflow(i, list);
        } else {
            let (own, rest) = self.words.part_mut(start..start + self.stride).split_at_mut(list.len());
            own.copy_from_slice(list);
            rest.fill(sentinel);
        }
    }

    /// Stores `list` as the list of i in `overflow` from now on.
    #[cold]
    pub(super) fn move_to_overflow(&mut self, i: u32, list: &[u32]) {
        let sentinel = self.sentinel();
        let free = self.free_overflow.pop().unwrap_or_else(|| {
            self.overflow.change(|overflow| overflow.push(Vec::new()));
            self.overflow.len() as u32 - 1
        });
        let overflow = &mut self.overflow[free as usize];
        overflow.clear();
        overflow.extend_from_slice(list);
        overflow.resize(list.len().next_multiple_of(LANES), sentinel);
        self.words[i as usize * self.stride] = free;
    }

    /// Adds j to the list of i; true if the list has moved to `overflow` because of it.
    #[inline]
    fn add(&mut self, i: u32, j: u32) -> bool {
        let start = i as usize * self.stride;
        let reference = &mut self.references[i as usize];
        let length = reference.members as usize;
        reference.members += 1;
        if length < self.stride {
            self.words[start + length] = j;
            return false;
        }
        self.add_to_overflow(i, j, length)
    }

    /// [`Self::add`] for a list of at least `stride` members; `length` is their number.
    #[cold]
    fn add_to_overflow(&mut self, i: u32, j: u32, length: usize) -> bool {
        let (sentinel, start) = (self.sentinel(), i as usize * self.stride);
        if length == self.stride {
            let mut list = self.words.part(start..start + length).to_vec();
            list.push(j);
            self.move_to_overflow(i, &list);
            return true;
        }
        let list = &mut self.overflow[self.words[start] as usize];
        if length == list.len() {
            list.resize(length + LANES, sentinel);
        }
        list[length] = j;
        false
    }

    /// Removes j from the list of i.
    #[inline(always)]
    fn remove<const VECTORS: bool>(&mut self, i: u32, j: u32) {
        let (sentinel, start) = (self.sentinel(), i as usize * self.stride);
        let length = self.references[i as usize].members as usize;
        if length > self.stride {
            self.remove_from_overflow(i, j);
            return;
        }
        let list = self.words.part_mut(start..start + self.stride);
        if let Some(at) = position_in::<VECTORS>(list, j) {
            list[at] = list[length - 1];
            list[length - 1] = sentinel;
            self.references[i as usize].members -= 1;
        }
    }

    /// [`Self::remove`] for a list in `overflow`.
    #[cold]
    fn remove_from_overflow(&mut self, i: u32, j: u32) {
        let mut list = self.of(i)[..self.references[i as usize].members as usize].to_vec();
        if let Some(at) = list.iter().position(|&other| other == j) {
            list.swap_remove(at);
            self.set(i, &list);
        }
    }

    /// Lengthens all lists if many have overflowed.
    fn grow(&mut self) {
        let count = self.references.len();
        let used = self.overflow.len().saturating_sub(self.free_overflow.len() + self.lent);
        if self.is_alias || used <= count / OVERFLOW_PART + 8 {
            return;
        }
        let lists: Vec<(u32, Vec<u32>)> = (0..count as u32)
            .filter(|&i| self.references[i as usize].members as usize > self.stride)
            .map(|i| (i, self.of(i)[..self.references[i as usize].members as usize].to_vec()))
            .collect();
        let before = self.stride;
        self.stride += LANES;
        (self.growths, self.lent) = (self.growths + 1, 0);
        // In place, starting with the last list: an old and a new table at once would take a quarter of all
        // memory.
        let stride = self.stride;
        self.words.change(|words| {
            words.reserve_exact(count * LANES);
            words.resize(count * stride, count as u32);
            for i in (0..count).rev() {
                let to = i * stride;
                words.copy_within(i * before..(i + 1) * before, to);
                words[to + before..to + stride].fill(count as u32);
            }
        });
        (self.overflow, self.free_overflow) = (Array::default(), Vec::new());
        for (i, list) in lists {
            self.references[i as usize].members = 0;
            self.set(i, &list);
        }
    }
}
