//! The Δ model of a granular layer between two vibrating plates, seen from above.

use haff_cli::{ContactLaw, NormalContact, Parameters};

/// Each contact takes a part of the approach speed and adds 2Δ to the separation: the vertical motion gives the
/// energy (R. Brito, D. Risso, R. Soto, Phys. Rev. E 87, 022209 (2013)).
#[derive(Debug)]
struct Delta {
    /// α, the coefficient of restitution without Δ.
    restitution: f64,
    /// Δ [length/time].
    added_speed: f64,
}

impl ContactLaw for Delta {
    fn separation_speed(&self, contact: &NormalContact) -> f64 {
        self.restitution * contact.approach_speed + 2.0 * self.added_speed
    }
}

/// The law with the parameters of a scene.
pub fn make(parameters: &mut Parameters) -> Box<dyn ContactLaw> {
    Box::new(Delta {
        restitution: parameters.fraction("restitution"),
        added_speed: parameters.not_negative("added_speed"),
    })
}
