//! The engine obeys the laws of mechanics.

use glam::DVec3;
use haff_engine::{
    Boundary, Dimension, EngineError, EventKind, Options, Silent, Simulation, Stop, System, Until, Wall,
};
use haff_mechanics::Restitution;

use crate::common::{Log, Random, add, class, gas, scatter, set_restitution, system};

fn start(system: System) -> Simulation {
    Simulation::new(system, Options::default()).unwrap()
}

/// A ball dropped from clear height `height` on a floor.
fn bouncing_ball(height: f64, radius: f64, gravity: f64, e: f64) -> System {
    let mut scene = system(Dimension::Three, DVec3::splat(1.0), [Boundary::Open; 3]);
    scene.domain.gravity = DVec3::new(0.0, 0.0, -gravity);
    scene.walls.push(Wall {
        name: "floor".into(),
        point: DVec3::ZERO,
        normal: DVec3::Z,
        motion: haff_engine::WallMotion::Fixed,
        shape: None,
    });
    scene.contacts.wall.push((Restitution::Constant(e)).into());
    let ball = class(&mut scene, radius, 2.0);
    add(&mut scene, ball, DVec3::new(0.3, -0.2, radius + height), DVec3::ZERO);
    scene
}

#[test]
fn rebound_height_is_e_squared_and_rest_is_reached_in_finite_time() {
    for (height, radius, gravity, e) in [
        (1.0, 0.1, 9.81, 0.8),
        (10.0, 0.5, 1.0, 0.5),
        (2.0, 0.3, 9.81, 0.95),
        (3.0, 1.0, 0.02, 0.1),
        (1.0, 1.0, 1.0, 0.0),
    ] {
        let mut simulation = start(bouncing_ball(height, radius, gravity, e));
        let mut log = Log::default();
        let stop = simulation.advance(Until::default(), &mut log).unwrap();
        assert_eq!(stop, Stop::Rest, "e = {e}");
        let (rest, bounces) = log.0.split_last().unwrap();
        assert_eq!(rest.kind, EventKind::Rest);
        let mut path = height;
        for (k, bounce) in bounces.iter().enumerate() {
            // Before the k-th impact the ball falls from the height H_k = e^{2k} H.
            let found = bounce.approach_speed.powi(2) / (2.0 * gravity);
            let expected = e.powi(2 * k as i32) * height;
            assert!(
                (found - expected).abs() <= 1e-12 * height,
                "e = {e}, bounce {k}: height {found}, not {expected}"
            );
            path += if k > 0 { 2.0 * found } else { 0.0 };
        }
        // The path of the completed series: 2 H_k + 2 H_{k+1} + ….
        let left = rest.approach_speed.powi(2) / (2.0 * gravity);
        path += 2.0 * left / (1.0 - e * e);
        let expected = height * (1.0 + e * e) / (1.0 - e * e);
        assert!((path / expected - 1.0).abs() < 1e-9, "e = {e}: path {path}, not {expected}");
        let duration = (2.0 * height / gravity).sqrt() * (1.0 + e) / (1.0 - e);
        assert!(
            (simulation.time() / duration - 1.0).abs() < 1e-9,
            "e = {e}: {} s, not {duration}",
            simulation.time()
        );
        // All energy of the fall is lost, and the losses of the rows add up to it.
        let lost: f64 = log.0.iter().map(|event| event.energy_loss).sum();
        let energy = 2.0 * gravity * height;
        assert!((lost / energy - 1.0).abs() < 1e-12, "e = {e}: {lost} of {energy} lost");
        assert!(simulation.ledger().residual.abs() < 1e-13);
        let frame = simulation.frame();
        assert!((frame.position[0].z - radius).abs() < 1e-13 * (height + radius));
        assert_eq!(frame.velocity[0], DVec3::ZERO);
        // The impulses of gravity, of the impacts and of the supporting floor add up to zero.
        assert!(simulation.sample().external_impulse.length() < 1e-12 * energy.sqrt());
    }
}

