//! Systems for tests.
#![allow(dead_code, reason = "unit tests and examples use a part of it")]

pub mod features;
pub mod mixture;

use glam::DVec3;
use haff_engine::{
    Body, Boundary, Class, Contacts, Dimension, Domain, EngineError, EventRecord, Group, Instant,
    NeighborChoice, Observer, Options, ProfileRow, Silent, SimdChoice, Simulation, Stop, System, Until, Wall,
};
use haff_mechanics::Restitution;
pub use haff_testing::Random;

/// Time this thread has been on a processor [s], where the system tells: unlike the clock's, it does not
/// count the time that other work takes.
pub fn processor_time() -> Option<f64> {
    let text = std::fs::read_to_string("/proc/thread-self/schedstat").ok()?;
    text.split(' ').next()?.parse::<f64>().ok().map(|nanoseconds| nanoseconds * 1e-9)
}

/// An empty system in a box.
pub fn system(dimension: Dimension, size: DVec3, boundary: [Boundary; 3]) -> System {
    let mut boundary = boundary;
    if dimension == Dimension::Two {
        boundary[2] = Boundary::Open;
    }
    let mut walls = Vec::new();
    for (axis, name) in ["x", "y", "z"].into_iter().enumerate() {
        if boundary[axis] == Boundary::Wall {
            let unit = DVec3::AXES[axis];
            let wall = |name: String, point, normal| Wall {
                name,
                point,
                normal,
                motion: haff_engine::WallMotion::Fixed,
                shape: None,
            };
            walls.push(wall(format!("{name}-"), DVec3::ZERO, unit));
            walls.push(wall(format!("{name}+"), unit * size, -unit));
        }
    }
    let wall_rules = vec![Restitution::Constant(1.0); walls.len()];
    System {
        spin: None,
        drag: None,
        drives: Vec::new(),
        measure: haff_engine::Measure::default(),
        flow: None,
        seed: 0,
        dimension,
        domain: Domain { size, boundary, gravity: DVec3::ZERO, shear: None, compression: None },
        bodies: Vec::new(),
        classes: Vec::new(),
        groups: vec![Group { name: "grain".into() }],
        species: vec!["grain".into()],
        walls,
        contacts: Contacts {
            pair: vec![Restitution::Constant(1.0)],
            wall: wall_rules.into_iter().map(haff_engine::WallLaw::from).collect(),
            tc: 0.0,
            rest_speed: 0.0,
        },
    }
}

/// Sets one constant restitution for everything.
pub fn set_restitution(system: &mut System, e: f64) {
    system.contacts.pair.fill(Restitution::Constant(e));
    system.contacts.wall.fill((Restitution::Constant(e)).into());
}

/// Adds a class and returns its index.
pub fn class(system: &mut System, radius: f64, mass: f64) -> u32 {
    system.classes.push(Class { radius, mass, group: 0 });
    system.classes.len() as u32 - 1
}

/// Adds a particle.
pub fn add(system: &mut System, class: u32, position: DVec3, velocity: DVec3) {
    system.bodies.push(Body { position, velocity, image: [0; 3], class, species: 0 });
}

/// Adds `count` particles at random positions without contacts, with normal velocities.
pub fn scatter(system: &mut System, class: u32, count: usize, speed: f64, random: &mut Random) {
    assert!(scatter_within_room(system, class, count, speed, random), "no room");
}

