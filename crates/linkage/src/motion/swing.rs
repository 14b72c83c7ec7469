/*!
The pendulum in closed form, for every amplitude: libration, rotation and the separatrix between them.

With half the angle from the vertical, S = sin(θ/2), C = cos(θ/2), and W = θ̇/(2ω₀), ω₀ = √(g/l), the energy
is m = S² + W²: the parameter of the elliptic functions, below 1 in libration, above in rotation. Then S = √m
sn(ω₀t + φ), and the addition theorem gives the state after t from the one at the start without φ, that is
without any inverse function:

```text
S' = (S cn dn + W C sn)/D      C' = (C dn − S W sn cn)/D      W' = (W cn − S C sn dn)/D      D = cn² + C² sn²
```

with sn, cn, dn of ω₀t. All terms keep their relative accuracy down to the smallest amplitude, and so does m1
= 1 − m = C² − W² at the separatrix. For m > 1: sn(u|m) = sn(√m u|1/m)/√m, cn = dn, dn = cn.
*/

use glam::DVec3;

use crate::elliptic::jacobi;

/// A body that swings about a center.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Swing {
    center: DVec3,
    length: f64,
    gravity: f64,
    /// Unit vector of gravity, and the one perpendicular to it in the plane of the motion.
    down: DVec3,
    side: DVec3,
    frequency: f64,
    half_sin: f64,
    half_cos: f64,
    speed: f64,
    m: f64,
    m1: f64,
}

impl Swing {
    /// A body at `position` about `center` \[length\] with a perpendicular velocity; `None` if the motion is
    /// not in a plane with gravity, or gravity is zero.
    pub fn new(center: DVec3, length: f64, position: DVec3, velocity: DVec3, gravity: DVec3) -> Option<Self> {
        let relative = position - center;
        let g = gravity.length();
        if g == 0.0 {
            return None;
        }
        let (down, u) = (gravity / g, relative.normalize());
        let scale = velocity.length() + (g * length).sqrt();
        let across = u - down * u.dot(down);
        // At the lowest or highest point the velocity determines the plane.
        let side = if across.length() > 1e-12 {
            across.normalize()
        } else if velocity.length() > 1e-14 * scale {
            (velocity - down * velocity.dot(down)).normalize()
        } else {
            down.any_orthonormal_vector()
        };
        // The component out of the plane is exactly zero in planar scenes.
        let out = velocity - down * velocity.dot(down) - side * velocity.dot(side);
        if out.length() > 1e-13 * scale {
            return None;
        }
        let (cos, sin) = (u.dot(down), u.dot(side));
        let (half_sin, half_cos) = if cos >= 0.0 {
            let c = ((1.0 + cos) * 0.5).sqrt();
            (sin / (2.0 * c), c)
        } else {
            let s = ((1.0 - cos) * 0.5).sqrt().copysign(sin);
            (s, sin / (2.0 * s))
        };
        let norm = libm::hypot(half_sin, half_cos);
        let (half_sin, half_cos) = (half_sin / norm, half_cos / norm);
        let frequency = (g / length).sqrt();
        let tangential = velocity.dot(side) * cos - velocity.dot(down) * sin;
        let speed = tangential / (2.0 * frequency * length);
        Some(Self {
            center,
            length,
            gravity: g,
            down,
            side,
            frequency,
            half_sin,
            half_cos,
            speed,
            m: half_sin * half_sin + speed * speed,
            m1: (half_cos - speed) * (half_cos + speed),
        })
    }

    /// sin and cos of half the angle, and W, after `tau`.
    fn halves(&self, tau: f64) -> (f64, f64, f64) {
        let (s, c, w) = (self.half_sin, self.half_cos, self.speed);
        let u = self.frequency * tau;
        let (sn, cn, dn) = if self.m1 >= 0.0 {
            jacobi(u, self.m, self.m1)
        } else {
            let k = self.m.sqrt();
            let (sn, cn, dn) = jacobi(k * u, 1.0 / self.m, -self.m1 / self.m);
            (sn / k, dn, cn)
        };
        let d = cn * cn + c * c * sn * sn;
        let (s1, c1) = ((s * cn * dn + w * c * sn) / d, (c * dn - s * w * sn * cn) / d);
        let w1 = (w * cn - s * c * sn * dn) / d;
        // S² + W² = m and C² − W² = m1 hold as exactly as the larger of the two terms determines the smaller.
        if w1 * w1 >= 0.5 * self.m {
            let norm = libm::hypot(s1, c1);
            let (s1, c1) = (s1 / norm, c1 / norm);
            return (s1, c1, (self.m - s1 * s1).max(0.0).sqrt().copysign(w1));
        }
        let (s2, c2) = (self.m - w1 * w1, self.m1 + w1 * w1);
        // At the top of a rotation C² is the difference of two large numbers.
        if self.m1 >= 0.0 || c2 >= 0.25 {
            return (s2.sqrt().copysign(s1), c2.sqrt().copysign(c1), w1);
        }
        let norm = libm::hypot(s1, c1);
        (s1 / norm, c1 / norm, w1)
    }

