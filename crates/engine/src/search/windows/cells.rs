/*!
The grid of a window: the cells in which particles are at any time within the window.

A particle is registered in every cell that its path through the window touches. Therefore a search for
partners reads only the cells near its own path, independent of the speed of the partners. A particle with a
new path is also registered along that path. Its old entries are harmless, since searches always test its
present path.

Cells are computed in single precision. A particle on a face can be assigned to either cell, as long as
searches have a slightly longer range ([`SLACK`](super::axes::SLACK)) than contacts.
*/

mod chunks;
mod path;

use std::{ops::Range, sync::Arc};

use haff_neighbors::{Array, Elements, Geometry, prefetch_at, with_huge_pages};

use crate::search::blocks::Bounds;

use super::axes::Axes;

pub(super) use chunks::{Candidates, Chunk};
use chunks::{EMPTY, ENTRIES};
pub(super) use path::path_span;
use path::{PathBox, count, for_each_cell, trace};

/// Boxes of cells with up to this many cells along each axis have a table of their cells.
const TABLE_SIZE: usize = 4;
/// Smallest number of cells in a part of the grid; parts are filled in parallel. Paths that leave their part
/// are registered afterwards, one by one, so that large parts are better.
const CELLS_PER_PART: usize = 4096;
/// Approximate limit of the number of parts.
const MAX_PARTS: usize = 20;

/// Where slots are registered one by one, the cell of the slot that comes this many later is prefetched.
const CELLS_AHEAD: usize = 16;

/// The eight cells nearest to a position: along each axis the cell of the position, and the nearer of its two
/// neighbors.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct NearestCells([[i32; 4]; 2]);

impl NearestCells {
    /// Whether all of them are those of a block. Not inlined: unrolled, it is a fifth of a loop of events.
    #[inline(never)]
    pub fn are_within(&self, bounds: &Bounds) -> bool {
        self.0.iter().all(|cell| (0..3).all(|axis| bounds.contains_cells(axis, cell[axis], 1)))
    }
}

/// A cell in a box of cells, relative to the first cell of the box: the offset of its index, for boxes inside
/// the grid, and the offsets along the axes.
#[derive(Debug, Clone, Copy)]
struct Offset {
    index: u32,
    x: u8,
    y: u8,
    z: u8,
}

/// Cells and the slots that are registered in them.
#[derive(Debug, Default)]
pub(super) struct Cells {
    pub axes: Axes,
    /// The first block of every cell, followed by the further blocks of cells with more than one.
    blocks: Array<Chunk>,
    /// Number of cells.
    count: usize,
    /// Index of the next further block, and of the first one that must not be used.
    next: usize,
    limit: usize,
    /// Whether a slot could not be registered, because there was no further block.
    is_full: bool,
    /// The cells of all boxes of up to [`TABLE_SIZE`] cells along each axis.
    tables: Arc<[Box<[Offset]>]>,
    /// The cells that may be used, if not all; for assertions.
    owned: Option<Bounds>,
}

impl Cells {
    /// Empty cells of about this width [length] for this number of particles.
    pub fn new(geometry: &Geometry, width: f64, particles: usize) -> Self {
        let axes = Axes::new(geometry, width, particles);
        let cells = axes.n.iter().map(|&n| n as usize).product();
        let (nx, ny) = (axes.n[0] as u32, axes.n[1] as u32);
        let mut tables = Vec::new();
        for shape in 0..TABLE_SIZE.pow(3) as u8 {
            let size = TABLE_SIZE as u8;
            let (sx, sy, sz) = (shape % size, shape / size % size, shape / size / size);
            let mut table = Vec::new();
            for z in 0..=sz {
                for y in 0..=sy {
                    for x in 0..=sx {
                        let index = (u32::from(z) * ny + u32::from(y)) * nx + u32::from(x);
                        table.push(Offset { index, x, y, z });
                    }
                }
            }
            tables.push(table.into_boxed_slice());
        }
        // With space for further blocks of full cells.
        let mut blocks: Vec<Chunk> = with_huge_pages(cells + cells / 8);
        blocks.resize(cells, EMPTY);
        Self {
            axes,
            blocks: blocks.into(),
            count: cells,
            next: cells,
            limit: usize::MAX,
            is_full: false,
            tables: tables.into(),
            owned: None,
        }
    }

    /// The cell of these coordinates.
    pub fn cell_of(&self, x: [i32; 3]) -> u32 {
        self.axes.index(self.axes.fold(self.axes.cells(self.axes.grid_coordinates(x)))) as u32
    }

