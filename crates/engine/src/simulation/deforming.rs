//! Simulations of boxes that deform: searches for the present edges.

use glam::DVec3;

use crate::{
    measure::sample::packing_fraction,
    model::Boundary,
    numerics::error::EngineError,
    report::Compressed,
    simulation::run::Simulation,
    state::deformation::{Deformation, until_boundary},
    support::geometry::present_system,
};

impl Simulation {
    /// Whether edges become shorter or longer.
    pub(super) fn stretches(&self) -> bool {
        self.state.world.boundary.deformation.is_some_and(|images| images.stretches())
    }

    /// Whether particles in a box that expands hardly move relative to each other any more. No search tells
    /// this: some have nothing to do earlier than others.
    pub(super) fn is_frozen(&self) -> bool {
        /// Of an edge, which becomes longer and longer.
        const PATH: f64 = 1e-9;
        let world = &self.state.world;
        let Some(images) = world.boundary.deformation.filter(Deformation::stretches) else {
            return false;
        };
        let speeds = (0..world.particles.len() as u32)
            .map(|i| world.peculiar(i, world.now).1.abs())
            .fold(DVec3::ZERO, DVec3::max);
        let time = world.clock.time(world.now);
        images.path_left(speeds, time) < PATH * images.edges(time).min_element()
    }

    /// Until when searches may be used that are made now, since walls move with the edges of the box [ticks]:
    /// coordinates of windows reach two edges far.
    pub(super) fn horizon_of_walls(&self) -> i64 {
        let (domain, world) = (&self.system.domain, &self.state.world);
        let Some(compression) = domain.compression else { return i64::MAX };
        let time = world.clock.time(world.now);
        let walled =
            (0..self.system.dimension.count()).filter(|&axis| domain.boundary[axis] == Boundary::Wall);
        let delay =
            walled.map(|axis| until_boundary(-compression.rates[axis], time)).fold(f64::INFINITY, f64::min);
        if delay == f64::INFINITY { i64::MAX } else { world.after(delay) }
    }

    /// What a box that is compressed is like, over the time since the previous call; `None` if it is not. Of
    /// flights that go on, what is after the last sample counts the next time.
    pub fn take_compressed(&mut self) -> Option<Compressed> {
        self.system.domain.compression?;
        let taken = self.state.accumulators.take_compressed();
        Some(Compressed {
            dimension: self.system.dimension,
            packing_fraction: packing_fraction(&self.system, &self.state.world, self.time()),
            reduced_pressure: taken.map_or(f64::NAN, |[virial, thermal]| 1.0 + virial / thermal),
        })
    }

    /// Makes the search again for the present edges of a box that deforms.
    #[cold]
    pub(super) fn renew(&mut self) -> Result<(), EngineError> {
        let world = &self.state.world;
        let time = world.clock.time(world.now);
        let short = world.boundary.deformation.as_ref().and_then(|images| images.too_short(time));
        if let Some((axis, edge)) = short {
            return Err(EngineError::ShortEdge { time, axis, edge });
        }
        if world.shear().is_some() {
            self.predict_all();
            return Ok(());
        }
        let system = present_system(&self.system, world);
        // Also for the same search, which has been made for other edges.
        self.choice.renew(&system, world);
        drop(system);
        self.compile();
        Ok(())
    }
}