/// Slower bounces are more elastic, but the sum of their durations is finite.
#[test]
#[ignore = "long: scripts/test all"]
fn a_ball_comes_to_rest_under_laws_that_depend_on_the_speed() {
    let cutoff = |restitution, speed, exponent| Restitution::Cutoff { restitution, speed, exponent };
    for (law, p) in [
        (Restitution::Viscoelastic { coefficient: 0.1 }, 0.2),
        (Restitution::Viscoelastic { coefficient: 0.4 }, 0.2),
        (cutoff(0.5, 1.0, 0.5), 0.5),
        (cutoff(0.3, 0.2, 0.75), 0.75),
    ] {
        let (height, g) = (1.0, 1.0);
        let mut scene = bouncing_ball(height, 0.5, g, 1.0);
        scene.contacts.wall = vec![(law).into()];
        let mut simulation = start(scene);
        let mut log = Log::default();
        assert_eq!(simulation.advance(Until::default(), &mut log).unwrap(), Stop::Rest, "{law:?}");
        // The sum over bounces, and the integral of the remaining ones, with a relative error of about 10⁻⁶.
        let fall = (2.0 * height / g).sqrt();
        let (mut w, mut speeds) = (g * fall, 0.0);
        for _ in 0..3_000_000 {
            w *= law.coefficient(w);
            speeds += w;
        }
        speeds += w / ((1.0 - law.coefficient(w)) * (1.0 - p)) - w;
        let expected = fall + 2.0 * speeds / g;
        let found = simulation.time();
        assert!((found / expected - 1.0).abs() < 1e-8, "{law:?}: {found} s, not {expected}");
        let lost: f64 = log.0.iter().map(|event| event.energy_loss).sum();
        assert!((lost / (2.0 * g * height) - 1.0).abs() < 1e-11, "{law:?}: {lost} lost");
        assert!(simulation.ledger().residual.abs() < 1e-12, "{law:?}: {:?}", simulation.ledger());
        assert!(simulation.sample().external_impulse.length() < 1e-11, "{law:?}");
    }
    // The sum of these bounces diverges, but finally they are below rounding.
    let mut scene = bouncing_ball(1e-6, 0.5, 1.0, 1.0);
    scene.contacts.wall = vec![(cutoff(0.0, 1e-3, 1.0)).into()];
    let mut simulation = start(scene);
    assert_eq!(simulation.advance(Until::default(), &mut Silent).unwrap(), Stop::Rest);
    assert!(simulation.ledger().residual.abs() < 1e-12);
}

#[test]
fn a_ball_on_the_floor_stays_at_rest_until_it_is_hit() {
    let mut scene = bouncing_ball(0.0, 0.5, 1.0, 0.5);
    let ball = 0;
    // A second ball falls on the first.
    add(&mut scene, ball, DVec3::new(0.3, -0.2, 4.0), DVec3::ZERO);
    let mut simulation = start(scene);
    let mut log = Log::default();
    simulation.advance(Until { time: 2.0, ..Until::default() }, &mut log).unwrap();
    assert_eq!(
        log.0.iter().map(|event| (event.kind, event.i)).collect::<Vec<_>>()[..2],
        [(EventKind::Wall, 0), (EventKind::Rest, 0)]
    );
    let before = log.0.len();
    // The upper ball falls by 2.5 in a time of √5.
    simulation.advance(Until { time: 5.0_f64.sqrt() + 0.01, ..Until::default() }, &mut log).unwrap();
    assert!(log.0[before..].iter().any(|event| event.kind == EventKind::Collision), "{:?}", log.0);
    assert!(simulation.ledger().residual.abs() < 1e-13);
}

