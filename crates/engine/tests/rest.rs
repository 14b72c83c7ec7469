//! Grains that lean on each other: they come to rest, stay there at no cost, and wake when hit.

mod common;

use common::{Log, Random, add, class, scatter, set_restitution, system};
use glam::DVec3;
use haff_engine::{
    Boundary, Dimension, EventKind, EventRecord, Frame, NeighborChoice, Options, Silent, Simulation, Stop,
    System, Until,
};
use haff_mechanics::Restitution;

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

/// Asserts that no grain can move down along any of many directions: each one is blocked by a contact.
/// Independent of how the engine looks for it.
fn assert_stands(scene: &System, frame: &Frame, gap: f64) {
    let mut random = Random(1);
    let down = scene.domain.gravity.normalize();
    let flat = scene.dimension == Dimension::Two;
    let directions: Vec<DVec3> = (0..4000)
        .map(|_| {
            let z = if flat { 0.0 } else { random.normal() };
            DVec3::new(random.normal(), random.normal(), z).normalize()
        })
        // Nearly level ones are left out: a slope of 1e-3 passes for none, and gaps tilt normals.
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
            assert_stands(&scene, &frame, 0.05 * 0.05);
            assert_eq!(ledger.kinetic, 0.0);
            assert!(ledger.residual.abs() < 1e-13, "{dimension:?}, e = {e}: {ledger:?}");
            // The log tells the same losses, those of rest among them: the very terms of the ledger, but for
            // the rounding of this sum.
            let lost: f64 = log.0.iter().map(|event| event.energy_loss).sum();
            let booked = ledger.dissipated + ledger.term(haff_engine::Term::Rest);
            assert!((lost / booked - 1.0).abs() < 1e-12, "{dimension:?}, e = {e}: {lost}, {booked}");
            let carnot: f64 = log.0.iter().map(|event| event.carnot_energy).sum();
            assert!(
                (carnot / ledger.carnot - 1.0).abs() < 1e-12,
                "{dimension:?}, e = {e}: {carnot}, {ledger:?}"
            );
            let rows = |kind| log.0.iter().filter(|event| event.kind == kind).count() as u64;
            let rests = rows(EventKind::Rest);
            let counted = [counters.collisions, counters.wall_collisions, counters.rests];
            assert_eq!([rows(EventKind::Collision), rows(EventKind::Wall), rests], counted);
            // All lie on each other in the end, so each has been put to rest once more than it has been
            // woken. The other rows are those of completed series of bounces, which have lost more velocity
            // than was left unless e = 0, and of jams.
            let is_series = |event: &&EventRecord| {
                event.kind == EventKind::Rest && event.carnot_energy != event.energy_loss
            };
            let series = log.0.iter().filter(is_series).count() as u64;
            assert!(rests - series >= counters.wakes + count as u64, "{series} series, {counters:?}");
            // What rest has given back to those it has let go is less than what it had taken.
            assert!(ledger.term(haff_engine::Term::Rest) > 0.0, "{dimension:?}, e = {e}: {ledger:?}");
            // Momentum: gravity, impacts and what holds the grains take together what there was.
            let mass = |body: &haff_engine::Body| scene.classes[body.class as usize].mass;
            let first: DVec3 = scene.bodies.iter().map(|body| mass(body) * body.velocity).sum();
            let left = first + simulation.sample().external_impulse;
            let scale = simulation.time() * count as f64;
            assert!(left.length() < 1e-12 * scale, "{dimension:?}, e = {e}: {left} of {scale}");
            // At rest nothing costs anything.
            let again = simulation.advance(Until { time: 1e6, ..Until::default() }, &mut Silent).unwrap();
            assert_eq!((again, simulation.counters()), (Stop::Rest, counters));
        }
    }
}

