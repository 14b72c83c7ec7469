//! Grids of places, made afresh from where particles are, independent of what the engine tracks: one grid for
//! every octave of radius, so that a few large bodies cost little.

use std::{collections::BTreeSet, ops::Range};

use glam::{DVec3, Vec4};
use haff_neighbors::{Axis, Geometry};
use rayon::prelude::*;

use crate::particles::{ClassData, World};

/// Particles of one octave of radius, sorted by cell. Cells are at least a largest diameter, and the asked
/// gap, wide; along axes that do not repeat the grid is folded onto itself.
pub(crate) struct Level {
    /// Cells per axis and per length.
    cells: [usize; 3],
    density: [f64; 3],
    /// Where each cell's particles begin, and where the last one's end.
    start: Vec<u32>,
    pub rows: Vec<u32>,
    /// Spheres of `rows`, where they are now.
    pub spheres: Vec<Coarse>,
}

/// A sphere in single precision, wrapped into the box, its radius last: who is not near needs no more, and a
/// million of them find room in 16 MB.
pub(crate) type Coarse = Vec4;

/// Widths of the widest cells that a slab is thick, at least.
const THICK: f64 = 4.0;
/// Particle that the slab after its own has to know, too.
const NEAR_NEXT: u8 = 1 << 7;

/// The box in slabs across an axis. Grids of one after the other need less memory than a grid of all.
pub(crate) struct Slabs {
    axis: usize,
    count: usize,
    /// Slab of every particle, and whether it is [`NEAR_NEXT`]; empty if there is one slab.
    homes: Vec<u8>,
}

impl Slabs {
    /// One slab: the box.
    pub const BOX: Self = Self { axis: 0, count: 1, homes: Vec::new() };

    /// At most `most` slabs, 128 at most, such that of two particles that touch one slab knows both.
    pub fn new(world: &World, geometry: &Geometry, most: usize) -> Self {
        let length = |axis: usize| match geometry.axes[axis] {
            Axis::Flat => 0.0,
            _ => geometry.size[axis],
        };
        let axis = (0..3).max_by(|&a, &b| length(a).total_cmp(&length(b))).unwrap_or(0);
        let largest = world.classes.iter().map(|class| class.radius).fold(0.0, f64::max);
        let width = width(largest, 0.0);
        let count = ((length(axis) / (THICK * width)) as usize).min(most);
        if count < 2 {
            return Self::BOX;
        }
        let per_length = count as f64 / length(axis);
        let home = |i: u32| {
            let x = place(world, i)[axis] * per_length;
            // What is outside of the box, too, is in a slab.
            let home = x.floor().clamp(0.0, (count - 1) as f64);
            home as u8 | if home + 1.0 - x <= width * per_length { NEAR_NEXT } else { 0 }
        };
        let homes = (0..world.particles.len() as u32).into_par_iter().map(home).collect();
        Self { axis, count, homes }
    }

    /// Number of slabs.
    pub fn len(&self) -> usize {
        self.count
    }

    /// Whether a slab knows particle i.
    pub fn knows(&self, slab: usize, i: u32) -> bool {
        let Some(&home) = self.homes.get(i as usize) else { return true };
        let own = usize::from(home & !NEAR_NEXT);
        own == slab || home & NEAR_NEXT != 0 && (own + 1) % self.count == slab
    }
}

/// How wide cells are in which no pair of spheres of at most this radius is lost: one part in 10⁹ is for the
/// rounding of coordinates.
fn width(largest: f64, gap: f64) -> f64 {
    (2.0 * largest + gap) * (1.0 + 1e-9)
}

