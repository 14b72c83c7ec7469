//! The trajectory is independent of the search (cells, lists, windows, all pairs), of the kernel, of the
//! number of threads and of resumptions: all give the same events, bit by bit.

mod dense;
mod matrix;
mod mixtures;
mod windows;

use glam::DVec3;
use haff_engine::{
    Boundary, Counters, Dimension, EngineError, NeighborChoice, Options, SimdChoice, Simulation, Stop,
    System, Until, Wall,
};

use crate::common::{
    Log, Random, add, check_independence, class, disks, gas, scatter, set_restitution, system,
};

/// Runs to `until` and returns the log, the hash of the final state and the simulation.
fn run(system: &System, options: Options, until: Until) -> (Log, String, Simulation) {
    let mut log = Log::default();
    let mut simulation = Simulation::new(system.clone(), options).unwrap();
    match simulation.advance(until, &mut log) {
        Ok(Stop::Slice) => panic!(
            "no end at t = {}: {:?}, last {:?}",
            simulation.time(),
            simulation.counters(),
            log.0.last()
        ),
        Ok(_) | Err(EngineError::Collapse { .. }) => {}
        Err(error) => panic!("{error}"),
    }
    let hash = simulation.state_hash();
    (log, hash, simulation)
}

fn options(neighbors: NeighborChoice, simd: SimdChoice) -> Options {
    Options { neighbors, simd, ..Options::default() }
}

/// Whether windows of time support a system.
fn has_windows(system: &System) -> bool {
    let windows = options(NeighborChoice::Windows, SimdChoice::Auto);
    !matches!(Simulation::new(system.clone(), windows), Err(EngineError::Unsuitable { .. }))
}

/// Asserts that every search and kernel gives the events of all pairs, and returns their number.
fn assert_same_trajectory(name: &str, system: &System, until: Until) -> usize {
    let (reference, hash, mut plain) =
        run(system, options(NeighborChoice::AllPairs, SimdChoice::Portable), until);
    let sample = format!("{:?}", plain.sample());
    let mut choices = vec![
        options(NeighborChoice::Cells, SimdChoice::Portable),
        options(NeighborChoice::Cells, SimdChoice::Auto),
        options(NeighborChoice::AllPairs, SimdChoice::Auto),
    ];
    // Edges can be too long or too short for lists.
    let lists = [SimdChoice::Portable, SimdChoice::Auto].map(|simd| options(NeighborChoice::Lists, simd));
    if !matches!(Simulation::new(system.clone(), lists[0]), Err(EngineError::Unsuitable { .. })) {
        choices.extend(lists);
    }
    if has_windows(system) {
        choices.push(options(NeighborChoice::Windows, SimdChoice::Portable));
        choices.push(options(NeighborChoice::Windows, SimdChoice::Auto));
        // Where `Auto` uses wider vectors than AVX2.
        let avx2 = options(NeighborChoice::Windows, SimdChoice::Avx2);
        if !matches!(Simulation::new(system.clone(), avx2), Err(EngineError::NoAvx2)) {
            choices.push(avx2);
        }
    }
    for choice in choices {
        let (log, other, mut simulation) = run(system, choice, until);
        for (row, (a, b)) in reference.0.iter().zip(&log.0).enumerate() {
            assert_eq!(a, b, "{name}, {choice:?}, event {row}");
        }
        assert_eq!(reference.0.len(), log.0.len(), "{name}, {choice:?}: number of events");
        assert_eq!(hash, other, "{name}, {choice:?}: state hash");
        assert_eq!(
            sample,
            format!("{:?}", simulation.sample()),
            "{name}, {choice:?}: observables and ledger"
        );
        simulation.validate(1e-12).unwrap_or_else(|error| panic!("{name}, {choice:?}: {error}"));
    }
    reference.0.len()
}

