//! Triangle meshes.

mod clearance;
mod topology;
mod tree;
mod triangle;

use glam::DVec3;
use haff_mechanics::{RelativeFlight, Surface};

pub use triangle::Triangle;

use crate::part::{Part, SHORTER, Side, contact_normal, first_in_step, gradient, time_for};
use clearance::Clearance;
use tree::{Bounds, Tree};

/// A triangle mesh, with particles inside, outside or on both sides.
#[derive(Debug, Clone, PartialEq)]
pub struct Mesh {
    triangles: Vec<Triangle>,
    tree: Tree,
    /// None for a mesh in a plane.
    clearance: Option<Clearance>,
    side: Side,
    is_closed: bool,
    center: DVec3,
    extent: f64,
}

/// Why triangles are no mesh.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum MeshError {
    /// There is none.
    #[error("has no triangles")]
    Empty,
    /// A corner is not a number.
    #[error("triangle {face} has a corner that is not finite: ({}, {}, {})", corner.x, corner.y, corner.z)]
    NotFinite {
        /// Its number.
        face: usize,
        /// The corner.
        corner: DVec3,
    },
    /// A triangle without area.
    #[error("triangle {face} has no area: its corners are on a line")]
    Flat {
        /// Its number.
        face: usize,
    },
    /// Neighbors cannot all have their normals on one side.
    #[error(
        "is not orientable: triangles beside the edge from ({}, {}, {}) to ({}, {}, {}) have their normals on different sides however \
         they are turned",
        from.x, from.y, from.z, to.x, to.y, to.z
    )]
    NotOrientable {
        /// One end of the edge.
        from: DVec3,
        /// The other end.
        to: DVec3,
    },
    /// A side is given, and the mesh does not close a volume.
    #[error(
        "is not closed: the edge from ({}, {}, {}) to ({}, {}, {}) belongs to {faces} triangle{}, not to two",
        from.x, from.y, from.z, to.x, to.y, to.z, if *faces == 1 { "" } else { "s" }
    )]
    Open {
        /// One end of the edge.
        from: DVec3,
        /// The other end.
        to: DVec3,
        /// The number of its triangles.
        faces: usize,
    },
}

/// Directions in which a position is tested to be inside: no edges of usual meshes are along them.
const RAYS: [DVec3; 3] = [
    DVec3::new(0.539_124_7, 0.297_311_9, 0.788_016_1),
    DVec3::new(-0.312_887_1, 0.871_450_3, 0.377_812_9),
    DVec3::new(0.151_902_7, -0.482_771_3, 0.862_481_9),
];

impl Mesh {
    /// The mesh of these triangles, which may be turned.
    ///
    /// # Errors
    /// Triangles that are no mesh, or do not close a volume where `side` needs one.
    pub fn new(corners: &[[DVec3; 3]], side: Side) -> Result<Self, MeshError> {
        if corners.is_empty() {
            return Err(MeshError::Empty);
        }
        let mut triangles = Vec::with_capacity(corners.len());
        for (face, &corners) in corners.iter().enumerate() {
            if let Some(&corner) = corners.iter().find(|corner| !corner.is_finite()) {
                return Err(MeshError::NotFinite { face, corner });
            }
            triangles.push(Triangle::new(corners).ok_or(MeshError::Flat { face })?);
        }
        let open_edge = topology::orient(&mut triangles)?;
        if let (Some((from, to, faces)), false) = (open_edge, side == Side::Both) {
            return Err(MeshError::Open { from, to, faces });
        }
        let tree = Tree::new(&mut triangles);
        let Bounds { low, high } = tree.bounds();
        let center = 0.5 * (low + high);
        let extent = 0.5 * (high - low).length();
        let mut mesh =
            Self { triangles, tree, clearance: None, side, is_closed: open_edge.is_none(), center, extent };
        if (high - low).min_element() > 0.0 {
            let distance = |position| mesh.offset(position).length();
            mesh.clearance = Some(Clearance::new([low, high], mesh.triangles.len(), distance));
        }
        Ok(mesh)
    }

    /// Its triangles.
    #[must_use]
    pub fn triangles(&self) -> &[Triangle] {
        &self.triangles
    }

    /// Whether it closes a volume.
    #[must_use]
    pub fn is_closed(&self) -> bool {
        self.is_closed
    }

    /// The volume that it closes \[length³\]: one sixth of the sum of the triple products of corners.
    #[must_use]
    pub fn volume(&self) -> f64 {
        let product = |triangle: &Triangle| {
            let [a, b, c] = triangle.corners.map(|corner| corner - self.center);
            a.dot(b.cross(c))
        };
        (self.triangles.iter().map(product).sum::<f64>() / 6.0).abs()
    }

