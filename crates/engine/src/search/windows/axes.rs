/*!
Integer coordinates, and the cells that contain them.

A periodic edge has 2^32 coordinates. The difference of two coordinates modulo 2^32 is therefore the
difference to the nearest image, without further operations. A bounded edge has 2^30 coordinates, so that
positions that rounding puts outside the box can be represented, too.

A *grid coordinate* is a position in units of the width of a cell, in single precision.
*/

use haff_neighbors::{Axis, Geometry};

use crate::search::{
    blocks::Grid,
    compact::{PERIOD, coordinate},
    moving::stretch_of_shear,
};

/// Largest number of windows after which the slots are filled from the anchors again.
pub(super) const MAX_WINDOWS: u64 = 16;
/// log₂ of the number of coordinates to a bounded edge.
const BOUNDED_BITS: u32 = 30;
/// Largest number of cells along an axis, because grid coordinates are in single precision.
const MAX_CELLS_PER_AXIS: f64 = 2048.0;
/// The grid is folded if it has more than this many cells per particle, plus [`FEW_CELLS`].
const MAX_PER_PARTICLE: usize = 8;
/// Largest number of cells per particle in a folded grid, plus [`FEW_CELLS`].
const FOLDED_PER_PARTICLE: usize = 2;
/// Number of cells that are allowed for any number of particles.
const FEW_CELLS: usize = 1 << 15;
/// Largest number of halvings of an axis.
const MAX_FOLDS: u32 = 20;
/// Largest number of cells: the index of a block has 29 bits, and full cells have more than one block.
const MAX_CELLS: i64 = 1 << 27;

/// Distance by which the range of searches is extended [cells]: ten times the rounding error of a grid
/// coordinate for the largest number of cells, see [`super::axes`].
pub(super) const SLACK: f32 = 2e-3;

/// How the coordinates of a window deform, as filters and cells read it.
#[derive(Debug, Clone, Copy)]
pub(super) struct Tilt {
    /// k, at the start of the window.
    pub start: f32,
    /// g.
    pub change: f32,
    /// g along each axis under compression, and 1/(1 + g).
    pub stretch: [f32; 3],
    pub end: [f32; 3],
}

impl Default for Tilt {
    fn default() -> Self {
        Self { start: 0.0, change: 0.0, stretch: [0.0; 3], end: [1.0; 3] }
    }
}

// With two more fields `Axes` would be copied by a call, for 1 % of the instructions.
impl Tilt {
    /// By how much lengths in space are longer in the coordinates of the grid, at most in the window.
    #[inline(always)]
    pub fn strain(self) -> f32 {
        let tilt = self.start.abs().max((self.start + self.change).abs());
        stretch_of_shear(tilt) * self.most()
    }

    /// By how much speeds are larger than displacements in the window, at most.
    #[inline(always)]
    pub fn speed(self) -> f32 {
        let most = self.most();
        stretch_of_shear(2.0 * self.change) * (most * most)
    }

    /// The largest 1/(1 + g θ).
    #[inline(always)]
    fn most(self) -> f32 {
        self.end.iter().fold(1.0, |most: f32, &end| most.max(end))
    }

    /// The displacement in the grid after a `fraction` of the window of the path with the displacement `v`.
    #[inline(always)]
    pub fn path(self, v: [f32; 3], fraction: f32) -> [f32; 3] {
        let mut path = [0.0; 3];
        for axis in 0..3 {
            path[axis] = v[axis] * (fraction / (1.0 + self.stretch[axis] * fraction));
        }
        path[0] -= self.change * v[1] * (fraction * fraction);
        path
    }

    /// The displacement `v` of a path from `from` to the end of the window as that of its chord in the grid
    /// for the whole window.
    #[inline(always)]
    pub fn chord(self, mut v: [f32; 3], from: f32) -> [f32; 3] {
        let across = v[1];
        for axis in 0..3 {
            v[axis] *= self.end[axis] / (1.0 + self.stretch[axis] * from);
        }
        v[0] -= self.change * across * (1.0 + from);
        v
    }
}