#[test]
fn a_ball_slides_down_a_tilted_plane_without_friction() {
    let (g, angle) = (10.0_f64, 0.5_f64);
    let normal = DVec3::new(-angle.sin(), 0.0, angle.cos());
    let mut scene = system(Dimension::Three, DVec3::ONE, [Boundary::Open; 3]);
    scene.domain.gravity = DVec3::new(0.0, 0.0, -g);
    scene.walls.push(Wall {
        name: "ramp".into(),
        point: DVec3::ZERO,
        normal,
        motion: haff_engine::WallMotion::Fixed,
        shape: None,
    });
    scene.contacts.wall.push((Restitution::Constant(0.5)).into());
    let ball = class(&mut scene, 0.5, 1.0);
    add(&mut scene, ball, normal * 0.5, DVec3::ZERO);
    let mut simulation = start(scene);
    let stop = simulation.advance(Until { time: 2.0, ..Until::default() }, &mut Silent).unwrap();
    assert_eq!(stop, Stop::Time);
    let frame = simulation.frame();
    // Down the plane with g sin α, and always in contact.
    let downhill = DVec3::new(-angle.cos(), 0.0, -angle.sin());
    let expected = downhill * (g * angle.sin() * 2.0);
    assert!((frame.velocity[0] - expected).length() < 1e-12, "{} not {expected}", frame.velocity[0]);
    assert!((frame.position[0].dot(normal) - 0.5).abs() < 1e-12);
    assert!(simulation.ledger().residual.abs() < 1e-13);
}

#[test]
fn momentum_changes_only_by_external_impulses() {
    let mut random = Random(3);
    let mut scene = system(Dimension::Three, DVec3::splat(9.0), [Boundary::Wall; 3]);
    scene.domain.gravity = DVec3::new(0.1, 0.0, -0.5);
    set_restitution(&mut scene, 0.8);
    let (light, heavy) = (class(&mut scene, 0.4, 1.0), class(&mut scene, 0.8, 5.0));
    scatter(&mut scene, light, 60, 1.0, &mut random);
    scatter(&mut scene, heavy, 10, 1.0, &mut random);
    let mut simulation = start(scene);
    let before = simulation.sample();
    simulation.advance(Until { time: 15.0, ..Until::default() }, &mut Silent).unwrap();
    let after = simulation.sample();
    assert!(after.collisions > 250 && after.wall_collisions > 500, "{after:?}");
    let change = after.momentum - before.momentum;
    let scale = after.external_impulse.length().max(100.0);
    assert!(
        (change - after.external_impulse).length() < 1e-13 * scale,
        "{change} against {}",
        after.external_impulse
    );
    assert!(after.ledger.residual.abs() < 1e-13, "{:e}", after.ledger.residual);
    // Carnot: each loss is (1 − e)/(1 + e) of the energy of the lost velocities; so are the sums.
    let ratio = after.ledger.dissipated / after.ledger.carnot;
    assert!((ratio - 0.2 / 1.8).abs() < 1e-12, "{ratio}");
}

#[test]
fn smooth_contacts_conserve_angular_momentum() {
    let mut random = Random(4);
    let mut scene = system(Dimension::Three, DVec3::splat(6.0), [Boundary::Open; 3]);
    set_restitution(&mut scene, 0.7);
    let (small, large) = (class(&mut scene, 0.3, 1.0), class(&mut scene, 0.6, 4.0));
    scatter(&mut scene, small, 60, 0.0, &mut random);
    scatter(&mut scene, large, 20, 0.0, &mut random);
    // A cluster that contracts and rotates.
    let middle = DVec3::splat(3.0);
    for body in &mut scene.bodies {
        let r = body.position - middle;
        body.velocity = -r + DVec3::Z.cross(r) * 0.3;
    }
    let mut simulation = start(scene);
    let before = simulation.sample();
    simulation.advance(Until { time: 20.0, ..Until::default() }, &mut Silent).unwrap();
    let after = simulation.sample();
    assert!(after.collisions > 50, "{}", after.collisions);
    let (h0, h1) = (before.angular_momentum.unwrap(), after.angular_momentum.unwrap());
    // Particles fly to r ≈ 60 with p ≈ 3 each: rounding is relative to Σ |r × p| there.
    assert!((h1 - h0).length() < 1e-12 * h0.length().max(1.0), "{h0} → {h1}");
    assert!((after.momentum - before.momentum).length() < 1e-13 * 80.0);
}