/// Size ratios of 30 and 100, in boxes of little more than one to three diameters of the large particle.
#[test]
#[ignore = "long: scripts/test all"]
fn windows_support_very_unequal_sizes() {
    for (large, small, edge, boundary) in [
        (3.0, 0.1, 17.0, Boundary::Periodic),
        (5.0, 0.05, 28.5, Boundary::Periodic),
        (5.0, 0.05, 12.0, Boundary::Wall),
    ] {
        let name = format!("{large} : {small}, {boundary:?}");
        let mut random = Random(57);
        let mut scene = system(Dimension::Three, DVec3::splat(edge), [boundary; 3]);
        let ball = class(&mut scene, large, 1000.0);
        scatter(&mut scene, ball, 1, 0.1, &mut random);
        let grain = class(&mut scene, small, 1.0);
        scatter(&mut scene, grain, 150, 3.0, &mut random);
        assert!(has_windows(&scene), "{name}");
        let events =
            assert_same_trajectory(&name, &scene, Until { collisions: 400, time: 100.0, entries: 4_000_000 });
        assert!(events > 200, "{name}: {events}");
    }
}

#[test]
fn trajectory_is_independent_of_search() {
    for (seed, (packing, e)) in [(0.02, 1.0), (0.1, 0.9), (0.3, 1.0), (0.45, 0.7)].into_iter().enumerate() {
        let system = gas(4, packing, e, seed as u64);
        let events = assert_same_trajectory(
            &format!("φ = {packing}"),
            &system,
            Until { collisions: 3000, ..Until::default() },
        );
        assert_eq!(events, 3000);
    }
}

/// All features mixed, in 200 random systems.
#[test]
#[ignore = "long: scripts/test all"]
fn trajectory_of_random_scenes_is_independent_of_search() {
    let mut events = 0;
    for seed in 0..200 {
        let mut random = Random(seed);
        let dimension = if random.index(2) == 0 { Dimension::Two } else { Dimension::Three };
        let kinds = [Boundary::Periodic, Boundary::Wall, Boundary::Open];
        let boundary = [0; 3].map(|_| kinds[random.index(3)]);
        let least = if dimension == Dimension::Two { 10.0 } else { 5.0 };
        let size = DVec3::from_array([0; 3].map(|_| random.uniform(least, 14.0)));
        let mut scene = system(dimension, size, boundary);
        if random.index(3) == 0 {
            for axis in 0..dimension.count() {
                if boundary[axis] != Boundary::Periodic {
                    scene.domain.gravity[axis] = random.uniform(-1.0, 1.0);
                }
            }
        }
        if random.index(3) == 0
            && let Some(axis) = (0..dimension.count()).find(|&axis| boundary[axis] != Boundary::Periodic)
        {
            // An oblique plane through a corner region, tilted between the axes that are not periodic.
            let mut normal = DVec3::AXES[axis];
            for other in 0..dimension.count() {
                if other != axis && boundary[other] != Boundary::Periodic {
                    normal[other] = random.uniform(-0.5, 0.5);
                }
            }
            // Only without gravity: otherwise grains would be squeezed without end into the wedge between the
            // ramp and a wall.
            let moves = random.index(4) == 0 && scene.domain.gravity == DVec3::ZERO;
            let velocity = if moves { normal * 0.1 } else { DVec3::ZERO };
            scene.walls.push(Wall {
                name: "ramp".into(),
                point: size * 0.2,
                normal: normal.normalize(),
                motion: velocity.into(),
                shape: None,
            });
            scene.contacts.wall.push((scene.contacts.pair[0]).into());
        }
        set_restitution(&mut scene, [1.0, 0.9, 0.5][random.index(3)]);
        let uniform = random.index(2) == 0;
        let classes = if uniform { 1 } else { 3 };
        for _ in 0..classes {
            let radius = if uniform { 0.5 } else { random.uniform(0.1, 0.7) };
            let mass = if uniform { 1.0 } else { random.uniform(0.1, 10.0) };
            let kind = class(&mut scene, radius, mass);
            let count = 2 + random.index(6);
            scatter(&mut scene, kind, count, 1.0, &mut random);
        }
        if !uniform && random.index(2) == 0 {
            let fixed = class(&mut scene, 0.6, f64::INFINITY);
            let speed = if random.index(2) == 0 { 0.0 } else { 0.3 };
            scatter(&mut scene, fixed, 1, speed, &mut random);
        }
        let name = format!("seed {seed}: {dimension:?} {boundary:?}");
        events +=
            assert_same_trajectory(&name, &scene, Until { collisions: 150, time: 40.0, entries: 400_000 });
    }
    assert!(events > 15_000, "{events} events in all");
}

