//! Surfaces, drives and probes that another crate adds.

use std::sync::Arc;

use glam::DVec3;
use haff_engine::{
    Action, Boundary, Column, Dimension, Drive, DriveKind, DrivenParticles, EngineError, Exchange,
    NamedProbe, Options, Particles, Partner, Probe, Shape, Simulation, System, Term, Until, Wall, WallMotion,
    conserved_momentum, named_action,
};
use haff_mechanics::{NamedSurface, Restitution, Surface};

use crate::common::{Log, Random, check_independence, class, scatter, set_restitution, system};

/// At the squares of whole numbers, times 0.1, the grains of one sign of x get random changes of velocity.
#[derive(Debug)]
struct Squares {
    last: u64,
    keeps: bool,
}

impl Action for Squares {
    fn time(&self, number: u64) -> f64 {
        if number <= self.last { 0.1 * (number * number) as f64 } else { f64::INFINITY }
    }

    fn act(&self, number: u64, particles: &mut dyn DrivenParticles) {
        for i in particles.driven().to_vec() {
            if (particles.position(i).x < 3.0) == number.is_multiple_of(2) {
                particles.set_velocity(i, DVec3::splat(f64::NAN));
                particles.set_velocity(i, particles.velocity(i) + 0.5 * particles.normals(i));
            }
        }
        // It does not act on these.
        for i in 0..particles.count() {
            if !particles.driven().contains(&i) {
                particles.set_velocity(i, DVec3::splat(f64::NAN));
            }
        }
    }

    fn keeps_momentum(&self) -> bool {
        self.keeps
    }
}

fn drive(action: impl Action + 'static) -> DriveKind {
    let parameters = format!("{action:?}");
    DriveKind::Named(named_action("squares", &parameters, Box::new(action)))
}

/// Sums over the changes of velocity since the last sample, and since the start of the run.
#[derive(Default)]
struct Changes {
    impacts: f64,
    kicks: f64,
    so_far: f64,
}

impl Probe for Changes {
    fn columns(&self) -> Vec<Column> {
        let changes = Column::vector("changes", "mass length/time", 2);
        vec![changes, Column::number("so_far", "mass length/time"), Column::number("mass", "mass")]
    }

    fn exchange(&mut self, exchange: &Exchange) {
        let sum: f64 = exchange.changes.iter().map(|c| c.mass * (c.after - c.before).length()).sum();
        match exchange.partner {
            Partner::Drive => self.kicks += sum,
            _ => self.impacts += sum,
        }
        self.so_far += sum;
    }

    fn sample(&mut self, particles: &dyn Particles) -> Vec<f64> {
        let mass = (0..particles.count()).map(|i| particles.mass(i)).sum();
        let (impacts, kicks) = (std::mem::take(&mut self.impacts), std::mem::take(&mut self.kicks));
        vec![impacts, kicks, self.so_far, mass]
    }

    fn save(&self) -> Vec<f64> {
        vec![self.impacts, self.kicks, self.so_far]
    }

    fn load(&mut self, numbers: &[f64]) -> bool {
        let &[impacts, kicks, so_far] = numbers else { return false };
        *self = Self { impacts, kicks, so_far };
        true
    }
}

fn gas(dimension: Dimension, kind: DriveKind) -> System {
    let mut random = Random(3);
    let edge = 1500_f64.powf(1.0 / dimension.count() as f64);
    let mut scene = system(dimension, DVec3::splat(edge), [Boundary::Periodic; 3]);
    let (light, heavy) = (class(&mut scene, 0.5, 1.0), class(&mut scene, 0.4, 3.0));
    scatter(&mut scene, light, 120, 1.0, &mut random);
    scatter(&mut scene, heavy, 120, 1.0, &mut random);
    for body in &mut scene.bodies {
        body.species = body.class;
    }
    scene.species = vec!["light".into(), "heavy".into()];
    set_restitution(&mut scene, 0.9);
    scene.drives = vec![Drive { kind, species: vec![1], rotational: false }];
    let start = || Box::new(Changes::default()) as Box<dyn Probe>;
    scene.measure.probes = vec![Arc::new(NamedProbe::new("changes", String::new(), Box::new(start)))];
    scene
}

#[test]
fn a_run_is_independent_of_search_threads_slices_and_resumption() {
    for dimension in [Dimension::Three, Dimension::Two] {
        let scene = gas(dimension, drive(Squares { last: 6, keeps: false }));
        let reference = check_independence(&scene, &[0.1, 1.0, 1.3, 2.5, 4.0]);
        assert!(reference.ledger().term(Term::DriveWork) > 1.0);
        assert!(reference.ledger().residual.abs() < 1e-13);
    }
}

