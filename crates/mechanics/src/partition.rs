/*!
A thin plane with particles on both sides, and with a round hole through which they pass.
*/

use glam::DVec3;

use crate::{first_contact_bounded, time_to_plane};

/// A plane without thickness, solid on both sides.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Partition {
    /// A point of the plane \[length\].
    pub point: DVec3,
    /// Unit normal.
    pub normal: DVec3,
    /// A round hole.
    pub hole: Option<Hole>,
}

/// A round hole in a plane; in two dimensions a gap.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hole {
    /// Its center, in the plane \[length\].
    pub center: DVec3,
    /// Its radius, larger than that of any particle \[length\].
    pub radius: f64,
}

impl Partition {
    /// The vector to a position from the nearest point of the partition \[length\].
    #[must_use]
    pub fn from_nearest(&self, position: DVec3) -> DVec3 {
        let height = (position - self.point).dot(self.normal);
        if let Some(hole) = self.hole {
            let across = self.across(position, &hole);
            let distance = across.length();
            if distance < hole.radius {
                // On the axis all points of the rim are as near.
                let direction =
                    if distance > 0.0 { across / distance } else { self.normal.any_orthonormal_vector() };
                return position - (hole.center + hole.radius * direction);
            }
        }
        self.normal * height
    }

    /// The vector from the axis of a hole to a position \[length\].
    fn across(&self, position: DVec3, hole: &Hole) -> DVec3 {
        let r = position - hole.center;
        r - self.normal * r.dot(self.normal)
    }

    /// Time until a sphere touches the partition \[time\]; `None` if it never does.
    ///
    /// The sphere first comes to the plane, in closed form. If the hole is below its center then, it can only
    /// touch the rim, until it has left the plane on either side.
    #[must_use]
    pub fn time_to_contact(
        &self,
        position: DVec3,
        velocity: DVec3,
        acceleration: DVec3,
        radius: f64,
    ) -> Option<f64> {
        let flight = Flight { position, velocity, acceleration };
        let mut time = 0.0;
        // A parabola enters the plane twice at most.
        for _ in 0..3 {
            let height = (flight.at(time) - self.point).dot(self.normal);
            let side = 1.0_f64.copysign(height);
            let speed = side * flight.velocity_at(time).dot(self.normal);
            let hole = self.hole.filter(|hole| self.across(flight.at(time), hole).length() < hole.radius);
            if height.abs() >= radius || hole.is_none() {
                let along = side * acceleration.dot(self.normal);
                // A sphere inside of the plane, and not in the hole, is there by rounding.
                time += time_to_plane((height.abs() - radius).max(0.0), speed, along)?;
            }
            let Some(hole) =
                self.hole.filter(|hole| self.across(flight.at(time), hole).length() < hole.radius)
            else {
                return Some(time);
            };
            match self.rim(&hole, &flight, radius, time) {
                Rim::Contact(contact) => return Some(contact),
                Rim::Left(left) => time = left,
                Rim::Never => return None,
            }
        }
        None
    }

    /// What happens to a sphere in a hole from `time` on.
    ///
    /// The distance from the partition falls no faster than the sphere moves. Near the rim its second
    /// derivative is not below −(v²/ρ + |a|), with the distance ρ of the center from the axis.
    fn rim(&self, hole: &Hole, flight: &Flight, radius: f64, mut time: f64) -> Rim {
        let distance = |time: f64| {
            let r = self.from_nearest(flight.at(time));
            let length = r.length();
            (length - radius, r.dot(flight.velocity_at(time)) / length)
        };
        // Steps are shorter than this, and where the distance is less than twice as much, the center is
        // farther than this from the axis.
        let reach = 0.25 * (hole.radius - radius);
        let strength = flight.acceleration.length();
        loop {
            let velocity = flight.velocity_at(time);
            let speed = velocity.length();
            let step = if strength > 0.0 {
                2.0 * reach / (speed + (speed * speed + 2.0 * strength * reach).sqrt())
            } else {
                reach / speed
            };
            if !(step.is_finite() && time + step > time) {
                return Rim::Never;
            }
            if distance(time).0 <= 2.0 * reach {
                let fastest = speed + strength * step;
                let bound = fastest * fastest / reach + strength;
                if let Some(delay) = first_contact_bounded(|t| distance(time + t), bound, radius, step, step)
                {
                    return Rim::Contact(time + delay);
                }
            }
            time += step;
            let height = (flight.at(time) - self.point).dot(self.normal);
            if height.abs() >= radius && height * flight.velocity_at(time).dot(self.normal) >= 0.0 {
                return Rim::Left(time);
            }
        }
    }
}

/// What happens to a sphere in a hole.
enum Rim {
    /// It touches the rim at this time.
    Contact(f64),
    /// It has left the plane at this time.
    Left(f64),
    /// It rests in the hole.
    Never,
}

