//! Surfaces of revolution whose profile consists of straight lines: cylinders and cones.

use std::f64::consts::PI;

use glam::DVec3;
use haff_mechanics::{RelativeFlight, Surface};

use crate::part::{Bend, Moment, Part, Side, contact_normal, first_contact, gradient, offset, time_for};

/// The axis of a surface of revolution.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Axis {
    origin: DVec3,
    /// Unit vector.
    direction: DVec3,
}

impl Axis {
    /// Distance ρ from the axis and height z along it, and the unit vector away from the axis.
    #[inline]
    fn coordinates(&self, position: DVec3) -> (f64, f64, DVec3) {
        let r = position - self.origin;
        let z = r.dot(self.direction);
        let across = r - self.direction * z;
        let rho = across.length();
        // On the axis all directions are equal.
        let outward = if rho > 0.0 { across / rho } else { self.direction.any_orthonormal_vector() };
        (rho, z, outward)
    }
}

/// A line of the profile: the points (ρ, z) = (ρ₀, z₀) + s (u, w) with s from `low` to `high`.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Line {
    rho: f64,
    z: f64,
    /// Unit vector (u, w).
    along: [f64; 2],
    low: f64,
    high: f64,
}

impl Line {
    /// From a point (ρ, z) to another one.
    fn between([rho, z]: [f64; 2], [end_rho, end_z]: [f64; 2]) -> Self {
        let (u, w) = (end_rho - rho, end_z - z);
        let length = u.hypot(w);
        Self { rho, z, along: [u / length, w / length], low: 0.0, high: length }
    }

    /// The vector (ρ, z) to a point from the nearest one of the line.
    #[inline]
    fn offset(&self, rho: f64, z: f64) -> [f64; 2] {
        let [u, w] = self.along;
        let (x, y) = (rho - self.rho, z - self.z);
        let s = x * u + y * w;
        if s >= self.low && s <= self.high {
            // Along the normal (w, −u), without a difference of near numbers.
            let height = x * w - y * u;
            return [w * height, -u * height];
        }
        let s = s.clamp(self.low, self.high);
        [x - s * u, y - s * w]
    }

    /// The largest distance from the axis.
    fn widest(&self) -> f64 {
        let [u, _] = self.along;
        if u == 0.0 { self.rho } else { self.rho + f64::max(self.low * u, self.high * u) }
    }

    /// Whether the line is a disk: perpendicular to the axis, which it touches.
    fn is_disk(&self) -> bool {
        self.along == [1.0, 0.0] && self.rho == 0.0
    }
}

/// A line of the profile, turned around the axis.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Band {
    axis: Axis,
    line: Line,
}

impl Part for Band {
    #[inline]
    fn offset(&self, position: DVec3) -> DVec3 {
        let (rho, z, outward) = self.axis.coordinates(position);
        let [x, y] = self.line.offset(rho, z);
        outward * x + self.axis.direction * y
    }

    /// The distance from the line is a convex function of (ρ, z), and z is linear in the position. Where the
    /// distance falls with ρ, the second derivative of ρ counts: at most that of the path across the axis,
    /// v²/ρ.
    fn bend(&self, moment: &Moment) -> Bend {
        let strength = moment.strength();
        if self.line.is_disk() {
            return Bend { time: f64::INFINITY, bound: strength };
        }
        let axis = self.axis.direction;
        let across = |vector: DVec3| (vector - axis * vector.dot(axis)).length();
        let (rho, _, _) = self.axis.coordinates(moment.position);
        let speed = across(moment.velocity);
        let pull = across(moment.acceleration) + moment.swing.1 * across(moment.swing.0);
        let widest = self.line.widest();
        let face = self.over_face(moment);
        // Far from the axis the distance is convex, until the path comes to the surface.
        let is_far = rho > 2.0 * widest;
        let time = time_for(if is_far { rho - widest } else { 0.5 * rho }, speed, pull);
        let curved = |time: f64| {
            let is_convex = is_far || time == f64::INFINITY;
            if is_convex { 0.0 } else { 2.0 / rho * (speed + pull * time).powi(2) }
        };
        if let Some(within) = face {
            // The distance is w ρ − u z there.
            let [u, w] = self.line.along.map(f64::abs);
            let time = time.min(within);
            let along = moment.strength_along(axis);
            // Rounding of what is taken off.
            let bound = w * (curved(time) + pull) + u * along + 4.0 * f64::EPSILON * strength;
            return Bend { time, bound };
        }
        Bend { time, bound: curved(time) + strength }
    }