    /// Cells with the same blocks, for another thread.
    ///
    /// # Safety
    ///
    /// As for [`Array::alias`], for the blocks of each cell; each thread [has](Self::limit_to) further blocks
    /// of its own.
    pub unsafe fn alias(&mut self) -> Self {
        Self {
            axes: self.axes,
            // SAFETY: guaranteed by the caller.
            blocks: unsafe { self.blocks.alias() },
            count: self.count,
            next: 0,
            limit: 0,
            is_full: false,
            tables: Arc::clone(&self.tables),
            owned: None,
        }
    }

    /// Renews the blocks of an alias, which may have been moved in memory.
    ///
    /// # Safety
    ///
    /// That of [`Self::alias`].
    pub unsafe fn renew(&mut self, alias: &mut Self) {
        // SAFETY: guaranteed by the caller.
        alias.blocks = unsafe { self.blocks.alias() };
    }

    /// Reserves this number of further blocks for aliases. Returns the index of the first one.
    pub fn reserve(&mut self, blocks: usize) -> usize {
        let first = self.next;
        self.next += blocks;
        let next = self.next;
        if next > self.blocks.len() {
            self.blocks.change(|blocks| blocks.resize(next, EMPTY));
        }
        first
    }

    /// Lets cells of an alias use these further blocks.
    pub fn limit_to(&mut self, blocks: Range<usize>) {
        (self.next, self.limit) = (blocks.start, blocks.end);
    }

    /// Lets an alias use these cells only; debug assertions test it.
    pub fn own(&mut self, bounds: Bounds) {
        self.owned = Some(bounds);
    }

    /// Asserts that a cell may be used.
    #[inline(always)]
    fn check_owned(&self, cell: usize) {
        if cfg!(debug_assertions)
            && let Some(bounds) = &self.owned
        {
            let n = self.axes.n.map(|n| n as usize);
            let cell = [cell % n[0], cell / n[0] % n[1], cell / n[0] / n[1]];
            // Another formula than that of blocks.
            let is_owned = (0..3).all(|k| {
                let (owned, c) = (bounds.first[k]..bounds.end[k], cell[k] as i32);
                owned.contains(&c) || owned.contains(&(c + self.axes.n[k]))
            });
            assert!(is_owned, "cell {cell:?} is outside of the block {bounds:?}");
        }
    }

    /// Whether a slot could not be registered.
    pub fn is_full(&self) -> bool {
        self.is_full
    }

    /// Number of cells.
    pub fn len(&self) -> usize {
        self.count
    }

    #[inline(always)]
    fn add(&mut self, cell: usize, slot: u32) {
        self.check_owned(cell);
        let block = &mut self.blocks[cell];
        let count = (block.link & 7) as usize;
        if count < ENTRIES {
            block.entries[count] = slot;
            block.link += 1;
        } else {
            self.add_block(cell, slot);
        }
    }

    /// Adds a slot to a cell whose first block is full: a new first block is linked to it.
    #[cold]
    #[inline(never)]
    fn add_block(&mut self, cell: usize, slot: u32) {
        let next = self.next;
        if next >= self.limit {
            self.is_full = true;
            return;
        }
        if next == self.blocks.len() {
            self.blocks.change(|blocks| blocks.push(EMPTY));
        }
        self.blocks[next] = self.blocks[cell];
        self.next += 1;
        let mut entries = [0; ENTRIES];
        entries[0] = slot;
        self.blocks[cell] = Chunk { entries, link: (next as u32) << 3 | 1 };
    }

    /// Splits the grid into parts that can be [filled](Part::fill) in parallel; [`Self::complete`] must
    /// follow. The parts are always the same. `rows` are the first slots of the rows of cells when slots were
    /// last sorted. Particles that have left their row since then are registered correctly all the same.
    pub fn parts<'a>(&'a mut self, rows: &[u32], mut lowest: &'a mut [u32]) -> Vec<Part<'a>> {
        self.next = self.count;
        let nx = self.axes.n[0] as usize;
        let row_count = self.count / nx;
        let rows_per_part = CELLS_PER_PART.max(self.count / MAX_PARTS).div_ceil(nx);
        let mut parts = Vec::with_capacity(row_count.div_ceil(rows_per_part));
        for (part, blocks) in (&mut *self.blocks)[..self.count].chunks_mut(rows_per_part * nx).enumerate() {
            let slots = rows[part * rows_per_part]..rows[((part + 1) * rows_per_part).min(row_count)];
            let (own, others) = lowest.split_at_mut(slots.len());
            lowest = others;
            parts.push(Part { first: part * rows_per_part * nx, blocks, slots, lowest: own });
        }
        parts
    }

