//! Searches for boxes that deform: images move at constant velocities. Under simple shear (A. W. Lees, S. F.
//! Edwards, J. Phys. C 5, 1921 (1972)) those across the faces of the gradient axis are displaced along the
//! flow, and slide; under compression they come nearer.

use glam::DVec3;
use haff_mechanics::time_to_face;

use crate::{
    Axis, Crossing, Deforming, Flight, Geometry, Search, Shift, Sliding,
    cells::{Cells, grid},
};

impl Sliding {
    /// Counts the edges of an image from a displacement without `turns` to one with them.
    fn absolute(&self, mut shift: Shift) -> Shift {
        shift[self.flow] -= (i64::from(shift[self.gradient]) * self.turns) as i32;
        shift
    }

    /// The opposite of [`Self::absolute`].
    fn relative(&self, mut shift: Shift) -> Shift {
        shift[self.flow] += (i64::from(shift[self.gradient]) * self.turns) as i32;
        shift
    }
}

/// Images at rest, for a geometry whose box does not deform.
const STILL: Deforming = Deforming { sliding: None, speeds: DVec3::ZERO, start: 0, tick: 1.0, horizon: 0.0 };

/// Images that slide nowhere: the axes by which cells are ordered without shear.
const RESTING: Sliding = Sliding { flow: 0, gradient: 1, speed: 0.0, offset: 0.0, turns: 0 };

/// Code of the crossing by which rows have moved by one cell.
const SLIDE: u8 = 6;

/**
Cells that move with the box.

A face between cells is at a constant part of the edge, so that cells become narrower with a box that is
compressed, and their faces move at a constant velocity. Cells are wide enough for the narrowest box of the
[horizon](Deforming::horizon).

Under shear cells are in rows that move with the flow. A row has all cells with one coordinate along the
gradient. Row j is displaced by j Δ along the flow, where n Δ for n rows is the displacement of the image
across the upper face: rows of the image continue those of the box, and every row moves with the mean
velocity of its particles. A particle leaves its cell as often as without shear.

Let Δ = (k + f) w for cells of width w, with 0 ≤ f ≤ 1. In the row above the neighbors of cell c are c − k − 2
to c − k + 1, in the row below c + k − 1 to c + k + 2. When f reaches an end, k changes by one for each
particle: a crossing of all particles at one time, by which each of them gets one new cell per row.
*/
#[derive(Debug, Clone)]
pub struct DeformingCells {
    /// With the widths at the start.
    cells: Cells,
    deforming: Deforming,
    sliding: Sliding,
    /// Whether rows slide: without shear a cell has one neighbor less in each row.
    slides: bool,
    /// Velocity at which cells become wider by axis [length/time].
    widening: [f64; 3],
    /// Velocity of a row relative to the row below [length/time].
    row_speed: f64,
    /// k by particle.
    slid: Vec<i32>,
    /// All walls: there are few of them.
    walls: Vec<u16>,
}

impl DeformingCells {
    /// Displacement of the image across the upper face at `now`, without the edges in `turns` [length].
    fn displacement(&self, now: i64) -> f64 {
        self.sliding.offset + self.sliding.speed * self.deforming.age(now)
    }

    /// Δ at `now`.
    fn row_offset(&self, now: i64) -> f64 {
        self.displacement(now) / f64::from(self.cells.n[self.sliding.gradient])
    }

    /// Width of cells along an axis at `now` [length].
    fn width(&self, axis: usize, now: i64) -> f64 {
        self.cells.width[axis] + self.widening[axis] * self.deforming.age(now)
    }

    /// Cells along the flow, relative to c, that are neighbors of cell c in the row `step` above, for k =
    /// `slid`.
    fn range(&self, step: i32, slid: i32) -> (i32, i32) {
        match step {
            _ if !self.slides => (-1, 1),
            0 => (-1, 1),
            1 => (-slid - 2, -slid + 1),
            _ => (slid - 1, slid + 2),
        }
    }

