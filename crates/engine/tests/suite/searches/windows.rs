//! Windows of time: the systems that they support, and the choice between them and other searches.

use super::*;

/// Asserts that windows give the events of cells. Returns the counters of windows and the kinetic energies at
/// the start and the end.
fn assert_windows(name: &str, system: &System, collisions: u64) -> (Counters, [f64; 2]) {
    let until = Until { collisions, ..Until::default() };
    let (reference, hash, _) = run(system, options(NeighborChoice::Cells, SimdChoice::Auto), until);
    let mut result = None;
    for simd in [SimdChoice::Portable, SimdChoice::Auto] {
        let windows = options(NeighborChoice::Windows, simd);
        let before = Simulation::new(system.clone(), windows).unwrap().ledger().kinetic;
        let (log, other, mut simulation) = run(system, windows, until);
        for (row, (a, b)) in reference.0.iter().zip(&log.0).enumerate() {
            assert_eq!(a, b, "{name}, {simd:?}, event {row}");
        }
        assert_eq!(reference.0.len(), log.0.len(), "{name}, {simd:?}: number of events");
        assert_eq!(hash, other, "{name}, {simd:?}: state hash");
        simulation.validate(1e-12).unwrap_or_else(|error| panic!("{name}, {simd:?}: {error}"));
        let counters = simulation.counters();
        assert!(counters.collisions >= collisions && counters.windows > 3, "{name}: {counters:?}");
        result = Some((counters, [before, simulation.ledger().kinetic]));
    }
    result.unwrap()
}

/// Windows must get longer as the gas gets slower, here by two orders of magnitude.
#[test]
fn windows_adapt_to_a_cooling_gas() {
    let mut scene = gas(6, 0.05, 0.5, 21);
    // Without this correction the energy at the end would be that of the mean velocity.
    let drift = scene.bodies.iter().map(|body| body.velocity).sum::<DVec3>() / scene.bodies.len() as f64;
    for body in &mut scene.bodies {
        body.velocity -= drift;
    }
    // Clusters must not collapse.
    scene.contacts.tc = 1e-3;
    let (_, [before, after]) = assert_windows("cooling", &scene, 8000);
    assert!(after < 1e-4 * before, "{before} → {after}");
}

/// In windows that are long enough for the other particles it would cross the whole box more than once.
#[test]
fn windows_are_shortened_for_one_very_fast_particle() {
    for (packing, per_edge) in [(0.05, 7), (0.001, 6)] {
        let mut scene = gas(per_edge, packing, 1.0, 22);
        let usual = assert_windows("usual", &scene, 1500).0.windows;
        scene.bodies[100].velocity = DVec3::new(150.0, -200.0, 240.0);
        let fast = assert_windows("fast", &scene, 1500).0.windows;
        // Only at first: after a few hundred collisions its energy is shared by all.
        assert!(4 * fast > 5 * usual, "φ = {packing}: {usual} windows, {fast} with a fast one");
    }
    // A particle that becomes very fast within a window: heavy particles hit light ones.
    let mut scene = gas(6, 0.02, 1.0, 23);
    let feather = class(&mut scene, 0.5, 1e-4);
    for body in scene.bodies.iter_mut().step_by(2) {
        (body.class, body.velocity) = (feather, body.velocity * 1e-3);
    }
    assert_windows("feathers", &scene, 4000);
}

/// In dilute gases particles move by a hundred diameters within a window, at the limits of single precision.
#[test]
fn windows_miss_no_contact_in_very_dilute_gases() {
    let mut scene = disks(24, 0.001, 24);
    assert_windows("disks", &scene, 3000);
    scene.bodies[7].velocity *= 40.0;
    assert_windows("disks, one fast", &scene, 2000);
    assert_windows("spheres", &gas(9, 1e-4, 1.0, 25), 3000);
}

