//! Rough impacts: the tangential part of impacts of particles and of impacts on walls.
//!
//! The normal part is resolved as for smooth particles; the tangential one is added to it.

use glam::DVec3;
use haff_mechanics::{RoughBody, Roughness, tangential_impact};

use crate::{
    laws::{
        contact,
        pair_law::{self, PairContact},
        wall_contact::{self, WallContact},
    },
    model::features::Features,
    report::{EventRecord, ledger::Term},
    state::{Pending, State, accumulators::Accumulators, spin::Spins, world::World},
};

/// What the tangential part adds to an impact.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Tangential {
    /// Impulse on the second body, or on the wall [mass·length/time].
    pub impulse: DVec3,
    pub energy_loss: f64,
    pub carnot_energy: f64,
    /// The part of `energy_loss` that translation loses.
    pub translational_loss: f64,
    /// Angular velocities after the impact [1/time].
    pub spins: [DVec3; 2],
    /// Velocity of the surface of each body at the contact, before the impact [length/time].
    pub surfaces: [DVec3; 2],
}

impl Tangential {
    /// Adds the work of the tangential impulse of body k, of infinite mass, whose center has this velocity.
    fn add_work(&self, accumulators: &mut Accumulators, k: usize, velocity: DVec3, now: f64) {
        let impulse = if k == 0 { self.impulse } else { -self.impulse };
        // What its center does changes the velocity of the other body, what its spin does the rest.
        let turning = impulse.dot(self.surfaces[k] - velocity);
        accumulators.add_energy(Term::WallWork, now, impulse.dot(velocity));
        accumulators.add_rotation(Term::WallWork, turning);
    }

    /// Adds the losses to the sums.
    fn add_losses(&self, accumulators: &mut Accumulators, now: f64) {
        accumulators.add_tangential(now, self.energy_loss, self.carnot_energy, self.translational_loss);
    }

    /// Adds the impulse and the losses to the row of an event.
    pub fn add_to(&self, row: &mut EventRecord) {
        row.impulse_vector += self.impulse;
        row.energy_loss += self.energy_loss;
        row.carnot_energy += self.carnot_energy;
        row.tangential_loss = self.energy_loss;
    }
}

/// The tangential part of an impact of two bodies, and the change of the velocity of each.
fn tangential(bodies: [RoughBody; 2], n: DVec3, normal: f64, law: Roughness) -> (Tangential, [DVec3; 2]) {
    let [first, second] = &bodies;
    let impact = tangential_impact(first, second, n, normal, law);
    let surface = |body: &RoughBody, n: DVec3| body.velocity + body.angular_velocity.cross(n * body.radius);
    let tangential = Tangential {
        impulse: impact.impulse,
        energy_loss: impact.energy_loss,
        carnot_energy: impact.carnot_energy,
        translational_loss: impact.translational_loss,
        spins: [0, 1].map(|k| bodies[k].angular_velocity + impact.spin_changes[k]),
        surfaces: [surface(first, n), surface(second, -n)],
    };
    (tangential, [-impact.impulse * first.inverse_mass, impact.impulse * second.inverse_mass])
}

/// The tangential part of the impact of two particles at `time`, the velocities after both parts, and the
/// contact.
fn pair<F: Features>(
    world: &World,
    bodies: [u32; 2],
    time: i64,
) -> Option<(Tangential, [DVec3; 2], PairContact)> {
    let spins = world.spin.as_deref()?;
    let (contact, _) = contact::touch::<F>(world, bodies, time).ok()?;
    let PairContact { bodies: [i, j], classes: [a, b], velocities: [wi, wj], n, .. } = contact;
    let (ui, uj, impact) = pair_law::resolve::<F>(world, &contact);
    let law = spins.pair[a.group * world.laws.groups + b.group];
    let decay = world.spin_decay(time);
    let rough = [spins.body(i, &a, wi, decay), spins.body(j, &b, wj, decay)];
    let (tangential, [change_i, change_j]) = tangential(rough, n, impact.impulse, law);
    Some((tangential, [ui + change_i, uj + change_j], contact))
}

/// The tangential part of an impact of two particles, from its computation to its effect: only rough impacts
/// fill it.
pub(crate) type RoughPair = Option<(Tangential, PairContact)>;

/// The velocities of two particles after their impact at `time`; fills `rough`.
///
/// The impact is computed from the anchors once more: kept in registers for this call, its parts cost smooth
/// particles 1 to 2 % of all instructions.
#[cold]
#[inline(never)]
pub(crate) fn velocities<F: Features>(
    world: &World,
    bodies: [u32; 2],
    time: i64,
    rough: &mut RoughPair,
) -> [DVec3; 2] {
    // The contact has been checked.
    let Some((tangential, velocities, contact)) = pair::<F>(world, bodies, time) else {
        return Default::default();
    };
    *rough = Some((tangential, contact));
    velocities
}

