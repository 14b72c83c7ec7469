//! A grid of cells at least one contact distance wide.

use glam::DVec3;
use haff_mechanics::time_to_face;
use rayon::prelude::*;

use crate::{Axis, Crossing, Flight, Geometry, Search, Shift, walls::WallTable};

/// Cells are this factor wider than the largest contact distance, so that rounding of a crossing time can
/// never bring two particles into contact before they are in neighboring cells.
const MARGIN: f64 = 1.0 + 1e-9;
/// Mean number of particles per cell, unless the contact distance requires wider cells.
const OCCUPANCY: f64 = 1.0;
/// Largest value of [`Geometry::crowding`] up to which the number of cells is increased.
const MAX_CROWDING: f64 = 8.0;
/// Bit of an id: the particle has left the box since its anchor was set.
const OUTSIDE: u32 = 1 << 31;
/// Bit of an id: the other bits are not a particle but the index of a list in `Cells::overflow`, which
/// continues a full cell.
const OVERFLOW: u32 = 1 << 30;
/// No particle.
const EMPTY: u32 = u32::MAX;
/// Number of ids in a cell: 16 bytes, a quarter of a cache line.
const SLOTS: usize = 4;

/**
Cell grid. The cell of a particle changes only by its crossings. It is never recomputed from the position.

Cell coordinates refer to anchor coordinates: along a periodic axis, coordinate c is cell c mod n in image
⌊c/n⌋. Along an open axis the grid is folded onto itself: coordinates that differ by n share a cell, which can
only add candidates, never lose one.
*/
#[derive(Debug, Clone)]
pub struct Cells {
    pub(crate) axes: [Axis; 3],
    /// Cells per axis.
    pub(crate) n: [i32; 3],
    /// Cell width per axis [length].
    pub(crate) width: [f64; 3],
    /// Cell coordinates of each particle.
    pub(crate) coordinate: Vec<[i32; 3]>,
    /// Ids in each cell.
    slots: Vec<[u32; SLOTS]>,
    overflow: Vec<Vec<u32>>,
    /// Indices in `overflow` that no cell uses.
    free_overflow: Vec<u32>,
    walls: WallTable,
    /// Differences of index between a cell that is not at the boundary of the grid and cells around it: for
    /// each code the cells that become neighbors by the crossing, and at [`ALL`] the whole block.
    stencils: [Vec<isize>; 7],
}

/// Index of the whole block in `Cells::stencils`.
const ALL: usize = 6;

/// Cells per axis and their widths for `count` particles.
pub(crate) fn grid(geometry: &Geometry, count: usize) -> ([i32; 3], [f64; 3]) {
    let lengths = geometry.lengths();
    let least = geometry.reach * MARGIN;
    // Target for the number of cells. A clustered system has more empty cells.
    let target = (count as f64 / OCCUPANCY).max(1.0) * geometry.crowding.clamp(1.0, MAX_CROWDING);
    // The width that gives this number of cells. Axes shorter than this width are not divided.
    let mut cut = geometry.axes.map(|axis| axis != Axis::Flat);
    let mut width = least;
    for _ in 0..3 {
        let axes = (0..3).filter(|&axis| cut[axis]).count();
        if axes == 0 {
            break;
        }
        let volume: f64 = (0..3).filter(|&axis| cut[axis]).map(|axis| lengths[axis]).product();
        width = least.max((volume / target).powf(1.0 / axes as f64));
        let narrow: Vec<usize> = (0..3).filter(|&axis| cut[axis] && lengths[axis] < width).collect();
        if narrow.is_empty() {
            break;
        }
        for axis in narrow {
            cut[axis] = false;
        }
    }
    let mut n = [1; 3];
    let mut widths = lengths;
    for axis in 0..3 {
        match geometry.axes[axis] {
            Axis::Flat => {}
            Axis::Open => {
                // At least three: otherwise the neighbors on the two sides would be the same cell.
                n[axis] = (lengths[axis] / width).floor().clamp(3.0, 1e6) as i32;
                widths[axis] = width;
            }
            Axis::Periodic | Axis::Bounded => {
                n[axis] = (lengths[axis] / width).floor().clamp(1.0, 1e9) as i32;
                widths[axis] = lengths[axis] / f64::from(n[axis]);
            }
        }
    }
    (n, widths)
}

