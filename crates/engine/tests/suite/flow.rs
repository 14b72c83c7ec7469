//! Inlets and outlets: numbers, energy and momentum are in balance, and no search, thread, slice or
//! resumption changes what happens.

use glam::DVec3;
use haff_engine::{
    Body, Boundary, Change, Cuboid, Dimension, EventKind, Flow, Inlet, Options, Silent, Simulation, Stop,
    Supply, System, Term, ThermalWall, Until, WallLaw,
};
use haff_mechanics::Restitution;
use haff_testing::Random;

use crate::common::{Log, check_independence, class, features::outlet, scatter, set_restitution, system};

/// Number of entries and exits of the long test: `HAFF_PASSAGES`, or a default.
fn passages(default: u64) -> u64 {
    std::env::var("HAFF_PASSAGES").ok().and_then(|text| text.parse().ok()).unwrap_or(default)
}

/// Adds an inlet with a rate, and the particles that it lets in, of class and species 0.
fn supply(scene: &mut System, [low, high]: [[f64; 3]; 2], rate: f64, count: u32) {
    let first = scene.bodies.len() as u32;
    let place = Cuboid { low: low.into(), high: high.into() };
    let waiting = Body { position: DVec3::ZERO, velocity: DVec3::ZERO, image: [0; 3], class: 0, species: 0 };
    let flow = scene.flow.get_or_insert_default();
    if flow.inlets.iter().all(|inlet| matches!(inlet.supply, Supply::Refill { .. })) {
        flow.present = scene.bodies.len();
    }
    let supply = Supply::Rate { rate, first, count };
    flow.inlets.push(Inlet { place, velocity: DVec3::new(0.5, 0.0, -1.0), temperature: 0.3, supply });
    scene.bodies.extend(vec![waiting; count as usize]);
}

/// Adds an inlet that puts back what has left, at most so many.
fn refill(scene: &mut System, [low, high]: [[f64; 3]; 2], count: u64) {
    let place = Cuboid { low: low.into(), high: high.into() };
    let supply = Supply::Refill { species: vec![0], count };
    let present = scene.bodies.len();
    let flow = scene.flow.get_or_insert_with(|| Box::new(Flow { present, ..Flow::default() }));
    flow.inlets.push(Inlet { place, velocity: DVec3::ZERO, temperature: 0.1, supply });
}

/// A box through which particles flow: in at one end, out at the other.
fn duct(count: u32) -> System {
    let boundary = [Boundary::Wall, Boundary::Periodic, Boundary::Wall];
    let mut scene = system(Dimension::Three, DVec3::new(20.0, 6.0, 6.0), boundary);
    let grain = class(&mut scene, 0.5, 1.0);
    scatter(&mut scene, grain, 60, 1.0, &mut Random(4));
    supply(&mut scene, [[0.5, 0.0, 0.5], [4.0, 6.0, 5.5]], 8.0, count);
    outlet(&mut scene, [[18.0, 0.0, 0.0], [20.0, 6.0, 6.0]]);
    set_restitution(&mut scene, 0.9);
    scene.contacts.wall[2] = WallLaw::Thermal(ThermalWall {
        temperature: 1.0,
        accommodation: 1.0,
        restitution: Restitution::Constant(1.0),
    });
    scene
}

/// Grains that fall on a floor, rest there, and leave in a corner; they come in again at the top.
fn fountain(rest_speed: f64) -> System {
    let boundary = [Boundary::Wall, Boundary::Periodic, Boundary::Wall];
    let mut scene = system(Dimension::Three, DVec3::new(8.3, 4.4, 20.0), boundary);
    let grain = class(&mut scene, 0.5, 1.0);
    scatter(&mut scene, grain, 120, 0.3, &mut Random(7));
    scene.domain.gravity = DVec3::new(0.0, 0.0, -1.0);
    set_restitution(&mut scene, 0.6);
    scene.contacts.rest_speed = rest_speed;
    refill(&mut scene, [[1.0, 0.0, 17.0], [7.0, 4.4, 19.4]], u64::MAX);
    outlet(&mut scene, [[0.0, 0.0, 0.0], [2.0, 4.4, 1.2]]);
    scene
}

fn run(simulation: &mut Simulation, time: f64) -> Stop {
    simulation.advance(Until { time, ..Until::default() }, &mut Silent).unwrap()
}