    /// Visits cells along the flow, relative to the cell of i, in the row `row` above and `layer` beside.
    #[inline]
    fn visit_row<V: FnMut(u32, Shift)>(
        &self,
        i: u32,
        [row, layer]: [i32; 2],
        (first, last): (i32, i32),
        visit: &mut V,
    ) {
        let Sliding { flow, gradient, .. } = self.sliding;
        let side = 3 - flow - gradient;
        let own = self.cells.coordinate[i as usize];
        let (mut cell, mut shift) = ([0; 3], [0; 3]);
        let is_beyond = |axis: usize, c: i32| {
            self.cells.axes[axis] == Axis::Bounded && !(0..self.cells.n[axis]).contains(&c)
        };
        for (axis, step) in [(gradient, row), (side, layer)] {
            if is_beyond(axis, own[axis] + step) {
                return;
            }
            (cell[axis], shift[axis]) = self.cells.fold(axis, own[axis] + step);
        }
        let n = self.cells.n[flow];
        let last = if is_beyond(flow, own[flow] + last) { last - 1 } else { last };
        let first = if is_beyond(flow, own[flow] + first) { first + 1 } else { first };
        (cell[flow], shift[flow]) = self.cells.fold(flow, own[flow] + first);
        for _ in first..=last {
            self.cells.visit_cell(i, self.cells.index(cell), shift, &mut |j, shift| {
                visit(j, self.sliding.absolute(shift));
            });
            cell[flow] += 1;
            if cell[flow] == n {
                cell[flow] = 0;
                // Along an open axis the grid is folded onto itself.
                shift[flow] += i32::from(self.cells.axes[flow] == Axis::Periodic);
            }
        }
    }

    /// Steps to the layers beside that of a particle.
    fn layers(&self) -> std::ops::RangeInclusive<i32> {
        let side = 3 - self.sliding.flow - self.sliding.gradient;
        if self.cells.axes[side] == Axis::Flat { 0..=0 } else { -1..=1 }
    }
}

impl Search for DeformingCells {
    fn new(geometry: &Geometry, positions: &[DVec3]) -> Self {
        let deforming = geometry.deforming.unwrap_or(STILL);
        let sliding = deforming.sliding.unwrap_or(RESTING);
        let mut narrowest = geometry.clone();
        narrowest.size =
            DVec3::from_array([0, 1, 2].map(|axis| deforming.shortest(axis, geometry.size[axis])));
        let (n, mut width) = grid(&narrowest, positions.len());
        let mut widening = [0.0; 3];
        for axis in (0..3).filter(|&axis| geometry.axes[axis] == Axis::Periodic) {
            width[axis] = geometry.size[axis] / f64::from(n[axis]);
            widening[axis] = deforming.speeds[axis] / f64::from(n[axis]);
        }
        let rows = f64::from(n[sliding.gradient]);
        let row_offset = sliding.offset / rows;
        let coordinate = |position: &DVec3| {
            let mut p = position.to_array();
            let row = (p[sliding.gradient] / width[sliding.gradient]).floor();
            p[sliding.flow] -= row * row_offset;
            [0, 1, 2].map(|axis| match geometry.axes[axis] {
                Axis::Flat => 0,
                Axis::Bounded => ((p[axis] / width[axis]).floor() as i32).clamp(0, n[axis] - 1),
                Axis::Periodic | Axis::Open => (p[axis] / width[axis]).floor() as i32,
            })
        };
        let coordinates: Vec<[i32; 3]> = positions.iter().map(coordinate).collect();
        let slid = (row_offset / width[sliding.flow]).floor() as i32;
        Self {
            cells: Cells::of(geometry, n, width, coordinates),
            deforming,
            sliding,
            slides: deforming.sliding.is_some(),
            widening,
            row_speed: sliding.speed / rows,
            slid: vec![slid; positions.len()],
            walls: (0..geometry.planes.len() as u16).collect(),
        }
    }

    #[inline]
    fn candidates<P: Fn(u32) -> DVec3, V: FnMut(u32, Shift)>(
        &self,
        i: u32,
        _now: i64,
        _position: P,
        mut visit: V,
    ) {
        let slid = self.slid[i as usize];
        for layer in self.layers() {
            for row in -1..=1 {
                self.visit_row(i, [row, layer], self.range(row, slid), &mut visit);
            }
        }
    }

    #[inline]
    fn new_candidates<P: Fn(u32) -> DVec3, V: FnMut(u32, Shift)>(
        &self,
        i: u32,
        code: u8,
        now: i64,
        position: P,
        mut visit: V,
    ) {
        let Sliding { flow, gradient, .. } = self.sliding;
        let slid = self.slid[i as usize];
        let (axis, upwards) = (usize::from(code / 2), code % 2 == 1);
        if code == SLIDE {
            for layer in self.layers() {
                for row in [-1, 1] {
                    let (first, last) = self.range(row, slid);
                    let new = if (self.row_speed > 0.0) == (row == 1) { first } else { last };
                    self.visit_row(i, [row, layer], (new, new), &mut visit);
                }
            }
        } else if axis == flow {
            for layer in self.layers() {
                for row in -1..=1 {
                    let (first, last) = self.range(row, slid);
                    let new = if upwards { last } else { first };
                    self.visit_row(i, [row, layer], (new, new), &mut visit);
                }
            }
        } else if axis == gradient {
            // In the row that was left, too, a cell may be new: that of the particle has changed.
            self.candidates(i, now, position, visit);
        } else {
            let layer = if upwards { 1 } else { -1 };
            for row in -1..=1 {
                self.visit_row(i, [row, layer], self.range(row, slid), &mut visit);
            }
        }
    }