impl Cells {
    /// A grid of `n` cells of these widths, with particles at these coordinates.
    pub(crate) fn of(geometry: &Geometry, n: [i32; 3], width: [f64; 3], coordinate: Vec<[i32; 3]>) -> Self {
        let cells = n.iter().map(|&n| n as usize).product();
        let mut grid = Self {
            axes: geometry.axes,
            n,
            width,
            coordinate,
            slots: vec![[EMPTY; SLOTS]; cells],
            overflow: Vec::new(),
            free_overflow: Vec::new(),
            walls: WallTable::new(geometry, n, width, geometry.radius),
            stencils: std::array::from_fn(|_| Vec::new()),
        };
        grid.stencils = std::array::from_fn(|code| grid.stencil(code));
        for i in 0..grid.coordinate.len() as u32 {
            grid.insert(i);
        }
        grid
    }

    /// Folds a cell coordinate along `axis` into the grid: (cell, image).
    #[inline]
    pub(crate) fn fold(&self, axis: usize, c: i32) -> (i32, i32) {
        let n = self.n[axis];
        if (0..n).contains(&c) {
            return (c, 0);
        }
        match self.axes[axis] {
            Axis::Periodic => (c.rem_euclid(n), c.div_euclid(n)),
            Axis::Open => (c.rem_euclid(n), 0),
            Axis::Bounded | Axis::Flat => (c.clamp(0, n - 1), 0),
        }
    }

    #[inline]
    pub(crate) fn index(&self, cell: [i32; 3]) -> usize {
        ((cell[2] as usize * self.n[1] as usize) + cell[1] as usize) * self.n[0] as usize + cell[0] as usize
    }

    /// Index and image of the cell of particle i.
    #[inline]
    fn cell_and_image(&self, i: u32) -> (usize, [i32; 3]) {
        let c = self.coordinate[i as usize];
        let folded = [self.fold(0, c[0]), self.fold(1, c[1]), self.fold(2, c[2])];
        (self.index(folded.map(|f| f.0)), folded.map(|f| f.1))
    }

    pub(crate) fn insert(&mut self, i: u32) {
        let (cell, image) = self.cell_and_image(i);
        let id = if image == [0; 3] { i } else { i | OUTSIDE };
        let slots = &mut self.slots[cell];
        let last = slots[SLOTS - 1];
        if last != EMPTY && last & OVERFLOW != 0 {
            self.overflow[(last & !OVERFLOW) as usize].push(id);
        } else if let Some(free) = slots.iter_mut().find(|slot| **slot == EMPTY) {
            *free = id;
        } else {
            let list = self.free_overflow.pop().unwrap_or_else(|| {
                self.overflow.push(Vec::with_capacity(4));
                self.overflow.len() as u32 - 1
            });
            self.overflow[list as usize].extend([last, id]);
            slots[SLOTS - 1] = list | OVERFLOW;
        }
    }

    pub(crate) fn remove(&mut self, i: u32) {
        let (cell, _) = self.cell_and_image(i);
        let slots = &mut self.slots[cell];
        let last = slots[SLOTS - 1];
        let list = (last != EMPTY && last & OVERFLOW != 0).then_some((last & !OVERFLOW) as usize);
        if let Some(list) = list {
            let overflow = &mut self.overflow[list];
            if let Some(at) = overflow.iter().position(|id| id & !OUTSIDE == i) {
                overflow.swap_remove(at);
            } else if let Some(slot) = slots[..SLOTS - 1].iter_mut().find(|slot| **slot & !OUTSIDE == i) {
                *slot = overflow.pop().unwrap_or(EMPTY);
            }
            if overflow.len() == 1 {
                slots[SLOTS - 1] = overflow[0];
                overflow.clear();
                self.free_overflow.push(list as u32);
            }
        } else if let Some(at) = slots.iter().position(|slot| *slot != EMPTY && *slot & !OUTSIDE == i) {
            // The occupied slots stay in front of the empty ones.
            let end = slots.iter().position(|slot| *slot == EMPTY).unwrap_or(SLOTS);
            slots[at] = slots[end - 1];
            slots[end - 1] = EMPTY;
        }
    }

