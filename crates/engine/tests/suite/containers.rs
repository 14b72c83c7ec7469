//! Containers that shrink with a box that is compressed, or grow with one that expands.

use std::f64::consts::FRAC_PI_4;

use glam::DVec3;
use haff_engine::{
    Boundary, Compression, ConstantVelocity, Dimension, Instant, Options, Shape, Shrinking, Silent,
    Simulation, System, Until, Wall, WallMotion,
};
use haff_mechanics::{NamedSurface, Restitution, Surface};
use haff_surfaces::{Revolution, Side, Sphere};
use haff_testing::Random;

use crate::common::{Log, add, check_independence, class, scatter, set_restitution, system};

const EDGE: f64 = 12.0;
const CENTER: DVec3 = DVec3::splat(6.0);

/// A box that is compressed at a rate, between walls or periodic along z, with a container in it.
fn compressed(surface: impl Surface + 'static, rate: f64, along_z: Boundary) -> System {
    let boundary = [Boundary::Wall, Boundary::Wall, along_z];
    let mut scene = system(Dimension::Three, DVec3::splat(EDGE), boundary);
    let inside = surface.volume(3, DVec3::splat(EDGE)).expect("it is closed") / EDGE.powi(3);
    scene.domain.compression = Some(Compression { rates: DVec3::splat(rate), inside });
    for wall in scene.walls.iter_mut().filter(|wall| wall.normal.element_sum() < 0.0) {
        let velocity = wall.normal * (rate * EDGE);
        wall.motion = WallMotion::Constant(ConstantVelocity { velocity, reference_time: 0.0 });
    }
    let numbers = format!("{surface:?}");
    scene.walls.push(Wall {
        name: "container".into(),
        point: DVec3::ZERO,
        normal: DVec3::ZERO,
        motion: WallMotion::Shrinking(Shrinking { rate, speed: 2.0 * EDGE * rate.abs() }),
        shape: Some(Shape::Named(NamedSurface::of("container", &numbers, Box::new(surface)))),
    });
    scene.contacts.wall = vec![Restitution::Constant(1.0).into(); scene.walls.len()];
    scene
}

/// The first τ > 0 with |x + v τ| = R − r − g τ, from inside, in closed form.
fn closed_form(x: DVec3, v: DVec3, room: f64, shrinking: f64) -> f64 {
    let (a, b) = (v.length_squared() - shrinking * shrinking, x.dot(v) + room * shrinking);
    let c = x.length_squared() - room * room;
    let root = (b * b - a * c).sqrt();
    if b > 0.0 { -c / (b + root) } else { (root - b) / a }
}

#[test]
fn contacts_with_spheres_and_cylinders_that_shrink_have_the_times_of_the_closed_form() {
    let mut random = Random(3);
    for k in 0..2000 {
        let round = k % 2 == 0;
        let rate = [0.02, 0.1, -0.05, 1e-6][k / 2 % 4];
        let mut scene = if round {
            compressed(Sphere { center: CENTER, radius: 5.0, side: Side::Inside }, rate, Boundary::Wall)
        } else {
            compressed(Revolution::cylinder(CENTER, DVec3::Z, 5.0, Side::Inside), rate, Boundary::Periodic)
        };
        let radius = random.uniform(0.1, 2.0);
        let grain = class(&mut scene, radius, 1.0);
        let across = |r: DVec3| if round { r } else { DVec3::new(r.x, r.y, 0.0) };
        let mut vector = |size: f64| DVec3::from_array([0; 3].map(|_| random.uniform(-size, size)));
        let (x, v) = (vector(4.0), vector(1.0));
        // Relative to the center, which moves to the corner of the box. The container must not be far slower.
        let flow = CENTER * -rate;
        if across(x).length() > 4.9 - radius || across(v - flow).length() < 5.0 * rate.abs() {
            continue;
        }
        add(&mut scene, grain, CENTER + x, v);
        let expected = closed_form(across(x), across(v - flow), 5.0 - radius, 5.0 * rate);
        let mut log = Log::default();
        let mut simulation = Simulation::new(scene, Options::default()).unwrap();
        let until = Until { time: expected + 1e-9, ..Until::default() };
        simulation.advance(until, &mut log).unwrap();
        let row = &log.0[0];
        // The rounding of the distance by the speed at which it falls.
        let tolerance = 4e-15 * (expected + (EDGE + v.length() * expected) / row.approach_speed);
        assert!((row.time - expected).abs() < tolerance, "case {k}: {} {expected}", row.time);
        // The surface comes at its own speed: the reflection is that in its frame.
        let at = across(x + (v - flow) * expected);
        let n = at / at.length();
        let speed = across(v - flow).dot(n) + 5.0 * rate;
        assert!((row.approach_speed - speed).abs() < 1e-12 && (row.impulse - 2.0 * speed).abs() < 2e-12);
        assert!(simulation.ledger().residual.abs() < 1e-13);
    }
}