    /// The vector to a position from the nearest point, if that is at most at a distance \[length\].
    fn offset_within(&self, position: DVec3, distance: f64) -> Option<DVec3> {
        let mut least = distance * distance * (1.0 + 1e-15);
        let mut nearest = None;
        self.tree.visit(
            // Boxes at the same distance count, too: limits are exclusive.
            least.next_up(),
            |bounds| bounds.distance_squared(position),
            |leaf| {
                for triangle in &self.triangles[leaf] {
                    let r = triangle.offset(position);
                    if r.length_squared() <= least {
                        least = r.length_squared();
                        nearest = Some(r);
                    }
                }
                least.next_up()
            },
        );
        nearest
    }

    /// Whether a position is inside of a closed mesh: lines from there cross it an odd number of times. The
    /// majority of three lines decides, since one may run through an edge.
    #[must_use]
    pub fn contains(&self, position: DVec3) -> bool {
        let is_odd = |direction: DVec3| {
            let mut crossings = 0_usize;
            let line = Line::new(position, direction, 0.0, f64::INFINITY);
            self.tree.visit(
                f64::INFINITY,
                // Each box counts, in any order.
                |bounds| if line.enters(bounds).is_nan() { f64::NAN } else { 0.0 },
                |leaf| {
                    crossings += self.triangles[leaf]
                        .iter()
                        .filter(|triangle| crosses(triangle, position, direction))
                        .count();
                    f64::INFINITY
                },
            );
            crossings % 2 == 1
        };
        let [first, second, third] = RAYS;
        let inside = is_odd(first);
        if is_odd(second) == inside { inside } else { is_odd(third) }
    }

    /// Offers the triangles in whose reach a flight comes between two times, `offer` returns the time after
    /// which no contact is wanted.
    fn sweep(
        &self,
        flight: &RelativeFlight,
        radius: f64,
        [from, until]: [f64; 2],
        mut offer: impl FnMut(&Triangle) -> f64,
    ) {
        let visit = |leaf: std::ops::Range<usize>, offer: &mut dyn FnMut(&Triangle) -> f64| {
            self.triangles[leaf].iter().map(offer).fold(f64::INFINITY, f64::min)
        };
        if flight.is_straight() {
            let line = Line::new(flight.position, flight.velocity, radius, until);
            self.tree.visit(f64::INFINITY, |bounds| line.enters(bounds), |leaf| visit(leaf, &mut offer));
            return;
        }
        // The box around the path.
        let (position, speed) = (flight.at(from), flight.velocity_at(from).length());
        let duration = until - from;
        let mut reach = DVec3::splat(radius);
        let (low, high) = if flight.swing.is_some() {
            reach += (speed + 0.5 * flight.strength() * duration) * duration;
            (position, position)
        } else {
            // A parabola is in the triangle of its ends and of where the tangents meet.
            let (end, tangent) = (flight.at(until), position + flight.velocity_at(from) * (0.5 * duration));
            (position.min(end).min(tangent), position.max(end).max(tangent))
        };
        // Rounding of positions.
        reach += (low.abs().max(high.abs()) + radius) * 1e-12;
        let (low, high) = (low - reach, high + reach);
        self.tree.visit(
            f64::INFINITY,
            |bounds| {
                if bounds.low.cmple(high).all() && bounds.high.cmpge(low).all() { from } else { f64::NAN }
            },
            |leaf| visit(leaf, &mut offer),
        );
    }
}

/// A straight flight, for tests of boxes: without a division for each.
struct Line {
    /// The position, and how near a box counts along each axis: added to it and taken off \[length\].
    position: [DVec3; 2],
    /// Time per length; infinite along an axis without motion [time/length].
    inverse: DVec3,
    /// The end of the flight \[time\].
    until: f64,
}

impl Line {
    fn new(position: DVec3, velocity: DVec3, radius: f64, until: f64) -> Self {
        let slack = radius + (position.abs() + radius) * 1e-12;
        Self { position: [position + slack, position - slack], inverse: velocity.recip(), until }
    }

    /// The time at which the flight first is at most a radius from a box along each axis; NaN if it never is
    /// before its end.
    #[inline]
    fn enters(&self, bounds: &Bounds) -> f64 {
        let (a, b) =
            ((bounds.low - self.position[0]) * self.inverse, (bounds.high - self.position[1]) * self.inverse);
        let first = a.min(b).max_element().max(0.0) * (1.0 - 1e-12);
        let last = a.max(b).min_element().min(self.until);
        // Times are rounded.
        if first <= last { first } else { f64::NAN }
    }
}

