//! Parts of a surface, and the search for the first contact with one of them.

use glam::DVec3;
use haff_mechanics::{RelativeFlight, duration, first_contact_bounded};

/// Where the particles are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Side {
    /// Inside of a container.
    Inside,
    /// Outside of an obstacle.
    Outside,
    /// On both sides of a surface without thickness.
    Both,
}

/// A sphere at a time of its flight.
#[derive(Debug, Clone, Copy)]
pub struct Moment {
    /// Position of its center relative to the surface \[length\].
    pub position: DVec3,
    /// Velocity relative to the surface [length/time].
    pub velocity: DVec3,
    /// Its own acceleration [length/time²].
    pub acceleration: DVec3,
    /// Direction, and bound of the acceleration of the surface along it [length/time²].
    pub swing: (DVec3, f64),
    /// Radius of the sphere \[length\].
    pub radius: f64,
}

impl Moment {
    /// A flight at a time.
    pub(crate) fn of(flight: &RelativeFlight, radius: f64, time: f64) -> Self {
        let swing = flight
            .swing
            .map_or((DVec3::ZERO, 0.0), |swing| (swing.direction, swing.oscillation.max_acceleration()));
        Self {
            position: flight.at(time),
            velocity: flight.velocity_at(time),
            acceleration: flight.acceleration,
            swing,
            radius,
        }
    }

    /// Bound of the acceleration along a unit vector [length/time²].
    pub fn strength_along(&self, direction: DVec3) -> f64 {
        self.acceleration.dot(direction).abs() + self.swing.1 * self.swing.0.dot(direction).abs()
    }

    /// The time for which a coordinate certainly stays within a `room` from where it is, along a unit vector
    /// \[time\]; `None` near the end of a face of this `size`, where the steps would become short.
    pub(crate) fn time_within(&self, room: f64, size: f64, direction: DVec3) -> Option<f64> {
        (room > NEAR_EDGE * size && room > NEAR_EDGE * self.radius)
            .then(|| time_for(room, self.velocity.dot(direction).abs(), self.strength_along(direction)))
    }

    /// Bound of the acceleration [length/time²].
    pub fn strength(&self) -> f64 {
        self.acceleration.length() + self.swing.1
    }
}

/// How the distance from a part bends from a moment on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bend {
    /// Time for which the bound counts \[time\]; infinite for a convex part.
    pub time: f64,
    /// The second derivative of the distance is at least −`bound` [length/time²].
    pub bound: f64,
}

/// A part of a surface.
pub trait Part {
    /// The vector to a position from the nearest point of the part \[length\].
    fn offset(&self, position: DVec3) -> DVec3;

    /// How the distance bends. By default as that of a convex part: along a straight line the distance is a
    /// convex function.
    fn bend(&self, moment: &Moment) -> Bend {
        Bend { time: f64::INFINITY, bound: moment.strength() }
    }

    /// Whether the distance is a convex function along straight lines that begin there.
    fn is_convex(&self, moment: &Moment) -> bool {
        self.bend(moment).time == f64::INFINITY
    }

    /// Distance of a position and its rate of change at this velocity.
    #[inline]
    fn approach(&self, position: DVec3, velocity: DVec3) -> (f64, f64) {
        let r = self.offset(position);
        let distance = r.length();
        (distance, if distance > 0.0 { velocity.dot(r) / distance } else { 0.0 })
    }
}

/// Most parts of a surface whose parts are tested one by one.
pub(crate) const MOST_PARTS: usize = 4;
/// Part of the size of a face, or of a radius, that counts as its edge.
const NEAR_EDGE: f64 = 1e-3;
/// Least path of a step [radii]: it passes an axis, where all of a part is equally near.
const LEAST: f64 = 1e-6;
/// Free paths are shortened by this part, for the rounding of distances.
pub(crate) const SHORTER: f64 = 1e-9;
/// Contacts across an axis are found before the distance is this far below zero [radii].
const TOLERANCE: f64 = 1e-14;

/// [`duration`], infinite at rest without acceleration.
pub(crate) fn time_for(path: f64, speed: f64, strength: f64) -> f64 {
    if speed == 0.0 && strength == 0.0 { f64::INFINITY } else { duration(path, speed, strength) }
}

