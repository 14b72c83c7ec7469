/*!
The grid of a window: in which cells particles are, at any time within it.

A particle is registered in every cell that its path through the window touches. So a search for partners
reads at the cells near its own path only, however fast others are. A particle that takes a new path is
registered along that too; where it was registered before does no harm, since what is tested is always its
path of now.

Cells are found in single precision: which of two cells a particle on their common face is in does not matter,
as long as searches reach a little further ([`SLACK`]) than contacts do.
*/

use std::ops::Range;

use haff_neighbors::{Geometry, prefetch_at, with_huge_pages};

use super::axes::Axes;
use crate::compact::LANES;

/// Entries of a block; with its link it fills half a cache line.
const ENTRIES: usize = 7;
/// What searches reach further [cells]: ten times the rounding of a place among the most cells,
/// [`super::axes`].
const SLACK: f32 = 2e-3;
/// Cells per axis of the blocks of cells that searches have tables for.
const TABLED: usize = 4;
/// Cells per part of the grid that is filled in parallel, at least, and parts at most, about: paths that
/// leave a part are registered afterwards, one by one.
const PART: usize = 4096;
const PARTS: usize = 20;

/// Of those registered one by one the cells are asked for so many ahead.
const AHEAD: usize = 16;

/// Up to seven entries, and what follows: the number of entries in three bits, the next block above.
#[derive(Debug, Clone, Copy)]
#[repr(C, align(32))]
pub(super) struct Block {
    entries: [u32; ENTRIES],
    link: u32,
}

impl Block {
    /// Its first entries: slots, of now or of a window before.
    #[inline(always)]
    pub fn first(&self) -> [u32; 2] {
        [self.entries[0], self.entries[1]]
    }
}

/// The cell of a place along each axis, and the one beside it that the place is nearer to.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct NearestCells([[i32; 4]; 2]);

const EMPTY: Block = Block { entries: [0; ENTRIES], link: 0 };

/// Slots gathered from cells for several searches, each filled up to whole vectors.
#[derive(Debug, Clone, Default)]
pub(super) struct Candidates {
    /// Slots; only the first `len` mean anything.
    pub slots: Vec<u32>,
    /// Search that each vector of [`LANES`] slots belongs to.
    pub owner: Vec<u32>,
    /// Slots so far, a multiple of [`LANES`] between searches.
    pub len: usize,
    /// Blocks gathered so far.
    pub blocks: u64,
}

impl Candidates {
    pub fn new() -> Self {
        Self { slots: vec![0; 1024], owner: vec![0; 1024 / LANES + LANES], ..Self::default() }
    }

