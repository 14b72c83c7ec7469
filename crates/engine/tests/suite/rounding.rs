//! Bounds on rounding errors where speeds grow by orders of magnitude, and where coordinates are small.

use glam::DVec3;
use haff_engine::{
    Boundary, Dimension, NeighborChoice, Options, Silent, Simulation, Stop, System, Until, Wall, WallMotion,
};

use crate::common::{Random, add, class, scatter, set_restitution, system};

/// A light ball between a wall and a heavy ball, which comes towards it (G. Galperin, Regul. Chaotic Dyn. 8,
/// 375 (2003)): for a ratio of masses of 100^k there are ⌊π 10^k⌋ impacts.
fn billiard(ratio: f64) -> System {
    let mut scene = system(Dimension::Three, DVec3::splat(10.0), [Boundary::Open; 3]);
    scene.walls.push(Wall {
        name: "left".into(),
        point: DVec3::ZERO,
        normal: DVec3::X,
        motion: WallMotion::Fixed,
        shape: None,
    });
    scene.contacts.wall = vec![haff_mechanics::Restitution::Constant(1.0).into()];
    let (light, heavy) = (class(&mut scene, 0.5, 1.0), class(&mut scene, 0.5, ratio));
    add(&mut scene, light, DVec3::new(2.0, 5.0, 5.0), DVec3::ZERO);
    add(&mut scene, heavy, DVec3::new(4.0, 5.0, 5.0), DVec3::new(-1.0, 0.0, 0.0));
    scene
}

#[test]
fn the_number_of_impacts_of_two_balls_and_a_wall_has_the_digits_of_pi() {
    for (k, digits) in [3, 31, 314, 3141, 31_415, 314_159].into_iter().enumerate() {
        let mut hashes = Vec::new();
        for neighbors in [NeighborChoice::AllPairs, NeighborChoice::Cells, NeighborChoice::Lists] {
            let options = Options { neighbors, ..Options::default() };
            let mut simulation = Simulation::new(billiard(100_f64.powi(k as i32)), options).unwrap();
            let until = Until { time: 100.0, ..Until::default() };
            let stop = simulation.advance(until, &mut Silent).unwrap();
            let counters = simulation.counters();
            assert_eq!(counters.collisions + counters.wall_collisions, digits, "{neighbors:?}: {stop:?}");
            assert!(simulation.ledger().residual.abs() < 1e-12);
            simulation.measure_overlap().unwrap();
            hashes.push(simulation.state_hash());
        }
        assert!(hashes.iter().all(|hash| *hash == hashes[0]), "{hashes:?}");
    }
}

/// A run that is resumed while speeds grow has the same ticks.
#[test]
fn a_shorter_tick_is_the_same_after_a_resumption() {
    let until = |collisions| Until { time: 100.0, collisions, ..Until::default() };
    let whole = || Simulation::new(billiard(1e8), Options::default()).unwrap();
    let mut reference = whole();
    reference.advance(until(u64::MAX), &mut Silent).unwrap();
    for collisions in [1, 100, 1000, 10_000] {
        let mut simulation = whole();
        assert_eq!(simulation.advance(until(collisions), &mut Silent).unwrap(), Stop::Collisions);
        let checkpoint = simulation.checkpoint();
        let mut resumed = Simulation::restore(billiard(1e8), Options::default(), &checkpoint).unwrap();
        assert_eq!(resumed.checkpoint(), checkpoint);
        resumed.advance(until(u64::MAX), &mut Silent).unwrap();
        assert_eq!(resumed.state_hash(), reference.state_hash(), "{collisions}");
    }
}

/// In the corner of a box coordinates are as small as the particles, but times are rounded as anywhere.
#[test]
fn contacts_in_corners_of_a_box_are_as_exact_as_elsewhere() {
    for seed in 1..=4 {
        let mut random = Random(seed);
        let mut scene = system(Dimension::Two, DVec3::new(1.0, 1.0, 1.0), [Boundary::Wall; 3]);
        let grain = class(&mut scene, 1e-9, 1.0);
        scatter(&mut scene, grain, 20, 1.0, &mut random);
        // Paths that end near a corner, after some impacts on walls.
        for body in &mut scene.bodies {
            let direction = DVec3::new(random.uniform(1.0, 2.0), random.uniform(1.0, 2.0), 0.0);
            body.position = 1e-8 * random.uniform(1.0, 2.0) + direction * random.uniform(0.1, 0.4);
            body.position.z = 0.0;
            body.velocity = -direction * random.uniform(1.0, 100.0);
        }
        set_restitution(&mut scene, 1.0);
        let mut simulation = Simulation::new(scene, Options::default()).unwrap();
        for k in 1..=100 {
            let until = Until { time: 0.01 * f64::from(k), ..Until::default() };
            simulation.advance(until, &mut Silent).unwrap();
            simulation.measure_overlap().unwrap();
        }
        assert!(simulation.counters().wall_collisions > 100);
    }
}
