/*!
Coordinates, and the cells that they fall into.

Coordinates are integers: 2^32 of them to a periodic edge, so that the difference of two, taken modulo 2^32,
is the nearest image at no cost, whatever the box; and 2^30 to a bounded edge, which leaves room for what
rounding puts outside.
*/

use haff_neighbors::{Axis, Geometry};

use crate::compact::{PERIOD, coordinate};

/// Windows after which the streamed copies are made from the anchors again, at most and at least.
pub(super) const MOST_WINDOWS: u64 = 16;
/// Coordinates per bounded edge, log₂.
const BOUNDED_BITS: u32 = 30;
/// Largest number of cells along an axis: places are found in single precision.
const MOST_CELLS: f64 = 2048.0;
/// Cells per particle from which on the grid is folded, and how many there are then at most; besides a few in
/// all.
const MOST_PER_PARTICLE: usize = 8;
const FOLDED_PER_PARTICLE: usize = 2;
const FEW: usize = 1 << 15;
/// Most halvings of an axis.
const MOST_FOLDS: u32 = 20;
/// Largest number of cells: blocks are counted in 29 bits, and full cells need more than one.
const MOST_CELLS_IN_ALL: i64 = 1 << 27;

/// The axes of the grid, one lane each; the fourth is idle.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Axes {
    /// Number of cells.
    pub n: [i32; 4],
    /// Coordinates per length, and back.
    pub per_length: [f64; 3],
    pub unit: [f32; 3],
    /// Halvings that fold the range of coordinates onto the grid, and the length that the grid spans
    /// [length].
    fold: [u32; 4],
    pub period: [f64; 3],
    /// The place of coordinate x is (((x << fold) ^ flip) · per_coordinate + bias) [cells].
    flip: [i32; 4],
    per_coordinate: [f32; 4],
    bias: [f32; 4],
    /// Cells per length.
    pub cells: [f32; 4],
    /// Where spans end: at bounded edges, and, for arithmetic's sake, a box beyond periodic ones [cells].
    low: [f32; 4],
    high: [f32; 4],
}

/// Coordinates to an edge.
fn range(periodic: bool) -> f64 {
    if periodic { PERIOD } else { 2.0_f64.powi(BOUNDED_BITS as i32) }
}

/// Part of the least contact distance that the rounding of coordinates comes to along an edge: of two places,
/// and of their ways through as many windows as there are before copies are made again.
pub(super) fn rounding(edge: f64, periodic: bool, least_radius: f64) -> f64 {
    let roundings = 2 * (MOST_WINDOWS + 2);
    roundings as f64 * edge / range(periodic) / (2.0 * least_radius)
}