/// As [`scatter`], but if there is not enough room adds fewer particles and returns `false`.
pub fn scatter_within_room(
    system: &mut System,
    class: u32,
    count: usize,
    speed: f64,
    random: &mut Random,
) -> bool {
    let radius = system.classes[class as usize].radius;
    let flat = system.dimension == Dimension::Two;
    let mut tries = 0;
    let mut placed = 0;
    while placed < count {
        tries += 1;
        if tries >= 2_000_000 {
            return false;
        }
        let mut position = DVec3::from_array([0, 1, 2].map(|axis| {
            let (low, high) = match system.domain.boundary[axis] {
                Boundary::Periodic => (0.0, system.domain.size[axis]),
                Boundary::Wall | Boundary::Open => (radius, system.domain.size[axis] - radius),
            };
            random.uniform(low, high)
        }));
        let mut velocity = DVec3::new(random.normal(), random.normal(), random.normal()) * speed;
        if flat {
            position.z = 0.0;
            velocity.z = 0.0;
        }
        let clear = system.bodies.iter().all(|body| {
            let mut r = position - body.position;
            for axis in 0..3 {
                if system.domain.boundary[axis] == Boundary::Periodic {
                    r[axis] -= (r[axis] / system.domain.size[axis]).round() * system.domain.size[axis];
                }
            }
            r.length() > radius + system.classes[body.class as usize].radius
        }) && system.walls.iter().all(|wall| {
            // Surfaces that swing come nearer.
            let swing = if wall.shape.is_some() { wall.motion.sweep(wall.normal).min(1.0) } else { 0.0 };
            wall.distance(position, Instant::ZERO) > radius + swing
        });
        if clear {
            add(system, class, position, velocity);
            placed += 1;
        }
    }
    true
}

/// A periodic gas of equal spheres, which start on a simple cubic lattice with random velocities.
pub fn gas(per_edge: usize, packing_fraction: f64, e: f64, seed: u64) -> System {
    let count = per_edge.pow(3);
    let edge = (count as f64 * std::f64::consts::PI / 6.0 / packing_fraction).cbrt();
    let mut system = system(Dimension::Three, DVec3::splat(edge), [Boundary::Periodic; 3]);
    set_restitution(&mut system, e);
    let grain = class(&mut system, 0.5, 1.0);
    let mut random = Random(seed);
    let step = edge / per_edge as f64;
    for i in 0..count {
        let site = DVec3::new(
            (i % per_edge) as f64,
            (i / per_edge % per_edge) as f64,
            (i / per_edge / per_edge) as f64,
        );
        let velocity = DVec3::new(random.normal(), random.normal(), random.normal());
        add(&mut system, grain, (site + 0.5) * step, velocity);
    }
    system
}

/// Stores every event row, and every row of a profile.
#[derive(Default)]
pub struct Log(pub Vec<EventRecord>, pub Vec<ProfileRow>);

impl Observer for Log {
    fn wants_events(&self) -> bool {
        true
    }
    fn event(&mut self, event: &EventRecord) {
        self.0.push(*event);
    }
    fn profile(&mut self, row: ProfileRow) {
        self.1.push(row);
    }
}

/// Disks in a periodic square, from a square lattice; `area_fraction` at most 0.78.
pub fn disks(per_edge: usize, area_fraction: f64, seed: u64) -> System {
    let count = per_edge.pow(2);
    let edge = (count as f64 * std::f64::consts::PI / 4.0 / area_fraction).sqrt();
    let mut system = system(Dimension::Two, DVec3::new(edge, edge, 1.0), [Boundary::Periodic; 3]);
    let grain = class(&mut system, 0.5, 1.0);
    let mut random = Random(seed);
    let step = edge / per_edge as f64;
    for i in 0..count {
        let site = DVec3::new((i % per_edge) as f64 + 0.5, (i / per_edge) as f64 + 0.5, 0.0);
        add(&mut system, grain, site * step, DVec3::new(random.normal(), random.normal(), 0.0));
    }
    system
}

/// As [`gas`], with 16 equally probable radii from a quarter of the largest up to it.
pub fn polydisperse(per_edge: usize, packing_fraction: f64, seed: u64) -> System {
    let radii: Vec<f64> = (0..16).map(|k| 0.125 + 0.375 * f64::from(k) / 15.0).collect();
    let volume = radii.iter().map(|radius| radius.powi(3)).sum::<f64>() / 16.0 / 0.125;
    let mut system = gas(per_edge, packing_fraction / volume, 1.0, seed);
    let mut random = Random(seed + 1);
    let first = system.classes.len() as u32;
    for radius in radii {
        class(&mut system, radius, (2.0 * radius).powi(3));
    }
    for body in &mut system.bodies {
        body.class = first + random.index(16) as u32;
    }
    system
}