    /// Makes room for so many blocks and a last vector.
    #[inline(always)]
    fn reserve(&mut self, blocks: usize) {
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
    /// There must be [room](Self::reserve) for it.
    #[inline(always)]
    unsafe fn push(&mut self, block: &Block, wanted: bool) -> u32 {
        debug_assert!(self.len + LANES <= self.slots.len());
        // The whole block in one move; what lies beyond its entries is overwritten by the next.
        // SAFETY: a block is as long as `LANES` slots, and the caller has made room.
        unsafe {
            let to = self.slots.as_mut_ptr().add(self.len).cast::<[u32; LANES]>();
            to.write(std::ptr::from_ref(block).cast::<[u32; LANES]>().read());
        }
        // A mask, not a branch: it cannot be predicted.
        self.len += (block.link & (7 * u32::from(wanted))) as usize;
        block.link
    }

    /// Ends the search that began at `from`: the last vector is filled up with `own`.
    #[inline(always)]
    fn end(&mut self, from: usize, search: u32, own: u32) {
        self.slots[self.len..self.len + LANES].fill(own);
        self.len = self.len.next_multiple_of(LANES);
        // Up to eight vectors in one move; what lies beyond belongs to the next search, which comes later.
        let (first, last) = (from / LANES, self.len / LANES);
        self.owner[first..first + LANES].fill(search);
        if last > first + LANES {
            self.owner[first + LANES..last].fill(search);
        }
    }
}

/// A cell of a block of cells: the step from the index of the first, inside the grid, and the steps along the
/// axes.
#[derive(Debug, Clone, Copy)]
struct Step {
    inside: u32,
    x: u8,
    y: u8,
    z: u8,
}

/// Cells and who is registered in them.
#[derive(Debug, Clone, Default)]
pub(super) struct Cells {
    pub axes: Axes,
    /// The first block of every cell, then those that full cells go on in.
    blocks: Vec<Block>,
    count: usize,
    /// Steps from the first cell for all shapes of up to `TABLED` cells along each axis.
    tables: Vec<Box<[Step]>>,
}

impl Cells {
    /// Empty cells about `width` wide [length], for `particles`.
    pub fn new(geometry: &Geometry, width: f64, particles: usize) -> Self {
        let axes = Axes::new(geometry, width, particles);
        let cells = axes.n.iter().map(|&n| n as usize).product();
        let (nx, ny) = (axes.n[0] as u32, axes.n[1] as u32);
        let mut tables = Vec::new();
        for shape in 0..TABLED.pow(3) as u8 {
            let most = TABLED as u8;
            let (sx, sy, sz) = (shape % most, shape / most % most, shape / most / most);
            let mut table = Vec::new();
            for z in 0..=sz {
                for y in 0..=sy {
                    for x in 0..=sx {
                        let inside = (u32::from(z) * ny + u32::from(y)) * nx + u32::from(x);
                        table.push(Step { inside, x, y, z });
                    }
                }
            }
            tables.push(table.into_boxed_slice());
        }
        // Room for full cells to go on.
        let mut blocks = with_huge_pages(cells + cells / 8);
        blocks.resize(cells, EMPTY);
        Self { axes, blocks, count: cells, tables }
    }

    /// The cell of a coordinate.
    pub fn cell_of(&self, x: [i32; 3]) -> u32 {
        self.axes.index(self.axes.fold(self.axes.cells(self.axes.grid_coordinates(x)))) as u32
    }

    /// Number of cells.
    pub fn len(&self) -> usize {
        self.count
    }

    #[inline(always)]
    fn add(&mut self, cell: usize, slot: u32) {
        let block = &mut self.blocks[cell];
        let count = (block.link & 7) as usize;
        if count < ENTRIES {
            block.entries[count] = slot;
            block.link += 1;
        } else {
            self.add_block(cell, slot);
        }
    }

    /// A full first block moves behind a new one.
    #[cold]
    #[inline(never)]
    fn add_block(&mut self, cell: usize, slot: u32) {
        let next = self.blocks.len() as u32;
        let full = self.blocks[cell];
        self.blocks.push(full);
        let mut entries = [0; ENTRIES];
        entries[0] = slot;
        self.blocks[cell] = Block { entries, link: next << 3 | 1 };
    }

    /// The grid in parts, always the same ones, that can be [filled](Part::fill) in parallel;
    /// [`Self::complete`] has to follow. `rows` are the first slots of the rows of cells, as slots are
    /// sorted: it does not matter if some have left their rows since.
    pub fn parts<'a>(&'a mut self, rows: &[u32], mut lowest: &'a mut [u32]) -> Vec<Part<'a>> {
        self.blocks.truncate(self.count);
        let across = self.axes.n[0] as usize;
        let rows_in_all = self.count / across;
        let deep = PART.max(self.count / PARTS).div_ceil(across);
        let mut parts = Vec::with_capacity(rows_in_all.div_ceil(deep));
        for (part, blocks) in self.blocks.chunks_mut(deep * across).enumerate() {
            let slots = rows[part * deep]..rows[((part + 1) * deep).min(rows_in_all)];
            let (own, others) = lowest.split_at_mut(slots.len());
            lowest = others;
            parts.push(Part { first: part * deep * across, blocks, slots, lowest: own });
        }
        parts
    }

    /// Registers those who have found no room in their part.
    pub fn complete(&mut self, left: &[(u32, u32)]) {
        for (k, &(cell, slot)) in left.iter().enumerate() {
            if let Some(&(cell, _)) = left.get(k + AHEAD) {
                prefetch_at(&self.blocks, cell as usize);
            }
            self.add(cell as usize, slot);
        }
    }

