//! A sphere, with particles inside or outside; in two dimensions a circle.

use std::f64::consts::PI;

use glam::DVec3;
use haff_mechanics::{RelativeFlight, Surface};

use crate::part::{Bend, Moment, Part, Side, first_contact, gradient, time_for};

/// A sphere.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sphere {
    /// Its center \[length\].
    pub center: DVec3,
    /// Its radius R > 0 \[length\].
    pub radius: f64,
    /// Where the particles are; [`Side::Both`] is a shell.
    pub side: Side,
}

impl Part for Sphere {
    fn offset(&self, position: DVec3) -> DVec3 {
        let r = position - self.center;
        let distance = r.length();
        // From the center all points are as near.
        let outward = if distance > 0.0 { r / distance } else { DVec3::X };
        outward * (distance - self.radius)
    }

    fn bend(&self, moment: &Moment) -> Bend {
        let distance = (moment.position - self.center).length();
        let strength = moment.strength();
        if self.side == Side::Outside {
            return Bend { time: f64::INFINITY, bound: strength };
        }
        let speed = moment.velocity.length();
        // Far from it the distance is convex, until the path comes to it.
        let is_far = distance > 2.0 * self.radius;
        let path = if is_far { distance - self.radius } else { 0.5 * distance };
        let time = time_for(path, speed, strength);
        if is_far || time == f64::INFINITY {
            return Bend { time, bound: strength };
        }
        Bend { time, bound: 2.0 / distance * (speed + strength * time).powi(2) + strength }
    }
}

impl Surface for Sphere {
    fn distance(&self, position: DVec3) -> f64 {
        let height = (position - self.center).length() - self.radius;
        match self.side {
            Side::Inside => -height,
            Side::Outside => height,
            Side::Both => height.abs(),
        }
    }

    fn normal(&self, position: DVec3) -> DVec3 {
        gradient(self.offset(position), self.distance(position)).unwrap_or(DVec3::X)
    }

    fn curvature(&self, low: f64, high: f64) -> f64 {
        let least = self.radius + if self.side == Side::Outside { low } else { -high };
        if least > 0.0 { 1.0 / least } else { f64::INFINITY }
    }

    fn bounds(&self) -> (DVec3, f64) {
        (self.center, self.radius)
    }

    fn volume(&self, dimension: usize, _edges: DVec3) -> Option<f64> {
        let square = PI * self.radius * self.radius;
        let volume = if dimension == 2 { square } else { 4.0 / 3.0 * square * self.radius };
        (self.side == Side::Inside).then_some(volume)
    }

    fn approach(&self, position: DVec3, velocity: DVec3) -> (f64, f64) {
        Part::approach(self, position, velocity)
    }

    fn time_to_contact(&self, flight: &RelativeFlight, radius: f64, within: f64) -> Option<f64> {
        if flight.misses(self.center, self.radius + radius) {
            return None;
        }
        first_contact(std::slice::from_ref(self), flight, radius, within)
    }
}
