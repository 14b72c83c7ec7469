//! Walls whose motion changes while a run goes on: they go on from where they are, and every search gives the
//! same bits. `HAFF_CHAINS=2000` tries more random chains of changes.

use glam::DVec3;
use haff_engine::{
    Boundary, ConstantVelocity, Dimension, EngineError, EventKind, Instant, NeighborChoice, Options,
    Oscillating, SimdChoice, Simulation, System, Until, Wall, WallMotion,
};
use haff_mechanics::{Oscillation, Waveform};

use crate::common::{Log, Random, class, scatter, set_restitution, system};

fn until(time: f64) -> Until {
    Until { time, ..Until::default() }
}

fn oscillating(waveform: Waveform, amplitude: f64, frequency: f64, cycles: f64) -> WallMotion {
    WallMotion::Oscillating(Oscillating {
        oscillation: Oscillation { waveform, amplitude, frequency },
        cycles,
    })
}

fn wall(point: DVec3, normal: DVec3, motion: WallMotion) -> Wall {
    Wall { name: "wall".into(), point, normal, motion, shape: None }
}

/// Position along the normal.
fn place(wall: &Wall, at: Instant) -> f64 {
    (wall.point + wall.motion.displacement(wall.normal, at)).dot(wall.normal)
}

fn speed(wall: &Wall, at: Instant) -> f64 {
    wall.motion.velocity(wall.normal, at).dot(wall.normal)
}

/// A motion by chance: fixed, at a constant velocity, or an oscillation of either form.
fn motion(random: &mut Random, normal: DVec3) -> WallMotion {
    let (amplitude, frequency) = (random.uniform(0.01, 0.2), 10_f64.powf(random.uniform(-0.7, 0.6)));
    match random.index(5) {
        0 => WallMotion::Fixed,
        1 => (normal * random.uniform(-0.1, 0.1)).into(),
        2 => oscillating(Waveform::Triangle, amplitude, frequency, random.uniform(0.0, 1.0)),
        _ => oscillating(Waveform::Sine, amplitude, frequency, random.uniform(0.0, 1.0)),
    }
}

/// The same with one of its parameters changed, or another motion.
fn changed(random: &mut Random, wall: &Wall) -> WallMotion {
    let mut next = wall.motion;
    if let WallMotion::Oscillating(motion) = &mut next {
        match random.index(4) {
            0 => motion.oscillation.frequency *= random.uniform(0.5, 2.0),
            1 => motion.oscillation.amplitude *= random.uniform(0.5, 1.5),
            2 => {
                motion.oscillation.frequency *= random.uniform(0.9, 1.1);
                motion.oscillation.amplitude *= random.uniform(0.9, 1.1);
            }
            _ => return self::motion(random, wall.normal),
        }
        return next;
    }
    motion(random, wall.normal)
}

