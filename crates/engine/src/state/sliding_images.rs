//! The images of a sheared box, which move along the flow.

use glam::DVec3;

use crate::{model::System, numerics::instant::Instant};

/// The images of a sheared box.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct SlidingImages {
    pub flow: usize,
    pub gradient: usize,
    /// γ̇ [1/time].
    pub rate: f64,
    /// Velocity of the image across the upper face [length/time].
    pub speed: f64,
    /// Edge length along the flow \[length\], and along the gradient.
    pub length: f64,
    pub height: f64,
    /// Displacement of that image at time 0, and its change in a unit of time \[edges\].
    start: f64,
    frequency: f64,
}

/// Displacement of the image across the upper face along the flow: `turns` edges and `offset` \[length\],
/// which is at most half an edge.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Displacement {
    pub turns: i64,
    pub offset: f64,
}

impl SlidingImages {
    pub fn of(system: &System) -> Option<Self> {
        let shear = system.domain.shear?;
        let (length, height) = (system.domain.size[shear.flow], system.domain.size[shear.gradient]);
        let speed = shear.rate * height;
        Some(Self {
            flow: shear.flow,
            gradient: shear.gradient,
            rate: shear.rate,
            speed,
            length,
            height,
            start: shear.offset / length,
            frequency: speed / length,
        })
    }

    /// The displacement at a time.
    pub fn at(&self, time: Instant) -> Displacement {
        let (whole, part) = time.turns(self.frequency);
        let edges = part + self.start;
        let more = edges.round_ties_even();
        Displacement { turns: (whole + more) as i64, offset: (edges - more) * self.length }
    }

    /// Velocity of the flow at a position [length/time].
    pub fn velocity(&self, position: DVec3) -> DVec3 {
        DVec3::AXES[self.flow] * (self.rate * position[self.gradient])
    }

    /// The force that changes the sum of peculiar momenta by which the particles have this `momentum` across
    /// the flow: −γ̇ P_y along the flow.
    pub fn force(&self, momentum: DVec3) -> DVec3 {
        DVec3::AXES[self.flow] * (-self.rate * momentum[self.gradient])
    }

    /// Moves a position into the box along the gradient, and as far along the flow as that image is displaced
    /// at `time`. Along the flow it can be outside of the box.
    pub fn fold(&self, mut position: DVec3, time: Instant) -> DVec3 {
        let up = (position[self.gradient] / self.height).floor();
        if up != 0.0 {
            position[self.gradient] -= up * self.height;
            position[self.flow] -= up * self.at(time).offset;
        }
        position
    }
}
