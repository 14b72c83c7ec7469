/*!
Shapes of walls, built in or of another crate, and the times at which spheres touch them.
*/

use std::fmt;

use glam::DVec3;

use crate::{
    Oscillation, Partition, duration, first_contact_bounded, free_flight, free_flight_velocity,
    named::{Named, NamedOnce},
};

/// A surface, by its distance, in its own frame.
///
/// A sphere touches it where the distance of its center is its radius. What is left to a surface are
/// functions of a position; the times of contacts follow from them. They may depend on their arguments alone:
/// they are computed more than once, and on any thread.
pub trait Surface: fmt::Debug + Send + Sync {
    /// Distance of a position from the surface \[length\], with a sign: positive on the side of the
    /// particles, negative on the other. It changes by at most the distance of two positions.
    fn distance(&self, position: DVec3) -> f64;

    /// Unit normal at the point of the surface that is the nearest to a position: the gradient of the
    /// distance, towards the particles.
    fn normal(&self, position: DVec3) -> DVec3;

    /// Bound of the second derivatives of the distance along straight lines, at positions with distances
    /// between `low` and `high` \[1/length\]: 1/s at the distance s from the center of a sphere. Infinite if
    /// there is no bound.
    fn curvature(&self, low: f64, high: f64) -> f64;

    /// Center and radius of a sphere that has all of the surface in it \[length\]; the radius is infinite for
    /// a surface without end.
    fn bounds(&self) -> (DVec3, f64) {
        (DVec3::ZERO, f64::INFINITY)
    }

    /// The box that particles cannot leave, of a closed surface with the particles inside: its lower and
    /// upper corner \[length\]. By default that around [`Self::bounds`], if what is outside of these is
    /// behind the surface.
    fn enclosure(&self) -> Option<[DVec3; 2]> {
        let (center, radius) = self.bounds();
        let is_closed = radius.is_finite() && self.distance(center + DVec3::X * (2.0 * radius)) < 0.0;
        is_closed.then(|| [center - radius, center + radius])
    }

    /// Volume inside of a container, in two dimensions the area in the plane z = 0 [length^d]; `None` if it
    /// is not known. Of one that is the same everywhere along a coordinate axis, that over this edge.
    fn volume(&self, dimension: usize, edges: DVec3) -> Option<f64> {
        let _ = (dimension, edges);
        None
    }

    /// Whether the surface is the same everywhere along a coordinate axis, as a tube without end is along its
    /// own: then it repeats with a box that is periodic there, and smooth contacts keep the momentum along
    /// it.
    fn is_same_along(&self, axis: usize) -> bool {
        let _ = axis;
        false
    }

    /// Distance of a position from the surface, and its rate of change there for a sphere with this velocity.
    fn approach(&self, position: DVec3, velocity: DVec3) -> (f64, f64) {
        (self.distance(position), velocity.dot(self.normal(position)))
    }

    /// Whether the distance of a position is at most `reach` \[length\]; `true` in case of doubt.
    fn is_near(&self, position: DVec3, reach: f64) -> bool {
        self.distance(position) <= reach
    }

    /// Unit normal of the contact of a sphere, towards the particles: in an edge, that of the part which the
    /// sphere approaches the fastest, of those whose distance is at most `reach` \[length\].
    fn contact_normal(&self, position: DVec3, velocity: DVec3, reach: f64) -> DVec3 {
        let _ = (velocity, reach);
        self.normal(position)
    }

