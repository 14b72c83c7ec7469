//! Whatever order events are taken in, the trajectory is one.

use std::cell::Cell;

use glam::DVec3;

#[path = "../../../tests/common/mod.rs"]
mod common;

use crate::windows::history::History;
use crate::{Boundary, Dimension, EventRecord, NeighborChoice, Options, Simulation, System, Until};
use common::Log;

thread_local! {
    /// From how many particles on tiles are used.
    pub(super) static LARGE: Cell<usize> = const { Cell::new(super::LARGE) };
    /// Windows taken tile by tile, collisions in them, collisions taken back in them, and windows taken again.
    static SEEN: Cell<[u64; 4]> = const { Cell::new([0; 4]) };
}

/// Notes that a window has been taken to its end, or has to be taken again.
pub(super) fn note(history: &History, to_its_end: bool) {
    let [windows, collisions, void, again] = SEEN.get();
    let valid = history.valid as u64;
    SEEN.set(if to_its_end {
        [windows + 1, collisions + valid, void + history.events.len() as u64 - valid, again]
    } else {
        [windows, collisions, void, again + 1]
    });
}

/// What a run gives: its events, its state, and what there was of tiles.
#[derive(Debug)]
struct Run {
    events: Vec<EventRecord>,
    hash: String,
    residual: f64,
    seen: [u64; 4],
}

/// Runs a system for so many collisions a particle, tile by tile or not.
fn run(system: &System, collisions: u64, tiles: bool) -> Run {
    LARGE.set(if tiles { 0 } else { usize::MAX });
    SEEN.set([0; 4]);
    let options = Options { neighbors: NeighborChoice::Windows, ..Options::default() };
    let particles = system.bodies.len() as u64;
    let mut simulation = Simulation::new(system.clone(), options).unwrap();
    let mut log = Log::default();
    simulation
        .advance(Until { collisions: collisions * particles / 2, ..Until::default() }, &mut log)
        .unwrap();
    Run {
        events: log.0,
        hash: simulation.state_hash(),
        residual: simulation.ledger().residual,
        seen: SEEN.get(),
    }
}

/// The run in tiles, found equal to the run in the order of time.
fn same(name: &str, system: &System, collisions: u64) -> [u64; 4] {
    let (plain, tiled) = (run(system, collisions, false), run(system, collisions, true));
    assert_eq!(plain.seen, [0; 4]);
    for (k, (a, b)) in plain.events.iter().zip(&tiled.events).enumerate() {
        assert_eq!(a, b, "{name}: event {k}");
    }
    assert_eq!(plain.events.len(), tiled.events.len(), "{name}");
    assert_eq!(plain.hash, tiled.hash, "{name}");
    // Sums of the ledger are taken in another order.
    assert!(tiled.residual.abs() < 1e-14, "{name}: {}", tiled.residual);
    tiled.seen
}

#[test]
fn tiles_change_nothing() {
    let mut taken_back = 0;
    for (packing_fraction, e) in [(0.01, 1.0), (0.1, 1.0), (0.3, 1.0), (0.45, 1.0), (0.1, 0.7), (0.3, 0.9)] {
        let name = format!("phi {packing_fraction}, e {e}");
        let [windows, collisions, void, _] = same(&name, &common::gas(14, packing_fraction, e, 5), 12);
        assert!(windows > 0 && collisions > 5000, "{name}: {windows} windows, {collisions} collisions");
        taken_back += void;
    }
    // Otherwise nothing was there to go wrong.
    assert!(taken_back > 100, "{taken_back}");
}

#[test]
fn tiles_change_nothing_for_disks_and_mixtures() {
    let [windows, ..] = same("disks", &common::disks(60, 0.4, 3), 10);
    assert!(windows > 5);
    let [windows, ..] = same("sizes", &common::polydisperse(14, 0.2, 3), 10);
    assert!(windows > 5);
}

/// Every event of a crystal with equal speeds has others in its tick, of the same particles too.
#[test]
fn simultaneous_events_are_taken_in_their_order() {
    let mut system = common::system(Dimension::Three, DVec3::splat(24.0), [Boundary::Periodic; 3]);
    let grain = common::class(&mut system, 0.5, 1.0);
    for k in 0..16_u32.pow(3) {
        let place = [k % 16, k / 16 % 16, k / 256].map(f64::from);
        let sign = |axis: usize| if (place[axis] as u32).is_multiple_of(2) { 1.0 } else { -1.0 };
        let velocity = DVec3::new(sign(0), sign(1), sign(2));
        common::add(&mut system, grain, (DVec3::from_array(place) + 0.5) * 1.5, velocity);
    }
    let [.., again] = same("crystal", &system, 8);
    assert!(again > 0, "nothing was simultaneous");
}
