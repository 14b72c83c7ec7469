//! The mean free time of systems with bodies of infinite mass.

use glam::DVec3;
use haff_engine::{Options, Simulation, Until};

use crate::common::{Log, class, gas};

fn until(time: f64) -> Until {
    Until { time, ..Until::default() }
}

#[test]
fn the_mean_free_time_counts_flights_of_bodies_of_finite_mass() {
    // A gas among fixed spheres: in each collision with one of them one flight ends.
    let mut scene = gas(5, 0.15, 1.0, 8);
    let fixed = class(&mut scene, 0.5, f64::INFINITY);
    for k in 0..40 {
        scene.bodies[3 * k].class = fixed;
        scene.bodies[3 * k].velocity = DVec3::ZERO;
    }
    let mut log = Log::default();
    let mut simulation = Simulation::new(scene.clone(), Options::default()).unwrap();
    simulation.sample();
    for step in 1..=3 {
        log.0.clear();
        simulation.advance(until(f64::from(step)), &mut log).unwrap();
        let movable = |i: u32| u64::from(scene.bodies[i as usize].class != fixed);
        let flights: u64 = log.0.iter().map(|row| movable(row.i) + movable(row.j)).sum();
        let found = simulation.sample().mean_free_time;
        let expected = 85.0 / flights as f64;
        assert!((found / expected - 1.0).abs() < 1e-12, "{found}, by the log {expected}");
        assert!(flights < 2 * log.0.len() as u64, "no collision with a fixed sphere");
    }
    // Resumed, the counts go on.
    let mut resumed =
        Simulation::restore(scene.clone(), Options::default(), &simulation.checkpoint()).unwrap();
    for simulation in [&mut simulation, &mut resumed] {
        simulation.advance(until(4.0), &mut Log::default()).unwrap();
    }
    assert_eq!(simulation.sample().mean_free_time, resumed.sample().mean_free_time);
    assert_eq!(simulation.counters().fixed_collisions, resumed.counters().fixed_collisions);
}
