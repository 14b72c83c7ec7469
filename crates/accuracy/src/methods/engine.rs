//! The engine under test.

use std::time::Instant;

use haff_engine::{Boundary, Options, Silent, Simulation, System, Until};

use super::{Method, Run, State};
use crate::Error;

/// haff's engine with its options.
#[derive(Debug, Clone, Copy, Default)]
pub struct Engine(pub Options);

impl Method for Engine {
    fn name(&self) -> &'static str {
        "haff"
    }

    fn parameter(&self) -> String {
        String::new()
    }

    fn value(&self) -> Option<f64> {
        None
    }

    fn run(&self, system: &System, times: &[f64]) -> Result<Run, Error> {
        let periodic = system.domain.boundary == [Boundary::Periodic; 3];
        let volume = system.domain.size.to_array().iter().product::<f64>();
        let system = system.clone();
        let mut states = Vec::with_capacity(times.len());
        let start = Instant::now();
        let mut simulation = Simulation::new(system, self.0)?;
        // The pressure is measured since the previous sample.
        let before = periodic.then(|| simulation.sample());
        for &time in times {
            simulation.advance(Until { time, ..Until::default() }, &mut Silent)?;
            let frame = simulation.frame();
            states.push(State { position: frame.position, velocity: frame.velocity });
        }
        let compressibility = before.and_then(|before| {
            let after = simulation.sample();
            // Exact without energy loss; with loss, the mean over time is not that of the two ends.
            let elastic = after.ledger.dissipated == before.ledger.dissipated;
            let pressure = after.pressure.filter(|_| elastic)?;
            Some(1.5 * pressure * volume / after.ledger.kinetic)
        });
        let wall = start.elapsed();
        let counters = simulation.counters();
        Ok(Run { states, wall, steps: counters.collisions + counters.wall_collisions, compressibility })
    }
}