/// Whether a line from a position in a direction crosses a triangle (T. Möller and B. Trumbore, J. Graphics
/// Tools 2, 21 (1997)).
fn crosses(triangle: &Triangle, position: DVec3, direction: DVec3) -> bool {
    let [a, b, c] = triangle.corners;
    let (ab, ac) = (b - a, c - a);
    let p = direction.cross(ac);
    let determinant = ab.dot(p);
    if determinant == 0.0 {
        return false;
    }
    let r = position - a;
    let u = r.dot(p) / determinant;
    let q = r.cross(ab);
    let v = direction.dot(q) / determinant;
    u >= 0.0 && v >= 0.0 && u + v <= 1.0 && ac.dot(q) / determinant > 0.0
}

impl Part for Mesh {
    fn offset(&self, position: DVec3) -> DVec3 {
        self.offset_within(position, f64::INFINITY).unwrap_or(DVec3::INFINITY)
    }
}

impl Surface for Mesh {
    fn distance(&self, position: DVec3) -> f64 {
        let distance = self.offset(position).length();
        match self.side {
            Side::Both => distance,
            side if self.contains(position) == (side == Side::Inside) => distance,
            _ => -distance,
        }
    }

    fn normal(&self, position: DVec3) -> DVec3 {
        let r = self.offset(position);
        gradient(r, self.distance(position)).unwrap_or(self.triangles[0].normal)
    }

    /// No bound: contacts are found by the triangles.
    fn curvature(&self, _low: f64, _high: f64) -> f64 {
        f64::INFINITY
    }

    fn bounds(&self) -> (DVec3, f64) {
        (self.center, self.extent)
    }

    fn enclosure(&self) -> Option<[DVec3; 2]> {
        let Bounds { low, high } = self.tree.bounds();
        (self.side == Side::Inside).then_some([low, high])
    }

    fn approach(&self, position: DVec3, velocity: DVec3) -> (f64, f64) {
        Part::approach(self, position, velocity)
    }

    fn is_near(&self, position: DVec3, reach: f64) -> bool {
        match self.clearance.as_ref().and_then(|clearance| clearance.at(position)) {
            // Where this is not exact, the walk along the flight is faster than one to the nearest point.
            Some(clearance) => clearance <= reach,
            None => self.offset_within(position, reach.max(0.0)).is_some(),
        }
    }

    fn contact_normal(&self, position: DVec3, velocity: DVec3, reach: f64) -> DVec3 {
        let mut near: Vec<&Triangle> = Vec::new();
        let limit = (reach * reach).next_up();
        self.tree.visit(
            limit,
            |bounds| bounds.distance_squared(position),
            |leaf| {
                near.extend(&self.triangles[leaf]);
                limit
            },
        );
        contact_normal(near.into_iter(), position, velocity, reach).unwrap_or_else(|| self.normal(position))
    }

    /// For straight flights one walk through the tree along the line; for others steps to where the sphere
    /// can touch something, and short ones there.
    fn time_to_contact(&self, flight: &RelativeFlight, radius: f64, within: f64) -> Option<f64> {
        if flight.misses(self.center, self.extent + radius) {
            return None;
        }
        let strength = flight.strength();
        let mut time = 0.0;
        while time <= within {
            let speed = flight.velocity_at(time).length();
            let mut step = f64::INFINITY;
            let mut is_free = false;
            if !flight.is_straight() {
                let free = self.offset(flight.at(time)).length() - radius;
                is_free = free > PATH * radius;
                let path = if is_free { free * (1.0 - SHORTER) } else { PATH * radius };
                step = time_for(path, speed, strength).min(flight.time_to_jump(time));
            }
            if step.is_nan() || time + step <= time {
                return None;
            }
            if is_free {
                time += step;
                continue;
            }
            // What is found must not depend on `within`, only whether it is.
            let stop = step.min(within - time);
            let mut first = f64::INFINITY;
            let is_straight = flight.is_straight();
            self.sweep(flight, radius, [time, time + stop], |triangle| {
                let of_face = if is_straight {
                    triangle.time_to_face(flight.position, flight.velocity, radius)
                } else {
                    None
                };
                let found = of_face
                    .or_else(|| first_in_step(triangle, flight, radius, time, [step, stop.min(first)]));
                first = first.min(found.unwrap_or(f64::INFINITY));
                time + first
            });
            if first < f64::INFINITY {
                return Some(time + first);
            }
            time += step;
        }
        Some(f64::INFINITY)
    }
}

/// Path of a step near the mesh in a flight that is not straight [radii].
const PATH: f64 = 1.0;
