//! The contact of a particle with a wall.

use glam::DVec3;

use crate::{
    laws::contact::{check_penetration, penetration_to_correct, state_at_event},
    model::features::Features,
    numerics::error::EngineError,
    state::world::World,
};

/// A contact of a particle with a wall, before its impact.
#[derive(Debug, Clone, Copy)]
pub(crate) struct WallContact {
    pub i: u32,
    pub wall: u32,
    /// [ticks]
    pub time: i64,
    pub position: DVec3,
    pub velocity: DVec3,
    /// Unit normal into the wall.
    pub n: DVec3,
    pub wall_velocity: DVec3,
}

/// The contact of particle i with a wall at `time`: a function of its anchor.
///
/// # Errors
/// An overlap that is more than rounding.
#[inline(always)]
pub(crate) fn touch_wall<F: Features>(
    world: &World,
    i: u32,
    wall: u32,
    time: i64,
) -> Result<WallContact, EngineError> {
    let (mut position, velocity) = state_at_event::<F>(world, i, time);
    let class = *world.class(i);
    let (gap, _) = world.wall_approach(wall, class.radius, position, velocity, time);
    let depth = penetration_to_correct(-gap, position.abs(), class.radius);
    if depth > 0.0 {
        let coordinates =
            position.abs().max(world.coordinates(i)).max(world.boundary.walls[wall as usize].coordinates());
        check_penetration(world, depth, class.radius, coordinates, (i, None), time)?;
    }
    let normal = world.contact_normal(i, wall, (position, velocity), time);
    if depth > 0.0 || world.is_level(wall) {
        position -= normal * gap;
    }
    let plane = &world.boundary.walls[wall as usize];
    let touched = position - normal * class.radius;
    let wall_velocity = plane.motion.velocity_of_surface(plane.normal, touched, (&world.clock, time));
    let n = -normal;
    Ok(WallContact { i, wall, time, position, velocity, n, wall_velocity })
}
