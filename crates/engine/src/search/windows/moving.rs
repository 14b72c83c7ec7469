/*!
Windows in a box that deforms, whose coordinates deform with the flow.

Under shear, with the axes in the order flow x, gradient y, and the displacement S of the image across the
upper face, the coordinates of a particle at the start of a window are ξ = x − k y and y, for the *tilt* k =
S/L_y. They repeat with the box. In the course of the window the tilt grows by g θ, with g = γ̇ W for the
length W of the window and 0 ≤ θ ≤ 1, so that images do not move in the grid. With the velocity relative to
the flow at the start, c = v − G r, the path is

```text
ξ(θ) = ξ + u θ − g w θ²,   u = (c_x − k c_y) W,   w = c_y W      under shear,
ξ(θ) = ξ + u θ/(1 + g θ),  u = c W,   g = a W/(1 + a t)          under compression, along each axis,
```

with the coordinates in lengths of the box at the start. A particle stores ξ and the displacements u, w. A
filter needs the straight paths in space: r_x = Δξ + k Δy, and the relative displacement along the flow Δu +
k Δw + g Δy; under compression Δu + g r along each axis. Cells need the path in the grid. Its chord from θ₀
to the end leads along ξ by (1 − θ₀)(u − g w (1 + θ₀)), or (1 − θ₀) u/((1 + g)(1 + g θ₀)), and under shear
the path is at most g |w|/4 away from it. Two points at the distance σ in space are up to σ √(1 + k²) apart
along ξ: searches extend farther along this axis. Under compression they are up to σ/(1 + g) apart.
*/

use glam::DVec3;
use haff_neighbors::Geometry;

use crate::{
    model::System,
    search::{compact::NEAREST, moving::MovingAxes},
    state::world::World,
};

use super::axes::{Axes, Tilt};

/// Largest change g of the tilt in a window.
pub(super) const LARGEST_CHANGE: f64 = 0.25;
/// Largest change g of an edge in a window.
const LARGEST_STRETCH: f64 = 0.05;
/// The frame of the windows of a box that deforms.
#[derive(Debug, Clone, Copy)]
pub(super) struct MovingFrame {
    pub axes: MovingAxes,
    /// k at the start of the window.
    tilt: f64,
    /// The diagonal of G at the start of the window [1/time].
    diagonal: [f64; 3],
}

/// A flight at the start of a window or later, in the coordinates of the grid.
pub(super) struct GridFlight {
    /// Position now, and at the start of the window if the flight is extended back \[length\].
    pub position: [f64; 3],
    pub start: [f64; 3],
    /// (u, w, and the displacement along the third axis) \[length\].
    pub displacement: [f64; 3],
}

impl MovingFrame {
    pub fn of(system: &System) -> Option<Self> {
        Some(Self { axes: MovingAxes::of(system)?, tilt: 0.0, diagonal: [0.0; 3] })
    }

    /// The geometry with its axes in the order of the frame.
    pub fn ordered(&self, geometry: &Geometry) -> Geometry {
        Geometry {
            size: DVec3::from_array(self.axes.ordered(geometry.size)),
            axes: self.axes.order.map(|axis| geometry.axes[axis]),
            ..geometry.clone()
        }
    }

    /// Sets the tilt, or the edges of the axes, to those of the images at `ticks`. Returns by how many
    /// edges along the flow per edge along the gradient the tilt is now less than the tilt that has grown
    /// for `duration` \[time\].
    pub fn start(&mut self, world: &World, ticks: i64, duration: f64, axes: &mut Axes) -> i32 {
        if self.axes.stretches() {
            for (axis, edge) in self.axes.changed_edges(world, ticks).into_iter().enumerate() {
                if let Some(edge) = edge {
                    axes.set_edge(axis, edge);
                }
            }
            self.diagonal = self.axes.diagonal(world, ticks);
            return 0;
        }
        let tilt = self.axes.tilt(world, ticks);
        let grown = self.tilt + self.axes.rate * duration;
        self.tilt = tilt;
        ((grown - tilt) / self.axes.ratio).round_ties_even() as i32
    }

