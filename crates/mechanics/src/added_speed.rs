/*!
The Δ model: contacts that add to the speed of separation.

A granular layer between two vibrating plates, seen from above, gains energy in its contacts: the vertical
motion of two grains becomes a horizontal one. The model adds 2Δ to the separation speed of every contact,
v_n' = e v_n + 2Δ (R. Brito, D. Risso, R. Soto, Phys. Rev. E 87, 022209 (2013)).
*/

use crate::{
    law::{ContactLaw, NamedLaw, NormalContact},
    restitution::Restitution,
};

/// A law of restitution, and an added speed.
#[derive(Debug)]
struct AddedSpeed {
    restitution: Restitution,
    /// Δ, half of the speed that is added [length/time].
    added: f64,
}

impl ContactLaw for AddedSpeed {
    fn separation_speed(&self, contact: &NormalContact) -> f64 {
        self.restitution.coefficient_in(contact) * contact.approach_speed + 2.0 * self.added
    }
}

impl Restitution {
    /// This law, with 2 `added` more for the speed of separation [length/time]: the Δ model. The same law for
    /// 0. An added speed below 0 takes from the separation speed, to nothing at most.
    ///
    /// ```
    /// use haff_mechanics::Restitution;
    /// let law = Restitution::Constant(0.5).with_added_speed(0.25);
    /// assert_eq!(law.coefficient(2.0) * 2.0, 0.5 * 2.0 + 2.0 * 0.25);
    /// ```
    #[must_use]
    pub fn with_added_speed(self, added: f64) -> Self {
        if added == 0.0 {
            return self;
        }
        let law = AddedSpeed { restitution: self, added };
        // Bits, since texts of numbers that differ could be the same.
        let parameters = format!("{self:?}, {:x}", added.to_bits());
        Self::Law(NamedLaw::of("added_speed", &parameters, Box::new(law)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_speed_is_added_to_that_of_any_law() {
        let viscoelastic = Restitution::Viscoelastic { coefficient: 0.1 };
        let law = viscoelastic.with_added_speed(0.125);
        for speed in [1e-3, 0.5, 1.0, 40.0] {
            let expected = viscoelastic.coefficient(speed) + 0.25 / speed;
            assert!((law.coefficient(speed) / expected - 1.0).abs() < 1e-15, "{speed}");
        }
        assert_eq!(viscoelastic.with_added_speed(0.0), viscoelastic);
        assert_eq!(law, viscoelastic.with_added_speed(0.125));
        assert_ne!(law, viscoelastic.with_added_speed(0.126));
        assert_ne!(law, Restitution::Constant(0.1).with_added_speed(0.125));
        assert!(!law.is_elastic() && !law.loses_energy());
        // Bodies that separate by rounding are not pushed apart.
        assert_eq!(law.coefficient(-1e-17), 0.0);
    }
}