#[test]
fn work_of_moving_walls_and_driven_bodies_equals_the_energy_change() {
    let mut random = Random(6);
    let mut scene = system(Dimension::Three, DVec3::new(12.0, 6.0, 6.0), [Boundary::Wall; 3]);
    scene.walls.push(Wall {
        name: "piston".into(),
        point: DVec3::new(1.0, 0.0, 0.0),
        normal: DVec3::X,
        motion: DVec3::new(0.2, 0.0, 0.0).into(),
        shape: None,
    });
    scene.contacts.wall.push((Restitution::Constant(1.0)).into());
    set_restitution(&mut scene, 0.95);
    let grain = class(&mut scene, 0.4, 1.0);
    let driven = class(&mut scene, 0.5, f64::INFINITY);
    scatter(&mut scene, driven, 1, 0.0, &mut random);
    scene.bodies[0].position = DVec3::new(6.0, 3.0, 3.0);
    scene.bodies[0].velocity = DVec3::new(0.5, 0.0, 0.0);
    scatter(&mut scene, grain, 40, 1.0, &mut random);
    let mut simulation = start(scene);
    simulation.advance(Until { time: 10.0, ..Until::default() }, &mut Silent).unwrap();
    let sample = simulation.sample();
    assert!(sample.ledger.term(haff_engine::Term::WallWork) > 1.0, "{:?}", sample.ledger);
    assert!(sample.ledger.residual.abs() < 1e-13, "{:?}", sample.ledger);
    let frame = simulation.frame();
    assert_eq!(frame.velocity[0], DVec3::new(0.5, 0.0, 0.0));
    assert_eq!(frame.position[0], DVec3::new(11.0, 3.0, 3.0));
    assert!(simulation.measure_overlap().unwrap().depth < 1e-12);
}

/// An elastic fluid with all velocities reversed returns to its start, up to the growth of rounding errors.
#[test]
fn a_reversed_elastic_fluid_retraces_its_path() {
    let scene = gas(5, 0.25, 1.0, 11);
    let start_positions: Vec<DVec3> = scene.bodies.iter().map(|body| body.position).collect();
    let unwrapped = |simulation: &Simulation| {
        let frame = simulation.frame();
        let size = simulation.system().domain.size;
        (0..frame.position.len())
            .map(|i| frame.position[i] + size * DVec3::from_array(frame.image[i].map(f64::from)))
            .collect::<Vec<_>>()
    };
    let mut errors = Vec::new();
    for per_particle in [2_u64, 4, 6, 8] {
        let mut simulation = start(scene.clone());
        let collisions = per_particle * 125 / 2;
        simulation.advance(Until { collisions, ..Until::default() }, &mut Silent).unwrap();
        let time = simulation.time();
        simulation.reverse();
        simulation.advance(Until { time: 2.0 * time, ..Until::default() }, &mut Silent).unwrap();
        // The collision at the time of the reversal is reversed, too.
        assert_eq!(
            simulation.counters().collisions.abs_diff(2 * collisions),
            0,
            "the same number of collisions in both directions"
        );
        let error = unwrapped(&simulation)
            .iter()
            .zip(&start_positions)
            .map(|(a, b)| (*a - *b).length())
            .fold(0.0, f64::max);
        println!("{per_particle} collisions a particle: returns to within {error:.1e} σ");
        errors.push(error);
    }
    // Errors start at 1e-16 and grow by a factor of about 3 to 10 per collision (λ ≈ 1–2 per collision),
    // forwards and backwards.
    assert!(errors[0] < 1e-11 && errors[3] < 1e-3, "{errors:?}");
    assert!(errors[0] > 0.0 && errors[3] > errors[0], "{errors:?}");
}