/// Runs with lists, portable and vectorized, asserts that the events are those of cells, and returns the
/// counters of the lists.
fn assert_lists(name: &str, system: &System, collisions: u64) -> Counters {
    let until = Until { collisions, ..Until::default() };
    let (reference, hash, _) = run(system, options(NeighborChoice::Cells, SimdChoice::Portable), until);
    let mut result = Counters::default();
    for simd in [SimdChoice::Portable, SimdChoice::Auto] {
        let (log, other, mut simulation) = run(system, options(NeighborChoice::Lists, simd), until);
        for (row, (a, b)) in reference.0.iter().zip(&log.0).enumerate() {
            assert_eq!(a, b, "{name}, {simd:?}, event {row}");
        }
        assert_eq!(reference.0.len(), log.0.len(), "{name}, {simd:?}: number of events");
        assert_eq!(hash, other, "{name}, {simd:?}: state hash");
        simulation.validate(1e-12).unwrap_or_else(|error| panic!("{name}, {simd:?}: {error}"));
        result = simulation.counters();
        // Only `ListSearch` has a filter and counts its candidates.
        assert!(result.candidates > 0 && result.transfers > 0, "{name}: {result:?}");
    }
    result
}

#[test]
fn single_precision_filter_of_lists_misses_no_contact() {
    for (seed, (packing, e)) in [(0.15, 1.0), (0.3, 0.9), (0.49, 1.0)].into_iter().enumerate() {
        let scene = gas(9, packing, e, 30 + seed as u64);
        let counters = assert_lists(&format!("φ = {packing}"), &scene, 6000);
        // The filter dismisses most members of lists: fewer than 3 of 10 are predicted.
        assert!(10 * counters.predictions < 3 * counters.candidates, "{counters:?}");
    }
    assert_lists("disks", &disks(20, 0.65, 33), 5000);
    // A crystal with random velocities, in which one particle is very fast and one is at rest.
    let mut scene = gas(9, 0.4, 1.0, 34);
    scene.bodies[100].velocity = DVec3::new(150.0, -200.0, 240.0);
    scene.bodies[200].velocity = DVec3::ZERO;
    assert_lists("fast", &scene, 4000);
    let mut random = Random(35);
    let mut scene = system(Dimension::Three, DVec3::new(12.0, 11.0, 10.0), [Boundary::Periodic; 3]);
    set_restitution(&mut scene, 0.95);
    for (radius, mass) in [(0.5, 1.0), (0.3, 0.2), (0.4, 5.0)] {
        let kind = class(&mut scene, radius, mass);
        scatter(&mut scene, kind, 200, 1.0, &mut random);
    }
    assert_lists("sizes", &scene, 6000);
}