    /// Registers the `leftover` (cell, slot) that the parts could not hold.
    pub fn complete(&mut self, leftover: &[(u32, u32)]) {
        for (k, &(cell, slot)) in leftover.iter().enumerate() {
            if let Some(&(cell, _)) = leftover.get(k + CELLS_AHEAD) {
                prefetch_at(&self.blocks, cell as usize);
            }
            self.add(cell as usize, slot);
        }
    }

    /// Registers a slot along a new path, which leads from `x` by the `fraction` of the displacement `v`
    /// [length].
    ///
    /// With an `extent` [length] greater than 0, the slot is registered in all cells within this distance of
    /// the bounding box of the path. Otherwise it is registered in all cells of the path but that of `x`,
    /// where it is registered already, because its old path ended there.
    #[inline(always)]
    pub fn register(&mut self, slot: u32, x: [i32; 3], v: [f32; 3], fraction: f32, extent: f32) {
        let axes = self.axes;
        trace::<false>(&axes, x, v, fraction, extent, |cell| {
            if extent > 0.0 {
                let block = &self.blocks[cell];
                if block.entries[..(block.link & 7) as usize].contains(&slot) {
                    return;
                }
            }
            self.add(cell, slot);
        });
    }

    /// Gathers the candidates of slot `own` for the search with the index `search`: all slots registered
    /// within `reach` [length] of the bounding box of a path. The path leads from `x` by the `fraction` of
    /// the displacement `v` [length]; slot `own` is registered within `extent` [length] of it.
    ///
    /// With `HALF`, only the cells from `lowest` on are read, the lowest cell in which `own` is registered:
    /// of two neighbors the one with the lower `lowest` finds the other.
    #[inline(always)]
    #[expect(clippy::too_many_arguments, reason = "in registers, on the hottest path")]
    pub fn gather<const HALF: bool>(
        &self,
        search: u32,
        own: u32,
        x: [i32; 3],
        v: [f32; 3],
        fraction: f32,
        [reach, extent]: [f32; 2],
        lowest: u32,
        candidates: &mut Candidates,
    ) {
        let axes = &self.axes;
        let path = PathBox::new(axes, x, v, fraction);
        let (low, high) = path.bounds(axes, reach);
        let count = [count(axes, low, high, 0), count(axes, low, high, 1), count(axes, low, high, 2)];
        // Also of a box that is longer than the grid, which has its last cells in common with its first ones.
        let exceeds = |k: usize| high[k] >= axes.n[k];
        let outside = (low[0] | low[1] | low[2]) < 0 || exceeds(0) | exceeds(1) | exceeds(2);
        let from = candidates.len;
        let mut links = 0;
        if count[0].max(count[1]).max(count[2]) > TABLE_SIZE as i32 {
            let blocks = count.iter().map(|&count| count as usize).product();
            candidates.reserve(blocks);
            candidates.blocks += blocks as u64;
            self.for_each_cell(low, count, |cell| {
                self.check_owned(cell);
                // SAFETY: space is reserved for one block per cell.
                links |= unsafe { candidates.push(&self.blocks[cell], !HALF || cell >= lowest as usize) };
            });
        } else {
            let shape =
                ((count[2] - 1) * TABLE_SIZE as i32 + count[1] - 1) * TABLE_SIZE as i32 + count[0] - 1;
            let table = &self.tables[shape as usize];
            candidates.reserve(table.len());
            if outside {
                candidates.blocks += table.len() as u64;
                // Some cells are beyond an edge: the index of each column, row and plane is folded first.
                let start = axes.fold(low);
                let mut folded = [[0; TABLE_SIZE]; 3];
                for k in 0..3 {
                    for step in 0..TABLE_SIZE {
                        let c = start[k] + step as i32;
                        folded[k][step] = if c >= axes.n[k] { c - axes.n[k] } else { c };
                    }
                }
                for &Offset { x, y, z, .. } in table {
                    let [x, y, z] = [
                        folded[0][x as usize % TABLE_SIZE],
                        folded[1][y as usize % TABLE_SIZE],
                        folded[2][z as usize % TABLE_SIZE],
                    ];
                    let cell = axes.index([x, y, z, 0]);
                    self.check_owned(cell);
                    // SAFETY: space is reserved for one block per element of the table.
                    links |= unsafe { candidates.push(&self.blocks[cell], !HALF || cell >= lowest as usize) };
                }
            } else {
                let first = axes.index(low);
                let mut offsets = &table[..];
                if HALF {
                    // The table is in the order of the cells, and `own` is registered in no cell before the
                    // first one of its bounding box.
                    let (own, _) = path.bounds(axes, extent);
                    let offset = |k: usize| own[k] - low[k];
                    let skipped = (offset(2) * count[1] + offset(1)) * count[0] + offset(0);
                    offsets = &table[(skipped as usize).min(table.len())..];
                }
                candidates.blocks += offsets.len() as u64;
                let blocks = self.blocks.start();
                for &Offset { index, .. } in offsets {
                    let cell = first + index as usize;
                    debug_assert!(cell < self.count);
                    self.check_owned(cell);
                    // SAFETY: as above; all cells of the box are inside the grid, so that `cell` is the index
                    // of a block.
                    links |= unsafe { candidates.push(&*blocks.add(cell), true) };
                }
            }
        }
        if links > 7 {
            self.for_each_cell(low, count, |cell| {
                if !HALF || cell >= lowest as usize {
                    self.follow(self.blocks[cell].link, candidates);
                }
            });
        }
        candidates.end(from, search, own);
    }

