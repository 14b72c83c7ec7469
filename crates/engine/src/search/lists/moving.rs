/*!
The frame of the filter in a box that deforms.

Coordinates deform with the flow and repeat with the box. Under shear, with the axes in the order flow x,
gradient y, the coordinates of a particle at the beginning of a span are ξ = x − k y and y, for the *tilt* k
= S/L_y of the displacement S of the image across the upper face. Under compression they are parts of the
edges. A particle at rest relative to the flow keeps its coordinates.

The velocity relative to the flow at the beginning of the span is c = v − G r. A path through the span is
straight in space, so that for a pair the filter has the separation r_x = Δξ + k Δy and the displacement

```text
Δu + k Δw + g Δy,   u = (c_x − k c_y) W,  w = c_y W,  g = γ̇ W       under shear,
Δu + g r,           u = c W,              g = a W/(1 + a t)           under compression, along each axis,
```

for the length W of the span. The path in coordinates is ξ + u θ − g w θ² or ξ + u θ/(1 + g θ).

Reference positions stay where they are in coordinates. Lists measure all distances as they were when all
lists were made: until the *horizon*, at which they are made again, two particles that touch are no farther
apart than the contact distance times 1 + [`strain`].
*/

use glam::DVec3;

use crate::{
    model::System,
    search::moving::{MovingAxes, stretch_of_shear},
    state::{
        deformation::{HORIZON, SHEAR_HORIZON},
        world::World,
    },
};

/// Largest change of edges, or of the tilt, in a span.
pub(super) const LARGEST_CHANGE: f64 = 0.05;

/// What filters and lists read of a frame that deforms.
#[derive(Debug, Clone, Copy)]
pub(super) struct Motion {
    /// k at the beginning of the span, and its change g in the span.
    pub tilt: f32,
    pub shear: f32,
    /// g along each axis.
    pub stretch: [f32; 3],
    /// Lengths when lists were made by those at the beginning of the span.
    pub to_lists: [f32; 3],
    /// By how much lengths in space are longer in coordinates, at most in the span; the same for lengths of
    /// lists; and speeds than displacements in the span.
    pub strain: f32,
    pub strain_of_lists: f32,
    pub speed: f32,
}

impl Default for Motion {
    /// No motion.
    fn default() -> Self {
        Self {
            tilt: 0.0,
            shear: 0.0,
            stretch: [0.0; 3],
            to_lists: [1.0; 3],
            strain: 1.0,
            strain_of_lists: 1.0,
            speed: 1.0,
        }
    }
}

impl Motion {
    /// The displacement at `fraction` of the span, in lengths of its beginning.
    #[inline(always)]
    pub fn path(&self, v: [f32; 3], fraction: f32) -> [f32; 3] {
        let mut path = [0.0; 3];
        for axis in 0..3 {
            path[axis] = v[axis] * (fraction / (1.0 + self.stretch[axis] * fraction));
        }
        path[0] -= self.shear * v[1] * (fraction * fraction);
        path
    }

    /// The derivative of [`Self::path`].
    #[inline(always)]
    pub fn velocity(&self, v: [f32; 3], fraction: f32) -> [f32; 3] {
        let mut velocity = [0.0; 3];
        for axis in 0..3 {
            let scale = 1.0 + self.stretch[axis] * fraction;
            velocity[axis] = v[axis] / (scale * scale);
        }
        velocity[0] -= 2.0 * self.shear * v[1] * fraction;
        velocity
    }
}

/// The frame of a box that deforms.
#[derive(Debug, Clone, Copy)]
pub(super) struct MovingFrame {
    pub axes: MovingAxes,
    /// k at the beginning of the span, and when lists were made.
    tilt: f64,
    pub list_tilt: f64,
    /// Edges when lists were made \[length\].
    list_edges: [f64; 3],
    /// The diagonal of G at the beginning of the span [1/time].
    diagonal: [f64; 3],
}

impl MovingFrame {
    pub fn of(system: &System) -> Option<Self> {
        let axes = MovingAxes::of(system)?;
        let list_edges = axes.ordered(system.domain.size);
        Some(Self { axes, tilt: 0.0, list_tilt: 0.0, list_edges, diagonal: [0.0; 3] })
    }