/// The time until a sphere touches one of the parts \[time\]; `None` if it never does, infinite if not before
/// `within`.
pub(crate) fn first_contact<P: Part>(
    parts: &[P],
    flight: &RelativeFlight,
    radius: f64,
    within: f64,
) -> Option<f64> {
    debug_assert!(parts.len() <= MOST_PARTS, "all parts are tested");
    let swelling = flight.swelling(radius);
    let mut time = 0.0;
    while time <= within {
        let moment = Moment::of(flight, radius, time);
        let (speed, strength) = (moment.velocity.length() + swelling.abs(), moment.strength());
        let here = flight.radius_at(radius, time);
        let (mut free, mut step) = (f64::INFINITY, f64::INFINITY);
        let mut gaps = [0.0; MOST_PARTS];
        for (part, gap) in parts.iter().zip(&mut gaps) {
            *gap = part.offset(moment.position).length() - here;
            free = free.min(*gap);
            step = step.min(part.bend(&moment).time);
        }
        // Without contact for this time, since no gap falls faster than the sphere moves and grows.
        let free = if free > 0.0 { time_for(free * (1.0 - SHORTER), speed, strength) } else { 0.0 };
        let is_free = free > 0.0 && free >= step;
        let least = time_for(LEAST * radius, speed, strength);
        let step = if is_free { free } else { step.max(least) }.min(flight.time_to_jump(time));
        if step.is_nan() || time + step <= time {
            return None;
        }
        if !is_free {
            // What is found must not depend on `within`, only whether it is.
            let stop = step.min(within - time);
            // Parts beyond this are not reached.
            let path = ((speed + 0.5 * strength * stop) * stop) * (1.0 + SHORTER);
            let mut first = f64::INFINITY;
            for (part, _) in parts.iter().zip(gaps).filter(|&(_, gap)| gap.is_nan() || gap <= path) {
                let gap = |t: f64| {
                    let at = time + t;
                    let (distance, rate) = part.approach(flight.at(at), flight.velocity_at(at));
                    (distance - flight.radius_at(radius, at), rate - swelling)
                };
                let bend = part.bend(&moment);
                let found = if bend.time < least {
                    crossing(gap, step, TOLERANCE * radius)
                } else {
                    first_contact_bounded(gap, bend.bound, radius, step, stop.min(first))
                };
                first = first.min(found.unwrap_or(f64::INFINITY));
            }
            if first < f64::INFINITY {
                return Some(time + first);
            }
            if step == f64::INFINITY {
                break;
            }
        }
        time += step;
    }
    // A straight flight away from convex parts comes to none of them later.
    let moment = Moment::of(flight, radius, 0.0);
    let recedes =
        |part: &P| part.is_convex(&moment) && part.approach(moment.position, moment.velocity).1 >= swelling;
    if flight.is_straight() && parts.iter().all(recedes) { None } else { Some(f64::INFINITY) }
}

/// The time after `start` at which a sphere first touches a part, if it does before `until`; perhaps not if
/// that is after `stop`.
pub(crate) fn first_in_step<P: Part>(
    part: &P,
    flight: &RelativeFlight,
    radius: f64,
    start: f64,
    [until, stop]: [f64; 2],
) -> Option<f64> {
    let mut time = 0.0;
    while time < until && time <= stop {
        let bend = part.bend(&Moment::of(flight, radius, start + time));
        let step = bend.time.min(until - time);
        let gap = |t: f64| {
            let at = start + (time + t);
            let (distance, rate) = part.approach(flight.at(at), flight.velocity_at(at));
            (distance - flight.radius_at(radius, at), rate - flight.swelling(radius))
        };
        if let Some(found) = first_contact_bounded(gap, bend.bound, radius, step, stop - time) {
            return Some(time + found);
        }
        if time + step <= time {
            return None;
        }
        time += step;
    }
    None
}

/// The time at which a distance falls to zero in a short interval in which it is concave \[time\].
fn crossing(gap: impl Fn(f64) -> (f64, f64), until: f64, tolerance: f64) -> Option<f64> {
    let (now, rate) = gap(0.0);
    if now <= tolerance && rate < 0.0 {
        return Some(0.0);
    }
    if gap(until).0 >= -tolerance {
        return None;
    }
    let (mut low, mut high) = (0.0, until);
    loop {
        let middle = 0.5 * (low + high);
        if middle <= low || middle >= high {
            return Some(low);
        }
        if gap(middle).0 < 0.0 { high = middle } else { low = middle }
    }
}

/// The gradient of a signed distance, from the vector to the position from the nearest point; `None` on the
/// surface.
pub(crate) fn gradient(offset: DVec3, distance: f64) -> Option<DVec3> {
    offset.try_normalize().map(|normal| if distance < 0.0 { -normal } else { normal })
}

/// The vector to a position from the nearest point of all parts.
pub(crate) fn offset<P: Part>(parts: &[P], position: DVec3) -> DVec3 {
    let mut nearest = DVec3::INFINITY;
    for part in parts {
        let r = part.offset(position);
        if r.length_squared() < nearest.length_squared() {
            nearest = r;
        }
    }
    nearest
}