    fn is_convex(&self, moment: &Moment) -> bool {
        // Along the axis ρ does not change.
        let across = |vector: DVec3| vector - self.axis.direction * vector.dot(self.axis.direction);
        let [velocity, acceleration] = [moment.velocity, moment.acceleration].map(across);
        self.line.is_disk() || velocity == DVec3::ZERO && acceleration == DVec3::ZERO
    }
}

impl Band {
    /// The time for which the nearest point is certainly on the line, not at one of its ends \[time\]; `None`
    /// near its ends.
    fn over_face(&self, moment: &Moment) -> Option<f64> {
        let Line { rho, z, along: [u, w], low, high } = self.line;
        let (here_rho, here_z, outward) = self.axis.coordinates(moment.position);
        let s = (here_rho - rho) * u + (here_z - z) * w;
        let room = (s - low).min(high - s);
        if room == f64::INFINITY {
            return Some(f64::INFINITY);
        }
        let size = (high - low).min(f64::MAX);
        let direction = outward * u + self.axis.direction * w;
        moment.time_within(room, size, direction)?;
        // ρ changes no faster than the position.
        Some(time_for(room, moment.velocity.length(), moment.strength()))
    }
}

/// All of an obstacle, which is convex.
struct Solid<'a>(&'a [Band]);

impl Part for Solid<'_> {
    fn offset(&self, position: DVec3) -> DVec3 {
        offset(self.0, position)
    }
}

/// A surface of revolution: a cylinder or a cone.
#[derive(Debug, Clone, PartialEq)]
pub struct Revolution {
    bands: Vec<Band>,
    side: Side,
    /// The volume inside: z from `low` to `high`, ρ below `radius` + `slope` z.
    low: f64,
    high: f64,
    radius: f64,
    slope: f64,
    center: DVec3,
    extent: f64,
}

impl Revolution {
    /// A cylinder without end around an axis through `point`, whose `direction` need not have unit length.
    #[must_use]
    pub fn cylinder(point: DVec3, direction: DVec3, radius: f64, side: Side) -> Self {
        let axis = Axis { origin: point, direction: direction.normalize() };
        let line =
            Line { rho: radius, z: 0.0, along: [0.0, 1.0], low: f64::NEG_INFINITY, high: f64::INFINITY };
        Self::new(axis, vec![line], side, [f64::NEG_INFINITY, f64::INFINITY], [radius, 0.0])
    }

    /// A cylinder from `point` on along an axis over a length, with flat ends; a tube without ends if `side`
    /// is [`Side::Both`].
    #[must_use]
    pub fn finite_cylinder(point: DVec3, direction: DVec3, radius: f64, length: f64, side: Side) -> Self {
        let axis = Axis { origin: point, direction: direction.normalize() };
        let mut lines = vec![Line::between([radius, 0.0], [radius, length])];
        if side != Side::Both {
            lines.push(Line::between([0.0, 0.0], [radius, 0.0]));
            lines.push(Line::between([0.0, length], [radius, length]));
        }
        Self::new(axis, lines, side, [0.0, length], [radius, 0.0])
    }

    /// A cone around an axis that begins at the apex, with this angle between the axis and the surface
    /// [radians], below π/2. The surface begins `start` from the apex along the axis, where it has a flat end
    /// if `start` > 0, and ends with another one at `end`, which can be infinite; a funnel without ends if
    /// `side` is [`Side::Both`].
    #[must_use]
    pub fn cone(apex: DVec3, direction: DVec3, angle: f64, [start, end]: [f64; 2], side: Side) -> Self {
        let axis = Axis { origin: apex, direction: direction.normalize() };
        let (sin, cos) = angle.sin_cos();
        let slope = sin / cos;
        let high = if end == f64::INFINITY { end } else { end / cos };
        let mut lines = vec![Line { rho: 0.0, z: 0.0, along: [sin, cos], low: start / cos, high }];
        if side != Side::Both {
            for z in [start, end] {
                if z > 0.0 && z < f64::INFINITY {
                    lines.push(Line::between([0.0, z], [z * slope, z]));
                }
            }
        }
        Self::new(axis, lines, side, [start, end], [0.0, slope])
    }

