//! Grids of the present positions of particles. They are built from scratch, independently of the engine's
//! search. There is one grid for every octave of radius, so that a few large bodies cost little.

use std::{collections::BTreeSet, ops::Range};

use glam::{DVec3, Vec4};
use haff_neighbors::{Axis, Geometry};
use rayon::prelude::*;

use crate::state::{particle::ClassData, sliding_images::SlidingImages, world::World};

/// Particles of one octave of radius, sorted by cell. The width of a cell is at least the largest diameter
/// plus the requested gap. Along axes that are not periodic the grid is folded onto itself: positions one
/// length of the grid apart are in the same cell.
pub(crate) struct Level {
    /// Number of cells per axis.
    cells: [usize; 3],
    /// Number of cells per length along each axis.
    density: [f64; 3],
    /// Index in `rows` of the first particle of each cell, and at the end the number of particles.
    start: Vec<u32>,
    /// Indices of the particles, sorted by cell.
    pub rows: Vec<u32>,
    /// Present spheres of the particles in `rows`.
    pub spheres: Vec<Coarse>,
}

/// A sphere in single precision: its position, wrapped into the box, and its radius. This is enough to reject
/// distant pairs, and takes 16 MB per million spheres.
pub(crate) type Coarse = Vec4;

/// Least thickness of a slab [widths of the widest cells].
const MIN_THICKNESS: f64 = 4.0;
/// Flag of a particle that belongs to the slab after its own, too.
const NEAR_NEXT: u8 = 1 << 7;

/// The box, divided into slabs along an axis. Building the grids of one slab after the other takes less
/// memory than one grid of all particles.
pub(crate) struct Slabs {
    axis: usize,
    count: usize,
    /// Slab of every particle, with the flag [`NEAR_NEXT`]; empty if there is one slab.
    slab_of: Vec<u8>,
}

impl Slabs {
    /// One slab: the whole box.
    pub const BOX: Self = Self { axis: 0, count: 1, slab_of: Vec::new() };

    /// At most `most` ≤ 128 slabs. Any two particles that touch are contained together in at least one slab.
    pub fn new(world: &World, geometry: &Geometry, most: usize) -> Self {
        let length = |axis: usize| match geometry.axes[axis] {
            Axis::Flat => 0.0,
            _ => geometry.size[axis],
        };
        let axis = (0..3).max_by(|&a, &b| length(a).total_cmp(&length(b))).unwrap_or(0);
        let largest = world.classes.iter().map(|class| class.radius).fold(0.0, f64::max);
        let width = width(largest, 0.0);
        let count = ((length(axis) / (MIN_THICKNESS * width)) as usize).min(most);
        if count < 2 {
            return Self::BOX;
        }
        let per_length = count as f64 / length(axis);
        let slab = |i: u32| {
            let x = wrapped_position(world, i)[axis] * per_length;
            // Particles outside of the box belong to the first or the last slab.
            let slab = x.floor().clamp(0.0, (count - 1) as f64);
            slab as u8 | if slab + 1.0 - x <= width * per_length { NEAR_NEXT } else { 0 }
        };
        let slab_of = (0..world.particles.len() as u32).into_par_iter().map(slab).collect();
        Self { axis, count, slab_of }
    }

    /// Number of slabs.
    pub fn len(&self) -> usize {
        self.count
    }

    /// Whether a slab contains particle i: as one of its own, or as one of the slab before, near the common
    /// face.
    pub fn contains(&self, slab: usize, i: u32) -> bool {
        let Some(&code) = self.slab_of.get(i as usize) else { return true };
        let own = usize::from(code & !NEAR_NEXT);
        own == slab || code & NEAR_NEXT != 0 && (own + 1) % self.count == slab
    }
}

/// Width of cells for pairs of spheres with radii up to `largest` and gaps up to `gap`. It is larger by one
/// part in 10⁹, so that no pair is lost by the rounding of coordinates.
fn width(largest: f64, gap: f64) -> f64 {
    (2.0 * largest + gap) * (1.0 + 1e-9)
}