    /// Visits the particles of one cell. `shift` is the image of the cell relative to i.
    #[inline(always)]
    pub(crate) fn visit_cell<V: FnMut(u32, Shift)>(&self, i: u32, cell: usize, shift: Shift, visit: &mut V) {
        for &id in &self.slots[cell] {
            if id == EMPTY {
                return;
            }
            if id & OVERFLOW != 0 {
                for &id in &self.overflow[(id & !OVERFLOW) as usize] {
                    self.visit_id(i, id, shift, visit);
                }
                return;
            }
            self.visit_id(i, id, shift, visit);
        }
    }

    /// Visits one particle of a cell. If it is outside the box, its own image is subtracted from `shift`.
    #[inline(always)]
    fn visit_id<V: FnMut(u32, Shift)>(&self, i: u32, id: u32, shift: Shift, visit: &mut V) {
        let j = id & !OUTSIDE;
        if j == i {
            return;
        }
        if id & OUTSIDE == 0 {
            visit(j, shift);
        } else {
            let (_, image) = self.cell_and_image(j);
            visit(j, [shift[0] - image[0], shift[1] - image[1], shift[2] - image[2]]);
        }
    }

    /// Range of steps along each axis to the cells around a cell, or only to those that become neighbors by
    /// the crossing `code`.
    fn steps(&self, code: usize) -> [(i32, i32); 3] {
        let mut steps = self.axes.map(|axis| if axis == Axis::Flat { (0, 0) } else { (-1, 1) });
        if code != ALL {
            let step = if code.is_multiple_of(2) { -1 } else { 1 };
            steps[code / 2] = (step, step);
        }
        steps
    }

    /// The same steps as differences of the cell index.
    fn stencil(&self, code: usize) -> Vec<isize> {
        let [x, y, z] = self.steps(code);
        let (nx, ny) = (self.n[0] as isize, self.n[1] as isize);
        let mut offsets = Vec::new();
        for dz in z.0..=z.1 {
            for dy in y.0..=y.1 {
                for dx in x.0..=x.1 {
                    offsets.push((dz as isize * ny + dy as isize) * nx + dx as isize);
                }
            }
        }
        offsets
    }

    /// Visits the cells around i, or only those that have become neighbors by the crossing `code`.
    #[inline]
    fn visit<V: FnMut(u32, Shift)>(&self, i: u32, code: usize, visit: &mut V) {
        let c = self.coordinate[i as usize];
        let inside =
            (0..3).all(|axis| self.axes[axis] == Axis::Flat || (c[axis] > 0 && c[axis] < self.n[axis] - 1));
        if inside {
            let own = self.index(c) as isize;
            for &offset in &self.stencils[code] {
                self.visit_cell(i, (own + offset) as usize, [0; 3], visit);
            }
        } else {
            self.visit_block(i, self.steps(code), visit);
        }
    }

    /// Visits the cells around i at these steps. Some of them can be beyond a face of the box.
    fn visit_block<V: FnMut(u32, Shift)>(&self, i: u32, steps: [(i32, i32); 3], visit: &mut V) {
        let c = self.coordinate[i as usize];
        let own = [self.fold(0, c[0]), self.fold(1, c[1]), self.fold(2, c[2])];
        // The cell at `step` along an axis: (cell, shift), or `None` beyond the end of a bounded axis.
        let neighbor = |axis: usize, step: i32| -> Option<(i32, i32)> {
            let (cell, image) = own[axis];
            let next = cell + step;
            if (0..self.n[axis]).contains(&next) {
                return Some((next, image));
            }
            match self.axes[axis] {
                Axis::Periodic => {
                    let wrap = next.div_euclid(self.n[axis]);
                    Some((next - wrap * self.n[axis], image + wrap))
                }
                Axis::Open => Some((next.rem_euclid(self.n[axis]), 0)),
                Axis::Bounded | Axis::Flat => None,
            }
        };
        for z in steps[2].0..=steps[2].1 {
            let Some((cz, sz)) = neighbor(2, z) else { continue };
            for y in steps[1].0..=steps[1].1 {
                let Some((cy, sy)) = neighbor(1, y) else { continue };
                for x in steps[0].0..=steps[0].1 {
                    let Some((cx, sx)) = neighbor(0, x) else { continue };
                    self.visit_cell(i, self.index([cx, cy, cz]), [sx, sy, sz], visit);
                }
            }
        }
    }
}

