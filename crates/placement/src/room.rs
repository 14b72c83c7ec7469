//! Initial positions of the species: lattices and random packings that avoid walls, planes and the particles
//! placed by hand.

use glam::DVec3;
use haff_engine::{Boundary, Dimension, Domain, Instant, Wall};
use haff_mechanics::Surface;

use crate::grid::{Grid, Periods};

/// Where the particles of a species are.
#[derive(Debug)]
pub enum Region {
    /// Between two corners [length].
    Cuboid {
        /// The lower one.
        low: DVec3,
        /// The upper one.
        high: DVec3,
    },
    /// Inside of a surface.
    Inside(Box<dyn Surface>),
}

impl Region {
    /// Signed distance of a position from its boundary [length], outside at most that.
    pub(crate) fn distance(&self, position: DVec3) -> f64 {
        match self {
            Self::Cuboid { low, high } => (position - *low).min(*high - position).min_element(),
            Self::Inside(surface) => surface.distance(position),
        }
    }

    /// The direction in which the distance grows.
    pub(crate) fn normal(&self, position: DVec3) -> DVec3 {
        match self {
            Self::Cuboid { low, high } => {
                let (below, above) = (position - *low, *high - position);
                let nearest = |depth: DVec3| {
                    (0..3).fold(0, |least, axis| if depth[axis] < depth[least] { axis } else { least })
                };
                let (a, b) = (nearest(below), nearest(above));
                if below[a] < above[b] { DVec3::AXES[a] } else { -DVec3::AXES[b] }
            }
            Self::Inside(surface) => surface.normal(position),
        }
    }

    /// Lower and upper corner of a box around it; infinite if it has no end.
    pub(crate) fn bounds(&self) -> (DVec3, DVec3) {
        match self {
            Self::Cuboid { low, high } => (*low, *high),
            Self::Inside(surface) => {
                let (center, extent) = surface.bounds();
                (center - extent, center + extent)
            }
        }
    }
}

/// The room and the obstacles of a packing.
#[derive(Debug)]
pub struct Room<'a> {
    /// 2 or 3.
    pub dimension: Dimension,
    /// The box.
    pub domain: &'a Domain,
    /// Planes beside the faces of the domain.
    pub planes: &'a [Wall],
    /// Centres and radii of particles that are already there.
    pub obstacles: &'a [(DVec3, f64)],
    /// The region of each particle, if it has one; empty if none has.
    pub regions: &'a [Option<&'a Region>],
}

impl Room<'_> {
    /// Range of the centres of spheres of this radius along an axis, or `None` if none fits. Along open axes,
    /// which have no faces, packings are placed between placeholder faces.
    pub(crate) fn span(&self, axis: usize, radius: f64) -> Option<[f64; 2]> {
        let length = self.domain.size[axis];
        if axis >= self.dimension.count() {
            Some([0.0, 0.0])
        } else if self.domain.boundary[axis] == Boundary::Periodic {
            Some([0.0, length])
        } else {
            (length >= 2.0 * radius).then_some([radius, length - radius])
        }
    }

    /// The region of a particle.
    pub(crate) fn region(&self, row: usize) -> Option<&Region> {
        self.regions.get(row).copied().flatten()
    }

    /// [`Self::span`] of a particle, within its region.
    pub(crate) fn span_of(&self, axis: usize, row: usize, radius: f64) -> Option<[f64; 2]> {
        let Some(region) = self.region(row).filter(|_| axis < self.dimension.count()) else {
            return self.span(axis, radius);
        };
        let (low, high) = region.bounds();
        let [mut low, mut high] = [low[axis] + radius, high[axis] - radius];
        if self.domain.boundary[axis] == Boundary::Wall || !low.is_finite() {
            let [first, last] = self.span(axis, radius)?;
            (low, high) = (low.max(first), high.min(last));
        }
        (low <= high).then_some([low, high])
    }

    pub(crate) fn behind_a_plane(&self, position: DVec3, radius: f64) -> bool {
        self.planes.iter().any(|plane| plane.distance(position, Instant::ZERO) < radius)
    }
}

/// The obstacles of a region in a grid for queries of particles up to a radius.
pub(crate) struct Obstacles<'a> {
    grid: Grid,
    all: &'a [(DVec3, f64)],
    periods: Periods,
    level_radius: f64,
}

impl<'a> Obstacles<'a> {
    /// `radius`: the largest of any query.
    pub(crate) fn new(room: &Room<'a>, radius: f64) -> Self {
        let levels: Vec<f64> = room.obstacles.iter().map(|o| o.1.max(radius)).collect();
        let periods = Periods::new(room.domain);
        let mut grid = Grid::new(&levels, 0.0, periods);
        for (k, obstacle) in room.obstacles.iter().enumerate() {
            grid.insert(k, obstacle.0);
        }
        Self { grid, all: room.obstacles, periods, level_radius: radius }
    }

    pub(crate) fn blocks(&self, position: DVec3, radius: f64) -> bool {
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
