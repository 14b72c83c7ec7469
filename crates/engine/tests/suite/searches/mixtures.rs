//! The search that is chosen for random mixtures of two sizes, by the work of each search, not by its time.

use haff_engine::{EngineError, NeighborChoice, Options, Silent, Simulation, System, Until};

use crate::common::mixture::mixture;

/// Work of a run \[about ns\]: an event, a prediction, a crossing of cells or an update of a list, a test of
/// a pair before its prediction, and a particle in a new window. The weights are fitted to the times of the
/// example `mixtures`, which they give within a factor of 2.3 (benches/record/choice.md).
fn work(system: &System, simulation: &Simulation) -> f64 {
    let counters = simulation.counters();
    let events = counters.collisions + counters.wall_collisions;
    let moved = counters.windows * system.bodies.len() as u64;
    // Cells predict all candidates, without a branch; the others only those that pass a test.
    let prediction = if simulation.neighbors() == NeighborChoice::Cells { 12.0 } else { 80.0 };
    [
        (events, 400.0),
        (counters.predictions, prediction),
        (counters.transfers, 230.0),
        (counters.candidates, 2.7),
        (moved, 56.0),
    ]
    .into_iter()
    .map(|(count, weight)| count as f64 * weight)
    .sum()
}

/// Work of some collisions; `None` if the search does not support the system.
fn run(system: &System, neighbors: NeighborChoice) -> Option<f64> {
    let options = Options { neighbors, ..Options::default() };
    let mut simulation = match Simulation::new(system.clone(), options) {
        Err(EngineError::Unsuitable { .. }) => return None,
        new => new.unwrap(),
    };
    let until = Until { collisions: system.bodies.len() as u64 / 2, ..Until::default() };
    simulation.advance(until, &mut Silent).unwrap();
    Some(work(system, &simulation))
}

#[test]
#[ignore = "long: scripts/test all"]
fn no_mixture_takes_twice_the_work_of_the_best_search() {
    let mut largest = 0.0_f64;
    for seed in 0..60 {
        let system = mixture(seed);
        let chosen = run(&system, NeighborChoice::Auto).unwrap();
        let searches = [NeighborChoice::Windows, NeighborChoice::Lists, NeighborChoice::Cells];
        let best = searches.into_iter().filter_map(|search| run(&system, search)).fold(chosen, f64::min);
        assert!(
            chosen < 2.0 * best,
            "mixture {seed}: {:.2} times the work of the best search",
            chosen / best
        );
        largest = largest.max(chosen / best);
    }
    println!("largest ratio: {largest:.2}");
}
