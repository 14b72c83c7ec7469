//! Runs every `unsafe` block of the engine on systems small enough for Miri, and compares the vector kernels
//! with the portable ones:
//!
//! ```sh
//! MIRIFLAGS="-Zmiri-disable-isolation -Zmiri-tree-borrows" RAYON_NUM_THREADS=1 \
//!     RUSTFLAGS="-C target-feature=+avx2,+fma,+bmi1,+bmi2,+lzcnt,+popcnt" \
//!     cargo +nightly miri test -p haff-engine --test suite unsafe_code
//! ```
//!
//! The thread pool's deque violates stacked borrows, hence tree borrows.

use glam::DVec3;
use haff_engine::{
    Boundary, Dimension, EngineError, NeighborChoice, Options, Silent, SimdChoice, Simulation, System, Until,
};

use crate::common::{self, Random, class, gas, scatter, set_restitution, system};

/// Number of collisions of a run, reduced under Miri, which is a thousand times slower.
const COLLISIONS: u64 = if cfg!(miri) { 30 } else { 3000 };

/// Asserts that cells, lists and windows, with each instruction set, with and without a log, give the state
/// of portable cells without a log.
fn assert_alike(name: &str, system: &System) {
    let end = |neighbors, simd, events: bool| {
        let mut simulation =
            Simulation::new(system.clone(), Options { neighbors, simd, ..Options::default() }).unwrap();
        let until = Until { collisions: COLLISIONS, ..Until::default() };
        let mut log = common::Log::default();
        if events {
            simulation.advance(until, &mut log).unwrap();
        } else {
            simulation.advance(until, &mut Silent).unwrap();
        }
        simulation.validate(1e-12).unwrap();
        simulation.state_hash()
    };
    let expected = end(NeighborChoice::Cells, SimdChoice::Portable, false);
    for neighbors in [NeighborChoice::Cells, NeighborChoice::Lists, NeighborChoice::Windows] {
        let avx2 = Options { neighbors, simd: SimdChoice::Avx2, ..Options::default() };
        let has_avx2 = !matches!(Simulation::new(system.clone(), avx2), Err(EngineError::NoAvx2));
        let narrower = has_avx2.then_some((SimdChoice::Avx2, true));
        let choices = [(SimdChoice::Portable, true), (SimdChoice::Auto, false), (SimdChoice::Auto, true)];
        for (simd, events) in choices.into_iter().chain(narrower) {
            let found = end(neighbors, simd, events);
            assert_eq!(found, expected, "{name}: {neighbors:?}, {simd:?}, with a log: {events}");
        }
    }
}

/// Equal sizes: kernels with vectors of eight and fast paths for this case.
#[test]
fn all_kernels_agree_for_equal_spheres() {
    assert_alike("equal spheres", &gas(4, 0.15, 1.0, 1));
}

/// Dense enough for `ListSearch`, whose lists have kernels of their own.
#[test]
fn all_kernels_agree_for_dense_spheres() {
    let scene = gas(6, 0.45, 0.95, 4);
    let options = Options { neighbors: NeighborChoice::Lists, ..Options::default() };
    let mut lists = Simulation::new(scene.clone(), options).unwrap();
    lists.advance(Until { collisions: 10, ..Until::default() }, &mut Silent).unwrap();
    assert!(lists.counters().candidates > 0, "the lists are not those of `ListSearch`");
    assert_alike("dense spheres", &scene);
}

/// Several sizes, walls and fixed bodies: the general paths of the same kernels, and lists whose length is
/// not a multiple of the vector length.
#[test]
fn all_kernels_agree_for_mixtures_between_walls() {
    let boundary = [Boundary::Periodic, Boundary::Wall, Boundary::Periodic];
    let mut scene = system(Dimension::Three, DVec3::splat(9.5), boundary);
    set_restitution(&mut scene, 0.95);
    let mut random = Random(2);
    for (radius, mass, count) in [(0.5, 1.0, 20), (0.3, 0.2, 20), (0.5, f64::INFINITY, 2)] {
        let kind = class(&mut scene, radius, mass);
        let speed = if mass.is_finite() { 1.0 } else { 0.0 };
        scatter(&mut scene, kind, count, speed, &mut random);
    }
    assert_alike("a mixture between walls", &scene);
}