    fn walls(&self, _i: u32) -> &[u16] {
        &self.walls
    }

    #[inline]
    fn next_crossing(&self, i: u32, flight: &Flight, _within: f64) -> Option<Crossing> {
        let Sliding { flow, gradient, .. } = self.sliding;
        let coordinate = self.cells.coordinate[i as usize];
        let (mut position, mut velocity) = (flight.position.to_array(), flight.velocity.to_array());
        let (row, offset) = (f64::from(coordinate[gradient]), self.row_offset(flight.now));
        position[flow] -= row * offset;
        velocity[flow] -= row * self.row_speed;
        let mut best = Crossing { delay: f64::INFINITY, code: SLIDE };
        if self.row_speed != 0.0 {
            let slid = self.slid[i as usize] + i32::from(self.row_speed > 0.0);
            let gap = f64::from(slid) * self.width(flow, flight.now) - offset;
            best.delay = (gap / self.row_speed).max(0.0);
        }
        for axis in 0..3 {
            if self.cells.axes[axis] == Axis::Flat {
                continue;
            }
            let (c, bounded) = (coordinate[axis], self.cells.axes[axis] == Axis::Bounded);
            let width = self.width(axis, flight.now);
            for side in 0..2 {
                if bounded && (c == 0 && side == 0 || c == self.cells.n[axis] - 1 && side == 1) {
                    continue;
                }
                let outward = if side == 0 { -1.0 } else { 1.0 };
                let number = f64::from(c + side);
                let gap = (number * width - position[axis]) * outward;
                let speed = outward * (velocity[axis] - number * self.widening[axis]);
                if let Some(delay) = time_to_face(gap, -speed, 0.0)
                    && delay < best.delay
                {
                    best = Crossing { delay, code: axis as u8 * 2 + side as u8 };
                }
            }
        }
        (best.delay < f64::INFINITY).then_some(best)
    }

    fn cross(&mut self, i: u32, code: u8, flight: &Flight) {
        if code == SLIDE {
            self.slid[i as usize] += if self.row_speed > 0.0 { 1 } else { -1 };
            return;
        }
        let Sliding { flow, gradient, .. } = self.sliding;
        self.cells.remove(i);
        let axis = usize::from(code / 2);
        let mut coordinate = self.cells.coordinate[i as usize];
        coordinate[axis] += if code.is_multiple_of(2) { -1 } else { 1 };
        if axis == gradient {
            let row = f64::from(coordinate[gradient]);
            let along = flight.position[flow] - row * self.row_offset(flight.now);
            coordinate[flow] = (along / self.width(flow, flight.now)).floor() as i32;
        }
        self.cells.coordinate[i as usize] = coordinate;
        self.cells.insert(i);
    }

    fn rewrap(&mut self, i: u32, wraps: [i32; 3]) {
        self.cells.rewrap(i, self.sliding.relative(wraps));
    }
}

/**
All pairs in a box that deforms: the reference for [`DeformingCells`], and the search for very few particles.

Each pair is given with its two nearest images along each axis: under shear first along the gradient, then,
with the displacement of that image, along the flow. A third can touch only after the image has moved by L −
reach relative to the particle. Under shear the flow, up to |γ̇| 2 L, may give half of that along the flow. A
particle is searched again when its own part, relative to the flow, is a sixth of that distance along the flow
of a shear, or a third along another axis. Distances are those at the start: where the edge is s times that
of the start, a length is divided by s.
*/
#[derive(Debug, Clone)]
pub struct DeformingPairs {
    lengths: [f64; 3],
    periodic: [bool; 3],
    /// L − reach by axis \[length\].
    room: [f64; 3],
    count: u32,
    deforming: Deforming,
    sliding: Sliding,
    walls: Vec<u16>,
}

