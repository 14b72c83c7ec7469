//! Scenes of random bodies whose series of impacts have to come to an end.

use glam::DVec3;
use haff_engine::{EventRecord, Observer, Stop, Until};
use haff_linkage::{SpringEnd, Tether};
use haff_testing::Random;

use crate::common::Scene;

const G: f64 = 9.81;

/// Balls that fall one after the other between two walls onto a floor that they stick to.
fn sticking_floor(seed: u64, n: usize, width: f64, e: f64) -> Scene {
    let mut random = Random(seed);
    let mut scene = Scene::new(e);
    scene.gravity = -DVec3::Y * G;
    scene.wall([0.0; 3], [1.0, 0.0, 0.0]);
    scene.wall([width, 0.0, 0.0], [-1.0, 0.0, 0.0]);
    let floor = scene.wall([0.0; 3], [0.0, 1.0, 0.0]);
    for k in 0..n {
        let x = random.uniform(0.25, width - 0.25);
        let ball = scene.particle([x, 1.0 + 0.6 * k as f64, 0.0], [0.0; 3], 1.0, 0.2);
        scene.joints.sticking_to_walls.push([ball as u32, floor as u32]);
    }
    scene
}

/// Balls and dumbbells of random sizes in a box, of which some stick to the floor.
fn dumbbells(seed: u64, n: usize, e: f64) -> Scene {
    let mut random = Random(seed);
    let mut scene = Scene::new(e);
    scene.gravity = -DVec3::Y * G;
    scene.wall([0.0; 3], [1.0, 0.0, 0.0]);
    scene.wall([4.0, 0.0, 0.0], [-1.0, 0.0, 0.0]);
    let floor = scene.wall([0.0; 3], [0.0, 1.0, 0.0]);
    for k in 0..n {
        let y = 1.0 + 0.6 * k as f64;
        let x = random.uniform(0.3, 3.0);
        let r = random.uniform(0.1, 0.25);
        let a = scene.particle([x, y, 0.0], [random.normal(), 0.0, 0.0], random.uniform(0.5, 2.0), r);
        if k % 2 == 0 {
            let b =
                scene.particle([x + 0.6, y, 0.0], [scene.particles[a].1.x, random.normal(), 0.0], 1.0, 0.15);
            scene.rod(a, b, 0.6);
        } else if k % 3 == 0 {
            scene.joints.sticking_to_walls.push([a as u32, floor as u32]);
        }
    }
    if scene.joints.sticking_to_walls.is_empty() && scene.joints.rods.is_empty() {
        scene.joints.sticking_to_walls.push([0, floor as u32]);
    }
    scene
}

/// Bobs side by side, some of them released, beside a wall.
fn bobs(seed: u64, n: usize, e: f64, tether: Tether) -> Scene {
    let mut random = Random(seed);
    let mut scene = Scene::new(e);
    scene.gravity = -DVec3::Y * G;
    scene.wall([-0.2, 0.0, 0.0], [1.0, 0.0, 0.0]);
    let length = 1.0;
    let mut x = 0.0;
    for k in 0..n {
        let r = random.uniform(0.05, 0.1);
        x += r;
        let angle = if k + 1 == n { random.uniform(0.2, 1.2) } else { 0.0 };
        let pivot = DVec3::new(x, 1.0, 0.0);
        let at = pivot + DVec3::new(f64::sin(angle), -f64::cos(angle), 0.0) * length;
        let bob = scene.particle(at.to_array(), [0.0; 3], random.uniform(0.5, 2.0), r);
        scene.pendulum(pivot, length, bob, tether);
        x += r + if random.index(2) == 0 { 0.0 } else { 0.01 };
    }
    scene
}

/// Bodies on springs above a floor (which may move), hit by falling balls.
fn springs(seed: u64, n: usize, e: f64, lift: f64, gravity: f64) -> Scene {
    let mut random = Random(seed);
    let mut scene = Scene::new(e);
    scene.gravity = -DVec3::Y * gravity;
    let floor = scene.wall([0.0; 3], [0.0, 1.0, 0.0]);
    scene.walls[floor].motion = (DVec3::Y * lift).into();
    for k in 0..n {
        let x = k as f64;
        let m = random.uniform(0.5, 2.0);
        let held = scene.particle([x, 0.5, 0.0], [0.0, -random.uniform(0.5, 2.0), 0.0], m, 0.2);
        // It presses the body on the floor.
        scene.spring(
            SpringEnd::Point(DVec3::new(x, 3.0, 0.0)),
            SpringEnd::Particle(held),
            random.uniform(20.0, 200.0),
            3.5,
        );
        scene.particle([x + random.uniform(-0.05, 0.05), 1.5, 0.0], [0.0, -1.0, 0.0], 1.0, 0.15);
    }
    scene
}

