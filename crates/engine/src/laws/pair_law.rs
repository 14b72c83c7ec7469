//! Laws of impact of two particles.
//!
//! To add a law, implement [`PairLaw`] in a file of its own and add an arm to [`resolve`].

use glam::DVec3;
use haff_mechanics::{Impact, NormalContact, Restitution, random::mix, reduced_mass, resolve_contact};

use crate::{
    laws::{hop, resting},
    model::features::Features,
    state::{particle::ClassData, world::World},
};

/// Two particles in contact, before their impact.
#[derive(Debug, Clone, Copy)]
pub(crate) struct PairContact {
    pub bodies: [u32; 2],
    pub classes: [ClassData; 2],
    /// In a box that deforms the second one is that of the image in contact, by `image_velocity` more than
    /// its own.
    pub velocities: [DVec3; 2],
    pub image_velocity: DVec3,
    /// Vector from the first to the second, its length, and the unit vector along it.
    pub r: DVec3,
    pub distance: f64,
    pub n: DVec3,
    /// [ticks]
    pub time: i64,
}

impl PairContact {
    /// Approach speed along the line of centers [length/time].
    #[inline(always)]
    pub fn approach_speed(&self) -> f64 {
        (self.velocities[0] - self.velocities[1]).dot(self.r) / self.distance
    }

    pub fn inverse_masses(&self) -> [f64; 2] {
        self.classes.map(|class| class.inverse_mass)
    }

    /// The coefficient of restitution of this contact.
    #[inline(always)]
    pub fn coefficient<F: Features>(&self, world: &World, law: Restitution) -> f64 {
        let [a, b] = self.classes;
        let (approach_speed, inverse, [i, j]) = (self.approach_speed(), self.inverse_masses(), self.bodies);
        let time = self.time;
        let contact = move || NormalContact {
            approach_speed,
            reduced_mass: reduced_mass(a.inverse_mass.recip(), b.inverse_mass.recip()),
            reduced_radius: a.radius * b.radius / (a.radius + b.radius),
            random: random_bits(world, &[i, j], None, time),
        };
        coefficient::<F>(world, law, approach_speed, self.time, self.bodies, inverse, contact)
    }
}

/// A law of impact of two particles.
pub(crate) trait PairLaw {
    /// Returns the velocities after the impact, and the impact.
    fn resolve<F: Features>(&self, world: &World, contact: &PairContact) -> (DVec3, DVec3, Impact);
}

/// Resolves a contact by the law of the pair.
#[inline(always)]
pub(crate) fn resolve<F: Features>(world: &World, contact: &PairContact) -> (DVec3, DVec3, Impact) {
    let restitution = world.laws.restitution(&contact.classes[0], &contact.classes[1]);
    if F::REST {
        Settling { restitution }.resolve::<F>(world, contact)
    } else {
        Smooth { restitution }.resolve::<F>(world, contact)
    }
}

/// Smooth spheres: the normal component of the relative velocity is reversed and multiplied by the
/// coefficient of restitution.
struct Smooth {
    restitution: Restitution,
}

impl PairLaw for Smooth {
    #[inline(always)]
    fn resolve<F: Features>(&self, world: &World, contact: &PairContact) -> (DVec3, DVec3, Impact) {
        let [wi, wj] = contact.velocities;
        let [inverse_i, inverse_j] = contact.inverse_masses();
        let e = contact.coefficient::<F>(world, self.restitution);
        if F::GRAVITY && !F::UNIFORM && (inverse_i == 0.0 || inverse_j == 0.0) {
            return resolve_on_surface(world, *contact, e);
        }
        resolve_contact(wi, wj, inverse_i, inverse_j, contact.r, e)
    }
}

/// The impact of a grain on a body of infinite mass under gravity, with the coefficient of restitution `e`.
// The contact is passed by value: a reference would put every contact into memory.
#[cold]
fn resolve_on_surface(world: &World, contact: PairContact, e: f64) -> (DVec3, DVec3, Impact) {
    let PairContact { bodies: [i, j], classes: [a, b], velocities, r, n, .. } = contact;
    let radius = if a.inverse_mass == 0.0 { b.radius } else { a.radius };
    let speed = contact.approach_speed();
    let acceleration = (world.acceleration(i) - world.acceleration(j)).dot(n);
    let separation = hop::separation_speed(e, speed, acceleration, radius);
    impact_with_separation(velocities, contact.inverse_masses(), r, e, speed, separation)
}