impl Level {
    /// Builds the grid of some particles. Along the axis of the slabs it has the length of one slab, so that
    /// it is repeated once per slab.
    fn new(world: &World, geometry: &Geometry, unsorted: &[u32], gap: f64, slabs: &Slabs) -> Self {
        let largest = unsorted.iter().map(|&i| world.class(i).radius).fold(0.0, f64::max);
        let width = width(largest, gap);
        let repeats = [0, 1, 2].map(|axis| if axis == slabs.axis { slabs.count } else { 1 });
        let fitting = [0, 1, 2].map(|axis| match geometry.axes[axis] {
            Axis::Flat => 1.0,
            _ => (geometry.size[axis] / repeats[axis] as f64 / width).floor().max(1.0),
        });
        // About as many cells as particles at most: with half or twice as many the search is not faster.
        let cells = limit_cells(fitting, unsorted.len() as f64 + 64.0);
        let density = std::array::from_fn(|axis| match geometry.axes[axis] {
            Axis::Periodic => (repeats[axis] * cells[axis]) as f64 / geometry.size[axis],
            _ => 1.0 / width,
        });
        let count = cells.iter().product::<usize>();
        let mut level =
            Self { cells, density, start: vec![0; count + 1], rows: Vec::new(), spheres: Vec::new() };
        let sphere = |&i: &u32| {
            let position = wrapped_position(world, i);
            let coarse = position.as_vec3().extend(world.class(i).radius as f32);
            (level.index(level.cell_of(position)) as u32, coarse)
        };
        let found: Vec<(u32, Coarse)> = unsorted.par_iter().map(sphere).collect();
        // A counting sort: `start` is first the number of particles per cell, then the end of each cell, and,
        // after filling each cell backwards, its start.
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
        // Backwards, so that the particles of a cell keep their order.
        for (&i, (cell, coarse)) in unsorted.iter().zip(found).rev() {
            let next = &mut level.start[cell as usize];
            *next -= 1;
            level.rows[*next as usize] = i;
            level.spheres[*next as usize] = coarse;
        }
        level
    }

    /// Coordinates of the cell of a position.
    fn cell_of(&self, position: DVec3) -> [usize; 3] {
        std::array::from_fn(|axis| {
            let (x, cells) = (position[axis] * self.density[axis], self.cells[axis] as i64);
            // The floor, computed without an instruction that baseline processors lack. Conversions saturate:
            // along open axes coordinates can be beyond the range of i64.
            let cell = (x as i64).wrapping_sub(i64::from(x < (x as i64) as f64));
            let inside = 0 <= cell && cell < cells;
            (if inside { cell } else { cell.rem_euclid(cells) }) as usize
        })
    }

    /// Index of the cell with these coordinates.
    fn index(&self, [x, y, z]: [usize; 3]) -> usize {
        (x * self.cells[1] + y) * self.cells[2] + z
    }

    /// Coordinates of the cell with this index.
    fn coordinates(&self, index: usize) -> [usize; 3] {
        let row = index / self.cells[2];
        [row / self.cells[1], row % self.cells[1], index % self.cells[2]]
    }

    /// Number of cells.
    pub fn len(&self) -> usize {
        self.start.len() - 1
    }

    /// Indices in `rows` of the particles of a cell.
    fn members(&self, cell: usize) -> Range<usize> {
        self.start[cell] as usize..self.start[cell + 1] as usize
    }

    /// Calls `visit` with the indices in `rows` of the particles in a cell and in its neighbor cells, except
    /// in cells with an index below `first`. Each particle is visited once; adjacent cells form one range.
    #[inline]
    fn visit_neighborhood(&self, cell: [usize; 3], first: usize, mut visit: impl FnMut(Range<usize>)) {
        let ((xs, nx), (ys, ny)) = (self.neighbors_along(cell, 0), self.neighbors_along(cell, 1));
        let (z, depth) = (cell[2], self.cells[2]);
        let mut visit_cells = |from: usize, to: usize| {
            let from = from.max(first);
            if from < to && self.start[from] < self.start[to] {
                visit(self.start[from] as usize..self.start[to] as usize);
            }
        };
        for &x in &xs[..nx] {
            for &y in &ys[..ny] {
                let row = self.index([x, y, 0]);
                if depth < 3 {
                    visit_cells(row, row + depth);
                    continue;
                }
                visit_cells(row + z.max(1) - 1, row + (z + 2).min(depth));
                if z == 0 {
                    visit_cells(row + depth - 1, row + depth);
                } else if z + 1 == depth {
                    visit_cells(row, row + 1);
                }
            }
        }
    }

    /// A cell's coordinate along an axis and the two next to it, and how many of these are distinct: one or
    /// two if the axis has only one or two cells.
    #[inline]
    fn neighbors_along(&self, cell: [usize; 3], axis: usize) -> ([usize; 3], usize) {
        let (own, cells) = (cell[axis], self.cells[axis]);
        let before = if own == 0 { cells - 1 } else { own - 1 };
        let after = if own + 1 == cells { 0 } else { own + 1 };
        ([own, after, before], cells.min(3))
    }
}

/// Cells per axis: as many as fit, but at most `most` (≥ 1) in total. Along all axes with several cells the
/// number is reduced by the same factor.
fn limit_cells(mut fitting: [f64; 3], most: f64) -> [usize; 3] {
    loop {
        let count = fitting.iter().product::<f64>();
        if count <= most {
            return fitting.map(|cells| cells as usize);
        }
        let several = fitting.iter().filter(|&&cells| cells > 1.0).count();
        let factor = (most / count).powf(1.0 / several as f64);
        fitting = fitting.map(|cells| (factor * cells).floor().max(1.0));
    }
}

