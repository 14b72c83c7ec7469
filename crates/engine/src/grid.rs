//! Grids of places, made afresh from where particles are, independent of what the engine tracks: one grid for every octave of
//! radius, so that a few large bodies cost little.

use std::{collections::BTreeMap, ops::Range};

use glam::DVec3;
use haff_neighbors::{Axis, Geometry};
use rayon::prelude::*;

use crate::particles::World;

/// A sphere where it is now, wrapped into the box.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Sphere {
    pub position: DVec3,
    pub radius: f64,
}

/// Particles of one octave of radius, sorted by cell. Cells are at least a largest diameter, and the asked gap, wide; along axes that do not
/// repeat the grid is folded onto itself.
pub(crate) struct Level {
    /// Cells per axis and per length.
    cells: [usize; 3],
    density: [f64; 3],
    /// Where each cell's particles begin, and where the last one's end.
    start: Vec<u32>,
    pub rows: Vec<u32>,
    /// Spheres of `rows`.
    pub spheres: Vec<Coarse>,
}

/// A sphere in single precision: who is not near needs no more, and a million of them find room in 16 MB.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Coarse {
    pub position: [f32; 3],
    pub radius: f32,
}

impl Level {
    fn new(world: &World, geometry: &Geometry, unsorted: &[u32], gap: f64) -> Self {
        let largest = unsorted.iter().map(|&i| world.class(i).radius).fold(0.0, f64::max);
        // One part in 10⁹ more, so that the rounding of a coordinate cannot lose a pair.
        let width = (2.0 * largest + gap) * (1.0 + 1e-9);
        let mut cells = [0, 1, 2].map(|axis| match geometry.axes[axis] {
            Axis::Flat => 1,
            _ => ((geometry.size[axis] / width).floor() as usize).max(1),
        });
        // No more cells than particles, or nearly.
        while cells.iter().map(|&n| n as f64).product::<f64>() > unsorted.len() as f64 + 64.0 {
            if let Some(most) = cells.iter_mut().max() {
                *most = (*most / 2).max(1);
            }
        }
        let density = std::array::from_fn(|axis| match geometry.axes[axis] {
            Axis::Periodic => cells[axis] as f64 / geometry.size[axis],
            _ => 1.0 / width,
        });
        let count = cells.iter().product::<usize>();
        let mut level =
            Self { cells, density, start: vec![0; count + 1], rows: Vec::new(), spheres: Vec::new() };
        let homes: Vec<u32> =
            unsorted.par_iter().map(|&i| level.index(level.home(place(world, i))) as u32).collect();
        for &cell in &homes {
            level.start[cell as usize + 1] += 1;
        }
        for cell in 0..count {
            level.start[cell + 1] += level.start[cell];
        }
        let mut fill = level.start.clone();
        level.rows = vec![0; unsorted.len()];
        for (&i, cell) in unsorted.iter().zip(homes) {
            let next = &mut fill[cell as usize];
            level.rows[*next as usize] = i;
            *next += 1;
        }
        drop(fill);
        let coarse = |&i: &u32| Coarse {
            position: place(world, i).as_vec3().to_array(),
            radius: world.class(i).radius as f32,
        };
        level.rows.par_iter().map(coarse).collect_into_vec(&mut level.spheres);
        level
    }

    /// Coordinates of the cell of a position.
    fn home(&self, position: DVec3) -> [usize; 3] {
        std::array::from_fn(|axis| {
            let cell = (position[axis] * self.density[axis]).floor() as i64;
            cell.rem_euclid(self.cells[axis] as i64) as usize
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
    pub fn within(&self, cell: usize) -> Range<usize> {
        self.start[cell] as usize..self.start[cell + 1] as usize
    }

    /// Calls `visit` for a cell and those around it, each once.
    #[inline]
    fn around(&self, cell: [usize; 3], mut visit: impl FnMut(usize)) {
        // Along an axis of one or two cells all of them are near.
        let near = |axis: usize| {
            let (at, cells) = (cell[axis], self.cells[axis]);
            let before = if at == 0 { cells - 1 } else { at - 1 };
            let after = if at + 1 == cells { 0 } else { at + 1 };
            ([at, after, before], cells.min(3))
        };
        let ((xs, nx), (ys, ny), (zs, nz)) = (near(0), near(1), near(2));
        for &x in &xs[..nx] {
            for &y in &ys[..ny] {
                let row = self.index([x, y, 0]);
                for &z in &zs[..nz] {
                    visit(row + z);
                }
            }
        }
    }
}

/// Where particle i is now, in the box.
pub(crate) fn place(world: &World, i: u32) -> DVec3 {
    world.wrap(world.state(i, world.now).0).0
}

/// The grids of some particles for finding pairs whose surfaces are no further apart than `gap`; the smallest first.
pub(crate) fn levels(
    world: &World,
    geometry: &Geometry,
    rows: &(impl Iterator<Item = u32> + Clone),
    gap: f64,
) -> Vec<Level> {
    let octave = |i: u32| world.class(i).radius.to_bits() >> 52;
    let mut counts: BTreeMap<u64, usize> = BTreeMap::new();
    rows.clone().for_each(|i| *counts.entry(octave(i)).or_default() += 1);
    let levels = counts.into_iter().map(|(wanted, count)| {
        let mut some = Vec::with_capacity(count);
        some.extend(rows.clone().filter(|&i| octave(i) == wanted));
        Level::new(world, geometry, &some, gap)
    });
    levels.collect()
}

/// Calls `visit` for each particle of a cell of the first level with those of its own level that have not met it yet, and
/// with those of greater levels: a pair of two levels is found from the smaller one.
pub(crate) fn meet(
    world: &World,
    levels: &[Level],
    cell: usize,
    mut visit: impl FnMut(u32, Sphere, &Level, Range<usize>),
) {
    let own = &levels[0];
    let within = own.within(cell);
    for k in within.clone() {
        let i = own.rows[k];
        let sphere = Sphere { position: place(world, i), radius: world.class(i).radius };
        visit(i, sphere, own, k + 1..within.end);
        own.around(own.coordinates(cell), |other| {
            // Two cells are looked at once, from the first.
            if other > cell {
                visit(i, sphere, own, own.within(other));
            }
        });
        for level in &levels[1..] {
            level.around(level.home(sphere.position), |other| visit(i, sphere, level, level.within(other)));
        }
    }
}