/// In boxes with walls, some of which move or are inclined, and around bodies of infinite mass.
#[test]
fn lists_miss_no_contact_with_walls_and_fixed_bodies() {
    let mut random = Random(37);
    let boundaries = [
        [Boundary::Wall; 3],
        [Boundary::Wall, Boundary::Periodic, Boundary::Wall],
        [Boundary::Periodic, Boundary::Periodic, Boundary::Wall],
    ];
    for boundary in boundaries {
        let mut scene = system(Dimension::Three, DVec3::new(12.0, 11.0, 10.0), boundary);
        set_restitution(&mut scene, 0.95);
        let (ball, post) = (class(&mut scene, 0.5, 1.0), class(&mut scene, 0.7, f64::INFINITY));
        scatter(&mut scene, post, 12, 0.0, &mut random);
        scatter(&mut scene, ball, 500, 1.0, &mut random);
        let counters = assert_lists(&format!("{boundary:?}"), &scene, 4000);
        assert!(counters.wall_collisions > 100, "{counters:?}");
        if boundary == [Boundary::Wall; 3] {
            let mut inclined = scene.clone();
            let normal = DVec3::new(1.0, 0.0, 1.0).normalize();
            let point =
                scene.bodies.iter().map(|body| body.position.dot(normal)).fold(f64::INFINITY, f64::min);
            let point = normal * (point - 0.71);
            inclined.walls.push(Wall {
                name: "ramp".into(),
                point,
                normal,
                motion: DVec3::ZERO.into(),
                shape: None,
            });
            let laws =
                inclined.contacts.wall.chunks(6).flat_map(|laws| [laws, &laws[..1]].concat()).collect();
            inclined.contacts.wall = laws;
            assert_lists("an inclined wall", &inclined, 4000);
            // One wall moves away from the particles, another one towards them.
            scene.walls[0].motion = DVec3::new(-0.1, 0.0, 0.0).into();
            scene.walls[5].motion = DVec3::new(0.0, 0.0, -0.02).into();
            assert_lists("moving walls", &scene, 4000);
        }
    }
    let mut scene = system(Dimension::Two, DVec3::new(24.0, 20.0, 1.0), [Boundary::Wall; 3]);
    let disk = class(&mut scene, 0.5, 1.0);
    scatter(&mut scene, disk, 240, 1.0, &mut random);
    let counters = assert_lists("disks and walls", &scene, 4000);
    assert!(counters.wall_collisions > 100, "{counters:?}");
}

/// At the end the gas is slower by two orders of magnitude, and has clusters.
#[test]
fn lists_adapt_to_a_cooling_gas() {
    let mut scene = gas(9, 0.2, 0.5, 36);
    scene.contacts.tc = 1e-3;
    assert_lists("cooling", &scene, 12_000);
}

/// Contacts of exactly equal times: their order must not depend on the order of the predictions.
#[test]
fn trajectory_of_symmetric_scenes_is_independent_of_search() {
    // A crystal whose particles all have one speed along the axes.
    let mut crystal = gas(4, 0.2, 1.0, 5);
    for (i, body) in crystal.bodies.iter_mut().enumerate() {
        let sign = if (i / 3) % 2 == 0 { 1.0 } else { -1.0 };
        body.velocity = DVec3::AXES[i % 3] * sign;
    }
    assert_same_trajectory("crystal", &crystal, Until { collisions: 2000, ..Until::default() });

    // Fifteen touching disks, hit in the middle.
    let mut table = system(Dimension::Two, DVec3::new(40.0, 20.0, 1.0), [Boundary::Wall; 3]);
    let ball = class(&mut table, 0.5, 1.0);
    add(&mut table, ball, DVec3::new(10.0, 10.0, 0.0), DVec3::new(8.0, 0.0, 0.0));
    for row in 0..5 {
        for k in 0..=row {
            let x = 25.0 + f64::from(row) * 0.75_f64.sqrt() * (1.0 + 1e-15);
            let y = 10.0 + f64::from(k) - 0.5 * f64::from(row);
            add(&mut table, ball, DVec3::new(x, y, 0.0), DVec3::ZERO);
        }
    }
    let events = assert_same_trajectory(
        "breakshot",
        &table,
        Until { time: 50.0, collisions: 400, ..Until::default() },
    );
    assert!(events > 20, "{events}");
}

