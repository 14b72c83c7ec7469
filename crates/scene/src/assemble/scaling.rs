//! States of files in a box of another size: `initial.positions = { file = …, scale_to = […] }`.

use glam::DVec3;

use super::values::{at, positive};
use super::{Assembler, Refused};
use crate::model::state::State;

/// Largest relative difference of the factors along two axes.
const TOLERANCE: f64 = 1e-12;

impl Assembler<'_> {
    /// The state with its box scaled to the edge lengths `to`: positions and radii are multiplied by the same
    /// factor, velocities stay. Its masses are left to the scene.
    pub(super) fn scaled(&mut self, mut state: State, to: &[f64]) -> Result<State, Refused> {
        let path = at(["initial", "positions", "scale_to"]);
        let d = self.dimension.count();
        if to.len() != d {
            self.document.refuse(&path, format!("must have {d} numbers, one per dimension"));
            return Err(Refused);
        }
        for (k, &length) in to.iter().enumerate() {
            let element: Vec<String> = path.iter().cloned().chain([k.to_string()]).collect();
            if !positive(&mut self.document, &element, length) {
                return Err(Refused);
            }
        }
        let Some(size) = state.size.filter(|size| (0..d).all(|axis| size[axis] > 0.0)) else {
            self.document.report(&path, "the file has no box that can be scaled");
            return Err(Refused);
        };
        let mut factors = DVec3::ONE;
        for axis in 0..d {
            factors[axis] = to[axis] / size[axis];
        }
        let factor = factors[0];
        let most = TOLERANCE.max(state.precision);
        let agrees = |axis: usize| (factors[axis] / factor - 1.0).abs() <= most;
        if !(1..d).all(agrees) || !factor.is_finite() {
            let edges: Vec<String> = (0..d).map(|axis| size[axis].to_string()).collect();
            let message =
                format!("must be the edges of the box of the file, [{}], times one factor", edges.join(", "));
            self.document.refuse(&path, message);
            return Err(Refused);
        }
        for (axis, &length) in to.iter().enumerate() {
            if let Some(size) = &mut state.size {
                size[axis] = length;
            }
        }
        for position in &mut state.position {
            *position *= factors;
        }
        for radius in &mut state.radius {
            *radius *= factor;
        }
        if let Some(edges) = &mut state.sheared_edges {
            for edge in edges {
                *edge *= factors;
            }
        }
        state.mass = None;
        Ok(state)
    }
}