/// Checks what must hold at any time.
fn check_balances(simulation: &mut Simulation, momentum_before: DVec3) {
    let sample = simulation.sample();
    assert!(sample.ledger.residual.abs() < 1e-13, "{:e}", sample.ledger.residual);
    let momentum = sample.momentum - momentum_before - sample.external_impulse;
    // Each event and each passage, of speeds of about 1, rounds the momentum to an ulp at most.
    let events = (sample.step + sample.particles_in + sample.particles_out) as f64;
    let allowed = 1e-12 * (1.0 + sample.external_impulse.length()) + f64::EPSILON * events;
    assert!(momentum.length() < allowed, "{momentum}, allowed {allowed}");
    simulation.measure_overlap().unwrap();
}

#[test]
#[ignore = "long: scripts/test all"]
fn a_flow_is_independent_of_search_threads_slices_and_resumption() {
    for (name, scene, times) in [
        ("duct", duct(200), [1.0, 3.5, 11.0, 40.0]),
        ("fountain", fountain(0.1), [2.0, 7.0, 15.0, 30.0]),
        ("without rest", fountain(0.0), [1.0, 2.0, 3.0, 4.0]),
    ] {
        let start = scene.flow.as_ref().unwrap().present as u64;
        let mut simulation = check_independence(&scene, &times);
        let sample = simulation.sample();
        assert_eq!(sample.particles, start + sample.particles_in - sample.particles_out, "{name}");
        assert!(sample.particles_out > 10 && sample.particles_in > 10, "{name}: {sample:?}");
        assert!(sample.ledger.term(Term::Outlet) != 0.0, "{name}");
        if name == "fountain" {
            assert!(simulation.counters().rests > 20, "{:?}", simulation.counters());
        }
    }
}

#[test]
#[ignore = "long: scripts/test all"]
fn numbers_energy_and_momentum_are_in_balance() {
    let wanted = passages(3000);
    let count = u32::try_from(wanted).unwrap();
    for (name, scene) in [("duct", duct(count)), ("fountain", fountain(0.1))] {
        let momentum: DVec3 = {
            let flow = scene.flow.as_ref().unwrap();
            scene.bodies[..flow.present].iter().map(|body| body.velocity).sum()
        };
        let start = scene.flow.as_ref().unwrap().present as u64;
        let mut simulation = Simulation::new(scene, Options::default()).unwrap();
        let mut time = 0.0;
        loop {
            time += 20.0;
            let stop = run(&mut simulation, time);
            check_balances(&mut simulation, momentum);
            let sample = simulation.sample();
            assert_eq!(sample.particles, start + sample.particles_in - sample.particles_out, "{name}");
            assert_eq!(sample.particles as usize, simulation.particles(), "{name}");
            let frame = simulation.frame();
            assert_eq!(frame.present.iter().filter(|there| **there).count(), simulation.particles());
            for (k, there) in frame.present.iter().enumerate() {
                assert_eq!(frame.position[k].is_finite(), *there, "{name}: {k}");
            }
            if sample.particles_in + sample.particles_out >= wanted || stop == Stop::Rest || time > 1e7 {
                println!("{name}: t = {time}, {} in, {} out", sample.particles_in, sample.particles_out);
                assert!(sample.particles_in + sample.particles_out >= wanted, "{name}: {stop:?}");
                break;
            }
        }
    }
}

/// Particles that come in are no others than those of the list, in its order; what has left comes back only
/// by an inlet that refills.
#[test]
fn events_name_particles_by_their_place_in_the_list() {
    let mut log = Log::default();
    let scene = duct(50);
    let mut simulation = Simulation::new(scene, Options::default()).unwrap();
    simulation.advance(Until { time: 40.0, ..Until::default() }, &mut log).unwrap();
    let of = |kind: EventKind| log.0.iter().filter(move |row| row.kind == kind).map(|row| row.i);
    assert_eq!(of(EventKind::Enter).collect::<Vec<_>>(), (60..110).collect::<Vec<u32>>());
    let left: Vec<u32> = of(EventKind::Leave).collect();
    let mut unique = left.clone();
    unique.sort_unstable();
    unique.dedup();
    assert_eq!(unique.len(), left.len(), "nothing leaves twice");
    assert!(left.iter().any(|&i| i >= 60) && left.iter().any(|&i| i < 60), "{left:?}");
    // Nothing happens to a particle that is not there.
    let mut there: Vec<bool> = (0..110).map(|i| i < 60).collect();
    for row in &log.0 {
        match row.kind {
            EventKind::Enter => assert!(!std::mem::replace(&mut there[row.i as usize], true)),
            EventKind::Leave => assert!(std::mem::replace(&mut there[row.i as usize], false)),
            EventKind::Collision => {
                assert!(row.i < row.j && there[row.i as usize] && there[row.j as usize], "{row:?}");
            }
            _ => assert!(there[row.i as usize], "{row:?}"),
        }
    }
    let frame = simulation.frame();
    assert_eq!(frame.present, there);
}

