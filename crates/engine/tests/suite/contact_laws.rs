//! Laws of contact that add speed, or draw their coefficient.

use glam::DVec3;
use haff_engine::{
    Boundary, Dimension, EventKind, EventRecord, Options, Simulation, Stop, System, Until, Wall, WallMotion,
};
use haff_mechanics::{Restitution, Scatter, reduced_mass};

use crate::common::{Log, Random, add, check_independence, class, scatter, system};

/// Numbers of grains, and their masses.
const COUNTS: [usize; 2] = [60, 30];
const KINDS: [f64; 2] = [1.0, 3.0];

/// The mass of a grain.
fn mass(i: usize) -> f64 {
    KINDS[usize::from(i >= COUNTS[0])]
}

/// Two kinds of grains in a box; they fall to a floor if `falls`.
fn grains(law: Restitution, falls: bool, seed: u64) -> System {
    let boundary =
        if falls { [Boundary::Periodic, Boundary::Wall, Boundary::Wall] } else { [Boundary::Periodic; 3] };
    let mut scene = system(Dimension::Three, DVec3::splat(8.0), boundary);
    let (small, large) = (class(&mut scene, 0.3, KINDS[0]), class(&mut scene, 0.5, KINDS[1]));
    let mut random = Random(seed);
    scatter(&mut scene, small, COUNTS[0], 1.0, &mut random);
    scatter(&mut scene, large, COUNTS[1], 1.0, &mut random);
    scene.domain.gravity = if falls { DVec3::new(0.0, 0.0, -0.3) } else { DVec3::ZERO };
    scene.contacts.pair = vec![law; scene.groups.len().pow(2)];
    scene.contacts.wall = vec![law.into(); scene.groups.len() * scene.walls.len()];
    scene
}

fn run(scene: System, time: f64) -> (Log, Simulation) {
    let mut simulation = Simulation::new(scene, Options::default()).unwrap();
    let mut log = Log::default();
    simulation.advance(Until { time, ..Until::default() }, &mut log).unwrap();
    (log, simulation)
}

/// The coefficient of restitution in a row: ½ μ v² (1 − e²) is lost.
fn coefficient(row: &EventRecord, mu: f64) -> f64 {
    (1.0 - 2.0 * row.energy_loss / (mu * row.approach_speed * row.approach_speed)).max(0.0).sqrt()
}

fn random_law() -> Restitution {
    Restitution::random(Scatter::Uniform([0.5, 0.9])).unwrap()
}

#[test]
fn the_laws_give_the_same_run_with_every_search_and_after_a_resumption() {
    let added = Restitution::Constant(0.8).with_added_speed(0.02);
    let both = random_law().with_added_speed(0.01);
    for (law, falls, seed) in [
        (random_law(), false, 1),
        (random_law(), true, 2),
        (added, false, 3),
        (added, true, 4),
        (both, true, 5),
    ] {
        check_independence(&grains(law, falls, seed), &[1.0, 3.0, 6.0]);
    }
}

#[test]
fn each_contact_adds_twice_the_speed() {
    let (e, delta) = (0.7, 0.05);
    let (log, simulation) = run(grains(Restitution::Constant(e).with_added_speed(delta), true, 6), 20.0);
    let mut gained = 0;
    for row in &log.0 {
        let (i, j) = (row.i as usize, row.j as usize);
        let mu = match row.kind {
            EventKind::Collision => reduced_mass(mass(i), mass(j)),
            EventKind::Wall => mass(i),
            _ => continue,
        };
        let v = row.approach_speed;
        let after = e * v + 2.0 * delta;
        let scale = mu * (v * v + after * after);
        assert!((row.impulse - mu * (v + after)).abs() < 1e-13 * mu * (v + after), "{row:?}");
        assert!((row.energy_loss - 0.5 * mu * (v * v - after * after)).abs() < 1e-13 * scale, "{row:?}");
        gained += usize::from(row.energy_loss < 0.0);
    }
    assert!(gained > 100 && gained < log.0.len(), "{gained} of {} contacts gain energy", log.0.len());
    assert!(simulation.ledger().residual.abs() < 1e-13, "{:?}", simulation.ledger());
}

