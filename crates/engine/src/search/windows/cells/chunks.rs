//! The blocks of entries of cells, and slots that searches have gathered from them.

use crate::search::compact::LANES;

/// Entries of a block. Together with its link they fill half a cache line.
pub(super) const ENTRIES: usize = 7;

/// Up to seven entries, and a link: its lowest three bits are the number of entries, the others are the index
/// of the next block, or 0.
#[derive(Debug, Clone, Copy)]
#[repr(C, align(32))]
pub(in super::super) struct Chunk {
    pub(super) entries: [u32; ENTRIES],
    pub(super) link: u32,
}

impl Chunk {
    /// The first two entries. In an empty block they are 0 or slots from an earlier window.
    #[inline(always)]
    pub fn first_entries(&self) -> [u32; 2] {
        [self.entries[0], self.entries[1]]
    }
}

pub(super) const EMPTY: Chunk = Chunk { entries: [0; ENTRIES], link: 0 };

/// Slots gathered from cells for several searches, padded to whole vectors for each search.
#[derive(Debug, Clone, Default)]
pub(in super::super) struct Candidates {
    /// Slots; only the first `len` are valid.
    pub slots: Vec<u32>,
    /// Index of the search to which each vector of [`LANES`] slots belongs.
    pub owner: Vec<u32>,
    /// Number of slots, a multiple of [`LANES`] between searches.
    pub len: usize,
    /// Number of blocks gathered.
    pub blocks: u64,
}

impl Candidates {
    pub fn new() -> Self {
        Self { slots: vec![0; 1024], owner: vec![0; 1024 / LANES + LANES], ..Self::default() }
    }

    /// Reserves space for this many blocks and a last vector.
    #[inline(always)]
    pub(super) fn reserve(&mut self, blocks: usize) {
        if self.len + (blocks + 2) * LANES > self.slots.len() {
            self.grow(blocks);
        }
    }

    #[cold]
    #[inline(never)]
    fn grow(&mut self, blocks: usize) {
        let len = 2 * (self.len + (blocks + 2) * LANES).next_multiple_of(LANES);
        self.slots.resize(len, 0);
        self.owner.resize(len / LANES + LANES, 0);
    }

    /// Adds the entries of a block if they are `wanted`; returns its link.
    ///
    /// # Safety
    ///
    /// Space for the block must be [reserved](Self::reserve).
    #[inline(always)]
    pub(super) unsafe fn push(&mut self, block: &Chunk, wanted: bool) -> u32 {
        debug_assert!(self.len + LANES <= self.slots.len());
        // The whole block is copied at once; what follows its entries is overwritten by the next block.
        // SAFETY: a block has the size of `LANES` slots, and the caller has reserved space for it.
        unsafe {
            let to = self.slots.as_mut_ptr().add(self.len).cast::<[u32; LANES]>();
            to.write(std::ptr::from_ref(block).cast::<[u32; LANES]>().read());
        }
        // A mask instead of a branch, which would be mispredicted.
        self.len += (block.link & (7 * u32::from(wanted))) as usize;
        block.link
    }

    /// Ends the search whose slots begin at `from`: the last vector is padded with `own`.
    #[inline(always)]
    pub(super) fn end(&mut self, from: usize, search: u32, own: u32) {
        self.slots[self.len..self.len + LANES].fill(own);
        self.len = self.len.next_multiple_of(LANES);
        // Eight elements are written at once; those beyond the last vector are overwritten by the next
        // search.
        let (first, last) = (from / LANES, self.len / LANES);
        self.owner[first..first + LANES].fill(search);
        if last > first + LANES {
            self.owner[first + LANES..last].fill(search);
        }
    }
}