/// The columns of the probe against the log of events and the changes of momentum by the drive, and in a
/// resumed run against those of a whole one.
#[test]
fn a_probe_receives_all_changes_of_velocity_also_in_a_resumed_run() {
    let scene = gas(Dimension::Three, drive(Squares { last: 6, keeps: false }));
    let mut whole = Simulation::new(scene.clone(), Options::default()).unwrap();
    let (mut log, mut rows) = (Log::default(), Vec::new());
    let until = |time: f64| Until { time, ..Until::default() };
    for time in [0.5, 1.2, 3.0] {
        whole.advance(until(time), &mut log).unwrap();
        rows.push(whole.sample().probes);
    }
    let exchanged: f64 = log.0.iter().map(|event| 2.0 * event.impulse).sum();
    let impacts: f64 = rows.iter().map(|row| row[0]).sum();
    assert!(
        (exchanged - impacts).abs() < 1e-12 * exchanged && exchanged > 100.0,
        "{exchanged} and {impacts}"
    );
    let kicks: f64 = rows.iter().map(|row| row[1]).sum();
    assert!(kicks > 10.0 && (kicks + impacts - rows[2][2]).abs() < 1e-12 * impacts, "{kicks} {rows:?}");
    assert!(rows.iter().all(|row| row[3] == 480.0));

    let mut first = Simulation::new(scene.clone(), Options::default()).unwrap();
    for time in [0.5, 0.8] {
        first.advance(until(time), &mut Log::default()).unwrap();
        if time == 0.5 {
            first.sample();
        }
    }
    let checkpoint = first.checkpoint();
    let mut resumed = Simulation::restore(scene.clone(), Options::default(), &checkpoint).unwrap();
    for (time, row) in [(1.2, &rows[1]), (3.0, &rows[2])] {
        resumed.advance(until(time), &mut Log::default()).unwrap();
        assert_eq!(&resumed.sample().probes, row);
    }
    assert_eq!(resumed.state_hash(), whole.state_hash());

    // A drive whose actions are at other times.
    let other = System {
        drives: vec![Drive {
            kind: drive(Squares { last: 1, keeps: false }),
            species: vec![1],
            rotational: false,
        }],
        ..scene
    };
    let error = Simulation::restore(other, Options::default(), &whole.checkpoint()).err().unwrap();
    assert!(error.to_string().contains("drive.0.done = 5 does not fit to the time 3"), "{error}");
}

#[test]
fn an_action_says_whether_it_keeps_the_momentum() {
    for keeps in [false, true] {
        let scene = gas(Dimension::Three, drive(Squares { last: 6, keeps }));
        assert_eq!(conserved_momentum(&scene), [keeps; 3]);
    }
}

#[test]
fn times_that_do_not_rise_end_the_run_with_an_error() {
    #[derive(Debug)]
    struct Stands;
    impl Action for Stands {
        fn time(&self, number: u64) -> f64 {
            (number as f64).min(2.0)
        }
        fn act(&self, _: u64, _: &mut dyn DrivenParticles) {}
    }
    let mut simulation = Simulation::new(gas(Dimension::Three, drive(Stands)), Options::default()).unwrap();
    let error = simulation.advance(Until { time: 9.0, ..Until::default() }, &mut Log::default()).unwrap_err();
    assert!(matches!(&error, EngineError::Plugin { name, .. } if name == "squares"), "{error}");
    assert!(
        error.to_string().contains("action 2 is at 2, and the next one at 2: times must rise"),
        "{error}"
    );
    assert_eq!(simulation.time(), 2.0);
}

/// A sphere with the grains outside (`side` 1) or inside (−1).
#[derive(Debug)]
struct Ball {
    center: DVec3,
    radius: f64,
    side: f64,
}

impl Surface for Ball {
    fn distance(&self, position: DVec3) -> f64 {
        self.side * ((position - self.center).length() - self.radius)
    }

    fn normal(&self, position: DVec3) -> DVec3 {
        self.side * (position - self.center).normalize_or(DVec3::X)
    }

    fn curvature(&self, low: f64, high: f64) -> f64 {
        let least = self.radius + if self.side > 0.0 { low } else { -high };
        if least > 0.0 { 1.0 / least } else { f64::INFINITY }
    }

    fn bounds(&self) -> (DVec3, f64) {
        (self.center, self.radius)
    }
}

