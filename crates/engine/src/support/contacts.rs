//! The contacts of grains, and whether these support a grain.

use glam::DVec3;
use haff_neighbors::Geometry;

use crate::{
    model::thresholds::Thresholds,
    motion::support::unbalanced_gravity,
    state::world::World,
    support::grid::{Slabs, levels, visit_pairs, wrapped_position},
};

/// A grain is supported if its contacts leave at most this fraction of gravity unbalanced.
const MAX_UNBALANCED: f64 = 1e-3;

/// Normals of the contacts of particle i with the particles `near` and with walls that do not move, at the
/// present. They point towards particle i.
pub(crate) fn normals(world: &World, gap: f64, i: u32, near: impl Iterator<Item = u32>) -> Vec<DVec3> {
    let (position, _) = world.state(i, world.now);
    let mut normals: Vec<DVec3> = near
        .map(|j| {
            -world.boundary.periodicity.nearest(world.state(j, world.now).0 - position).normalize_or_zero()
        })
        .collect();
    let radius = world.body(i).radius;
    for (wall, plane) in world.boundary.walls.iter().enumerate() {
        if !plane.motion.is_moving() && world.wall_distance(i, wall as u32, position) - radius <= gap {
            normals.push(world.contact_normal(i, wall as u32, (position, DVec3::ZERO), world.now));
        }
    }
    normals
}

/// Whether particle i is supported by the particles `near` and by walls that do not move.
pub(crate) fn is_supported(
    world: &World,
    thresholds: &Thresholds,
    i: u32,
    near: impl Iterator<Item = u32>,
) -> bool {
    let normals = normals(world, thresholds.gap, i, near);
    unbalanced_gravity(world.gravity, &normals.iter().copied()).length()
        <= MAX_UNBALANCED * world.gravity.length()
}

/// Whether body i is fixed: its own mass is infinite, and it does not move.
pub(crate) fn is_fixed(world: &World, i: u32) -> bool {
    world.body(i).inverse_mass == 0.0 && world.particles[i as usize].velocity == DVec3::ZERO
}

/// For each particle of `chosen`, those particles in contact with it that are in `chosen`, asleep or fixed.
/// Each list is in ascending order.
pub(crate) fn find_contacts(
    world: &World,
    geometry: &Geometry,
    thresholds: &Thresholds,
    chosen: &[u32],
) -> Vec<Vec<u32>> {
    // `u32::MAX`: not chosen.
    let mut index_of = vec![u32::MAX; world.particles.len()];
    for (index, &i) in chosen.iter().enumerate() {
        index_of[i as usize] = index as u32;
    }
    let solid = (0..world.particles.len() as u32)
        .filter(|&i| index_of[i as usize] != u32::MAX || world.is_asleep(i) || is_fixed(world, i));
    let mut contacts = vec![Vec::new(); chosen.len()];
    let levels = levels(world, geometry, &solid, thresholds.gap, &Slabs::BOX);
    for first in 0..levels.len() {
        for cell in 0..levels[first].len() {
            visit_pairs(world, &levels[first..], cell, |own, level, others| {
                let i = levels[first].rows[own];
                let (position, radius) = (wrapped_position(world, i), world.class(i).radius);
                for &j in &level.rows[others] {
                    let indices = [index_of[i as usize], index_of[j as usize]];
                    let reach = radius + world.class(j).radius + thresholds.gap;
                    if indices == [u32::MAX; 2] {
                        continue;
                    }
                    let r = world.boundary.periodicity.nearest(wrapped_position(world, j) - position);
                    if r.length_squared() <= reach * reach {
                        for (index, partner) in indices.into_iter().zip([j, i]) {
                            if index != u32::MAX {
                                contacts[index as usize].push(partner);
                            }
                        }
                    }
                }
            });
        }
    }
    for list in &mut contacts {
        list.sort_unstable();
    }
    contacts
}
