//! What the values of a change can be: the same as in a scene.

use glam::DVec3;

use crate::{
    model::{Boundary, Dimension, System, bounds, wall_motion::WallMotion},
    numerics::number::significant,
    state::{deformation::Deformation, periodicity::Periodicity, world::World},
};

use super::{Change, NewParticle};

/// Images beyond this number of box lengths could not be counted any more [box lengths].
const MOST_IMAGES: f64 = (i32::MAX - (1 << 24)) as f64;

/// Overlap that is rounding \[contact distances\].
const TOLERANCE: f64 = 1e-12;

/// What is wrong, by the name of the value.
type Checked = Result<(), String>;

/// Checks the vectors of a change against the dimension and the box, for `count` particles.
pub(super) fn given(system: &System, change: &Change, count: usize) -> Checked {
    let lists = [
        ("positions", &change.positions),
        ("velocities", &change.velocities),
        ("angular_velocities", &change.angular_velocities),
    ];
    for (name, list) in lists {
        let Some(list) = list else { continue };
        if list.len() != count {
            return Err(format!("{name}: {} vectors for {count} particles", list.len()));
        }
        for (i, &value) in list.iter().enumerate() {
            vector(system, name, i, value)?;
        }
    }
    for (k, new) in change.add.iter().enumerate() {
        vector(system, "positions", k, new.position)?;
        vector(system, "velocities", k, new.velocity)?;
        vector(system, "angular_velocities", k, new.angular_velocity)?;
        size_and_mass(system, k, new)?;
    }
    if change.positions.is_some() && system.measure.correlations.msd.any() {
        let why =
            "positions: the mean square displacement (measure.msd) follows the particles: none can be moved";
        return Err(why.to_owned());
    }
    Ok(())
}

/// Checks a vector of a list.
fn vector(system: &System, name: &str, i: usize, value: DVec3) -> Checked {
    if let Err((axis, why)) = bounds::vector(value) {
        return Err(format!("{name}[{i}, {axis}] = {}: {why}", significant(value[axis], 6)));
    }
    let spins = name == "angular_velocities";
    if system.dimension == Dimension::Two {
        let (off, allowed) = if spins {
            (value.x != 0.0 || value.y != 0.0, "must be along z in two dimensions")
        } else {
            (value.z != 0.0, "must have z = 0 in two dimensions")
        };
        if off {
            let numbers = value.to_array().map(|x| significant(x, 6));
            return Err(format!("{name}[{i}] = [{}]: {allowed}", numbers.join(", ")));
        }
    }
    let periodic = |&axis: &usize| system.domain.boundary[axis] == Boundary::Periodic;
    if name == "positions"
        && let Some(axis) =
            (0..3).filter(periodic).find(|&axis| value[axis].abs() > MOST_IMAGES * system.domain.size[axis])
    {
        return Err(format!(
            "{name}[{i}, {axis}] = {}: must be at most {} in size, {MOST_IMAGES:e} edges of the periodic box",
            significant(value[axis], 6),
            significant(MOST_IMAGES * system.domain.size[axis], 6)
        ));
    }
    Ok(())
}

/// Checks the radius, the mass and the species of the k-th added particle.
fn size_and_mass(system: &System, k: usize, new: &NewParticle) -> Checked {
    let NewParticle { radius, mass, species, .. } = *new;
    let of_radius = |why: &str| Err(format!("radius[{k}] = {}: {why}", significant(radius, 6)));
    let of_mass = |why: &str| Err(format!("mass[{k}] = {}: {why}", significant(mass, 6)));
    if let Err(why) = bounds::positive(radius) {
        return of_radius(why);
    }
    if let Err(why) = bounds::mass(mass) {
        return of_mass(why);
    }
    if Deformation::of(system).is_some() && mass == f64::INFINITY {
        return of_mass("must be finite in a box that deforms");
    }
    for axis in 0..system.dimension.count() {
        let edge = system.domain.size[axis];
        if system.domain.boundary[axis] != Boundary::Periodic {
            continue;
        }
        let sheared = system.domain.shear.is_some_and(|shear| shear.gradient == axis);
        let diameters = if sheared { bounds::LEAST_SHEARED_EDGE } else { 1.0 };
        if edge < diameters * 2.0 * radius {
            let most = significant(edge / (2.0 * diameters), 6);
            return of_radius(&format!("must be at most {most}: the particle would touch its own image"));
        }
    }
    let holes = system.walls.iter().filter_map(|wall| wall.shape.as_ref()?.hole());
    if holes.into_iter().any(|hole| hole.radius < radius * bounds::LEAST_HOLE) {
        return of_radius("must be smaller than every hole of the walls");
    }
    let Some(name) = system.species.get(species as usize) else {
        return Err(format!("species = {species}: must be one of {}", system.species.len()));
    };
    if !system.groups.iter().any(|group| group.name == *name) {
        return Err(format!("species = {name}: has no laws of contact"));
    }
    Ok(())
}

