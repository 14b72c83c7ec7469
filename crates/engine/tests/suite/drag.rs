//! Drag: flights, contacts, energies and pressures in closed form, and independence of the search.

use glam::DVec3;
use haff_engine::{
    Boundary, Change, Dimension, Drag, Drive, DriveKind, KickTimes, Options, Silent, Simulation, Spin,
    System, Term, ThermalWall, Until, WallLaw,
};
use haff_mechanics::{
    Restitution, Roughness, Scatter,
    drag::{flight_time, transformed_time},
    time_to_contact,
};

use crate::common::{Log, Random, add, check_independence, class, scatter, set_restitution, system};

const OPEN: [Boundary; 3] = [Boundary::Open; 3];

fn until(time: f64) -> Until {
    Until { time, ..Until::default() }
}

fn damped(scene: &mut System, time: f64) {
    scene.drag = Some(Drag { time, rotational: false });
}

fn simulation(scene: System) -> Simulation {
    Simulation::new(scene, Options::default()).unwrap()
}

/// A flight over many epochs: r(t) = r₀ + v₀ τ (1 − e^(−t/τ)), and at last r₀ + v₀ τ.
#[test]
fn a_particle_stops_after_its_speed_times_tau() {
    for tau in [0.01, 0.7, 30.0, 1e4] {
        let mut scene = system(Dimension::Three, DVec3::ONE, OPEN);
        let kind = class(&mut scene, 0.5, 2.0);
        let (start, velocity) = (DVec3::new(1.0, -2.0, 0.5), DVec3::new(3.0, 1.0, -0.25));
        add(&mut scene, kind, start, velocity);
        damped(&mut scene, tau);
        let mut simulation = simulation(scene);
        for turns in [0.1, 0.5, 1.0, 3.3, 10.0, 60.0] {
            let time = turns * tau;
            simulation.advance(until(time), &mut Silent).unwrap();
            let frame = simulation.frame();
            let expected = start + velocity * transformed_time(time, tau);
            let scale = start.length() + expected.length();
            assert!((frame.position[0] - expected).length() < 1e-14 * scale, "{tau} {turns}");
            let left = velocity * (-turns).exp();
            assert!(
                (frame.velocity[0] - left).length() < 1e-13 * left.length() * turns.max(1.0),
                "{tau} {turns}"
            );
            assert_eq!(frame.time, time);
            let ledger = simulation.ledger();
            let lost = velocity.length_squared() * -(-2.0 * turns).exp_m1();
            assert!((ledger.term(Term::Drag) / lost - 1.0).abs() < 1e-13, "{tau} {turns}");
            assert!(ledger.residual.abs() < 1e-14, "{:e}", ledger.residual);
        }
        let stopped = simulation.frame().position[0];
        assert!((stopped - (start + velocity * tau)).length() < 1e-14 * stopped.length());
    }
}

/// A ball between two walls: the k-th contact is at s = s₀ + Σ L/(v₀ e^j), over several epochs.
#[test]
fn contact_times_with_walls_are_those_of_the_closed_form() {
    for e in [1.0, 0.9] {
        let [edge, radius, speed, tau] = [3.0, 0.5, 2.0, 40.0];
        let boundary = [Boundary::Wall, Boundary::Open, Boundary::Open];
        let mut scene = system(Dimension::Two, DVec3::new(edge, 1.0, 1.0), boundary);
        let kind = class(&mut scene, radius, 1.0);
        add(&mut scene, kind, DVec3::new(1.0, 0.0, 0.0), DVec3::new(speed, 0.3, 0.0));
        set_restitution(&mut scene, e);
        damped(&mut scene, tau);
        let mut log = Log::default();
        simulation(scene).advance(until(8.0 * tau), &mut log).unwrap();
        let mut transformed = (edge - radius - 1.0) / speed;
        let mut factor = 1.0;
        for row in &log.0 {
            let expected = flight_time(transformed, tau);
            // The logarithm enlarges the rounding of s by τ/(τ − s).
            let amplified = tau / (tau - transformed) * transformed / expected;
            assert!(
                (row.time / expected - 1.0).abs() < 1e-14 * amplified.max(10.0),
                "{} {expected}",
                row.time
            );
            let approach = speed * factor * (1.0 - transformed / tau);
            assert!((row.approach_speed / approach - 1.0).abs() < 1e-13 * amplified.max(10.0));
            factor *= e;
            transformed += (edge - 2.0 * radius) / (speed * factor);
        }
        // The next contact is never reached.
        assert!(transformed >= tau && log.0.len() > 12, "{} contacts", log.0.len());
    }
}