    /// Largest tilt of any window.
    pub fn largest_tilt(&self) -> f64 {
        if self.axes.stretches() { 0.0 } else { 0.5 * self.axes.ratio + LARGEST_CHANGE }
    }

    /// The largest tilt at the end of any window.
    pub fn largest_tilt_at_end(&self) -> f64 {
        self.largest_tilt() + LARGEST_CHANGE
    }

    /// Longest displacement of a particle in a window along a periodic axis, with which nearest images at
    /// this largest contact distance are found \[length\]. Differences along the flow count with the tilt and
    /// its change.
    pub fn longest_displacement(&self, axis: usize, edge: f64, contact: f64) -> f64 {
        let tilt = if axis == 0 { self.largest_tilt_at_end() } else { 0.0 };
        let shortest = self.axes.shortest();
        0.5 * (NEAREST * shortest * edge - contact * (1.0 + tilt) / shortest) / (1.0 + 2.0 * tilt)
    }

    /// Longest window \[time\].
    pub fn longest(&self) -> f64 {
        let stretch = self.diagonal.iter().fold(0.0, |largest: f64, rate| largest.max(rate.abs()));
        (LARGEST_CHANGE / self.axes.rate.abs()).min(LARGEST_STRETCH / stretch)
    }

    /// Square of the speed at which a particle moves in the grid at the start of a window.
    pub fn square_speed(&self, position: DVec3, velocity: DVec3) -> f64 {
        let flight = self.flight(position, velocity, 0.0, 1.0);
        flight.displacement.iter().map(|v| v * v).sum()
    }

    /// The flight of a particle `elapsed` \[time\] after the start of a window of the length `step` \[time\].
    #[inline(always)]
    pub fn flight(&self, position: DVec3, velocity: DVec3, elapsed: f64, step: f64) -> GridFlight {
        let rate = self.axes.rate;
        let [x, y, z] = self.axes.ordered(position);
        let [vx, vy, vz] = self.axes.ordered(velocity);
        if self.axes.stretches() {
            let (position, velocity) = ([x, y, z], [vx, vy, vz]);
            let mut flight = GridFlight { position, start: position, displacement: velocity };
            for axis in 0..3 {
                let rate = self.diagonal[axis];
                flight.start[axis] -= velocity[axis] * elapsed;
                flight.position[axis] /= 1.0 + rate * elapsed;
                flight.displacement[axis] = (velocity[axis] - rate * flight.start[axis]) * step;
            }
            return flight;
        }
        let first = y - vy * elapsed;
        let along = vx - rate * first;
        GridFlight {
            position: [x - (self.tilt + rate * elapsed) * y, y, z],
            start: [x - vx * elapsed - self.tilt * first, first, z - vz * elapsed],
            displacement: [(along - self.tilt * vy) * step, vy * step, vz * step],
        }
    }

    /// Sets the tilt of the axes, for a window of the length `step` \[time\] in which no particle is
    /// displaced by more than `displacement` \[length\].
    pub fn tilt(&self, axes: &mut Axes, step: f64, displacement: f64) {
        let change = self.axes.rate * step;
        let stretch = self.diagonal.map(|rate| rate * step);
        axes.tilt = Tilt {
            start: self.tilt as f32,
            change: change as f32,
            stretch: stretch.map(|g| g as f32),
            end: stretch.map(|g| (1.0 / (1.0 + g)) as f32),
        };
        if self.axes.stretches() {
            let low = stretch.iter().copied().fold(f64::INFINITY, f64::min);
            let high = stretch.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            // Along axes with different rates a path is bent, by little more than under shear.
            let deviation = 0.625 * (high - low) * displacement;
            let reach = 1.0 / (1.0 + low.min(0.0));
            for axis in 0..3 {
                axes.widen(axis, reach as f32, deviation as f32);
            }
            return;
        }
        let largest = self.tilt.abs().max((self.tilt + change).abs());
        // Two particles, each a quarter.
        let deviation = 0.5 * change.abs() * displacement;
        axes.widen(0, (1.0 + largest * largest).sqrt() as f32, deviation as f32);
    }
}
