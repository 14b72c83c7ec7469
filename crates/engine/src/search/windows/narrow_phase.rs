//! Exact predictions of pairs and of contacts with walls, with the same bits as those of
//! [`crate::search::predict`].

use glam::DVec3;

pub(super) use crate::motion::pair_flight::contact;
use crate::{
    model::features::Features,
    numerics::clock::{LONGEST, whole},
    state::{particle::Particle, world::World},
};

/// The time when a particle with this anchor touches a wall [ticks]; `None` without contact `within` a time
/// \[time\] from the anchor.
#[inline(always)]
pub(super) fn wall_contact<F: Features>(
    world: &World,
    anchor: &Particle,
    radius: f64,
    wall: u32,
    within: f64,
) -> Option<i64> {
    let acceleration = if F::GRAVITY { world.gravity } else { DVec3::ZERO };
    let ticks = world.wall_contact(anchor, radius, acceleration, wall, within)?;
    (ticks <= LONGEST).then(|| anchor.time + whole(ticks))
}
