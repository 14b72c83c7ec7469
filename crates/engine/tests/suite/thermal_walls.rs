//! Thermal walls: equilibrium, heat flux, independence of the trajectory of the search, and the balance of
//! energies.

use std::f64::consts::PI;

use glam::DVec3;
use haff_engine::{
    Boundary, Dimension, EventKind, EventRecord, Options, Silent, Simulation, System, Term, ThermalWall,
    Until, WallLaw,
};
use haff_mechanics::Restitution;

use crate::common::{Log, Random, check_independence, class, scatter, set_restitution, system};

/// Mass of the particles.
const MASS: f64 = 2.0;

fn until(time: f64) -> Until {
    Until { time, ..Until::default() }
}

fn thermal(temperature: f64, accommodation: f64) -> WallLaw {
    WallLaw::Thermal(ThermalWall { temperature, accommodation, restitution: Restitution::Constant(1.0) })
}

/// A gas in a box with the given boundaries.
fn gas(dimension: Dimension, count: usize, edge: f64, radius: f64, walls: [Boundary; 3]) -> System {
    let mut scene = system(dimension, DVec3::splat(edge), walls);
    let kind = class(&mut scene, radius, MASS);
    scatter(&mut scene, kind, count, 1.0, &mut Random(5));
    scene.seed = 23;
    scene
}

#[test]
fn trajectory_with_thermal_walls_is_independent_of_search_slices_and_resumption() {
    let boundary = [Boundary::Wall, Boundary::Periodic, Boundary::Wall];
    for (dimension, gravity) in [(Dimension::Three, -0.5), (Dimension::Two, 0.0), (Dimension::Three, 0.0)] {
        let mut scene =
            gas(dimension, 300, if dimension == Dimension::Two { 40.0 } else { 12.0 }, 0.5, boundary);
        set_restitution(&mut scene, 0.9);
        scene.domain.gravity.x = gravity;
        scene.contacts.wall[0] = thermal(1.5, 1.0);
        scene.contacts.wall[1] = thermal(0.5, 0.6);
        let reference = check_independence(&scene, &[0.5, 2.0, 6.0]);
        assert!(reference.ledger().term(Term::WallHeat) != 0.0);
    }
}

/// All walls at T and elastic particles give the canonical ensemble: the energy has the mean d N T/2 and the
/// variance d N T²/2. The motion of the center of mass is part of it: relative to it the temperature is
/// T (N − 1)/N.
fn check_canonical(dimension: Dimension, edge: f64) {
    let (count, temperature, d) = (8, 1.7, dimension.count() as f64);
    let mut scene = gas(dimension, count, edge, 0.3, [Boundary::Wall; 3]);
    scene.contacts.wall.fill(thermal(temperature, 1.0));
    let mut simulation = Simulation::new(scene, Options::default()).unwrap();
    let (mut energy, mut squares, mut inner) = (Vec::new(), 0.0, Vec::new());
    let n = count as f64;
    let mean = 0.5 * d * n * temperature;
    for k in 1..=3000 {
        simulation.advance(until(15.0 * f64::from(k)), &mut Silent).unwrap();
        let sample = simulation.sample();
        energy.push(sample.ledger.kinetic);
        let of_energy = 2.0 * sample.ledger.kinetic / (d * n);
        assert!((sample.temperature / of_energy - 1.0).abs() < 1e-13, "{} {of_energy}", sample.temperature);
        let velocity = simulation.frame().velocity;
        let common = velocity.iter().sum::<DVec3>() / n;
        let relative: f64 = velocity.iter().map(|v| (*v - common).length_squared()).sum();
        inner.push(MASS * relative / (d * n));
        squares += (sample.ledger.kinetic - mean).powi(2);
    }
    let states = energy.len() as f64;
    // Between two states each particle hits walls about ten times, so the states are independent.
    let variance = 0.5 * d * n * temperature * temperature;
    let z = (energy.iter().sum::<f64>() / states - mean) / (variance / states).sqrt();
    assert!(z.abs() < 4.0, "d = {d}: mean energy, z = {z}");
    // The fourth central moment of a gamma distribution of shape k is 3k(k + 2).
    let shape = 0.5 * d * n;
    let fourth = 3.0 * shape * (shape + 2.0) * temperature.powi(4);
    let z = (squares / states - variance) / ((fourth - variance * variance) / states).sqrt();
    assert!(z.abs() < 4.0, "d = {d}: variance of the energy, z = {z}");
    let expected = temperature * (n - 1.0) / n;
    let error = expected * (2.0 / (d * (n - 1.0) * states)).sqrt();
    let z = (inner.iter().sum::<f64>() / states - expected) / error;
    assert!(z.abs() < 4.0, "d = {d}: temperature, z = {z}");
    assert!(simulation.ledger().residual.abs() < 1e-12, "{:?}", simulation.ledger());
}

