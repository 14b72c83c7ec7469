//! A triangle: the nearest point of a position.

use glam::DVec3;

use crate::part::{Bend, Moment, Part};

/// A triangle with its unit normal by the right-hand rule.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Triangle {
    /// Its corners \[length\].
    pub corners: [DVec3; 3],
    /// Unit normal.
    pub normal: DVec3,
}

impl Triangle {
    /// `None` if the corners are on a line, or not finite.
    #[must_use]
    pub fn new(corners: [DVec3; 3]) -> Option<Self> {
        let [a, b, c] = corners;
        let (ab, ac) = (b - a, c - a);
        // Scaled, so that tiny and huge triangles do not under- or overflow.
        let scale = ab.abs().max(ac.abs()).max_element();
        let area = (ab / scale).cross(ac / scale);
        let normal = area.normalize();
        (area.length() > FLAT && normal.is_finite()).then_some(Self { corners, normal })
    }

    /// The box around it: lower and upper corner \[length\].
    #[must_use]
    pub fn bounds(&self) -> (DVec3, DVec3) {
        let [a, b, c] = self.corners;
        (a.min(b).min(c), a.max(b).max(c))
    }
}

impl Triangle {
    /// The time at which a sphere that moves along a line touches the inside of the triangle, before any
    /// other part of it \[time\]; `None` if it touches an edge first, or nothing.
    #[must_use]
    pub fn time_to_face(&self, position: DVec3, velocity: DVec3, radius: f64) -> Option<f64> {
        let [a, b, c] = self.corners;
        let (height, rate) = ((position - a).dot(self.normal), velocity.dot(self.normal));
        let (gap, speed) = (height.abs() - radius, -rate * height.signum());
        if gap < 0.0 || speed <= 0.0 {
            return None;
        }
        let time = gap / speed;
        let foot = position + velocity * time;
        let is_inside = |from: DVec3, to: DVec3| {
            (to - from).cross(foot - from).dot(self.normal) > EDGE * (to - from).length_squared()
        };
        (is_inside(a, b) && is_inside(b, c) && is_inside(c, a)).then_some(time)
    }
}

/// A foot nearer to an edge than this part of its length counts as one on the edge.
const EDGE: f64 = 1e-9;

/// Twice the least area [squared longest edge].
const FLAT: f64 = 1e-12;

impl Part for Triangle {
    /// By the regions of the plane in which a corner, an edge or the inside is the nearest (C. Ericson,
    /// Real-Time Collision Detection, 5.1.5).
    #[inline]
    fn offset(&self, position: DVec3) -> DVec3 {
        let [a, b, c] = self.corners;
        let (ab, ac, ap) = (b - a, c - a, position - a);
        let (d1, d2) = (ab.dot(ap), ac.dot(ap));
        if d1 <= 0.0 && d2 <= 0.0 {
            return ap;
        }
        let bp = position - b;
        let (d3, d4) = (ab.dot(bp), ac.dot(bp));
        if d3 >= 0.0 && d4 <= d3 {
            return bp;
        }
        if d1 * d4 - d3 * d2 <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
            return across(ap, ab);
        }
        let cp = position - c;
        let (d5, d6) = (ab.dot(cp), ac.dot(cp));
        if d6 >= 0.0 && d5 <= d6 {
            return cp;
        }
        if d5 * d2 - d1 * d6 <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
            return across(ap, ac);
        }
        if d3 * d6 - d5 * d4 <= 0.0 && d4 >= d3 && d5 >= d6 {
            return across(bp, c - b);
        }
        self.normal * self.normal.dot(ap)
    }

    /// The distance from a convex part; over its face that from a plane, which an acceleration along the face
    /// does not change.
    fn bend(&self, moment: &Moment) -> Bend {
        let mut bend = Bend { time: f64::INFINITY, bound: moment.strength() };
        if bend.bound == 0.0 {
            return bend;
        }
        let [a, b, c] = self.corners;
        let mut time = f64::INFINITY;
        for (from, to, opposite) in [(a, b, c), (b, c, a), (c, a, b)] {
            let inward = self.normal.cross(to - from).normalize();
            let (room, height) = ((moment.position - from).dot(inward), (opposite - from).dot(inward));
            let Some(within) = moment.time_within(room, height, inward) else { return bend };
            time = time.min(within);
        }
        // Rounding of the normal.
        bend.bound = moment.strength_along(self.normal) + 16.0 * f64::EPSILON * bend.bound;
        bend.time = time;
        bend
    }

    fn is_convex(&self, _moment: &Moment) -> bool {
        true
    }
}

/// The part of a vector that is perpendicular to an edge.
#[inline]
fn across(r: DVec3, edge: DVec3) -> DVec3 {
    r - edge * (r.dot(edge) / edge.length_squared())
}
