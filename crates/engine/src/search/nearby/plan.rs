//! Which systems the scheduler supports, and how its lists are laid out for one.

use glam::DVec3;
use haff_neighbors::Axis;

use crate::{
    model::{Boundary, System, Wall, thresholds::Thresholds},
    numerics::tuning::particles::SHORT_LISTS,
    search::{
        case::{Case, MAY_SETTLE, Reason, SLIDING_IMAGES},
        summary::{LocalDensity, SystemSummary},
    },
    state::world::can_carry,
    support::geometry::axes,
};

use super::frame::Frame;

/// Mean number of members of a list. With the first value most lists, fluctuations included, fit into two
/// vectors of the filter. The second is for systems of [`SHORT_LISTS`] particles and more: there each member
/// costs more, because it is not in the second-level cache.
const MEMBERS: [f64; 2] = [14.5, 10.0];
/// Smallest and largest distance at which particles become neighbors [mean diameters].
const SHELL: [f64; 2] = [1.3, 2.5];
/// Largest number of walls: for a particle near one wall the contacts with all walls are predicted.
const MAX_WALLS: usize = 16;
/// Largest ratio of two radii: the width of the bins is that for the largest radius.
const SIZE_RATIO: f64 = 2.0;

/// Whether this scheduler can run a case.
///
/// # Errors
/// Why it cannot.
pub(crate) fn can_run(case: &Case) -> Result<(), Reason> {
    Plan::new(case.system, case.summary, case.density).map(|_| ())
}

/// Whether sizes differ too much for the bins.
pub(crate) fn is_wide(summary: &SystemSummary) -> bool {
    summary.largest > SIZE_RATIO * summary.least
}

/// The layout of the lists for one system, made before the run.
#[derive(Debug, Clone)]
pub(super) struct Plan {
    pub frame: Frame,
    /// Half of the skin [largest contact distances].
    pub half_skin: f64,
    /// Edges of the box, 0 along an axis without motion [largest contact distances].
    pub edges: [f64; 3],
    /// Mean distance of neighbors [largest contact distances].
    pub spacing: f64,
    /// Mean number of members of a list where the distance of neighbors is `spacing`.
    pub members: f64,
}

impl Plan {
    /// The layout for a system at this density.
    ///
    /// # Errors
    /// Why the scheduler cannot run the system.
    pub fn new(system: &System, summary: &SystemSummary, density: &LocalDensity) -> Result<Self, Reason> {
        if summary.count == 0 {
            return Err(Reason::new("there are no particles"));
        }
        if summary.count >= i32::MAX as usize {
            return Err(Reason::new(format!("there are more than {} particles", i32::MAX)));
        }
        if Thresholds::of(system).is_some() {
            return Err(Reason::new(MAY_SETTLE));
        }
        if system.domain.gravity != DVec3::ZERO {
            return Err(Reason::new("there is gravity"));
        }
        if can_carry(system) {
            return Err(Reason::new("an oscillating wall may carry grains"));
        }
        if system.domain.shear.is_some() {
            return Err(Reason::new(SLIDING_IMAGES));
        }
        if system.walls.len() > MAX_WALLS {
            return Err(Reason::new(format!("there are more than {MAX_WALLS} walls")));
        }
        if is_wide(summary) {
            return Err(Reason::new(format!("radii differ by more than {SIZE_RATIO} times")));
        }
        let sigma = summary.contact;
        let flat = summary.dimension == 2;
        // Area of the unit circle or volume of the unit sphere.
        let unit_sphere = if flat { std::f64::consts::PI } else { 4.0 / 3.0 * std::f64::consts::PI };
        let spacing = summary.spacing(density.packing) / sigma;
        let members = MEMBERS[usize::from(summary.count >= SHORT_LISTS)];
        let volume = (members + 1.0) * spacing.powi(summary.dimension) / unit_sphere;
        let shell = libm::pow(volume, 1.0 / f64::from(summary.dimension));
        let mean = 2.0 * summary.mean / sigma;
        let half_skin = 0.5 * ((shell / mean).clamp(SHELL[0], SHELL[1]) - 1.0) * mean;
        // Reference positions of neighbors are at most a contact distance and the skin apart, and each
        // particle is at most half of the skin from its reference position.
        let axes = axes(system);
        let reach = (1.01 + 4.0 * half_skin) * sigma;
        let frame = Frame::new(axes, system.domain.size, sigma, reach)?;
        if is_beyond_faces(system, reach) {
            return Err(Reason::new("walls are farther beyond the faces of the box than lists reach"));
        }
        let edges = [0, 1, 2].map(|k| if axes[k] == Axis::Flat { 0.0 } else { frame.period[k] / sigma });
        let members = unit_sphere * ((mean + 2.0 * half_skin) / spacing).powi(summary.dimension) - 1.0;
        Ok(Self { frame, half_skin, edges, spacing, members })
    }
}

/// Whether walls let particles go beyond the faces of the box along an axis by more than `reach` \[length\],
/// on both sides together: coordinates of lists repeat at that distance behind the upper face, and a particle
/// below the lower one would be taken for one that is far from both walls.
fn is_beyond_faces(system: &System, reach: f64) -> bool {
    let beyond = |axis: usize, side: f64| {
        let face = if side > 0.0 { 0.0 } else { system.domain.size[axis] };
        let walls = system.walls.iter().filter(|wall| wall.normal[axis] == side);
        let depth = |wall: &Wall| (face - wall.point[axis]) * side + wall.motion.sweep(wall.normal);
        // A wall that moves on and on is tested by all particles.
        walls.map(depth).filter(|depth| depth.is_finite()).fold(0.0, f64::max)
    };
    let bounded = |&axis: &usize| system.domain.boundary[axis] == Boundary::Wall;
    (0..system.dimension.count()).filter(bounded).any(|axis| beyond(axis, 1.0) + beyond(axis, -1.0) > reach)
}