/// A contact can be later than the end of the clock's epoch, and its anchors can be older than the epoch.
#[test]
fn a_contact_many_epochs_later_happens_at_its_time() {
    for (gap, speed) in [(3.0, 0.002), (4.0, 0.000_7), (5.0, 0.000_3)] {
        let mut scene = system(Dimension::Three, DVec3::splat(20.0), [Boundary::Periodic; 3]);
        let ball = class(&mut scene, 0.5, 1.0);
        // The fast particle sets the length of an epoch and never collides.
        add(&mut scene, ball, DVec3::new(1.0, 15.0, 15.0), DVec3::new(1.0, 0.0, 0.0));
        add(&mut scene, ball, DVec3::new(5.0, 5.0, 5.0), DVec3::ZERO);
        add(&mut scene, ball, DVec3::new(6.0 + gap, 5.0, 5.0), DVec3::new(-speed, 0.0, 0.0));
        let time = gap / speed;
        for neighbors in [NeighborChoice::AllPairs, NeighborChoice::Cells, NeighborChoice::Lists] {
            let options = options(neighbors, SimdChoice::Auto);
            let mut simulation = Simulation::new(scene.clone(), options).unwrap();
            let mut collisions = |time| {
                simulation.advance(Until { time, ..Until::default() }, &mut Log::default()).unwrap();
                (simulation.counters().collisions, simulation.counters().epochs)
            };
            assert_eq!(collisions(time - 0.1).0, 0, "{neighbors:?}, before {time}");
            let (after, epochs) = collisions(time + 0.1);
            assert_eq!(after, 1, "{neighbors:?}, after {time}, {epochs} epochs");
        }
    }
}

#[test]
fn a_resumed_run_equals_the_uninterrupted_run() {
    for (seed, gravity) in [(1, false), (2, true)] {
        let mut random = Random(seed);
        let mut scene = system(Dimension::Three, DVec3::splat(8.0), [Boundary::Wall; 3]);
        set_restitution(&mut scene, 0.9);
        if gravity {
            scene.domain.gravity = DVec3::new(0.0, 0.1, -1.0);
        }
        let (small, large) = (class(&mut scene, 0.4, 1.0), class(&mut scene, 0.7, 3.0));
        scatter(&mut scene, small, 40, 1.0, &mut random);
        scatter(&mut scene, large, 10, 1.0, &mut random);
        let whole = Until { time: 20.0, ..Until::default() };
        let (_, hash, mut reference) = run(&scene, Options::default(), whole);
        let expected = reference.sample();

        let searches = [NeighborChoice::Lists, NeighborChoice::Cells, NeighborChoice::AllPairs];
        let mut parts = Simulation::new(scene.clone(), Options::default()).unwrap();
        for (k, entries) in [1, 10, 100, 300, 1000, 1000].into_iter().enumerate() {
            parts.advance(Until { entries, ..whole }, &mut Log::default()).unwrap();
            let checkpoint = parts.checkpoint();
            let next = options(searches[k % 3], SimdChoice::Auto);
            parts = Simulation::restore(scene.clone(), next, &checkpoint).unwrap();
            assert_eq!(parts.checkpoint(), checkpoint);
        }
        parts.advance(whole, &mut Log::default()).unwrap();
        assert_eq!(parts.state_hash(), hash);
        let sample = parts.sample();
        assert_eq!(sample.ledger, expected.ledger);
        assert_eq!(
            (sample.momentum, sample.external_impulse),
            (expected.momentum, expected.external_impulse)
        );
        assert!(sample.wall_collisions > 100);
    }
}

/// Windows are opened in parallel from 65,536 particles on, or from 16,384 where events are rare.
#[test]
fn trajectory_is_independent_of_thread_count() {
    let windows = NeighborChoice::Windows;
    for (system, neighbors, blocks) in [
        (gas(12, 0.2, 0.95, 9), NeighborChoice::Lists, None),
        (gas(12, 0.3, 0.95, 9), NeighborChoice::Lists, Some(2)),
        (gas(20, 0.5, 0.95, 9), NeighborChoice::Lists, Some(8)),
        (gas(26, 0.01, 0.95, 9), windows, None),
        (gas(26, 0.01, 0.95, 9), windows, Some(2)),
        (gas(20, 0.1, 0.95, 9), windows, Some(8)),
    ] {
        let until = Until { collisions: 5000, ..Until::default() };
        let hashes: Vec<String> = [1, 2, 3, 4, 8]
            .into_iter()
            .map(|threads| {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
                let options = Options { blocks, ..options(neighbors, SimdChoice::Auto) };
                pool.install(|| run(&system, options, until).1)
            })
            .collect();
        assert!(hashes.iter().all(|hash| *hash == hashes[0]), "{neighbors:?}: {hashes:?}");
    }
}

