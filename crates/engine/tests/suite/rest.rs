//! Grains supported by each other come to rest, cost nothing while at rest, and wake when hit.

use glam::DVec3;
use haff_engine::{
    Boundary, Dimension, EventKind, EventRecord, Frame, NeighborChoice, Options, Silent, Simulation, Stop,
    System, Until,
};
use haff_mechanics::Restitution;

use crate::common::{Log, Random, add, class, scatter, set_restitution, system};

/// Grains of two sizes over the floor of a box.
fn poured(dimension: Dimension, count: usize, width: f64, e: f64, seed: u64) -> System {
    let mut random = Random(seed);
    let flat = dimension == Dimension::Two;
    let size = if flat { DVec3::new(width, 30.0, 1.0) } else { DVec3::new(width, width, 30.0) };
    let mut scene = system(dimension, size, [Boundary::Wall; 3]);
    scene.domain.gravity = if flat { DVec3::new(0.0, -1.0, 0.0) } else { DVec3::new(0.0, 0.0, -1.0) };
    set_restitution(&mut scene, e);
    scene.contacts.rest_speed = 0.05;
    let (small, large) = (class(&mut scene, 0.4, 0.5), class(&mut scene, 0.5, 1.0));
    scatter(&mut scene, small, count / 2, 0.3, &mut random);
    scatter(&mut scene, large, count - count / 2, 0.3, &mut random);
    scene
}

fn start(scene: &System, neighbors: NeighborChoice) -> Simulation {
    Simulation::new(scene.clone(), Options { neighbors, ..Options::default() }).unwrap()
}

/// Asserts that each of many downward directions is blocked by a contact, for every grain. The test shares no
/// code with the settling scan of the engine.
fn assert_supported(scene: &System, frame: &Frame, gap: f64) {
    let mut random = Random(1);
    let down = scene.domain.gravity.normalize();
    let flat = scene.dimension == Dimension::Two;
    let directions: Vec<DVec3> = (0..4000)
        .map(|_| {
            let z = if flat { 0.0 } else { random.normal() };
            DVec3::new(random.normal(), random.normal(), z).normalize()
        })
        // Nearly horizontal directions are omitted: the engine ignores slopes below 1e-3, and gaps tilt
        // normals.
        .filter(|d| d.dot(down) > 0.05)
        .collect();
    let radius = |i: usize| scene.classes[scene.bodies[i].class as usize].radius;
    for (i, &x) in frame.position.iter().enumerate() {
        let others = frame.position.iter().enumerate().filter(|&(j, _)| j != i);
        let near = others.filter(|&(j, &y)| (x - y).length() <= radius(i) + radius(j) + gap);
        let walls = scene.walls.iter().filter(|wall| (x - wall.point).dot(wall.normal) <= radius(i) + gap);
        let normals: Vec<DVec3> =
            near.map(|(_, &y)| (x - y).normalize()).chain(walls.map(|wall| wall.normal)).collect();
        let free = directions.iter().find(|d| normals.iter().all(|n| d.dot(*n) >= 0.0));
        assert!(free.is_none(), "grain {i} at {x} can move along {free:?}; its contacts: {normals:?}");
    }
}

