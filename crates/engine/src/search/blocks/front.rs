//! The front of a block: from when on a place can be reached by an event that is not known yet.
//!
//! Outside of a block, and after an event that the block has left to a later round, nothing is known. What
//! happens there spreads at most with the largest speed c, and in an impact by a contact distance σ. A
//! *front* is the field T(x) of the earliest times at which it can have arrived, in a step that begins at
//! t₀: the least of
//!
//! * t₀ + max(0, g − d_f)/c, where g is the distance from the nearest face with another block beyond it,
//! * t_s + max(0, |x − x_s| − d_s)/c for each source s, an event at t_s that has been left over.
//!
//! An event is taken if its time is before T. All events of later rounds are tested to be in the same field
//! with both distances less by d_i ≥ σ. Such an event changes particles there. Until their next event they
//! move at most with c, and T changes by at most |Δx|/c over Δx, so that they stay in the field with
//! distances less by d_i. What they then touch is at most σ away, and so in the field itself, and it stays
//! there until its own next event. An event that has been taken is outside of the field. So no event of a
//! later round can reach a particle before an event of it that has been taken.
//!
//! In a box that deforms places are in coordinates that deform with it: c is the largest speed there, so
//! relative to the flow, and σ the largest distance there of two particles that touch.

use super::Grid;

/// Distances from faces and from sources, and what tests of later rounds subtract from them [largest contact
/// distances].
#[derive(Debug, Clone, Copy)]
pub(crate) struct Dilations {
    pub face: f32,
    pub source: f32,
    pub inner: f32,
}

/// A grid coordinate beyond all grids.
const FAR: f32 = 1e30;

/// A cuboid of cells: along each axis the cells `first` ≤ c < `end`. On a periodic axis `end` can be larger
/// than the number of cells.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Bounds {
    pub first: [i32; 3],
    pub end: [i32; 3],
    /// The faces with another block beyond them [cells]; far away where there is none.
    low: [f32; 3],
    high: [f32; 3],
    /// Number of cells after which an axis repeats; 0 if it does not.
    period: [i32; 3],
    /// Whether no other block is beyond any face.
    pub is_whole: bool,
}

impl Bounds {
    /// Bounds of these cells of a grid. `shared`: whether another block is beyond the lower and the upper
    /// face of each axis.
    pub fn new(grid: &Grid, first: [i32; 3], end: [i32; 3], shared: [[bool; 2]; 3]) -> Self {
        let face = |k: usize, side: usize, c: i32, far: f32| if shared[k][side] { c as f32 } else { far };
        Self {
            first,
            end,
            low: [0, 1, 2].map(|k| face(k, 0, first[k], -FAR)),
            high: [0, 1, 2].map(|k| face(k, 1, end[k], FAR)),
            period: [0, 1, 2].map(|k| if grid.wraps[k] { grid.n[k] } else { 0 }),
            is_whole: shared == [[false; 2]; 3],
        }
    }

    /// Number of cells along each axis.
    fn counts(&self) -> [i32; 3] {
        [0, 1, 2].map(|k| self.end[k] - self.first[k])
    }

    /// Whether cells `low` to `low` + `count` − 1 of an axis are within these bounds.
    #[inline(always)]
    pub fn contains_cells(&self, axis: usize, low: i32, count: i32) -> bool {
        let (first, end, period) = (self.first[axis], self.end[axis], self.period[axis]);
        let low = if low < first { low + period } else { low };
        let low = if period > 0 && low >= first + period { low - period } else { low };
        // Without images, the cells at an edge also hold what is beyond it.
        (low >= first || self.low[axis] == -FAR) && (low + count <= end || self.high[axis] == FAR)
    }
}

