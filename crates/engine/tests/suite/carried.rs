//! Grains that oscillating walls carry: when their bounces end, their motion, their release, and what they
//! meet in between.

use std::f64::consts::{PI, TAU};

use glam::DVec3;
use haff_engine::{
    Body, Boundary, Dimension, EventKind, Options, Oscillating, Simulation, System, Term, Until, Wall,
    WallMotion,
};
use haff_mechanics::{Oscillation, Restitution, Waveform};

use crate::common::{Log, Random, check_independence, class, scatter, set_restitution, system};

const RADIUS: f64 = 0.05;

fn until(time: f64) -> Until {
    Until { time, ..Until::default() }
}

fn oscillating(waveform: Waveform, amplitude: f64, cycles: f64) -> WallMotion {
    WallMotion::Oscillating(Oscillating {
        oscillation: Oscillation { waveform, amplitude, frequency: 1.0 },
        cycles,
    })
}

fn ball(position: DVec3, velocity: DVec3) -> Body {
    Body { position, velocity, image: [0; 3], class: 0, species: 0 }
}

/// Balls under gravity 1 over a plate at z = 0, with a first ball at `height` above it.
fn plate(motion: WallMotion, e: f64, height: f64, velocity: DVec3) -> System {
    let mut scene = system(Dimension::Three, DVec3::splat(8.0), [Boundary::Open; 3]);
    class(&mut scene, RADIUS, 2.0);
    let shift = motion.displacement(DVec3::Z, haff_engine::Instant::ZERO).z;
    scene.bodies.push(ball(DVec3::new(1.0, 1.0, shift + height + RADIUS), velocity));
    scene.walls.push(Wall {
        name: "plate".into(),
        point: DVec3::ZERO,
        normal: DVec3::Z,
        motion,
        shape: None,
    });
    scene.contacts.wall.push(Restitution::Constant(e).into());
    set_restitution(&mut scene, e);
    scene.domain.gravity = -DVec3::Z;
    scene
}

/// The end of the bounces of a ball that starts at rest `height` above a plate A sin(2πt + θ₀), without
/// haff: each contact by bisection of the gap, and the geometric series after contacts too fast to resolve.
fn end_of_bounces(amplitude: f64, start: f64, e: f64, height: f64) -> f64 {
    let plate = |t: f64| amplitude * (TAU * t + start).sin();
    let speed = |t: f64| amplitude * TAU * (TAU * t + start).cos();
    let pressing = |t: f64| 1.0 - amplitude * TAU * TAU * (TAU * t + start).sin();
    // Height relative to the plate's shift and velocity at the last contact, and its time.
    let (mut time, mut above, mut v) = (0.0, height, 0.0);
    loop {
        let gap = |dt: f64| {
            // The difference of sines as a product keeps the digits of short flights.
            let moved = 2.0 * amplitude * (PI * dt).sin() * (TAU * (time + 0.5 * dt) + start).cos();
            above + v * dt - 0.5 * dt * dt - moved
        };
        let relative = v - speed(time);
        let p = pressing(time);
        if above == 0.0 && relative < 1e-6 * p {
            return time + 2.0 * relative / (p * (1.0 - e));
        }
        let first = if above > 0.0 { (2.0 * above / p.max(0.1)).sqrt() } else { 2.0 * relative / p };
        let mut low = 0.05 * first;
        assert!(gap(low) > 0.0);
        while gap(low * 1.001) > 0.0 {
            low *= 1.001;
        }
        let mut high = low * 1.001;
        for _ in 0..100 {
            let middle = 0.5 * (low + high);
            if gap(middle) > 0.0 { low = middle } else { high = middle }
        }
        let before = v - low;
        time += low;
        (above, v) = (0.0, speed(time) - e * (before - speed(time)));
        let _ = plate;
    }
}

