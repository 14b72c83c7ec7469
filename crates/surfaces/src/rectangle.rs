//! A finite plane without thickness; in two dimensions a line of finite length.

use glam::DVec3;
use haff_mechanics::{RelativeFlight, Surface};

use crate::part::{Bend, Moment, Part, first_contact};

/// A rectangle with particles on both sides.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rectangle {
    /// Its center \[length\].
    pub center: DVec3,
    /// Unit normal.
    pub normal: DVec3,
    /// Unit vectors along its edges, perpendicular to each other and to the normal.
    pub along: [DVec3; 2],
    /// Half of its edges \[length\]; infinite along z in two dimensions.
    pub half: [f64; 2],
}

impl Part for Rectangle {
    #[inline]
    fn offset(&self, position: DVec3) -> DVec3 {
        let r = position - self.center;
        let mut from = self.normal * r.dot(self.normal);
        for (direction, half) in self.along.into_iter().zip(self.half) {
            let x = r.dot(direction);
            if x.abs() > half {
                from += direction * (x - half.copysign(x));
            }
        }
        from
    }

    /// The distance from a convex part. Over its face that from a plane: an acceleration along the face does
    /// not change it. Beside an edge one along the edge does not.
    fn bend(&self, moment: &Moment) -> Bend {
        let r = moment.position - self.center;
        let mut bend = Bend { time: f64::INFINITY, bound: moment.strength() };
        if bend.bound == 0.0 {
            return bend;
        }
        let (mut acceleration, mut swing) = (moment.acceleration, moment.swing.0);
        for (direction, half) in self.along.into_iter().zip(self.half) {
            let room = half - r.dot(direction).abs();
            if let Some(time) = moment.time_within(room, half.min(f64::MAX), direction) {
                bend.time = bend.time.min(time);
                acceleration -= direction * acceleration.dot(direction);
                swing -= direction * swing.dot(direction);
            }
        }
        // Rounding of what is taken off.
        let rest = acceleration.length() + moment.swing.1 * swing.length();
        bend.bound = rest + 4.0 * f64::EPSILON * bend.bound;
        bend
    }

    fn is_convex(&self, _moment: &Moment) -> bool {
        true
    }
}

impl Surface for Rectangle {
    fn distance(&self, position: DVec3) -> f64 {
        self.offset(position).length()
    }

    fn normal(&self, position: DVec3) -> DVec3 {
        self.offset(position).normalize_or(self.normal)
    }

    /// That of its corners.
    fn curvature(&self, low: f64, _high: f64) -> f64 {
        if low > 0.0 { 1.0 / low } else { f64::INFINITY }
    }

    fn bounds(&self) -> (DVec3, f64) {
        let [a, b] = self.half;
        // In two dimensions the positions have z = 0.
        let across = if b.is_finite() { b } else { 0.0 };
        (self.center, a.hypot(across))
    }

    fn approach(&self, position: DVec3, velocity: DVec3) -> (f64, f64) {
        Part::approach(self, position, velocity)
    }

    fn time_to_contact(&self, flight: &RelativeFlight, radius: f64, within: f64) -> Option<f64> {
        let (center, extent) = self.bounds();
        if flight.misses(center, extent + radius) {
            return None;
        }
        first_contact(std::slice::from_ref(self), flight, radius, within)
    }
}