/// Distances, in lengths and in cells.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Metric {
    /// Number of cells along each axis, and the same as a length of repetition, 0 if there is none [cells].
    pub n: [i32; 3],
    period: [f32; 3],
    /// Edges of a cell [length]; 1 along an axis without extension.
    width: [f32; 3],
    /// Largest speed [length per window].
    pub speed: f32,
    /// The largest contact distance [length].
    sigma: f32,
    /// Distances [length].
    face: f32,
    pub source: f32,
    inner: f32,
}

/// The distances of a place from the nearest face with another block beyond it [length]; negative outside of
/// the block.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Depth {
    pub distance: f32,
    /// From the nearest cell that is certain to be in the block, with the rounding of coordinates.
    pub of_cells: f32,
}

impl Metric {
    pub fn new(grid: &Grid, speed: f32, sigma: f32, dilations: Dilations) -> Self {
        let width = |k: usize| if grid.cells[k] > 0.0 { 1.0 / grid.cells[k] } else { 1.0 };
        Self {
            n: grid.n,
            period: [0, 1, 2].map(|k| if grid.wraps[k] { grid.n[k] as f32 } else { 0.0 }),
            width: [0, 1, 2].map(width),
            speed,
            sigma,
            face: dilations.face * sigma,
            source: dilations.source * sigma,
            inner: dilations.inner * sigma,
        }
    }

    /// The same with distances of fronts larger by a factor.
    pub fn widened(self, factor: f32) -> Self {
        Self { face: factor * self.face, source: factor * self.source, ..self }
    }

    /// The distances of a place from the faces of a block.
    #[inline(always)]
    pub fn depth(&self, bounds: &Bounds, x: [f32; 3]) -> Depth {
        let mut depth = Depth { distance: FAR, of_cells: FAR };
        for k in 0..3 {
            let z = if x[k] < bounds.low[k] { x[k] + self.period[k] } else { x[k] };
            let gap = (z - bounds.low[k]).min(bounds.high[k] - z);
            depth.distance = depth.distance.min(gap * self.width[k]);
            // One cell for the cell of the place, and one for the rounding of coordinates.
            depth.of_cells = depth.of_cells.min((gap - 2.0) * self.width[k]);
        }
        depth
    }

    /// Whether what is beyond the faces cannot have an effect at this depth in a time since the start of the
    /// step [windows]; with distances less by `less` [length].
    #[inline(always)]
    pub fn is_clear(&self, depth: Depth, elapsed: f32, less: f32) -> bool {
        depth.distance > self.face - less + self.speed * elapsed
    }

    /// The place in the middle of two places, which are near each other.
    pub fn middle(&self, mut a: [f32; 3], b: [f32; 3]) -> [f32; 3] {
        for k in 0..3 {
            let n = self.period[k];
            let mut d = b[k] - a[k];
            if n > 0.0 && d.abs() > 0.5 * n {
                d -= n * d.signum();
            }
            a[k] += 0.5 * d;
            if a[k] < 0.0 {
                a[k] += n;
            }
            if n > 0.0 && a[k] >= n {
                a[k] -= n;
            }
        }
        a
    }

    /// The square of the distance of two places [length²].
    #[inline(always)]
    fn square(&self, a: [f32; 3], b: [f32; 3]) -> f32 {
        let mut sum = 0.0;
        for k in 0..3 {
            let mut d = (a[k] - b[k]).abs();
            let n = self.period[k];
            if n > 0.0 && d > 0.5 * n {
                d = (n - d).abs();
            }
            sum += (d * self.width[k]) * (d * self.width[k]);
        }
        sum
    }

    /// Whether sources reach one and a half contact distances, but for rounding, farther than what tests of
    /// later rounds subtract.
    #[inline(always)]
    pub fn has_wide_sources(&self) -> bool {
        self.source >= self.inner + 1.49 * self.sigma
    }

    /// Whether [`Front::lines`] reaches all cells within `reach` [length].
    pub fn reaches(&self, reach: f32) -> bool {
        (0..3).all(|k| self.n[k] <= LONGEST || 2.0 * reach / self.width[k] + 2.0 <= LONGEST as f32)
    }
}