/// A flight of constant acceleration.
struct Flight {
    position: DVec3,
    velocity: DVec3,
    acceleration: DVec3,
}

impl Flight {
    fn at(&self, time: f64) -> DVec3 {
        self.position + self.velocity * time + self.acceleration * (0.5 * time * time)
    }

    fn velocity_at(&self, time: f64) -> DVec3 {
        self.velocity + self.acceleration * time
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn partition(radius: f64) -> Partition {
        let hole = Some(Hole { center: DVec3::new(0.0, 1.0, 2.0), radius });
        Partition { point: DVec3::ZERO, normal: DVec3::X, hole }
    }

    /// The first time at which the surface is touched, by steps of 10⁻⁵ and bisection.
    fn by_steps(
        plane: &Partition,
        (position, velocity, acceleration): (DVec3, DVec3, DVec3),
        radius: f64,
    ) -> Option<f64> {
        let gap = |t: f64| {
            plane.from_nearest(position + velocity * t + acceleration * (0.5 * t * t)).length() - radius
        };
        let step = 1e-5;
        let found = (1..800_000).find(|&k| gap(f64::from(k) * step) < 0.0)?;
        let (mut low, mut high) = (f64::from(found - 1) * step, f64::from(found) * step);
        for _ in 0..60 {
            let middle = 0.5 * (low + high);
            if gap(middle) < 0.0 { high = middle } else { low = middle }
        }
        Some(high)
    }

    #[test]
    fn both_sides_are_solid() {
        let plane = Partition { hole: None, ..partition(1.0) };
        for side in [1.0, -1.0] {
            let position = DVec3::new(3.0 * side, 1.0, 2.0);
            let towards = DVec3::new(-side, 0.3, 0.0);
            assert_eq!(plane.time_to_contact(position, towards, DVec3::ZERO, 0.5), Some(2.5));
            assert_eq!(plane.time_to_contact(position, -towards, DVec3::ZERO, 0.5), None);
            assert_eq!(plane.from_nearest(position), DVec3::new(3.0 * side, 0.0, 0.0));
        }
    }

    #[test]
    fn a_sphere_flies_through_the_middle_of_a_hole() {
        let start = DVec3::new(-3.0, 1.1, 2.0);
        assert_eq!(partition(1.0).time_to_contact(start, DVec3::X, DVec3::ZERO, 0.5), None);
        // Off the axis by more than the hole is wide.
        let beside = start + DVec3::new(0.0, 1.2, 0.0);
        assert_eq!(partition(1.0).time_to_contact(beside, DVec3::X, DVec3::ZERO, 0.5), Some(2.5));
        // Onto the rim: the center is 0.8 from the axis, 0.2 inside of the rim.
        let rim = start + DVec3::new(0.0, 0.7, 0.0);
        let expected = 3.0 - (0.25_f64 - 0.04).sqrt();
        let found = partition(1.0).time_to_contact(rim, DVec3::X, DVec3::ZERO, 0.5);
        assert!(found.is_some_and(|time| (time - expected).abs() < 1e-14), "{found:?}");
    }

    #[test]
    fn contacts_with_the_rim_are_the_first_ones() {
        let mut random = haff_testing::Random(9);
        let mut rims = 0;
        for k in 0..400 {
            let mut number = |size: f64| random.uniform(-size, size);
            let (hole, radius) = (1.2 + 0.5 * number(1.0), 0.4 + 0.2 * number(1.0));
            let plane = partition(hole);
            let position = DVec3::new(-1.5, 1.0 + number(1.0), 2.0 + number(1.0));
            let velocity = DVec3::new(1.0 + 0.8 * number(1.0), number(1.0), number(1.0));
            let fall = match k % 3 {
                0 => DVec3::ZERO,
                1 => DVec3::new(0.0, 0.0, -1.0),
                // As of a grain that slides down a tilted wall: it may turn back in the hole.
                _ => DVec3::new(-0.7, 0.0, -0.5),
            };
            let flight = (position, velocity, fall);
            let found = plane.time_to_contact(position, velocity, fall, radius);
            let expected = by_steps(&plane, flight, radius);
            match (found, expected) {
                (Some(found), Some(expected)) => {
                    assert!((found - expected).abs() < 1e-9, "{k}: {found} and {expected}");
                    let there = position + velocity * found + fall * (0.5 * found * found);
                    rims += usize::from(plane.from_nearest(there).cross(DVec3::X).length() > 1e-6);
                }
                (None, None) => {}
                (found, expected) => panic!("{k}: {found:?} and {expected:?}"),
            }
        }
        assert!(rims > 50, "{rims} contacts with the rim");
    }
}