    /// Registers a slot that has taken a new path, in all cells within `extent` [length] of the path from
    /// `x`, the `part` of the displacement `v` [length] long; without an extent, but for the cell of `x`,
    /// where its old path has brought it.
    #[inline(always)]
    pub fn register(&mut self, slot: u32, x: [i32; 3], v: [f32; 3], part: f32, extent: f32) {
        let axes = self.axes;
        trace::<false>(&axes, x, v, part, extent, |cell| {
            if extent > 0.0 {
                let block = &self.blocks[cell];
                if block.entries[..(block.link & 7) as usize].contains(&slot) {
                    return;
                }
            }
            self.add(cell, slot);
        });
    }

    /// Gathers, for the search of number `search` from slot `own`, all that are registered within `reach`
    /// [length] of the box around the path from `x`, the `part` of the displacement `v` [length] long.
    ///
    /// With `HALF`, those alone that are registered in the cell `lowest` of its own or a later one: of two
    /// that are near each other the one with the lesser `lowest` finds the other.
    #[inline(always)]
    #[expect(clippy::too_many_arguments, reason = "in registers, on the hottest path")]
    pub fn gather<const HALF: bool>(
        &self,
        search: u32,
        own: u32,
        x: [i32; 3],
        v: [f32; 3],
        part: f32,
        [reach, extent]: [f32; 2],
        lowest: u32,
        candidates: &mut Candidates,
    ) {
        let axes = &self.axes;
        let path = PathBox::new(axes, x, v, part);
        let (low, count) = path.span(axes, reach);
        let past = |k: usize| low[k] + count[k] > axes.n[k];
        let outside = (low[0] | low[1] | low[2]) < 0 || past(0) | past(1) | past(2);
        let from = candidates.len;
        let mut links = 0;
        if count[0].max(count[1]).max(count[2]) > TABLED as i32 {
            let blocks = count.iter().map(|&count| count as usize).product();
            candidates.reserve(blocks);
            candidates.blocks += blocks as u64;
            self.for_each_cell(low, count, |cell| {
                // SAFETY: there is room for as many blocks as there are cells.
                links |= unsafe { candidates.push(&self.blocks[cell], !HALF || cell >= lowest as usize) };
            });
        } else {
            let shape = ((count[2] - 1) * TABLED as i32 + count[1] - 1) * TABLED as i32 + count[0] - 1;
            let table = &self.tables[shape as usize];
            candidates.reserve(table.len());
            if outside {
                candidates.blocks += table.len() as u64;
                // Some of the cells lie beyond an edge: where each row, column and plane is, is found first.
                let start = axes.fold(low);
                let mut at = [[0; TABLED]; 3];
                for k in 0..3 {
                    for step in 0..TABLED {
                        let c = start[k] + step as i32;
                        at[k][step] = if c >= axes.n[k] { c - axes.n[k] } else { c };
                    }
                }
                for &Step { x, y, z, .. } in table {
                    let [x, y, z] =
                        [at[0][x as usize % TABLED], at[1][y as usize % TABLED], at[2][z as usize % TABLED]];
                    let cell = axes.index([x, y, z, 0]);
                    // SAFETY: there is room for as many blocks as there are steps.
                    links |= unsafe { candidates.push(&self.blocks[cell], !HALF || cell >= lowest as usize) };
                }
            } else {
                let first = axes.index(low);
                let mut steps = &table[..];
                if HALF {
                    // The table goes through the cells in their order; nothing of the own path is before its
                    // box.
                    let (own, _) = path.span(axes, extent);
                    let at = |k: usize| own[k] - low[k];
                    let skipped = (at(2) * count[1] + at(1)) * count[0] + at(0);
                    steps = &table[(skipped as usize).min(table.len())..];
                }
                candidates.blocks += steps.len() as u64;
                for &Step { inside, .. } in steps {
                    let cell = first + inside as usize;
                    debug_assert!(cell < self.count);
                    // SAFETY: as above; nothing of the block of cells is outside the grid.
                    links |= unsafe { candidates.push(self.blocks.get_unchecked(cell), true) };
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

    /// The cells around the place that a path has come to after a `part` of the window.
    #[inline(always)]
    pub fn around(&self, x: [i32; 3], v: [f32; 3], part: f32) -> NearestCells {
        let axes = &self.axes;
        let v = [v[0], v[1], v[2], 0.0];
        let mut place = axes.grid_coordinates(x);
        for k in 0..4 {
            place[k] += v[k] * part * axes.cells[k];
        }
        let cells = axes.cells(place);
        let home = axes.fold(cells);
        let mut near = [home; 2];
        for k in 0..3 {
            let (c, n) = (home[k], axes.n[k]);
            near[1][k] = if place[k] - (cells[k] as f32) < 0.5 {
                if c == 0 { n - 1 } else { c - 1 }
            } else if c == n - 1 {
                0
            } else {
                c + 1
            };
        }
        NearestCells(near)
    }

    /// Visits the first blocks of these cells.
    #[inline(always)]
    pub fn visit(&self, near: &NearestCells, mut visit: impl FnMut(&Block)) {
        for [_, _, z, _] in near.0 {
            for [_, y, _, _] in near.0 {
                let row = (z * self.axes.n[1] + y) * self.axes.n[0];
                for [x, ..] in near.0 {
                    // There may be less cells than when these were found.
                    visit(&self.blocks[((row + x) as usize).min(self.count - 1)]);
                }
            }
        }
    }

    /// Visits all cells of a block of cells, wherever it lies.
    #[inline(always)]
    fn for_each_cell(&self, low: [i32; 4], count: [i32; 3], visit: impl FnMut(usize)) {
        for_each_cell(&self.axes, low, count, visit);
    }

    /// Adds the blocks that a cell goes on in.
    #[cold]
    #[inline(never)]
    fn follow(&self, mut link: u32, candidates: &mut Candidates) {
        while link > 7 {
            candidates.reserve(1);
            // SAFETY: there is room.
            link = unsafe { candidates.push(&self.blocks[(link >> 3) as usize], true) };
        }
    }
}

/// A part of the grid, and the slots that were in it when they were sorted.
pub(super) struct Part<'a> {
    /// Its first cell.
    first: usize,
    blocks: &'a mut [Block],
    slots: Range<u32>,
    lowest: &'a mut [u32],
}

impl Part<'_> {
    /// Empties its cells, and registers its slots; `path` tells where the path of a slot begins, its
    /// displacement and its extent. Sets the least cell that each slot is registered in. Adds to `left`
    /// (cell, slot) for which there is no room in the part.
    #[inline(always)]
    pub fn fill(
        self,
        axes: &Axes,
        path: impl Fn(u32) -> ([i32; 3], [f32; 3], f32),
        left: &mut Vec<(u32, u32)>,
    ) {
        for block in self.blocks.iter_mut() {
            block.link = 0;
        }
        for (slot, lowest) in self.slots.zip(self.lowest) {
            let (x, v, extent) = path(slot);
            let mut least = usize::MAX;
            trace::<true>(axes, x, v, 1.0, extent, |cell| {
                least = least.min(cell);
                match self.blocks.get_mut(cell.wrapping_sub(self.first)) {
                    Some(block) if block.link < ENTRIES as u32 => {
                        block.entries[block.link as usize] = slot;
                        block.link += 1;
                    }
                    _ => left.push((cell as u32, slot)),
                }
            });
            *lowest = least as u32;
        }
    }
}

/// The box around a path, in cells.
#[derive(Debug, Clone, Copy)]
struct PathBox {
    low: [f32; 4],
    high: [f32; 4],
}

impl PathBox {
    /// The box around the path from `x`, the `part` of the displacement `v` [length] long.
    #[inline(always)]
    fn new(axes: &Axes, x: [i32; 3], v: [f32; 3], part: f32) -> Self {
        let v = [v[0], v[1], v[2], 0.0];
        let place = axes.grid_coordinates(x);
        let (mut low, mut high) = ([0.0; 4], [0.0; 4]);
        for k in 0..4 {
            let way = v[k] * part * axes.cells[k];
            low[k] = place[k] + if way < 0.0 { way } else { 0.0 };
            high[k] = place[k] + if way > 0.0 { way } else { 0.0 };
        }
        Self { low, high }
    }

    /// First cell, counted on beyond the edges, and number of cells per axis, of the box and `reach` [length]
    /// around it.
    #[inline(always)]
    fn span(&self, axes: &Axes, reach: f32) -> ([i32; 4], [i32; 3]) {
        let (mut low, mut high) = ([0.0; 4], [0.0; 4]);
        for k in 0..4 {
            let reach = reach * axes.cells[k] + SLACK;
            low[k] = self.low[k] - reach;
            high[k] = self.high[k] + reach;
        }
        let (low, high) = (axes.cells(low), axes.cells(high));
        let count = |k: usize| (high[k] - low[k] + 1).min(axes.n[k]);
        (low, [count(0), count(1), count(2)])
    }
}

/// Visits all cells of a block of cells, wherever it lies.
#[inline(always)]
fn for_each_cell(axes: &Axes, low: [i32; 4], count: [i32; 3], mut visit: impl FnMut(usize)) {
    let n = axes.n;
    let start = axes.fold(low);
    let wrapped = |at: i32, axis: usize| if at >= n[axis] { at - n[axis] } else { at };
    for z in 0..count[2] {
        let plane = wrapped(start[2] + z, 2) * n[1];
        for y in 0..count[1] {
            let row = (plane + wrapped(start[1] + y, 1)) * n[0];
            for x in 0..count[0] {
                visit((row + wrapped(start[0] + x, 0)) as usize);
            }
        }
    }
}

/// Visits the cells within `extent` [length] of the path from `x`, the `part` of the displacement `v`
/// [length] long; without an extent, the cell of `x` only if `FIRST`.
#[inline(always)]
fn trace<const FIRST: bool>(
    axes: &Axes,
    x: [i32; 3],
    v: [f32; 3],
    part: f32,
    extent: f32,
    mut visit: impl FnMut(usize),
) {
    if extent > 0.0 {
        let (low, count) = PathBox::new(axes, x, v, part).span(axes, extent);
        return for_each_cell(axes, low, count, visit);
    }
    let v = [v[0], v[1], v[2], 0.0];
    let from = axes.grid_coordinates(x);
    let (mut way, mut to) = ([0.0; 4], [0.0; 4]);
    for k in 0..4 {
        way[k] = v[k] * part * axes.cells[k];
        to[k] = from[k] + way[k];
    }
    let (first, last) = (axes.cells(from), axes.cells(to));
    if FIRST {
        visit(axes.index(axes.fold(first)));
    }
    if last != first {
        // Mostly a single face is crossed.
        let faces = |k: usize| last[k].abs_diff(first[k]);
        if faces(0) + faces(1) + faces(2) == 1 {
            visit(axes.index(axes.fold(last)));
        } else {
            trace_on(axes, from, way, first, last, visit);
        }
    }
}

/// The rest of a path that leaves its first cell.
#[inline(never)]
fn trace_on(
    axes: &Axes,
    from: [f32; 4],
    way: [f32; 4],
    first: [i32; 4],
    last: [i32; 4],
    mut visit: impl FnMut(usize),
) {
    // Part of the way to the next face on each axis, and from face to face.
    let (mut next, mut every) = ([f32::INFINITY; 3], [0.0; 3]);
    let mut left = [0; 3];
    for axis in 0..3 {
        if last[axis] != first[axis] {
            left[axis] = last[axis].abs_diff(first[axis]);
            let part = from[axis] - first[axis] as f32;
            let gap = if way[axis] > 0.0 { 1.0 - part } else { part };
            every[axis] = 1.0 / way[axis].abs();
            next[axis] = gap * every[axis];
        }
    }
    let mut cell = first;
    for _ in 0..left[0] + left[1] + left[2] {
        let axis = if next[0] <= next[1] && next[0] <= next[2] {
            0
        } else if next[1] <= next[2] {
            1
        } else {
            2
        };
        cell[axis] += if way[axis] > 0.0 { 1 } else { -1 };
        left[axis] -= 1;
        next[axis] = if left[axis] > 0 { next[axis] + every[axis] } else { f32::INFINITY };
        visit(axes.index(axes.fold(cell)));
    }
}

#[cfg(test)]
mod tests;
