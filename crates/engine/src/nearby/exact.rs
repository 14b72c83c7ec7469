//! The exact prediction of one pair: the same bits as [`crate::packed`] has for it.

use glam::DVec3;
use haff_mechanics::{drift, is_rounding_noise};

use crate::{
    batch::TOUCHING,
    clock::{LONGEST, whole},
    features::Features,
    particles::{Particle, World},
};

/// No contact.
pub(super) const NEVER: i64 = i64::MAX;
/// A contact further from the later anchor than can be told in ticks.
pub(super) const FAR: i64 = i64::MAX - 1;

/// When two particles with these anchors touch [ticks], for the image that is nearest now; [`NEVER`] or
/// [`FAR`].
///
/// Without a branch that is taken one time and not another, so that the predictions of two pairs overlap in
/// the processor.
#[expect(clippy::neg_cmp_op_on_partial_ord, reason = "what is not a number goes the way of the kernel")]
#[expect(clippy::needless_bitwise_bool, reason = "no branches")]
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
    // The earlier anchor is carried on to the later one.
    let behind = a.time - b.time;
    let (dt_a, dt_b) = ((-behind).max(0) as f64 * tick, behind.max(0) as f64 * tick);
    let apart = drift(b.position, b.velocity, dt_b) - drift(a.position, a.velocity, dt_a);
    let v = b.velocity - a.velocity;
    let from = a.time.max(b.time);
    let here = apart + v * ((world.now - from) as f64 * tick);
    let r = apart + world.periodicity.offset(here);
    let ss = sigma * sigma;
    // As `batch::delay` has it.
    let approach = r.dot(v);
    let (rr, vv) = (r.length_squared(), v.length_squared());
    let gap = rr - ss;
    let disc = vv * ss - r.cross(v).length_squared();
    let den = disc.max(0.0).sqrt() - approach;
    let beyond = gap * vv > -approach * den;
    let delay = (if beyond { -approach } else { gap }) / (if beyond { vv } else { den });
    let delay = if gap > 0.0 { delay } else { 0.0 };
    let meets = (approach < 0.0) & ((disc >= 0.0) | !(gap > 0.0));
    if meets && rr <= ss * (1.0 + TOUCHING) && is_echo(r, v, a, b) {
        return NEVER;
    }
    let ticks = delay * world.clock.per_time;
    let far = if meets { FAR } else { NEVER };
    if meets & (ticks <= LONGEST) { from + whole(ticks.min(LONGEST)) } else { far }
}

/// Whether a pair that touches approaches by rounding alone.
#[cold]
fn is_echo(r: DVec3, v: DVec3, a: &Particle, b: &Particle) -> bool {
    is_rounding_noise(r, v, a.velocity.length().max(b.velocity.length()))
}