    /// Position and velocity.
    pub fn state(&self, tau: f64) -> (DVec3, DVec3) {
        let (relative, velocity) = self.relative(tau);
        (self.center + relative, velocity)
    }

    /// Position relative to the center, and velocity.
    fn relative(&self, tau: f64) -> (DVec3, DVec3) {
        let (s, c, w) = self.halves(tau);
        let (sin, cos) = (2.0 * s * c, (c - s) * (c + s));
        let speed = 2.0 * self.frequency * self.length * w;
        ((self.down * cos + self.side * sin) * self.length, (self.side * cos - self.down * sin) * speed)
    }

    /// Force along the string over the mass, positive if it pulls inwards, v²/l + g cos θ, and its slope
    /// [length/time²], [length/time³].
    pub fn tension(&self, tau: f64) -> (f64, f64) {
        let (s, c, w) = self.halves(tau);
        let rate = 2.0 * self.frequency * w;
        (
            self.length * rate * rate + self.gravity * (c - s) * (c + s),
            -3.0 * self.gravity * 2.0 * s * c * rate,
        )
    }

    /// Bound on the second derivative of the tension.
    pub fn tension_bound(&self) -> f64 {
        3.0 * self.gravity * self.frequency * self.frequency * (4.0 * self.m + 1.0)
    }

    /// Bound on the speed.
    pub fn speed_bound(&self) -> f64 {
        2.0 * self.frequency * self.length * self.m.sqrt()
    }

    /// Acceleration.
    pub fn acceleration(&self, tau: f64) -> DVec3 {
        let (s, c, w) = self.halves(tau);
        let (sin, cos) = (2.0 * s * c, (c - s) * (c + s));
        let rate = 2.0 * self.frequency * w;
        let (outward, along) = (self.down * cos + self.side * sin, self.side * cos - self.down * sin);
        along * (-self.gravity * sin) - outward * (self.length * rate * rate)
    }

    /// The same motion about another center.
    pub fn about(&self, center: DVec3) -> Self {
        Self { center, ..self.clone() }
    }

    /// Bound on the acceleration relative to another pendulum, within `t` from times of both.
    ///
    /// With the difference ρ of the positions relative to the centers, and ν of the velocities, the
    /// difference of accelerations is at most α |ρ| + β |ν| + c, α = (V²/l + 2g)/l, β = 2V/l, with c from
    /// the difference of lengths. So √α |ρ| + |ν| grows at most with the rate κ = √α + β.
    pub fn relative_acceleration_bound(&self, tau: f64, other: &Self, other_tau: f64, t: f64) -> f64 {
        if self.down != other.down || self.gravity != other.gravity {
            return f64::INFINITY;
        }
        let speed = self.speed_bound().max(other.speed_bound());
        let (l, g) = (self.length.min(other.length), self.gravity);
        let turning = speed * speed / l;
        let (alpha, beta) = ((turning + 2.0 * g) / l, 2.0 * speed / l);
        let c = 2.0 * (turning + g) * (self.length - other.length).abs() / l;
        let ((r, v), (s, w)) = (self.relative(tau), other.relative(other_tau));
        let kappa = alpha.sqrt() + beta;
        let start = alpha.sqrt() * (r - s).length() + (v - w).length();
        kappa * (start + c / kappa) * libm::exp(kappa * t) + c
    }

    /// Bound on the rate of change of the acceleration g − T u, with T' ≤ 3 g θ̇.
    pub fn jerk_bound(&self) -> f64 {
        let rate = 2.0 * self.frequency * self.m.sqrt();
        rate * (3.0 * self.gravity + self.acceleration_bound())
    }

