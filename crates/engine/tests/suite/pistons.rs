//! Pistons: contact times and impacts in closed form, energies in balance, reversal, and the statistics of a
//! gas at constant load.

use glam::DVec3;
use haff_engine::{
    Boundary, Dimension, Options, Oscillating, Silent, Simulation, Spin, System, Term, ThermalWall, Until,
    Wall, WallLaw, WallMotion,
};
use haff_mechanics::{Oscillation, Restitution, Roughness, Waveform};
use haff_testing::Random;

use crate::common::{
    add, check_independence, class,
    features::{add_wall, lid},
    scatter, set_restitution, system,
};

const TUBE: [Boundary; 3] = [Boundary::Periodic, Boundary::Periodic, Boundary::Open];

fn until(time: f64) -> Until {
    Until { time, ..Until::default() }
}

/// A fixed floor at z = 0, and nothing above.
fn floor(scene: &mut System, e: f64) {
    let (point, normal, motion) = (DVec3::ZERO, DVec3::Z, WallMotion::Fixed);
    add_wall(scene, Wall { name: "floor".into(), point, normal, motion, shape: None });
    let count = scene.walls.len();
    let last = scene.contacts.wall.iter_mut().skip(count - 1).step_by(count);
    last.for_each(|law| *law = Restitution::Constant(e).into());
}

/// Grains of two sizes between a floor and a lid.
fn press(e: f64, gravity: f64, [mass, force]: [f64; 2]) -> System {
    let mut scene = system(Dimension::Three, DVec3::new(7.0, 7.0, 12.0), TUBE);
    scene.domain.gravity.z = -gravity;
    for (radius, seed) in [(0.5, 3), (0.3, 4)] {
        let kind = class(&mut scene, radius, (2.0 * radius).powi(3));
        scatter(&mut scene, kind, 60, 1.0, &mut Random(seed));
    }
    set_restitution(&mut scene, e);
    floor(&mut scene, e);
    lid(&mut scene, 13.0, [mass, force], false);
    scene
}

#[test]
fn no_search_slice_or_resumption_changes_what_happens() {
    let times = [0.5, 3.0, 11.0];
    check_independence(&press(1.0, 0.0, [20.0, 30.0]), &times);
    check_independence(&press(0.9, 1.0, [5.0, 30.0]), &times);
    // A piston that falls by its weight alone, and contacts that are elastic soon after others.
    let mut scene = press(0.6, 0.5, [100.0, 0.0]);
    scene.contacts.tc = 1e-3;
    check_independence(&scene, &[1.0, 8.0]);
    // Between two gases, and above both of them another one.
    let mut scene = press(1.0, 0.0, [20.0, 40.0]);
    scene.bodies.retain(|body| (body.position.z - 6.0).abs() > 0.6);
    lid(&mut scene, 6.0, [10.0, 0.0], true);
    check_independence(&scene, &times);
    // Rough grains.
    let mut scene = press(0.9, 0.2, [5.0, 30.0]);
    let law = Roughness { tangential_restitution: 0.5, friction: 0.3 };
    scene.spin = Some(Spin {
        inertia: vec![0.4; scene.groups.len()],
        angular_velocity: vec![DVec3::ZERO; scene.bodies.len()],
        pair: vec![law; scene.contacts.pair.len()],
        wall: vec![law; scene.contacts.wall.len()],
    });
    check_independence(&scene, &[1.0, 5.0]);
    // Grains that a shaken floor carries.
    let mut scene = press(0.7, 1.0, [15.0, 0.0]);
    let oscillation = Oscillation { waveform: Waveform::Sine, amplitude: 0.1, frequency: 1.1 };
    scene.walls[0].motion = WallMotion::Oscillating(Oscillating { oscillation, cycles: 0.0 });
    scene.bodies.retain(|body| body.position.z > 1.0);
    scene.bodies.truncate(20);
    scene.contacts.tc = 1e-4;
    check_independence(&scene, &[2.0, 9.0]);
}