    /// Time until a sphere touches the surface \[time\]; `None` if it never does. Of a later contact than
    /// `within`, the time or infinity.
    ///
    /// The default takes steps in which the sphere cannot come to the surface by its path, and, near it, by
    /// the bound of its curvature ([`first_contact_bounded`]): no contact is missed, however short.
    fn time_to_contact(&self, flight: &RelativeFlight, radius: f64, within: f64) -> Option<f64> {
        let (center, extent) = self.bounds();
        if flight.misses(center, extent + radius) {
            return None;
        }
        let gap = |time: f64| {
            let (distance, rate) = self.approach(flight.at(time), flight.velocity_at(time));
            (distance - flight.radius_at(radius, time), rate - flight.swelling(radius))
        };
        let strength = flight.strength();
        // Paths in which the bound of the curvature counts.
        let near = NEAR * radius;
        let mut time = 0.0;
        while time <= within {
            let (now, _) = gap(time);
            let speed = flight.velocity_at(time).length() + flight.swelling(radius).abs();
            let is_near = now <= 2.0 * near;
            let (path, curvature) = if is_near {
                let here = flight.radius_at(radius, time);
                let reached = here + now.min(0.0);
                let mut path = near;
                // Nearer to the surface than the points where its curvature has no bound.
                let mut curvature = self.curvature(reached - path, here + now + path);
                while !curvature.is_finite() && path > SMALL * radius {
                    path *= 0.5;
                    curvature = self.curvature(reached - path, here + now + path);
                }
                (path, curvature)
            } else {
                (now - near, 0.0)
            };
            let step = duration(path, speed, strength).min(flight.time_to_jump(time));
            // At rest, or where no number is finite.
            if !(step.is_finite() && time + step > time && curvature.is_finite()) {
                return None;
            }
            if is_near {
                let fastest = speed + strength * step;
                let bound = fastest * fastest * curvature + strength;
                if let Some(delay) = first_contact_bounded(|t| gap(time + t), bound, radius, step, step) {
                    return Some(time + delay);
                }
            }
            time += step;
            if !is_near && flight.from(time).misses(center, extent + radius) {
                return None;
            }
        }
        Some(f64::INFINITY)
    }
}

/// Path of a step near a surface [radii].
const NEAR: f64 = 0.5;
/// Least path of a step near a surface [radii].
const SMALL: f64 = 1e-6;

/// The flight of the center of a sphere, with a constant acceleration, relative to a surface that may swing.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RelativeFlight {
    /// Position at time 0, relative to the mean position of a surface that swings \[length\].
    pub position: DVec3,
    /// Velocity at time 0, relative to a surface of constant velocity [length/time].
    pub velocity: DVec3,
    /// Acceleration [length/time²].
    pub acceleration: DVec3,
    /// The oscillation of the surface.
    pub swing: Option<Swing>,
    /// Growth of the radius of the sphere in a unit of time, as a part of that at time 0 [1/time].
    pub growth: f64,
}

/// An oscillation of a surface along a direction.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Swing {
    /// Unit vector.
    pub direction: DVec3,
    /// Form, amplitude and frequency.
    pub oscillation: Oscillation,
    /// Phase at time 0 in cycles.
    pub cycles: f64,
}

impl Swing {
    /// Phase at a time in cycles.
    fn at(&self, time: f64) -> f64 {
        self.cycles + self.oscillation.frequency * time
    }
}

impl RelativeFlight {
    /// A flight beside a surface at rest.
    #[must_use]
    pub fn new(position: DVec3, velocity: DVec3, acceleration: DVec3) -> Self {
        Self { position, velocity, acceleration, swing: None, growth: 0.0 }
    }

    /// Position relative to the surface at a time \[length\].
    #[inline]
    #[must_use]
    pub fn at(&self, time: f64) -> DVec3 {
        let position = free_flight(self.position, self.velocity, self.acceleration, time);
        match &self.swing {
            None => position,
            Some(swing) => position - swing.direction * swing.oscillation.shift(swing.at(time)),
        }
    }

    /// Velocity relative to the surface at a time [length/time].
    #[inline]
    #[must_use]
    pub fn velocity_at(&self, time: f64) -> DVec3 {
        let velocity = free_flight_velocity(self.velocity, self.acceleration, time);
        match &self.swing {
            None => velocity,
            Some(swing) => velocity - swing.direction * swing.oscillation.velocity(swing.at(time)),
        }
    }

    /// Bound of the acceleration relative to the surface, without jumps of the velocity [length/time²].
    #[must_use]
    pub fn strength(&self) -> f64 {
        let swing = self.swing.map_or(0.0, |swing| swing.oscillation.max_acceleration());
        self.acceleration.length() + swing
    }

    /// Time from `time` until the relative velocity next jumps \[time\]; infinite if it never does.
    #[must_use]
    pub fn time_to_jump(&self, time: f64) -> f64 {
        // At least some roundings of the time, so that the corner has gone by.
        let jump =
            |swing: Swing| swing.oscillation.time_to_corner(swing.at(time)).max(8.0 * f64::EPSILON * time);
        self.swing.map_or(f64::INFINITY, jump)
    }

