//! Systems for measurements: equal spheres of unit diameter and mass, and parts of the scenes with
//! closed-form solutions.

use glam::DVec3;
use haff_engine::{
    Body, Boundary, Class, Contacts, Dimension, Domain, Frame, Group, Options, Silent, Simulation, System,
    Until, Wall, WallMotion, model::Restitution,
};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

use crate::Error;

/// An empty box of three dimensions with one restitution for pairs and one for walls.
pub fn empty(size: DVec3, boundary: [Boundary; 3], restitution: f64, wall_restitution: f64) -> System {
    let mut walls = Vec::new();
    for (axis, name) in ["x", "y", "z"].into_iter().enumerate() {
        if boundary[axis] == Boundary::Wall {
            let unit = DVec3::AXES[axis];
            let wall = |side, point, normal| Wall {
                name: format!("{name}{side}"),
                point,
                normal,
                motion: WallMotion::Fixed,
                shape: None,
            };
            walls.push(wall('-', DVec3::ZERO, unit));
            walls.push(wall('+', unit * size, -unit));
        }
    }
    System {
        dimension: Dimension::Three,
        domain: Domain { size, boundary, gravity: DVec3::ZERO, shear: None, compression: None },
        bodies: Vec::new(),
        classes: Vec::new(),
        groups: vec![Group { name: "sphere".to_owned() }],
        species: vec!["sphere".to_owned()],
        contacts: Contacts {
            pair: vec![Restitution::Constant(restitution)],
            wall: vec![(Restitution::Constant(wall_restitution)).into(); walls.len()],
            tc: 0.0,
            rest_speed: 0.0,
        },
        walls,
        spin: None,
        drag: None,
        drives: Vec::new(),
        measure: haff_engine::Measure::default(),
        flow: None,
        seed: 0,
    }
}

/// Adds a plane wall at rest; its unit normal points to the inside.
pub fn add_wall(system: &mut System, name: &str, point: DVec3, normal: DVec3, restitution: f64) {
    system.walls.push(Wall { name: name.to_owned(), point, normal, motion: WallMotion::Fixed, shape: None });
    system.contacts.wall.push((Restitution::Constant(restitution)).into());
}

/// Adds a sphere.
pub fn add_sphere(system: &mut System, radius: f64, mass: f64, position: DVec3, velocity: DVec3) {
    let class = Class { radius, mass, group: 0 };
    let known = system.classes.iter().position(|other| *other == class);
    let class = known.unwrap_or_else(|| {
        system.classes.push(class);
        system.classes.len() - 1
    });
    system.bodies.push(Body { position, velocity, image: [0; 3], class: class as u32, species: 0 });
}

/// A gas of `per_edge`³ spheres of unit diameter, mass and temperature on a simple cubic lattice in a cube,
/// with zero momentum. `boundary`: periodic or walls. Packing fractions up to π/6 = 0.52 fit on the lattice.
pub fn gas(
    per_edge: usize,
    packing_fraction: f64,
    boundary: Boundary,
    restitution: f64,
    seed: u64,
) -> System {
    let count = per_edge.pow(3);
    let edge = (count as f64 * std::f64::consts::FRAC_PI_6 / packing_fraction).cbrt();
    // Centres are at least half a diameter from walls: the lattice is smaller by that.
    let (room, margin) = if boundary == Boundary::Wall { (edge - 1.0, 0.5) } else { (edge, 0.0) };
    let mut system = empty(DVec3::splat(edge), [boundary; 3], restitution, 1.0);
    let mut random = Pcg64Mcg::seed_from_u64(seed);
    let step = room / per_edge as f64;
    for i in 0..count {
        let site =
            [i % per_edge, i / per_edge % per_edge, i / per_edge.pow(2)].map(|k| (k as f64 + 0.5) * step);
        let velocity = DVec3::from_array([0; 3].map(|_| normal(&mut random)));
        add_sphere(&mut system, 0.5, 1.0, DVec3::from_array(site) + margin, velocity);
    }
    let mean = system.bodies.iter().map(|body| body.velocity).sum::<DVec3>() / count as f64;
    let square = system.bodies.iter().map(|body| (body.velocity - mean).length_squared()).sum::<f64>();
    let scale = (3.0 * count as f64 / square).sqrt();
    for body in &mut system.bodies {
        body.velocity = (body.velocity - mean) * scale;
    }
    system
}

/// The system after `collisions` for each particle; every collision counts for both partners.
pub fn melted(system: &System, collisions: f64) -> Result<System, Error> {
    let mut simulation = Simulation::new(system.clone(), Options::default())?;
    let total = (0.5 * collisions * system.bodies.len() as f64).round() as u64;
    simulation.advance(Until { collisions: total, ..Until::default() }, &mut Silent)?;
    Ok(with_state(system, &simulation.frame()))
}

/// The system with its particles in the state of a frame.
pub fn with_state(system: &System, frame: &Frame) -> System {
    let mut system = system.clone();
    for (body, (position, velocity)) in
        system.bodies.iter_mut().zip(frame.position.iter().zip(&frame.velocity))
    {
        (body.position, body.velocity) = (*position, *velocity);
    }
    system
}

/// The system with all velocities multiplied by the same number, so that its temperature is 1.
pub fn at_unit_temperature(mut system: System) -> System {
    let n = system.bodies.len() as f64;
    let mean = system.bodies.iter().map(|body| body.velocity).sum::<DVec3>() / n;
    let square = system.bodies.iter().map(|body| (body.velocity - mean).length_squared()).sum::<f64>();
    for body in &mut system.bodies {
        body.velocity = (body.velocity - mean) * (3.0 * n / square).sqrt();
    }
    system
}

/// Moves each coordinate and velocity to the next f64, up or down at random.
pub fn perturbed(mut system: System, seed: u64) -> System {
    let mut random = Pcg64Mcg::seed_from_u64(seed);
    for body in &mut system.bodies {
        for vector in [&mut body.position, &mut body.velocity] {
            for axis in 0..3 {
                let x = vector[axis];
                vector[axis] = if random.random_bool(0.5) { x.next_up() } else { x.next_down() };
            }
        }
    }
    system
}

/// Normal deviate of unit variance (Box and Muller).
fn normal(random: &mut Pcg64Mcg) -> f64 {
    let (a, b): (f64, f64) = (random.random(), random.random());
    (-2.0 * (1.0 - a).ln()).sqrt() * (std::f64::consts::TAU * b).cos()
}