/// The axes of the grid, one lane each; the fourth lane is unused.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Axes {
    /// Number of cells.
    pub n: [i32; 4],
    /// Number of coordinates per length [1/length].
    pub per_length: [f64; 3],
    /// Distance between two coordinates [length].
    pub unit: [f32; 3],
    /// Number of halvings that fold the range of coordinates onto the grid.
    fold: [u32; 4],
    /// Edges of the grid [length].
    pub period: [f64; 3],
    /// The grid coordinate of coordinate x is ((x << fold) ^ flip) · per_coordinate + bias [cells].
    flip: [i32; 4],
    per_coordinate: [f32; 4],
    bias: [f32; 4],
    /// Number of cells per length [1/length].
    pub cells: [f32; 4],
    /// Cells by which searches extend to each side, per length of their reach [1/length], and besides
    /// [cells].
    pub reach: [f32; 4],
    pub slack: [f32; 4],
    /// The tilt of the window in a box that deforms.
    pub tilt: Tilt,
    /// Limits of grid coordinates [cells]: the edges along a bounded axis, and one period beyond the edges
    /// along a periodic or folded one, so that the conversion to integers is defined and one addition folds a
    /// cell into the grid.
    low: [f32; 4],
    high: [f32; 4],
}

/// Number of coordinates to an edge.
fn range(periodic: bool) -> f64 {
    if periodic { PERIOD } else { 2.0_f64.powi(BOUNDED_BITS as i32) }
}

/// Rounding error of a difference of two coordinates along an edge [smallest contact distances]: both
/// positions are rounded, and their displacements in each window until the slots are filled again.
pub(super) fn rounding(edge: f64, periodic: bool, smallest_radius: f64) -> f64 {
    let roundings = 2 * (MAX_WINDOWS + 2);
    roundings as f64 * edge / range(periodic) / (2.0 * smallest_radius)
}

impl Axes {
    /// Axes divided into cells of about this width [length], for this number of particles.
    ///
    /// The number of cells is limited in proportion to that of particles. Where it would be larger, in a box
    /// that is mostly empty, the grid is folded onto itself: distant positions then share a cell.
    pub fn new(geometry: &Geometry, width: f64, particles: usize) -> Self {
        let size = geometry.size.to_array();
        let mut n = [1.0; 3];
        for axis in 0..3 {
            if geometry.axes[axis] != Axis::Flat {
                n[axis] = (size[axis] / width).floor().max(1.0);
            }
        }
        let mut folds = [0_u32; 3];
        let cells = |n: &[f64; 3], folds: &[u32; 3]| {
            [0, 1, 2].map(|k| (n[k] * 0.5_f64.powi(folds[k] as i32)).floor())
        };
        let max = (MAX_PER_PARTICLE * particles + FEW_CELLS) as f64;
        let is_folded = cells(&n, &folds).iter().product::<f64>() > max;
        let bound = if is_folded { (FOLDED_PER_PARTICLE * particles + FEW_CELLS) as f64 } else { max };
        let bound = bound.min(MAX_CELLS as f64);
        loop {
            let stored = cells(&n, &folds);
            let longest = (0..3).max_by(|&a, &b| stored[a].total_cmp(&stored[b])).unwrap_or(0);
            if stored[longest] <= MAX_CELLS_PER_AXIS && stored.iter().product::<f64>() <= bound {
                break;
            }
            if folds[longest] < MAX_FOLDS {
                // A bounded edge is a quarter of the range of coordinates: its folding also shifts out the
                // two upper bits, see `divide`.
                folds[longest] += 1;
            } else {
                n[longest] *= 0.5;
            }
        }
        Self::divide(geometry, cells(&n, &folds), folds)
    }

