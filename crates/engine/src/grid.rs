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

/// How wide cells are in which no pair of spheres of at most this radius is lost: one part in 10⁹ is for the rounding of coordinates.
fn width(largest: f64, gap: f64) -> f64 {
    (2.0 * largest + gap) * (1.0 + 1e-9)
}

impl Level {
    /// The grid goes round as often as there are slabs.
    fn new(world: &World, geometry: &Geometry, unsorted: &[u32], gap: f64, slabs: &Slabs) -> Self {
        let largest = unsorted.iter().map(|&i| world.class(i).radius).fold(0.0, f64::max);
        let width = width(largest, gap);
        let turns = [0, 1, 2].map(|axis| if axis == slabs.axis { slabs.count } else { 1 });
        let mut cells = [0, 1, 2].map(|axis| match geometry.axes[axis] {
            Axis::Flat => 1,
            _ => ((geometry.size[axis] / turns[axis] as f64 / width).floor() as usize).max(1),
        });
        // No more cells than particles, or nearly.
        while cells.iter().map(|&n| n as f64).product::<f64>() > unsorted.len() as f64 + 64.0 {
            if let Some(most) = cells.iter_mut().max() {
                *most = (*most / 2).max(1);
            }
        }
        let density = std::array::from_fn(|axis| match geometry.axes[axis] {
            Axis::Periodic => (turns[axis] * cells[axis]) as f64 / geometry.size[axis],
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

/// The grids of some particles, all or those that one of the `slabs` knows, for finding pairs whose surfaces are no further apart than `gap`; the
/// smallest first.
pub(crate) fn levels(
    world: &World,
    geometry: &Geometry,
    rows: &(impl Iterator<Item = u32> + Clone),
    gap: f64,
    slabs: &Slabs,
) -> Vec<Level> {
    let octave = |i: u32| world.class(i).radius.to_bits() >> 52;
    let mut counts: BTreeMap<u64, usize> = BTreeMap::new();
    rows.clone().for_each(|i| *counts.entry(octave(i)).or_default() += 1);
    let levels = counts.into_iter().map(|(wanted, count)| {
        let mut some = Vec::with_capacity(count);
        some.extend(rows.clone().filter(|&i| octave(i) == wanted));
        Level::new(world, geometry, &some, gap, slabs)
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