/// Two spheres whose paths cross, with times over eight orders of magnitude of τ.
#[test]
#[ignore = "long: scripts/test all"]
fn contact_times_of_pairs_are_those_of_the_closed_form() {
    let mut random = Random(41);
    let mut contacts = 0;
    for _ in 0..4000 {
        let mut scene = system(Dimension::Three, DVec3::ONE, OPEN);
        let kind = class(&mut scene, 0.5, 1.0);
        let mut vector = || DVec3::new(random.normal(), random.normal(), random.normal());
        let (r, v) = (vector().normalize() * 3.0, 0.5 * vector());
        let common = 0.3 * vector();
        let v = v - r * ((v.dot(r) + 5.0) / r.length_squared());
        let tau = 10_f64.powf(random.uniform(-0.5, 8.0));
        add(&mut scene, kind, DVec3::ZERO, common);
        add(&mut scene, kind, r, v + common);
        damped(&mut scene, tau);
        let expected =
            time_to_contact(r, v, 1.0).filter(|&s| s < 0.999 * tau).map(|s| (s, flight_time(s, tau)));
        let mut log = Log::default();
        simulation(scene).advance(Until { collisions: 1, ..until(20.0 * tau) }, &mut log).unwrap();
        let Some((s, expected)) = expected else { continue };
        let amplified = tau / (tau - s) * s / expected;
        // A grazing contact enlarges the rounding of its position.
        let grazing = v.length() / log.0[0].approach_speed * (1.0 - s / tau);
        let off = (log.0[0].time / expected - 1.0).abs();
        assert!(off < 1e-14 * amplified.max(1.0) * grazing.max(1.0), "{off:e} {amplified} {grazing}");
        contacts += 1;
    }
    assert!(contacts > 500, "{contacts}");
}

/// Particles between walls, of two sizes.
fn gas(dimension: Dimension, count: usize, tau: f64) -> System {
    let mut random = Random(23);
    let edge = (5.0 * count as f64).powf(1.0 / dimension.count() as f64);
    let boundary = [Boundary::Periodic, Boundary::Wall, Boundary::Periodic];
    let mut scene = system(dimension, DVec3::splat(edge), boundary);
    for (radius, mass) in [(0.5, 1.0), (0.3, 0.2)] {
        let kind = class(&mut scene, radius, mass);
        scatter(&mut scene, kind, count / 2, 1.0, &mut random);
    }
    set_restitution(&mut scene, 0.9);
    damped(&mut scene, tau);
    scene.seed = 3;
    scene
}

fn noise(rate: f64) -> Drive {
    let kind = DriveKind::WhiteNoise { strength: 0.5, kicks: KickTimes::Poisson { rate } };
    Drive { kind, species: vec![0], rotational: true }
}

fn rough(mut scene: System, rotational: bool) -> System {
    let law = Roughness { tangential_restitution: 0.4, friction: 0.5 };
    let count = scene.bodies.len();
    let spin = if scene.dimension == Dimension::Two { DVec3::Z } else { DVec3::new(0.3, -1.0, 0.7) };
    scene.spin = Some(Spin {
        inertia: vec![0.4],
        angular_velocity: vec![spin; count],
        pair: vec![law],
        wall: vec![law; scene.walls.len()],
    });
    scene.drag = scene.drag.map(|drag| Drag { rotational, ..drag });
    scene
}

#[test]
#[ignore = "long: scripts/test all"]
fn the_trajectory_is_independent_of_search_threads_slices_and_resumption() {
    let times = [0.1, 1.0, 1.3, 6.0];
    for dimension in [Dimension::Three, Dimension::Two] {
        for tau in [0.5, 7.0, 1e3] {
            check_independence(&gas(dimension, 150, tau), &times);
            let mut driven = gas(dimension, 150, tau);
            driven.drives = vec![noise(2.0)];
            driven.measure.stress = true;
            let reference = check_independence(&driven, &times);
            assert!(reference.ledger().term(Term::Drag) > 0.0);
            for rotational in [false, true] {
                check_independence(&rough(driven.clone(), rotational), &times);
            }
            let wall = Restitution::random(Scatter::Uniform([0.5, 1.0])).unwrap();
            driven.contacts.wall.fill(wall.into());
            driven.contacts.pair.fill(Restitution::Viscoelastic { coefficient: 0.1 });
            check_independence(&driven, &times);
            driven.contacts.tc = 0.01;
            let thermal =
                ThermalWall { temperature: 2.0, accommodation: 0.7, restitution: Restitution::Constant(0.9) };
            driven.contacts.wall.fill(WallLaw::Thermal(thermal));
            check_independence(&rough(driven, true), &times);
        }
    }
}

