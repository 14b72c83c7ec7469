//! Input of a search: the box, the walls and the sizes.

use glam::DVec3;
use haff_mechanics::NamedSurface;

/// Boundary along an axis.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Axis {
    /// The system repeats with the box length L.
    Periodic,
    /// Walls keep the particles within [0, L].
    Bounded,
    /// Particles are not confined.
    Open,
    /// No motion along this axis (z of a plane system).
    Flat,
}

/// A wall.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Plane {
    /// A point on it [length].
    pub point: DVec3,
    /// Unit normal towards the particles.
    pub normal: DVec3,
    /// The largest distance of the wall from this position at any time \[length\]: 0 if it does not move,
    /// infinite if it moves on and on.
    pub sweep: f64,
    /// Its surface, if that is no plane; then `point` is its displacement from where its surface has it.
    pub surface: Option<&'static NamedSurface>,
}

impl Plane {
    /// Whether the wall is the same at all places that one coordinate stands for: along periodic and open
    /// axes.
    pub fn repeats(&self, axes: [Axis; 3]) -> bool {
        let repeating = |axis: &usize| matches!(axes[*axis], Axis::Periodic | Axis::Open);
        let is_same = |axis: usize| match self.surface {
            None => self.normal[axis] == 0.0,
            Some(surface) => surface.get().is_same_along(axis),
        };
        (0..3).filter(repeating).all(is_same)
    }

    /// Whether a surface can come to a distance from some position within `extent` of a center \[length\].
    /// Distances are negative on the other side.
    pub fn is_near(&self, center: DVec3, extent: f64, reach: f64) -> bool {
        let Some(surface) = self.surface else { return true };
        let (surface, center) = (surface.get(), center - self.point);
        let reach = extent + reach + self.sweep;
        let reach = reach + 1e-9 * (reach + center.abs().max_element());
        // The second is slow for meshes, and seldom needed after the first.
        surface.is_near(center, reach) && surface.distance(center) >= -reach
    }
}

/// The box, its walls and the largest sizes.
#[derive(Debug, Clone, PartialEq)]
pub struct Geometry {
    /// Edge lengths L [length]; along open axes only a scale for the cells.
    pub size: DVec3,
    /// Kind of each axis.
    pub axes: [Axis; 3],
    /// Density around the average particle in units of the mean density; 1 if particles fill the box evenly.
    pub crowding: f64,
    /// Largest contact distance of a pair: the largest distance of centers at which two particles touch
    /// [length].
    pub reach: f64,
    /// Largest radius [length].
    pub radius: f64,
    /// Radius of each particle [length]; empty if all have `radius`.
    pub radii: Vec<f64>,
    /// Walls in the order of their indices.
    pub planes: Vec<Plane>,
    /// The images of a box that deforms, for the searches that support them.
    pub deforming: Option<Deforming>,
}

impl Geometry {
    /// Box lengths as an array.
    pub(crate) fn lengths(&self) -> [f64; 3] {
        self.size.to_array()
    }
}

/// Images that move at constant velocities. The edges are those of the [`Geometry`] at `start`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Deforming {
    /// Those of a sheared box.
    pub sliding: Option<Sliding>,
    /// Velocity at which the edge along each axis becomes longer [length/time].
    pub speeds: DVec3,
    /// [ticks]
    pub start: i64,
    /// Length of a tick \[time\].
    pub tick: f64,
    /// Searches are made again at the latest when this time has passed since `start` [time]. All edges are
    /// positive until then. Infinite if none changes.
    pub horizon: f64,
}

impl Deforming {
    /// Time from `start` to `now` \[ticks\] [time].
    pub(crate) fn age(&self, now: i64) -> f64 {
        (now - self.start) as f64 * self.tick
    }

    /// The shortest edge along an axis within the horizon, from that at the start [length].
    pub fn shortest(&self, axis: usize, edge: f64) -> f64 {
        let speed = self.speeds[axis];
        if speed < 0.0 { edge + speed * self.horizon } else { edge }
    }
}

/// The images of a sheared box.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sliding {
    /// Axis of the flow.
    pub flow: usize,
    /// Axis of the gradient.
    pub gradient: usize,
    /// Velocity of the image across the upper face [length/time].
    pub speed: f64,
    /// Its displacement along the flow at the start \[length\], besides `turns` edges.
    pub offset: f64,
    /// Whole edges of its displacement at the start.
    pub turns: i64,
}
