//! The front of a block: from when on a place can be reached by an event that is not known yet.
//!
//! Outside of a block, and after an event that the block has left to a later round, nothing is known. What
//! happens there spreads at most with the largest speed c, and in an impact by a contact distance σ. A
//! *front* is the field T(x) of the earliest times at which it can have arrived, the least of
//!
//! * t_f + max(0, |x − x_f| − 5σ)/c for each face f from whose other side nothing is known after t_f,
//! * t_s + max(0, |x − x_s| − 3.5σ)/c for each source s, an event at t_s that has been left over.
//!
//! An event is taken if its time is before T. All events of later rounds are tested to be in the same field
//! with both distances less by 2σ. Such an event changes particles there. Until their next event they move at
//! most with c, and T changes by at most |Δx|/c over Δx, so that they stay in the field with distances less
//! by 2σ. What they then touch is at most σ away, in the field with distances less by σ, and so is that
//! particle until its own next event. An event that has been taken is outside of the field. So no event of a
//! later round can reach a particle before an event of it that has been taken.

use haff_neighbors::Array;

use super::axes::Axes;

/// Distances from faces and from sources, and what tests of later rounds subtract from them [largest contact
/// distances].
#[derive(Debug, Clone, Copy)]
pub(super) struct Dilations {
    pub face: f32,
    pub source: f32,
    pub inner: f32,
}

/// The planes of cells `first` ≤ plane < `end` along the axis of the blocks. On a periodic axis `end` can be
/// larger than the number of planes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Planes {
    pub first: i32,
    pub end: i32,
    /// The times \[fractions of the window\] until which the other sides of the first and the last face are
    /// known; infinite where nothing is beyond the face.
    pub known: [f32; 2],
}

impl Planes {
    /// Whether nothing is beyond these planes.
    #[inline(always)]
    pub fn is_whole(&self) -> bool {
        self.known == [f32::INFINITY; 2]
    }
}

/// Distances, in lengths and in cells.
#[derive(Debug, Clone, Copy)]
pub(super) struct Metric {
    /// Axis along which blocks follow each other.
    pub axis: usize,
    /// Number of cells along each axis, and whether the cells beyond an edge are those at the other one.
    pub n: [i32; 3],
    pub wraps: [bool; 3],
    /// Edges of a cell [length]; 0 along an axis without extension.
    pub width: [f32; 3],
    /// Largest speed [length per window].
    pub speed: f32,
    /// Distances [length].
    pub face: f32,
    pub source: f32,
    pub inner: f32,
}

impl Metric {
    pub fn new(axes: &Axes, axis: usize, speed: f32, sigma: f32, dilations: Dilations) -> Self {
        let width = |k: usize| if axes.cells[k] > 0.0 { 1.0 / axes.cells[k] } else { 0.0 };
        Self {
            axis,
            n: [axes.n[0], axes.n[1], axes.n[2]],
            wraps: [0, 1, 2].map(|k| axes.wraps(k)),
            width: [0, 1, 2].map(width),
            speed,
            face: dilations.face * sigma,
            source: dilations.source * sigma,
            inner: dilations.inner * sigma,
        }
    }

    /// The grid coordinate along the axis of blocks, as seen from `planes`: not before its first plane, if
    /// the axis is periodic.
    #[inline(always)]
    fn along(&self, x: [f32; 3], planes: &Planes) -> f32 {
        let (z, first, n) = (x[self.axis], planes.first as f32, self.n[self.axis] as f32);
        if !self.wraps[self.axis] {
            return z;
        }
        let z = if z < first { z + n } else { z };
        if z >= first + n { z - n } else { z }
    }

    /// Whether a place is in these planes.
    #[inline(always)]
    pub fn contains(&self, planes: &Planes, x: [f32; 3]) -> bool {
        let z = self.along(x, planes);
        z >= planes.first as f32 && z < planes.end as f32
    }

    /// Whether cells `low` to `low` + `count` − 1 are in these planes.
    #[inline(always)]
    pub fn contains_cells(&self, planes: &Planes, low: i32, count: i32) -> bool {
        if planes.known == [f32::INFINITY; 2] {
            return true;
        }
        let mut low = low;
        if self.wraps[self.axis] {
            let n = self.n[self.axis];
            if low < planes.first {
                low += n;
            }
            if low >= planes.first + n {
                low -= n;
            }
        }
        // Without images, the cells at an edge also hold what is beyond it.
        (low >= planes.first || planes.known[0] == f32::INFINITY)
            && (low + count <= planes.end || planes.known[1] == f32::INFINITY)
    }

