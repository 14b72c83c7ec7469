//! The cells that a path goes through.

use super::super::axes::Axes;

/// The bounding box of a path [cells].
#[derive(Debug, Clone, Copy)]
pub(super) struct PathBox {
    low: [f32; 4],
    high: [f32; 4],
}

impl PathBox {
    /// The bounding box of the path that leads from `x` by the `fraction` of the displacement `v` [length].
    #[inline(always)]
    pub fn new(axes: &Axes, x: [i32; 3], v: [f32; 3], fraction: f32) -> Self {
        let v = [v[0], v[1], v[2], 0.0];
        let start = axes.grid_coordinates(x);
        let (mut low, mut high) = ([0.0; 4], [0.0; 4]);
        for k in 0..4 {
            let displacement = v[k] * fraction * axes.cells[k];
            low[k] = start[k] + if displacement < 0.0 { displacement } else { 0.0 };
            high[k] = start[k] + if displacement > 0.0 { displacement } else { 0.0 };
        }
        Self { low, high }
    }

    /// First and last cell along each axis of this box, extended by `reach` [length] to all sides. Their
    /// numbers continue beyond the edges.
    #[inline(always)]
    pub fn bounds(&self, axes: &Axes, reach: f32) -> ([i32; 4], [i32; 4]) {
        let (mut low, mut high) = ([0.0; 4], [0.0; 4]);
        for k in 0..4 {
            let reach = reach * axes.reach[k] + axes.slack[k];
            low[k] = self.low[k] - reach;
            high[k] = self.high[k] + reach;
        }
        (axes.cells(low), axes.cells(high))
    }

    /// First cell and number of cells per axis of this box, extended by `reach` [length] to all sides.
    #[inline(always)]
    pub fn span(&self, axes: &Axes, reach: f32) -> ([i32; 4], [i32; 3]) {
        let (low, high) = self.bounds(axes, reach);
        (low, [count(axes, low, high, 0), count(axes, low, high, 1), count(axes, low, high, 2)])
    }
}

/// Number of cells from the first to the last one along an axis, each counted once.
#[inline(always)]
pub(super) fn count(axes: &Axes, low: [i32; 4], high: [i32; 4], axis: usize) -> i32 {
    (high[axis] - low[axis] + 1).min(axes.n[axis])
}

/// First cell and number of cells per axis of the bounding box of a path, extended by `reach` [length].
#[inline(always)]
pub(in super::super) fn path_span(
    axes: &Axes,
    x: [i32; 3],
    v: [f32; 3],
    fraction: f32,
    reach: f32,
) -> ([i32; 4], [i32; 3]) {
    PathBox::new(axes, x, v, fraction).span(axes, reach)
}

/// Visits all cells of a box of cells, which can extend beyond the edges of the grid.
#[inline(always)]
pub(super) fn for_each_cell(axes: &Axes, low: [i32; 4], count: [i32; 3], mut visit: impl FnMut(usize)) {
    let n = axes.n;
    let start = axes.fold(low);
    let wrapped = |c: i32, axis: usize| if c >= n[axis] { c - n[axis] } else { c };
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

/// Visits the cells of the path that leads from `x` by the `fraction` of the displacement `v` [length].
///
/// With an `extent` [length] greater than 0, these are all cells within this distance of its bounding box.
/// Otherwise the cell of `x` is visited only with `FIRST`.
#[inline(always)]
pub(super) fn trace<const FIRST: bool>(
    axes: &Axes,
    x: [i32; 3],
    v: [f32; 3],
    fraction: f32,
    extent: f32,
    mut visit: impl FnMut(usize),
) {
    if extent > 0.0 {
        let (low, count) = PathBox::new(axes, x, v, fraction).span(axes, extent);
        return for_each_cell(axes, low, count, visit);
    }
    let v = [v[0], v[1], v[2], 0.0];
    let from = axes.grid_coordinates(x);
    let (mut displacement, mut to) = ([0.0; 4], [0.0; 4]);
    for k in 0..4 {
        displacement[k] = v[k] * fraction * axes.cells[k];
        to[k] = from[k] + displacement[k];
    }
    let (first, last) = (axes.cells(from), axes.cells(to));
    if FIRST {
        visit(axes.index(axes.fold(first)));
    }
    if last != first {
        // In most cases a single face is crossed.
        let faces = |k: usize| last[k].abs_diff(first[k]);
        if faces(0) + faces(1) + faces(2) == 1 {
            visit(axes.index(axes.fold(last)));
        } else {
            trace_rest(axes, from, displacement, first, last, visit);
        }
    }
}

/// Visits the cells of a path after its first cell.
#[inline(never)]
fn trace_rest(
    axes: &Axes,
    from: [f32; 4],
    displacement: [f32; 4],
    first: [i32; 4],
    last: [i32; 4],
    mut visit: impl FnMut(usize),
) {
    // For each axis: the fraction of the path up to the next face, and between two faces.
    let (mut next, mut interval) = ([f32::INFINITY; 3], [0.0; 3]);
    let mut remaining = [0; 3];
    for axis in 0..3 {
        if last[axis] != first[axis] {
            remaining[axis] = last[axis].abs_diff(first[axis]);
            let within = from[axis] - first[axis] as f32;
            let gap = if displacement[axis] > 0.0 { 1.0 - within } else { within };
            interval[axis] = 1.0 / displacement[axis].abs();
            next[axis] = gap * interval[axis];
        }
    }
    let mut cell = first;
    for _ in 0..remaining[0] + remaining[1] + remaining[2] {
        let axis = if next[0] <= next[1] && next[0] <= next[2] {
            0
        } else if next[1] <= next[2] {
            1
        } else {
            2
        };
        cell[axis] += if displacement[axis] > 0.0 { 1 } else { -1 };
        remaining[axis] -= 1;
        next[axis] = if remaining[axis] > 0 { next[axis] + interval[axis] } else { f32::INFINITY };
        visit(axes.index(axes.fold(cell)));
    }
}
