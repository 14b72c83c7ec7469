//! Blocks give the trajectory of a single queue, also if they must undo their steps.

use std::cell::Cell;

use glam::DVec3;
use haff_testing::Random;

use crate::{
    Simulation, Until,
    model::{
        Body, Boundary, Class, Compression, Contacts, Dimension, Domain, Group, NeighborChoice, Options,
        Restitution, Shear, System, Wall, thermal::ThermalWall, wall_law::WallLaw, wall_motion::WallMotion,
    },
    report::{BlockCounts, EventRecord, Observer},
    search::blocks::{Settings, front::Dilations},
};

thread_local! {
    /// The settings of simulations that are made by this thread.
    pub(super) static SETTINGS: Cell<Option<Settings>> = const { Cell::new(None) };
}

/// Particles on a distorted lattice of spacing 1, with these radii in turn, in a box of these edges.
fn scene(dimension: Dimension, edges: [u32; 3], boundary: [Boundary; 3], radii: &[f64], e: f64) -> System {
    let mut random = Random(7);
    let size = DVec3::from_array(edges.map(f64::from));
    let classes: Vec<Class> =
        radii.iter().map(|&radius| Class { radius, mass: 8.0 * radius.powi(3), group: 0 }).collect();
    let room = 0.5 - radii.iter().copied().fold(0.0, f64::max);
    let mut bodies = Vec::new();
    let axes = dimension.count();
    for z in 0..if axes == 3 { edges[2] } else { 1 } {
        for y in 0..edges[1] {
            for x in 0..edges[0] {
                let mut vector = |range: f64| {
                    let mut v = DVec3::ZERO;
                    for axis in 0..axes {
                        v[axis] = random.uniform(-range, range);
                    }
                    v
                };
                let mut position = DVec3::new(f64::from(x), f64::from(y), f64::from(z)) + 0.5;
                if axes == 2 {
                    position.z = 0.0;
                }
                let (position, velocity) = (position + vector(0.99 * room), vector(1.0));
                let class = bodies.len() as u32 % radii.len() as u32;
                bodies.push(Body { position, velocity, image: [0; 3], class, species: 0 });
            }
        }
    }
    let mut walls = Vec::new();
    for axis in (0..axes).filter(|&axis| boundary[axis] == Boundary::Wall) {
        let normal = DVec3::AXES[axis];
        for (side, point, normal) in [("-", DVec3::ZERO, normal), ("+", normal * size, -normal)] {
            walls.push(Wall {
                name: format!("{}{side}", ["x", "y", "z"][axis]),
                point,
                normal,
                motion: WallMotion::Fixed,
                shape: None,
            });
        }
    }
    let wall = vec![WallLaw::Restitution(Restitution::Constant(e)); walls.len()];
    System {
        dimension,
        domain: Domain { size, boundary, gravity: DVec3::ZERO, shear: None, compression: None },
        bodies,
        classes,
        groups: vec![Group { name: "grains".to_owned() }],
        species: vec!["grains".to_owned()],
        walls,
        contacts: Contacts { pair: vec![Restitution::Constant(e)], wall, tc: 0.0, rest_speed: 0.0 },
        spin: None,
        drag: None,
        drives: Vec::new(),
        measure: crate::Measure { stress: true, ..crate::Measure::default() },
        flow: None,
        seed: 1,
    }
}

/// A gas.
pub(in crate::search) fn gas() -> System {
    scene(Dimension::Three, [9, 9, 24], [Boundary::Periodic; 3], &[0.4], 0.9)
}

/// A gas, a mixture between walls of which one is thermal, disks, falling grains, and boxes that deform.
fn scenes() -> Vec<(&'static str, NeighborChoice, System)> {
    let periodic = [Boundary::Periodic; 3];
    let gas = gas();
    let walls = [Boundary::Wall, Boundary::Periodic, Boundary::Wall];
    let mut mixture = scene(Dimension::Three, [9, 9, 24], walls, &[0.4, 0.25], 0.95);
    mixture.contacts.wall[0] = WallLaw::Thermal(ThermalWall {
        temperature: 2.0,
        accommodation: 1.0,
        restitution: Restitution::Constant(1.0),
    });
    let disks = scene(Dimension::Two, [30, 60, 1], periodic, &[0.4], 1.0);
    let floor = [Boundary::Periodic, Boundary::Periodic, Boundary::Wall];
    let mut falling = scene(Dimension::Three, [9, 9, 24], floor, &[0.4], 1.0);
    falling.domain.gravity = DVec3::new(0.0, 0.0, -0.2);
    let with = |name, system: &System| {
        [NeighborChoice::Windows, NeighborChoice::Lists].map(|neighbors| (name, neighbors, system.clone()))
    };
    let mut all = [with("gas", &gas), with("mixture", &mixture), with("disks", &disks)].concat();
    all.push(("falling", NeighborChoice::Windows, falling));
    let deforming = [
        ("shear", sheared(&gas, 0.3)),
        (
            "sheared mixture",
            sheared(&scene(Dimension::Three, [12, 12, 24], periodic, &[0.4, 0.25], 0.95), -0.5),
        ),
        ("sheared disks", sheared(&disks, 0.4)),
        ("compression", compressed(&gas, DVec3::splat(0.02))),
        ("expansion", compressed(&disks, DVec3::new(-0.1, -0.05, 0.0))),
        ("elongation", compressed(&gas, DVec3::new(0.02, 0.02, -0.1))),
    ];
    all.extend(deforming.iter().flat_map(|&(name, ref system)| with(name, system)));
    all
}