    /// The time from which on the other sides of the faces can have an effect at a place, which is in the
    /// planes; with distances less by `less` [length].
    #[inline(always)]
    pub fn arrival_from_faces(&self, planes: &Planes, x: [f32; 3], less: f32) -> f32 {
        let (z, width, distance) = (self.along(x, planes), self.width[self.axis], self.face - less);
        let time = |known: f32, gap: f32| known + (gap * width - distance).max(0.0) / self.speed;
        let below = time(planes.known[0], z - planes.first as f32);
        let above = time(planes.known[1], planes.end as f32 - z);
        below.min(above)
    }

    /// The time at which an effect of an event can arrive at a face.
    pub fn arrival_at_face(&self, face: i32, x: [f32; 3], time: f32) -> f32 {
        let n = self.n[self.axis] as f32;
        let mut gap = (x[self.axis] - face as f32).abs();
        if self.wraps[self.axis] {
            gap %= n;
            gap = gap.min(n - gap);
        }
        time + (gap * self.width[self.axis] - self.face).max(0.0) / self.speed
    }

    /// The place in the middle of one or two places, which are near each other.
    pub fn middle(&self, places: &[[f32; 3]]) -> [f32; 3] {
        let &[mut a, b] = places else { return places[0] };
        for k in 0..3 {
            let n = self.n[k] as f32;
            let mut d = b[k] - a[k];
            if self.wraps[k] && d.abs() > 0.5 * n {
                d -= n * d.signum();
            }
            a[k] += 0.5 * d;
            if self.wraps[k] && a[k] < 0.0 {
                a[k] += n;
            }
            if self.wraps[k] && a[k] >= n {
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
            let n = self.n[k] as f32;
            if self.wraps[k] && d > 0.5 * n {
                d = (n - d).abs();
            }
            sum += (d * self.width[k]) * (d * self.width[k]);
        }
        sum
    }

    /// The index of the cell of a place.
    #[inline(always)]
    pub fn cell(&self, x: [f32; 3]) -> usize {
        let (a, b, c) = (floor(x[0]), floor(x[1]), floor(x[2]));
        self.index([self.wrapped(0, a), self.wrapped(1, b), self.wrapped(2, c)])
    }

    #[inline(always)]
    fn wrapped(&self, k: usize, c: i32) -> i32 {
        let n = self.n[k];
        if (0..n).contains(&c) {
            c
        } else if self.wraps[k] {
            c.rem_euclid(n)
        } else {
            c.clamp(0, n - 1)
        }
    }

    #[inline(always)]
    fn index(&self, c: [i32; 3]) -> usize {
        ((c[2] * self.n[1] + c[1]) * self.n[0] + c[0]) as usize
    }

    /// Visits the cells within `reach` [length] of a place, and in these planes: the index of each, and the
    /// square of its distance from the place [length²].
    #[inline(always)]
    fn visit(&self, planes: &Planes, x: [f32; 3], reach: f32, mut visit: impl FnMut(usize, f32)) {
        // Along each axis: the part of the index, and the square of the distance.
        let mut lines = [[(0_usize, 0.0_f32); LONGEST]; 3];
        let mut counts = [0; 3];
        let mut stride = 1;
        for k in 0..3 {
            let r = if self.width[k] > 0.0 { reach / self.width[k] } else { 0.0 };
            let (low, high) = (floor(x[k] - r), floor(x[k] + r));
            let (low, high) = if self.wraps[k] {
                (low, high.min(low + self.n[k] - 1))
            } else {
                (low.max(0), high.min(self.n[k] - 1))
            };
            for c in low..=high.min(low + LONGEST as i32 - 1) {
                let gap = (c as f32 - x[k]).max(x[k] - (c + 1) as f32).max(0.0) * self.width[k];
                let c = self.wrapped(k, c);
                if k == self.axis && !self.contains_cells(planes, c, 1) {
                    continue;
                }
                lines[k][counts[k]] = (c as usize * stride, gap * gap);
                counts[k] += 1;
            }
            stride *= self.n[k] as usize;
        }
        let most = reach * reach;
        for &(plane, z) in &lines[2][..counts[2]] {
            for &(row, y) in &lines[1][..counts[1]] {
                let aside = y + z;
                if aside > most {
                    continue;
                }
                for &(cell, x) in &lines[0][..counts[0]] {
                    let square = aside + x;
                    if square <= most {
                        visit(plane + row + cell, square);
                    }
                }
            }
        }
    }

    /// Whether [`Self::visit`] reaches all cells within `reach` [length].
    pub fn reaches(&self, reach: f32) -> bool {
        (0..3).all(|k| self.width[k] == 0.0 || 2.0 * reach / self.width[k] + 2.0 <= LONGEST as f32)
    }

    /// Whether all cells within a distance [length] of a place are in these planes.
    #[inline(always)]
    pub fn is_deep(&self, planes: &Planes, x: [f32; 3], distance: f32) -> bool {
        let (z, width) = (self.along(x, planes), self.width[self.axis]);
        // One cell for the cell of the place, and one for the rounding of coordinates.
        let needed = distance / width + 2.0;
        let below = planes.known[0] == f32::INFINITY || z - planes.first as f32 >= needed;
        let above = planes.known[1] == f32::INFINITY || planes.end as f32 - z >= needed;
        below && above
    }
}

/// Most cells along an axis that [`Metric::visit`] visits.
const LONGEST: usize = 32;

/// The largest integer that is not above a number.
#[inline(always)]
fn floor(x: f32) -> i32 {
    let truncated = x as i32;
    truncated - i32::from(truncated as f32 > x)
}

/// End of a list of sources.
const NONE: u32 = u32::MAX;

/// The sources of one block in a round.
#[derive(Debug, Default)]
pub(super) struct Sources {
    /// Place, time, and the next source in the same cell.
    list: Vec<([f32; 3], f32, u32)>,
    /// Cells that have a finite time.
    reached: Vec<u32>,
}

/// The fields of a round on the cells of the grid. Blocks have aliases of it.
#[derive(Debug, Default)]
pub(super) struct Fields {
    /// The time from which on sources can have an effect in each cell, and in each row of cells along the
    /// first axis: most rows are not reached, and their times stay in the cache.
    arrival: Array<f32>,
    rows: Array<f32>,
    /// The first source in each cell, in the list of its block.
    first: Array<u32>,
}

impl Fields {
    /// Fields without sources, for these numbers of cells and of rows.
    pub fn resize(&mut self, cells: usize, rows: usize) {
        if self.first.len() != cells {
            self.arrival = vec![f32::INFINITY; cells].into();
            self.first = vec![NONE; cells].into();
        }
        if self.rows.len() != rows {
            self.rows = vec![f32::INFINITY; rows].into();
        }
    }

