use glam::DVec3;

use crate::{
    laws::{wall_contact::WallContact, wall_impact::reflect},
    report::{Observer, Silent, ledger::Term},
    state::State,
};

use super::two_spheres;

/// A vibrating wall of infinite frequency: whatever arrives leaves with the same normal speed
/// [length/time], relative to the wall.
fn constant_speed<const EVENTS: bool>(
    state: &mut State,
    contact: &WallContact,
    speed: f64,
    observer: &mut dyn Observer,
) {
    let &WallContact { velocity, wall_velocity, n, .. } = contact;
    let relative = velocity - wall_velocity;
    // The normal points into the wall.
    let after = relative - n * relative.dot(n) - n * speed;
    reflect::<EVENTS>(state, contact, (wall_velocity + after, None), Term::WallHeat, observer);
}

#[test]
fn a_particle_leaves_the_wall_at_the_given_speed_and_the_balance_has_the_energy() {
    let mut simulation = two_spheres();
    let velocity = DVec3::new(1.0, 0.0, -0.5);
    let position = DVec3::new(4.0, 2.0, 0.5);
    let contact =
        WallContact { i: 0, wall: 0, time: 0, position, velocity, n: -DVec3::Z, wall_velocity: DVec3::ZERO };
    constant_speed::<false>(&mut simulation.state, &contact, 3.0, &mut Silent);
    assert_eq!(simulation.state.world.state(0, 0), (position, DVec3::new(1.0, 0.0, 3.0)));
    let heat = simulation.state.accumulators.terms()[Term::WallHeat as usize];
    assert_eq!(heat, 0.5 * (3.0 * 3.0 - 0.5 * 0.5));
}