#[test]
fn a_gas_resumed_with_windows_equals_the_uninterrupted_run() {
    let scene = gas(7, 0.1, 0.9, 4);
    let whole = Until { time: 6.0, ..Until::default() };
    let (_, hash, mut reference) = run(&scene, options(NeighborChoice::Cells, SimdChoice::Auto), whole);
    let expected = reference.sample();
    let searches = [NeighborChoice::Windows, NeighborChoice::Windows, NeighborChoice::Lists];
    let mut parts =
        Simulation::new(scene.clone(), options(NeighborChoice::Windows, SimdChoice::Auto)).unwrap();
    // Each window that is opened counts as an entry of the slice.
    for (k, entries) in [1, 10, 100, 300, 500, 700].into_iter().enumerate() {
        let stop = parts.advance(Until { entries, ..whole }, &mut Log::default()).unwrap();
        assert_eq!(stop, Stop::Slice, "part {k}");
        let checkpoint = parts.checkpoint();
        let next = options(searches[k % 3], SimdChoice::Auto);
        parts = Simulation::restore(scene.clone(), next, &checkpoint).unwrap();
        assert_eq!(parts.checkpoint(), checkpoint);
    }
    parts.advance(whole, &mut Log::default()).unwrap();
    assert_eq!(parts.state_hash(), hash);
    let sample = parts.sample();
    assert_eq!((sample.ledger, sample.momentum), (expected.ledger, expected.momentum));
    assert!(parts.counters().collisions > 1000, "{:?}", parts.counters());
}

/// Close to the densest packing, where lists are longer than in any fluid; and one large particle among many
/// small ones, whose list must overflow.
#[test]
#[ignore = "long: scripts/test all"]
fn trajectory_of_crowded_systems_is_independent_of_search() {
    // A face-centered cubic crystal at φ = 0.7.
    let edge = (4.0 * std::f64::consts::PI / 6.0 / 0.7_f64).cbrt();
    let mut crystal = system(Dimension::Three, DVec3::splat(4.0 * edge), [Boundary::Periodic; 3]);
    let ball = class(&mut crystal, 0.5, 1.0);
    let mut random = Random(3);
    for k in 0..256 {
        let cell = DVec3::new(f64::from(k / 4 % 4), f64::from(k / 16 % 4), f64::from(k / 64));
        let corner =
            [DVec3::ZERO, DVec3::new(0.5, 0.5, 0.0), DVec3::new(0.5, 0.0, 0.5), DVec3::new(0.0, 0.5, 0.5)];
        let velocity = DVec3::new(random.normal(), random.normal(), random.normal());
        add(&mut crystal, ball, (cell + corner[k as usize % 4] + 0.25) * edge, velocity);
    }
    assert_eq!(
        assert_same_trajectory("crystal", &crystal, Until { collisions: 4000, ..Until::default() }),
        4000
    );

    let mut bag = system(Dimension::Three, DVec3::splat(8.0), [Boundary::Periodic; 3]);
    let (large, small) = (class(&mut bag, 2.5, 100.0), class(&mut bag, 0.25, 1.0));
    add(&mut bag, large, DVec3::splat(4.0), DVec3::ZERO);
    scatter(&mut bag, small, 1200, 1.0, &mut random);
    assert_eq!(assert_same_trajectory("bag", &bag, Until { collisions: 3000, ..Until::default() }), 3000);
}