#[test]
fn windows_support_mixtures_disks_and_walls() {
    let mut random = Random(26);
    // Sizes 1 : 10, masses 1 : 1000.
    for boundary in [Boundary::Periodic, Boundary::Wall] {
        let mut scene = system(Dimension::Three, DVec3::splat(20.0), [boundary; 3]);
        set_restitution(&mut scene, 0.95);
        let (large, small) = (class(&mut scene, 1.0, 1000.0), class(&mut scene, 0.1, 1.0));
        scatter(&mut scene, large, 40, 0.03, &mut random);
        scatter(&mut scene, small, 1200, 1.0, &mut random);
        assert_windows(&format!("mixture, {boundary:?}"), &scene, 3000);
    }
    assert_windows("disks", &disks(20, 0.3, 27), 4000);
    assert_windows("dense disks", &disks(14, 0.7, 28), 4000);
    let mut scene = system(Dimension::Two, DVec3::new(30.0, 12.0, 1.0), [Boundary::Wall; 3]);
    let disk = class(&mut scene, 0.5, 1.0);
    scatter(&mut scene, disk, 100, 1.0, &mut random);
    assert_windows("disks and walls", &scene, 3000);
    let walls = [Boundary::Wall, Boundary::Periodic, Boundary::Wall];
    let mut scene = system(Dimension::Three, DVec3::new(30.0, 12.0, 8.0), walls);
    let ball = class(&mut scene, 0.5, 1.0);
    scatter(&mut scene, ball, 150, 1.0, &mut random);
    assert_windows("a channel", &scene, 3000);
}

/// Under gravity the coordinates of windows are relative to a falling frame, in which all paths are straight.
#[test]
fn windows_support_gravity() {
    let mut random = Random(30);
    for (e, g) in [(1.0, 0.3), (0.95, 5.0), (0.9, 0.01)] {
        let boundary = [Boundary::Periodic, Boundary::Wall, Boundary::Wall];
        let mut scene = system(Dimension::Three, DVec3::new(12.0, 9.0, 40.0), boundary);
        scene.domain.gravity = DVec3::new(0.0, 0.1 * g, -g);
        set_restitution(&mut scene, e);
        let ball = class(&mut scene, 0.5, 1.0);
        scatter(&mut scene, ball, 250, 1.0, &mut random);
        assert_windows(&format!("e = {e}, g = {g}"), &scene, 4000);
        // All start at rest at the same time.
        for body in &mut scene.bodies {
            body.velocity = DVec3::ZERO;
        }
        assert_windows(&format!("dropped, e = {e}, g = {g}"), &scene, 2000);
    }
    let mut scene = system(Dimension::Two, DVec3::new(30.0, 60.0, 1.0), [Boundary::Wall; 3]);
    scene.domain.gravity.y = -1.0;
    set_restitution(&mut scene, 0.95);
    let (large, small) = (class(&mut scene, 1.0, 8.0), class(&mut scene, 0.4, 1.0));
    scatter(&mut scene, large, 30, 1.0, &mut random);
    scatter(&mut scene, small, 150, 3.0, &mut random);
    assert_windows("disks of two sizes", &scene, 4000);
}

/// A particle at rest on the floor no longer falls, which windows do not support: cells replace them.
#[test]
fn an_unsupported_engine_is_replaced() {
    let mut scene = system(
        Dimension::Three,
        DVec3::new(20.0, 20.0, 30.0),
        [Boundary::Periodic, Boundary::Periodic, Boundary::Wall],
    );
    scene.domain.gravity.z = -1.0;
    set_restitution(&mut scene, 0.4);
    let ball = class(&mut scene, 0.5, 1.0);
    scatter(&mut scene, ball, 120, 0.3, &mut Random(31));
    let until = Until { time: 12.0, ..Until::default() };
    let (_, hash, settled) = run(&scene, options(NeighborChoice::Auto, SimdChoice::Auto), until);
    assert_eq!(
        Simulation::new(scene.clone(), Options::default()).unwrap().neighbors(),
        NeighborChoice::Windows
    );
    assert_eq!(settled.neighbors(), NeighborChoice::Cells);
    assert!(settled.counters().rests > 0);
    assert_eq!(run(&scene, options(NeighborChoice::Cells, SimdChoice::Auto), until).1, hash);
}

/// A cluster of particles in an otherwise empty box.
fn cluster(per_edge: usize, packing: f64, e: f64, size: DVec3, seed: u64) -> System {
    let mut scene = gas(per_edge, packing, e, seed);
    let shift = 0.5 * (size - scene.domain.size);
    scene.domain.size = size;
    for body in &mut scene.bodies {
        body.position += shift;
    }
    scene
}

