//! Initial positions of the species: lattices and random packings that avoid walls, planes and the particles
//! placed by hand.

pub(crate) mod growth;
pub(crate) mod lattice;
pub(crate) mod loose;

use glam::DVec3;
use haff_engine::{Boundary, Dimension, Domain, Wall};

use crate::placement::grid::{Grid, Periods};

/// The region and obstacles of a packing.
pub(crate) struct Room<'a> {
    pub(crate) dimension: Dimension,
    pub(crate) domain: &'a Domain,
    /// Planes beside the faces of the domain.
    pub(crate) planes: &'a [Wall],
    /// Centres and radii of particles that are already there.
    pub(crate) obstacles: &'a [(DVec3, f64)],
}

impl Room<'_> {
    /// Range of the centres of spheres of this radius along an axis, or `None` if none fits. Along open axes,
    /// which have no faces, packings are placed between placeholder faces.
    fn span(&self, axis: usize, radius: f64) -> Option<[f64; 2]> {
        let length = self.domain.size[axis];
        if axis >= self.dimension.count() {
            Some([0.0, 0.0])
        } else if self.domain.boundary[axis] == Boundary::Periodic {
            Some([0.0, length])
        } else {
            (length >= 2.0 * radius).then_some([radius, length - radius])
        }
    }

    fn behind_a_plane(&self, position: DVec3, radius: f64) -> bool {
        self.planes.iter().any(|plane| match &plane.shape {
            Some(shape) => shape.surface().distance(position) < radius,
            None => (position - plane.point).dot(plane.normal) < radius,
        })
    }
}

/// The obstacles of a region in a grid for queries of particles up to a radius.
struct Obstacles<'a> {
    grid: Grid,
    all: &'a [(DVec3, f64)],
    periods: Periods,
    level_radius: f64,
}

impl<'a> Obstacles<'a> {
    /// `radius`: the largest of any query.
    fn new(room: &Room<'a>, radius: f64) -> Self {
        let levels: Vec<f64> = room.obstacles.iter().map(|o| o.1.max(radius)).collect();
        let periods = Periods::new(room.domain);
        let mut grid = Grid::new(&levels, 0.0, periods);
        for (k, obstacle) in room.obstacles.iter().enumerate() {
            grid.insert(k, obstacle.0);
        }
        Self { grid, all: room.obstacles, periods, level_radius: radius }
    }

    fn blocks(&self, position: DVec3, radius: f64) -> bool {
        if self.all.is_empty() {
            return false;
        }
        let mut blocked = false;
        self.grid.visit(position, self.level_radius, |j| {
            let (centre, other) = self.all[j];
            blocked = self.periods.nearest(centre - position).length() < radius + other;
            !blocked
        });
        blocked
    }
}