/// Mean and variance of the coefficients in the log, and their correlation with the approach speed and from
/// each contact of a grain to its next, by z-scores.
#[test]
fn coefficients_in_the_log_are_independent_draws() {
    let (low, high) = (0.5_f64, 0.9_f64);
    let (log, _) = run(grains(random_law(), false, 7), 200.0);
    let mut last = vec![None; COUNTS.iter().sum()];
    let (mut n, mut sum, mut squares, mut with_speed, mut pairs, mut with_last) =
        (0.0_f64, 0.0, 0.0, 0.0, 0.0_f64, 0.0);
    let (mean, variance) = (0.5 * (low + high), (high - low).powi(2) / 12.0);
    let mut speeds = Vec::new();
    for row in &log.0 {
        let [i, j] = [row.i as usize, row.j as usize];
        let e = coefficient(row, reduced_mass(mass(i), mass(j)));
        assert!((low - 1e-9..high + 1e-9).contains(&e), "{row:?}: {e}");
        n += 1.0;
        sum += e - mean;
        squares += (e - mean).powi(2);
        speeds.push((row.approach_speed.ln(), e - mean));
        for k in [i, j] {
            if let Some(before) = last[k].replace(e - mean) {
                pairs += 1.0;
                with_last += before * (e - mean);
            }
        }
    }
    let average = speeds.iter().map(|(speed, _)| speed).sum::<f64>() / n;
    let spread = speeds.iter().map(|(speed, _)| (speed - average).powi(2)).sum::<f64>();
    for (speed, e) in speeds {
        with_speed += (speed - average) * e;
    }
    // The fourth central moment of a uniform distribution of width w is w⁴/80.
    let fourth = (high - low).powi(4) / 80.0;
    let z = [
        sum / (n * variance).sqrt(),
        (squares - n * variance) / (n * (fourth - variance * variance)).sqrt(),
        with_speed / (variance * spread).sqrt(),
        with_last / (variance * pairs.sqrt()),
    ];
    assert!(n > 1000.0 && z.iter().all(|z| z.abs() < 4.0), "{n} contacts: z = {z:?}");
}

/// A ball on a floor whose coefficient is drawn comes to rest, and the energy of the fall is lost.
#[test]
fn a_ball_comes_to_rest_by_random_coefficients() {
    for scatter in [
        Scatter::Uniform([0.3, 0.9]),
        Scatter::Values(vec![0.5, 1.0]),
        Scatter::Values(vec![1.0, 0.5]),
        Scatter::Normal([0.8, 0.1]),
    ] {
        let mut scene = system(Dimension::Three, DVec3::splat(1.0), [Boundary::Open; 3]);
        scene.domain.gravity = DVec3::new(0.0, 0.0, -9.81);
        let floor = Wall {
            name: "floor".into(),
            point: DVec3::ZERO,
            normal: DVec3::Z,
            motion: WallMotion::Fixed,
            shape: None,
        };
        scene.walls.push(floor);
        scene.contacts.wall.push(Restitution::random(scatter.clone()).unwrap().into());
        let ball = class(&mut scene, 0.5, 2.0);
        add(&mut scene, ball, DVec3::new(0.0, 0.0, 1.5), DVec3::new(0.1, 0.0, 0.0));
        let mut simulation = Simulation::new(scene, Options::default()).unwrap();
        let mut log = Log::default();
        let stop = simulation.advance(Until { time: 1e4, ..Until::default() }, &mut log).unwrap();
        // It slides on for ever.
        assert_eq!((stop, log.0.last().unwrap().kind), (Stop::Time, EventKind::Rest), "{scatter:?}");
        let lost: f64 = log.0.iter().map(|row| row.energy_loss).sum();
        assert!((lost / (2.0 * 9.81) - 1.0).abs() < 1e-12, "{scatter:?}: {lost}");
        assert_eq!(simulation.frame().position[0].z, 0.5);
        // The series ends where its height is nothing, whatever would be drawn next.
        assert!(log.0.last().unwrap().approach_speed < 1e-6, "{scatter:?}: {:?}", log.0.last());
    }
}

/// Grains whose coefficient is drawn are put to rest on a floor and on each other.
#[test]
#[ignore = "long: scripts/test all"]
fn grains_with_random_coefficients_come_to_rest() {
    let mut scene = grains(random_law(), true, 9);
    scene.contacts.rest_speed = 0.05;
    let simulation = check_independence(&scene, &[5.0, 20.0, 80.0]);
    assert!(simulation.counters().rests > 20, "{:?}", simulation.counters());
}