/// Most cells along an axis that [`Front::lines`] visits.
const LONGEST: i32 = 32;

/// The largest integer that is not above a number.
#[inline(always)]
fn floor(x: f32) -> i32 {
    let truncated = x as i32;
    truncated - i32::from(truncated as f32 > x)
}

/// End of a list of sources.
const NONE: u32 = u32::MAX;
/// The arrival in cells that are not reached in the step.
const NEVER: u8 = u8::MAX;
/// Sources are found by cells that are larger than those of the grid: 2 to the power of this number.
const COARSE: u32 = 1;

/// The field of a block in a round.
#[derive(Debug, Default)]
pub(crate) struct Front {
    metric: Metric,
    pub bounds: Bounds,
    /// Number of cells along each axis, and of larger cells.
    counts: [i32; 3],
    coarse: [i32; 3],
    /// The time from which on sources can have an effect in each cell [parts of the step].
    arrival: Vec<u8>,
    /// The same for each row of cells along the first axis: most rows are not reached, and their times stay
    /// in the cache.
    rows: Vec<u8>,
    /// The first source in each of the larger cells, in `sources`.
    first: Vec<u32>,
    /// Place, time, and the next source in the same cell.
    sources: Vec<([f32; 3], f32, u32)>,
    /// Cells with a finite time, and their rows.
    reached: Vec<u32>,
    reached_rows: Vec<u32>,
    /// Number of cells at each face that it reaches at the start of the step.
    shadow: [[i32; 2]; 3],
    /// Start of the step [windows], and parts of the step per window.
    start: f32,
    parts: f32,
}

impl Front {
    /// A field without sources, in the memory of another one.
    pub fn new(metric: Metric, bounds: Bounds, other: Option<Self>) -> Self {
        let counts = bounds.counts();
        let coarse = counts.map(|count| (count + (1 << COARSE) - 1) >> COARSE);
        // A block without another one beyond it leaves nothing over.
        let cells = |counts: [i32; 3]| {
            if bounds.is_whole { 0 } else { counts.iter().map(|&count| count as usize).product() }
        };
        let other = other.unwrap_or_default();
        let (mut arrival, mut rows, mut first) = (other.arrival, other.rows, other.first);
        arrival.clear();
        arrival.resize(cells(counts), NEVER);
        rows.clear();
        rows.resize(cells([1, counts[1], counts[2]]), NEVER);
        first.clear();
        first.resize(cells(coarse), NONE);
        Self {
            metric,
            bounds,
            counts,
            coarse,
            arrival,
            rows,
            first,
            sources: Vec::new(),
            reached: Vec::new(),
            reached_rows: Vec::new(),
            shadow: [[0; 2]; 3],
            start: 0.0,
            parts: 0.0,
        }
    }

    /// Removes all sources, and begins a step [windows] with these distances.
    pub fn begin(&mut self, metric: Metric, start: f32, end: f32) {
        for &cell in &self.reached {
            self.arrival[cell as usize] = NEVER;
        }
        for &row in &self.reached_rows {
            self.rows[row as usize] = NEVER;
        }
        self.reached.clear();
        self.reached_rows.clear();
        for k in 0..self.sources.len() {
            let cell = self.coarse_cell(self.sources[k].0);
            self.first[cell] = NONE;
        }
        self.sources.clear();
        self.metric = metric;
        let cells = |k: usize| (metric.face / metric.width[k]) as i32;
        let bounds = &self.bounds;
        self.shadow = [0, 1, 2].map(|k| {
            [bounds.low[k] > -FAR, bounds.high[k] < FAR].map(|shared| if shared { cells(k) } else { 0 })
        });
        self.start = start;
        self.parts = 254.0 / (end - start).max(f32::MIN_POSITIVE);
    }

