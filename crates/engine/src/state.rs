//! What a scheduler works on: the particles, the accumulators and what else decides about events to come.

use std::collections::BTreeMap;

use crate::{accumulators::Accumulators, particles::World, rest::state::SettlingState, stall::Stall};

/// The state of a simulation, without the data of its scheduler.
#[derive(Debug, Clone)]
pub(crate) struct State {
    pub world: World,
    pub accumulators: Accumulators,
    pub pending: BTreeMap<u32, Pending>,
    pub stall: Stall,
    pub settling: SettlingState,
}

impl State {
    /// Whether nothing moves and no series of bounces is still to be booked.
    pub fn is_at_rest(&self) -> bool {
        self.pending.is_empty() && self.world.is_at_rest()
    }
}

/// A completed series of bounces, up to its end.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Pending {
    /// When the series ends [ticks].
    pub end: i64,
    pub wall: u32,
    /// Approach speed of the first bounce left out [length/time].
    pub speed: f64,
    /// Sums over the bounces left out.
    pub impulse: f64,
    pub energy_loss: f64,
    pub carnot_energy: f64,
}