#[test]
fn walls_go_on_from_where_they_are_at_any_time() {
    let mut random = Random(36);
    let mut kinds = [0; 3];
    for case in 0..20_000 {
        let normal = DVec3::from_array([0; 3].map(|_| random.uniform(-1.0, 1.0))).normalize();
        let normal = if case % 2 == 0 { DVec3::AXES[random.index(3)] } else { normal };
        let point = DVec3::from_array([0; 3].map(|_| random.uniform(-10.0, 10.0)));
        let mut wall = wall(point, normal, motion(&mut random, normal));
        // Late in a run the rounding of a time is no longer small: a wall that starts to move then must not
        // be displaced by it.
        let mut at = Instant::at(10_f64.powf(random.uniform(-1.0, 10.0)));
        let first = at;
        for _ in 0..5 {
            at = at.after(random.uniform(0.0, 3.0));
            let next = changed(&mut random, &wall);
            let after = wall.going_on(&next, at);
            // A wall that moves at a constant velocity since time 0 has the rounding of its distance.
            let far = match wall.motion {
                WallMotion::Constant(ConstantVelocity { velocity, reference_time: 0.0 }) => {
                    velocity.length() * at.high
                }
                _ => 0.0,
            };
            let bound = 16.0 * f64::EPSILON * (20.0 + far + wall.point.length());
            let jump = place(&after, at) - place(&wall, at);
            assert!(jump.abs() <= bound, "case {case}: {jump:e}, {wall:?} to {after:?} at {at:?}");
            if let (WallMotion::Oscillating(a), WallMotion::Oscillating(b)) = (&wall.motion, &after.motion) {
                let (a, b) = (a.oscillation, b.oscillation);
                // The phase is continuous: the velocity changes as A f does. A triangle may be at a corner.
                let scale = (b.amplitude * b.frequency) / (a.amplitude * a.frequency);
                let (before, now) = (speed(&wall, at) * scale, speed(&after, at));
                if a.waveform == b.waveform && a.waveform == Waveform::Sine {
                    kinds[0] += 1;
                    assert!((before - now).abs() <= 1e-14 * b.max_speed(), "case {case}: {before} to {now}");
                }
                if (a.waveform, a.amplitude) == (b.waveform, b.amplitude) {
                    kinds[1] += 1;
                    assert_eq!(after.point, wall.point, "case {case}: the mean position stays");
                }
            }
            if next == wall.motion {
                assert_eq!(after, wall);
            }
            if let WallMotion::Constant(motion) = after.motion
                && motion.reference_time > 0.0
            {
                kinds[2] += 1;
                let later = at.after(7.0);
                let moved = place(&after, later) - place(&after, at);
                let error = moved - 7.0 * motion.velocity.dot(normal);
                // The duration since the reference time keeps its digits, however late it is.
                assert!(
                    error.abs() <= 16.0 * f64::EPSILON * (20.0 + after.point.length()),
                    "case {case}: {error:e} from {first:?}"
                );
            }
            wall = after;
        }
    }
    assert!(kinds.iter().all(|&count| count > 3000), "{kinds:?}");
}

#[test]
fn a_stopped_wall_stays_a_started_one_begins_at_phase_zero_and_an_amplitude_acts_from_its_phase() {
    let at = Instant::at(600.0);
    let piston = wall(DVec3::Z * 24.0, DVec3::NEG_Z, (DVec3::Z * -0.02).into());
    let stopped = piston.going_on(&WallMotion::Fixed, at);
    assert_eq!((stopped.point, stopped.motion), (DVec3::Z * 12.0, WallMotion::Fixed));
    let shaken = stopped.going_on(&oscillating(Waveform::Sine, 0.5, 0.25, 0.7), at);
    assert_eq!(shaken.point, DVec3::Z * 12.0);
    let rise = |wall: &Wall, later: f64| place(wall, Instant::at(600.0 + later)) + 12.0;
    assert!(rise(&shaken, 0.0).abs() < 1e-14 && (rise(&shaken, 1.0) - 0.5).abs() < 1e-14);
    // At the phase π/2, a shift of 0.5 along the normal: the mean position moves back by 0.3.
    let louder = shaken.going_on(&oscillating(Waveform::Sine, 0.8, 0.25, 0.0), Instant::at(601.0));
    assert!((louder.point.z - 12.3).abs() < 1e-14, "{louder:?}");
    assert!((rise(&louder, 1.0) - 0.5).abs() < 1e-14 && (rise(&louder, 2.0) + 0.3).abs() < 1e-14);
    // Back to the first amplitude at the same phase: where it was.
    let back = louder.going_on(&oscillating(Waveform::Sine, 0.5, 0.25, 0.0), Instant::at(605.0));
    assert!((rise(&back, 3.0) + 0.5).abs() < 1e-13, "{back:?}");
}

/// Grains between walls that may move, of which one is oblique.
fn scene(random: &mut Random, seed: u64) -> System {
    let flat = seed.is_multiple_of(2);
    let dimension = if flat { Dimension::Two } else { Dimension::Three };
    let boundary = [
        Boundary::Wall,
        if seed.is_multiple_of(3) { Boundary::Wall } else { Boundary::Periodic },
        Boundary::Wall,
    ];
    let mut scene = system(dimension, DVec3::splat(if flat { 22.0 } else { 10.0 }), boundary);
    let grain = class(&mut scene, 0.5, 1.0);
    scatter(&mut scene, grain, 60, 1.0, random);
    set_restitution(&mut scene, random.uniform(0.85, 1.0));
    if seed % 4 < 2 {
        scene.domain.gravity.x = -random.uniform(0.1, 1.0);
    }
    // Clear of the grains at the start, which are within the box.
    for wall in &mut scene.walls {
        wall.point -= 0.4 * wall.normal;
        wall.motion = motion(random, wall.normal);
    }
    if boundary[1] == Boundary::Wall {
        let normal = DVec3::new(1.0, 0.3, 0.0).normalize();
        let law = scene.contacts.wall[0];
        scene.walls.push(wall(DVec3::ZERO - 0.5 * normal, normal, motion(random, normal)));
        scene.contacts.wall.push(law);
    }
    scene
}