/// Runs a scene with all pairs to each of these times, and with the other searches to the same states: in
/// slices, and restored from a checkpoint after each. Returns the first simulation.
pub fn check_independence(scene: &System, times: &[f64]) -> Simulation {
    let until = |time: f64| Until { time, ..Until::default() };
    let plain =
        Options { neighbors: NeighborChoice::AllPairs, simd: SimdChoice::Portable, ..Options::default() };
    let mut reference = Simulation::new(scene.clone(), plain).unwrap();
    let state = |simulation: &Simulation| {
        (simulation.state_hash(), simulation.ledger().terms, simulation.counters().simultaneous)
    };
    let expected: Vec<_> = times
        .iter()
        .map(|&time| {
            reference.advance(until(time), &mut Silent).unwrap();
            state(&reference)
        })
        .collect();
    for (neighbors, blocks) in [
        (NeighborChoice::Cells, None),
        (NeighborChoice::Lists, None),
        (NeighborChoice::Windows, None),
        (NeighborChoice::Windows, Some(2)),
        (NeighborChoice::Windows, Some(3)),
        (NeighborChoice::Lists, Some(2)),
    ] {
        let options = Options { neighbors, blocks, ..Options::default() };
        let mut simulation = match Simulation::new(scene.clone(), options) {
            Err(EngineError::Unsuitable { .. }) => continue,
            result => result.unwrap(),
        };
        for (&time, expected) in times.iter().zip(&expected) {
            let slice = Until { entries: 333, ..until(time) };
            while simulation.advance(slice, &mut Silent).unwrap() == Stop::Slice {}
            assert_eq!(&state(&simulation), expected, "{neighbors:?}, t = {time}");
            let checkpoint = simulation.checkpoint();
            simulation = Simulation::restore(scene.clone(), options, &checkpoint).unwrap();
            assert_eq!(simulation.checkpoint(), checkpoint, "{neighbors:?}, t = {time}");
        }
        let residual = simulation.ledger().residual;
        assert!(residual.abs() < 1e-13, "{neighbors:?}: ledger {residual:e}");
    }
    reference
}

/// Checks that `term` of the balance is the integral of the `power`, which is that of a mean pressure
/// tensor over an interval, in intervals of very different lengths up to the `longest`; and pressure and
/// momentum with it. Returns the work.
pub fn check_stress_power(
    scene: System,
    term: haff_engine::Term,
    longest: f64,
    power: impl Fn(&[f64; 9]) -> f64,
) -> f64 {
    let mut simulation = Simulation::new(scene, Options::default()).unwrap();
    let mut before = simulation.sample();
    let mut spans = [0.01, 0.5, 2e-4, 3.0, 0.1, longest].into_iter().cycle();
    for _ in 0..12 {
        let time = before.time + spans.next().unwrap();
        simulation.advance(Until { time, ..Until::default() }, &mut Silent).unwrap();
        let sample = simulation.sample();
        let span = sample.time - before.time;
        let stress = sample.stress.unwrap().total();
        let work = sample.ledger.term(term) - before.ledger.term(term);
        let expected = power(&stress) * span;
        let scale = sample.ledger.term(term).abs();
        assert!((work - expected).abs() < 1e-12 * scale + 1e-10 * work.abs(), "{work} {expected}");
        let trace = (stress[0] + stress[4] + stress[8]) / 3.0;
        let pressure = sample.pressure.unwrap();
        assert!((pressure / trace - 1.0).abs() < 1e-9, "{pressure} {trace} {span}");
        assert!(sample.ledger.residual.abs() < 1e-13, "{:e}", sample.ledger.residual);
        // Rounding of velocities of the size of the flow.
        assert!(sample.momentum.length() < 1e-11, "{}", sample.momentum);
        before = sample;
    }
    before.ledger.term(term)
}
