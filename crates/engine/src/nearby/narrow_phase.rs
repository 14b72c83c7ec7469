//! The exact prediction of one pair, with the same bits as the result of [`crate::packed`].

use haff_mechanics::drift;

use crate::{
    batch::{self, is_spurious_recontact},
    clock::{LONGEST, whole},
    features::Features,
    particles::{Particle, World},
};

/// No contact.
pub(super) const NEVER: i64 = i64::MAX;
/// A contact that exists, but is more than [`LONGEST`] ticks after the later anchor.
pub(super) const FAR: i64 = i64::MAX - 1;

/// Time at which two particles with these anchors touch [ticks], for the image that is nearest now, or
/// [`NEVER`] or [`FAR`].
///
/// The code contains no branch that is hard to predict. So the processor can overlap the predictions of two
/// pairs.
#[inline(always)]
pub(super) fn contact<F: Features>(world: &World, a: &Particle, b: &Particle) -> i64 {
    let sigma = if F::UNIFORM {
        let radius = world.classes[0].radius;
        radius + radius
    } else {
        let (a, b) = (&world.classes[a.class()], &world.classes[b.class()]);
        if a.inverse_mass + b.inverse_mass == 0.0 {
            return NEVER; // Two bodies of infinite mass pass through each other.
        }
        a.radius + b.radius
    };
    let tick = world.clock.tick;
    // The earlier anchor is advanced to the time of the later one.
    let behind = a.time - b.time;
    let (dt_a, dt_b) = ((-behind).max(0) as f64 * tick, behind.max(0) as f64 * tick);
    let separation = drift(b.position, b.velocity, dt_b) - drift(a.position, a.velocity, dt_a);
    let v = b.velocity - a.velocity;
    let from = a.time.max(b.time);
    let present = separation + v * ((world.now - from) as f64 * tick);
    let r = separation + world.periodicity.offset(present);
    let ss = sigma * sigma;
    let delay = batch::delay(r.to_array(), v.to_array(), ss);
    if is_spurious_recontact(r, v, ss, || larger_speed(a, b)) {
        return NEVER;
    }
    let ticks = delay * world.clock.per_time;
    let far = if delay < f64::INFINITY { FAR } else { NEVER };
    if ticks <= LONGEST { from + whole(ticks.min(LONGEST)) } else { far }
}

#[cold]
fn larger_speed(a: &Particle, b: &Particle) -> f64 {
    a.velocity.length().max(b.velocity.length())
}
