/*!
Windows in a sheared box, whose coordinates deform with the flow.

With the axes in the order flow x, gradient y, and the displacement S of the image across the upper face,
the coordinates of a particle at the start of a window are ξ = x − k y and y, for the *tilt* k = S/L_y. They
repeat with the box. In the course of the window the tilt grows by g θ, with g = γ̇ W for the length W of the
window and 0 ≤ θ ≤ 1, so that images do not move in the grid. With the velocity relative to the flow at the
start, c = v − γ̇ y, the path is

```text
ξ(θ) = ξ + u θ − g w θ²,   u = (c_x − k c_y) W,   w = c_y W
```

A particle stores ξ, y and u, w. A filter needs the straight paths in space: r_x = Δξ + k Δy, and the relative
displacement along the flow Δu + k Δw + g Δy. Cells need the path in the grid. Its chord from θ₀ to the end
leads along ξ by (1 − θ₀)(u − g w (1 + θ₀)), and the path is at most g |w|/4 away from it. Two points at the
distance σ in space are up to σ √(1 + k²) apart along ξ: searches extend farther along this axis.
*/

use glam::DVec3;
use haff_neighbors::Geometry;

use crate::{
    model::{Shear, System},
    state::world::World,
};

use super::axes::{Axes, Tilt};

/// Largest change g of the tilt in a window.
pub(super) const LARGEST_CHANGE: f64 = 0.25;
/// Windows are used up to this ratio of the edges along the flow and along the gradient: half of it is the
/// largest tilt.
pub(super) const LARGEST_RATIO: f64 = 4.0;

/// The frame of the windows of a sheared box.
#[derive(Debug, Clone, Copy)]
pub(super) struct ShearedFrame {
    /// The axes of the flow, of the gradient, and the third one: the axes of the grid in this order.
    order: [usize; 3],
    /// γ̇ [1/time].
    rate: f64,
    /// Edge along the flow by that along the gradient.
    pub ratio: f64,
    /// Edge along the gradient [length].
    height: f64,
    /// k at the start of the window.
    tilt: f64,
}

/// A flight at the start of a window or later, in the coordinates of the grid.
pub(super) struct GridFlight {
    /// Position now, and at the start of the window if the flight is extended back [length].
    pub position: [f64; 3],
    pub start: [f64; 3],
    /// (u, w, and the displacement along the third axis) [length].
    pub displacement: [f64; 3],
}

impl ShearedFrame {
    pub fn of(system: &System) -> Option<Self> {
        let Shear { flow, gradient, rate, .. } = system.domain.shear?;
        let size = system.domain.size;
        let (ratio, height) = (size[flow] / size[gradient], size[gradient]);
        Some(Self { order: [flow, gradient, 3 - flow - gradient], rate, ratio, height, tilt: 0.0 })
    }

    /// The geometry with its axes in the order of the frame.
    pub fn ordered(&self, geometry: &Geometry) -> Geometry {
        Geometry {
            size: DVec3::from_array(self.order.map(|axis| geometry.size[axis])),
            axes: self.order.map(|axis| geometry.axes[axis]),
            ..geometry.clone()
        }
    }

    /// Sets the tilt to that of the images at `ticks`. Returns by how many edges along the flow per edge
    /// along the gradient it is now less than the tilt that has grown for `duration` \[time\].
    pub fn start(&mut self, world: &World, ticks: i64, duration: f64) -> i32 {
        let tilt = world.displacement(ticks).offset / self.height;
        let grown = self.tilt + self.rate * duration;
        self.tilt = tilt;
        ((grown - tilt) / self.ratio).round_ties_even() as i32
    }

    /// Largest tilt of any window.
    pub fn largest_tilt(&self) -> f64 {
        0.5 * self.ratio + LARGEST_CHANGE
    }

    /// Longest window [time].
    pub fn longest(&self) -> f64 {
        LARGEST_CHANGE / self.rate.abs()
    }

    /// Square of the speed at which a particle moves in the grid at the start of a window.
    pub fn square_speed(&self, position: DVec3, velocity: DVec3) -> f64 {
        let flight = self.flight(position, velocity, 0.0, 1.0);
        flight.displacement.iter().map(|v| v * v).sum()
    }

    /// The flight of a particle `elapsed` [time] after the start of a window of the length `step` [time].
    #[inline(always)]
    pub fn flight(&self, position: DVec3, velocity: DVec3, elapsed: f64, step: f64) -> GridFlight {
        let [x, y, z] = self.order.map(|axis| position[axis]);
        let [vx, vy, vz] = self.order.map(|axis| velocity[axis]);
        let first = y - vy * elapsed;
        let along = vx - self.rate * first;
        GridFlight {
            position: [x - (self.tilt + self.rate * elapsed) * y, y, z],
            start: [x - vx * elapsed - self.tilt * first, first, z - vz * elapsed],
            displacement: [(along - self.tilt * vy) * step, vy * step, vz * step],
        }
    }

    /// Sets the tilt of the axes, for a window of the length `step` [time] in which no particle is displaced
    /// by more than `displacement` [length].
    pub fn tilt(&self, axes: &mut Axes, step: f64, displacement: f64) {
        let change = self.rate * step;
        let largest = self.tilt.abs().max((self.tilt + change).abs());
        axes.tilt = Tilt { start: self.tilt as f32, change: change as f32 };
        // Two particles, each a quarter.
        let deviation = 0.5 * change.abs() * displacement;
        axes.widen(0, (1.0 + largest * largest).sqrt() as f32, deviation as f32);
    }
}
