//! Grains that slide and roll on curved walls, in hops, against the pendulum of the same motion.

use std::f64::consts::PI;

use glam::DVec3;
use haff_engine::{Boundary, Dimension, Shape, Silent, Simulation, Spin, System, Until, Wall, WallMotion};
use haff_mechanics::{NamedSurface, Roughness};
use haff_surfaces::{Revolution, Side, Sphere};

use crate::common::{add, check_independence, class, features::add_wall, set_restitution, system};

/// Radius of the wall and of the grain.
const WALL: f64 = 2.0;
const GRAIN: f64 = 0.25;
/// Angle of the start from the bottom.
const START: f64 = 0.8;

/// A grain of mass 1 and restitution 0.5 that starts at rest on the inside of a wall under gravity 1.
fn grain_inside(named: &'static NamedSurface) -> System {
    let mut scene = system(Dimension::Three, DVec3::splat(10.0), [Boundary::Open; 3]);
    scene.domain.gravity = -DVec3::Y;
    let grain = class(&mut scene, GRAIN, 1.0);
    add(&mut scene, grain, (WALL - GRAIN) * DVec3::new(START.sin(), -START.cos(), 0.0), DVec3::ZERO);
    set_restitution(&mut scene, 0.5);
    add_wall(
        &mut scene,
        Wall {
            name: "bowl".into(),
            point: DVec3::ZERO,
            normal: DVec3::ZERO,
            motion: WallMotion::Fixed,
            shape: Some(Shape::Named(named)),
        },
    );
    scene
}

fn cylinder() -> &'static NamedSurface {
    let surface = Revolution::cylinder(DVec3::ZERO, DVec3::Z, WALL, Side::Inside);
    NamedSurface::of("bowl", "cylinder", Box::new(surface))
}

fn sphere() -> &'static NamedSurface {
    let surface = Sphere { center: DVec3::ZERO, radius: WALL, side: Side::Inside };
    NamedSurface::of("bowl", "sphere", Box::new(surface))
}

/// A quarter of the period of a pendulum of this length under gravity 1 with this part of its kinetic energy
/// in rotation: K(sin ½θ₀) √(L (1 + κ)), with K by the arithmetic-geometric mean.
fn quarter_period(length: f64, rotation: f64) -> f64 {
    let (mut a, mut b) = (1.0, (0.5 * START).cos());
    while a - b > 1e-15 {
        (a, b) = (0.5 * (a + b), f64::sqrt(a * b));
    }
    PI / (2.0 * a) * f64::sqrt(length * (1.0 + rotation))
}

/// Angle from the bottom, and energy of the center above the bottom, of the grain at a time.
fn state(simulation: &mut Simulation, time: f64) -> (f64, f64) {
    simulation.advance(Until { time, ..Until::default() }, &mut Silent).unwrap();
    let frame = simulation.frame();
    let (r, v) = (frame.position[0], frame.velocity[0]);
    assert_eq!((r.z, v.z), (0.0, 0.0));
    (r.x.atan2(-r.y), 0.5 * v.length_squared() + r.y + WALL - GRAIN)
}

const LENGTH: f64 = WALL - GRAIN;

#[test]
fn a_smooth_grain_slides_in_a_cylinder_and_in_a_sphere_as_a_pendulum() {
    for wall in [cylinder(), sphere()] {
        let scene = grain_inside(wall);
        let quarter = quarter_period(LENGTH, 0.0);
        let mut simulation = check_independence(&scene, &[0.5, 1.0]);
        let start = LENGTH * (1.0 - START.cos());
        for k in 1..=8 {
            let (angle, energy) = state(&mut simulation, f64::from(k) * quarter);
            let expected = [START, 0.0, -START, 0.0][k as usize % 4];
            assert!((angle - expected).abs() < 1e-8, "quarter {k}: angle {angle}, expected {expected}");
            // It touches at the start, and leaves with ½ u² that it has not lost before: u = 10⁻⁴ √(a R).
            let gained = energy - start;
            let hop = 0.5e-8 * START.cos() * GRAIN;
            assert!((gained - hop).abs() < 1e-3 * hop, "quarter {k}: {gained:e}, expected {hop:e}");
        }
    }
}

#[test]
fn a_rough_grain_rolls_in_a_cylinder_as_a_pendulum_with_its_inertia() {
    let mut scene = grain_inside(cylinder());
    let law = Roughness { tangential_restitution: 0.0, friction: 1.0 };
    scene.spin = Some(Spin {
        inertia: vec![0.4],
        angular_velocity: vec![DVec3::ZERO],
        pair: vec![law],
        wall: vec![law],
    });
    let quarter = quarter_period(LENGTH, 0.4);
    let mut simulation = check_independence(&scene, &[0.5, 1.0]);
    for k in 1..=8 {
        let (angle, energy) = state(&mut simulation, f64::from(k) * quarter);
        let frame = simulation.frame();
        let spin = frame.angular_velocity[0].z;
        let rolls = frame.velocity[0].dot(DVec3::new(angle.cos(), angle.sin(), 0.0)) + GRAIN * spin;
        let expected = [START, 0.0, -START, 0.0][k as usize % 4];
        assert!((angle - expected).abs() < 1e-4, "quarter {k}: angle {angle}, expected {expected}");
        // The slip of one hop, τ sin θ, is at most 9·10⁻⁵.
        assert!(rolls.abs() < 1e-4, "quarter {k}: slip {rolls:e}");
        let gained = energy + 0.2 * (GRAIN * spin).powi(2) - LENGTH * (1.0 - START.cos());
        // Each hop of a duration τ loses ½ · 2/7 (τ sin θ)², and τ is at most 2·10⁻⁴ √(R/a).
        let time = f64::from(k) * quarter;
        let bound = time / 7.0 * START.sin().powi(2) * 2e-4 * (GRAIN / START.cos()).sqrt();
        assert!(-bound < gained && gained < -0.2 * bound, "quarter {k}: {gained:e}, bound {bound:e}");
    }
}