/// The energy error of an elastic gas is a random walk. With a unit normal in the impact, the energy would
/// rise by 1.4 ε T per collision.
#[test]
#[ignore = "long: scripts/test all"]
fn energy_error_of_an_elastic_gas_has_no_drift() {
    let mut random = Random(12);
    let collisions = 200_000;
    for masses in [[1.0, 1.0], [0.7, 0.7], [1.0, 2.0], [0.3, 0.7]] {
        let mut scene = gas(6, 0.2, 1.0, 5);
        scene.classes[0].mass = masses[0];
        let other = class(&mut scene, 0.5, masses[1]);
        for body in scene.bodies.iter_mut().filter(|_| random.index(2) == 0) {
            body.class = other;
        }
        let bodies = scene.bodies.len() as f64;
        let mut simulation = start(scene);
        simulation.advance(Until { collisions, ..Until::default() }, &mut Silent).unwrap();
        // [ε T per collision], with an energy of 3/2 N T. A random walk with steps of 2.6 ε T gives 0.006.
        let found = simulation.ledger().residual / f64::EPSILON * 1.5 * bodies / collisions as f64;
        println!("masses {masses:?}: {found:.4} ε T a collision");
        assert!(found.abs() < 4.0 * 0.006, "masses {masses:?}: {found:.4} ε T a collision");
    }
}

/// An impact with e = 0 leaves an approach speed of a few ulp, which must not give a second contact.
#[test]
fn a_plastic_impact_is_one_event() {
    let mut random = Random(8);
    for _ in 0..500 {
        let mut scene = system(Dimension::Three, DVec3::splat(1.0), [Boundary::Open; 3]);
        set_restitution(&mut scene, 0.0);
        let (a, b) = (
            class(&mut scene, 0.5, random.uniform(0.1, 9.0)),
            class(&mut scene, 0.3, random.uniform(0.1, 9.0)),
        );
        let direction = DVec3::new(random.normal(), random.normal(), random.normal()).normalize();
        let side = DVec3::new(random.normal(), random.normal(), random.normal()) * 0.05;
        let drift = DVec3::new(random.normal(), random.normal(), random.normal());
        add(&mut scene, a, DVec3::ZERO, drift);
        add(&mut scene, b, direction * 3.0 + side, drift - direction);
        let mut simulation = start(scene);
        simulation.advance(Until { time: 1e6, ..Until::default() }, &mut Silent).unwrap();
        assert_eq!(simulation.counters().collisions, 1);
        let frame = simulation.frame();
        let depth = simulation.measure_overlap().unwrap().depth;
        let reach = frame.position.iter().map(|p| p.abs().max_element()).fold(0.0, f64::max);
        // Four ulp of the largest coordinate, in contact distances.
        let bound = 4.0 * f64::EPSILON * reach / 0.8;
        assert!(depth <= bound, "overlap {depth:e}, bound {bound:e}");
    }
}

/// A contact within tc of the last one is elastic.
#[test]
fn the_tc_model_makes_repeated_contacts_elastic() {
    let mut scene = system(Dimension::Three, DVec3::splat(1.0), [Boundary::Open; 3]);
    set_restitution(&mut scene, 0.5);
    let ball = class(&mut scene, 0.5, 1.0);
    // The first ball hits the second, which hits the third after a gap of 0.01.
    for (x, speed) in [(0.0, 1.0), (2.0, 0.0), (3.01, 0.0)] {
        add(&mut scene, ball, DVec3::new(x, 0.0, 0.0), DVec3::new(speed, 0.0, 0.0));
    }
    for (tc, second) in [(0.0, 0.5), (0.005, 0.5), (0.1, 1.0)] {
        scene.contacts.tc = tc;
        let mut simulation = start(scene.clone());
        let mut log = Log::default();
        simulation.advance(Until { collisions: 2, ..Until::default() }, &mut log).unwrap();
        // J = (1 + e) v/2 between equal masses.
        let e = |k: usize| 2.0 * log.0[k].impulse / log.0[k].approach_speed - 1.0;
        assert!((e(0) - 0.5).abs() < 1e-14, "no contact before the first: {}", e(0));
        assert!((e(1) - second).abs() < 1e-14, "tc = {tc}: e = {}, not {second}", e(1));
    }
}

