//! Random scenes through which particles flow: every search finds the same, and numbers and energies are in
//! balance.

use glam::DVec3;
use haff_engine::{
    Body, Correlations, Cuboid, Dimension, Flow, Inlet, NeighborChoice, Options, Outlet, Silent, SimdChoice,
    Simulation, Stop, Supply, System, Until,
};
use proptest::prelude::*;
use proptest::test_runner::TestCaseError;

use super::{POOLS, Recipe, check_each};
use crate::common::Random;

/// The system of a recipe with an inlet that adds particles, one that puts them back, and an outlet.
fn with_flow(recipe: &Recipe) -> System {
    let plain = Recipe {
        drive: 0,
        drag: false,
        shear: 0,
        compression: 0,
        changed: false,
        at_kick: false,
        ..recipe.clone()
    };
    let mut system = plain.build();
    system.measure.correlations = Correlations::default();
    let mut random = Random(recipe.seed ^ 0x666c_6f77);
    let axis = random.index(system.dimension.count());
    let size = system.domain.size;
    // A part of the box along an axis; in two dimensions of any thickness.
    let slab = |from: f64, to: f64| {
        let (mut low, mut high) = (DVec3::ZERO, size);
        (low[axis], high[axis]) = (from * size[axis], to * size[axis]);
        if system.dimension == Dimension::Two {
            (low.z, high.z) = (-1.0, 1.0);
        }
        Cuboid { low, high }
    };
    let mut kinds: Vec<_> = system.bodies.iter().map(|body| (body.class, body.species)).collect();
    kinds.retain(|&(class, _)| system.classes[class as usize].mass.is_finite());
    let present = system.bodies.len();
    let count = if kinds.is_empty() { 0 } else { random.index(30) };
    let mut flow = Flow { present, ..Flow::default() };
    flow.outlets.push(Outlet {
        place: slab(0.0, random.uniform(0.1, 0.4)),
        interval: [None, Some(0.3)][random.index(2)],
    });
    let inlet = |supply: Supply, random: &mut Random| Inlet {
        place: slab(0.5, 1.0),
        velocity: DVec3::AXES[axis] * -random.uniform(0.0, 2.0),
        temperature: random.uniform(0.0, 1.0),
        supply,
    };
    let rate = random.uniform(1.0, 20.0);
    let supply = Supply::Rate { rate, first: present as u32, count: count as u32 };
    flow.inlets.push(inlet(supply, &mut random));
    if random.index(3) > 0 {
        let species = (0..system.species.len() as u32).collect();
        let count = [5, u64::MAX][random.index(2)];
        flow.inlets.push(inlet(Supply::Refill { species, count }, &mut random));
    }
    for _ in 0..count {
        let (class, species) = kinds[random.index(kinds.len())];
        let (position, velocity) = (DVec3::ZERO, DVec3::ZERO);
        system.bodies.push(Body { position, velocity, image: [0; 3], class, species });
    }
    if let Some(spin) = &mut system.spin {
        spin.angular_velocity.resize(system.bodies.len(), DVec3::ZERO);
    }
    system.flow = Some(Box::new(flow));
    system
}

/// Entries after which events are said to have no end.
pub const ENOUGH: u64 = 100_000;
/// The same for a search: updates of the lists of fast particles that are far from each other are entries,
/// too.
pub const MOST: u64 = 100 * ENOUGH;

/// What a run is like at some times; `None` if it takes more entries than these. It goes on from a checkpoint
/// after the first time.
pub fn outcome(system: &System, options: Options, entries: u64) -> Option<(Vec<String>, Simulation)> {
    let mut simulation = Simulation::new(system.clone(), options).unwrap();
    let mut found = Vec::new();
    for time in [0.7, 2.0, 5.0] {
        let until = Until { time, collisions: 1500, entries };
        match simulation.advance(until, &mut Silent) {
            Ok(Stop::Slice) => return None,
            Ok(stop) => {
                let terms = simulation.ledger().terms;
                found.push(format!("{stop:?} {} {terms:?}", simulation.state_hash()));
            }
            Err(error) => {
                found.push(error.to_string());
                break;
            }
        }
        if time == 0.7 {
            let checkpoint = simulation.checkpoint();
            simulation = Simulation::restore(system.clone(), options, &checkpoint).unwrap();
            assert_eq!(simulation.checkpoint(), checkpoint);
        }
    }
    Some((found, simulation))
}

/// Checks one scene. Returns the numbers of entries and exits; `None` if its events have no end.
fn check(recipe: &Recipe) -> Result<Option<[u64; 2]>, TestCaseError> {
    let system = with_flow(recipe);
    let plain =
        Options { neighbors: NeighborChoice::AllPairs, simd: SimdChoice::Portable, ..Options::default() };
    let Some((expected, mut simulation)) = outcome(&system, plain, ENOUGH) else { return Ok(None) };
    let sample = simulation.sample();
    let start = system.bodies_at_start().iter();
    let movable = start.filter(|body| system.classes[body.class as usize].mass.is_finite()).count() as u64;
    prop_assert_eq!(sample.particles, movable + sample.particles_in - sample.particles_out);
    prop_assert!(sample.ledger.residual.abs() < 1e-9, "ledger {:e}", sample.ledger.residual);
    let choices =
        [NeighborChoice::Auto, NeighborChoice::Cells, NeighborChoice::Lists, NeighborChoice::Windows];
    for (k, neighbors) in choices.into_iter().enumerate() {
        let blocks = [None, Some(2), Some(3)][(recipe.seed % 3) as usize];
        let options = Options { neighbors, blocks, ..Options::default() };
        if Simulation::new(system.clone(), options).is_err() {
            // It cannot run this system.
            continue;
        }
        let pool = &POOLS[(k as u64 + recipe.seed) as usize % 3];
        let found = pool.install(|| outcome(&system, options, MOST)).map(|(texts, _)| texts);
        prop_assert_eq!(found.as_ref(), Some(&expected), "{:?}", neighbors);
    }
    Ok(Some([sample.particles_in, sample.particles_out]))
}

#[test]
#[ignore = "long: scripts/test all"]
fn random_flows_are_in_balance_and_independent_of_search() {
    let counts = std::cell::Cell::new([0, 0, 0]);
    let scenes = check_each(4, 2, |recipe| {
        let [entered, left, endless] = counts.get();
        counts.set(match check(recipe)? {
            Some([more_entered, more_left]) => [entered + more_entered, left + more_left, endless],
            None => [entered, left, endless + 1],
        });
        Ok(())
    });
    let [entered, left, endless] = counts.get();
    println!("{scenes} scenes, {endless} of them without end; {entered} entries, {left} exits");
    let scenes = u64::from(scenes);
    assert!(entered > 2 * scenes && left > 2 * scenes && 5 * endless < scenes, "{entered} {left} {endless}");
}