    /// By how much the contact distance is larger in lengths of the lists, until these are made again.
    pub fn strain(&self) -> f64 {
        if self.axes.stretches() {
            1.0 / (1.0 - HORIZON) - 1.0
        } else {
            // The largest factor of a length in a simple shear.
            (1.0 + 0.25 * SHEAR_HORIZON * SHEAR_HORIZON).sqrt() + 0.5 * SHEAR_HORIZON - 1.0
        }
    }

    /// Largest tilt of any span.
    pub fn largest_tilt(&self) -> f64 {
        if self.axes.stretches() { 0.0 } else { 0.5 * self.axes.ratio + SHEAR_HORIZON + LARGEST_CHANGE }
    }

    /// Longest span [time].
    pub fn longest(&self) -> f64 {
        let fastest =
            self.diagonal.iter().fold(self.axes.rate.abs(), |fastest, rate| fastest.max(rate.abs()));
        LARGEST_CHANGE / fastest
    }

    /// Sets the frame for a span from `ticks` on, with edges \[length\] along the axes that are periodic: the
    /// edges then. If lists are `made`, they are made there.
    pub fn begin(&mut self, world: &World, ticks: i64, edges: &mut [f64; 3], made: bool) {
        if self.axes.stretches() {
            self.diagonal = self.axes.diagonal(world, ticks);
            for (edge, present) in edges.iter_mut().zip(self.axes.changed_edges(world, ticks)) {
                *edge = present.unwrap_or(*edge);
            }
        } else {
            let (tilt, ratio) = (self.axes.tilt(world, ticks), self.axes.ratio);
            // Not reduced by an edge while lists are in use.
            let turns = if made { 0.0 } else { ((self.tilt - tilt) / ratio).round_ties_even() };
            self.tilt = tilt + turns * ratio;
        }
        if made {
            (self.list_tilt, self.list_edges) = (self.tilt, *edges);
        }
    }

    /// What filters and lists read, for a span of this length [time] and with these edges.
    pub fn motion(&self, step: f64, edges: &[f64; 3]) -> Motion {
        let (shear, stretch) = (self.axes.rate * step, self.diagonal.map(|rate| rate * step));
        let to_lists = [0, 1, 2].map(|axis| self.list_edges[axis] / edges[axis]);
        let shortest = stretch.iter().fold(1.0, |least: f64, g| least.min(1.0 + g));
        let longest = to_lists.iter().fold(1.0, |most: f64, ratio| most.max(1.0 / ratio));
        let tilt = self.tilt.abs().max((self.tilt + shear).abs());
        Motion {
            tilt: self.tilt as f32,
            shear: shear as f32,
            stretch: stretch.map(|g| g as f32),
            to_lists: to_lists.map(|ratio| ratio as f32),
            strain: stretch_of_shear(tilt as f32) / shortest as f32,
            strain_of_lists: stretch_of_shear(self.list_tilt as f32) * longest as f32,
            speed: stretch_of_shear(2.0 * shear as f32) / (shortest * shortest) as f32,
        }
    }

    /// The position, in lengths of the box at the beginning of the span, and the velocity in these
    /// coordinates, of a path that is at `position` then.
    #[inline(always)]
    pub fn path(&self, position: DVec3, velocity: DVec3) -> [[f64; 3]; 2] {
        if self.axes.stretches() {
            let flow = DVec3::from_array(self.diagonal) * position;
            return [position.to_array(), (velocity - flow).to_array()];
        }
        let (mut r, mut v) = (self.axes.ordered(position), self.axes.ordered(velocity));
        v[0] -= self.axes.rate * r[1] + self.tilt * v[1];
        r[0] -= self.tilt * r[1];
        [r, v]
    }

    /// The longest time for which paths of up to `displacement` in a span of this length differ from their
    /// chords by at most `bend` [spans].
    pub fn longest_chord(&self, step: f64, displacement: f64, bend: f64) -> f32 {
        let change = LARGEST_CHANGE.min(step * LARGEST_CHANGE / self.longest());
        // A parabola differs from its chord by a quarter of g w θ²; a path under compression by little more.
        (4.0 * bend / (1.25 * change * displacement)).sqrt() as f32
    }
}