#[test]
fn a_contact_and_its_impact_are_those_of_two_bodies() {
    let mut scene = system(Dimension::Three, DVec3::splat(4.0), TUBE);
    let kind = class(&mut scene, 0.5, 2.0);
    let (z, v, height, mass, force) = (1.0, 0.7, 5.0, 3.0, 1.5);
    add(&mut scene, kind, DVec3::new(1.0, 2.0, z), DVec3::new(0.3, 0.0, v));
    set_restitution(&mut scene, 0.6);
    lid(&mut scene, height, [mass, force], false);
    let mut simulation = Simulation::new(scene, Options::default()).unwrap();
    // z + R + v t = h − ½ (F/M) t².
    let a = force / mass;
    let gap = height - z - 0.5;
    let contact = 2.0 * gap / (v + (v * v + 2.0 * a * gap).sqrt());
    let u = -a * contact;
    // (2.14) of the chapter, with the masses m and M.
    let approach = v - u;
    let reduced = 2.0 * mass / (2.0 + mass);
    let impulse = 1.6 * reduced * approach;
    let after = contact * 1.5;
    simulation.advance(until(after), &mut Silent).unwrap();
    let frame = simulation.frame();
    let [position, velocity] = frame.pistons[0];
    let rest = after - contact;
    let expected_speed = u + impulse / mass - a * rest;
    let expected = height - 0.5 * a * contact * contact + (u + impulse / mass) * rest - 0.5 * a * rest * rest;
    // Some ulp of 5, the largest coordinate, each 9e-16.
    assert!((velocity.z - expected_speed).abs() < 5e-15, "{velocity}");
    assert!((position.z - expected).abs() < 5e-15, "{position}");
    let grain = frame.velocity[0];
    assert_eq!((grain.x, grain.y), (0.3, 0.0));
    assert!((grain.z - (v - impulse / 2.0)).abs() < 1e-15, "{grain}");
    let ledger = simulation.ledger();
    let loss = 0.5 * reduced * (1.0 - 0.36) * approach * approach;
    assert!((ledger.dissipated - loss).abs() < 1e-15, "{}", ledger.dissipated);
    assert!((ledger.term(Term::LoadWork) - force * (height - expected)).abs() < 1e-14);
    assert!((ledger.pistons - 0.5 * mass * expected_speed * expected_speed).abs() < 1e-14);
    assert_eq!(ledger.term(Term::WallWork), 0.0);
    assert!(ledger.residual.abs() < 1e-15, "{}", ledger.residual);
}

#[test]
fn fixed_bodies_stop_a_piston_and_driven_ones_do_work_on_it() {
    let mut scene = system(Dimension::Three, DVec3::splat(6.0), TUBE);
    scene.domain.gravity.z = -2.0;
    let stop = class(&mut scene, 0.5, f64::INFINITY);
    add(&mut scene, stop, DVec3::splat(1.0), DVec3::ZERO);
    lid(&mut scene, 2.5, [4.0, 0.0], false);
    let mut simulation = Simulation::new(scene.clone(), Options::default()).unwrap();
    // It falls by 1 within 1, again and again.
    for k in 1..=2000_u32 {
        simulation.advance(until(2.0 * f64::from(k)), &mut Silent).unwrap();
        let [position, velocity] = simulation.frame().pistons[0];
        assert!((position.z - 2.5).abs() < 1e-11, "{k}: {position}");
        assert!(velocity.z.abs() < 1e-10, "{k}: {velocity}");
    }
    assert_eq!(simulation.counters().wall_collisions, 2000);
    assert!(simulation.ledger().residual.abs() < 1e-12);
    // The body moves up: in its frame the fall is the same.
    scene.bodies[0].velocity = DVec3::Z * 0.5;
    let mut simulation = Simulation::new(scene, Options::default()).unwrap();
    simulation.advance(until(30.0), &mut Silent).unwrap();
    let ledger = simulation.ledger();
    assert!(ledger.term(Term::WallWork) > 1.0, "{}", ledger.term(Term::WallWork));
    assert!(ledger.residual.abs() < 1e-13, "{}", ledger.residual);
}

