//! Run time and work of each search for random mixtures of two sizes: `mixtures FIRST COUNT [COLLISIONS]`.
//!
//! One line for each mixture and search: seconds of processor time, work counters, and the time relative to
//! that of the fastest search.

#[path = "../tests/suite/common/mod.rs"]
mod common;

use common::{mixture::mixture, processor_time};
use haff_engine::{NeighborChoice, Options, Silent, Simulation, System, Until};

/// Least processor time of some runs [s], the counters of one, and the search that was chosen; `None` where
/// the search does not support the system, or the system tells no times.
fn run(system: &System, neighbors: NeighborChoice, collisions: u64) -> Option<(f64, [u64; 5], &'static str)> {
    let options = Options { neighbors, ..Options::default() };
    let mut least = f64::INFINITY;
    let mut found = None;
    for _ in 0..3 {
        let begin = processor_time()?;
        let mut simulation = Simulation::new(system.clone(), options).ok()?;
        simulation.advance(Until { collisions, ..Until::default() }, &mut Silent).expect("the run goes on");
        least = least.min(processor_time()? - begin);
        let c = simulation.counters();
        let events = c.collisions + c.wall_collisions;
        found = Some((
            [events, c.predictions, c.transfers, c.candidates, c.windows],
            simulation.neighbors().name(),
        ));
        if least > 5.0 {
            break;
        }
    }
    found.map(|(counters, name)| (least, counters, name))
}

fn main() {
    let args: Vec<u64> = std::env::args().skip(1).map(|word| word.parse().expect("a number")).collect();
    let (first, count) = (args.first().copied().unwrap_or(0), args.get(1).copied().unwrap_or(20));
    println!(
        "seed dimension n ratio search chosen seconds relative events predictions transfers candidates windows"
    );
    for seed in first..first + count {
        let system = mixture(seed);
        let n = system.bodies.len() as u64;
        let collisions = args.get(2).copied().unwrap_or(10 * n);
        let searches =
            [NeighborChoice::Auto, NeighborChoice::Windows, NeighborChoice::Lists, NeighborChoice::Cells];
        let found: Vec<_> =
            searches.iter().filter_map(|&search| Some((search, run(&system, search, collisions)?))).collect();
        let best = found.iter().map(|(_, (seconds, ..))| *seconds).fold(f64::INFINITY, f64::min);
        for (search, (seconds, counters, chosen)) in &found {
            let ratio = system.classes[0].radius / system.classes[1].radius;
            let counters = counters.map(|count| count.to_string()).join(" ");
            println!(
                "{seed} {} {n} {ratio:.2} {} {chosen} {seconds:.5} {:.2} {counters}",
                system.dimension.count(),
                search.name(),
                seconds / best
            );
        }
    }
}
