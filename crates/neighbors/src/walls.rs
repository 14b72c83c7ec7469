//! The walls that a particle in a cell can touch.

use glam::DVec3;
use rayon::prelude::*;

use crate::{Axis, Geometry, Plane};

/// For every cell of a grid the walls that a particle assigned to it can touch; empty without walls.
#[derive(Debug, Clone, Default)]
pub(crate) struct WallTable {
    /// Walls of cell c: `ids[start[c]..start[c + 1]]`.
    start: Vec<u32>,
    ids: Vec<u16>,
}

impl WallTable {
    /// The table of a grid with `n` cells per axis of these widths. `radius` is the largest distance between
    /// the cell of a particle and a wall that the particle touches \[length\].
    pub fn new(geometry: &Geometry, n: [i32; 3], width: [f64; 3], radius: f64) -> Self {
        if geometry.planes.is_empty() {
            return Self::default();
        }
        let [nx, ny, nz] = n.map(|n| n as usize);
        let beyond = beyond_faces(geometry.axes, geometry.size, &geometry.planes);
        let lists: Vec<Vec<u16>> = (0..nx * ny * nz)
            .into_par_iter()
            .map(|index| {
                let cell = [index % nx, index / nx % ny, index / (nx * ny)];
                let edges = [0, 1, 2].map(|axis| {
                    let [below, above] = beyond[axis];
                    let low = cell[axis] as f64 * width[axis];
                    let high = low + width[axis];
                    let is_last = cell[axis] + 1 == n[axis] as usize;
                    [
                        if cell[axis] == 0 { low - below } else { low },
                        if is_last { high + above } else { high },
                    ]
                });
                let near = |plane: &Plane| is_near(geometry.axes, edges, plane, radius);
                (0..geometry.planes.len() as u16)
                    .filter(|&wall| near(&geometry.planes[wall as usize]))
                    .collect()
            })
            .collect();
        let mut table = Self { start: Vec::with_capacity(lists.len() + 1), ids: Vec::new() };
        table.start.push(0);
        for list in lists {
            table.ids.extend(list);
            table.start.push(table.ids.len() as u32);
        }
        table
    }

    /// Whether there are no walls at all.
    #[inline]
    pub fn is_empty(&self) -> bool {
        self.start.is_empty()
    }

    /// Walls of a cell; the table must not be empty.
    #[inline]
    pub fn of(&self, cell: usize) -> &[u16] {
        &self.ids[self.start[cell] as usize..self.start[cell + 1] as usize]
    }
}

/// How far the walls of a box with these edges let particles go beyond its faces, lower and upper, along each
/// axis \[length\]: walls may be displaced, and oscillate. Infinite where a wall moves on and on: particles
/// that follow it can touch others there, which are oblique.
pub fn beyond_faces(axes: [Axis; 3], size: DVec3, planes: &[Plane]) -> [[f64; 2]; 3] {
    [0, 1, 2].map(|axis| {
        if axes[axis] != Axis::Bounded {
            return [0.0; 2];
        }
        [(1.0, 0.0), (-1.0, size[axis])].map(|(side, face)| {
            let is_face = |plane: &&Plane| plane.surface.is_none() && plane.normal[axis] == side;
            let planes = planes.iter().filter(is_face);
            planes.map(|plane| (face - plane.point[axis]) * side + plane.sweep).fold(0.0, f64::max)
        })
    })
}

/// Whether a plane is at most `radius` from a cell with these edges, rounding included.
fn is_near(axes: [Axis; 3], edges: [[f64; 2]; 3], plane: &Plane, radius: f64) -> bool {
    if plane.sweep == f64::INFINITY {
        return true;
    }
    if plane.surface.is_some() {
        if !plane.repeats(axes) {
            // The cell represents all its images.
            return true;
        }
        let [low, high] = [0, 1].map(|end| DVec3::from_array(edges.map(|edge| edge[end])));
        // A cell without end has no center.
        let is_endless = !(low.is_finite() && high.is_finite());
        return is_endless || plane.is_near(0.5 * (low + high), 0.5 * (high - low).length(), radius);
    }
    let normal = plane.normal.to_array();
    let point = plane.point.to_array();
    let mut distance = 0.0;
    let mut slack = radius + plane.sweep;
    for axis in 0..3 {
        if normal[axis] == 0.0 {
            continue;
        }
        if matches!(axes[axis], Axis::Open | Axis::Periodic) {
            // The cell represents all its images.
            return true;
        }
        let [low, high] = edges[axis];
        distance += ((low - point[axis]) * normal[axis]).min((high - point[axis]) * normal[axis]);
        slack += radius.max(high - low) * 1e-9;
    }
    distance <= slack
}
