//! Runs that are changed on their way: other laws of contact, another gravity, walls with another motion.
//! Every search, blocks and resumptions give the bits of all pairs.

use glam::DVec3;
use haff_engine::{
    EngineError, Instant, NeighborChoice, Options, SimdChoice, Simulation, Stop, System, Until, WallLaw,
    WallMotion,
};
use haff_mechanics::Restitution;
use proptest::prelude::*;
use proptest::test_runner::TestCaseError;

use super::{End, POOLS, THREADS, compare, go_on, recipe::Recipe};
use crate::common::{Log, Random};

/// The system with some of the keys changed that may change in a run that goes on.
fn changed(mut system: System, seed: u64, at: Instant) -> System {
    let mut random = Random(seed ^ 0x9e37_79b9_7f4a_7c15);
    if random.index(2) == 0 {
        let law = Restitution::Constant([0.0, 0.7, 1.0][random.index(3)]);
        system.contacts.pair.fill(law);
        for wall in &mut system.contacts.wall {
            if matches!(wall, WallLaw::Restitution(_)) {
                *wall = law.into();
            }
        }
    }
    if random.index(2) == 0 {
        system.contacts.tc = [0.0, 1e-3, 0.1][random.index(3)];
    }
    if random.index(2) == 0 {
        system.domain.gravity *= [0.0, -1.0, 2.0][random.index(3)];
    }
    for wall in system.walls.iter_mut().filter(|wall| wall.shape.is_none()) {
        let motion = match (random.index(3), wall.motion) {
            (0, WallMotion::Oscillating(mut motion)) => {
                motion.oscillation.frequency *= random.uniform(0.5, 2.0);
                motion.oscillation.amplitude *= random.uniform(0.5, 1.0);
                WallMotion::Oscillating(motion)
            }
            (0, WallMotion::Fixed) => (wall.normal * random.uniform(-0.1, 0.02)).into(),
            (0, WallMotion::Constant(_)) => WallMotion::Fixed,
            _ => continue,
        };
        *wall = wall.going_on(&motion, at);
    }
    system
}

/// How a changed run began and went on.
struct Changed {
    log: Log,
    /// The error of the change, or how the run ended.
    end: Result<End, EngineError>,
    simulation: Simulation,
}

/// Runs a system, changes it after half of the collisions or of the time, and goes on; with `resume` from a
/// checkpoint. An error is how the run ended before the change.
fn run_changed(
    system: &System,
    seed: u64,
    until: Until,
    options: Options,
    resume: bool,
) -> Result<Changed, End> {
    let mut log = Log::default();
    let mut simulation = Simulation::new(system.clone(), options).unwrap();
    simulation.sample();
    let half = Until { time: 0.5 * until.time, collisions: until.collisions / 2, ..until };
    let before = go_on(system, half, &mut log, &mut simulation);
    if !matches!(before, End::Stop(Stop::Collisions | Stop::Time)) {
        return Err(before);
    }
    let next = changed(simulation.present_system().unwrap(), seed, simulation.instant());
    if let Err(error) = simulation.change_system(next.clone(), &mut log) {
        return Ok(Changed { log, end: Err(error), simulation });
    }
    if resume {
        simulation = Simulation::restore(next.clone(), options, &simulation.checkpoint()).unwrap();
    }
    let end = go_on(&next, until, &mut log, &mut simulation);
    Ok(Changed { log, end: Ok(end), simulation })
}

/// Checks that all searches, blocks and resumptions give the same changed run. Returns the number of its
/// events after the change.
pub fn check_changed(recipe: &Recipe, system: &System, until: Until) -> Result<u64, TestCaseError> {
    let plain =
        Options { neighbors: NeighborChoice::AllPairs, simd: SimdChoice::Portable, ..Options::default() };
    // Bounces without end take most of the time of this test.
    let until = Until { entries: 5000, ..until };
    let Ok(mut expected) = run_changed(system, recipe.seed, until, plain, false) else { return Ok(0) };
    let frame = expected.simulation.frame();
    prop_assert!(frame.position.iter().chain(&frame.velocity).copied().all(DVec3::is_finite));
    let is_reported = matches!(&expected.end, Ok(End::Error(text)) if text.contains("overlaps with"));
    let overlap = expected.simulation.measure_overlap();
    prop_assert!(overlap.is_ok() || is_reported, "changed: {}", overlap.unwrap_err());
    let threads = (recipe.seed >> 16) as usize % THREADS.len();
    for (neighbors, blocks, resume) in [
        (NeighborChoice::AllPairs, None, true),
        (NeighborChoice::Cells, None, true),
        (NeighborChoice::Lists, None, false),
        (NeighborChoice::Windows, None, true),
        (NeighborChoice::Windows, Some(2), false),
        (NeighborChoice::Auto, None, false),
    ] {
        let options = Options { neighbors, blocks, ..Options::default() };
        if matches!(Simulation::new(system.clone(), options), Err(EngineError::Unsuitable { .. })) {
            continue;
        }
        let found = POOLS[threads].install(|| run_changed(system, recipe.seed, until, options, resume));
        let found = match found {
            Ok(found) => found,
            // The number of entries until then depends on the search.
            Err(End::Stop(Stop::Slice)) => continue,
            Err(end) => {
                prop_assert!(false, "{options:?}: {end:?} before the change");
                continue;
            }
        };
        let text = format!("changed, {options:?}, resumed: {resume}");
        match (&expected.end, &found.end) {
            (Ok(end), Ok(ended)) => compare(
                &text,
                (&expected.log, end, &expected.simulation),
                (&found.log, ended, &found.simulation),
            )?,
            (_, Err(EngineError::Unsuitable { .. })) => {}
            (Err(why @ EngineError::Change(_)), Err(other)) => prop_assert_eq!(why, other, "{}", text),
            (expected, found) => prop_assert!(false, "{}: {:?} and {:?}", text, expected, found),
        }
    }
    Ok(expected.log.0.len() as u64)
}