    /// The cells nearest to the position on a path after a `fraction` of the window.
    #[inline(always)]
    pub fn nearest(&self, x: [i32; 3], v: [f32; 3], fraction: f32) -> NearestCells {
        let axes = &self.axes;
        let v = [v[0], v[1], v[2], 0.0];
        let mut position = axes.grid_coordinates(x);
        for k in 0..4 {
            position[k] += v[k] * fraction * axes.cells[k];
        }
        let cells = axes.cells(position);
        let own = axes.fold(cells);
        let mut nearest = [own; 2];
        for k in 0..3 {
            let (c, n) = (own[k], axes.n[k]);
            nearest[1][k] = if position[k] - (cells[k] as f32) < 0.5 {
                if c == 0 { n - 1 } else { c - 1 }
            } else if c == n - 1 {
                0
            } else {
                c + 1
            };
        }
        NearestCells(nearest)
    }

    /// Visits the first blocks of these cells.
    #[inline(always)]
    pub fn visit(&self, cells: &NearestCells, mut visit: impl FnMut(&Chunk)) {
        for [_, _, z, _] in cells.0 {
            for [_, y, _, _] in cells.0 {
                let row = (z * self.axes.n[1] + y) * self.axes.n[0];
                for [x, ..] in cells.0 {
                    // The grid can have fewer cells than when these were determined.
                    visit(&self.blocks[((row + x) as usize).min(self.count - 1)]);
                }
            }
        }
    }

    /// Visits all cells of a box of cells, which can extend beyond the edges of the grid.
    #[inline(always)]
    fn for_each_cell(&self, low: [i32; 4], count: [i32; 3], visit: impl FnMut(usize)) {
        for_each_cell(&self.axes, low, count, visit);
    }

    /// Adds the further blocks of a cell.
    #[cold]
    #[inline(never)]
    fn follow(&self, mut link: u32, candidates: &mut Candidates) {
        while link > 7 {
            candidates.reserve(1);
            // SAFETY: space for a block has just been reserved.
            link = unsafe { candidates.push(&self.blocks[(link >> 3) as usize], true) };
        }
    }
}

/// A part of the grid, and the slots that were in it when slots were last sorted.
pub(super) struct Part<'a> {
    /// The first cell of the part.
    first: usize,
    blocks: &'a mut [Chunk],
    slots: Range<u32>,
    lowest: &'a mut [u32],
}

impl Part<'_> {
    /// Empties the cells of the part and registers its slots. `path` returns the start of the path of a slot,
    /// its displacement and its extent. Sets the lowest cell in which each slot is registered. Adds to
    /// `leftover` the (cell, slot) whose cell is full or in another part.
    #[inline(always)]
    pub fn fill(
        self,
        axes: &Axes,
        path: impl Fn(u32) -> ([i32; 3], [f32; 3], f32),
        leftover: &mut Vec<(u32, u32)>,
    ) {
        for block in self.blocks.iter_mut() {
            block.link = 0;
        }
        for (slot, lowest) in self.slots.zip(self.lowest) {
            let (x, v, extent) = path(slot);
            let mut first_cell = usize::MAX;
            trace::<true>(axes, x, v, 1.0, extent, |cell| {
                first_cell = first_cell.min(cell);
                match self.blocks.get_mut(cell.wrapping_sub(self.first)) {
                    Some(block) if block.link < ENTRIES as u32 => {
                        block.entries[block.link as usize] = slot;
                        block.link += 1;
                    }
                    _ => leftover.push((cell as u32, slot)),
                }
            });
            *lowest = first_cell as u32;
        }
    }
}

#[cfg(test)]
mod tests;