#[test]
fn a_chattering_ball_is_carried_from_the_end_of_its_bounces_until_the_plate_falls_faster() {
    let mut releases = 0;
    for (gamma, e, start, height) in [
        (1.2, 0.5, 3.5, 1e-3),
        (1.2, 0.2, 4.0, 1e-2),
        (2.5, 0.3, 3.6, 1e-3),
        (1.05, 0.7, 4.0, 1e-4),
        (6.0, 0.0, 5.0, 1e-3),
    ] {
        let amplitude = gamma / (TAU * TAU);
        let motion = oscillating(Waveform::Sine, amplitude, start / TAU);
        let scene = plate(motion, e, height, DVec3::new(0.3, 0.0, 0.0));
        let mut simulation = Simulation::new(scene.clone(), Options::default()).unwrap();
        let mut log = Log::default();
        // sin θ = 1/Γ on the way up.
        let release = ((1.0 / gamma).asin() + TAU - start) / TAU;
        let lock = end_of_bounces(amplitude, start, e, height);
        assert!(lock < release);
        let path = |t: f64| amplitude * (TAU * t + start).sin() + RADIUS;
        for k in 1..50 {
            let time = lock + (release - lock) * f64::from(k) / 50.0;
            simulation.advance(until(time), &mut log).unwrap();
            let frame = simulation.frame();
            let expected = DVec3::new(1.0 + 0.3 * time, 1.0, path(time));
            let off = (frame.position[0] - expected).length();
            assert!(off < 1e-14, "Γ = {gamma}, e = {e}: off by {off:e} at {time}");
            let velocity = DVec3::new(0.3, 0.0, amplitude * TAU * (TAU * time + start).cos());
            assert!((frame.velocity[0] - velocity).length() < 1e-14);
            let sample = simulation.sample();
            assert!(sample.ledger.residual.abs() < 1e-13, "{:?}", sample.ledger);
            let given = sample.momentum - DVec3::X * 0.6 - sample.external_impulse;
            assert!(given.length() < 1e-14, "{given}");
        }
        simulation.advance(until(release + 0.01), &mut log).unwrap();
        let row = |kind| log.0.iter().find(|event| event.kind == kind).expect("a row");
        let (rest, lift) = (row(EventKind::Rest), row(EventKind::Lift));
        assert!((rest.time - lock).abs() < 1e-9, "Γ = {gamma}, e = {e}: {} for {lock}", rest.time);
        assert!((lift.time - release).abs() < 1e-9, "Γ = {gamma}, e = {e}: {} for {release}", lift.time);
        assert_eq!((lift.i, lift.j), (0, 0));
        assert!(simulation.frame().position[0].z > path(release + 0.01));
        // Many periods of flights, series of bounces and carrying.
        simulation.advance(until(200.0), &mut log).unwrap();
        let lifts = log.0.iter().filter(|event| event.kind == EventKind::Lift).count();
        releases += lifts;
        assert!(simulation.ledger().residual.abs() < 1e-12, "{:?}", simulation.ledger());
    }
    assert!(releases > 100, "{releases}");
}

#[test]
fn a_plate_that_never_falls_faster_carries_the_ball_for_ever() {
    let scene = plate(oscillating(Waveform::Sine, 0.5 / (TAU * TAU), 0.3), 0.5, 0.1, DVec3::ZERO);
    let mut simulation = Simulation::new(scene, Options::default()).unwrap();
    let mut log = Log::default();
    simulation.advance(until(1e4), &mut log).unwrap();
    assert_eq!(log.0.last().map(|event| event.kind), Some(EventKind::Rest));
    assert!(log.0.last().unwrap().time < 10.0);
    let height = simulation.frame().position[0].z;
    let plate = 0.5 / (TAU * TAU) * (TAU * 0.3).sin() + RADIUS;
    assert!((height - plate).abs() < 1e-11, "{height} for {plate}");
    assert!(simulation.ledger().residual.abs() < 1e-12);
}

