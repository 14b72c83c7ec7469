//! What the frames of windows and of lists in a box that deforms have in common: their axes, and how the box
//! deforms along them.

use glam::DVec3;

use crate::{
    model::System,
    state::{
        deformation::{Deformation, HORIZON},
        world::World,
    },
};

/// By how much a simple shear of this amount stretches a vector at most: the norm of (1, a; 0, 1).
#[inline(always)]
pub(crate) fn stretch_of_shear(amount: f32) -> f32 {
    let half = 0.5 * amount.abs();
    half + (1.0 + half * half).sqrt()
}

/// The axes of a frame that deforms with the box.
#[derive(Debug, Clone, Copy)]
pub(crate) struct MovingAxes {
    /// The axes of the flow, of the gradient, and the third one; without shear x, y, z.
    pub order: [usize; 3],
    images: Deformation,
    /// γ̇ [1/time].
    pub rate: f64,
    /// Edge along the flow by that along the gradient, and the latter \[length\].
    pub ratio: f64,
    pub height: f64,
}

impl MovingAxes {
    pub fn of(system: &System) -> Option<Self> {
        let images = Deformation::of(system)?;
        let (flow, gradient) = images.sliding.map_or((0, 1), |shear| (shear.flow, shear.gradient));
        let size = system.domain.size;
        Some(Self {
            order: [flow, gradient, 3 - flow - gradient],
            images,
            rate: images.sliding.map_or(0.0, |shear| shear.rate),
            ratio: size[flow] / size[gradient],
            height: size[gradient],
        })
    }

    /// The components of a vector in the order of the axes.
    #[inline(always)]
    pub fn ordered(&self, vector: DVec3) -> [f64; 3] {
        self.order.map(|axis| vector[axis])
    }

    /// Whether edges become shorter or longer.
    #[inline(always)]
    pub fn stretches(&self) -> bool {
        self.images.stretches()
    }

    /// By how much edges can be shorter than when the search was made, until it is made again.
    pub fn shortest(&self) -> f64 {
        if self.stretches() { 1.0 - HORIZON } else { 1.0 }
    }

    /// The diagonal of G at `ticks` [1/time], in the order of the axes.
    pub fn diagonal(&self, world: &World, ticks: i64) -> [f64; 3] {
        self.ordered(self.images.rates / self.images.scale(world.clock.time(ticks)))
    }

    /// The edges at `ticks` along the axes on which they change \[length\]: those of the world, because the
    /// system of a search has the edges at which it was made.
    pub fn changed_edges(&self, world: &World, ticks: i64) -> [Option<f64>; 3] {
        let edges = world.periodicity(ticks).size;
        self.order.map(|axis| (self.images.rates[axis] != 0.0).then_some(edges[axis]))
    }

    /// k at `ticks`: the displacement of images by the edge along the gradient.
    pub fn tilt(&self, world: &World, ticks: i64) -> f64 {
        world.displacement(ticks).offset / self.height
    }
}
