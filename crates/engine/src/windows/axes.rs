/*!
Coordinates, and the cells that they fall into.

Coordinates are integers: 2^32 of them to a periodic edge, so that the difference of two, taken modulo 2^32, is the
nearest image at no cost, whatever the box; and 2^30 to a bounded edge, which leaves room for what rounding puts outside.
*/

use haff_neighbors::{Axis, Geometry};

/// Coordinates per bounded edge, log₂.
const BOUNDED_BITS: u32 = 30;
/// Largest number of cells along an axis.
const MOST_CELLS: f64 = 2048.0;
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
    /// The place of coordinate x is ((x ^ flip) · per_coordinate + bias) [cells].
    flip: [i32; 4],
    per_coordinate: [f32; 4],
    bias: [f32; 4],
    /// Cells per length.
    pub cells: [f32; 4],
    /// Where spans end: at bounded edges, and, for arithmetic's sake, a box beyond periodic ones [cells].
    low: [f32; 4],
    high: [f32; 4],
}

impl Axes {
    /// Axes cut into cells about `width` wide [length], wider where that would make too many.
    pub fn new(geometry: &Geometry, width: f64) -> Self {
        let axes = Self::cut(geometry, width);
        let cells: i64 = axes.n.iter().map(|&n| i64::from(n)).product();
        if cells > MOST_CELLS_IN_ALL { Self::new(geometry, 1.25 * width) } else { axes }
    }

    fn cut(geometry: &Geometry, width: f64) -> Self {
        let mut axes = Self { n: [1; 4], high: [0.5; 4], ..Self::default() };
        let size = geometry.size.to_array();
        for axis in 0..3 {
            let length = size[axis];
            let kind = geometry.axes[axis];
            if kind == Axis::Flat {
                (axes.per_length[axis], axes.unit[axis]) = (1.0, 1.0);
                continue;
            }
            let n = (length / width).floor().clamp(1.0, MOST_CELLS);
            let periodic = kind == Axis::Periodic;
            let coordinates = if periodic { 2.0_f64.powi(32) } else { f64::from(1 << BOUNDED_BITS) };
            axes.n[axis] = n as i32;
            axes.per_length[axis] = coordinates / length;
            axes.unit[axis] = (length / coordinates) as f32;
            axes.per_coordinate[axis] = (n / coordinates) as f32;
            axes.cells[axis] = (n / length) as f32;
            if periodic {
                // Unsigned coordinates, brought into the range of signed ones.
                (axes.flip[axis], axes.bias[axis]) = (i32::MIN, (0.5 * n) as f32);
                (axes.low[axis], axes.high[axis]) = (-n as f32, (2.0 * n - 0.5) as f32);
            } else {
                axes.high[axis] = (n - 0.5) as f32;
            }
        }
        axes
    }

    /// Whether an axis is periodic.
    pub fn is_periodic(&self, axis: usize) -> bool {
        self.flip[axis] != 0
    }

    /// The coordinate of a position along an axis [length].
    #[inline(always)]
    pub fn coordinate(&self, axis: usize, position: f64) -> i32 {
        round(position * self.per_length[axis])
    }

    // Loops, not `map`: an array's `map` may stay a call, compiled for the baseline.

    /// The coordinates of a way [length].
    #[inline(always)]
    pub fn way(&self, v: [f32; 3], part: f32) -> [i32; 3] {
        let mut way = [0; 3];
        for axis in 0..3 {
            way[axis] = round(f64::from(v[axis] * part) * self.per_length[axis]);
        }
        way
    }

    /// The place of a coordinate [cells].
    #[inline(always)]
    pub fn places(&self, x: [i32; 3]) -> [f32; 4] {
        let x = [x[0], x[1], x[2], 0];
        let mut places = [0.0; 4];
        for k in 0..4 {
            places[k] = (x[k] ^ self.flip[k]) as f32 * self.per_coordinate[k] + self.bias[k];
        }
        places
    }

    /// The cells, counted on beyond periodic edges, of places.
    #[inline(always)]
    pub fn cells(&self, places: [f32; 4]) -> [i32; 4] {
        let mut cells = [0; 4];
        for k in 0..4 {
            let place = places[k].max(self.low[k]).min(self.high[k]).floor();
            // SAFETY: the bounds are small numbers, and `max` and `min` leave no NaN.
            cells[k] = unsafe { place.to_int_unchecked::<i32>() };
        }
        cells
    }

    /// Brings cells counted on beyond the edges into the grid.
    #[inline(always)]
    pub fn fold(&self, cells: [i32; 4]) -> [i32; 4] {
        let mut folded = [0; 4];
        for k in 0..4 {
            let (c, n) = (cells[k], self.n[k]);
            let c = if c < 0 { c + n } else { c };
            folded[k] = if c >= n { c - n } else { c };
        }
        folded
    }

    /// The index of a cell of the grid.
    #[inline(always)]
    pub fn index(&self, cells: [i32; 4]) -> usize {
        ((cells[2] * self.n[1] + cells[1]) * self.n[0] + cells[0]) as usize
    }
}

/// Nearest integer modulo 2^32, by the rounding of an addition; |x| < 2^51.
#[inline(always)]
fn round(x: f64) -> i32 {
    (x + 6_755_399_441_055_744.0).to_bits() as i32 // 1.5 · 2^52
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;

    #[test]
    fn there_are_never_more_cells_than_can_be_counted() {
        let (size, axes) = (DVec3::splat(1e4), [Axis::Periodic; 3]);
        let geometry =
            Geometry { size, axes, reach: 1.0, radius: 0.5, radii: Vec::new(), planes: Vec::new() };
        for width in [1e-3, 1.0, 5.0, 19.0] {
            let n = Axes::new(&geometry, width).n.map(i64::from);
            let cells: i64 = n.iter().product();
            assert!((MOST_CELLS_IN_ALL / 4..=MOST_CELLS_IN_ALL).contains(&cells), "{width}: {n:?}");
        }
        // Where there are few enough, they are as wide as asked.
        assert_eq!(Axes::new(&geometry, 30.0).n, [333, 333, 333, 1]);
    }
}