/// The normal of a contact: that of the part which a sphere approaches the fastest, of those within `reach`,
/// also if it approaches them by its growth only; of the nearest one if none is.
pub(crate) fn contact_normal<P: Part>(
    parts: impl Iterator<Item = P>,
    position: DVec3,
    velocity: DVec3,
    reach: f64,
) -> Option<DVec3> {
    let mut nearest: Option<(f64, DVec3)> = None;
    let mut fastest: Option<(f64, DVec3)> = None;
    for part in parts {
        let r = part.offset(position);
        let distance = r.length();
        let normal = r / distance;
        if nearest.is_none_or(|(least, _)| distance < least) {
            nearest = Some((distance, normal));
        }
        let rate = velocity.dot(normal);
        if distance <= reach && fastest.is_none_or(|(least, _)| rate < least) {
            fastest = Some((rate, normal));
        }
    }
    fastest.or(nearest).map(|(_, normal)| normal).filter(|normal| normal.is_finite())
}

impl<P: Part> Part for &P {
    fn offset(&self, position: DVec3) -> DVec3 {
        (*self).offset(position)
    }

    fn bend(&self, moment: &Moment) -> Bend {
        (*self).bend(moment)
    }

    fn is_convex(&self, moment: &Moment) -> bool {
        (*self).is_convex(moment)
    }
}

#[cfg(test)]
mod tests {
    use std::cell::Cell;

    use super::*;
    use crate::{Rectangle, mesh::Triangle};

    /// Counts how often a part is asked.
    struct Counted<'a, P> {
        part: P,
        asked: &'a Cell<usize>,
    }

    impl<P: Part> Part for Counted<'_, P> {
        fn offset(&self, position: DVec3) -> DVec3 {
            self.asked.set(self.asked.get() + 1);
            self.part.offset(position)
        }

        fn bend(&self, moment: &Moment) -> Bend {
            self.part.bend(moment)
        }
    }

    /// A grain that was at rest beside a wall falls along it: the gap is as small as rounding all the way.
    #[test]
    fn a_fall_along_a_wall_takes_few_steps() {
        let asked = Cell::new(0);
        let radius = 0.11;
        let position = DVec3::new(radius * (1.0 + 1e-12), 0.0, 3.0);
        let flight = RelativeFlight::new(position, DVec3::ZERO, DVec3::new(0.0, 0.0, -10.0));
        let along = [DVec3::Z, DVec3::Y];
        let part = Rectangle { center: DVec3::ZERO, normal: DVec3::X, along, half: [3.5, 50.0] };
        let found = first_contact(&[Counted { part, asked: &asked }], &flight, radius, 1.0);
        assert_eq!(found, Some(f64::INFINITY));
        assert!(asked.get() < 100, "{}", asked.get());

        asked.set(0);
        let corners = [DVec3::new(0.0, -9.0, -9.0), DVec3::new(0.0, 9.0, -9.0), DVec3::new(0.0, 0.0, 20.0)];
        let part = Triangle::new(corners).expect("a triangle");
        let part = Counted { part, asked: &asked };
        assert_eq!(first_in_step(&part, &flight, radius, 0.0, [1.0, 1.0]), None);
        assert!(asked.get() < 100, "{}", asked.get());
    }

    /// What accelerates along a wall only meets it as a straight flight does.
    #[test]
    fn an_acceleration_along_a_wall_does_not_change_its_contacts() {
        let radius = 0.11;
        let along = [DVec3::Z, DVec3::Y];
        let face = Rectangle { center: DVec3::ZERO, normal: DVec3::X, along, half: [30.0, f64::INFINITY] };
        let corners =
            [DVec3::new(0.0, -90.0, -90.0), DVec3::new(0.0, 90.0, -90.0), DVec3::new(0.0, 0.0, 200.0)];
        let triangle = Triangle::new(corners).expect("a triangle");
        for gap in [1e-9, 1e-4, 0.3, 1.0] {
            for speed in [1e-3, 0.2, 5.0] {
                let position = DVec3::new(radius + gap, 0.0, 3.0);
                let velocity = DVec3::new(-speed, 0.1, 0.3);
                let within = (2.0 * gap / speed).min(1.5);
                let straight = RelativeFlight::new(position, velocity, DVec3::ZERO);
                let falling = RelativeFlight::new(position, velocity, DVec3::new(0.0, 0.0, -10.0));
                let of = |flight: &RelativeFlight| {
                    let face = first_contact(&[face], flight, radius, within).expect("none is lost");
                    [
                        face,
                        first_in_step(&triangle, flight, radius, 0.0, [within; 2]).unwrap_or(f64::INFINITY),
                    ]
                };
                let ([a, b], [c, d]) = (of(&straight), of(&falling));
                for found in [b, c, d] {
                    assert!(found == a || (found - a).abs() < 1e-12 * (1.0 + radius / speed), "{a} {found}");
                }
                assert_eq!(a < f64::INFINITY, gap / speed < within, "{a} {gap} {speed}");
            }
        }
    }
}