    fn new(
        axis: Axis,
        lines: Vec<Line>,
        side: Side,
        [low, high]: [f64; 2],
        [radius, slope]: [f64; 2],
    ) -> Self {
        let bands = lines.into_iter().map(|line| Band { axis, line }).collect();
        let (mut center, mut extent) = (axis.origin, f64::INFINITY);
        if low.is_finite() && high.is_finite() {
            let half = 0.5 * (high - low);
            center = axis.origin + axis.direction * (low + half);
            extent = half.hypot(radius + slope * high);
        }
        Self { bands, side, low, high, radius, slope, center, extent }
    }

    /// Whether a position is in the volume inside.
    fn contains(&self, position: DVec3) -> bool {
        let (rho, z, _) = self.bands[0].axis.coordinates(position);
        z >= self.low && z <= self.high && rho <= self.radius + self.slope * z
    }
}

impl Surface for Revolution {
    fn distance(&self, position: DVec3) -> f64 {
        let distance = offset(&self.bands, position).length();
        match self.side {
            Side::Both => distance,
            side if self.contains(position) == (side == Side::Inside) => distance,
            _ => -distance,
        }
    }

    fn normal(&self, position: DVec3) -> DVec3 {
        let r = offset(&self.bands, position);
        gradient(r, self.distance(position)).unwrap_or(self.bands[0].axis.direction)
    }

    /// No bound: contacts are found by the parts.
    fn curvature(&self, _low: f64, _high: f64) -> f64 {
        f64::INFINITY
    }

    fn bounds(&self) -> (DVec3, f64) {
        (self.center, self.extent)
    }

    /// Around the disks at both ends; of a cylinder without end across its axis.
    fn enclosure(&self) -> Option<[DVec3; 2]> {
        let Axis { origin, direction } = self.bands[0].axis;
        let across = (1.0 - direction * direction).max(DVec3::ZERO).map(f64::sqrt);
        let ends = [self.low, self.high];
        if self.side != Side::Inside || self.slope != 0.0 && ends.iter().any(|z| z.is_infinite()) {
            return None;
        }
        // Not 0 · ∞.
        let shift = |z: f64| direction.map(|along| if along == 0.0 { 0.0 } else { along * z });
        let [a, b] = ends.map(|z| {
            let radius = if self.slope == 0.0 { self.radius } else { self.radius + self.slope * z };
            let center = origin + shift(z);
            [center - across * radius, center + across * radius]
        });
        Some([a[0].min(b[0]), a[1].max(b[1])])
    }

    /// From the disks at both ends; in two dimensions a circle, or a trapezoid along the axis.
    fn volume(&self, dimension: usize, edges: DVec3) -> Option<f64> {
        if self.side != Side::Inside {
            return None;
        }
        let direction = self.bands[0].axis.direction;
        if dimension == 2 && direction.z.abs() == 1.0 {
            return (self.slope == 0.0).then_some(PI * self.radius * self.radius);
        }
        let length = match (0..dimension).find(|&axis| self.is_same_along(axis)) {
            Some(axis) => edges[axis],
            None => self.high - self.low,
        };
        let [a, b] = if self.slope == 0.0 {
            [self.radius; 2]
        } else {
            [self.low, self.high].map(|z| self.radius + self.slope * z)
        };
        let volume =
            if dimension == 2 { (a + b) * length } else { PI / 3.0 * (a * a + a * b + b * b) * length };
        volume.is_finite().then_some(volume)
    }

    fn is_same_along(&self, axis: usize) -> bool {
        let is_endless = self.low == f64::NEG_INFINITY && self.high == f64::INFINITY;
        is_endless && self.bands[0].axis.direction[axis].abs() == 1.0
    }

    fn approach(&self, position: DVec3, velocity: DVec3) -> (f64, f64) {
        Solid(&self.bands).approach(position, velocity)
    }

    fn is_near(&self, position: DVec3, reach: f64) -> bool {
        offset(&self.bands, position).length() <= reach
    }

    fn contact_normal(&self, position: DVec3, velocity: DVec3, reach: f64) -> DVec3 {
        if self.side == Side::Outside {
            return self.normal(position);
        }
        contact_normal(self.bands.iter(), position, velocity, reach).unwrap_or_else(|| self.normal(position))
    }

    fn time_to_contact(&self, flight: &RelativeFlight, radius: f64, within: f64) -> Option<f64> {
        if flight.misses(self.center, self.extent + radius) {
            return None;
        }
        if self.side == Side::Outside {
            return first_contact(&[Solid(&self.bands)], flight, radius, within);
        }
        first_contact(&self.bands, flight, radius, within)
    }
}
