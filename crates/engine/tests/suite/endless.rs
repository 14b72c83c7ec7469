//! Endless sequences of events: bounces with decreasing loss, grains pressed together, collapses. Each one
//! ends, or stays exact.

use glam::DVec3;
use haff_engine::{
    Boundary, Dimension, EngineError, NeighborChoice, Options, Silent, Simulation, Stop, System, Until, Wall,
};
use haff_mechanics::Restitution;

use crate::common::{self, Log, Random, add, class, gas, set_restitution, system};

fn start(system: System) -> Simulation {
    Simulation::new(system, Options::default()).unwrap()
}

/// A grain under gravity in a large box, above the wall at its far end.
fn far_from_the_origin(law: Restitution, height: f64) -> System {
    let mut scene = system(Dimension::Three, DVec3::new(160.3, 160.0, 160.0), [Boundary::Wall; 3]);
    scene.domain.gravity = DVec3::X * 0.064;
    scene.contacts.wall.fill((law).into());
    let grain = class(&mut scene, 2.4, 1.0);
    add(&mut scene, grain, DVec3::new(160.3 - 2.4 - height, 49.0, 59.0), DVec3::ZERO);
    scene
}

/// The loss of a bounce decreases with its speed, but the rounding error of its coordinate does not.
#[test]
fn a_grain_comes_to_rest_where_restitution_tends_to_one() {
    for (restitution, speed, exponent) in [(0.2, 0.05, 0.75), (0.2, 0.05, 0.5), (0.5, 0.5, 0.9)] {
        let law = Restitution::Cutoff { restitution, speed, exponent };
        let height = 2.0;
        let mut simulation = start(far_from_the_origin(law, height));
        let until = Until { time: 1e9, entries: 1_000_000, ..Until::default() };
        assert_eq!(simulation.advance(until, &mut Silent).unwrap(), Stop::Rest, "{law:?}");
        // √(2 H/g) to the first bounce, and the series of bounces that starts with its outgoing speed.
        let impact = (2.0 * 0.064 * height).sqrt();
        let first = law.coefficient(impact) * impact;
        let bounces = law.bounces(first).unwrap();
        let expected = (impact + 2.0 * first * bounces.speeds) / 0.064;
        let off = simulation.time() / expected - 1.0;
        // Rounding changes the heights of the last bounces.
        assert!(off.abs() < 1e-3, "{law:?}: at rest at {}, expected {expected}", simulation.time());
        let ledger = simulation.ledger();
        assert_eq!(ledger.kinetic, 0.0);
        let bounces = simulation.counters().wall_collisions as f64;
        println!("{law:?}: {bounces} bounces, off {off:.1e}, residual {:.1e}", ledger.residual);
        // Coordinates and velocities are rounded by half an ulp at random.
        let allowed = 4.0 * f64::EPSILON * (1.0 + bounces.sqrt());
        assert!(ledger.residual.abs() < allowed, "{law:?}: {:e}, allowed {allowed:e}", ledger.residual);
    }
}

/// The rounding of flights between equal bounces has no preferred sign: the energy error is a random walk.
#[test]
#[ignore = "long: scripts/test all"]
fn energy_error_of_equal_bounces_is_a_random_walk() {
    let mut worst = 0.0_f64;
    for seed in 0..20 {
        let mut random = Random(seed);
        let mut scene = system(Dimension::Three, DVec3::splat(10.0), [Boundary::Open; 3]);
        // A moving wall, elastic within `contact.tc`: hops as short as tc carry the grain along without end.
        let normal = DVec3::new(random.uniform(-0.2, 0.2), random.uniform(-0.2, 0.2), 1.0).normalize();
        scene.walls.push(Wall {
            name: "floor".into(),
            point: DVec3::ZERO,
            normal,
            motion: (normal * 1e-2).into(),
            shape: None,
        });
        scene.contacts.wall.push((Restitution::Constant(0.3)).into());
        scene.contacts.tc = 1e-4;
        scene.domain.gravity = DVec3::new(0.1, 0.15, -0.2);
        let grain = class(&mut scene, 0.5, random.uniform(1.0, 1e5));
        add(&mut scene, grain, normal * 0.6, DVec3::new(1.0, 0.5, 0.0));
        let mut simulation = start(scene);
        let until = Until { entries: 200_000, ..Until::default() };
        assert_eq!(simulation.advance(until, &mut Silent).unwrap(), Stop::Slice);
        let bounces = simulation.counters().wall_collisions as f64;
        assert!(bounces > 150_000.0, "{bounces} bounces");
        worst = worst.max(simulation.ledger().residual.abs() / (f64::EPSILON * bounces.sqrt()));
    }
    println!("worst residual: {worst:.2} ε √n");
    // Half an ulp of a component v of the velocity changes the energy by at most ε m v²/2, and the root mean
    // square of its rounding is 0.3 ulp: about ε T per bounce, which rounds twice; rounding of positions adds
    // less. The largest of 20 random walks is at twice the root mean square.
    assert!(worst < 3.0, "{worst} ε √n");
}

