/*!
Laws of contact that another crate adds.
*/

use std::fmt;

use crate::named::{Named, NamedOnce};

/// What a law of contact is given of two bodies that touch.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NormalContact {
    /// Speed at which they approach along the line of centers, > 0 [length/time].
    pub approach_speed: f64,
    /// Reduced mass m₁m₂/(m₁ + m₂); the mass of the particle in a contact with a wall or a fixed body
    /// \[mass\].
    pub reduced_mass: f64,
    /// Reduced radius R₁R₂/(R₁ + R₂); the radius of the particle in a contact with a wall \[length\].
    pub reduced_radius: f64,
    /// Random bits, a hash of the seed of the scene, the bodies and the time: other ones
    /// in each contact, and the same with every search, any number of threads and in a run that goes on. For
    /// [`Draw::from_bits`](crate::random::Draw::from_bits).
    pub random: u64,
}

impl Default for NormalContact {
    /// Bodies with a reduced mass and a reduced radius of 1 that do not approach, and bits like any others.
    fn default() -> Self {
        Self { approach_speed: 0.0, reduced_mass: 1.0, reduced_radius: 1.0, random: 0 }
    }
}

/// A law of contact of smooth bodies.
///
/// A smooth contact changes the velocities along its normal only, and conserves momentum. What is left to a
/// law is one number: the speed at which the two bodies separate. It is e times the approach speed with a
/// coefficient of restitution e, which a law may choose for every contact, and which may be above 1: then the
/// contact gives energy to the bodies, and `energy_loss` is negative.
///
/// The result may depend on the contact alone: it is computed more than once, and on any thread.
pub trait ContactLaw: fmt::Debug + Send + Sync {
    /// Speed at which the two bodies separate, ≥ 0 [length/time]. A run ends with an error where it is not
    /// finite; a negative speed counts as 0.
    fn separation_speed(&self, contact: &NormalContact) -> f64;

    /// Whether bodies never separate faster than they approach, and lose energy in general. Then grains come
    /// to rest under gravity: a series of bounces by this law is ended as plastic where its energy is less
    /// than rounding. Default no.
    fn loses_energy(&self) -> bool {
        false
    }
}

/// A law of contact with the name and the parameters by which scenes have it.
pub type NamedLaw = Named<dyn ContactLaw>;

static LAWS: NamedOnce<dyn ContactLaw> = NamedOnce::new();

impl NamedLaw {
    /// The law with this name and these parameters, as text; `law` if it is new.
    pub fn of(name: &str, parameters: &str, law: Box<dyn ContactLaw>) -> &'static Self {
        LAWS.of(name, parameters, law)
    }

    /// The coefficient of restitution of a contact: the ratio of the speeds after and before it. Bodies that
    /// do not approach, by rounding, are not pushed apart.
    // A call, so that it is not compiled into every impact.
    #[inline(never)]
    #[must_use]
    pub fn coefficient(&self, contact: &NormalContact) -> f64 {
        if contact.approach_speed > 0.0 {
            // NaN stays NaN, and ends the run.
            let speed = self.get().separation_speed(contact);
            (if speed < 0.0 { 0.0 } else { speed }) / contact.approach_speed
        } else {
            0.0
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Restitution;

    #[derive(Debug)]
    struct Add(f64);

    impl ContactLaw for Add {
        fn separation_speed(&self, contact: &NormalContact) -> f64 {
            contact.approach_speed + self.0 * contact.reduced_mass / contact.reduced_radius
        }
    }

    #[test]
    fn the_coefficient_is_the_ratio_of_the_speeds_and_equal_laws_are_one() {
        let law = NamedLaw::of("add", "speed = 3", Box::new(Add(3.0)));
        assert!(std::ptr::eq(law, NamedLaw::of("add", "speed = 3", Box::new(Add(3.0)))));
        assert!(law != NamedLaw::of("add", "speed = 4", Box::new(Add(4.0))));
        let contact = |approach_speed| NormalContact {
            approach_speed,
            reduced_mass: 0.5,
            reduced_radius: 0.25,
            ..NormalContact::default()
        };
        assert_eq!(law.coefficient(&contact(2.0)), 8.0 / 2.0);
        assert_eq!((law.coefficient(&contact(0.0)), law.coefficient(&contact(-1e-17))), (0.0, 0.0));
        assert_eq!(NamedLaw::of("take", "", Box::new(Add(-9.0))).coefficient(&contact(2.0)), 0.0);
        assert!(NamedLaw::of("nan", "", Box::new(Add(f64::NAN))).coefficient(&contact(2.0)).is_nan());
        let law = Restitution::Law(law);
        assert_eq!(law.coefficient_in(&contact(2.0)), 4.0);
        assert!(
            !law.is_elastic() && !law.loses_energy() && law.bounces(1.0).is_none() && law.check().is_ok()
        );
    }
}