/// Equal bounces could have equal rounding errors, which would add up. A grain that bounces without end, with
/// e = 1 or elastic within `contact.tc`, must not penetrate: a level or tilted wall, at rest or moving, a
/// corner of walls, a driven sphere.
#[test]
fn endless_bounces_do_not_penetrate() {
    let mut random = Random(5);
    let (tilted, other) = (DVec3::new(0.3, 0.1, 1.0).normalize(), DVec3::new(-0.7, 0.2, 1.0).normalize());
    let third = DVec3::new(0.1, -0.8, 1.0).normalize();
    for (e, tc) in [(1.0, 0.0), (0.5, 0.1), (0.9, 1e-3), (0.9, 1e-9)] {
        for (normals, speed) in [
            (vec![tilted], 0.0),
            (vec![DVec3::Z], 1e-3),
            (vec![DVec3::Z], -1e-3),
            (vec![tilted, other, third], 1e-3),
            (vec![], 1e-3),
        ] {
            let mut scene = system(Dimension::Three, DVec3::ONE, [Boundary::Open; 3]);
            let (radius, height) = (random.uniform(0.1, 1.0), random.uniform(0.5, 1.5));
            let grain = class(&mut scene, radius, 2.0);
            // With a single wall gravity is along its normal, so that the grain does not move sideways.
            let up = if normals.len() == 1 { normals[0] } else { DVec3::Z };
            scene.domain.gravity = -up;
            let velocity = up * speed;
            for &normal in &normals {
                scene.walls.push(Wall {
                    name: "floor".into(),
                    point: DVec3::ZERO,
                    normal,
                    motion: velocity.into(),
                    shape: None,
                });
                scene.contacts.wall.push((Restitution::Constant(1.0)).into());
            }
            let mut clear = radius;
            if normals.is_empty() {
                let driven = class(&mut scene, 0.5, f64::INFINITY);
                add(&mut scene, driven, DVec3::ZERO, velocity);
                clear += 0.5;
            }
            set_restitution(&mut scene, e);
            scene.contacts.tc = tc;
            let clear = normals.iter().map(|n| clear / n.dot(up)).fold(clear, f64::max);
            add(&mut scene, grain, up * (clear + height), DVec3::ZERO);
            let mut simulation = start(scene);
            let mut stop = Stop::Slice;
            for _ in 0..10 {
                stop = simulation.advance(Until { entries: 2000, ..Until::default() }, &mut Silent).unwrap();
                let position = simulation.frame().position[usize::from(normals.is_empty())];
                let depth = simulation.measure_overlap().unwrap().depth * radius;
                let allowed = 8.0 * f64::EPSILON * (position.abs().max_element() + radius + 0.5);
                assert!(
                    depth <= allowed,
                    "e = {e}, tc = {tc}, {normals:?} at {speed}: {depth:e}, allowed {allowed:e}"
                );
            }
            let counters = simulation.counters();
            let bounces = counters.collisions + counters.wall_collisions;
            assert!(stop == Stop::Rest || bounces > 10_000, "{stop:?}, {counters:?}");
            let residual = simulation.ledger().residual;
            assert!(
                residual.abs() < 20_000.0 * f64::EPSILON,
                "e = {e}, tc = {tc}, {normals:?}: {residual:e}"
            );
        }
    }
}

/// Where gravity is nearly along a tilted normal, its component along the plane is rounding: it moves a ball
/// at rest, but must not move it into the plane.
#[test]
fn a_ball_at_rest_on_a_tilted_plane_stays_on_it() {
    for slope in [0.0, 1e-3] {
        let normal = DVec3::new(0.3, 0.1, 1.0).normalize();
        let mut scene = system(Dimension::Three, DVec3::ONE, [Boundary::Open; 3]);
        scene.domain.gravity = -(normal + DVec3::X * slope).normalize();
        scene.walls.push(Wall {
            name: "floor".into(),
            point: DVec3::ZERO,
            normal,
            motion: haff_engine::WallMotion::Fixed,
            shape: None,
        });
        scene.contacts.wall.push((Restitution::Constant(0.5)).into());
        let ball = class(&mut scene, 0.5, 1.0);
        add(&mut scene, ball, normal * 0.75, DVec3::ZERO);
        let mut simulation = start(scene);
        simulation.advance(Until { time: 1e6, ..Until::default() }, &mut Silent).unwrap();
        let depth = simulation.measure_overlap().unwrap().depth * 0.5;
        let path = simulation.frame().position[0].abs().max_element();
        assert!(depth <= 8.0 * f64::EPSILON * path, "slope {slope}: {depth:e} after {path}");
    }
}

