//! Collisions per second of the elastic fluid:
//! `throughput N_PER_EDGE PHI COLLISIONS [auto|cells|lists|all] [spheres|disks|polydisperse]`.

#[path = "../tests/suite/common/mod.rs"]
mod common;

use common::processor_time;
use haff_engine::{NeighborChoice, Options, Silent, Simulation, Until};
use std::time::Instant;

fn main() {
    let args: Vec<String> = std::env::args().collect();
    let number = |k: usize, default: f64| args.get(k).and_then(|a| a.parse().ok()).unwrap_or(default);
    let (edge, phi, collisions) = (number(1, 16.0) as usize, number(2, 0.1), number(3, 1e6) as u64);
    let neighbors = match args.get(4).map_or("auto", String::as_str) {
        "cells" => NeighborChoice::Cells,
        "windows" => NeighborChoice::Windows,
        "lists" => NeighborChoice::Lists,
        "all" => NeighborChoice::AllPairs,
        _ => NeighborChoice::Auto,
    };
    let system = match args.get(5).map(String::as_str) {
        Some("disks") => common::disks(edge, phi, 1),
        Some("polydisperse") => common::polydisperse(edge, phi, 1),
        _ => common::gas(edge, phi, 1.0, 1),
    };
    let n = system.bodies.len() as u64;
    let start = Instant::now();
    let mut simulation = Simulation::new(system, Options { neighbors, ..Options::default() }).unwrap();
    let built = start.elapsed();
    simulation
        .advance(
            Until {
                collisions: args.get(6).and_then(|a| a.parse::<u64>().ok()).unwrap_or(10) * n,
                ..Until::default()
            },
            &mut Silent,
        )
        .unwrap();
    let before = simulation.counters();
    let (start, processor) = (Instant::now(), processor_time());
    simulation
        .advance(Until { collisions: before.collisions + collisions, ..Until::default() }, &mut Silent)
        .unwrap();
    let seconds = start.elapsed().as_secs_f64();
    let processor = processor_time().zip(processor).map_or(seconds, |(end, start)| end - start);
    let after = simulation.counters();
    let per = |a: u64, b: u64| (a - b) as f64 / collisions as f64;
    println!(
        "N {n} phi {phi}: {:.3} M collisions/s, {:.3} by processor time, built in {built:.2?}; per collision: {:.1} predictions, {:.2} stale, {:.2} dropped, {:.2} transfers, {:.1} candidates, {:.4} windows; residual {:.1e}; {}",
        collisions as f64 / seconds / 1e6,
        collisions as f64 / processor / 1e6,
        per(after.predictions, before.predictions),
        per(after.stale, before.stale),
        per(after.dropped, before.dropped),
        per(after.transfers, before.transfers),
        per(after.candidates, before.candidates),
        per(after.windows, before.windows),
        simulation.ledger().residual,
        simulation.state_hash()
    );
}