    /// Whether nothing unknown can have an effect at a place of this depth at this time.
    #[inline(always)]
    pub fn is_clear(&self, depth: Depth, x: [f32; 3], time: f32) -> bool {
        self.metric.is_clear(depth, time - self.start, 0.0) && {
            let ([a, b, c], part) = (self.cell(x), self.part(time));
            let row = (c * self.counts[1] + b) as usize;
            self.rows[row] > part || self.arrival[row * self.counts[0] as usize + a as usize] > part
        }
    }

    /// Adds a source, up to the end of the step [windows], if its effects can come before those of the faces.
    pub fn add(&mut self, x: [f32; 3], time: f32, end: f32) {
        let metric = self.metric;
        let depth = metric.depth(&self.bounds, x);
        // A place of another block is behind a face.
        if !metric.is_clear(depth, time - self.start, metric.source) {
            return;
        }
        // In lists both partners have an entry for their collision.
        if self.sources.last().is_some_and(|&(place, at, _)| place == x && at == time) {
            return;
        }
        let cell = self.coarse_cell(x);
        self.sources.push((x, time, self.first[cell]));
        self.first[cell] = self.sources.len() as u32 - 1;
        // A little further, because the square of a distance is rounded.
        let reach = metric.source + 1.001 * metric.speed * (end - time).max(0.0);
        let lines = self.lines(x, reach, 0);
        let (part, per_length) = ((time - self.start) * self.parts, self.parts / metric.speed);
        let near = metric.source * metric.source;
        let arrival = |square: f32| {
            if square <= near {
                return part as u8;
            }
            let later = (square.sqrt() - metric.source).max(0.0) * per_length;
            (part + later) as u8
        };
        let most = reach * reach;
        for (start, aside) in lines.rows().filter(|row| row.1 <= most) {
            let row = start / self.counts[0] as usize;
            lower(&mut self.rows[row], arrival(aside), row, &mut self.reached_rows);
            for &(cell, along) in lines.row() {
                let (cell, square) = (start + cell as usize, aside + along);
                if square <= most {
                    lower(&mut self.arrival[cell], arrival(square), cell, &mut self.reached);
                }
            }
        }
    }

    /// Whether an event of a later round can be at this place and time.
    pub fn expects(&self, x: [f32; 3], time: f32) -> bool {
        let (metric, elapsed) = (&self.metric, time - self.start);
        let depth = metric.depth(&self.bounds, x);
        if !metric.is_clear(depth, elapsed, metric.inner) {
            return true;
        }
        let distance = metric.source - metric.inner;
        let lines = self.lines(x, distance + metric.speed * elapsed, COARSE);
        for (start, _) in lines.rows() {
            for &(cell, _) in lines.row() {
                let mut next = self.first[start + cell as usize];
                while next != NONE {
                    let (source, at, following) = self.sources[next as usize];
                    let reach = distance + metric.speed * (time - at);
                    if at <= time && metric.square(x, source) <= reach * reach {
                        return true;
                    }
                    next = following;
                }
            }
        }
        false
    }

    /// The part of the step in which a time falls.
    #[inline(always)]
    fn part(&self, time: f32) -> u8 {
        ((time - self.start) * self.parts) as u8
    }

    /// The coordinates of a place in the block, from its first cell on [cells].
    #[inline(always)]
    fn place(&self, x: [f32; 3]) -> [f32; 3] {
        let mut place = [0.0; 3];
        for k in 0..3 {
            let z = if x[k] < self.bounds.low[k] { x[k] + self.metric.period[k] } else { x[k] };
            place[k] = z - self.bounds.first[k] as f32;
        }
        place
    }

    /// The cell of a place in the block, from its first one on.
    #[inline(always)]
    fn cell(&self, x: [f32; 3]) -> [i32; 3] {
        let place = self.place(x);
        [0, 1, 2].map(|k| floor(place[k]).max(0).min(self.counts[k] - 1))
    }

    /// The larger cell of a place in the block.
    fn coarse_cell(&self, x: [f32; 3]) -> usize {
        index(self.cell(x).map(|c| c >> COARSE), self.coarse)
    }

