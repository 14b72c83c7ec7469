//! The exact prediction of one pair, with the same bits as that of [`crate::search::predict`].

use glam::DVec3;
use haff_mechanics::time_to_contact_unscaled;

use crate::{
    model::features::Features,
    motion::pair_flight::PairFlight,
    numerics::clock::{LONGEST, whole},
    search::batch::is_spurious_recontact,
    state::{particle::Particle, world::World},
};

/// The time when two particles with these anchors touch [ticks], for the image that is nearest at present;
/// `None` without contact.
#[inline(always)]
pub(super) fn contact<F: Features>(world: &World, a: &Particle, b: &Particle) -> Option<i64> {
    let PairFlight { from, r, v, sigma2, velocities: [va, vb] } = PairFlight::of::<F>(world, a, b)?;
    let delay = time_to_contact_unscaled(r, v, sigma2)?;
    if is_spurious_recontact(r, v, sigma2, || va.length().max(vb.length())) {
        return None;
    }
    let ticks = delay * world.clock.per_time;
    (ticks <= LONGEST).then(|| from + whole(ticks))
}

/// The time when a particle with this anchor touches a wall [ticks]; `None` without contact.
#[inline(always)]
pub(super) fn wall_contact<F: Features>(
    world: &World,
    anchor: &Particle,
    radius: f64,
    wall: u32,
) -> Option<i64> {
    let acceleration = if F::GRAVITY { world.gravity } else { DVec3::ZERO };
    let ticks = world.wall_contact(anchor, radius, acceleration, wall)?;
    (ticks <= LONGEST).then(|| anchor.time + whole(ticks))
}
