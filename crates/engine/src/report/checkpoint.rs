//! All that a run needs to go on.

use glam::DVec3;

/// The exact state, sufficient for a bitwise identical continuation with the same [`crate::System`].
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Checkpoint {
    /// Anchor positions [length].
    pub position: Vec<DVec3>,
    /// Velocities [length/time].
    pub velocity: Vec<DVec3>,
    /// Anchor times [ticks since the epoch's start]; the least integer for a particle that is not there.
    pub anchor: Vec<i64>,
    /// Box images of the anchors.
    pub image: Vec<[i32; 3]>,
    /// Numbers of own events.
    pub count: Vec<u32>,
    /// Angular velocities [1/time], of a grain that slides when its slide began; empty without spin.
    pub angular_velocity: Vec<DVec3>,
    /// The walls that support a particle, as digits that are their indices plus one, and two flags: asleep
    /// and recently hit. 0 for a particle in free flight.
    pub resting: Vec<u32>,
    /// Scalars as (name, bits): clock, sums, counters. Names are stable; an unknown name is an error.
    pub scalars: Vec<(String, u64)>,
    /// Ticks of the last contacts, if a law depends on them, and data of the measurements, as bits of numbers
    /// in their order.
    pub measured: Vec<u64>,
}