    /// The cells, or larger cells, of the block within `reach` [length] of a place.
    #[inline(always)]
    fn lines(&self, x: [f32; 3], reach: f32, coarse: u32) -> Lines {
        let (place, metric) = (self.place(x), &self.metric);
        let counts = if coarse == 0 { self.counts } else { self.coarse };
        let mut lines = Lines { lines: [[(0, 0.0); LONGEST as usize]; 3], counts: [0; 3] };
        let mut stride = 1;
        for k in 0..3 {
            let r = reach / metric.width[k];
            let (low, high) = (floor(place[k] - r), floor(place[k] + r));
            // Along an axis that is not cut, the cells beyond an edge are those at the other one.
            let n = self.counts[k];
            let wraps = metric.period[k] > 0.0 && n == metric.n[k];
            // Cells that the faces reach at the start of the step need no times of sources.
            let shadow = if coarse == 0 { self.shadow[k] } else { [0; 2] };
            let (low, high) = if wraps {
                (low, high.min(low + n - 1))
            } else {
                (low.max(shadow[0]), high.min(n - 1 - shadow[1]))
            };
            let mut previous = -1;
            for c in low..=high.min(low + LONGEST - 1) {
                let gap = (c as f32 - place[k]).max(place[k] - (c + 1) as f32).max(0.0) * metric.width[k];
                let c = (if wraps { c.rem_euclid(n) } else { c }) >> coarse;
                if c == previous {
                    continue;
                }
                previous = c;
                lines.lines[k][lines.counts[k]] = (c as u32 * stride, gap * gap);
                lines.counts[k] += 1;
            }
            stride *= counts[k] as u32;
        }
        lines
    }
}

/// The index of a cell.
#[inline(always)]
fn index(cell: [i32; 3], counts: [i32; 3]) -> usize {
    ((cell[2] * counts[1] + cell[1]) * counts[0] + cell[0]) as usize
}

/// The cells of a cuboid around a place: along each axis, the parts of their indices and the squares of their
/// distances [length²].
struct Lines {
    lines: [[(u32, f32); LONGEST as usize]; 3],
    counts: [usize; 3],
}

impl Lines {
    /// The rows of cells along the first axis: the part of the index, and the square of the distance.
    #[inline(always)]
    fn rows(&self) -> impl Iterator<Item = (usize, f32)> {
        let [_, second, third] = [0, 1, 2].map(|k| &self.lines[k][..self.counts[k]]);
        third
            .iter()
            .flat_map(move |&(plane, z)| second.iter().map(move |&(row, y)| ((plane + row) as usize, y + z)))
    }

    /// The cells of a row.
    #[inline(always)]
    fn row(&self) -> &[(u32, f32)] {
        &self.lines[0][..self.counts[0]]
    }
}

/// Sets the time of a cell or row to an earlier one. The first time, adds its index to `reached`.
#[inline(always)]
fn lower(time: &mut u8, at: u8, index: usize, reached: &mut Vec<u32>) {
    if at < *time {
        if *time == NEVER {
            reached.push(index as u32);
        }
        *time = at;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_part_of_a_walled_axis_contains_no_cells_of_another_part() {
        for (kind, wraps) in [("walled", false), ("periodic", true)] {
            let grid = Grid { n: [20; 3], cells: [1.0; 3], wraps: [wraps; 3] };
            let shared = [[false; 2], [false; 2], [true, wraps]];
            let last = Bounds::new(&grid, [0, 0, 12], [20; 3], shared);
            for (low, count, expected) in
                [(9, 1, false), (11, 2, false), (12, 8, true), (19, 2, !wraps), (-1, 1, wraps), (0, 1, false)]
            {
                assert_eq!(last.contains_cells(2, low, count), expected, "{kind}: {count} cells from {low}");
            }
            assert!(last.contains_cells(1, 3, 20), "{kind}: an axis that is not cut");
        }
    }
}