#[test]
fn a_triangular_plate_throws_the_ball_at_its_upper_corner_and_strikes_it_at_the_lower_one() {
    // Constant speed 4 A f = 0.2: the ball comes to rest on the plate between its corners.
    let scene = plate(oscillating(Waveform::Triangle, 0.05, 0.8), 0.3, 1e-4, DVec3::ZERO);
    let mut simulation = Simulation::new(scene, Options::default()).unwrap();
    let mut log = Log::default();
    simulation.advance(until(20.0), &mut log).unwrap();
    let lift = log.0.iter().find(|event| event.kind == EventKind::Lift).unwrap();
    assert!((lift.time - 0.45).abs() < 1e-12, "{}", lift.time);
    // It flies at 0.2 from the height 0.05 against a plate that falls at 0.2: t²/2 = 0.4 t.
    let strike = log.0.iter().find(|event| event.kind == EventKind::Wall && event.time > lift.time).unwrap();
    assert!((strike.time - 0.45).abs() < 0.8, "{}", strike.time);
    assert!(simulation.ledger().residual.abs() < 1e-12, "{:?}", simulation.ledger());
}

/// A shallow layer of grains in a box with a sine floor: carried grains meet each other, falling grains and
/// walls.
fn layer(dimension: Dimension, e: f64, gamma: f64) -> System {
    let boundary = [Boundary::Wall, Boundary::Periodic, Boundary::Wall];
    let (edge, up) = if dimension == Dimension::Two { (30.0, DVec3::Y) } else { (12.0, DVec3::Z) };
    let boundary = if dimension == Dimension::Two {
        [Boundary::Periodic, Boundary::Wall, Boundary::Wall]
    } else {
        boundary
    };
    let mut scene = system(dimension, DVec3::splat(edge), boundary);
    let (small, large) = (class(&mut scene, 0.3, 1.0), class(&mut scene, 0.5, 3.0));
    let mut random = Random(17);
    scatter(&mut scene, small, 12, 0.5, &mut random);
    scatter(&mut scene, large, 12, 0.5, &mut random);
    set_restitution(&mut scene, e);
    // Only walls have infinite series of bounces.
    scene.contacts.pair.fill(Restitution::Constant(1.0));
    scene.domain.gravity = -up;
    let floor = scene.walls.iter_mut().find(|wall| wall.normal == up).unwrap();
    let amplitude = gamma / (TAU * TAU);
    floor.motion = oscillating(Waveform::Sine, amplitude, 0.5);
    floor.point -= up * amplitude;
    scene
}

#[test]
#[ignore = "long: scripts/test all"]
fn trajectory_of_a_layer_with_carried_grains_is_independent_of_search_slices_and_resumption() {
    for dimension in [Dimension::Three, Dimension::Two] {
        for gamma in [0.8, 1.6] {
            let scene = layer(dimension, 0.4, gamma);
            let reference = check_independence(&scene, &[1.0, 8.0, 15.5, 25.0]);
            assert!(reference.counters().rests > 20, "Γ = {gamma}: {:?}", reference.counters());
            assert!(reference.ledger().term(Term::WallWork) != 0.0);
        }
    }
}

#[test]
fn without_gravity_a_wall_carries_a_ball_while_it_accelerates_towards_it() {
    // The wall starts at its lowest point, and the ball touches it there: it is pressed until the wall is
    // fastest.
    let amplitude = 0.5;
    let mut scene = plate(oscillating(Waveform::Sine, amplitude, 0.75), 0.2, 1e-4, DVec3::ZERO);
    scene.domain.gravity = DVec3::ZERO;
    let mut simulation = Simulation::new(scene, Options::default()).unwrap();
    let mut log = Log::default();
    simulation.advance(until(0.5), &mut log).unwrap();
    let lift = log.0.iter().find(|event| event.kind == EventKind::Lift).unwrap();
    assert!((lift.time - 0.25).abs() < 1e-9, "{}", lift.time);
    let speed = simulation.frame().velocity[0].z;
    assert!((speed - TAU * amplitude).abs() < 1e-9, "{speed}");
    assert!(simulation.ledger().residual.abs() < 1e-13);
}