impl DeformingPairs {
    /// Edge along an axis at `now` [length].
    fn length(&self, axis: usize, now: i64) -> f64 {
        self.lengths[axis] + self.deforming.speeds[axis] * self.deforming.age(now)
    }

    /// Time until a particle has moved by a third of the room along an axis, relative to the flow.
    fn time_along(&self, axis: usize, flight: &Flight) -> f64 {
        let rate = self.deforming.speeds[axis] / self.lengths[axis];
        let scale = 1.0 + rate * self.deforming.age(flight.now);
        let third = self.room[axis] / 3.0;
        // Of the path c t/(s + a t), for the velocity c relative to the flow.
        let speed = (flight.velocity[axis] - rate * flight.position[axis] / scale).abs();
        let left = speed - third * rate;
        if left > 0.0 { third * scale / left } else { f64::INFINITY }
    }
}

impl Search for DeformingPairs {
    const IS_ALL_PAIRS: bool = true;

    fn new(geometry: &Geometry, positions: &[DVec3]) -> Self {
        let lengths = geometry.lengths();
        let deforming = geometry.deforming.unwrap_or(STILL);
        let room = |axis: usize| {
            let length = lengths[axis];
            // At the start, where it is longer than at any contact.
            let reach = geometry.reach * length / deforming.shortest(axis, length);
            (length - reach).max(lengths[axis] * 1e-3)
        };
        Self {
            lengths,
            periodic: geometry.axes.map(|axis| axis == Axis::Periodic),
            room: [0, 1, 2].map(room),
            count: positions.len() as u32,
            deforming,
            sliding: deforming.sliding.unwrap_or(RESTING),
            walls: (0..geometry.planes.len() as u16).collect(),
        }
    }

    fn candidates<P: Fn(u32) -> DVec3, V: FnMut(u32, Shift)>(
        &self,
        i: u32,
        now: i64,
        position: P,
        mut visit: V,
    ) {
        let Sliding { flow, gradient, .. } = self.sliding;
        let side = 3 - flow - gradient;
        let displacement = self.sliding.offset + self.sliding.speed * self.deforming.age(now);
        // −d/L is between the shifts of the two nearest images.
        let pair = |axis: usize, d: f64| {
            if !self.periodic[axis] {
                return 0..=0;
            }
            let low = (-d / self.length(axis, now)).floor() as i32;
            low..=low + 1
        };
        let from = position(i);
        for j in (0..self.count).filter(|&j| j != i) {
            let d = position(j) - from;
            for up in pair(gradient, d[gradient]) {
                for along in pair(flow, d[flow] + f64::from(up) * displacement) {
                    for beside in pair(side, d[side]) {
                        let mut shift = [0; 3];
                        (shift[flow], shift[gradient], shift[side]) = (along, up, beside);
                        visit(j, self.sliding.absolute(shift));
                    }
                }
            }
        }
    }

    fn new_candidates<P: Fn(u32) -> DVec3, V: FnMut(u32, Shift)>(
        &self,
        i: u32,
        _code: u8,
        now: i64,
        position: P,
        visit: V,
    ) {
        self.candidates(i, now, position, visit);
    }

    fn walls(&self, _i: u32) -> &[u16] {
        &self.walls
    }

    fn next_crossing(&self, _i: u32, flight: &Flight, _within: f64) -> Option<Crossing> {
        let Sliding { flow, gradient, speed, .. } = self.sliding;
        let periodic = (0..3).filter(|&axis| self.periodic[axis]);
        let is_sheared = self.deforming.sliding.is_some();
        let free = periodic.filter(|&axis| !is_sheared || axis != flow);
        let mut delay = free.map(|axis| self.time_along(axis, flight)).fold(f64::INFINITY, f64::min);
        if is_sheared {
            let rate = speed / self.lengths[gradient];
            let (r, v) = (flight.position.to_array(), flight.velocity.to_array());
            delay = delay.min(self.room[flow] / (4.0 * speed.abs()));
            // The path relative to the flow: |c| t + ½ |γ̇ v_g| t².
            let (c, a) = ((v[flow] - rate * r[gradient]).abs(), 0.5 * (rate * v[gradient]).abs());
            let path = self.room[flow] / 6.0;
            delay = delay.min(2.0 * path / (c + (c * c + 4.0 * a * path).sqrt()));
        }
        (delay < f64::INFINITY).then_some(Crossing { delay, code: 0 })
    }

    fn cross(&mut self, _i: u32, _code: u8, _flight: &Flight) {}

    fn rewrap(&mut self, _i: u32, _wraps: [i32; 3]) {}
}
