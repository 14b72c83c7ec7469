use glam::DVec3;
use haff_mechanics::{Impact, Restitution};

use crate::{
    laws::pair_law::{PairContact, PairLaw, impact_with_separation},
    model::features::{Features, Polydisperse},
    state::world::World,
};

use super::two_spheres;

/// Granular layer between two vibrating plates, seen from above: each contact adds the speed Δ to the
/// separation (R. Brito, D. Risso, R. Soto, Phys. Rev. E 87, 022209 (2013)).
struct DeltaModel {
    restitution: Restitution,
    /// Δ [length/time].
    added_speed: f64,
}

impl PairLaw for DeltaModel {
    fn resolve<F: Features>(&self, world: &World, contact: &PairContact) -> (DVec3, DVec3, Impact) {
        let e = contact.coefficient::<F>(world, self.restitution);
        let speed = contact.approach_speed();
        let separation = e * speed + 2.0 * self.added_speed;
        impact_with_separation(contact.velocities, contact.inverse_masses(), contact.r, e, speed, separation)
    }
}

#[test]
fn a_pair_separates_at_e_times_the_approach_speed_and_twice_delta() {
    let simulation = two_spheres();
    let world = &simulation.state.world;
    let law = DeltaModel { restitution: Restitution::Constant(0.5), added_speed: 0.75 };
    let contact = PairContact {
        bodies: [0, 1],
        classes: [*world.class(0), *world.class(1)],
        velocities: [DVec3::X, -DVec3::X],
        r: DVec3::X,
        distance: 1.0,
        n: DVec3::X,
        image_velocity: DVec3::ZERO,
        time: 0,
    };
    let (u0, u1, impact) = law.resolve::<Polydisperse>(world, &contact);
    assert_eq!((u1 - u0).x, 0.5 * 2.0 + 2.0 * 0.75);
    assert_eq!(u0 + u1, DVec3::ZERO);
    let kinetic = 0.5 * (u0.length_squared() + u1.length_squared());
    assert_eq!(impact.energy_loss, 1.0 - kinetic);
}