#[test]
fn a_gas_in_a_container_that_shrinks_is_independent_of_search_slices_and_resumption() {
    let can = Revolution::finite_cylinder(CENTER - DVec3::Z * 5.0, DVec3::Z, 5.0, 10.0, Side::Inside);
    let tube = Revolution::cylinder(CENTER, DVec3::Z, 5.0, Side::Inside);
    let cone =
        Revolution::cone(CENTER - DVec3::Z * 5.0, DVec3::Z, 0.5 * FRAC_PI_4, [1.0, 10.0], Side::Inside);
    let ball = Sphere { center: CENTER, radius: 5.5, side: Side::Inside };
    for (rate, e) in [(0.1, 1.0), (0.05, 0.9), (-0.2, 1.0)] {
        let scenes = [
            ("can", compressed(can.clone(), rate, Boundary::Wall)),
            ("tube", compressed(tube.clone(), rate, Boundary::Periodic)),
            ("cone", compressed(cone.clone(), rate, Boundary::Wall)),
            ("ball", compressed(ball, rate, Boundary::Wall)),
        ];
        for (name, mut scene) in scenes {
            for radius in [0.3, 0.2] {
                let grain = class(&mut scene, radius, radius.powi(3));
                scatter(&mut scene, grain, 60, 1.0, &mut Random(17));
            }
            set_restitution(&mut scene, e);
            let mut end = check_independence(&scene, &[0.4, 1.0, 3.0]);
            assert!(end.counters().wall_collisions > 20, "{name}: {:?}", end.counters());
            end.measure_overlap().unwrap();
            let residual = end.ledger().residual;
            assert!(residual.abs() < 1e-12, "{name}: {residual:e}");
            let wall = scene.walls.last().unwrap();
            for (position, body) in end.frame().position.iter().zip(&scene.bodies) {
                let distance = wall.distance(*position, Instant::at(3.0));
                let radius = scene.classes[body.class as usize].radius;
                assert!(distance > radius - 1e-12, "{name}: {position} is at {distance}");
            }
        }
    }
}

#[test]
fn a_container_is_the_volume_of_packing_fraction_and_pressure() {
    // Many points in a large ball: their pressure is N T/V of the ball, not of the box.
    let ball = Sphere { center: CENTER, radius: 5.5, side: Side::Inside };
    let mut scene = compressed(ball, 1e-9, Boundary::Wall);
    let grain = class(&mut scene, 1e-3, 1.0);
    scatter(&mut scene, grain, 400, 1.0, &mut Random(17));
    let mut simulation = Simulation::new(scene, Options::default()).unwrap();
    simulation.sample();
    simulation.advance(Until { time: 5.0, ..Until::default() }, &mut Silent).unwrap();
    let sample = simulation.sample();
    let volume = 4.0 / 3.0 * std::f64::consts::PI * 5.5_f64.powi(3);
    assert!((sample.box_volume / volume - 1.0).abs() < 1e-7);
    let filled = 400.0 * 4.0 / 3.0 * std::f64::consts::PI * 1e-9;
    assert!((sample.packing_fraction * volume / filled - 1.0).abs() < 1e-7);
    // Collisions hardly count; of the kinetic energy that of the common motion does not, about a part 1/N.
    let pressure = sample.pressure.unwrap();
    assert!((pressure * volume / (400.0 * sample.temperature) - 1.0).abs() < 0.01, "{pressure}");
}
