/*!
The grid of a window: in which cells particles are, at any time within it.

A particle is registered in every cell that its path through the window touches. So whoever looks for partners has to look
at the cells near its own path only, however fast others are. A particle that takes a new path is registered along that
too; where it was registered before does no harm, since what is tested is always its path of now.

Cells are found in single precision: which of two cells a particle on their common face is in does not matter, as long as
searches reach a little further ([`SLACK`]) than contacts do.
*/

use haff_neighbors::{Geometry, roomy};

use super::axes::Axes;

/// Entries of a block; with its link it fills half a cache line.
const ENTRIES: usize = 7;
/// What searches reach further [cells]: ten times the rounding of a place among the most cells, [`super::axes`].
const SLACK: f32 = 2e-3;
/// Cells per axis of the blocks of cells that searches have tables for.
const TABLED: usize = 4;

/// Up to seven entries, and what follows: the number of entries in three bits, the next block above.
#[derive(Debug, Clone, Copy)]
#[repr(C, align(32))]
struct Block {
    entries: [u32; ENTRIES],
    link: u32,
}

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

/// Slots of a vector.
pub(super) const LANES: usize = 8;

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

    /// Adds the entries of a block; returns its link.
    ///
    /// # Safety
    ///
    /// There must be [room](Self::reserve) for it.
    #[inline(always)]
    unsafe fn push(&mut self, block: &Block) -> u32 {
        debug_assert!(self.len + LANES <= self.slots.len());
        // The whole block in one move; what lies beyond its entries is overwritten by the next.
        // SAFETY: a block is as long as `LANES` slots, and the caller has made room.
        unsafe {
            let to = self.slots.as_mut_ptr().add(self.len).cast::<[u32; LANES]>();
            to.write(std::ptr::from_ref(block).cast::<[u32; LANES]>().read());
        }
        self.len += (block.link & 7) as usize;
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

/// A cell of a block of cells: the step from the index of the first, inside the grid, and the steps along the axes.
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
    /// Empty cells about `width` wide.
    pub fn new(geometry: &Geometry, width: f64) -> Self {
        let axes = Axes::new(geometry, width);
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
        let mut blocks = roomy(cells + cells / 8);
        blocks.resize(cells, EMPTY);
        Self { axes, blocks, count: cells, tables }
    }

    /// The cell of a coordinate.
    pub fn home(&self, x: [i32; 3]) -> u32 {
        self.axes.index(self.axes.fold(self.axes.cells(self.axes.places(x)))) as u32
    }

    /// Number of cells.
    pub fn len(&self) -> usize {
        self.count
    }

    /// Takes everybody out.
    pub fn clear(&mut self) {
        self.blocks.truncate(self.count);
        for block in &mut self.blocks {
            block.link = 0;
        }
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

    /// Registers a slot in all cells within `extent` [length] of the path from `x`, the `part` of the displacement `v` [length]
    /// long. Without an extent, in the cell of `x` only if it is `NEW` there.
    #[inline(always)]
    pub fn register<const NEW: bool>(&mut self, slot: u32, x: [i32; 3], v: [f32; 3], part: f32, extent: f32) {
        if extent > 0.0 {
            return self.register_box(slot, x, v, part, extent);
        }
        let axes = &self.axes;
        let v = [v[0], v[1], v[2], 0.0];
        let from = axes.places(x);
        let (mut way, mut to) = ([0.0; 4], [0.0; 4]);
        for k in 0..4 {
            way[k] = v[k] * part * axes.cells[k];
            to[k] = from[k] + way[k];
        }
        let (first, last) = (axes.cells(from), axes.cells(to));
        let axes = *axes;
        if NEW {
            self.add(axes.index(axes.fold(first)), slot);
        }
        if last != first {
            // Mostly a single face is crossed.
            let faces = |k: usize| last[k].abs_diff(first[k]);
            if faces(0) + faces(1) + faces(2) == 1 {
                self.add(axes.index(axes.fold(last)), slot);
            } else {
                self.register_on(slot, from, way, first, last);
            }
        }
    }

    /// [`Self::register`] for large particles: all cells of the box around the path.
    #[inline(never)]
    fn register_box(&mut self, slot: u32, x: [i32; 3], v: [f32; 3], part: f32, extent: f32) {
        let (low, count) = self.span(x, v, part, ([extent; 3], extent));
        let start = self.axes.fold(low);
        let n = self.axes.n;
        let wrap = |at: i32, axis: usize| if at >= n[axis] { at - n[axis] } else { at };
        for z in 0..count[2] {
            for y in 0..count[1] {
                let row = (wrap(start[2] + z, 2) * n[1] + wrap(start[1] + y, 1)) * n[0];
                for x in 0..count[0] {
                    let cell = (row + wrap(start[0] + x, 0)) as usize;
                    let block = &self.blocks[cell];
                    if !block.entries[..(block.link & 7) as usize].contains(&slot) {
                        self.add(cell, slot);
                    }
                }
            }
        }
    }

    /// First cell, counted on beyond the edges, and number of cells per axis, of the box around a path.
    #[inline(always)]
    fn span(
        &self,
        x: [i32; 3],
        v: [f32; 3],
        part: f32,
        (below, above): ([f32; 3], f32),
    ) -> ([i32; 4], [i32; 3]) {
        let axes = &self.axes;
        let (v, below) = ([v[0], v[1], v[2], 0.0], [below[0], below[1], below[2], 0.0]);
        let place = axes.places(x);
        let (mut low, mut high) = ([0.0; 4], [0.0; 4]);
        for k in 0..4 {
            let way = v[k] * part * axes.cells[k];
            low[k] = place[k] + way.min(0.0) - (below[k] * axes.cells[k] + SLACK);
            high[k] = place[k] + way.max(0.0) + (above * axes.cells[k] + SLACK);
        }
        let (low, high) = (axes.cells(low), axes.cells(high));
        let count = |k: usize| (high[k] - low[k] + 1).min(axes.n[k]);
        (low, [count(0), count(1), count(2)])
    }

    /// The rest of a path that leaves its first cell.
    #[inline(never)]
    fn register_on(&mut self, slot: u32, from: [f32; 4], way: [f32; 4], first: [i32; 4], last: [i32; 4]) {
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
            self.add(self.axes.index(self.axes.fold(cell)), slot);
        }
    }

    /// Gathers, for the search of number `search` from slot `own`, all that are registered within `margins` (below on
    /// each axis, above) [length] of the box around the path from `x`, the `part` of the displacement `v` [length] long.
    #[inline(always)]
    #[expect(clippy::too_many_arguments, reason = "in registers, on the hottest path")]
    pub fn gather(
        &self,
        search: u32,
        own: u32,
        x: [i32; 3],
        v: [f32; 3],
        part: f32,
        margins: ([f32; 3], f32),
        candidates: &mut Candidates,
    ) {
        let axes = &self.axes;
        let (low, count) = self.span(x, v, part, margins);
        let past = |k: usize| low[k] + count[k] > axes.n[k];
        let outside = (low[0] | low[1] | low[2]) < 0 || past(0) | past(1) | past(2);
        let from = candidates.len;
        let mut links = 0;
        if count[0].max(count[1]).max(count[2]) > TABLED as i32 {
            let blocks = count.iter().map(|&count| count as usize).product();
            candidates.reserve(blocks);
            candidates.blocks += blocks as u64;
            self.each(low, count, |block| {
                // SAFETY: there is room for as many blocks as there are cells.
                links |= unsafe { candidates.push(block) };
            });
        } else {
            let shape = ((count[2] - 1) * TABLED as i32 + count[1] - 1) * TABLED as i32 + count[0] - 1;
            let table = &self.tables[shape as usize];
            candidates.reserve(table.len());
            candidates.blocks += table.len() as u64;
            if outside {
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
                    links |= unsafe { candidates.push(&self.blocks[cell]) };
                }
            } else {
                let first = axes.index(low);
                for &Step { inside, .. } in table {
                    // SAFETY: as above.
                    links |= unsafe { candidates.push(&self.blocks[first + inside as usize]) };
                }
            }
        }
        if links > 7 {
            self.each(low, count, |block| self.follow(block.link, candidates));
        }
        candidates.end(from, search, own);
    }

    /// Visits the first blocks of a block of cells, wherever it lies.
    #[inline(always)]
    fn each<'a>(&'a self, low: [i32; 4], count: [i32; 3], mut visit: impl FnMut(&'a Block)) {
        let n = self.axes.n;
        let start = self.axes.fold(low);
        let wrapped = |at: i32, axis: usize| if at >= n[axis] { at - n[axis] } else { at };
        for z in 0..count[2] {
            let plane = wrapped(start[2] + z, 2) * n[1];
            for y in 0..count[1] {
                let row = (plane + wrapped(start[1] + y, 1)) * n[0];
                for x in 0..count[0] {
                    visit(&self.blocks[(row + wrapped(start[0] + x, 0)) as usize]);
                }
            }
        }
    }

    /// Adds the blocks that a cell goes on in.
    #[cold]
    #[inline(never)]
    fn follow(&self, mut link: u32, candidates: &mut Candidates) {
        while link > 7 {
            candidates.reserve(1);
            // SAFETY: there is room.
            link = unsafe { candidates.push(&self.blocks[(link >> 3) as usize]) };
        }
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;
    use haff_neighbors::Axis;

    use super::*;
    use crate::windows::random::Random;

    fn geometry(size: DVec3, axes: [Axis; 3]) -> Geometry {
        Geometry { size, axes, reach: 1.0, radius: 0.5, radii: Vec::new(), planes: Vec::new() }
    }

    /// A path through a window, bent once.
    struct Path {
        start: [f64; 3],
        ways: [[f64; 3]; 2],
        bend: f64,
        extent: f64,
    }

    impl Path {
        fn new(random: &mut Random, geometry: &Geometry, longest: f64, extent: f64) -> Self {
            let mut path = Self { start: [0.0; 3], ways: [[0.0; 3]; 2], bend: 1.0, extent };
            if random.index(3) == 0 {
                path.bend = random.uniform(0.1, 0.9);
            }
            for axis in (0..3).filter(|&axis| geometry.axes[axis] != Axis::Flat) {
                let length = geometry.size[axis];
                path.start[axis] = random.uniform(0.0, length);
                for way in &mut path.ways {
                    // Some along an axis, or at rest.
                    let part = if random.index(4) == 0 { 0.0 } else { longest };
                    way[axis] = random.uniform(-part, part) * length;
                }
            }
            path
        }

        fn at(&self, theta: f64) -> [f64; 3] {
            let (before, after) = (theta.min(self.bend), (theta - self.bend).max(0.0));
            [0, 1, 2].map(|k| self.start[k] + before * self.ways[0][k] + after * self.ways[1][k])
        }
    }

    fn coordinates(cells: &Cells, p: [f64; 3]) -> [i32; 3] {
        [0, 1, 2].map(|axis| cells.axes.coordinate(axis, p[axis]))
    }

    /// The promise of the grid, for straight and bent paths and searches from the start and from later on.
    #[test]
    fn whoever_comes_near_a_path_is_among_its_candidates() {
        use Axis::{Bounded, Flat, Periodic};
        let grids = [
            (DVec3::new(20.0, 14.0, 17.0), [Periodic; 3], 1.0, 0.05),
            (DVec3::new(20.0, 14.0, 17.0), [Periodic; 3], 1.0, 0.22),
            (DVec3::new(9.0, 30.0, 12.0), [Bounded; 3], 0.9, 0.4),
            (DVec3::new(12.0, 11.0, 10.0), [Periodic, Bounded, Periodic], 1.1, 0.2),
            (DVec3::new(300.0, 250.0, 1.0), [Periodic, Bounded, Flat], 1.0, 0.22),
            // One, two and three cells to an edge.
            (DVec3::new(5.0, 10.0, 15.0), [Periodic; 3], 5.0, 0.2),
            (DVec3::new(5.0, 10.0, 15.0), [Bounded, Bounded, Periodic], 5.0, 0.4),
        ];
        let mut random = Random(11);
        let (mut near, mut candidates_in_all, mut pairs) = (0, 0, 0);
        for (size, axes, width, longest) in grids {
            let geometry = geometry(size, axes);
            for largest in [0.0, 1.6] {
                let mut cells = Cells::new(&geometry, width);
                let paths: Vec<Path> = (0..150)
                    .map(|k| {
                        let extent = if k % 3 == 0 { random.uniform(0.0, largest) } else { 0.0 };
                        Path::new(&mut random, &geometry, longest, extent)
                    })
                    .collect();
                for (slot, path) in paths.iter().enumerate() {
                    let extent = path.extent as f32;
                    let slot = slot as u32;
                    let ways = path.ways.map(|way| way.map(|way| way as f32));
                    cells.register::<true>(slot, coordinates(&cells, path.start), ways[0], 1.0, extent);
                    if path.bend < 1.0 {
                        let place = coordinates(&cells, path.at(path.bend));
                        cells.register::<false>(slot, place, ways[1], 1.0 - path.bend as f32, extent);
                    }
                }
                let mut candidates = Candidates::new();
                let searches: Vec<(usize, f64, [f64; 3], f64)> = (0..paths.len())
                    .map(|own| {
                        let straight = paths[own].bend == 1.0;
                        let from = if straight {
                            random.index(2) as f64 * random.uniform(0.0, 1.0)
                        } else {
                            paths[own].bend
                        };
                        let above = random.uniform(0.0, 1.2);
                        let below =
                            [0; 3].map(|_| if random.index(3) == 0 { 0.0 } else { random.uniform(0.0, 1.2) });
                        (own, from, below, above)
                    })
                    .collect();
                for (search, &(own, from, below, above)) in searches.iter().enumerate() {
                    let path = &paths[own];
                    let way = path.ways[usize::from(path.bend < 1.0)].map(|way| way as f32);
                    let margins = (below.map(|below| below as f32), above as f32);
                    let place = coordinates(&cells, path.at(from));
                    let part = 1.0 - from as f32;
                    cells.gather(search as u32, own as u32, place, way, part, margins, &mut candidates);
                }
                let mut found = vec![vec![false; paths.len()]; searches.len()];
                for k in 0..candidates.len {
                    found[candidates.owner[k / LANES] as usize][candidates.slots[k] as usize] = true;
                }
                candidates_in_all += found.iter().flatten().filter(|&&found| found).count();
                pairs += searches.len() * paths.len();
                for (&(own, from, below, above), found) in searches.iter().zip(&found) {
                    for (slot, path) in paths.iter().enumerate() {
                        let comes_near = (0..=40).any(|k| {
                            let theta = from + (1.0 - from) * f64::from(k) / 40.0;
                            let (a, b) = (paths[own].at(theta), path.at(theta));
                            (0..3).all(|axis| {
                                let mut d = b[axis] - a[axis];
                                if axes[axis] == Periodic {
                                    d -= (d / size[axis]).round() * size[axis];
                                }
                                -below[axis] - path.extent <= d && d <= above + path.extent
                            })
                        });
                        near += usize::from(comes_near);
                        assert!(!comes_near || found[slot], "{axes:?}, {size}: {own} does not find {slot}");
                    }
                }
            }
        }
        // Something was there to be missed, and finding everybody would not do.
        assert!(near > 3000, "{near}");
        assert!(2 * candidates_in_all < pairs, "{candidates_in_all} of {pairs}");
    }

    #[test]
    fn a_cell_holds_any_number_and_forgets_all() {
        let geometry = geometry(DVec3::splat(8.0), [Axis::Periodic; 3]);
        let mut cells = Cells::new(&geometry, 1.0);
        let mut candidates = Candidates::new();
        let count = 10_000;
        for round in 0..2 {
            for slot in 0..count {
                cells.register::<true>(slot, coordinates(&cells, [4.5; 3]), [0.0; 3], 1.0, 0.0);
            }
            for (search, place) in [[4.5; 3], [5.2, 4.5, 3.9]].into_iter().enumerate() {
                candidates.len = 0;
                let x = coordinates(&cells, place);
                cells.gather(search as u32, count, x, [0.0; 3], 1.0, ([0.5; 3], 0.5), &mut candidates);
                let mut slots = candidates.slots[..candidates.len].to_vec();
                slots.retain(|&slot| slot != count);
                slots.sort_unstable();
                assert!(slots.into_iter().eq(0..count), "round {round}, from {place:?}");
                let owner = &candidates.owner[..candidates.len / LANES];
                assert!(owner.iter().all(|&owner| owner == search as u32));
            }
            cells.clear();
            candidates.len = 0;
            let x = coordinates(&cells, [4.5; 3]);
            cells.gather(0, count, x, [0.0; 3], 1.0, ([0.5; 3], 0.5), &mut candidates);
            assert!(candidates.slots[..candidates.len].iter().all(|&slot| slot == count), "round {round}");
        }
    }
}