/// A scene that flows along its last axis, at this rate.
fn sheared(system: &System, rate: f64) -> System {
    let mut system = system.clone();
    let (flow, gradient) = if system.dimension == Dimension::Two { (1, 0) } else { (2, 1) };
    system.domain.shear = Some(Shear { flow, gradient, rate, offset: 0.0 });
    system
}

/// A scene whose edges become shorter at these rates.
fn compressed(system: &System, rates: DVec3) -> System {
    let mut system = system.clone();
    system.domain.compression = Some(Compression { rates, inside: 1.0 });
    system
}

/// All events of a run.
#[derive(Default)]
struct Log(Vec<EventRecord>);

impl Observer for Log {
    fn wants_events(&self) -> bool {
        true
    }

    fn event(&mut self, event: &EventRecord) {
        self.0.push(*event);
    }
}

/// The rows, the state, the sums and the samples of a run with these settings.
fn run(
    system: &System,
    neighbors: NeighborChoice,
    settings: Settings,
    threads: usize,
) -> (Vec<EventRecord>, String, String, BlockCounts) {
    SETTINGS.set(Some(settings));
    let options = Options { neighbors, ..Options::default() };
    let mut simulation = Simulation::new(system.clone(), options).unwrap();
    SETTINGS.set(None);
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
    let mut log = Log::default();
    let mut samples = Vec::new();
    pool.install(|| {
        for k in 0..5 {
            // The limits of time cut steps, too.
            simulation.advance(Until { time: 0.7 * f64::from(k), ..Until::default() }, &mut log).unwrap();
            samples.push(simulation.sample());
        }
        let collisions = simulation.counters().collisions + 500;
        simulation.advance(Until { collisions, ..Until::default() }, &mut log).unwrap();
    });
    samples.push(simulation.sample());
    simulation.validate(1e-9).unwrap();
    (log.0, simulation.state_hash(), format!("{samples:?}"), simulation.block_counts())
}

#[test]
fn blocks_give_the_trajectory_the_sums_and_the_rows_of_one_queue() {
    for (name, neighbors, system) in scenes() {
        let expected = run(&system, neighbors, Settings::new(Some(1)), 1);
        assert!(expected.0.len() > 1000, "{name}: {} events", expected.0.len());
        let narrow = Dilations { face: 1.0, source: 0.6, inner: 0.5 };
        for (blocks, threads, dilations) in [
            (2, 1, None),
            (2, 2, None),
            (3, 2, None),
            (4, 3, None),
            (8, 4, None),
            (2, 8, None),
            (2, 2, Some(narrow)),
            (4, 2, Some(narrow)),
        ] {
            let dilations = dilations.unwrap_or(Settings::MEASURED.dilations);
            let settings = Settings { dilations, ..Settings::new(Some(blocks)) };
            let found = run(&system, neighbors, settings, threads);
            let counts = found.3;
            let text = format!(
                "{name}, {neighbors:?}: {blocks} blocks, {threads} threads, {dilations:?}, {counts:?}"
            );
            assert!(counts.events() > 100 || dilations.face == 1.0, "{text}: few events of blocks");
            assert!(counts.undone > 0 || dilations.face > 1.0, "{text}: nothing undone");
            assert_eq!(found.0.len(), expected.0.len(), "{text}");
            for (row, (a, b)) in found.0.iter().zip(&expected.0).enumerate() {
                assert_eq!(a, b, "{text}: row {row}");
            }
            assert_eq!(found.1, expected.1, "{text}: state");
            assert_eq!(found.2, expected.2, "{text}: samples");
        }
    }
}