#[test]
#[ignore = "long: scripts/test all"]
fn heaps_come_to_rest_after_finitely_many_events() {
    for (dimension, count, width) in [(Dimension::Three, 40, 3.3), (Dimension::Two, 30, 5.3)] {
        for e in [0.0, 0.01, 0.3, 0.5, 0.9] {
            let scene = poured(dimension, count, width, e, 10);
            let mut simulation = start(&scene, NeighborChoice::Auto);
            let mut log = Log::default();
            let mut stop = Stop::Time;
            for k in 1..=3000 {
                stop =
                    simulation.advance(Until { time: f64::from(k), ..Until::default() }, &mut log).unwrap();
                let depth = simulation.measure_overlap().unwrap().depth;
                assert!(depth <= 1e-12, "{dimension:?}, e = {e}, t = {k}: overlap {depth:e}");
                if stop == Stop::Rest {
                    break;
                }
            }
            let (ledger, counters) = (simulation.ledger(), simulation.counters());
            assert_eq!(stop, Stop::Rest, "{dimension:?}, e = {e}: t = {}, {ledger:?}", simulation.time());
            let frame = simulation.frame();
            assert!(frame.velocity.iter().all(|v| *v == DVec3::ZERO), "{dimension:?}, e = {e}");
            assert_supported(&scene, &frame, 0.05 * 0.05);
            assert_eq!(ledger.kinetic, 0.0);
            assert!(ledger.residual.abs() < 1e-13, "{dimension:?}, e = {e}: {ledger:?}");
            // The losses in the log, with those of rest, are those of the ledger, up to the rounding of this
            // sum.
            let lost: f64 = log.0.iter().map(|event| event.energy_loss).sum();
            let recorded = ledger.dissipated + ledger.term(haff_engine::Term::Rest);
            assert!((lost / recorded - 1.0).abs() < 1e-12, "{dimension:?}, e = {e}: {lost}, {recorded}");
            let carnot: f64 = log.0.iter().map(|event| event.carnot_energy).sum();
            assert!(
                (carnot / ledger.carnot - 1.0).abs() < 1e-12,
                "{dimension:?}, e = {e}: {carnot}, {ledger:?}"
            );
            let rows = |kind| log.0.iter().filter(|event| event.kind == kind).count() as u64;
            let rests = rows(EventKind::Rest);
            let counted = [counters.collisions, counters.wall_collisions, counters.rests];
            assert_eq!([rows(EventKind::Collision), rows(EventKind::Wall), rests], counted);
            // At the end all grains are at rest, so each has been put to rest once more often than it has
            // been woken. The other rows of rest are those of jams and of completed series of bounces; the
            // `carnot_energy` of the latter differs from their loss unless e = 0.
            let is_series = |event: &&EventRecord| {
                event.kind == EventKind::Rest && event.carnot_energy != event.energy_loss
            };
            let series = log.0.iter().filter(is_series).count() as u64;
            assert!(rests - series >= counters.wakes + count as u64, "{series} series, {counters:?}");
            // Waking grains get back less energy than was removed when they were put to rest.
            assert!(ledger.term(haff_engine::Term::Rest) > 0.0, "{dimension:?}, e = {e}: {ledger:?}");
            // Gravity, impacts and supports together have removed the initial momentum.
            let mass = |body: &haff_engine::Body| scene.classes[body.class as usize].mass;
            let first: DVec3 = scene.bodies.iter().map(|body| mass(body) * body.velocity).sum();
            let left = first + simulation.sample().external_impulse;
            let scale = simulation.time() * count as f64;
            assert!(left.length() < 1e-12 * scale, "{dimension:?}, e = {e}: {left} of {scale}");
            // Grains at rest have no events.
            let again = simulation.advance(Until { time: 1e6, ..Until::default() }, &mut Silent).unwrap();
            assert_eq!((again, simulation.counters()), (Stop::Rest, counters));
        }
    }
}

#[test]
#[ignore = "long: scripts/test all"]
fn rest_is_independent_of_search_and_checkpoints() {
    for (k, e) in [0.0, 0.01, 0.3, 0.5, 0.9].into_iter().enumerate() {
        for dimension in [Dimension::Three, Dimension::Two] {
            let scene = poured(dimension, 25, 3.4, e, 20 + k as u64);
            let until = |time: f64| Until { time, ..Until::default() };
            let mut expected = Log::default();
            let mut reference = start(&scene, NeighborChoice::AllPairs);
            let mut hashes = Vec::new();
            let times = [4.0, 9.0, 20.0, 60.0];
            for time in times {
                reference.advance(until(time), &mut expected).unwrap();
                hashes.push(reference.state_hash());
            }
            assert!(reference.counters().rests > 5, "{:?}", reference.counters());
            for neighbors in [NeighborChoice::Cells, NeighborChoice::Lists] {
                let mut log = Log::default();
                let mut simulation = start(&scene, neighbors);
                for (time, hash) in times.into_iter().zip(&hashes) {
                    // In slices, and at each time a checkpoint and a resumption from it.
                    let slice = Until { entries: 777, ..until(time) };
                    while simulation.advance(slice, &mut log).unwrap() == Stop::Slice {}
                    assert_eq!(
                        simulation.state_hash(),
                        *hash,
                        "{dimension:?}, e = {e}, {neighbors:?}, t = {time}"
                    );
                    let checkpoint = simulation.checkpoint();
                    let options = Options { neighbors, ..Options::default() };
                    simulation = Simulation::restore(scene.clone(), options, &checkpoint).unwrap();
                    assert_eq!(simulation.checkpoint(), checkpoint);
                }
                assert_eq!(log.0, expected.0, "{dimension:?}, e = {e}, {neighbors:?}");
            }
        }
    }
}

