//! Contacts of grains, and whether they support them.

use glam::DVec3;
use haff_neighbors::Geometry;

use super::thresholds::Thresholds;
use crate::{
    grid::{Slabs, levels, meet, place},
    particles::{World, supported},
};

/// A grain is supported if what its contacts leave of gravity is less than this part of it.
const SLOPE: f64 = 1e-3;

/// Normals, towards particle i, of its contacts with these particles and with walls that do not move, all of
/// them where they are now.
pub(super) fn normals(world: &World, gap: f64, i: u32, near: impl Iterator<Item = u32>) -> Vec<DVec3> {
    let (position, _) = world.state(i, world.now);
    let mut normals: Vec<DVec3> = near
        .map(|j| -world.periodicity.nearest(world.state(j, world.now).0 - position).normalize_or_zero())
        .collect();
    let radius = world.body(i).radius;
    for (wall, plane) in world.walls.iter().enumerate() {
        if !plane.motion.is_moving()
            && world.wall_approach(wall as u32, radius, position, DVec3::ZERO, world.now).0 <= gap
        {
            normals.push(plane.normal);
        }
    }
    normals
}

/// Whether particle i stands on these particles and on walls that do not move.
pub(super) fn is_supported(
    world: &World,
    thresholds: &Thresholds,
    i: u32,
    near: impl Iterator<Item = u32>,
) -> bool {
    let normals = normals(world, thresholds.gap, i, near);
    supported(world.gravity, &normals.iter().copied()).length() <= SLOPE * world.gravity.length()
}

/// Whether body i holds others without being at rest by a scan: of infinite mass, and not moving.
pub(super) fn is_fixed(world: &World, i: u32) -> bool {
    world.body(i).inverse_mass == 0.0 && world.particles[i as usize].velocity == DVec3::ZERO
}

/// Of each of these particles those in contact that are among them, asleep or fixed; in order.
pub(super) fn contacts(
    world: &World,
    geometry: &Geometry,
    thresholds: &Thresholds,
    some: &[u32],
) -> Vec<Vec<u32>> {
    let mut slot = vec![u32::MAX; world.particles.len()];
    for (k, &i) in some.iter().enumerate() {
        slot[i as usize] = k as u32;
    }
    let solid = (0..world.particles.len() as u32)
        .filter(|&i| slot[i as usize] != u32::MAX || world.is_asleep(i) || is_fixed(world, i));
    let mut near = vec![Vec::new(); some.len()];
    let levels = levels(world, geometry, &solid, thresholds.gap, &Slabs::BOX);
    for first in 0..levels.len() {
        for cell in 0..levels[first].len() {
            meet(world, &levels[first..], cell, |k, level, others| {
                let i = levels[first].rows[k];
                let (position, radius) = (place(world, i), world.class(i).radius);
                for &j in &level.rows[others] {
                    let slots = [slot[i as usize], slot[j as usize]];
                    let reach = radius + world.class(j).radius + thresholds.gap;
                    if slots == [u32::MAX; 2] {
                        continue;
                    }
                    let r = world.periodicity.nearest(place(world, j) - position);
                    if r.length_squared() <= reach * reach {
                        for (slot, partner) in slots.into_iter().zip([j, i]) {
                            if slot != u32::MAX {
                                near[slot as usize].push(partner);
                            }
                        }
                    }
                }
            });
        }
    }
    for contacts in &mut near {
        contacts.sort_unstable();
    }
    near
}
