//! Dense systems in which particles fall, rest, are carried or fixed: lists give the events of all pairs.

use glam::DVec3;
use haff_engine::{
    Boundary, Dimension, NeighborChoice, Options, Oscillating, Silent, Simulation, Spin, System, Until, Wall,
    WallMotion,
};
use haff_mechanics::{Oscillation, Roughness, Waveform};

use crate::common::{Random, class, scatter, set_restitution, system};

const FLOOR: [Boundary; 3] = [Boundary::Periodic, Boundary::Periodic, Boundary::Wall];

const EQUAL: &[(f64, usize)] = &[(0.5, 250)];
const MIXED: &[(f64, usize)] = &[(0.9, 24), (0.4, 350), (0.15, 500)];

/// Spheres of these radii and numbers in a box with this edge, in gravity.
fn spheres(
    edge: f64,
    boundary: [Boundary; 3],
    sizes: &[(f64, usize)],
    (e, gravity): (f64, DVec3),
    seed: u64,
) -> System {
    let mut random = Random(seed);
    let mut scene = system(Dimension::Three, DVec3::new(edge, edge, 9.0), boundary);
    for &(radius, count) in sizes {
        let kind = class(&mut scene, radius, (2.0 * radius).powi(3));
        scatter(&mut scene, kind, count, 1.0, &mut random);
    }
    scene.domain.gravity = gravity;
    set_restitution(&mut scene, e);
    scene
}

/// Spheres between a floor and a ceiling. Lists need an edge of some of the largest particles.
fn bed(sizes: &[(f64, usize)], e: f64, gravity: f64, seed: u64) -> System {
    let edge = if sizes.len() > 1 { 11.0 } else { 8.0 };
    spheres(edge, FLOOR, sizes, (e, DVec3::new(0.0, 0.0, -gravity)), seed)
}

fn moved(waveform: Waveform, mut scene: System) -> System {
    let oscillation = Oscillation { waveform, amplitude: 0.15, frequency: 1.3 };
    scene.walls[0].motion = WallMotion::Oscillating(Oscillating { oscillation, cycles: 0.0 });
    scene
}

/// The same scene with a plane as the floor and an open axis.
fn open(mut scene: System) -> System {
    scene.domain.boundary[2] = Boundary::Open;
    scene.walls = vec![Wall {
        name: "floor".to_owned(),
        point: DVec3::ZERO,
        normal: DVec3::new(0.0, 0.0, 1.0),
        motion: WallMotion::Fixed,
        shape: None,
    }];
    scene.contacts.wall.truncate(1);
    scene
}

fn with(mut scene: System, change: impl FnOnce(&mut System)) -> System {
    change(&mut scene);
    scene
}

/// State and energies at the end, the number of members of lists that a filter has tested, and that of events
/// that blocks have taken.
fn end(scene: &System, neighbors: NeighborChoice, blocks: Option<u16>) -> (String, [u64; 2]) {
    let options = Options { neighbors, blocks, ..Options::default() };
    let until = Until { time: 6.0, collisions: 20 * scene.bodies.len() as u64, ..Until::default() };
    let mut simulation = Simulation::new(scene.clone(), options).unwrap();
    let stop = simulation.advance(until, &mut Silent).map_err(|error| error.to_string());
    simulation.validate(1e-11).unwrap();
    let state = format!("{} {:?} {stop:?}", simulation.state_hash(), simulation.ledger().terms);
    (state, [simulation.counters().candidates, simulation.block_counts().events()])
}

#[test]
#[ignore = "long: scripts/test all"]
fn lists_of_falling_resting_and_carried_grains_have_the_events_of_all_pairs() {
    let rough = Roughness { tangential_restitution: 0.4, friction: 0.3 };
    let down = DVec3::new(0.0, 0.0, -1.0);
    let obstacles = |scene: &mut System| {
        let kind = class(scene, 0.7, f64::INFINITY);
        scatter(scene, kind, 4, 0.0, &mut Random(8));
    };
    let spinning = |scene: &mut System| {
        scene.spin = Some(Spin {
            inertia: vec![0.4],
            angular_velocity: vec![DVec3::Z; scene.bodies.len()],
            pair: vec![rough],
            wall: vec![rough; 2],
        });
    };
    let heap = |scene: &mut System| scene.contacts.rest_speed = 0.05;
    let wide = [(0.5, 300)];
    let scenes = [
        ("elastic", bed(EQUAL, 1.0, 1.0, 1)),
        ("strong gravity", bed(EQUAL, 0.95, 30.0, 2)),
        ("sizes", bed(MIXED, 0.9, 1.0, 3)),
        ("grains that rest on the floor", bed(EQUAL, 0.6, 2.0, 4)),
        ("heap", with(bed(EQUAL, 0.6, 2.0, 5), heap)),
        ("heap of sizes", with(bed(MIXED, 0.6, 2.0, 6), heap)),
        ("vibrated", moved(Waveform::Sine, bed(EQUAL, 0.8, 2.0, 7))),
        ("vibrated by a triangle", moved(Waveform::Triangle, bed(MIXED, 0.8, 2.0, 8))),
        ("vibrated without gravity", moved(Waveform::Sine, bed(EQUAL, 0.8, 0.0, 9))),
        ("open above", open(spheres(12.0, FLOOR, &wide, (0.9, down), 10))),
        ("open above, sizes", open(bed(MIXED, 0.8, 1.0, 11))),
        ("obstacles", with(spheres(12.0, FLOOR, &wide, (0.9, down), 12), obstacles)),
        ("obstacles of sizes", with(bed(MIXED, 0.9, 1.0, 12), obstacles)),
        (
            "oblique gravity",
            spheres(12.0, [Boundary::Wall; 3], &wide, (0.7, DVec3::new(0.7, -0.4, -1.0)), 13),
        ),
        ("rough", with(bed(EQUAL, 0.9, 1.0, 14), spinning)),
    ];
    let mut shared = Vec::new();
    for (name, scene) in scenes {
        let (expected, _) = end(&scene, NeighborChoice::AllPairs, None);
        for blocks in [None, Some(2)] {
            let (found, [candidates, taken]) = end(&scene, NeighborChoice::Lists, blocks);
            assert_eq!(found, expected, "{name}, {blocks:?}");
            assert!(candidates > 0, "{name}: not with lists");
            if taken > 0 {
                shared.push(name);
            }
        }
    }
    assert!(shared.contains(&"elastic") && shared.contains(&"sizes"), "{shared:?}");
}

/// Of the largest contact distance, that of the two largest particles, the radius of a particle that is
/// larger than all others is more than half.
#[test]
#[ignore = "long: scripts/test all"]
fn a_particle_larger_than_all_others_touches_every_wall() {
    for seed in 0..12 {
        let mut scene = spheres(12.0, [Boundary::Wall; 3], &[], (1.0, DVec3::ZERO), seed);
        let kinds = [class(&mut scene, 0.95, 6.0), class(&mut scene, 0.5, 1.0)];
        let mut random = Random(100 + seed);
        scatter(&mut scene, kinds[0], 1, 20.0, &mut random);
        scatter(&mut scene, kinds[1], 450, 1.0, &mut random);
        let end = |neighbors| end(&scene, neighbors, None);
        let (found, [candidates, _]) = end(NeighborChoice::Lists);
        assert!(candidates > 0, "not with lists");
        assert_eq!(found, end(NeighborChoice::AllPairs).0, "{seed}");
    }
}