    /// The radius at a time of a sphere that has this radius at time 0 \[length\].
    #[inline]
    #[must_use]
    pub fn radius_at(&self, radius: f64, time: f64) -> f64 {
        radius + self.swelling(radius) * time
    }

    /// The growth of the radius of a sphere that has this radius at time 0 [length/time].
    #[inline]
    #[must_use]
    pub fn swelling(&self, radius: f64) -> f64 {
        radius * self.growth
    }

    /// Whether the path is a straight line.
    #[must_use]
    pub fn is_straight(&self) -> bool {
        self.acceleration == DVec3::ZERO && self.swing.is_none()
    }

    /// The same flight from a later time on.
    #[must_use]
    pub fn from(&self, time: f64) -> Self {
        let Self { position, velocity, acceleration, swing, growth } = *self;
        Self {
            position: free_flight(position, velocity, acceleration, time),
            velocity: free_flight_velocity(velocity, acceleration, time),
            acceleration,
            swing: swing.map(|swing| Swing { cycles: swing.at(time), ..swing }),
            growth: growth / (1.0 + growth * time),
        }
    }

    /// Whether a straight flight certainly never comes into a sphere.
    #[must_use]
    pub fn misses(&self, center: DVec3, radius: f64) -> bool {
        if radius == f64::INFINITY || !self.is_straight() || self.growth > 0.0 {
            return false;
        }
        let from = self.position - center;
        let (along, square) = (from.dot(self.velocity), self.velocity.length_squared());
        let nearest = if along < 0.0 { from - self.velocity * (along / square) } else { from };
        nearest.length() > radius * (1.0 + 1e-9)
    }
}

/// A surface with the name and the parameters by which scenes have it.
pub type NamedSurface = Named<dyn Surface>;

static SURFACES: NamedOnce<dyn Surface> = NamedOnce::new();

impl NamedSurface {
    /// The surface with this name and these parameters, as text; `surface` if it is new.
    pub fn of(name: &str, parameters: &str, surface: Box<dyn Surface>) -> &'static Self {
        SURFACES.of(name, parameters, surface)
    }
}

/// The shape of a wall that is no half-space.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Shape {
    /// A plane with particles on both sides.
    Partition(Partition),
    /// A surface of another crate.
    Named(&'static NamedSurface),
}

impl Shape {
    /// The surface.
    #[must_use]
    pub fn surface(&self) -> &dyn Surface {
        match self {
            Self::Partition(partition) => partition,
            Self::Named(named) => named.get(),
        }
    }

    /// The hole of a partition.
    #[must_use]
    pub fn hole(&self) -> Option<crate::Hole> {
        match self {
            Self::Partition(partition) => partition.hole,
            Self::Named(_) => None,
        }
    }
}

impl Surface for Partition {
    fn distance(&self, position: DVec3) -> f64 {
        self.from_nearest(position).length()
    }

    fn normal(&self, position: DVec3) -> DVec3 {
        self.from_nearest(position).normalize_or(self.normal)
    }

    /// Not used: its contacts are in closed form, but for those with the rim of a hole.
    fn curvature(&self, _low: f64, _high: f64) -> f64 {
        f64::INFINITY
    }

    fn approach(&self, position: DVec3, velocity: DVec3) -> (f64, f64) {
        let r = self.from_nearest(position);
        let distance = r.length();
        (distance, velocity.dot(r) / distance)
    }