/// Runs with a chain of changes; returns the state after each part. `resume`: from a checkpoint after each
/// change.
fn chain(start: &System, seed: u64, options: Options, resume: bool) -> Vec<(String, [u64; 3], u64)> {
    let mut random = Random(1000 + seed);
    let mut simulation = Simulation::new(start.clone(), options).unwrap();
    let mut states = Vec::new();
    for part in 1..=4 {
        let mut log = Log::default();
        simulation.advance(until(1.3 * f64::from(part)), &mut log).unwrap();
        if let Err(error) = simulation.measure_overlap() {
            panic!("seed {seed}, part {part}, {options:?}: {error}");
        }
        let ledger = simulation.ledger();
        assert!(ledger.residual.abs() < 1e-12, "seed {seed}, part {part}: {:e}", ledger.residual);
        let sums = [ledger.kinetic, ledger.dissipated, ledger.terms[0]].map(f64::to_bits);
        states.push((simulation.state_hash(), sums, simulation.counters().wall_collisions));
        let mut system = simulation.present_system().unwrap();
        let at = simulation.instant();
        for wall in &mut system.walls {
            if random.index(3) > 0 {
                *wall = wall.going_on(&changed(&mut random, wall), at);
            }
        }
        let (before, work) = (simulation.frame(), simulation.ledger().terms);
        simulation.change_system(system.clone(), &mut log).unwrap();
        let after = simulation.frame();
        assert_eq!((&before.position, &before.velocity), (&after.position, &after.velocity));
        assert_eq!(simulation.ledger().terms, work, "walls that do not jump do no work");
        assert_eq!(log.0.last().map(|row| row.kind), Some(EventKind::Change));
        if resume {
            simulation = Simulation::restore(system, options, &simulation.checkpoint()).unwrap();
        }
    }
    states
}

#[test]
fn chains_of_changes_have_the_same_bits_in_every_search_and_after_resumptions() {
    let plain =
        Options { neighbors: NeighborChoice::AllPairs, simd: SimdChoice::Portable, ..Options::default() };
    let count = std::env::var("HAFF_CHAINS").map_or(24, |text| text.parse().expect("a number"));
    let mut contacts = 0;
    for seed in 0..count {
        let scene = scene(&mut Random(seed), seed);
        let expected = chain(&scene, seed, plain, false);
        contacts += expected.last().map_or(0, |state| state.2);
        for (neighbors, blocks, resume) in [
            (NeighborChoice::Cells, None, true),
            (NeighborChoice::Lists, None, false),
            (NeighborChoice::Windows, None, true),
            (NeighborChoice::Windows, Some(2), true),
            (NeighborChoice::Auto, None, false),
        ] {
            let options = Options { neighbors, blocks, ..Options::default() };
            let found = chain(&scene, seed, options, resume);
            let same = found.iter().zip(&expected).take_while(|(a, b)| a == b).count();
            assert_eq!(same, expected.len(), "seed {seed}, {neighbors:?}: {same} parts are the same");
        }
    }
    assert!(contacts > 20 * count, "{contacts} contacts with walls in {count} scenes");
}

#[test]
fn a_wall_that_jumps_onto_a_particle_is_refused_by_its_name() {
    let mut random = Random(3);
    let mut simulation = Simulation::new(scene(&mut random, 3), Options::default()).unwrap();
    simulation.advance(until(1.0), &mut Log::default()).unwrap();
    let hash = simulation.state_hash();
    let mut system = simulation.present_system().unwrap();
    system.walls[0].point.x += 5.0;
    let error = simulation.change_system(system, &mut Log::default()).unwrap_err();
    let EngineError::Change(why) = &error else { panic!("{error}") };
    assert!(why.contains("with wall \"x-\" by") && why.ends_with("radii"), "{why}");
    assert_eq!(simulation.state_hash(), hash);
}
