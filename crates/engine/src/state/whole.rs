//! The whole state of a run.

use std::collections::BTreeMap;

use glam::DVec3;

use crate::{
    report::sample::BlockCounts,
    state::{
        accumulators::Accumulators, population::Population, settling::SettlingState, stall::Stall,
        world::World,
    },
};

/// The state of a simulation, without the data of its scheduler.
#[derive(Debug, Clone)]
pub(crate) struct State {
    pub world: World,
    pub accumulators: Accumulators,
    /// Completed series of bounces by particle.
    pub pending: BTreeMap<u32, Pending>,
    pub stall: Stall,
    pub settling: SettlingState,
    /// Which particles are there, where they come and go.
    pub population: Option<Box<Population>>,
    /// How threads have taken events; not part of what is saved.
    pub blocks: BlockCounts,
}

impl State {
    /// Whether nothing moves and no completed series of bounces is pending.
    pub fn is_at_rest(&self) -> bool {
        self.pending.is_empty() && self.world.is_at_rest()
    }
}

/// A completed series of bounces that has not ended yet.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Pending {
    /// End of the series [ticks].
    pub end: i64,
    pub wall: u32,
    /// Approach speed of the first bounce that is not computed [length/time].
    pub speed: f64,
    /// Sums over all bounces that are not computed.
    pub impulse: f64,
    pub energy_loss: f64,
    pub carnot_energy: f64,
    /// Tangential impulse on the wall, and the part of the loss that is due to it.
    pub tangential: DVec3,
    pub tangential_loss: f64,
}