/// One ball above another on a floor, with rest switched off: infinitely many impacts of both and the floor
/// in finite time.
#[test]
fn an_inelastic_collapse_is_reported() {
    let mut scene = bouncing_ball(0.5, 0.5, 1.0, 0.3);
    set_restitution(&mut scene, 0.3);
    add(&mut scene, 0, DVec3::new(0.3, -0.2, 2.5), DVec3::ZERO);
    let mut simulation = start(scene);
    let error = simulation.advance(Until { time: 100.0, ..Until::default() }, &mut Silent).unwrap_err();
    let EngineError::Collapse { time, events, particles, walls, position, .. } = &error else {
        panic!("{error}")
    };
    assert!(*time > 1.0 && *time < 10.0 && *events > 100_000, "{error}");
    assert_eq!((particles.as_slice(), walls.len()), ([0, 1].as_slice(), 1), "{error}");
    // The center of the two balls, one on the other on the floor.
    assert!((DVec3::from_array(*position) - DVec3::new(0.3, -0.2, 1.0)).length() < 1e-6, "{error}");
    let text = error.to_string();
    for part in ["particles 0, 1, wall floor", "contact.tc", "contact.rest_speed"] {
        assert!(text.contains(part), "{text}");
    }
    assert!(simulation.frame().velocity.iter().all(|velocity| velocity.is_finite()));
    assert!(simulation.ledger().residual.abs() < 1e-12);
}

/// A ball between two walls: the run is as exact after 10⁵ periods as at its start.
#[test]
fn clock_errors_do_not_grow_with_time() {
    let mut scene = system(Dimension::Three, DVec3::new(4.0, 4.0, 4.0), [Boundary::Wall; 3]);
    let ball = class(&mut scene, 0.5, 1.0);
    add(&mut scene, ball, DVec3::new(1.0, 2.0, 2.0), DVec3::new(1.0, 0.0, 0.0));
    let mut simulation = start(scene);
    // The free path is 3: after a time of 6k the ball is at its initial position.
    for periods in [1.0, 1e3, 1e5] {
        simulation.advance(Until { time: 6.0 * periods, ..Until::default() }, &mut Silent).unwrap();
        let frame = simulation.frame();
        assert_eq!(frame.position[0].x, 1.0, "after {periods} periods");
        assert_eq!(frame.velocity[0], DVec3::X);
    }
    assert!(simulation.counters().epochs > 1000, "{:?}", simulation.counters());
}

/// A cooling gas slows down by orders of magnitude: the tick is adapted to it, without loss of energy or
/// contacts.
#[test]
fn the_tick_adapts_to_a_gas_that_cools_by_orders_of_magnitude() {
    let mut scene = gas(6, 0.05, 0.9, 3);
    let drift = scene.bodies.iter().map(|body| body.velocity).sum::<DVec3>() / 216.0;
    scene.bodies.iter_mut().for_each(|body| body.velocity -= drift);
    let mut simulation = start(scene);
    let before = simulation.ledger().kinetic;
    let stop = simulation.advance(Until { time: 1e5, collisions: 40_000, ..Until::default() }, &mut Silent);
    assert!(stop.is_ok(), "{stop:?}");
    let ledger = simulation.ledger();
    assert!(ledger.kinetic < 1e-6 * before, "{} → {}", before, ledger.kinetic);
    assert!(ledger.residual.abs() < 1e-13, "{:e}", ledger.residual);
    assert!(simulation.counters().epochs > 2, "{:?}", simulation.counters());
    simulation.validate(1e-12).unwrap();
}