impl Level {
    /// The grid goes round as often as there are slabs.
    fn new(world: &World, geometry: &Geometry, unsorted: &[u32], gap: f64, slabs: &Slabs) -> Self {
        let largest = unsorted.iter().map(|&i| world.class(i).radius).fold(0.0, f64::max);
        let width = width(largest, gap);
        let turns = [0, 1, 2].map(|axis| if axis == slabs.axis { slabs.count } else { 1 });
        let fitting = [0, 1, 2].map(|axis| match geometry.axes[axis] {
            Axis::Flat => 1.0,
            _ => (geometry.size[axis] / turns[axis] as f64 / width).floor().max(1.0),
        });
        // No more cells than particles, or nearly: half and twice as many are no better.
        let cells = no_more(fitting, unsorted.len() as f64 + 64.0);
        let density = std::array::from_fn(|axis| match geometry.axes[axis] {
            Axis::Periodic => (turns[axis] * cells[axis]) as f64 / geometry.size[axis],
            _ => 1.0 / width,
        });
        let count = cells.iter().product::<usize>();
        let mut level =
            Self { cells, density, start: vec![0; count + 1], rows: Vec::new(), spheres: Vec::new() };
        let sphere = |&i: &u32| {
            let position = place(world, i);
            let coarse = position.as_vec3().extend(world.class(i).radius as f32);
            (level.index(level.home(position)) as u32, coarse)
        };
        let found: Vec<(u32, Coarse)> = unsorted.par_iter().map(sphere).collect();
        // First how many a cell has, then where they end; filled from there, where they begin.
        for &(cell, _) in &found {
            level.start[cell as usize] += 1;
        }
        let mut end = 0;
        for start in &mut level.start {
            end += *start;
            *start = end;
        }
        level.rows = vec![0; unsorted.len()];
        level.spheres = vec![Coarse::ZERO; unsorted.len()];
        // From behind, so that the particles of a cell keep their order.
        for (&i, (cell, coarse)) in unsorted.iter().zip(found).rev() {
            let next = &mut level.start[cell as usize];
            *next -= 1;
            level.rows[*next as usize] = i;
            level.spheres[*next as usize] = coarse;
        }
        level
    }

    /// Coordinates of the cell of a position.
    fn home(&self, position: DVec3) -> [usize; 3] {
        std::array::from_fn(|axis| {
            let (x, cells) = (position[axis] * self.density[axis], self.cells[axis] as i64);
            // The floor, for which some processors have no instruction. Conversions saturate for coordinates
            // beyond the range of i64, which open axes allow.
            let cell = (x as i64).wrapping_sub(i64::from(x < (x as i64) as f64));
            let inside = 0 <= cell && cell < cells;
            (if inside { cell } else { cell.rem_euclid(cells) }) as usize
        })
    }

    fn index(&self, [x, y, z]: [usize; 3]) -> usize {
        (x * self.cells[1] + y) * self.cells[2] + z
    }

    /// Coordinates of the cell of this index.
    fn coordinates(&self, index: usize) -> [usize; 3] {
        let row = index / self.cells[2];
        [row / self.cells[1], row % self.cells[1], index % self.cells[2]]
    }

    /// Number of cells.
    pub fn len(&self) -> usize {
        self.start.len() - 1
    }

    /// Places in `rows` of the particles of a cell.
    fn within(&self, cell: usize) -> Range<usize> {
        self.start[cell] as usize..self.start[cell + 1] as usize
    }

    /// Calls `visit` with the places in `rows` of the particles of a cell and of those around it, as far as
    /// cells are not before `first`: each particle once, cells in a row together.
    #[inline]
    fn around(&self, cell: [usize; 3], first: usize, mut visit: impl FnMut(Range<usize>)) {
        let ((xs, nx), (ys, ny)) = (self.near(cell, 0), self.near(cell, 1));
        let (z, depth) = (cell[2], self.cells[2]);
        let mut some = |from: usize, to: usize| {
            let from = from.max(first);
            if from < to && self.start[from] < self.start[to] {
                visit(self.start[from] as usize..self.start[to] as usize);
            }
        };
        for &x in &xs[..nx] {
            for &y in &ys[..ny] {
                let row = self.index([x, y, 0]);
                if depth < 3 {
                    some(row, row + depth);
                    continue;
                }
                some(row + z.max(1) - 1, row + (z + 2).min(depth));
                if z == 0 {
                    some(row + depth - 1, row + depth);
                } else if z + 1 == depth {
                    some(row, row + 1);
                }
            }
        }
    }

