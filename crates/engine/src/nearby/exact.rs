//! The exact prediction of one pair: the same bits as [`crate::packed`] has for it.

use glam::DVec3;
use haff_mechanics::{drift, is_rounding_noise};

use crate::{
    clock::{LONGEST, whole},
    machine::Features,
    particles::{Particle, World},
    predict::TOUCHING,
};

/// When two particles with these anchors touch.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Contact {
    Never,
    /// Further from the later anchor than can be told in ticks.
    Far,
    /// At this time [ticks].
    At(i64),
}

/// When two particles with these anchors touch, for the image that is nearest now.
#[inline(always)]
#[expect(clippy::neg_cmp_op_on_partial_ord, reason = "what is not a number goes the way of the kernel")]
pub(super) fn contact<F: Features>(world: &World, a: &Particle, b: &Particle) -> Contact {
    let sigma = if F::UNIFORM {
        let radius = world.classes[0].radius;
        radius + radius
    } else {
        world.classes[a.class()].radius + world.classes[b.class()].radius
    };
    let tick = world.clock.tick;
    // The earlier anchor is carried on to the later one.
    let behind = a.time - b.time;
    let dt = behind.abs() as f64 * tick;
    let (dt_a, dt_b) = if behind < 0 { (dt, 0.0) } else { (0.0, dt) };
    let apart = drift(b.position, b.velocity, dt_b) - drift(a.position, a.velocity, dt_a);
    let v = b.velocity - a.velocity;
    let from = a.time.max(b.time);
    let here = apart + v * ((world.now - from) as f64 * tick);
    // A whole number of lengths, added as one product, as everywhere; 0 · L changes nothing.
    let shift = |axis: usize| -round(here[axis] * world.per_size[axis]) * world.size[axis];
    let r = apart + DVec3::new(shift(0), shift(1), shift(2));
    let ss = sigma * sigma;
    // As in `batch::delay`, without what is not needed.
    let b_ = r.dot(v);
    if !(b_ < 0.0) {
        return Contact::Never;
    }
    let rr = r.length_squared();
    let gap = rr - ss;
    let mut delay = 0.0;
    if gap > 0.0 {
        let vv = v.length_squared();
        let disc = vv * ss - r.cross(v).length_squared();
        if !(disc >= 0.0) {
            return Contact::Never;
        }
        let den = disc.sqrt() - b_;
        delay = if gap * vv > -b_ * den { -b_ / vv } else { gap / den };
    }
    if rr <= ss * (1.0 + TOUCHING)
        && is_rounding_noise(r, v, a.velocity.length().max(b.velocity.length()))
    {
        return Contact::Never;
    }
    let ticks = delay * world.clock.per_time;
    if ticks <= LONGEST { Contact::At(from + whole(ticks)) } else { Contact::Far }
}

/// Nearest integer, by the rounding of an addition; |x| < 2^51.
#[inline(always)]
fn round(x: f64) -> f64 {
    const MAGIC: f64 = 6_755_399_441_055_744.0; // 1.5 · 2^52
    (x + MAGIC) - MAGIC
}