/// The present position of particle i, wrapped into the box.
pub(crate) fn wrapped_position(world: &World, i: u32) -> DVec3 {
    world.wrap(world.state(i, world.now).0, world.now).0
}

/// The grids of the particles `rows`, for finding pairs with a gap of at most `gap` between their surfaces;
/// small radii first. If there are several slabs, `rows` must be the particles of one of them.
pub(crate) fn levels(
    world: &World,
    geometry: &Geometry,
    rows: &(impl Iterator<Item = u32> + Clone),
    gap: f64,
    slabs: &Slabs,
) -> Vec<Level> {
    let octave = |class: &ClassData| class.radius.to_bits() >> 52;
    let mut octaves = BTreeSet::new();
    // Extended one by one: collecting would copy all classes first, which can be as many as particles.
    octaves.extend(world.classes.iter().map(octave));
    let single = octaves.len() == 1;
    let levels = octaves.iter().filter_map(|&wanted| {
        let members: Vec<u32> =
            rows.clone().filter(|&i| single || octave(world.class(i)) == wanted).collect();
        (!members.is_empty()).then(|| Level::new(world, geometry, &members, gap, slabs))
    });
    levels.collect()
}

/// Visits all pairs of particles in the same or in neighbor cells, one of which is in `cell` of the first
/// level. Pairs within the first level are visited from the particle with the lower index in `rows`, pairs of
/// two levels from the smaller particle.
///
/// Calls `visit` with the index in `rows` of a particle of the cell, and a range of indices in the `rows` of
/// the same or a later level.
#[inline]
pub(crate) fn visit_pairs(
    world: &World,
    levels: &[Level],
    cell: usize,
    mut visit: impl FnMut(usize, &Level, Range<usize>),
) {
    let own = &levels[0];
    let members = own.members(cell);
    if members.is_empty() {
        return;
    }
    // Nine rows of cells, with two ranges in each where the grid wraps around.
    let mut ranges = [const { 0..0 }; 18];
    let mut count = 0;
    own.visit_neighborhood(own.coordinates(cell), cell + 1, |range| {
        ranges[count] = range;
        count += 1;
    });
    for k in members.clone() {
        visit(k, own, k + 1..members.end);
        for range in &ranges[..count] {
            visit(k, own, range.clone());
        }
        for level in &levels[1..] {
            level.visit_neighborhood(level.cell_of(wrapped_position(world, own.rows[k])), 0, |range| {
                visit(k, level, range);
            });
        }
    }
}

/// Visits pairs that may be nearer than `reach` \[length\] across the faces of the gradient axis of a sheared
/// box, where images are displaced along the flow: the grids find all others.
pub(crate) fn visit_pairs_across_sheared_faces(
    world: &World,
    shear: &SlidingImages,
    reach: f64,
    mut visit: impl FnMut(u32, u32),
) {
    let height = world.boundary.periodicity.size[shear.gradient];
    let length = world.boundary.periodicity.size[shear.flow];
    let offset = world.displacement(world.now).offset;
    // Coordinates along the flow: of particles at the upper face, and of images of those at the lower one.
    let (mut upper, mut lower) = (Vec::new(), Vec::new());
    for i in 0..world.particles.len() as u32 {
        let position = wrapped_position(world, i);
        if position[shear.gradient] >= height - reach {
            upper.push((position[shear.flow], i));
        }
        if position[shear.gradient] <= reach {
            lower.push(((position[shear.flow] + offset).rem_euclid(length), i));
        }
    }
    lower.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    for &(x, i) in &upper {
        for edge in [-length, 0.0, length] {
            let first = lower.partition_point(|&(other, _)| other < x + edge - reach);
            let near = lower[first..].iter().take_while(|&&(other, _)| other <= x + edge + reach);
            near.filter(|&&(_, j)| j != i).for_each(|&(_, j)| visit(i, j));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_are_at_most_the_limit_and_not_much_fewer() {
        for (fitting, most) in [
            ([32.0, 32.0, 32.0], 32_000.0),
            ([1e6, 3.0, 1.0], 100.0),
            ([5.0, 1.0, 1.0], 64.0),
            ([1e9, 1e9, 1e9], 64.0),
            ([2.0, 2.0, 1e5], 1000.0),
            ([1.0, 1.0, 1.0], 64.0),
        ] {
            let cells = limit_cells(fitting, most).map(|cells| cells as f64);
            let (count, wanted) = (cells.iter().product::<f64>(), fitting.iter().product::<f64>().min(most));
            assert!(count <= most && count > 0.4 * wanted, "{fitting:?}, {most}: {cells:?}");
            assert!((0..3).all(|axis| 1.0 <= cells[axis] && cells[axis] <= fitting[axis]));
        }
    }
}
