//! Worked examples of CONTRIBUTING.md: one implementation for each seam of the engine. They are compiled and
//! run by the tests, and CONTRIBUTING.md quotes them.

mod boundary;
mod event;
mod observable;
mod pair_law;
mod wall_law;

use glam::DVec3;

use crate::{
    Simulation,
    model::{
        Body, Boundary, Class, Contacts, Dimension, Domain, Group, Options, Restitution, System, Wall,
        wall_law::WallLaw, wall_motion::WallMotion,
    },
};

/// Two spheres of radius 0.5 and mass 1 that approach each other along x at relative speed 2, above a floor.
fn two_spheres() -> Simulation {
    let body = |x: f64, speed: f64| Body {
        position: DVec3::new(x, 2.0, 2.0),
        velocity: DVec3::new(speed, 0.0, 0.0),
        image: [0; 3],
        class: 0,
        species: 0,
    };
    let system = System {
        dimension: Dimension::Three,
        domain: Domain {
            size: DVec3::splat(10.0),
            boundary: [Boundary::Periodic, Boundary::Periodic, Boundary::Wall],
            gravity: DVec3::ZERO,
            shear: None,
            compression: None,
        },
        bodies: vec![body(4.0, 1.0), body(6.0, -1.0)],
        classes: vec![Class { radius: 0.5, mass: 1.0, group: 0 }],
        groups: vec![Group { name: "spheres".to_owned() }],
        species: vec!["spheres".to_owned()],
        walls: vec![Wall {
            name: "floor".to_owned(),
            point: DVec3::ZERO,
            normal: DVec3::Z,
            motion: WallMotion::Fixed,
            shape: None,
        }],
        contacts: Contacts {
            pair: vec![Restitution::Constant(0.5)],
            wall: vec![WallLaw::Restitution(Restitution::Constant(1.0))],
            tc: 0.0,
            rest_speed: 0.0,
        },
        spin: None,
        drag: None,
        drives: Vec::new(),
        measure: crate::Measure::default(),
        flow: None,
        seed: 0,
    };
    Simulation::new(system, Options::default()).expect("the system is valid")
}