    /// The same fields, for another thread.
    ///
    /// # Safety
    ///
    /// Each thread uses only the cells of its own block.
    pub unsafe fn alias(&mut self) -> Self {
        // SAFETY: guaranteed by the caller.
        unsafe { Self { arrival: self.arrival.alias(), rows: self.rows.alias(), first: self.first.alias() } }
    }

    /// Whether sources can have an effect at a place and time.
    #[inline(always)]
    pub fn is_reached(&self, metric: &Metric, x: [f32; 3], time: f32) -> bool {
        let cell = metric.cell(x);
        self.rows[cell / metric.n[0] as usize] <= time && self.arrival[cell] <= time
    }

    /// Adds a source.
    pub fn add(
        &mut self,
        metric: &Metric,
        planes: &Planes,
        sources: &mut Sources,
        x: [f32; 3],
        time: f32,
        end: f32,
    ) {
        let cell = metric.cell(x);
        sources.list.push((x, time, self.first[cell]));
        self.first[cell] = sources.list.len() as u32 - 1;
        sources.reached.push(cell as u32);
        let reach = metric.source + metric.speed * (end - time).max(0.0);
        let near = metric.source * metric.source;
        metric.visit(planes, x, reach, |cell, square| {
            let later = if square <= near { 0.0 } else { (square.sqrt() - metric.source) / metric.speed };
            let arrival = time + later;
            let known = &mut self.arrival[cell];
            if arrival < *known {
                if *known == f32::INFINITY {
                    sources.reached.push(cell as u32);
                }
                *known = arrival;
                let row = &mut self.rows[cell / metric.n[0] as usize];
                *row = row.min(arrival);
            }
        });
    }

    /// Whether an event of a later round can be at this place and time. `begin` is the earliest time of a
    /// source.
    pub fn expects(
        &self,
        metric: &Metric,
        planes: &Planes,
        sources: &Sources,
        x: [f32; 3],
        time: f32,
        begin: f32,
    ) -> bool {
        if metric.arrival_from_faces(planes, x, metric.inner) <= time {
            return true;
        }
        let distance = metric.source - metric.inner;
        let mut found = false;
        metric.visit(planes, x, distance + metric.speed * (time - begin).max(0.0), |cell, _| {
            let mut next = self.first[cell];
            while !found && next != NONE {
                let (source, at, following) = sources.list[next as usize];
                let reach = distance + metric.speed * (time - at);
                found = at <= time && metric.square(x, source) <= reach * reach;
                next = following;
            }
        });
        found
    }

    /// Removes all sources of a block.
    pub fn clear(&mut self, metric: &Metric, sources: &mut Sources) {
        for &cell in &sources.reached {
            self.arrival[cell as usize] = f32::INFINITY;
            self.rows[cell as usize / metric.n[0] as usize] = f32::INFINITY;
            self.first[cell as usize] = NONE;
        }
        sources.list.clear();
        sources.reached.clear();
    }
}