    /// A cell's coordinate along an axis and those next to it, and how many they are: of one or two cells all
    /// are near.
    #[inline]
    fn near(&self, cell: [usize; 3], axis: usize) -> ([usize; 3], usize) {
        let (at, cells) = (cell[axis], self.cells[axis]);
        let before = if at == 0 { cells - 1 } else { at - 1 };
        let after = if at + 1 == cells { 0 } else { at + 1 };
        ([at, after, before], cells.min(3))
    }
}

/// As many cells per axis as fit, but at most `most` (≥ 1) in all: wider by the same factor along all axes
/// that have several.
fn no_more(mut fitting: [f64; 3], most: f64) -> [usize; 3] {
    loop {
        let count = fitting.iter().product::<f64>();
        if count <= most {
            return fitting.map(|cells| cells as usize);
        }
        let several = fitting.iter().filter(|&&cells| cells > 1.0).count();
        let part = (most / count).powf(1.0 / several as f64);
        fitting = fitting.map(|cells| (part * cells).floor().max(1.0));
    }
}

/// Where particle i is now, in the box.
pub(crate) fn place(world: &World, i: u32) -> DVec3 {
    world.periodicity.wrap(world.state(i, world.now).0).0
}

/// The grids of some particles, all or those that one of the `slabs` knows, for finding pairs whose surfaces
/// are no further apart than `gap`; the smallest first.
pub(crate) fn levels(
    world: &World,
    geometry: &Geometry,
    rows: &(impl Iterator<Item = u32> + Clone),
    gap: f64,
    slabs: &Slabs,
) -> Vec<Level> {
    let octave = |class: &ClassData| class.radius.to_bits() >> 52;
    let mut octaves = BTreeSet::new();
    // One by one: there may be as many classes as particles, and collecting would copy all of them.
    octaves.extend(world.classes.iter().map(octave));
    let alone = octaves.len() == 1;
    let levels = octaves.iter().filter_map(|&wanted| {
        let some: Vec<u32> = rows.clone().filter(|&i| alone || octave(world.class(i)) == wanted).collect();
        (!some.is_empty()).then(|| Level::new(world, geometry, &some, gap, slabs))
    });
    levels.collect()
}

/// Calls `visit` for each particle of a cell of the first level, told by its place in `rows`, with those of
/// its own level that have not met it yet, and with those of greater levels: a pair of two levels is found
/// from the smaller one.
#[inline]
pub(crate) fn meet(
    world: &World,
    levels: &[Level],
    cell: usize,
    mut visit: impl FnMut(usize, &Level, Range<usize>),
) {
    let own = &levels[0];
    let within = own.within(cell);
    if within.is_empty() {
        return;
    }
    // Nine rows, two runs in each where the grid begins again.
    let mut runs = [const { 0..0 }; 18];
    let mut count = 0;
    own.around(own.coordinates(cell), cell + 1, |run| {
        runs[count] = run;
        count += 1;
    });
    for k in within.clone() {
        visit(k, own, k + 1..within.end);
        for run in &runs[..count] {
            visit(k, own, run.clone());
        }
        for level in &levels[1..] {
            level.around(level.home(place(world, own.rows[k])), 0, |run| visit(k, level, run));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_are_no_more_than_asked_and_no_fewer_than_they_need_be() {
        for (fitting, most) in [
            ([32.0, 32.0, 32.0], 32_000.0),
            ([1e6, 3.0, 1.0], 100.0),
            ([5.0, 1.0, 1.0], 64.0),
            ([1e9, 1e9, 1e9], 64.0),
            ([2.0, 2.0, 1e5], 1000.0),
            ([1.0, 1.0, 1.0], 64.0),
        ] {
            let cells = no_more(fitting, most).map(|cells| cells as f64);
            let (count, wanted) = (cells.iter().product::<f64>(), fitting.iter().product::<f64>().min(most));
            assert!(count <= most && count > 0.4 * wanted, "{fitting:?}, {most}: {cells:?}");
            assert!((0..3).all(|axis| 1.0 <= cells[axis] && cells[axis] <= fitting[axis]));
        }
    }
}