/// A heavy grain presses a light grain against a wall, at an angle at which it slides off only slowly.
fn pressed(mass: f64, tc: f64, slope: f64, neighbors: NeighborChoice) -> Simulation {
    let mut scene = system(Dimension::Three, DVec3::splat(92.0), [Boundary::Wall; 3]);
    set_restitution(&mut scene, 0.41);
    scene.contacts.wall.fill((Restitution::Constant(0.99)).into());
    scene.contacts.tc = tc;
    scene.domain.gravity = DVec3::new(0.015, 0.2, -0.038);
    let light = class(&mut scene, 0.4, 1.0);
    let heavy = class(&mut scene, 0.55, mass);
    let position = DVec3::new(87.0, 92.0 - 0.4, 20.0);
    let towards = DVec3::new(slope, -1.0, -0.3 * slope).normalize();
    add(&mut scene, light, position, DVec3::ZERO);
    add(&mut scene, heavy, position + towards * 0.95, DVec3::ZERO);
    Simulation::new(scene, Options { neighbors, ..Options::default() }).unwrap()
}

#[test]
#[ignore = "long: scripts/test all"]
fn grains_pressed_together_overlap_only_by_rounding() {
    let mut events = 0;
    for mass in [1.0, 28.0, 1e4, 1e9] {
        for (tc, slope) in [(0.0, 0.4), (0.0, 1.0), (1e-3, 0.4), (1e-5, 1.0), (1e-7, 0.01)] {
            let mut simulation = pressed(mass, tc, slope, NeighborChoice::AllPairs);
            let mut deepest = 0.0_f64;
            for _ in 0..200 {
                let until = Until { entries: 500, ..Until::default() };
                match simulation.advance(until, &mut Silent) {
                    Ok(_) | Err(EngineError::Collapse { .. }) => {}
                    Err(error) => panic!("mass {mass}, tc {tc}, slope {slope}: {error}"),
                }
                deepest = deepest.max(simulation.measure_overlap().unwrap().depth);
            }
            let counters = simulation.counters();
            events += counters.collisions;
            println!("mass {mass:e}, tc {tc:e}, slope {slope}: {deepest:.1e} {counters:?}");
            // A few rounding errors of coordinates up to 92 [contact distances].
            assert!(deepest < 2e-13, "mass {mass}, tc {tc}, slope {slope}: {deepest:e}");
        }
    }
    assert!(events > 100_000, "{events}");
}

/// Grains that fall onto each other on a floor, with rest switched off: they collapse.
fn collapsing() -> System {
    let mut scene = system(Dimension::Two, DVec3::new(12.0, 12.0, 1.0), [Boundary::Wall; 3]);
    set_restitution(&mut scene, 0.3);
    scene.domain.gravity = -DVec3::Y;
    let grain = class(&mut scene, 0.5, 1.0);
    let mut random = Random(3);
    common::scatter(&mut scene, grain, 20, 1.0, &mut random);
    scene
}

