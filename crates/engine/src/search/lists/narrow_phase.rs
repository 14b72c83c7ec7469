//! The exact prediction of one pair, with the same bits as those of [`crate::search::predict`].

use crate::{
    model::features::Features,
    motion::pair_flight::{PairFlight, is_spurious_recontact},
    numerics::clock::{LONGEST, whole},
    search::batch,
    state::{particle::Particle, world::World},
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
    let Some(PairFlight { from, r, v, sigma2, velocities }) = PairFlight::of::<F>(world, a, b) else {
        return NEVER;
    };
    let delay = batch::delay(r.to_array(), v.to_array(), sigma2);
    let is_spurious = if F::GRAVITY {
        is_spurious_recontact(r, v, sigma2, || velocities[0].length().max(velocities[1].length()))
    } else {
        is_spurious_recontact(r, v, sigma2, || larger_speed(a, b))
    };
    if is_spurious {
        return NEVER;
    }
    let ticks = delay * world.clock.per_time;
    let far = if delay < f64::INFINITY { FAR } else { NEVER };
    if ticks <= LONGEST { from + whole(ticks.min(LONGEST)) } else { far }
}

/// Without gravity the velocities of the anchors are those of the flights: read again in this rare case, they
/// take no registers in the others.
#[cold]
fn larger_speed(a: &Particle, b: &Particle) -> f64 {
    a.velocity.length().max(b.velocity.length())
}
