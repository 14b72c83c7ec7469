//! The relative flight of two particles with one acceleration, from the later one of their anchors.

use glam::DVec3;
use haff_mechanics::{drift, free_flight, free_flight_velocity, is_rounding_noise, time_to_contact_unscaled};

use crate::{
    model::features::Features,
    numerics::clock::{LONGEST, whole},
    state::{particle::Particle, world::World},
};

/// A pair with r² ≤ σ² (1 + `TOUCHING`) touches within the rounding errors of its positions.
pub(crate) const TOUCHING: f64 = 64.0 * f64::EPSILON;

/// Whether a predicted contact only repeats the last impact, usually one with e = 0: the pair touches within
/// the rounding errors of its positions, and its speed of approach is within the rounding error of its
/// velocities. `speed` returns the larger speed of the two particles [length/time].
#[inline(always)]
pub(crate) fn is_spurious_recontact(r: DVec3, v: DVec3, sigma2: f64, speed: impl FnOnce() -> f64) -> bool {
    r.length_squared() <= sigma2 * (1.0 + TOUCHING) && is_rounding_noise(r, v, speed())
}

/// Relative position and velocity, b − a, at the time of the later anchor.
pub(crate) struct PairFlight {
    /// Time of the later anchor [ticks].
    pub from: i64,
    /// For the image that is the nearest at present [length].
    pub r: DVec3,
    pub v: DVec3,
    /// Square of the contact distance [length²].
    pub sigma2: f64,
    /// Velocities of both at this time [length/time].
    pub velocities: [DVec3; 2],
}

impl PairFlight {
    /// `None` for two bodies of infinite mass, which pass through each other. Without a branch that is hard
    /// to predict: a processor overlaps the predictions of two pairs.
    #[inline(always)]
    pub fn of<F: Features>(world: &World, a: &Particle, b: &Particle) -> Option<Self> {
        let sigma = if F::UNIFORM {
            let radius = world.classes[0].radius;
            radius + radius
        } else {
            let (a, b) = (&world.classes[a.class()], &world.classes[b.class()]);
            if a.inverse_mass + b.inverse_mass == 0.0 {
                return None;
            }
            a.radius + b.radius
        };
        let tick = world.clock.tick;
        // The earlier anchor is moved to the time of the later one.
        let lag = a.time - b.time;
        let (dt_a, dt_b) = ((-lag).max(0) as f64 * tick, lag.max(0) as f64 * tick);
        let (ra, rb, va, vb);
        if F::GRAVITY {
            let g = world.gravity;
            ra = free_flight(a.position, a.velocity, g, dt_a);
            rb = free_flight(b.position, b.velocity, g, dt_b);
            va = free_flight_velocity(a.velocity, g, dt_a);
            vb = free_flight_velocity(b.velocity, g, dt_b);
        } else {
            ra = drift(a.position, a.velocity, dt_a);
            rb = drift(b.position, b.velocity, dt_b);
            (va, vb) = (a.velocity, b.velocity);
        }
        let (separation, v) = (rb - ra, vb - va);
        let from = a.time.max(b.time);
        let present = separation + v * ((world.now - from) as f64 * tick);
        let sigma2 = sigma * sigma;
        if F::DEFORMS {
            let (r, v) = world.image_of_present(separation, v, present, from);
            return Some(Self { from, r, v, sigma2, velocities: [va, vb] });
        }
        let r = separation + world.boundary.periodicity.offset(present);
        Some(Self { from, r, v, sigma2, velocities: [va, vb] })
    }
}

/// The time when two particles with these anchors touch [ticks], for the image that is nearest at present;
/// `None` without contact.
#[inline(always)]
pub(crate) fn contact<F: Features>(world: &World, a: &Particle, b: &Particle) -> Option<i64> {
    let PairFlight { from, r, v, sigma2, velocities: [va, vb] } = PairFlight::of::<F>(world, a, b)?;
    let delay = time_to_contact_unscaled(r, v, sigma2)?;
    if is_spurious_recontact(r, v, sigma2, || va.length().max(vb.length())) {
        return None;
    }
    let ticks = delay * world.clock.per_time;
    (ticks <= LONGEST).then(|| from + whole(ticks))
}