    /// Bound on the acceleration.
    pub fn acceleration_bound(&self) -> f64 {
        self.gravity * (1.0 + 4.0 * self.m)
    }

    /// Center and radius of the circle.
    pub fn enclosing_sphere(&self) -> (DVec3, f64) {
        (self.center, self.length)
    }

    /// A time over which the motion changes.
    pub fn timescale(&self) -> f64 {
        1.0 / (self.frequency * self.m.sqrt().max(1.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::elliptic::complete_elliptic_integral;

    fn swing(angle: f64, rate: f64, length: f64, g: f64) -> Swing {
        let (sin, cos) = libm::sincos(angle);
        let relative = DVec3::new(sin, -cos, 0.0) * length;
        let velocity = DVec3::new(cos, sin, 0.0) * (rate * length);
        Swing::new(DVec3::ZERO, length, relative, velocity, DVec3::new(0.0, -g, 0.0)).unwrap()
    }

    #[test]
    fn quarter_period_is_the_complete_elliptic_integral() {
        for angle in [1e-8, 0.1, 1.0, 2.0, 3.0, 3.13] {
            let of = swing(angle, 0.0, 0.7, 9.81);
            let quarter = (0.7_f64 / 9.81).sqrt() * complete_elliptic_integral((angle * 0.5).cos().powi(2));
            let (r, v) = of.relative(quarter);
            let speed = 2.0 * (9.81_f64 * 0.7).sqrt() * (0.5 * angle).sin();
            // Near the top the rounding of the bob's position determines when it falls.
            let condition = 1.0 + 1.0 / (0.5 * angle).cos();
            assert!(r.x.abs() < 4e-16 * condition * speed * quarter, "{angle}: {r}");
            assert!((v.length() / speed - 1.0).abs() < 4e-15, "{angle}: {v} against {speed}");
            let (r, _) = of.relative(4.0 * quarter);
            assert!((r.x / (0.7 * angle.sin()) - 1.0).abs() < 1e-14 * condition * condition, "{angle}: {r}");
        }
    }

    #[test]
    fn energy_is_conserved_in_libration_rotation_and_at_the_separatrix() {
        for (angle, rate) in [(0.3, 1.0), (2.5, 3.0), (0.1, 7.0), (3.0, 0.05), (0.0, 2.0), (-2.0, -20.0)] {
            let of = swing(angle, rate, 1.0, 1.0);
            let energy = |(r, v): (DVec3, DVec3)| 0.5 * v.length_squared() + r.y;
            let start = energy(of.relative(0.0));
            for k in 0..2000 {
                let state = of.relative(0.1 * f64::from(k));
                let error = (energy(state) - start).abs();
                assert!(error < 3e-15 * (2.0 + start.abs()), "{angle}, {rate}: {error} at {k}");
            }
        }
        // The separatrix: the bob approaches the top without reaching it.
        let of = swing(0.0, 2.0, 1.0, 1.0);
        let (r, v) = of.relative(30.0);
        assert!((r.y - 1.0).abs() < 1e-15 && v.length() < 1e-12, "{r} {v}");
    }

    #[test]
    fn velocity_and_tension_are_derivatives_of_the_motion() {
        for (angle, rate) in [(0.3, 1.0), (1.0, 3.0), (2.9, -0.4)] {
            let of = swing(angle, rate, 1.3, 2.0);
            for k in 1..60 {
                let (t, h) = (0.13 * f64::from(k), 1e-4);
                let difference = (of.relative(t + h).0 - of.relative(t - h).0) / (2.0 * h);
                let ((r, v), a) = (of.relative(t), (of.relative(t + h).1 - of.relative(t - h).1) / (2.0 * h));
                assert!((difference - v).length() < 1e-6, "{difference} {v}");
                let inward = -(a - DVec3::new(0.0, -2.0, 0.0)).dot(r) / 1.3;
                let (tension, slope) = of.tension(t);
                assert!((inward - tension).abs() < 1e-5, "{inward} {tension}");
                let numeric = (of.tension(t + h).0 - of.tension(t - h).0) / (2.0 * h);
                assert!((numeric - slope).abs() < 1e-5, "{numeric} {slope}");
            }
        }
    }
}