#[test]
fn rest_does_not_depend_on_the_search_nor_on_a_checkpoint() {
    for (k, e) in [0.0, 0.01, 0.3, 0.5, 0.9].into_iter().enumerate() {
        for dimension in [Dimension::Three, Dimension::Two] {
            let scene = poured(dimension, 25, 3.4, e, 20 + k as u64);
            let until = |time: f64| Until { time, ..Until::default() };
            let mut expected = Log::default();
            let mut twin = start(&scene, NeighborChoice::AllPairs);
            let mut hashes = Vec::new();
            let times = [4.0, 9.0, 20.0, 60.0];
            for time in times {
                twin.advance(until(time), &mut expected).unwrap();
                hashes.push(twin.state_hash());
            }
            assert!(twin.counters().rests > 5, "{:?}", twin.counters());
            for neighbors in [NeighborChoice::Cells, NeighborChoice::Lists] {
                let mut log = Log::default();
                let mut simulation = start(&scene, neighbors);
                for (time, hash) in times.into_iter().zip(&hashes) {
                    // In slices, and with a stop, a checkpoint and a resumption on the way.
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

/// A heap at rest, and a grain high above it: it wakes those that it hits, and all come to rest again.
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
    // It falls 300 − 3 in 24: the others are at rest by then.
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
    assert_stands(&scene, &simulation.frame(), 0.05 * 0.05);
    assert!(simulation.ledger().residual.abs() < 1e-13);
}

/// A column of grains, one on the other, stands; one that stands next to a pit does not.
#[test]
fn a_column_stands_and_a_grain_on_a_slope_does_not() {
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
    // Off the axis by more than the slope that passes for none, the upper one rolls off.
    scene.bodies.truncate(2);
    scene.bodies[1].position.x += 0.02;
    let mut simulation = start(&scene, NeighborChoice::Auto);
    simulation.advance(Until { time: 30.0, ..Until::default() }, &mut Silent).unwrap();
    let height = simulation.frame().position[1].z;
    assert!(height < 0.5 + 1e-3, "{height}");
}

/// A grain that bounces on top of a fixed sphere comes to rest there, off its top it does not.
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
        // Without walls and jams there are no rows of rest but those of grains that are held from then on.
        let counters = simulation.counters();
        assert_eq!(counters.rests, counters.wakes + u64::from(rests), "{counters:?}");
        assert!(simulation.ledger().residual.abs() < 1e-13);
    }
}

/// A moving wall wakes what it meets: nothing passes through a grain at rest.
#[test]
fn a_piston_pushes_grains_at_rest() {
    let mut scene = poured(Dimension::Two, 12, 6.3, 0.5, 5);
    let push = DVec3::new(0.05, 0.0, 0.0);
    scene.walls.push(haff_engine::Wall {
        name: "piston".into(),
        point: DVec3::new(-2.0, 0.0, 0.0),
        normal: DVec3::X,
        motion: (push).into(),
    });
    scene.contacts.wall.push((Restitution::Constant(0.5)).into());
    let mut simulation = start(&scene, NeighborChoice::Auto);
    // At t = 60 it stands at x = 1.
    for k in 1..=60 {
        simulation.advance(Until { time: f64::from(k), ..Until::default() }, &mut Silent).unwrap();
        let depth = simulation.measure_overlap().unwrap().depth;
        assert!(depth <= 1e-12, "t = {k}: overlap {depth:e}");
    }
    assert!(simulation.counters().wakes > 0, "{:?}", simulation.counters());
    assert!(simulation.ledger().residual.abs() < 1e-13);
}

/// On a wall that moves no series of bounces is completed in closed form: a grain that is alone with it goes
/// on with small bounces, of which there are not too many.
#[test]
fn a_grain_on_a_moving_floor_bounces_on_at_little_cost() {
    for e in [0.0, 0.01, 0.5, 0.9] {
        for speed in [-0.3, -1e-3, 1e-4, 0.02, 1.0] {
            let mut scene = system(Dimension::Three, DVec3::ONE, [Boundary::Open; 3]);
            scene.domain.gravity = DVec3::NEG_Z;
            let velocity = DVec3::Z * speed;
            let (name, point) = ("floor".to_owned(), DVec3::ZERO);
            scene.walls.push(haff_engine::Wall { name, point, normal: DVec3::Z, motion: velocity.into() });
            scene.contacts.wall.push((Restitution::Constant(e)).into());
            let v = 0.05;
            scene.contacts.rest_speed = v;
            let grain = class(&mut scene, 0.5, 1.0);
            add(&mut scene, grain, DVec3::new(0.0, 0.0, 0.75), DVec3::ZERO);
            let mut simulation = start(&scene, NeighborChoice::Auto);
            let time = 60.0;
            let stop = simulation.advance(Until { time, ..Until::default() }, &mut Silent).unwrap();
            // Bounces at v/128 and more, which take v/64g each, and the few that have led to them.
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
    // Above it they part after a few collisions; below it nothing is left of their relative velocities.
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