#[test]
#[ignore = "long: scripts/test all"]
fn a_collapse_is_reported_at_the_same_event_by_every_search_and_after_resumption() {
    let scene = collapsing();
    let options = |neighbors| Options { neighbors, ..Options::default() };
    let run = |neighbors| {
        let mut simulation = Simulation::new(scene.clone(), options(neighbors)).unwrap();
        let error = simulation.advance(Until::default(), &mut Silent).unwrap_err();
        (simulation, error)
    };
    let (first, expected) = run(NeighborChoice::AllPairs);
    assert!(matches!(expected, EngineError::Collapse { .. }), "{expected}");
    for neighbors in [NeighborChoice::Cells, NeighborChoice::Lists, NeighborChoice::Windows] {
        let (other, error) = run(neighbors);
        assert_eq!(error, expected, "{neighbors:?}");
        assert_eq!(other.state_hash(), first.state_hash(), "{neighbors:?}");
    }
    // Resumed before the series of events, during it, while its particles are recorded, and after the report.
    let mut simulation = Simulation::new(scene.clone(), options(NeighborChoice::Cells)).unwrap();
    let mut last = None;
    for part in 0.. {
        assert!(part < 100);
        let until = Until { entries: 7001, ..Until::default() };
        let stop = simulation.advance(until, &mut Silent);
        let checkpoint = simulation.checkpoint();
        simulation =
            Simulation::restore(scene.clone(), options(NeighborChoice::AllPairs), &checkpoint).unwrap();
        if let Err(error) = stop {
            if last.as_ref() == Some(&error) {
                break;
            }
            assert_eq!(error, expected, "part {part}");
            last = Some(error);
        }
    }
}

/// A wall moves into a corner: a particle there collides without end, the others move freely.
fn wedge() -> System {
    let mut scene = gas(6, 0.02, 0.65, 9);
    scene.domain.boundary = [Boundary::Wall; 3];
    scene.contacts.wall.clear();
    let edge = scene.domain.size.x;
    let walls = system(Dimension::Three, scene.domain.size, scene.domain.boundary).walls;
    scene.walls = walls;
    let normal = DVec3::new(0.55, 0.0, 0.836).normalize();
    let point = DVec3::new(0.15 * edge, 0.5 * edge, 0.0);
    scene.bodies.retain(|body| (body.position - point).dot(normal) > 0.55);
    scene.walls.push(Wall {
        name: "plane".into(),
        point,
        normal,
        motion: (normal * 0.24).into(),
        shape: None,
    });
    scene.contacts.wall = vec![(Restitution::Constant(0.3)).into(); scene.walls.len()];
    scene
}

#[test]
#[ignore = "long: scripts/test all"]
fn a_wall_moving_into_a_wedge_has_the_same_collapse_with_every_search() {
    let scene = wedge();
    let mut ends = Vec::new();
    for neighbors in [NeighborChoice::Cells, NeighborChoice::Lists, NeighborChoice::Windows] {
        let options = Options { neighbors, ..Options::default() };
        let mut simulation = Simulation::new(scene.clone(), options).unwrap();
        let error = simulation.advance(Until { time: 500.0, ..Until::default() }, &mut Silent).unwrap_err();
        assert!(matches!(error, EngineError::Collapse { .. }), "{error}");
        let counters = simulation.counters();
        // A window contains many events, and the particles in the wedge are not registered too often.
        let events = counters.collisions + counters.wall_collisions;
        assert!(counters.windows < events / 200 && counters.candidates < 1000 * events, "{counters:?}");
        ends.push((error, simulation.state_hash()));
    }
    assert!(ends.windows(2).all(|pair| pair[0] == pair[1]), "{ends:?}");
}

/// One particle that is much faster than all others would make all windows short, so cells are chosen.
#[test]
fn cells_are_chosen_for_a_small_system_with_a_speed_outlier() {
    let mut scene = gas(6, 0.02, 1.0, 9);
    scene.bodies[0].velocity *= 1e6;
    let simulation = start(scene);
    assert_eq!(simulation.neighbors(), NeighborChoice::Cells);
}

/// The log has a row for every event before the collapse.
#[test]
fn the_log_has_all_rows_before_a_collapse() {
    let mut log = Log::default();
    let mut simulation = start(collapsing());
    simulation.advance(Until::default(), &mut log).unwrap_err();
    let counters = simulation.counters();
    assert_eq!(log.0.len() as u64, counters.collisions + counters.wall_collisions + counters.rests);
}
