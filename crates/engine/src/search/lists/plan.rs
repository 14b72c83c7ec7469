//! Which systems the scheduler supports, and how its lists are laid out for one.

use glam::DVec3;
use haff_neighbors::{Axis, beyond_faces};

use crate::{
    model::System,
    numerics::tuning::particles::SHORT_LISTS,
    search::{
        case::{Case, HAS_PISTONS, Reason},
        summary::{LocalDensity, SystemSummary},
    },
    support::geometry::{axes, planes},
};

use super::{
    frame::{self, Extent, FilterFrame},
    moving::{LARGEST_CHANGE, MovingFrame},
};

/// Mean number of members of a list. With the first value most lists, fluctuations included, fit into two
/// vectors of the filter. The second is for systems of [`SHORT_LISTS`] particles and more: there each member
/// costs more, because it is not in the second-level cache.
const MEMBERS: [f64; 2] = [14.5, 10.0];
/// Contact distance with a margin [largest contact distances].
const CONTACT: f64 = 1.01;
/// Lists are profitable if the skin with which they are fastest is thicker than theirs by at most this
/// factor.
const ROOM: f64 = 1.5;
/// Thinnest half of the skin with which lists are made [largest contact distances].
const THINNEST: f64 = 0.01;
/// Mean number of members of a list in a dilute system, in which a thinner shell would be left many times
/// between two contacts (choice.md).
const DILUTE: f64 = 3.0;
/// Largest distance at which particles become neighbors in a dilute system: in open space there is no limit
/// to their distances [mean diameters].
const FARTHEST: f64 = 20.0;
/// Smallest and largest distance at which particles become neighbors, except in dilute systems [mean
/// diameters].
const SHELL: [f64; 2] = [1.3, 2.5];

/// Under gravity particles leave their skin spheres when their distance from the reference position is this
/// part of half of the skin. The rest is how far a path is allowed to bend away from its chord.
pub(super) const STRAIGHT: f64 = 0.9;

/// Whether this scheduler can run a case.
///
/// # Errors
/// Why it cannot.
pub(crate) fn can_run(case: &Case) -> Result<(), Reason> {
    Plan::new(case.system, case.summary, case.density).map(|_| ())
}

/// The layout of the lists for one system, made before the run.
#[derive(Debug, Clone)]
pub(super) struct Plan {
    pub frame: FilterFrame,
    /// Half of the skin [largest contact distances].
    pub half_skin: f64,
    /// That with which lists are fastest in a large box.
    fastest: f64,
    /// By how much contact distances are larger in lengths of the lists [largest contact distances].
    pub strain: f64,
    /// The axes of the box; one along which a wall moves on and on is open.
    pub axes: [Axis; 3],
    /// Edges of the box, 0 along an axis without motion [largest contact distances].
    pub edges: [f64; 3],
    /// Coordinates above this are of particles below the lower face [largest contact distances].
    pub highest: [f64; 3],
    /// Mean distance of neighbors [largest contact distances].
    pub spacing: f64,
    /// Mean number of members of a list where the distance of neighbors is `spacing`.
    pub members: f64,
}

/// Whether lists have room for their skins: in a small box they are thin, and left often. Where edges change,
/// thin skins are still faster than cells (choice.md).
pub(crate) fn is_profitable(case: &Case) -> bool {
    let changes = MovingFrame::of(case.system).is_some_and(|frame| frame.axes.stretches());
    Plan::new(case.system, case.summary, case.density)
        .is_ok_and(|plan| changes || plan.fastest <= ROOM * plan.half_skin)
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
        if system.piston_count() > 0 {
            return Err(Reason::new(HAS_PISTONS));
        }
        if summary.count >= i32::MAX as usize {
            return Err(Reason::new(format!("there are more than {} particles", i32::MAX)));
        }
        let sigma = summary.contact;
        let flat = summary.dimension == 2;
        // Area of the unit circle or volume of the unit sphere.
        let unit_sphere = if flat { std::f64::consts::PI } else { 4.0 / 3.0 * std::f64::consts::PI };
        let spacing = summary.spacing(density.packing) / sigma;
        let members = MEMBERS[usize::from(summary.count >= SHORT_LISTS)];
        // Radius of the sphere with this many other particles.
        let sphere_of = |members: f64| {
            let volume = (members + 1.0) * spacing.powi(summary.dimension) / unit_sphere;
            libm::pow(volume, 1.0 / f64::from(summary.dimension))
        };
        let shell = sphere_of(members);
        let mean = 2.0 * summary.mean / sigma;
        let (mut kinds, mut size) = (axes(system), system.domain.size);
        let beyond = beyond_faces(kinds, size, &planes(system));
        let moving = MovingFrame::of(system);
        let strain = moving.map_or(0.0, |moving| moving.strain());
        // The shortest edges, for a distance that is longer along them in coordinates.
        let mut shortest = size;
        if let Some(moving) = &moving {
            // Only without walls: then axes are all alike but for their lengths.
            size = DVec3::from_array(moving.axes.ordered(size));
            kinds = moving.axes.order.map(|axis| kinds[axis]);
            shortest = size * moving.axes.shortest();
            shortest.x /= 1.0 + moving.largest_tilt();
        }
        // Where a wall moves on and on, there is no limit to positions.
        let is_endless = |k: usize| beyond[k].contains(&f64::INFINITY);
        let axes = [0, 1, 2].map(|k| if is_endless(k) { Axis::Open } else { kinds[k] });
        // In a small box the skin is thinner than would be fastest.
        let change = if moving.is_some() { LARGEST_CHANGE } else { 0.0 };
        let longest = (0..3).map(|k| frame::longest_reach(axes[k], shortest[k], beyond[k], sigma, change));
        let thickest = 0.25 * (longest.fold(f64::INFINITY, f64::min) / sigma - CONTACT - strain);
        if thickest < THINNEST {
            return Err(Reason::new("an edge is too short for images of lists"));
        }
        let shell = (shell / mean).clamp(SHELL[0], SHELL[1]) * mean;
        let fastest = 0.5 * (shell.max(sphere_of(DILUTE).min(FARTHEST * mean)) - mean - strain * mean);
        let half_skin = fastest.min(thickest);
        // Reference positions of neighbors are at most a contact distance and the skin apart, and each
        // particle is at most half of the skin from its reference position.
        let reach = (CONTACT + strain + 4.0 * half_skin) * sigma;
        let frame = FilterFrame::new(&Extent {
            axes,
            size,
            beyond,
            contact: [sigma, 2.0 * summary.least],
            reach,
            gravity: system.domain.gravity,
            bend: (1.0 - STRAIGHT) * half_skin,
            moving,
        })?;
        // In the middle of what has been added to the edge.
        let highest = [0, 1, 2].map(|k| match axes[k] {
            Axis::Bounded => (size[k] + beyond[k][1] + 0.5 * reach) / sigma,
            _ => f64::INFINITY,
        });
        let edges = [0, 1, 2].map(|k| if axes[k] == Axis::Flat { 0.0 } else { frame.period[k] / sigma });
        let members = unit_sphere * ((mean + 2.0 * half_skin) / spacing).powi(summary.dimension) - 1.0;
        Ok(Self { frame, half_skin, fastest, strain, axes, edges, highest, spacing, members })
    }
}
