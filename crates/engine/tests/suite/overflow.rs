//! Cells, lists and buckets with far more entries than they are designed for: no abort, and no missed
//! contact. Crystals near close packing, many sizes in one cell, thousands of particles in a corner of a huge
//! box.

use glam::DVec3;
use haff_engine::{
    Boundary, Dimension, NeighborChoice, Options, Silent, SimdChoice, Simulation, Stop, System, Until,
};

use crate::common::{self, Random, class, gas, system};

/// Runs `collisions` collisions, checks all pairs for overlaps and the energy, and returns the hash of the
/// state.
fn end(name: &str, system: &System, neighbors: NeighborChoice, simd: SimdChoice, collisions: u64) -> String {
    let what = format!("{name}, {neighbors:?}, {simd:?}");
    let mut simulation = Simulation::new(system.clone(), Options { neighbors, simd, ..Options::default() })
        .unwrap_or_else(|error| panic!("{what}: {error}"));
    let stop = simulation
        .advance(Until { collisions, ..Until::default() }, &mut Silent)
        .unwrap_or_else(|error| panic!("{what}: {error}"));
    assert_eq!(stop, Stop::Collisions, "{what}");
    // Positions are rounded to an ulp of the largest coordinate; overlaps are in contact distances.
    let farthest =
        system.bodies.iter().fold(0.0, |far, body| f64::max(far, body.position.abs().max_element()));
    let smallest = system.classes.iter().map(|class| class.radius).fold(f64::INFINITY, f64::min);
    simulation
        .validate(8.0 * f64::EPSILON * (1.0 + farthest / smallest))
        .unwrap_or_else(|error| panic!("{what}: {error}"));
    simulation.state_hash()
}

/// Asserts that all `choices` with vector kernels agree with the first one with portable kernels.
fn assert_same(name: &str, system: &System, choices: &[NeighborChoice], collisions: u64) {
    let expected = end(name, system, choices[0], SimdChoice::Portable, collisions);
    for &choice in choices {
        let found = end(name, system, choice, SimdChoice::Auto, collisions);
        assert_eq!(found, expected, "{name}, {choice:?} against {:?}", choices[0]);
    }
}

const SEARCHES: [NeighborChoice; 3] = [NeighborChoice::Cells, NeighborChoice::Windows, NeighborChoice::Lists];

/// A face-centered cubic crystal of 4·k³ spheres of unit diameter.
fn crystal(per_edge: usize, packing_fraction: f64, seed: u64) -> System {
    let count = 4 * per_edge.pow(3);
    let edge = (count as f64 * std::f64::consts::PI / 6.0 / packing_fraction).cbrt();
    let mut scene = system(Dimension::Three, DVec3::splat(edge), [Boundary::Periodic; 3]);
    let sphere = class(&mut scene, 0.5, 1.0);
    let mut random = Random(seed);
    let step = edge / per_edge as f64;
    for cell in 0..per_edge.pow(3) {
        let corner = [cell % per_edge, cell / per_edge % per_edge, cell / per_edge.pow(2)];
        for offset in [[0.25, 0.25, 0.25], [0.75, 0.75, 0.25], [0.75, 0.25, 0.75], [0.25, 0.75, 0.75]] {
            let site = DVec3::from_array([0, 1, 2].map(|axis| corner[axis] as f64 + offset[axis]));
            let velocity = DVec3::new(random.normal(), random.normal(), random.normal());
            common::add(&mut scene, sphere, site * step, velocity);
        }
    }
    scene
}

/// Each sphere has twelve neighbors with gaps below 2 % of the diameter; close packing is at φ = 0.7405.
#[test]
fn trajectory_of_crystals_near_close_packing_is_independent_of_search() {
    for (packing_fraction, seed) in [(0.70, 1), (0.735, 2)] {
        let scene = crystal(7, packing_fraction, seed);
        assert_same(&format!("φ = {packing_fraction}"), &scene, &SEARCHES, 20_000);
    }
    // A smaller crystal, for all pairs.
    let choices = [NeighborChoice::AllPairs, SEARCHES[0], SEARCHES[1], SEARCHES[2]];
    assert_same("φ = 0.70, all pairs", &crystal(4, 0.70, 3), &choices, 2000);
}

/// Radii from 0.5 to 0.5 · `ratio`, three of them the largest and most near the smallest: a cell as wide as a
/// large particle has hundreds of small ones.
fn sizes(ratio: f64, count: usize, seed: u64) -> System {
    let mut random = Random(seed);
    let radii: Vec<f64> = (0..count)
        .map(|k| if k < 3 { 0.5 * ratio } else { 0.5 * ratio.powf(random.uniform(0.0, 1.0).powi(4)) })
        .collect();
    let volume: f64 = radii.iter().map(|radius| 4.0 / 3.0 * std::f64::consts::PI * radius.powi(3)).sum();
    let edge = (volume / 0.25).cbrt().max(9.1 * radii[0]);
    let mut scene = system(Dimension::Three, DVec3::splat(edge), [Boundary::Periodic; 3]);
    let mut sorted = radii;
    sorted.sort_by(|a, b| b.total_cmp(a));
    for radius in sorted {
        let kind = class(&mut scene, radius, (2.0 * radius).powi(3));
        // Equal temperatures.
        common::scatter(&mut scene, kind, 1, (2.0 * radius).powf(-1.5), &mut random);
    }
    scene
}

#[test]
#[ignore = "long: scripts/test all"]
fn trajectory_of_a_wide_range_of_sizes_is_independent_of_search() {
    for (ratio, count) in [(3.0, 700), (10.0, 1500), (30.0, 1500)] {
        let scene = sizes(ratio, count, ratio as u64);
        assert_same(&format!("s = {ratio}"), &scene, &SEARCHES, 4000);
        if count < 1000 {
            assert_same(
                &format!("s = {ratio}"),
                &scene,
                &[NeighborChoice::AllPairs, NeighborChoice::Cells],
                1000,
            );
        }
    }
}

/// 22³ spheres at a packing fraction of 0.4, in a box of which they fill 10⁻⁹.
fn crowd(boundary: [Boundary; 3], corner: DVec3) -> System {
    let dense = gas(22, 0.4, 0.9, 5);
    let mut scene = system(Dimension::Three, DVec3::splat(2e4), boundary);
    common::set_restitution(&mut scene, 0.9);
    (scene.classes, scene.bodies) = (dense.classes, dense.bodies);
    for body in &mut scene.bodies {
        body.position += corner;
    }
    scene
}

/// With cells and windows all particles are in one cell or a few, so that the first search tests 10⁸ pairs;
/// each choice therefore runs only once.
#[test]
fn trajectory_of_ten_thousand_particles_in_one_cell_is_independent_of_search() {
    let walls = DVec3::splat(1.0);
    for (name, boundary, corner, choice) in [
        ("in a periodic box", Boundary::Periodic, DVec3::splat(7e3), NeighborChoice::Windows),
        ("in a corner of walls", Boundary::Wall, walls, NeighborChoice::Windows),
        ("along open axes", Boundary::Open, DVec3::splat(-3e5), NeighborChoice::Cells),
    ] {
        let scene = crowd([boundary; 3], corner);
        assert_eq!(scene.bodies.len(), 10_648);
        let [found, expected] =
            [choice, NeighborChoice::Lists].map(|choice| end(name, &scene, choice, SimdChoice::Auto, 500));
        assert_eq!(found, expected, "{name}, {choice:?} against lists");
    }
}