/// Elastic smooth particles that collide lose the same part of their energy in every time.
#[test]
fn an_elastic_gas_cools_exponentially() {
    let tau = 3.0;
    let mut scene = gas(Dimension::Three, 300, tau);
    set_restitution(&mut scene, 1.0);
    let mut simulation = simulation(scene);
    let start = simulation.ledger().kinetic;
    for time in [0.5, 2.0, 7.0, 11.0] {
        simulation.advance(until(time), &mut Silent).unwrap();
        let ledger = simulation.ledger();
        let expected = start * (-2.0 * time / tau).exp();
        assert!((ledger.kinetic / expected - 1.0).abs() < 1e-12, "{time}: {}", ledger.kinetic / expected);
        assert!((ledger.term(Term::Drag) / (start - expected) - 1.0).abs() < 1e-12);
        assert!(ledger.dissipated.abs() < 1e-12 * start && ledger.residual.abs() < 1e-13);
    }
    assert!(simulation.counters().collisions > 300, "{}", simulation.counters().collisions);
}

/// Rotations decay only with `rotational`, and their energy is in the balance.
#[test]
fn rotations_decay_like_velocities_if_they_are_damped() {
    let tau = 2.0;
    for rotational in [false, true] {
        let mut scene = rough(gas(Dimension::Three, 100, tau), rotational);
        if let Some(spin) = &mut scene.spin {
            spin.pair.fill(Roughness::SMOOTH);
            spin.wall.fill(Roughness::SMOOTH);
        }
        let before = scene.spin.as_ref().unwrap().angular_velocity[0];
        let mut simulation = simulation(scene);
        let first = simulation.ledger();
        simulation.advance(until(5.0), &mut Silent).unwrap();
        let decay = if rotational { (-5.0 / tau).exp() } else { 1.0 };
        for spin in simulation.frame().angular_velocity {
            assert!((spin - before * decay).length() < 1e-13, "{spin}");
        }
        let ledger = simulation.ledger();
        assert!((ledger.rotational / (first.rotational * decay * decay) - 1.0).abs() < 1e-12);
        assert!(ledger.residual.abs() < 1e-13, "{:e}", ledger.residual);
    }
}

/// Without collisions, drag and white noise give T = m ξ₀² τ/2 at any rate of kicks, and the distribution of
/// velocities has the excess kurtosis 3/(ν τ).
#[test]
#[ignore = "long: scripts/test all"]
fn white_noise_and_drag_are_an_ornstein_uhlenbeck_process() {
    let count = 20_000;
    for (tau, rate) in [(0.4, 10.0), (1.5, 2.0)] {
        let mut scene = system(Dimension::Three, DVec3::ONE, OPEN);
        let kind = class(&mut scene, 1e-6, 2.0);
        for k in 0..count {
            let place = DVec3::new(f64::from(k % 28), f64::from(k / 28 % 28), f64::from(k / 784));
            add(&mut scene, kind, 1e5 * place, DVec3::ZERO);
        }
        damped(&mut scene, tau);
        scene.drives = vec![noise(rate)];
        let mut simulation = simulation(scene);
        simulation.advance(until(15.0 * tau), &mut Silent).unwrap();
        assert_eq!(simulation.counters().collisions, 0);
        let variance = 0.5 * 0.5 * tau;
        let n = f64::from(3 * count);
        let components = || simulation.frame().velocity.into_iter().flat_map(|v| v.to_array());
        let [second, fourth] = [2, 4].map(|power| components().map(|v| v.powi(power)).sum::<f64>() / n);
        let excess = 3.0 / (rate * tau);
        // Components of one particle have the times of their kicks in common.
        let error = ((2.0 + 3.0 * excess) / n).sqrt();
        let z = (second / variance - 1.0) / error;
        assert!(z.abs() < 4.0, "{second}, expected {variance}: z = {z}");
        // The spread of the fourth moment, from blocks of particles.
        let velocities: Vec<f64> = components().collect();
        let blocks: Vec<f64> = velocities
            .chunks(velocities.len() / 40)
            .map(|block| {
                let mean = |power: i32| block.iter().map(|v| v.powi(power)).sum::<f64>() / block.len() as f64;
                mean(4) / mean(2).powi(2) - 3.0
            })
            .collect();
        let blocks_count = blocks.len() as f64;
        let mean = blocks.iter().sum::<f64>() / blocks_count;
        let spread = (blocks.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / (blocks_count - 1.0)).sqrt();
        let z = (fourth / second.powi(2) - 3.0 - excess) / (spread / blocks_count.sqrt());
        assert!(z.abs() < 4.0, "excess {}, expected {excess}: z = {z}", fourth / second.powi(2) - 3.0);
    }
}