/// Smooth spheres that can come to rest on each other: repeated contacts are elastic below a speed, and
/// spheres that gravity presses together have a least separation speed.
struct Settling {
    restitution: Restitution,
}

impl PairLaw for Settling {
    #[inline(always)]
    fn resolve<F: Features>(&self, world: &World, contact: &PairContact) -> (DVec3, DVec3, Impact) {
        let &PairContact { bodies: [i, j], velocities, r, n, time, .. } = contact;
        let e = contact.coefficient::<F>(world, self.restitution);
        let speed = contact.approach_speed();
        let acceleration = (world.acceleration(i) - world.acceleration(j)).dot(n);
        let repeated = resting::is_repeated_contact(world, [i, j], time);
        let separation = resting::separation_speed(world, e, speed, acceleration, repeated);
        impact_with_separation(velocities, contact.inverse_masses(), r, e, speed, separation)
    }
}

/// The coefficient of restitution of a contact at `time`; 1 within the contact duration of the TC model.
/// `contact` is the rest of it, for laws that need it.
#[inline(always)]
pub(crate) fn coefficient<F: Features>(
    world: &World,
    law: Restitution,
    speed: f64,
    time: i64,
    bodies: [u32; 2],
    inverse_masses: [f64; 2],
    contact: impl FnOnce() -> NormalContact,
) -> f64 {
    if F::ELASTIC {
        return 1.0;
    }
    // By value: references would put the whole contact into memory (38 instructions).
    if world.laws.tc > 0.0 && is_within_contact_duration(world, time, bodies, inverse_masses) {
        return 1.0;
    }
    law.coefficient_of(speed, contact)
}

/// The random bits of a contact: a hash of the seed, the time and the bodies. A count of events would not do:
/// searches may find contacts of bodies that do not approach, which change nothing else.
pub(crate) fn random_bits(world: &World, bodies: &[u32], wall: Option<u32>, time: i64) -> u64 {
    // Another start than that of the draws of thermal walls and kicks.
    let start = mix(world.seed ^ 0x6861_6666_2072_6573) ^ world.clock.shown(time).to_bits();
    let ids = bodies.iter().map(|&i| world.id(i)).chain(wall.map(|wall| !wall));
    ids.fold(mix(start), |bits, id| mix(bits ^ u64::from(id)))
}

/// Whether one of two bodies had a contact within the contact duration of the TC model before `time`.
#[cold]
#[inline(never)]
fn is_within_contact_duration(world: &World, time: i64, bodies: [u32; 2], inverse: [f64; 2]) -> bool {
    bodies
        .iter()
        .zip(inverse)
        .any(|(&i, inverse)| inverse != 0.0 && world.contact_age(i, time) < world.laws.tc)
}

/// The impact of two bodies with the coefficient of restitution `e`, but at least the separation speed
/// `separation`. `r` points from the first to the second.
pub(crate) fn impact_with_separation(
    [wi, wj]: [DVec3; 2],
    inverse: [f64; 2],
    r: DVec3,
    e: f64,
    speed: f64,
    separation: f64,
) -> (DVec3, DVec3, Impact) {
    // By rounding, bodies may touch that no longer approach: `speed` ≤ 0. Then even e times `speed` is above
    // `speed`, and the impulse would be attractive.
    if separation > speed.max(0.0) {
        return resting::push_apart(inverse, [wi, wj], r.normalize(), speed, separation);
    }
    let e = if separation > e * speed { separation / speed } else { e };
    resolve_contact(wi, wj, inverse[0], inverse[1], r, e)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// By rounding, bodies may touch while they already separate. The law must not attract them.
    #[test]
    fn separating_bodies_do_not_attract() {
        let e = 0.5;
        for speed in [-1e-17, -0.0, 0.0] {
            let velocities = [DVec3::new(speed, 0.3, 0.0), DVec3::ZERO];
            for separation in [e * speed, 0.0] {
                let (wi, wj, impact) =
                    impact_with_separation(velocities, [1.0, 1.0], DVec3::X, e, speed, separation);
                assert_eq!(([wi, wj], impact.impulse), (velocities, 0.0), "{speed}, {separation}");
            }
            // Bodies that gravity presses together separate at the given speed.
            let (wi, wj, impact) = impact_with_separation(velocities, [1.0, 1.0], DVec3::X, e, speed, 0.25);
            assert_eq!(wj.x - wi.x, 0.25);
            assert!(impact.impulse > 0.0 && impact.energy_loss < 0.0, "{impact:?}");
        }
    }
}