/// A grain falls on a heap at rest: it wakes the grains that it hits, and all come to rest again.
#[test]
fn a_heap_at_rest_wakes_when_it_is_hit() {
    let mut scene = poured(Dimension::Three, 30, 3.3, 0.5, 3);
    let size = &mut scene.domain.size;
    size.z = 400.0;
    let top = size.z;
    for wall in scene.walls.iter_mut().filter(|wall| wall.name == "z+") {
        wall.point.z = top;
    }
    add(&mut scene, 1, DVec3::new(1.6, 1.7, 300.0), DVec3::ZERO);
    let mut simulation = start(&scene, NeighborChoice::Auto);
    // It falls by 300 − 3 in a time of 24; by then the others are at rest.
    simulation.advance(Until { time: 23.5, ..Until::default() }, &mut Silent).unwrap();
    let before = simulation.frame();
    let moving = before.velocity.iter().filter(|v| **v != DVec3::ZERO).count();
    assert_eq!(moving, 1, "{:?}", simulation.counters());
    let (events, wakes) = (simulation.counters(), simulation.counters().wakes);
    simulation.advance(Until { time: 23.9, ..Until::default() }, &mut Silent).unwrap();
    let quiet = simulation.counters();
    assert_eq!(quiet.collisions + quiet.wall_collisions, events.collisions + events.wall_collisions);
    let stop = simulation.advance(Until { time: 500.0, ..Until::default() }, &mut Silent).unwrap();
    assert_eq!(stop, Stop::Rest);
    assert!(simulation.counters().wakes > wakes + 5, "{:?}", simulation.counters());
    assert_supported(&scene, &simulation.frame(), 0.05 * 0.05);
    assert!(simulation.ledger().residual.abs() < 1e-13);
}

/// A vertical column of grains comes to rest; a grain that is off the axis of the grain below rolls off.
#[test]
fn a_vertical_column_comes_to_rest_and_an_unsupported_grain_does_not() {
    let mut scene = system(Dimension::Three, DVec3::new(9.0, 9.0, 9.0), [Boundary::Wall; 3]);
    scene.domain.gravity = DVec3::new(0.0, 0.0, -1.0);
    set_restitution(&mut scene, 0.5);
    scene.contacts.rest_speed = 0.05;
    let ball = class(&mut scene, 0.5, 1.0);
    for k in 0..5 {
        add(&mut scene, ball, DVec3::new(2.0, 2.0, 0.5 + f64::from(k) * 1.001), DVec3::ZERO);
    }
    let mut simulation = start(&scene, NeighborChoice::Auto);
    let stop = simulation.advance(Until { time: 50.0, ..Until::default() }, &mut Silent).unwrap();
    assert_eq!(stop, Stop::Rest);
    // The slope at the contact is above the one that the engine ignores, so the upper grain rolls off.
    scene.bodies.truncate(2);
    scene.bodies[1].position.x += 0.02;
    let mut simulation = start(&scene, NeighborChoice::Auto);
    simulation.advance(Until { time: 30.0, ..Until::default() }, &mut Silent).unwrap();
    let height = simulation.frame().position[1].z;
    assert!(height < 0.5 + 1e-3, "{height}");
}

/// A grain that bounces on the top of a fixed sphere comes to rest there; beside the top it does not.
#[test]
fn a_grain_rests_on_top_of_a_fixed_sphere() {
    for (offset, rests) in [(0.0, true), (0.1, false)] {
        let mut scene = system(Dimension::Three, DVec3::splat(1.0), [Boundary::Open; 3]);
        scene.domain.gravity = DVec3::new(0.0, 0.0, -1.0);
        set_restitution(&mut scene, 0.5);
        scene.contacts.rest_speed = 0.05;
        let (fixed, grain) = (class(&mut scene, 1.0, f64::INFINITY), class(&mut scene, 0.5, 1.0));
        add(&mut scene, fixed, DVec3::ZERO, DVec3::ZERO);
        add(&mut scene, grain, DVec3::new(offset, 0.0, 2.5), DVec3::ZERO);
        let mut simulation = start(&scene, NeighborChoice::Auto);
        let stop = simulation.advance(Until { time: 40.0, ..Until::default() }, &mut Silent).unwrap();
        assert_eq!(stop == Stop::Rest, rests, "offset {offset}");
        let z = simulation.frame().position[1].z;
        assert_eq!(z > 1.49, rests, "offset {offset}: {z}");
        // Without walls and jams, the only rows of rest are those of grains that fall asleep.
        let counters = simulation.counters();
        assert_eq!(counters.rests, counters.wakes + u64::from(rests), "{counters:?}");
        assert!(simulation.ledger().residual.abs() < 1e-13);
    }
}