impl Search for Cells {
    fn new(geometry: &Geometry, positions: &[DVec3]) -> Self {
        let (n, width) = grid(geometry, positions.len());
        let axes = geometry.axes;
        let coordinate: Vec<[i32; 3]> = positions
            .par_iter()
            .map(|position| {
                let p = position.to_array();
                [0, 1, 2].map(|axis| match axes[axis] {
                    Axis::Flat => 0,
                    Axis::Bounded => ((p[axis] / width[axis]).floor() as i32).clamp(0, n[axis] - 1),
                    Axis::Periodic | Axis::Open => (p[axis] / width[axis]).floor() as i32,
                })
            })
            .collect();
        Self::of(geometry, n, width, coordinate)
    }

    #[inline]
    fn candidates<P: Fn(u32) -> DVec3, V: FnMut(u32, Shift)>(
        &self,
        i: u32,
        _now: i64,
        _position: P,
        mut visit: V,
    ) {
        self.visit(i, ALL, &mut visit);
    }

    #[inline]
    fn new_candidates<P: Fn(u32) -> DVec3, V: FnMut(u32, Shift)>(
        &self,
        i: u32,
        code: u8,
        _now: i64,
        _position: P,
        mut visit: V,
    ) {
        self.visit(i, usize::from(code), &mut visit);
    }

    #[inline]
    fn walls(&self, i: u32) -> &[u16] {
        if self.walls.is_empty() { &[] } else { self.walls.of(self.cell_and_image(i).0) }
    }

    #[inline]
    fn next_crossing(&self, i: u32, flight: &Flight, _within: f64) -> Option<Crossing> {
        let coordinate = self.coordinate[i as usize];
        let (position, velocity, acceleration) =
            (flight.position.to_array(), flight.velocity.to_array(), flight.acceleration.to_array());
        let mut best: Option<Crossing> = None;
        for axis in 0..3 {
            let (c, width) = (coordinate[axis], self.width[axis]);
            for side in 0..2_u8 {
                let outward = if side == 0 { -1.0 } else { 1.0 };
                let bounded = self.axes[axis] == Axis::Bounded;
                if self.axes[axis] == Axis::Flat
                    || (bounded && (c == 0 && side == 0 || c == self.n[axis] - 1 && side == 1))
                {
                    continue;
                }
                let face = f64::from(c + i32::from(side)) * width;
                let gap = (face - position[axis]) * outward;
                let delay = time_to_face(gap, -outward * velocity[axis], -outward * acceleration[axis]);
                if let Some(delay) = delay.filter(|&delay| best.is_none_or(|best| delay < best.delay)) {
                    best = Some(Crossing { delay, code: axis as u8 * 2 + side });
                }
            }
        }
        best
    }

    fn cross(&mut self, i: u32, code: u8, _flight: &Flight) {
        self.remove(i);
        let c = &mut self.coordinate[i as usize][usize::from(code >> 1)];
        *c += if code & 1 == 0 { -1 } else { 1 };
        self.insert(i);
    }

    fn rewrap(&mut self, i: u32, wraps: [i32; 3]) {
        self.remove(i);
        for axis in 0..3 {
            self.coordinate[i as usize][axis] -= wraps[axis] * self.n[axis];
        }
        self.insert(i);
    }
}