    /// Axes with these numbers of `stored` cells, onto which `folds` halvings fold the box.
    fn divide(geometry: &Geometry, stored: [f64; 3], folds: [u32; 3]) -> Self {
        let mut axes = Self { n: [1; 4], high: [0.5; 4], ..Self::default() };
        let size = geometry.size.to_array();
        for axis in 0..3 {
            let (length, n, fold) = (size[axis], stored[axis], folds[axis]);
            let kind = geometry.axes[axis];
            if kind == Axis::Flat {
                (axes.per_length[axis], axes.unit[axis]) = (1.0, 1.0);
                continue;
            }
            let periodic = kind == Axis::Periodic;
            let coordinates = range(periodic);
            axes.n[axis] = n as i32;
            axes.per_length[axis] = coordinates / length;
            axes.unit[axis] = (length / coordinates) as f32;
            axes.cells[axis] = (n * 2.0_f64.powi(fold as i32) / length) as f32;
            if periodic || fold > 0 {
                // A folded grid is periodic also along bounded axes: the shift of coordinates drops their
                // upper bits.
                axes.fold[axis] = if periodic { fold } else { fold + 32 - BOUNDED_BITS };
                axes.per_coordinate[axis] = (n / range(true)) as f32;
                axes.period[axis] = length * 0.5_f64.powi(fold as i32);
                // Coordinates are unsigned here; the flip of the sign bit maps them to the range of `i32`.
                (axes.flip[axis], axes.bias[axis]) = (i32::MIN, (0.5 * n) as f32);
                (axes.low[axis], axes.high[axis]) = (-n as f32, (2.0 * n - 0.5) as f32);
            } else {
                axes.per_coordinate[axis] = (n / coordinates) as f32;
                axes.period[axis] = length;
                axes.high[axis] = (n - 0.5) as f32;
            }
        }
        (axes.reach, axes.slack) = (axes.cells, [SLACK; 4]);
        axes
    }

    /// Sets the edge of a periodic axis \[length\]: coordinates are parts of it.
    pub fn set_edge(&mut self, axis: usize, edge: f64) {
        let folds = f64::from(1_u32 << self.fold[axis]);
        self.per_length[axis] = range(true) / edge;
        self.unit[axis] = (edge / range(true)) as f32;
        self.period[axis] = edge / folds;
        self.cells[axis] = (f64::from(self.n[axis]) * folds / edge) as f32;
        self.reach[axis] = self.cells[axis];
    }

    /// Extends searches along an axis by the factor `stretch` and by `distance` [length].
    pub fn widen(&mut self, axis: usize, stretch: f32, distance: f32) {
        self.reach[axis] = self.cells[axis] * stretch;
        self.slack[axis] = SLACK + self.cells[axis] * distance;
    }

    /// How far searches and registrations extend around a path, for this reach in space \[length\].
    #[inline(always)]
    pub fn widened(&self, reach: f32) -> f32 {
        let mut widest = reach;
        for axis in 0..3 {
            if self.cells[axis] > 0.0 {
                let cells = reach * self.reach[axis] + (self.slack[axis] - SLACK);
                widest = widest.max(cells / self.cells[axis]);
            }
        }
        widest
    }

    /// Whether cells beyond an edge of an axis are those at the other edge.
    #[inline(always)]
    pub fn wraps(&self, axis: usize) -> bool {
        self.low[axis] < 0.0
    }

    /// The grid of blocks.
    #[inline(always)]
    pub fn grid(&self) -> Grid {
        Grid {
            n: [self.n[0], self.n[1], self.n[2]],
            cells: [self.cells[0], self.cells[1], self.cells[2]],
            wraps: [self.wraps(0), self.wraps(1), self.wraps(2)],
        }
    }

    /// The coordinate of a position along an axis [length].
    #[inline(always)]
    pub fn coordinate(&self, axis: usize, position: f64) -> i32 {
        coordinate(position * self.per_length[axis])
    }

    // Loops instead of `array::map`, which can remain a call compiled for the baseline instruction set.

    /// This `fraction` of the displacement `v` [length], in coordinates.
    #[inline(always)]
    pub fn displacement(&self, v: [f32; 3], fraction: f32) -> [i32; 3] {
        let mut displacement = [0; 3];
        for axis in 0..3 {
            displacement[axis] = coordinate(f64::from(v[axis] * fraction) * self.per_length[axis]);
        }
        displacement
    }