/// The kinetic part of the pressure is the mean of Σ m v² over the interval.
#[test]
fn pressure_is_a_mean_over_flights_that_slow_down() {
    let tau = 1.5;
    let mut scene = system(Dimension::Three, DVec3::splat(100.0), [Boundary::Periodic; 3]);
    let kind = class(&mut scene, 1e-3, 1.0);
    let mut random = Random(2);
    scatter(&mut scene, kind, 20, 1.0, &mut random);
    damped(&mut scene, tau);
    scene.measure.stress = true;
    let mut simulation = simulation(scene);
    let mut before = simulation.sample();
    for time in [0.3, 1.0, 4.0, 4.5] {
        simulation.advance(until(time), &mut Silent).unwrap();
        let sample = simulation.sample();
        let span = time - before.time;
        let mean = 2.0 * before.ledger.kinetic * (-0.5 * tau * (-2.0 * span / tau).exp_m1()) / span;
        let expected = mean / 3e6;
        assert!((sample.pressure.unwrap() / expected - 1.0).abs() < 1e-12, "{time}");
        let stress = sample.stress.as_ref().unwrap().total();
        assert!(((stress[0] + stress[4] + stress[8]) / (3.0 * expected) - 1.0).abs() < 1e-12, "{time}");
        before = sample;
    }
    assert_eq!(simulation.counters().collisions, 0);
}

/// Velocities that are given on the way are those at that time; a drag can go on, end, or change.
#[test]
fn velocities_and_the_drag_can_be_changed_on_the_way() {
    let mut scene = system(Dimension::Three, DVec3::ONE, OPEN);
    let kind = class(&mut scene, 0.5, 1.0);
    add(&mut scene, kind, DVec3::ZERO, DVec3::X);
    damped(&mut scene, 2.0);
    let mut simulation = simulation(scene);
    simulation.advance(until(1.0), &mut Silent).unwrap();
    let at = transformed_time(1.0, 2.0);
    let change = Change { velocities: Some(vec![DVec3::Y]), ..Change::default() };
    simulation.change(&change, &mut Silent).unwrap();
    simulation.advance(until(4.0), &mut Silent).unwrap();
    let expected = DVec3::new(at, transformed_time(3.0, 2.0), 0.0);
    assert!((simulation.frame().position[0] - expected).length() < 1e-14);
    let mut free = simulation.present_system().unwrap();
    free.drag = None;
    let speed = simulation.frame().velocity[0].y;
    simulation.change_system(free, &mut Silent).unwrap();
    simulation.advance(until(6.0), &mut Silent).unwrap();
    let expected = expected + DVec3::Y * (2.0 * speed);
    assert!((simulation.frame().position[0] - expected).length() < 1e-14);
    let mut again = simulation.present_system().unwrap();
    damped(&mut again, 0.5);
    simulation.change_system(again, &mut Silent).unwrap();
    simulation.advance(until(100.0), &mut Silent).unwrap();
    let expected = expected + DVec3::Y * (0.5 * speed);
    assert!((simulation.frame().position[0] - expected).length() < 1e-14);
    assert!(simulation.ledger().residual.abs() < 1e-14);
}

/// The TC model counts physical time, also from a contact in an earlier epoch.
#[test]
fn times_since_contacts_are_physical() {
    let [edge, radius, speed, tau] = [3.0, 0.5, 2.0, 3.0];
    let boundary = [Boundary::Wall, Boundary::Open, Boundary::Open];
    let first = flight_time((edge - radius - 1.0) / speed, tau);
    let second = flight_time((edge - radius - 1.0 + edge - 2.0 * radius) / speed, tau);
    assert!(second > 2.0_f64.ln() * tau, "an epoch ends between the contacts");
    for (factor, elastic) in [(0.999, false), (1.001, true)] {
        let mut scene = system(Dimension::Two, DVec3::new(edge, 1.0, 1.0), boundary);
        let kind = class(&mut scene, radius, 1.0);
        add(&mut scene, kind, DVec3::new(1.0, 0.0, 0.0), DVec3::new(speed, 0.0, 0.0));
        // The first contact is elastic by its law, the second one by the TC model.
        set_restitution(&mut scene, 0.5);
        scene.contacts.wall[1] = Restitution::Constant(1.0).into();
        damped(&mut scene, tau);
        scene.contacts.tc = factor * (second - first);
        let mut log = Log::default();
        simulation(scene).advance(until(1.01 * second), &mut log).unwrap();
        assert_eq!(log.0.len(), 2, "{:?}", log.0.iter().map(|row| row.time).collect::<Vec<_>>());
        assert!((log.0[1].time / second - 1.0).abs() < 1e-13);
        assert_eq!(log.0[1].energy_loss == 0.0, elastic, "{factor}");
    }
}