/// Grains in a box, inside or outside of a sphere in it.
fn beside_a_sphere(
    dimension: Dimension,
    (radius, side): (f64, f64),
    count: u32,
    e: f64,
    gravity: DVec3,
) -> System {
    let mut random = Random(17);
    let axes = dimension.count();
    let across = if axes == 3 { Boundary::Wall } else { Boundary::Periodic };
    let mut scene = system(dimension, DVec3::splat(12.0), [Boundary::Wall, Boundary::Wall, across]);
    let center = if axes == 3 { DVec3::splat(6.0) } else { DVec3::new(6.0, 6.0, 0.0) };
    let ball = Ball { center, radius, side };
    let surface = NamedSurface::of("ball", &format!("{ball:?}"), Box::new(ball));
    let shape = Some(Shape::Named(surface));
    let wall = Wall {
        name: "ball".into(),
        point: DVec3::ZERO,
        normal: DVec3::ZERO,
        motion: WallMotion::Fixed,
        shape,
    };
    let law = scene.contacts.wall.first().copied();
    scene.walls.push(wall);
    let grain = class(&mut scene, 0.3, 1.0);
    scene.contacts.wall = vec![law.unwrap_or(Restitution::Constant(1.0).into()); scene.walls.len()];
    scatter(&mut scene, grain, count as usize, 1.0, &mut random);
    set_restitution(&mut scene, e);
    scene.contacts.wall.fill(Restitution::Constant(e).into());
    scene.domain.gravity = gravity;
    scene
}

#[test]
#[ignore = "long: scripts/test all"]
fn a_gas_beside_a_sphere_is_independent_of_search_threads_slices_and_resumption() {
    for dimension in [Dimension::Three, Dimension::Two] {
        let count = if dimension == Dimension::Three { 300 } else { 100 };
        let cases = [(1.0, DVec3::ZERO), (0.9, DVec3::ZERO), (0.9, DVec3::NEG_Y)];
        let balls = [(6.0, -1.0), (2.0, 1.0), (0.4, 1.0)];
        for ((e, gravity), ball) in cases.into_iter().flat_map(|case| balls.map(|ball| (case, ball))) {
            let scene = beside_a_sphere(dimension, ball, count, e, gravity);
            let mut reference = check_independence(&scene, &[0.1, 1.0, 1.3, 3.0]);
            assert!(reference.counters().wall_collisions > 20, "{:?}", reference.counters());
            assert!(reference.ledger().residual.abs() < 1e-13);
            reference.measure_overlap().unwrap();
        }
    }
}

/// One grain, 100,000 bounces: the energy, and the angular momentum about the center, stay to rounding. The
/// chords are all of one length, and so are the times between contacts.
#[test]
fn a_grain_in_a_sphere_keeps_its_angular_momentum() {
    let scene = beside_a_sphere(Dimension::Three, (6.0, -1.0), 1, 1.0, DVec3::ZERO);
    let body = scene.bodies[0];
    let center = DVec3::splat(6.0);
    let momentum = |r: DVec3, v: DVec3| (r - center).cross(v);
    let before = momentum(body.position, body.velocity);
    let mut simulation = Simulation::new(scene, Options::default()).unwrap();
    let mut log = Log::default();
    let until = Until { time: f64::INFINITY, collisions: u64::MAX, entries: 200_000 };
    while log.0.len() < 100_000 {
        simulation.advance(until, &mut log).unwrap();
    }
    let frame = simulation.frame();
    let off = (momentum(frame.position[0], frame.velocity[0]) - before).length();
    let bounces = log.0.len() as f64;
    // Each bounce rounds position, normal and velocity: a walk at random.
    assert!(off <= 4.0 * bounces.sqrt() * f64::EPSILON * 12.0 * body.velocity.length(), "{off:e}");
    let residual = simulation.ledger().residual;
    assert!(residual.abs() <= 4.0 * bounces.sqrt() * f64::EPSILON, "{residual:e}");
    let [first, last] = [&log.0[1], log.0.last().unwrap()];
    let period = (last.time - first.time) / (bounces - 2.0);
    let distance = (before.length() / body.velocity.length()).powi(2);
    let chord = 2.0 * (5.7_f64.powi(2) - distance).sqrt() / body.velocity.length();
    assert!((period / chord - 1.0).abs() < 1e-12, "{period} {chord}");
    assert!(log.0.iter().all(|row| (row.position - center).length() > 6.0 - 1e-12));
}