    fn time_to_contact(&self, flight: &RelativeFlight, radius: f64, _within: f64) -> Option<f64> {
        Self::time_to_contact(self, flight.position, flight.velocity, flight.acceleration, radius)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A sphere with particles inside (`side` −1) or outside (1).
    #[derive(Debug)]
    struct Ball {
        radius: f64,
        side: f64,
    }

    impl Surface for Ball {
        fn distance(&self, position: DVec3) -> f64 {
            self.side * (position.length() - self.radius)
        }

        fn normal(&self, position: DVec3) -> DVec3 {
            position.normalize_or(DVec3::X) * self.side
        }

        fn curvature(&self, low: f64, high: f64) -> f64 {
            let least = self.radius + if self.side > 0.0 { low } else { -high };
            if least > 0.0 { 1.0 / least } else { f64::INFINITY }
        }

        fn bounds(&self) -> (DVec3, f64) {
            (DVec3::ZERO, self.radius)
        }
    }

    /// The first root t > 0 of |x + v t| = distance at which it falls or rises, in closed form.
    fn expected(x: DVec3, v: DVec3, distance: f64, side: f64) -> Option<f64> {
        let (b, c, v2) = (x.dot(v), x.length_squared() - distance * distance, v.length_squared());
        let discriminant = b * b - v2 * c;
        if discriminant < 0.0 {
            return None;
        }
        let root = discriminant.sqrt();
        if side < 0.0 {
            // From inside: the later root.
            return Some(if b > 0.0 { -c / (b + root) } else { (root - b) / v2 });
        }
        (b < 0.0).then(|| c / (root - b))
    }

    #[test]
    fn straight_flights_to_a_sphere_have_the_times_of_the_closed_form() {
        let mut random = haff_testing::Random(5);
        let mut vector = |scale: f64| DVec3::from_array([0; 3].map(|_| scale * random.uniform(-1.0, 1.0)));
        let (mut hits, mut misses) = (0, 0);
        for _ in 0..100_000 {
            for side in [-1.0, 1.0] {
                let ball = Ball { radius: 2.0, side };
                let radius = 0.3;
                let (x, v) = (vector(3.0), vector(1.0));
                if ball.distance(x) < radius {
                    continue;
                }
                let contact = 2.0 + side * radius;
                let found = ball.time_to_contact(&RelativeFlight::new(x, v, DVec3::ZERO), radius, 1e6);
                let expected = expected(x, v, contact, side);
                match (found, expected) {
                    (Some(found), Some(expected)) => {
                        hits += 1;
                        // The rounding of the distance by the rate at which it falls.
                        let normal = (x + v * expected).normalize();
                        let tolerance = 1e-15 * (x.length() + 2.0) / v.dot(normal).abs() + 1e-15 * expected;
                        assert!((found - expected).abs() <= 8.0 * tolerance, "{x} {v}: {found} {expected}");
                    }
                    (None, None) => misses += 1,
                    // Grazing within rounding.
                    (found, expected) => {
                        let off = (x - v * (x.dot(v) / v.length_squared())).length() - contact;
                        assert!(side > 0.0 && off.abs() < 1e-12, "{x} {v}: {found:?} {expected:?}");
                    }
                }
            }
        }
        assert!(hits > 20_000 && misses > 50_000, "{hits} {misses}");
    }

    #[test]
    fn falls_are_found_and_a_sphere_that_leaves_the_surface_does_not_touch_it_at_once() {
        let ball = Ball { radius: 2.0, side: -1.0 };
        let gravity = DVec3::new(0.0, 0.0, -10.0);
        // From the center down to the lowest point: 1.5 = ½ g t².
        let time =
            ball.time_to_contact(&RelativeFlight::new(DVec3::ZERO, DVec3::ZERO, gravity), 0.5, 1e6).unwrap();
        assert!((time - f64::sqrt(0.3)).abs() < 1e-15, "{time}");
        // A jump from there, up and back.
        let lowest = DVec3::new(0.0, 0.0, -1.5);
        for speed in [1e-6, 1e-3, 1.0, 3.0] {
            let time = ball
                .time_to_contact(&RelativeFlight::new(lowest, DVec3::Z * speed, gravity), 0.5, 1e6)
                .unwrap();
            // The rounding of the height by the speed.
            assert!((time - 0.2 * speed).abs() < 4e-16 / speed + 1e-16, "{speed}: {time}");
        }
        // At rest in free space, and beyond the given time.
        assert_eq!(
            ball.time_to_contact(&RelativeFlight::new(DVec3::ZERO, DVec3::ZERO, DVec3::ZERO), 0.5, 1e6),
            None
        );
        let late = ball
            .time_to_contact(&RelativeFlight::new(DVec3::ZERO, DVec3::X * 1e-9, DVec3::ZERO), 0.5, 1.0)
            .unwrap();
        assert!(late == f64::INFINITY || (late - 1.5e9).abs() < 1e-5, "{late}");
        // Outside, away from it.
        let outside = Ball { radius: 2.0, side: 1.0 };
        assert_eq!(
            outside.time_to_contact(&RelativeFlight::new(DVec3::X * 2.5, DVec3::X, DVec3::ZERO), 0.5, 1e6),
            None
        );
    }
}