/// An empty box fills at the stated rate: the number of entries in a time is that of a Poisson process.
#[test]
#[ignore = "long: scripts/test all"]
fn entries_are_a_poisson_process() {
    let (rate, until) = (40.0, 50.0);
    let mut scene = system(Dimension::Three, DVec3::splat(40.0), [Boundary::Wall; 3]);
    class(&mut scene, 0.2, 1.0);
    supply(&mut scene, [[1.0, 1.0, 1.0], [39.0, 39.0, 39.0]], rate, 1_000_000);
    let mut log = Log::default();
    let mut simulation = Simulation::new(scene, Options::default()).unwrap();
    assert_eq!(simulation.particles(), 0);
    simulation.advance(Until { time: until, ..Until::default() }, &mut log).unwrap();
    let times: Vec<f64> =
        log.0.iter().filter(|row| row.kind == EventKind::Enter).map(|row| row.time).collect();
    let (found, expected) = (times.len() as f64, rate * until);
    assert!(((found - expected) / expected.sqrt()).abs() < 3.0, "{found} {expected}");
    // Intervals have the variance of an exponential distribution, whose square has the variance 8 μ⁴.
    let squares = times.windows(2).map(|pair| (pair[1] - pair[0]).powi(2) * rate * rate);
    let mean = squares.sum::<f64>() / (found - 1.0);
    assert!(((mean - 2.0) / (20.0 / found).sqrt()).abs() < 3.0, "{mean}");
    check_balances(&mut simulation, DVec3::ZERO);
}

/// Without an end to what comes back, nothing grows: neither the world nor what a checkpoint saves.
#[test]
#[ignore = "long: scripts/test all"]
fn a_closed_circuit_keeps_its_size() {
    let mut simulation = Simulation::new(fountain(0.1), Options::default()).unwrap();
    run(&mut simulation, 50.0);
    let before = simulation.checkpoint();
    run(&mut simulation, 500.0);
    let after = simulation.checkpoint();
    assert_eq!(before.position.len(), after.position.len());
    assert!(after.scalars.len() < before.scalars.len() + 400, "{}", after.scalars.len());
    assert!(simulation.sample().particles_in > 300, "{:?}", simulation.sample());
}

#[test]
fn a_run_ends_when_the_last_particle_has_left() {
    let mut scene = system(Dimension::Three, DVec3::splat(10.0), [Boundary::Wall; 3]);
    class(&mut scene, 0.5, 1.0);
    scene.domain.gravity = DVec3::new(0.0, 0.0, -1.0);
    supply(&mut scene, [[1.0, 1.0, 7.0], [9.0, 9.0, 9.0]], 1.0, 20);
    outlet(&mut scene, [[0.0, 0.0, 0.0], [10.0, 10.0, 2.0]]);
    let mut simulation = Simulation::new(scene, Options::default()).unwrap();
    assert_eq!(run(&mut simulation, f64::INFINITY), Stop::Rest);
    let sample = simulation.sample();
    assert_eq!((sample.particles, sample.particles_in, sample.particles_out), (0, 20, 20));
    check_balances(&mut simulation, DVec3::ZERO);
}

#[test]
fn the_state_cannot_be_changed_from_outside() {
    let mut simulation = Simulation::new(duct(10), Options::default()).unwrap();
    run(&mut simulation, 1.0);
    let hash = simulation.state_hash();
    let error = simulation.change(&Change::default(), &mut Silent).unwrap_err().to_string();
    assert!(error.contains("inlets or outlets"), "{error}");
    assert_eq!(simulation.state_hash(), hash);
}

/// Damaged checkpoints are errors.
#[test]
fn numbers_that_do_not_fit_are_refused() {
    let scene = duct(100);
    let mut simulation = Simulation::new(scene.clone(), Options::default()).unwrap();
    run(&mut simulation, 5.0);
    let checkpoint = simulation.checkpoint();
    for (name, change, why) in [
        ("flow.entered", 1, "particles are there"),
        ("flow.left_before", 1000, "flow.left_before"),
        ("inlet.0.entered", 1000, "inlet.0: 10"),
        ("inlet.0.waiting", 1 << 40, "of 160 particles wait"),
    ] {
        let mut damaged = checkpoint.clone();
        damaged.scalars.iter_mut().find(|(found, _)| found == name).unwrap().1 += change;
        let error = Simulation::restore(scene.clone(), Options::default(), &damaged).err().unwrap();
        assert!(error.to_string().contains(why), "{error}");
    }
    let mut damaged = checkpoint;
    damaged.anchor[3] = i64::MIN;
    assert!(Simulation::restore(scene, Options::default(), &damaged).is_err());
}
