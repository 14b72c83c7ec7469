//! Measurements of a state: energies, temperatures, pressure, momenta, the hash. They move copies of the
//! particles to the present, and do not change the anchors.

use glam::DVec3;
use rayon::prelude::*;
use xxhash_rust::xxh3::Xxh3;

use crate::{
    numerics::total::BLOCK,
    report::Frame,
    state::{State, population::spread, world::World},
};

/// Present position, velocity and image of a particle, wrapped into the box.
pub(crate) fn present(world: &World, i: usize) -> (DVec3, DVec3, [i32; 3]) {
    let (position, mut velocity) = world.state(i as u32, world.now);
    let (position, wraps, change) = world.wrap(position, world.now);
    if world.boundary.deformation.is_some() {
        velocity += change;
    }
    let image = world.images[i];
    (position, velocity, [image[0] + wraps[0], image[1] + wraps[1], image[2] + wraps[2]])
}

/// The present state of all particles, wrapped into the box.
pub(crate) fn frame(state: &State, time: f64) -> Frame {
    let world = &state.world;
    let count = world.particles.len();
    let mut frame = Frame {
        time,
        step: state.accumulators.counters.collisions + state.accumulators.counters.wall_collisions,
        position: vec![DVec3::ZERO; count],
        velocity: vec![DVec3::ZERO; count],
        image: vec![[0; 3]; count],
        edges: world.edges(world.now),
        angular_velocity: if world.spin.is_some() {
            (0..count as u32).map(|i| world.angular_velocity(i, world.now)).collect()
        } else {
            Vec::new()
        },
        present: Vec::new(),
        pistons: world.states_of_pistons(),
    };
    let Frame { position, velocity, image, .. } = &mut frame;
    (position, velocity, image).into_par_iter().enumerate().with_min_len(BLOCK).for_each(
        |(i, (position, velocity, image))| {
            (*position, *velocity, *image) = present(world, i);
            *image = world.image_in_box(*image, world.now);
        },
    );
    match (&world.ids, &state.population) {
        (Some(ids), Some(population)) => whole(&frame, ids, population.all(), world.spin.is_some()),
        _ => frame,
    }
}

/// A frame of all particles of the list, from that of those that are there.
fn whole(frame: &Frame, ids: &[u32], all: usize, has_spins: bool) -> Frame {
    let spins = if has_spins { all } else { 0 };
    Frame {
        time: frame.time,
        step: frame.step,
        edges: frame.edges,
        position: spread(ids, &frame.position, vec![DVec3::NAN; all]),
        velocity: spread(ids, &frame.velocity, vec![DVec3::NAN; all]),
        image: spread(ids, &frame.image, vec![[0; 3]; all]),
        angular_velocity: spread(ids, &frame.angular_velocity, vec![DVec3::NAN; spins]),
        present: spread(ids, &vec![true; ids.len()], vec![false; all]),
        pistons: frame.pistons.clone(),
    }
}

/// A 128-bit hash of every particle's position, velocity and image at the present, of its spin, and of the
/// positions and velocities of pistons.
pub(crate) fn hash(world: &World) -> u128 {
    let mut hasher = Xxh3::new();
    // In blocks: hashing a few bytes per call is slow, and a frame would be a copy of all particles.
    let mut block = Vec::with_capacity(60 * BLOCK);
    for start in (0..world.particles.len()).step_by(BLOCK) {
        block.clear();
        for i in start..(start + BLOCK).min(world.particles.len()) {
            let (position, velocity, image) = present(world, i);
            for value in position.to_array().into_iter().chain(velocity.to_array()) {
                block.extend(value.to_le_bytes());
            }
            block.extend(image.into_iter().flat_map(i32::to_le_bytes));
            if world.ids.is_some() {
                block.extend(world.id(i as u32).to_le_bytes());
            }
            if world.spin.is_some() {
                let spin = world.angular_velocity(i as u32, world.now);
                block.extend(spin.to_array().into_iter().flat_map(f64::to_le_bytes));
            }
        }
        hasher.update(&block);
    }
    for number in world.states_of_pistons().iter().flatten().flat_map(DVec3::to_array) {
        hasher.update(&number.to_le_bytes());
    }
    hasher.digest128()
}