impl Axes {
    /// Axes cut into cells about `width` wide [length], for `particles`.
    ///
    /// There are never many more cells than particles: where there would be, in a box that is mostly empty,
    /// the grid is folded onto itself, so that places far from each other share a cell.
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
        let most = (MOST_PER_PARTICLE * particles + FEW) as f64;
        let much = cells(&n, &folds).iter().product::<f64>() > most;
        let bound = if much { (FOLDED_PER_PARTICLE * particles + FEW) as f64 } else { most };
        let bound = bound.min(MOST_CELLS_IN_ALL as f64);
        loop {
            let stored = cells(&n, &folds);
            let longest = (0..3).max_by(|&a, &b| stored[a].total_cmp(&stored[b])).unwrap_or(0);
            if stored[longest] <= MOST_CELLS && stored.iter().product::<f64>() <= bound {
                break;
            }
            if folds[longest] < MOST_FOLDS {
                // Along a bounded edge a fold begins with the range of coordinates, which is four times as
                // long.
                folds[longest] += 1;
            } else {
                n[longest] *= 0.5;
            }
        }
        Self::cut(geometry, cells(&n, &folds), folds)
    }

    /// Axes of `stored` cells, onto which so many halvings fold the box.
    fn cut(geometry: &Geometry, stored: [f64; 3], folds: [u32; 3]) -> Self {
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
                // A folded grid goes round, whatever the box does: it ends with the range of coordinates,
                // multiplied.
                axes.fold[axis] = if periodic { fold } else { fold + 32 - BOUNDED_BITS };
                axes.per_coordinate[axis] = (n / range(true)) as f32;
                axes.period[axis] = length * 0.5_f64.powi(fold as i32);
                // Unsigned coordinates, brought into the range of signed ones.
                (axes.flip[axis], axes.bias[axis]) = (i32::MIN, (0.5 * n) as f32);
                (axes.low[axis], axes.high[axis]) = (-n as f32, (2.0 * n - 0.5) as f32);
            } else {
                axes.per_coordinate[axis] = (n / coordinates) as f32;
                axes.period[axis] = length;
                axes.high[axis] = (n - 0.5) as f32;
            }
        }
        axes
    }

    /// The coordinate of a position along an axis [length].
    #[inline(always)]
    pub fn coordinate(&self, axis: usize, position: f64) -> i32 {
        coordinate(position * self.per_length[axis])
    }

    // Loops, not `map`: an array's `map` may stay a call, compiled for the baseline.

    /// The coordinates of a way [length].
    #[inline(always)]
    pub fn displacement(&self, v: [f32; 3], part: f32) -> [i32; 3] {
        let mut way = [0; 3];
        for axis in 0..3 {
            way[axis] = coordinate(f64::from(v[axis] * part) * self.per_length[axis]);
        }
        way
    }

    /// The place of a coordinate [cells].
    #[inline(always)]
    pub fn grid_coordinates(&self, x: [i32; 3]) -> [f32; 4] {
        let x = [x[0], x[1], x[2], 0];
        let mut places = [0.0; 4];
        for k in 0..4 {
            let x = x[k] << self.fold[k];
            places[k] = (x ^ self.flip[k]) as f32 * self.per_coordinate[k] + self.bias[k];
        }
        places
    }

    /// The cells, counted on beyond periodic edges, of places.
    #[inline(always)]
    pub fn cells(&self, places: [f32; 4]) -> [i32; 4] {
        let mut cells = [0; 4];
        for k in 0..4 {
            // One instruction each, as `max` and `min` are not: those care for NaN, of which here comparisons
            // make the lower bound.
            let place = if places[k] > self.low[k] { places[k] } else { self.low[k] };
            let place = if place < self.high[k] { place } else { self.high[k] };
            // SAFETY: the bounds are small numbers, and no NaN is left.
            cells[k] = unsafe { place.floor().to_int_unchecked::<i32>() };
        }
        cells
    }

    /// Brings cells counted on beyond the edges into the grid.
    #[inline(always)]
    pub fn fold(&self, cells: [i32; 4]) -> [i32; 4] {
        let mut folded = [0; 4];
        for k in 0..4 {
            // By their signs, so that it is done for all axes at once.
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
        Geometry { size, axes, reach: 1.0, crowding: 1.0, radius: 0.5, radii: Vec::new(), planes: Vec::new() }
    }

    #[test]
    fn there_are_never_many_more_cells_than_particles() {
        let particles = 10_000;
        let long = DVec3::new(5.0, 7.0, 1e6);
        for size in [DVec3::splat(1e4), DVec3::splat(1e7), long] {
            for kind in [Axis::Periodic, Axis::Bounded] {
                for width in [1e-3, 1.0, 5.0, 19.0] {
                    let axes = Axes::new(&geometry(size, [kind; 3]), width, particles);
                    let cells: i32 = axes.n.iter().product();
                    assert!((1000..=8 * 10_000 + FEW as i32).contains(&cells), "{size} {width}: {axes:?}");
                    assert!(axes.fold != [0; 4]);
                }
            }
        }
        // Where there are few enough, they are as wide as asked.
        let axes = Axes::new(&geometry(DVec3::splat(1e4), [Axis::Periodic; 3]), 300.0, particles);
        assert_eq!((axes.n, axes.fold), ([33, 33, 33, 1], [0; 4]));
    }

    #[test]
    fn a_folded_grid_goes_round() {
        for kind in [Axis::Periodic, Axis::Bounded] {
            let size = DVec3::splat(3e5);
            let axes = Axes::new(&geometry(size, [kind; 3]), 2.0, 1000);
            let cell =
                |x: f64| axes.fold(axes.cells(axes.grid_coordinates([axes.coordinate(0, x), 0, 0])))[0];
            for x in [0.1, 1.0, 777.7, 123_456.7] {
                // A quarter of a cell, away from faces; unfolded cells are of one width.
                let x = (x * f64::from(axes.cells[0])).floor() / f64::from(axes.cells[0]) + 0.25 * 2.0;
                let next = (cell(x) + 1) % axes.n[0];
                assert_eq!(cell(x + 1.0 / f64::from(axes.cells[0])), next, "{kind:?} {x}");
                assert_eq!(cell(x + axes.period[0]), cell(x), "{kind:?} {x}");
            }
        }
    }
}
