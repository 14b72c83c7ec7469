//! Distances from shapes in 400-bit arithmetic.

use dashu_float::{FBig, round::mode::HalfEven};
use glam::DVec3;

const BITS: usize = 400;

pub type Big = FBig<HalfEven, 2>;

pub fn big(x: f64) -> Big {
    Big::try_from(x).expect("a finite number").with_precision(BITS).value()
}

pub fn nearest(x: &Big) -> f64 {
    x.to_f64().value()
}

fn square_root(x: &Big) -> Big {
    if x <= &Big::ZERO { big(0.0) } else { x.sqrt() }
}

#[derive(Debug, Clone)]
pub struct Vector(pub [Big; 3]);

impl Vector {
    pub fn of(v: DVec3) -> Self {
        Self(v.to_array().map(big))
    }

    pub fn dot(&self, other: &Self) -> Big {
        let ([a, b, c], [x, y, z]) = (&self.0, &other.0);
        a * x + b * y + c * z
    }

    pub fn minus(&self, other: &Self) -> Self {
        let ([a, b, c], [x, y, z]) = (&self.0, &other.0);
        Self([a - x, b - y, c - z])
    }

    pub fn plus(&self, other: &Self, factor: &Big) -> Self {
        let ([a, b, c], [x, y, z]) = (&self.0, &other.0);
        Self([a + x * factor, b + y * factor, c + z * factor])
    }

    pub fn length(&self) -> Big {
        square_root(&self.dot(self))
    }

    /// Of exactly unit length.
    pub fn unit(&self) -> Self {
        let length = self.length();
        let [x, y, z] = &self.0;
        Self([x / &length, y / &length, z / &length])
    }
}

/// x + v t + ½ a t²
pub fn flight(x: DVec3, v: DVec3, a: DVec3, t: f64) -> Vector {
    let time = big(t);
    let half = big(0.5) * &time * &time;
    Vector::of(x).plus(&Vector::of(v), &time).plus(&Vector::of(a), &half)
}

/// Distance from a line segment, or from a whole line if `limited` is false.
fn from_segment(position: &Vector, [a, b]: [&Vector; 2], limited: bool) -> Big {
    let (along, r) = (b.minus(a), position.minus(a));
    let mut s = r.dot(&along) / along.dot(&along);
    if limited {
        s = s.max(big(0.0)).min(big(1.0));
    }
    r.plus(&along, &-s).length()
}

/// Distance from a triangle: from its plane if the foot is inside, otherwise from the nearest edge.
pub fn from_triangle(position: &Vector, corners: [DVec3; 3]) -> Big {
    let corners = corners.map(Vector::of);
    let cross = |a: &Vector, b: &Vector| {
        let ([a, b, c], [x, y, z]) = (&a.0, &b.0);
        Vector([b * z - c * y, c * x - a * z, a * y - b * x])
    };
    let normal = cross(&corners[1].minus(&corners[0]), &corners[2].minus(&corners[0]));
    let inside = (0..3).all(|k| {
        let edge = corners[(k + 1) % 3].minus(&corners[k]);
        cross(&edge, &position.minus(&corners[k])).dot(&normal) >= Big::ZERO
    });
    if inside {
        let height = position.minus(&corners[0]).dot(&normal.unit());
        return if height < Big::ZERO { -height } else { height };
    }
    let edges = (0..3).map(|k| from_segment(position, [&corners[k], &corners[(k + 1) % 3]], true));
    edges.reduce(Ord::min).unwrap()
}

/// Distance from the lines of a profile, each from one point (ρ, z) to another, turned around an axis.
pub fn from_profile(
    position: &Vector,
    origin: DVec3,
    axis: DVec3,
    lines: &[([Big; 2], [Big; 2], bool)],
) -> Big {
    let axis = Vector::of(axis).unit();
    let r = position.minus(&Vector::of(origin));
    let z = r.dot(&axis);
    let rho = r.plus(&axis, &-z.clone()).length();
    let point = Vector([rho, z, big(0.0)]);
    let lines = lines.iter().map(|([a, b], [c, d], limited)| {
        let ends = [[a, b], [c, d]].map(|[x, y]| Vector([x.clone(), y.clone(), big(0.0)]));
        from_segment(&point, [&ends[0], &ends[1]], *limited)
    });
    lines.reduce(Ord::min).unwrap()
}
