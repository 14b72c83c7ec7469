//! The exact prediction of one pair, with the same bits as that of [`crate::predict`].

use glam::DVec3;
use haff_mechanics::time_to_contact_unscaled;

use crate::{
    batch::is_spurious_recontact,
    clock::{LONGEST, whole},
    features::Features,
    particles::{Particle, World},
};

/// The time when two particles with these anchors touch [ticks], for the image that is nearest at present;
/// `None` without contact.
#[inline(always)]
pub(super) fn contact<F: Features>(world: &World, a: &Particle, b: &Particle) -> Option<i64> {
    let sigma = if F::UNIFORM {
        let radius = world.classes[0].radius;
        radius + radius
    } else {
        let (a, b) = (&world.classes[a.class()], &world.classes[b.class()]);
        if a.inverse_mass + b.inverse_mass == 0.0 {
            return None; // Two bodies of infinite mass pass through each other.
        }
        a.radius + b.radius
    };
    let tick = world.clock.tick;
    // The earlier anchor is moved to the time of the later one, without a branch that could not be predicted.
    let lag = a.time - b.time;
    let (dt_a, dt_b) = ((-lag).max(0) as f64 * tick, lag.max(0) as f64 * tick);
    let (ra, rb, va, vb);
    if F::GRAVITY {
        // Both particles have the same acceleration, so that their relative motion is straight.
        let g = world.gravity;
        ra = haff_mechanics::free_flight(a.position, a.velocity, g, dt_a);
        rb = haff_mechanics::free_flight(b.position, b.velocity, g, dt_b);
        va = haff_mechanics::free_flight_velocity(a.velocity, g, dt_a);
        vb = haff_mechanics::free_flight_velocity(b.velocity, g, dt_b);
    } else {
        ra = haff_mechanics::drift(a.position, a.velocity, dt_a);
        rb = haff_mechanics::drift(b.position, b.velocity, dt_b);
        (va, vb) = (a.velocity, b.velocity);
    }
    let (apart, v) = (rb - ra, vb - va);
    let from = a.time.max(b.time);
    // The image that is the nearest now. Gravity moves both alike.
    let now = apart + v * ((world.now - from) as f64 * tick);
    let r = apart + world.periodicity.offset(now);
    let delay = time_to_contact_unscaled(r, v, sigma * sigma)?;
    if is_spurious_recontact(r, v, sigma * sigma, || va.length().max(vb.length())) {
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