/// Checks the radii against the coordinates that a change gives, and bodies of infinite mass that it places
/// against walls that oscillate. `system` is that after the change, and `first` the number of its particles
/// that have been there before.
pub(super) fn places(system: &System, change: &Change, first: usize) -> Checked {
    let positions = change.positions.iter().flatten().copied();
    let given = positions.chain(change.add.iter().map(|new| new.position));
    let farthest = given.fold(0.0, |extent: f64, position| extent.max(position.abs().max_element()));
    if change.positions.is_none() && change.add.is_empty() {
        return Ok(());
    }
    let closed = |&axis: &usize| system.domain.boundary[axis] != Boundary::Open;
    let edges = (0..system.dimension.count()).filter(closed).map(|axis| system.domain.size[axis]);
    let extent = edges.fold(farthest, f64::max);
    for (i, body) in system.bodies.iter().enumerate() {
        let class = &system.classes[body.class as usize];
        let name = if i < first { format!("particle {i}: radius") } else { format!("radius[{}]", i - first) };
        if let Err(why) = bounds::resolved(class.radius, extent) {
            return Err(format!("{name} = {}: {why}", significant(class.radius, 6)));
        }
        let is_placed = i >= first || change.positions.is_some();
        if class.mass != f64::INFINITY || !is_placed {
            continue;
        }
        let moving = |motion: &WallMotion| matches!(motion, WallMotion::Oscillating(_));
        for wall in system.walls.iter().filter(|wall| moving(&wall.motion)) {
            let gap = (body.position - wall.point).dot(wall.normal) - class.radius;
            if gap < wall.motion.sweep(wall.normal) {
                let what =
                    if i < first { format!("positions[{i}]") } else { format!("positions[{}]", i - first) };
                return Err(format!(
                    "{what}: the wall \"{}\" would sweep through this body of infinite mass",
                    wall.name
                ));
            }
        }
    }
    Ok(())
}

/// Refuses an added body of infinite mass that overlaps with another one. Later they move through each other.
pub(super) fn fixed_bodies(system: &System, first: usize) -> Checked {
    let periodicity = Periodicity::of(&system.domain);
    let class = |i: usize| &system.classes[system.bodies[i].class as usize];
    let fixed: Vec<usize> = (0..system.bodies.len()).filter(|&i| class(i).mass == f64::INFINITY).collect();
    for (k, &i) in fixed.iter().enumerate().filter(|(_, i)| **i >= first) {
        for &j in &fixed[..k] {
            let apart = periodicity.nearest(system.bodies[i].position - system.bodies[j].position).length();
            let contact = class(i).radius + class(j).radius;
            if apart < contact * (1.0 - TOLERANCE) {
                let depth = 1.0 - apart / contact;
                return Err(format!(
                    "particle {j} would overlap with particle {i} by {depth:.1e} contact distances"
                ));
            }
        }
    }
    Ok(())
}

/// A position from outside, wrapped into the box, and the image numbers of a particle that had those of
/// `image`. Under shear the velocity that is given with it is the one in the box.
pub(super) fn wrapped(world: &World, position: DVec3, image: [i32; 3]) -> Result<(DVec3, [i32; 3]), String> {
    let far = |axis: usize| {
        let most = significant(MOST_IMAGES, 3);
        Err(format!(
            "positions: {} along {} is farther from the box than images are counted, {most} of its edges",
            significant(position[axis], 6),
            ["x", "y", "z"][axis]
        ))
    };
    if let Some(shear) = world.shear() {
        let up = world.boundary.periodicity.wrap(position).1[shear.gradient];
        if (f64::from(up) * world.displacement(world.now).turns as f64).abs() > MOST_IMAGES {
            return far(shear.gradient);
        }
    }
    let (position, wraps, _) = world.wrap(position, world.now);
    let mut sum = image;
    for axis in 0..3 {
        match image[axis].checked_add(wraps[axis]) {
            Some(total) if f64::from(total).abs() <= MOST_IMAGES => sum[axis] = total,
            _ => return far(axis),
        }
    }
    Ok((position, sum))
}