#[test]
fn an_elastic_gas_under_a_piston_retraces_its_path() {
    let scene = press(1.0, 0.0, [20.0, 30.0]);
    let mut simulation = Simulation::new(scene, Options::default()).unwrap();
    let start = simulation.frame();
    simulation.advance(until(2.0), &mut Silent).unwrap();
    assert!(simulation.counters().wall_collisions > 20);
    simulation.reverse();
    simulation.advance(until(4.0), &mut Silent).unwrap();
    let end = simulation.frame();
    let far = start.position.iter().zip(&end.position).map(|(a, b)| (*a - *b).length()).fold(0.0, f64::max);
    // Collisions multiply rounding, 1e-15, by some ten for each that a grain has.
    assert!(far < 1e-6, "{far:e}");
    let [moved, turned] = [0, 1].map(|k| end.pistons[0][k]);
    assert!((moved - start.pistons[0][0]).length() < 1e-8, "{moved}");
    assert!((turned + start.pistons[0][1]).length() < 1e-8, "{turned}");
}

#[test]
#[ignore = "long: scripts/test all"]
fn the_balance_stays_closed_in_a_long_run() {
    for (e, gravity) in [(1.0, 0.0), (1.0, 0.5)] {
        let mut simulation = Simulation::new(press(e, gravity, [2.0, 30.0]), Options::default()).unwrap();
        simulation.advance(Until { collisions: 300_000, ..Until::default() }, &mut Silent).unwrap();
        let ledger = simulation.ledger();
        assert!(simulation.counters().wall_collisions > 50_000);
        assert!(ledger.residual.abs() < 1e-12, "gravity {gravity}: {:e}", ledger.residual);
    }
}

/// Mean of a series and its standard error, from blocks of it.
fn mean(series: &[f64]) -> (f64, f64) {
    let blocks = 50;
    let size = series.len() / blocks;
    let means: Vec<f64> =
        series.chunks_exact(size).map(|block| block.iter().sum::<f64>() / size as f64).collect();
    let mean = means.iter().sum::<f64>() / means.len() as f64;
    let spread = means.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / (means.len() - 1) as f64;
    (mean, (spread / means.len() as f64).sqrt())
}

#[test]
fn a_gas_at_constant_load_has_the_volumes_of_an_ideal_gas() {
    // N particles above a thermal floor: P(x) ∝ xᴺ exp(−F x/T), so that ⟨x⟩ = (N + 1) T/F, and the variance
    // is (N + 1)(T/F)², with the height x at which centers can be.
    let (count, temperature, force, radius) = (4, 1.3, 2.0, 1e-3);
    let mut scene = system(Dimension::Three, DVec3::splat(3.0), TUBE);
    let kind = class(&mut scene, radius, 1.0);
    let mut random = Random(11);
    scatter(&mut scene, kind, count, 1.0, &mut random);
    floor(&mut scene, 1.0);
    scene.contacts.wall[0] = WallLaw::Thermal(ThermalWall {
        temperature,
        accommodation: 1.0,
        restitution: Restitution::Constant(1.0),
    });
    lid(&mut scene, 3.5, [1.0, force], false);
    let mut simulation = Simulation::new(scene, Options::default()).unwrap();
    let interval = 2.0;
    let (mut height, mut square) = (Vec::new(), Vec::new());
    let expected = (count as f64 + 1.0) * temperature / force;
    for k in 0..100_000_u32 {
        simulation.advance(until(interval * f64::from(k)), &mut Silent).unwrap();
        let [position, velocity] = simulation.frame().pistons[0];
        if k >= 100 {
            height.push(position.z - 2.0 * radius);
            square.push((position.z - 2.0 * radius - expected).powi(2));
            assert!(velocity.is_finite());
        }
    }
    let variance = expected * temperature / force;
    for (series, expected) in [(height, expected), (square, variance)] {
        let (found, error) = mean(&series);
        let z = (found - expected) / error;
        assert!(z.abs() < 3.0 && error < 0.02 * expected, "{found} ± {error} for {expected}: z = {z:.2}");
    }
    assert!(simulation.ledger().residual.abs() < 1e-12);
}
