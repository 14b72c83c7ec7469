//! The end of series of bounces on surfaces of any kind: curved, moving, in corners. The events of each
//! scene stay few, and a grain then follows its surface.

use std::f64::consts::TAU;

use glam::DVec3;
use haff_engine::{
    Boundary, Dimension, Hole, Options, Oscillating, Partition, Shape, Silent, Simulation, System, Until,
    Wall, WallMotion,
};
use haff_mechanics::{Oscillation, Restitution, Waveform};

use crate::common::{self, add, check_independence, class, set_restitution, system};

/// Heights of hops are 5·10⁻⁷ radii.
const HOPS: f64 = 1e-6;

fn until(time: f64) -> Until {
    Until { time, ..Until::default() }
}

/// Disks in open space under gravity 1.
fn open(e: f64) -> System {
    let mut scene = system(Dimension::Two, DVec3::splat(10.0), [Boundary::Open; 3]);
    set_restitution(&mut scene, e);
    scene.domain.gravity = -DVec3::Y;
    scene
}

/// A disk of radius 0.2 above a fixed one of radius 0.3 at the origin, at this place.
fn above_a_fixed_disk(e: f64, place: DVec3) -> System {
    let mut scene = open(e);
    let (fixed, free) = (class(&mut scene, 0.3, f64::INFINITY), class(&mut scene, 0.2, 2.0));
    add(&mut scene, fixed, DVec3::ZERO, DVec3::ZERO);
    add(&mut scene, free, place, DVec3::ZERO);
    scene
}

fn wall(name: &str, point: DVec3, normal: DVec3, motion: WallMotion) -> Wall {
    Wall { name: name.into(), point, normal, motion, shape: None }
}

fn events(simulation: &Simulation) -> u64 {
    let counters = simulation.counters();
    counters.collisions + counters.wall_collisions
}

#[test]
#[ignore = "long: scripts/test all"]
fn bounces_on_top_of_a_fixed_disk_end() {
    for e in [0.0, 0.4, 0.9] {
        let scene = above_a_fixed_disk(e, DVec3::Y * 1.5);
        let mut simulation = check_independence(&scene, &[1.5, 40.0]);
        let frame = simulation.frame();
        assert_eq!(frame.position[1].x, 0.0);
        let height = frame.position[1].y - 0.5;
        assert!((0.0..HOPS * 0.2).contains(&height), "{e}: {height:e} above the fixed disk");
        // 2 u/a a hop, with u = 10⁻³ √(a R).
        let hops = 40.0 / (2e-3 * f64::sqrt(0.2));
        assert!((events(&simulation) as f64) < 1.01 * hops, "{e}: {} events", events(&simulation));
        let lost = simulation.sample().ledger.dissipated / (2.0 * 1.0);
        assert!((lost - 1.0).abs() < HOPS, "{e}: {lost} of the energy of the fall");
    }
}

/// Without friction a particle that slides from rest at the angle θ₀ leaves the circle where cos θ = ⅔ cos
/// θ₀.
#[test]
fn a_disk_slides_along_a_fixed_one_and_leaves_it_where_it_no_longer_presses() {
    let start: f64 = 0.3;
    let scene = above_a_fixed_disk(0.3, 0.5 * DVec3::new(start.sin(), start.cos(), 0.0));
    check_independence(&scene, &[0.5, 1.2, 1.5]);
    let mut rows = common::Log::default();
    let mut simulation = Simulation::new(scene, Options::default()).unwrap();
    simulation.advance(until(4.0), &mut rows).unwrap();
    let left = rows.0.last().unwrap().normal.y.abs();
    let expected = 2.0 / 3.0 * start.cos();
    // Where the pressure tends to zero hops become longer: as the square root of their speed, at most.
    assert!((left - expected).abs() < 2e-2, "it leaves at cos θ = {left}, expected {expected}");
    let frame = simulation.frame();
    let energy = 0.5 * frame.velocity[1].length_squared() + frame.position[1].y;
    assert!((energy - 0.5 * start.cos()).abs() < HOPS, "{energy}");
    assert!(simulation.ledger().residual.abs() < 1e-13);
}

