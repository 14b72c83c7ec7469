//! The present of a run that goes on with changed keys.

use glam::DVec3;
use haff_engine::{Instant, Simulation, Wall};

/// What the checks of changed keys need of the present state.
#[derive(Debug, Clone, PartialEq)]
pub struct Present {
    /// Now.
    pub at: Instant,
    /// The walls, whose motions go on; pistons as they are now.
    pub walls: Vec<Wall>,
    /// Row, position \[length\] and radius \[length\] of every body of infinite mass.
    pub fixed: Vec<(usize, DVec3, f64)>,
}

impl Present {
    /// The present of a simulation.
    pub fn of(simulation: &Simulation) -> Self {
        let properties = simulation.properties();
        let is_fixed = |row: &usize| properties[*row].1 == f64::INFINITY;
        let rows: Vec<usize> = (0..properties.len()).filter(is_fixed).collect();
        let positions = if rows.is_empty() { Vec::new() } else { simulation.frame().position };
        Self {
            at: simulation.instant(),
            walls: simulation.present_walls(),
            fixed: rows.into_iter().map(|row| (row, positions[row], properties[row].0)).collect(),
        }
    }
}