    /// The grid coordinates of these coordinates [cells].
    #[inline(always)]
    pub fn grid_coordinates(&self, x: [i32; 3]) -> [f32; 4] {
        let x = [x[0], x[1], x[2], 0];
        let mut grid = [0.0; 4];
        for k in 0..4 {
            let x = x[k] << self.fold[k];
            grid[k] = (x ^ self.flip[k]) as f32 * self.per_coordinate[k] + self.bias[k];
        }
        grid
    }

    /// The cells of these grid coordinates; their numbers continue beyond periodic edges.
    #[inline(always)]
    pub fn cells(&self, grid: [f32; 4]) -> [i32; 4] {
        let mut cells = [0; 4];
        for k in 0..4 {
            // Each comparison is one instruction, whereas `max` and `min` need more to handle NaN. Here NaN
            // is replaced by the lower bound.
            let x = if grid[k] > self.low[k] { grid[k] } else { self.low[k] };
            let x = if x < self.high[k] { x } else { self.high[k] };
            // SAFETY: `x` is between the bounds, which are finite and within the range of `i32`, and it is
            // not NaN.
            cells[k] = unsafe { x.floor().to_int_unchecked::<i32>() };
        }
        cells
    }

    /// Folds cells beyond the edges into the grid.
    #[inline(always)]
    pub fn fold(&self, cells: [i32; 4]) -> [i32; 4] {
        let mut folded = [0; 4];
        for k in 0..4 {
            // By sign masks instead of branches, so that all axes are computed in one vector.
            let (c, n) = (cells[k], self.n[k]);
            let c = c + (n & (c >> 31));
            folded[k] = c - (n & ((n - 1 - c) >> 31));
        }
        folded
    }

    /// The index of a cell of the grid.
    #[inline(always)]
    pub fn index(&self, cells: [i32; 4]) -> usize {
        ((cells[2] * self.n[1] + cells[1]) * self.n[0] + cells[0]) as usize
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;

    fn geometry(size: DVec3, axes: [Axis; 3]) -> Geometry {
        Geometry {
            size,
            axes,
            reach: 1.0,
            crowding: 1.0,
            radius: 0.5,
            radii: Vec::new(),
            planes: Vec::new(),
            deforming: None,
        }
    }

    #[test]
    fn the_number_of_cells_is_limited_by_that_of_particles() {
        let particles = 10_000;
        let long = DVec3::new(5.0, 7.0, 1e6);
        for size in [DVec3::splat(1e4), DVec3::splat(1e7), long] {
            for kind in [Axis::Periodic, Axis::Bounded] {
                for width in [1e-3, 1.0, 5.0, 19.0] {
                    let axes = Axes::new(&geometry(size, [kind; 3]), width, particles);
                    let cells: i32 = axes.n.iter().product();
                    assert!(
                        (1000..=8 * 10_000 + FEW_CELLS as i32).contains(&cells),
                        "{size} {width}: {axes:?}"
                    );
                    assert!(axes.fold != [0; 4]);
                }
            }
        }
        // A grid of few cells is not folded, and its cells have the requested width.
        let axes = Axes::new(&geometry(DVec3::splat(1e4), [Axis::Periodic; 3]), 300.0, particles);
        assert_eq!((axes.n, axes.fold), ([33, 33, 33, 1], [0; 4]));
    }

    #[test]
    fn a_folded_grid_is_periodic() {
        for kind in [Axis::Periodic, Axis::Bounded] {
            let size = DVec3::splat(3e5);
            let axes = Axes::new(&geometry(size, [kind; 3]), 2.0, 1000);
            let cell =
                |x: f64| axes.fold(axes.cells(axes.grid_coordinates([axes.coordinate(0, x), 0, 0])))[0];
            for x in [0.1, 1.0, 777.7, 123_456.7] {
                // A position at a quarter of a cell, away from faces.
                let x = (x * f64::from(axes.cells[0])).floor() / f64::from(axes.cells[0]) + 0.25 * 2.0;
                let next = (cell(x) + 1) % axes.n[0];
                assert_eq!(cell(x + 1.0 / f64::from(axes.cells[0])), next, "{kind:?} {x}");
                assert_eq!(cell(x + axes.period[0]), cell(x), "{kind:?} {x}");
            }
        }
    }
}