/// A moving wall wakes the grains that it touches and does not pass through them.
#[test]
fn a_piston_pushes_grains_at_rest() {
    let mut scene = poured(Dimension::Two, 12, 6.3, 0.5, 5);
    let push = DVec3::new(0.05, 0.0, 0.0);
    scene.walls.push(haff_engine::Wall {
        name: "piston".into(),
        point: DVec3::new(-2.0, 0.0, 0.0),
        normal: DVec3::X,
        motion: (push).into(),
        shape: None,
    });
    scene.contacts.wall.push((Restitution::Constant(0.5)).into());
    let mut simulation = start(&scene, NeighborChoice::Auto);
    // At t = 60 the piston is at x = 1.
    for k in 1..=60 {
        simulation.advance(Until { time: f64::from(k), ..Until::default() }, &mut Silent).unwrap();
        let depth = simulation.measure_overlap().unwrap().depth;
        assert!(depth <= 1e-12, "t = {k}: overlap {depth:e}");
    }
    assert!(simulation.counters().wakes > 0, "{:?}", simulation.counters());
    assert!(simulation.ledger().residual.abs() < 1e-13);
}

/// On a moving wall no series of bounces is completed in closed form: a grain on it keeps bouncing, but the
/// number of bounces is bounded.
#[test]
fn bounces_on_a_moving_floor_are_bounded_in_number() {
    for e in [0.0, 0.01, 0.5, 0.9] {
        for speed in [-0.3, -1e-3, 1e-4, 0.02, 1.0] {
            let mut scene = system(Dimension::Three, DVec3::ONE, [Boundary::Open; 3]);
            scene.domain.gravity = DVec3::NEG_Z;
            let velocity = DVec3::Z * speed;
            let (name, point) = ("floor".to_owned(), DVec3::ZERO);
            scene.walls.push(haff_engine::Wall {
                name,
                point,
                normal: DVec3::Z,
                motion: velocity.into(),
                shape: None,
            });
            scene.contacts.wall.push((Restitution::Constant(e)).into());
            let v = 0.05;
            scene.contacts.rest_speed = v;
            let grain = class(&mut scene, 0.5, 1.0);
            add(&mut scene, grain, DVec3::new(0.0, 0.0, 0.75), DVec3::ZERO);
            let mut simulation = start(&scene, NeighborChoice::Auto);
            let time = 60.0;
            let stop = simulation.advance(Until { time, ..Until::default() }, &mut Silent).unwrap();
            // Bounces have speeds of v/128 and more and last v/64g each; 100 are for the bounces before them.
            let most = (time / (v / 64.0)) as u64 + 100;
            let counters = simulation.counters();
            assert!(stop == Stop::Time && counters.wall_collisions <= most, "e = {e}, {speed}: {counters:?}");
            let height = simulation.frame().position[0].z - speed * time - 0.5;
            assert!((-1e-14..v * v).contains(&height), "e = {e}, {speed}: {height:e} above the floor");
            assert!(simulation.ledger().residual.abs() < 1e-12);
        }
    }
}

/// Without gravity rest is off: three grains on a line with e < 7 − 4√3 collapse unless contacts become
/// elastic.
#[test]
fn three_grains_on_a_line_collapse_below_the_critical_restitution_only() {
    let critical = 7.0 - 4.0 * 3.0_f64.sqrt();
    let line = |e: f64| {
        let mut scene = system(Dimension::Three, DVec3::ONE, [Boundary::Open; 3]);
        set_restitution(&mut scene, e);
        let ball = class(&mut scene, 0.5, 1.0);
        for (x, speed) in [(0.0, 1.0), (2.0, 0.3), (4.0, -1.0)] {
            add(&mut scene, ball, DVec3::new(x, 0.0, 0.0), DVec3::new(speed, 0.0, 0.0));
        }
        scene
    };
    let relative = |scene: &System| {
        let mut simulation = start(scene, NeighborChoice::Auto);
        simulation.advance(Until { time: 100.0, ..Until::default() }, &mut Silent).unwrap();
        let v = simulation.frame().velocity;
        ((v[1].x - v[0].x).min(v[2].x - v[1].x), simulation.counters().collisions)
    };
    // Above the critical e they separate after a few collisions; below it their relative velocities vanish.
    for e in [1.05 * critical, 0.1, 0.3] {
        let (speed, collisions) = relative(&line(e));
        assert!(speed > 1e-12 && collisions < 60, "e = {e}: {speed:e} after {collisions}");
    }
    for e in [0.95 * critical, 0.05, 0.01] {
        let (speed, collisions) = relative(&line(e));
        assert!(speed.abs() < 1e-13 && collisions > 25, "e = {e}: {speed:e} after {collisions}");
        let mut tc = line(e);
        tc.contacts.tc = 1e-3;
        let mut cutoff = line(e);
        cutoff.contacts.pair.fill(Restitution::Cutoff { restitution: e, speed: 1e-3, exponent: 0.75 });
        for scene in [tc, cutoff] {
            let (speed, collisions) = relative(&scene);
            assert!(speed > 1e-9 && collisions < 60, "e = {e}: {speed:e} after {collisions}");
        }
    }
}