#[test]
fn a_gas_between_walls_of_one_temperature_is_canonical() {
    check_canonical(Dimension::Three, 3.0);
}

#[test]
fn a_gas_of_disks_between_walls_of_one_temperature_is_canonical() {
    check_canonical(Dimension::Two, 4.0);
}

/// A gas of particles that rarely collide, between plates at T₁ and T₂: T = √(T₁T₂), heat flux
/// 2n√(2T₁T₂/(πm))(√T₁ − √T₂).
#[test]
#[ignore = "long: scripts/test all"]
fn a_nearly_collisionless_gas_between_plates_has_the_free_molecular_heat_flux() {
    let [hot, cold] = [3.0, 1.0];
    let (count, edge, radius, mass) = (200, 10.0, 1e-4, 2.0);
    let boundary = [Boundary::Wall, Boundary::Periodic, Boundary::Periodic];
    let mut scene = gas(Dimension::Three, count, edge, radius, boundary);
    scene.contacts.wall[0] = thermal(hot, 1.0);
    scene.contacts.wall[1] = thermal(cold, 1.0);
    // The slowest particles need long to cross the box, so the gas starts at the expected temperature.
    let start = (hot * cold).sqrt();
    scene.bodies.iter_mut().for_each(|body| body.velocity *= (start / mass).sqrt());
    let mut simulation = Simulation::new(scene, Options::default()).unwrap();
    simulation.advance(until(300.0), &mut Silent).unwrap();
    let density = count as f64 / edge.powi(3);
    let speed = (2.0 * hot * cold / (PI * mass)).sqrt();
    let flux = 2.0 * density * speed * (hot.sqrt() - cold.sqrt());
    let (mut temperatures, mut heats, intervals, span) = (Vec::new(), Vec::new(), 40, 250.0);
    for k in 1..=intervals {
        let end = 300.0 + span * f64::from(k);
        // Means over intervals so long that all but the slowest particles hit a wall in each.
        let mut mean = 0.0;
        let mut log = Log::default();
        for part in (0..50).rev() {
            simulation.advance(until(end - f64::from(part) * span / 50.0), &mut log).unwrap();
            mean += 2.0 * simulation.ledger().kinetic / (3.0 * count as f64) / 50.0;
        }
        temperatures.push(mean);
        // Heat from the hot wall. Rows have only the normal component of the velocity, which carries half of
        // the energy: T of the 2T per particle in a flux at T.
        let normal = |row: &EventRecord| {
            let after = row.impulse / mass - row.approach_speed;
            0.5 * mass * (after * after - row.approach_speed * row.approach_speed)
        };
        let hot = log.0.iter().filter(|row| row.kind == EventKind::Wall && row.j == 0);
        heats.push(2.0 * hot.map(normal).sum::<f64>() / (span * edge * edge));
    }
    let z = |values: &[f64], expected: f64| {
        let n = values.len() as f64;
        let mean = values.iter().sum::<f64>() / n;
        let variance = values.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / (n - 1.0);
        (mean - expected) / (variance / n).sqrt()
    };
    let of_temperature = z(&temperatures, (hot * cold).sqrt());
    assert!(of_temperature.abs() < 4.0, "T: z = {of_temperature}");
    let of_flux = z(&heats, flux);
    assert!(of_flux.abs() < 4.0, "heat flux: z = {of_flux}");
}