/// The cost of a search is independent of the size of the box: grids are folded where most of their cells
/// would be empty.
#[test]
fn clusters_in_large_boxes_cost_no_more_than_gases() {
    for size in [DVec3::splat(200.0), DVec3::splat(1e6), DVec3::new(20.0, 30.0, 1e5)] {
        let scene = cluster(10, 0.1, 0.8, size, 32);
        let name = format!("a cluster in {size}");
        let per_collision = |counters: &Counters| counters.candidates as f64 / counters.collisions as f64;
        // An unfolded grid would give all thousand particles.
        let candidates = per_collision(&assert_windows(&name, &scene, 1000).0);
        assert!(candidates < 300.0, "{name}: {candidates} candidates a collision");
        // The coordinates of lists are too coarse for the largest box.
        if size.max_element() <= 1e5 {
            let candidates = per_collision(&assert_lists(&name, &scene, 1000));
            assert!(candidates < 300.0, "{name}: {candidates} candidates a collision in lists");
        }
    }
}

/// A dense cluster starts with lists; after it has dispersed, windows are faster and replace them.
#[test]
#[ignore = "long: scripts/test all"]
fn an_unprofitable_engine_is_replaced() {
    let scene = cluster(20, 0.52, 1.0, DVec3::splat(60.0), 33);
    let start = Simulation::new(scene.clone(), Options::default()).unwrap();
    assert_eq!(start.neighbors(), NeighborChoice::Lists);
    let until = Until { collisions: 200_000, ..Until::default() };
    let (_, hash, apart) = run(&scene, Options::default(), until);
    assert_eq!(apart.neighbors(), NeighborChoice::Windows);
    assert_eq!(run(&scene, options(NeighborChoice::Lists, SimdChoice::Auto), until).1, hash);
}

#[test]
fn windows_are_refused_for_unsupported_systems() {
    let why = |scene: &System| {
        let windows = options(NeighborChoice::Windows, SimdChoice::Auto);
        let Err(error) = Simulation::new(scene.clone(), windows) else { return String::new() };
        assert!(matches!(error, EngineError::Unsuitable { .. }), "{error:?}");
        // The message recommends `auto`, which must work.
        Simulation::new(scene.clone(), Options::default()).unwrap();
        error.to_string()
    };
    let ball = |size: f64, boundary: [Boundary; 3]| {
        let mut scene = system(Dimension::Three, DVec3::splat(size), boundary);
        let ball = class(&mut scene, 0.5, 1.0);
        scatter(&mut scene, ball, 5, 1.0, &mut Random(29));
        scene
    };
    let closed = ball(5.0, [Boundary::Wall; 3]);
    assert_eq!(why(&closed), "");
    let mut heavy = closed;
    heavy.domain.gravity.z = -1.0;
    assert_eq!(why(&heavy), "");
    let fixed = class(&mut heavy, 0.5, f64::INFINITY);
    scatter(&mut heavy, fixed, 1, 0.0, &mut Random(30));
    let vast = ball(1e9, [Boundary::Periodic; 3]);
    let open = ball(5.0, [Boundary::Periodic, Boundary::Periodic, Boundary::Open]);
    let narrow = ball(2.7, [Boundary::Periodic; 3]);
    assert_eq!(why(&ball(2.8, [Boundary::Periodic; 3])), "");
    for (scene, reason) in [
        (heavy, "there are gravity and bodies of infinite mass, which do not fall"),
        (vast, "an edge of 1000000000 is too long for the least radius, 0.5"),
        (open, "an axis is open"),
        (narrow, "a periodic edge of 2.7 is shorter than 2.8 of the largest contact distance, 1"),
    ] {
        let expected = format!("engine.neighbors = \"windows\" does not work here: {reason}; use \"auto\"");
        assert_eq!(why(&scene), expected);
    }
}

/// One large body among small ones: what counts is its contact distance with them, not twice its radius.
#[test]
fn windows_are_chosen_for_one_large_body_and_have_the_bits_of_all_pairs() {
    for (dimension, edge, radius, count) in
        [(Dimension::Two, 30.0, 9.0, 150), (Dimension::Three, 18.0, 4.8, 600)]
    {
        let mut random = Random(5);
        let mut scene = system(dimension, DVec3::splat(edge), [Boundary::Periodic; 3]);
        let (large, small) = (class(&mut scene, radius, 100.0), class(&mut scene, 0.4, 1.0));
        scatter(&mut scene, large, 1, 0.5, &mut random);
        scatter(&mut scene, small, count, 1.0, &mut random);
        set_restitution(&mut scene, 0.95);
        let simulation = Simulation::new(scene.clone(), Options::default()).unwrap();
        assert_eq!(simulation.neighbors(), NeighborChoice::Windows, "{dimension:?}");
        check_independence(&scene, &[0.2, 1.0, 3.0]);
    }
}
