//! Which systems the scheduler supports, and how its lists are laid out for one.

use glam::DVec3;
use haff_neighbors::{Axis, Geometry};

use super::frame::Frame;
use crate::{
    model::{Boundary, System},
    summary::{LocalDensity, SystemSummary},
    tuning::particles::SHORT_LISTS,
};

/// Members that a list shall have: with what it fluctuates, two groups of the filter hold it. Where members
/// come from memory ([`SHORT_LISTS`]), fewer.
const MEMBERS: [f64; 2] = [14.5, 10.0];
/// Distances at which particles become neighbors, at least and at most [mean diameters].
const SHELL: [f64; 2] = [1.3, 2.5];
/// A particle near one wall is predicted against all: there may be so many.
const FEW_WALLS: usize = 16;
/// Radii may differ by this factor: the bins are made for the largest.
const SIZE_RATIO: f64 = 2.0;

/// Whether this scheduler supports a system, if its box is large enough.
pub(crate) fn supports(system: &System, summary: &SystemSummary) -> bool {
    summary.count < i32::MAX as usize
        && system.domain.gravity == DVec3::ZERO
        && system.walls.len() <= FEW_WALLS
        && (0..system.dimension.count()).all(|axis| system.domain.boundary[axis] != Boundary::Open)
        && !is_wide(summary)
}

/// Whether sizes differ too much for its bins.
pub(crate) fn is_wide(summary: &SystemSummary) -> bool {
    summary.largest > SIZE_RATIO * summary.least
}

/// What this engine knows of a system before it starts.
pub(super) struct Plan {
    pub frame: Frame,
    /// Radius of the balls, and the edges, 0 where nothing moves [largest contact distances].
    pub half: f64,
    pub edges: [f64; 3],
    /// Mean distance of neighbors [largest contact distances].
    pub spacing: f64,
    /// Members that a list has on average, where particles are as near as their neighbors.
    pub members: f64,
}

impl Plan {
    /// `None` if this scheduler does not support the system.
    pub fn new(
        geometry: &Geometry,
        system: &System,
        summary: &SystemSummary,
        density: &LocalDensity,
    ) -> Option<Self> {
        if summary.count == 0 || !supports(system, summary) {
            return None;
        }
        let sigma = geometry.reach;
        let flat = summary.dimension == 2;
        let ball = if flat { std::f64::consts::PI } else { 4.0 / 3.0 * std::f64::consts::PI };
        let spacing = summary.spacing(density.packing) / sigma;
        let members = MEMBERS[usize::from(summary.count >= SHORT_LISTS)];
        let volume = (members + 1.0) * spacing.powi(summary.dimension) / ball;
        let shell = libm::pow(volume, 1.0 / f64::from(summary.dimension));
        let mean = 2.0 * summary.mean / sigma;
        let half = 0.5 * ((shell / mean).clamp(SHELL[0], SHELL[1]) - 1.0) * mean;
        // Centers of neighbors are a contact distance and two radii apart, and they themselves up to two
        // more.
        let frame = Frame::new(geometry, (1.01 + 4.0 * half) * sigma)?;
        let edges =
            [0, 1, 2].map(|k| if geometry.axes[k] == Axis::Flat { 0.0 } else { frame.period[k] / sigma });
        let members = ball * ((mean + 2.0 * half) / spacing).powi(summary.dimension) - 1.0;
        Some(Self { frame, half, edges, spacing, members })
    }
}
