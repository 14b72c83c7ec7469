//! When the states of profiles are taken: at random times, so that no motion with a period that fits the
//! interval is always met at the same phase, and the same ones after every resumption.

use glam::DVec3;
use haff_engine::{
    Boundary, Dimension, Grid, GridAxis, NeighborChoice, Options, Oscillating, ProfileRow, Simulation,
    System, Until, WallMotion,
};
use haff_mechanics::{Oscillation, Waveform};
use std::f64::consts::TAU;

use crate::common::{Log, add, class, gas, set_restitution, system};

fn until(time: f64) -> Until {
    Until { time, ..Until::default() }
}

fn grid(system: &System, bins: usize, interval: f64, samples: u64, spread: bool) -> Grid {
    let axis = GridAxis { axis: 2, low: 0.0, high: system.domain.size.z, bins };
    Grid { axes: vec![axis], interval, samples, spread, species: Vec::new() }
}

fn rows(system: &System, options: Options, end: f64) -> Vec<ProfileRow> {
    let mut log = Log::default();
    let mut simulation = Simulation::new(system.clone(), options).unwrap();
    simulation.advance(until(end), &mut log).unwrap();
    log.1
}

/// A grain that an oscillating floor of this frequency carries, with the velocity A ω cos(ω t).
fn carried(frequency: f64) -> (System, f64) {
    let mut scene =
        system(Dimension::Three, DVec3::splat(10.0), [Boundary::Periodic, Boundary::Wall, Boundary::Wall]);
    scene.domain.gravity = DVec3::new(0.0, 0.0, -10.0);
    let grain = class(&mut scene, 0.5, 1.0);
    let amplitude = 1.0 / (TAU * frequency).powi(2);
    add(&mut scene, grain, DVec3::new(5.0, 5.0, 0.5), DVec3::new(0.0, 0.0, amplitude * TAU * frequency));
    set_restitution(&mut scene, 0.0);
    let floor = scene.walls.iter().position(|wall| wall.name == "z-").unwrap();
    let oscillation = Oscillation { waveform: Waveform::Sine, amplitude, frequency };
    scene.walls[floor].motion = WallMotion::Oscillating(Oscillating { oscillation, cycles: 0.0 });
    (scene, amplitude * TAU * frequency)
}

#[test]
fn a_grain_on_an_oscillating_floor_has_no_mean_velocity() {
    // Cycles of the floor between two states: whole numbers, halves, and others.
    for cycles in [1.0, 2.0, 7.0, 0.5, 1.5, 3.25, 1.618_034, 0.37, 40.0] {
        let frequency = cycles / 0.1;
        let (mut scene, speed) = carried(frequency);
        let mean = |spread: bool, scene: &mut System| {
            scene.measure.profiles = vec![grid(scene, 1, 1.0, 10, spread)];
            let rows = rows(scene, Options::default(), 60.0);
            assert_eq!(rows.len(), 60);
            rows.iter().map(|row| row.velocity[0].z).sum::<f64>() / (60.0 * speed)
        };
        if cycles == f64::round(cycles) {
            let strobed = mean(false, &mut scene);
            assert!((strobed - 1.0).abs() < 1e-6, "{cycles} cycles at equal times: {strobed}");
        }
        // 600 independent times would have a standard error of 1/√(2 · 600) = 0.029.
        let found = mean(true, &mut scene);
        assert!(
            found.abs() < 4.0 * 0.029,
            "{cycles} cycles: {found} of the largest speed, z = {}",
            found / 0.029
        );
    }
}

#[test]
fn rows_of_random_times_end_at_multiples_and_are_the_same_with_every_search_and_resumption() {
    let mut scene = gas(5, 0.2, 0.9, 4);
    for samples in [1, 3, 10] {
        scene.measure.profiles =
            vec![grid(&scene, 4, 0.25, samples, true), grid(&scene, 3, 0.4, samples, true)];
        let whole = rows(&scene, Options::default(), 2.1);
        assert_eq!(whole.len(), 8 + 5);
        for (index, interval) in [(0, 0.25), (1, 0.4)] {
            for (k, row) in whole.iter().filter(|row| row.profile == index).enumerate() {
                assert_eq!(row.time, interval * (k + 1) as f64);
                let cells = row.density.len() as f64;
                let count = row.density.iter().sum::<f64>() * scene.domain.size.element_product() / cells;
                assert!(
                    (count - 125.0).abs() < 1e-11 * 125.0,
                    "{count} particles in a row of {samples} states"
                );
            }
        }
        for neighbors in [NeighborChoice::Cells, NeighborChoice::AllPairs] {
            assert_eq!(
                rows(&scene, Options { neighbors, ..Options::default() }, 2.1),
                whole,
                "{neighbors:?}"
            );
        }
        for stop in [0.0, 0.1, 0.25, 0.7, 0.8, 1.999, 2.0] {
            let mut log = Log::default();
            let mut first = Simulation::new(scene.clone(), Options::default()).unwrap();
            first.advance(until(stop), &mut log).unwrap();
            let mut second =
                Simulation::restore(scene.clone(), Options::default(), &first.checkpoint()).unwrap();
            second.advance(until(2.1), &mut log).unwrap();
            assert_eq!(log.1, whole, "{samples} states, resumed at {stop}");
        }
    }
}
