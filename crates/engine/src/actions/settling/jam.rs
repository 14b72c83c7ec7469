//! Jams: grains without any room to move, which would collide without end.

use std::iter;

use glam::DVec3;
use haff_neighbors::Geometry;

use crate::{
    laws::series,
    model::thresholds::Thresholds,
    motion::flights,
    report::Observer,
    state::{State, settling::JAM_DURATION, world::World},
    support::contacts::{find_contacts, normals},
};

use super::settle::{end_series, record_loss};

/// Largest gap between jammed bodies [largest gap of a contact, `Thresholds::gap`].
const JAM_GAP: f64 = 1e-6;
/// The iteration has converged if no impulse changes a speed by more than this fraction of
/// [`Thresholds::negligible`].
const ACCURACY: f64 = 0.1;
/// Largest number of iterations.
const ROUNDS: usize = 2000;
/// A change that stays the same, within this part of it, from so many further iterations on to three times as
/// many does not converge: in a chain of n grains changes decrease by (π/n)² of themselves, about, in each.
const FURTHER_ROUNDS: usize = 50;
const SAME: f64 = 1e-3;
/// Smaller changes than this part of the largest speed are rounding errors.
const ROUNDING: f64 = 1e-13;

/// A contact in a jam: of a grain with another grain of the jam, or with an immovable body or wall.
#[derive(Clone)]
struct Contact {
    grain: usize,
    other: Option<usize>,
    /// Unit vector towards the grain.
    normal: DVec3,
    /// Effective mass.
    mass: f64,
    impulse: f64,
}

/// Resolves a jam: one plastic impact on all contacts of the grains that have just had contacts, with each
/// other and with immovable bodies and walls. The new velocities are those nearest to the old ones, in the
/// norm of the kinetic energy, at which no contact closes. Returns the grains whose velocity has changed.
pub(crate) fn resolve_jam(
    state: &mut State,
    geometry: &Geometry,
    thresholds: &Thresholds,
    observer: &mut dyn Observer,
) -> Vec<u32> {
    let world = &state.world;
    let (now, narrow) = (world.now, Thresholds { gap: JAM_GAP * thresholds.gap, ..*thresholds });
    let recent: Vec<u32> = (0..world.particles.len() as u32)
        .filter(|&i| {
            world.class(i).inverse_mass != 0.0
                && world.contact_age(i, now) <= JAM_DURATION * thresholds.period
        })
        .collect();
    let mut jam = jam_contacts(world, geometry, &narrow, &recent);
    let mut velocities: Vec<DVec3> = recent.iter().map(|&i| world.state(i, now).1).collect();
    let inverse: Vec<f64> = recent.iter().map(|&i| world.class(i).inverse_mass).collect();
    solve(&mut jam, &mut velocities, &inverse, ACCURACY * thresholds.negligible);
    let mut changed = Vec::new();
    for (&i, after) in recent.iter().zip(velocities) {
        let (position, before) = state.world.state(i, now);
        if after == before {
            continue;
        }
        end_series(state, i, observer);
        let mass = state.world.class(i).mass;
        let energy = 0.5 * mass * (before - after).dot(before + after);
        let carnot_energy = 0.5 * mass * (before - after).length_squared();
        record_loss(state, i, mass * (before - after), [energy, carnot_energy], thresholds, observer);
        flights::end(state, i, now);
        let particle = &mut state.world.particles[i as usize];
        particle.set_anchor(position, after, now);
        particle.set_recently_hit(true);
        state.world.note_contact(i, now);
        series::keep_support(state, i, now);
        changed.push(i);
    }
    changed
}

/// All contacts of these grains; the grains are in ascending order.
fn jam_contacts(world: &World, geometry: &Geometry, narrow: &Thresholds, recent: &[u32]) -> Vec<Contact> {
    let mut jam = Vec::new();
    for (grain, (&i, contacts)) in
        recent.iter().zip(find_contacts(world, geometry, narrow, recent)).enumerate()
    {
        let position = world.state(i, world.now).0;
        let inverse = world.class(i).inverse_mass;
        for j in contacts {
            let other = recent.binary_search(&j).ok();
            // Each pair of grains is in two lists; it becomes one contact.
            if other.is_some_and(|other| other < grain) {
                continue;
            }
            let r = world.boundary.periodicity.nearest(position - world.state(j, world.now).0);
            let mass = 1.0 / (inverse + world.class(j).inverse_mass);
            jam.push(Contact { grain, other, normal: r.normalize_or_zero(), mass, impulse: 0.0 });
        }
        let walls = normals(world, narrow.gap, i, iter::empty()).into_iter();
        let mass = 1.0 / inverse;
        jam.extend(walls.map(|normal| Contact { grain, other: None, normal, mass, impulse: 0.0 }));
    }
    jam
}

