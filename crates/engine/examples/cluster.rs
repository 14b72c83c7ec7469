//! Collisions per second, and candidates a collision, of a cluster in the middle of a periodic box that is
//! mostly empty: `cluster N_PER_EDGE PHI BOX_OVER_CLUSTER RESTITUTION COLLISIONS_PER_PARTICLE
//! [auto|cells|lists|windows]`.

#[path = "../tests/suite/common/mod.rs"]
mod common;

use std::time::Instant;

use haff_engine::{NeighborChoice, Options, Silent, Simulation, Until};

fn main() {
    let args: Vec<String> = std::env::args().collect();
    let number = |k: usize, default: f64| args.get(k).and_then(|a| a.parse().ok()).unwrap_or(default);
    let neighbors = match args.get(6).map_or("auto", String::as_str) {
        "cells" => NeighborChoice::Cells,
        "lists" => NeighborChoice::Lists,
        "windows" => NeighborChoice::Windows,
        _ => NeighborChoice::Auto,
    };
    let mut system = common::gas(number(1, 32.0) as usize, number(2, 0.05), number(4, 0.9), 1);
    let size = system.domain.size * number(3, 20.0);
    let shift = 0.5 * (size - system.domain.size);
    system.domain.size = size;
    for body in &mut system.bodies {
        body.position += shift;
    }
    let collisions = (number(5, 2.0) * system.bodies.len() as f64) as u64;
    let mut simulation = Simulation::new(system, Options { neighbors, ..Options::default() }).unwrap();
    let start = Instant::now();
    // A cluster that has flown apart may not make them all.
    simulation.advance(Until { collisions, time: 1e6, ..Until::default() }, &mut Silent).unwrap();
    let (seconds, counters) = (start.elapsed().as_secs_f64(), simulation.counters());
    println!(
        "{:.3} M collisions/s, {:.1} candidates a collision, {:?} at the end, {}",
        counters.collisions as f64 / seconds / 1e6,
        counters.candidates as f64 / counters.collisions as f64,
        simulation.neighbors(),
        simulation.state_hash()
    );
}
