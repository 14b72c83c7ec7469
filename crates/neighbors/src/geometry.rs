//! What a search knows of the box, the walls and the sizes.

use glam::DVec3;

/// How an axis looks to the search.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Axis {
    /// Repeats with the box length.
    Periodic,
    /// Particles stay within [0, L].
    Bounded,
    /// Particles go anywhere.
    Open,
    /// Nothing ever moves along it (z of a plane system).
    Flat,
}

/// A wall, as far as the search cares.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Plane {
    /// A point of it [length].
    pub point: DVec3,
    /// Unit normal towards the particles.
    pub normal: DVec3,
    /// Whether it moves; then every particle has to mind it.
    pub moving: bool,
}

/// The box, its walls and the largest sizes.
#[derive(Debug, Clone, PartialEq)]
pub struct Geometry {
    /// Edge lengths L [length]; a scale for the cells only along open axes.
    pub size: DVec3,
    /// Kind of each axis.
    pub axes: [Axis; 3],
    /// How many times denser than in the box particles stand around the average one; 1 if they fill it evenly.
    pub crowding: f64,
    /// Largest distance of centres at which a pair touches [length].
    pub reach: f64,
    /// Largest radius [length].
    pub radius: f64,
    /// Radius of each particle [length]; empty if all have `radius`.
    pub radii: Vec<f64>,
    /// Walls in the order of their indices.
    pub planes: Vec<Plane>,
}

impl Geometry {
    /// Box lengths as an array.
    pub(crate) fn lengths(&self) -> [f64; 3] {
        self.size.to_array()
    }

    /// The same box, with neither walls nor sizes of its own.
    pub(crate) fn without_planes(&self) -> Self {
        Self { radii: Vec::new(), planes: Vec::new(), ..*self }
    }
}
