//! Lower bounds on the distance from a mesh, by cells.

use glam::DVec3;

/// Most cells along an axis.
const MOST: f64 = 64.0;
/// Approximate number of cells per triangle.
const PER_TRIANGLE: f64 = 16.0;
/// Fewest cells, of a mesh with few triangles.
const FEWEST: f64 = 32_768.0;

/// How far each cell of a grid is at least from a mesh: most positions need no more to be known as far away.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Clearance {
    low: DVec3,
    /// Cells per length along each axis [1/length].
    per_length: DVec3,
    counts: [usize; 3],
    /// Lower bounds of the distance, along x first \[length\].
    bounds: Vec<f32>,
}

impl Clearance {
    /// The bounds in a box, from the `distance` of a position.
    pub fn new([low, high]: [DVec3; 2], triangles: usize, distance: impl Fn(DVec3) -> f64) -> Self {
        let size = high - low;
        let cells = (PER_TRIANGLE * triangles as f64).clamp(FEWEST, MOST.powi(3));
        // Of equal edges, as far as the box allows it.
        let edge = size.max_element() / cells.cbrt();
        let counts = size.to_array().map(|size| (size / edge).ceil().clamp(1.0, MOST) as usize);
        let along = DVec3::from_array(counts.map(|count| count as f64));
        let width = size / along;
        let half = 0.5 * width.length();
        let mut bounds = Vec::with_capacity(counts.iter().product());
        for z in 0..counts[2] {
            for y in 0..counts[1] {
                for x in 0..counts[0] {
                    let cell = DVec3::new(x as f64, y as f64, z as f64);
                    let bound = (distance(low + (cell + 0.5) * width) - half) * (1.0 - 1e-6);
                    bounds.push((bound as f32).next_down());
                }
            }
        }
        Self { low, per_length: along / size, counts, bounds }
    }

    /// A distance that a position certainly has from the mesh \[length\]; none outside the grid.
    #[inline]
    pub fn at(&self, position: DVec3) -> Option<f64> {
        let place = (position - self.low) * self.per_length;
        let [nx, ny, nz] = self.counts;
        // False for what is not a number.
        let is_inside = place.cmpge(DVec3::ZERO).all()
            && place.x < nx as f64
            && place.y < ny as f64
            && place.z < nz as f64;
        if !is_inside {
            return None;
        }
        let [x, y, z] = place.to_array().map(|place| place as usize);
        self.bounds.get((z * ny + y) * nx + x).map(|&bound| f64::from(bound))
    }
}