/// The velocities and impulses after a plastic impact on all contacts: those of a projected Gauss–Seidel
/// iteration. If it does not converge, because normals are almost opposite, the velocities of the grains
/// concerned are set to zero.
fn solve(jam: &mut [Contact], velocities: &mut [DVec3], inverse: &[f64], accuracy: f64) {
    let is_small = |&change: &f64| change <= accuracy;
    let fastest = velocities.iter().fold(0.0, |fastest, velocity| f64::max(fastest, velocity.length()));
    let mut changes = Vec::new();
    for _ in 0..ROUNDS {
        changes = iterate(jam, velocities, inverse);
        if changes.iter().all(is_small) {
            break;
        }
    }
    // A grain in a gap that narrows by 10⁻⁸ of its way loses this part of its speed in each round: the
    // changes are small, and remain.
    let (mut further, mut after) = (jam.to_vec(), velocities.to_vec());
    let later = [(); 3].map(|()| {
        (1..FURTHER_ROUNDS).for_each(|_| _ = iterate(&mut further, &mut after, inverse));
        iterate(&mut further, &mut after, inverse)
    });
    let remains = |k: usize| {
        let change = later[0][k];
        change > ROUNDING * fastest && later.iter().all(|later| (later[k] - change).abs() <= SAME * change)
    };
    for (k, contact) in jam.iter().enumerate() {
        if !is_small(&changes[k]) || remains(k) {
            for grain in [Some(contact.grain), contact.other].into_iter().flatten() {
                velocities[grain] = DVec3::ZERO;
            }
        }
    }
}

/// One round: each contact in turn gets the impulse that stops its approach; total impulses are never
/// attractive. Returns by how much the impulse of each contact has changed the speed of its approach.
fn iterate(jam: &mut [Contact], velocities: &mut [DVec3], inverse: &[f64]) -> Vec<f64> {
    let round = jam.iter_mut().map(|contact| {
        let &mut Contact { grain, other, normal, mass, .. } = contact;
        let relative = velocities[grain] - other.map_or(DVec3::ZERO, |other| velocities[other]);
        let impulse = (contact.impulse - mass * relative.dot(normal)).max(0.0);
        let change = impulse - contact.impulse;
        contact.impulse = impulse;
        velocities[grain] += normal * (change * inverse[grain]);
        if let Some(other) = other {
            velocities[other] -= normal * (change * inverse[other]);
        }
        change.abs() / mass
    });
    round.collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A light grain between a heavy one and a wall: impacts resolved one by one would never end.
    #[test]
    fn a_jam_is_resolved_at_once_without_attraction() {
        let contact = |grain, other, normal, mass| Contact { grain, other, normal, mass, impulse: 0.0 };
        let inverse = [1.0, 0.1, 1.0];
        let tilted = DVec3::new(0.6, 0.8, 0.0);
        let mut jam = [
            contact(0, None, DVec3::X, 1.0),
            contact(0, Some(1), -tilted, 1.0 / 1.1),
            contact(1, Some(2), -DVec3::Y, 1.0 / 1.1),
        ];
        // The third moves away.
        let start = [DVec3::ZERO, DVec3::new(-1.0, -0.2, 0.3), DVec3::Y];
        let mut velocities = start;
        solve(&mut jam, &mut velocities, &inverse, 1e-16);
        assert_eq!((velocities[2], jam[2].impulse), (start[2], 0.0));
        assert!(jam[0].impulse > 0.0 && jam[1].impulse > 0.0);
        for Contact { grain, other, normal, .. } in &jam[..2] {
            let relative = velocities[*grain] - other.map_or(DVec3::ZERO, |other| velocities[other]);
            assert!(relative.dot(*normal).abs() < 1e-15);
        }
        // Closed form of the two impulses: [1, −0.6; −0.6, 1.1] (J₀, J₁) = (0, −u·n).
        let press = -(start[1].dot(tilted));
        let expected = press / (1.1 - 0.36);
        assert!((jam[1].impulse / expected - 1.0).abs() < 1e-13);
        assert!((jam[0].impulse / (0.6 * expected) - 1.0).abs() < 1e-13);
        let energy = |v: &[DVec3; 3]| (0..3).map(|k| 0.5 * v[k].length_squared() / inverse[k]).sum::<f64>();
        assert!(energy(&velocities) < energy(&start));
    }

    /// A grain falls into a gap of its own width between a wall and a grain at rest: each impact stops 10⁻⁸
    /// of its fall, so that there would be 10⁸ more.
    #[test]
    fn a_grain_in_a_gap_that_hardly_narrows_stops() {
        let contact = |normal| Contact { grain: 0, other: None, normal, mass: 1.0, impulse: 0.0 };
        let mut jam = [contact(DVec3::X), contact(DVec3::new(-1.0, 1.1e-8, 0.0))];
        // The first impulses are others than those that follow.
        for along in [0.0, 2.4e-10, -3e-9] {
            let mut velocities = [DVec3::new(along, -0.1, 0.0)];
            for contact in &mut jam {
                contact.impulse = 0.0;
            }
            solve(&mut jam, &mut velocities, &[1.0], 1e-8);
            assert_eq!(velocities, [DVec3::ZERO], "{along}");
        }
    }
}