/// Balls between two plates of infinite mass that approach each other, one ball on a spring.
fn row(seed: u64, n: usize, e: f64) -> Scene {
    let mut random = Random(seed);
    let mut scene = Scene::new(e);
    scene.wall([0.0; 3], [1.0, 0.0, 0.0]);
    let mut x = 0.3;
    for _ in 0..n {
        x += random.uniform(0.4, 0.8);
        scene.particle([x, 0.0, 0.0], [-random.uniform(0.2, 2.0), 0.0, 0.0], random.uniform(0.5, 2.0), 0.2);
    }
    let last = n - 1;
    scene.spring(SpringEnd::Particle(last), SpringEnd::Point(DVec3::new(x + 2.0, 0.0, 0.0)), 50.0, 3.0);
    scene
}

/// Number of rows, sum of their losses, and the least of these.
struct Losses(u64, f64, f64);

impl Observer for Losses {
    fn wants_events(&self) -> bool {
        true
    }

    fn event(&mut self, event: &EventRecord) {
        self.0 += 1;
        self.1 += event.energy_loss;
        self.2 = self.2.min(event.energy_loss);
    }
}

/// Runs a scene for 20 units of time: with at most this number of rows, a balance that closes, no impact
/// that adds energy, and no overlap.
fn check(name: &str, scene: &Scene, most: u64) {
    let mut simulation = scene.start();
    let mut losses = Losses(0, 0.0, 0.0);
    for k in 1..=50 {
        let until = Until { time: 0.4 * f64::from(k), entries: most, ..Until::default() };
        let stop = simulation.advance(until, &mut losses).unwrap_or_else(|error| panic!("{name}: {error}"));
        let has_ended = matches!(stop, Stop::Time | Stop::Rest);
        assert!(has_ended, "{name}: {stop:?} after {} events at t = {}", losses.0, simulation.time());
        let residual = simulation.ledger().residual;
        assert!(residual.abs() < 1e-12, "{name}: residual {residual:e} at t = {}", simulation.time());
        simulation.measure_overlap().unwrap_or_else(|error| panic!("{name}: {error}"));
    }
    assert!(losses.0 <= most, "{name}: {} events", losses.0);
    assert!(losses.2 >= 0.0, "{name}: an impact adds the energy {:e}", -losses.2);
    // Each of the rows rounds the sum of their losses.
    let dissipated = simulation.ledger().dissipated;
    let off = (losses.1 - dissipated).abs();
    let allowed = f64::EPSILON * (4 + losses.0) as f64 * dissipated;
    assert!(off <= allowed, "{name}: rows and balance differ by {off:e} of {dissipated}");
}

#[test]
#[ignore = "long: scripts/test all"]
fn series_of_impacts_end_wherever_bodies_bounce_on_each_other() {
    for (k, e) in [0.0, 0.2, 0.4, 0.6, 0.8, 0.9].into_iter().enumerate() {
        for n in 0..3 {
            let seed = n + 10 * k as u64;
            let count = n as usize;
            let name = |scene: &str| format!("{scene}, e = {e}, seed {seed}");
            check(&name("floor"), &sticking_floor(seed, 6 + 2 * count, 4.0, e), 5000);
            check(&name("strings"), &bobs(seed, 3 + count, e, Tether::String), 5000);
            check(&name("rods"), &bobs(seed, 3 + count, e, Tether::Rod), 5000);
            check(&name("springs"), &springs(seed, 1 + count, e, 0.0, G), 5000);
            check(&name("springs without gravity"), &springs(seed, 1 + count, e, 0.05, 0.0), 5000);
            check(&name("row"), &row(seed, 3 + count, e), 20_000);
            if e < 0.8 {
                check(&name("dumbbells"), &dumbbells(seed, 4 + count, e), 50_000);
            }
        }
    }
}

/// Five bobs, the first of which is released: impacts of all of them at once.
#[test]
fn the_balance_of_a_cradle_closes_as_long_as_it_swings() {
    for e in [0.5, 0.9, 1.0] {
        let mut scene = Scene::new(e);
        scene.gravity = -DVec3::Z * G;
        for k in 0..5 {
            let pivot = DVec3::new(0.1 * f64::from(k), 0.0, 1.0);
            let angle: f64 = if k == 0 { -0.6 } else { 0.0 };
            let at = pivot + DVec3::new(angle.sin(), 0.0, -angle.cos());
            let bob = scene.particle(at.to_array(), [0.0; 3], 1.0, 0.05);
            scene.pendulum(pivot, 1.0, bob, Tether::String);
        }
        let mut simulation = scene.start();
        for k in 1..=100 {
            let until = Until { time: f64::from(k), entries: 100_000, ..Until::default() };
            assert_eq!(simulation.advance(until, &mut haff_engine::Silent).unwrap(), Stop::Time);
            let residual = simulation.ledger().residual;
            assert!(residual.abs() < 1e-12, "e = {e}: {residual:e} at t = {k}");
        }
    }
}