/// Half of gravity presses a disk against a wall at rest, all of it against an oscillating floor.
#[test]
fn bounces_in_the_corner_of_a_wall_and_an_oscillating_floor_end() {
    for gravity in [DVec3::new(-0.5, -1.0, 0.0), DVec3::new(-1.0, -0.5, 0.0)] {
        for e in [0.0, 0.5, 0.9] {
            let mut scene = open(e);
            scene.domain.gravity = gravity;
            let disk = class(&mut scene, 0.5, 1.0);
            add(&mut scene, disk, DVec3::new(1.0, 1.0, 0.0), DVec3::ZERO);
            let oscillation = Oscillation { waveform: Waveform::Sine, amplitude: 0.1, frequency: 0.1 };
            let motion = WallMotion::Oscillating(Oscillating { oscillation, cycles: 0.0 });
            scene.walls.push(wall("x-", DVec3::ZERO, DVec3::X, WallMotion::Fixed));
            scene.walls.push(wall("y-", DVec3::ZERO, DVec3::Y, motion));
            scene.contacts.wall = vec![Restitution::Constant(e).into(); 2];
            let simulation = check_independence(&scene, &[3.0, 20.0, 33.0, 100.0]);
            let count = events(&simulation);
            assert!(count < 2000, "{gravity}, {e}: {count} events");
            let frame = simulation.frame();
            let floor = 0.1 * (TAU * 0.1 * 100.0_f64).sin();
            let off = frame.position[0] - DVec3::new(0.5, 0.5 + floor, 0.0);
            assert!(off.length() < 1e-11, "{gravity}, {e}: {off}");
        }
    }
}

/// A plate that shakes so strongly that it throws a grain up which leans against a wall.
#[test]
fn a_wall_still_supports_a_grain_that_the_floor_releases() {
    let mut scene = open(0.4);
    scene.domain.gravity = DVec3::new(-0.3, -1.0, 0.0);
    let disk = class(&mut scene, 0.05, 1.0);
    add(&mut scene, disk, DVec3::new(0.1, 0.4, 0.0), DVec3::ZERO);
    let oscillation = Oscillation { waveform: Waveform::Sine, amplitude: 0.06, frequency: 1.0 };
    let motion = WallMotion::Oscillating(Oscillating { oscillation, cycles: 0.3 });
    scene.walls.push(wall("x-", DVec3::ZERO, DVec3::X, WallMotion::Fixed));
    scene.walls.push(wall("y-", DVec3::ZERO, DVec3::Y, motion));
    scene.contacts.wall = vec![Restitution::Constant(0.4).into(); 2];
    scene.measure.wall_forces = true;
    let mut simulation = check_independence(&scene, &[0.5, 3.0, 3.3, 7.0, 20.0]);
    assert_eq!(simulation.frame().position[0].x, 0.05);
    simulation.sample();
    let (momentum, start) = (simulation.frame().velocity[0], simulation.time());
    simulation.advance(until(25.0), &mut Silent).unwrap();
    let sample = simulation.sample();
    // Forces on the walls, gravity and the change of momentum balance.
    let force: DVec3 = sample.wall_force.iter().sum();
    let gained = simulation.frame().velocity[0] - momentum;
    let off = gained - (DVec3::new(-0.3, -1.0, 0.0) - force) * (25.0 - start);
    assert!(off.length() < 1e-12, "{off}");
    assert!(sample.ledger.residual.abs() < 1e-13, "{:e}", sample.ledger.residual);
}

/// A floor at a constant velocity, level and tilted, and a partition: a grain stays on each.
#[test]
fn bounces_on_walls_of_constant_velocity_and_on_partitions_end() {
    for normal in [DVec3::Y, DVec3::new(0.6, 0.8, 0.0)] {
        let mut scene = open(0.5);
        let disk = class(&mut scene, 0.5, 1.0);
        add(&mut scene, disk, normal * 0.7, DVec3::ZERO);
        scene.walls.push(wall("floor", DVec3::ZERO, normal, (normal * 0.1).into()));
        scene.contacts.wall = vec![Restitution::Constant(0.5).into()];
        let simulation = check_independence(&scene, &[1.0, 20.0]);
        let gap = simulation.frame().position[0].dot(normal) - 0.1 * 20.0 - 0.5;
        assert!((-1e-13..HOPS * 0.5).contains(&gap), "{normal}: {gap:e}");
        assert!(events(&simulation) < 20_000, "{normal}: {} events", events(&simulation));
        assert!(simulation.ledger().residual.abs() < 1e-13);
    }
    let mut scene = system(Dimension::Two, DVec3::new(8.0, 8.0, 1.0), [Boundary::Wall; 3]);
    scene.domain.gravity = -DVec3::Y;
    let disk = class(&mut scene, 0.5, 1.0);
    add(&mut scene, disk, DVec3::new(2.0, 6.0, 0.0), DVec3::ZERO);
    let hole = Some(Hole { center: DVec3::new(6.0, 4.0, 0.0), radius: 1.0 });
    let mut plate = wall("plate", DVec3::new(0.0, 4.0, 0.0), DVec3::Y, WallMotion::Fixed);
    plate.shape = Some(Shape::Partition(Partition { point: plate.point, normal: plate.normal, hole }));
    scene.walls.push(plate);
    scene.contacts.wall = vec![Restitution::Constant(0.5).into(); 5];
    let simulation = check_independence(&scene, &[2.0, 20.0]);
    let gap = simulation.frame().position[0].y - 4.5;
    assert!((0.0..HOPS * 0.5).contains(&gap), "{gap:e}");
    assert!(events(&simulation) < 20_000, "{} events", events(&simulation));
}