/// Sets the spins of two particles after their impact at `time`, and adds its tangential energies and
/// impulse. Their anchors are still those before the impact.
#[cold]
#[inline(never)]
pub(crate) fn apply_pair(state: &mut State, rough: &RoughPair, time: i64) -> Tangential {
    let State { world, accumulators, .. } = state;
    let &Some((tangential, contact)) = rough else { return Tangential::default() };
    let PairContact { bodies, classes, velocities, .. } = contact;
    let decay = world.spin_decay(time);
    if let Some(spins) = &mut world.spin {
        for k in 0..2 {
            // Another thread may read the spin of a body of infinite mass, which never changes.
            if classes[k].inverse_mass != 0.0 {
                spins.angular_velocity[bodies[k] as usize] = tangential.spins[k] / decay;
            }
        }
    }
    let now = world.clock.shown(time);
    tangential.add_losses(accumulators, now);
    // The impulse on the first body is −P, on the second P.
    if classes[0].inverse_mass == 0.0 {
        accumulators.add_impulse(tangential.impulse);
        tangential.add_work(accumulators, 0, velocities[0], now);
    } else if classes[1].inverse_mass == 0.0 {
        accumulators.add_impulse(-tangential.impulse);
        tangential.add_work(accumulators, 1, velocities[1], now);
    }
    tangential
}

/// The tangential part of the impact of a particle on a wall at a time, (i, wall, time), with the normal
/// impulse `normal`; the change of velocity by it, and the contact.
fn on_wall<F: Features>(
    world: &World,
    (i, wall, time): (u32, u32, i64),
    normal: f64,
) -> Option<(Tangential, DVec3, WallContact)> {
    let spins = world.spin.as_deref()?;
    let contact = wall_contact::touch_wall::<F>(world, i, wall, time).ok()?;
    let velocities = [contact.velocity, contact.wall_velocity];
    let bodies = wall_bodies(spins, world, i, velocities, world.spin_decay(time));
    let law = world.roughness(spins, i, wall);
    let (tangential, [change, _]) = tangential(bodies, contact.n, normal, law);
    Some((tangential, change, contact))
}

/// As [`RoughPair`] for an impact on a wall.
pub(crate) type RoughWall = Option<(Tangential, WallContact)>;

/// The velocity of a particle after its impact on a wall, (i, wall, time), from that after its normal part;
/// fills `rough`.
#[cold]
#[inline(never)]
pub(crate) fn wall_velocity<F: Features>(
    world: &World,
    event: (u32, u32, i64),
    after: DVec3,
    normal: f64,
    rough: &mut RoughWall,
) -> DVec3 {
    // The contact has been checked.
    let Some((tangential, change, contact)) = on_wall::<F>(world, event, normal) else { return after };
    *rough = Some((tangential, contact));
    after + change
}

/// Sets the spin of a particle after its impact on a wall, and adds its tangential energies and impulse. Its
/// anchor is still that before the impact.
#[cold]
#[inline(never)]
pub(crate) fn apply_wall(state: &mut State, rough: &RoughWall) -> Tangential {
    let State { world, accumulators, .. } = state;
    let &Some((tangential, contact)) = rough else { return Tangential::default() };
    let WallContact { i, wall, time, .. } = contact;
    let now = world.clock.shown(time);
    world.set_spin(i, tangential.spins[0], time);
    tangential.add_losses(accumulators, now);
    accumulators.add_impulse(-tangential.impulse);
    world.add_from_wall(wall, -tangential.impulse, -tangential.energy_loss);
    if contact.wall_velocity != DVec3::ZERO {
        let work = -tangential.impulse.dot(contact.wall_velocity);
        accumulators.add_energy(Term::WallWork, now, work);
    }
    tangential
}

/// Particle i and a wall as bodies in a contact, with their velocities and what a drag has left of the
/// angular velocity.
fn wall_bodies(
    spins: &Spins,
    world: &World,
    i: u32,
    [velocity, wall_velocity]: [DVec3; 2],
    decay: f64,
) -> [RoughBody; 2] {
    let body = spins.body(i, world.class(i), velocity, decay);
    let wall = RoughBody {
        velocity: wall_velocity,
        angular_velocity: DVec3::ZERO,
        radius: 0.0,
        inverse_mass: 0.0,
        inertia: 1.0,
    };
    [body, wall]
}

/// Adds the tangential part of all bounces of a completed series on a fixed wall, whose normal impulses have
/// the sum in `rest`, to the state and to `rest`.
///
/// Each bounce of the series either slides, with the impulse of Coulomb's law, or reduces the slip by the
/// factor |β|: after infinitely many of them, the slip is what sliding has left of it.
#[cold]
pub(crate) fn end_series(state: &mut State, i: u32, velocity: DVec3, rest: &mut Pending) {
    let world = &mut state.world;
    let Some(spins) = world.spin.as_deref() else { return };
    let law = world.roughness(spins, i, rest.wall);
    if law.is_smooth() {
        return;
    }
    let n = -world.boundary.walls[rest.wall as usize].normal;
    let bodies = wall_bodies(spins, world, i, [velocity, DVec3::ZERO], 1.0);
    let law = Roughness { tangential_restitution: 0.0, ..law };
    let (tangential, [change, _]) = tangential(bodies, n, rest.impulse, law);
    world.particles[i as usize].velocity += change;
    world.set_spin(i, tangential.spins[0], world.now);
    world.add_wall_impulse(rest.wall, -tangential.impulse);
    state.accumulators.add_impulse(-tangential.impulse);
    rest.tangential = tangential.impulse;
    rest.tangential_loss = tangential.energy_loss;
    rest.energy_loss += tangential.energy_loss;
    rest.carnot_energy += tangential.carnot_energy;
}

impl World {
    /// The tangential law of particle i with a wall.
    pub fn roughness(&self, spins: &Spins, i: u32, wall: u32) -> Roughness {
        spins.wall[self.body(i).group * self.boundary.walls.len() + wall as usize]
    }
}
