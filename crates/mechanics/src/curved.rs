/*!
Contact of two spheres under a constant relative acceleration: a sphere in gravity and a fixed or driven one.

The distance `|q(t)|`, `q = r + v t + ½ a t²`, equals σ at the roots of a quartic. Its coefficients are never
formed: for |r| ≫ σ they cancel like those of the usual quadratic. Instead

```text
f(t)   = |q|² − σ²                                falls where the spheres approach
f'/2   = g(t) = q·w,      w = v + a t             a cubic: its zeros cut f into monotone pieces
g'     = |w|² + q·a                               a quadratic: its zeros cut g into monotone pieces
```

are evaluated from the vectors, which is exact for arguments moved by a few ulp, and every monotone piece on
which `f` falls through zero is found before a root is computed. No root can be missed, however close to
another it is: of two that merge, the minimum between them is evaluated itself.
*/

use crate::contact::time_to_contact;
use crate::roots::bracketed_root;
use crate::scale::{exponent, magnitude, scaled, scaled_vector};
use glam::DVec3;

/// Time until two spheres touch whose relative acceleration is constant \[time\], or `None`.
///
/// `r = r_j − r_i` \[length\], `v = v_j − v_i` [length/time], `a = a_j − a_i` [length/time²];
/// `sigma = R_i + R_j` > 0 \[length\]. The smallest t ≥ 0 with `|r + v t + ½ a t²| = σ` at which the distance
/// falls.
///
/// * Touching or overlapping at the start, and approaching in the next instant: `Some(0.0)`.
/// * Touching or overlapping, and separating: the time at which the acceleration has brought them back, to σ
///   or, where they overlap, to the distance of the start. So the smallest bounce returns, and an overlap by
///   rounding neither grows nor lets a sphere through.
/// * Not reached, beyond the f64 range, or an argument that is not finite: `None`.
///
/// With `a = 0` the result is that of [`time_to_contact`]. Even: `(−r, −v, −a)` gives the same bits. Powers
/// of two as units of length and time scale the result exactly.
///
/// ```
/// use glam::DVec3;
/// use haff_mechanics::time_to_contact_accelerated;
/// // Dropped from a clear height of 5 over a fixed sphere: √(2 · 5/10) = 1.
/// let (r, a) = (DVec3::new(0.0, 0.0, 6.0), DVec3::new(0.0, 0.0, -10.0));
/// let t = time_to_contact_accelerated(r, DVec3::ZERO, a, 1.0).unwrap();
/// assert!((t - 1.0).abs() < 1e-15);
/// // Thrown up from contact it returns after 2 s/g.
/// let t = time_to_contact_accelerated(DVec3::Z, DVec3::new(0.0, 0.0, 5.0), a, 1.0).unwrap();
/// assert!((t - 1.0).abs() < 1e-15);
/// ```
#[must_use]
pub fn time_to_contact_accelerated(r: DVec3, v: DVec3, a: DVec3, sigma: f64) -> Option<f64> {
    // In the units below: the acceleration takes 10⁹⁰ times longer to act than the flight over one length.
    const NEGLIGIBLE: f64 = 1e-90;
    if a == DVec3::ZERO {
        return time_to_contact(r, v, sigma);
    }
    if !(r.is_finite() && v.is_finite() && a.is_finite() && sigma > 0.0 && sigma.is_finite()) {
        return None;
    }
    // Units, powers of two: length near the larger of |r| and σ; time such that velocity and
    // acceleration are at most about 1 and one of them is.
    let kl = exponent(magnitude(r).max(sigma));
    let fall = (kl - exponent(magnitude(a))).div_euclid(2);
    let kt = if v == DVec3::ZERO { fall } else { fall.min(kl - exponent(magnitude(v))) };
    let (r1, v1) = (scaled_vector(r, -kl), scaled_vector(v, kt - kl));
    let (a1, sigma1) = (scaled_vector(a, 2 * kt - kl), scaled(sigma, -kl));
    if magnitude(a1) < NEGLIGIBLE {
        return time_to_contact(r, v, sigma);
    }
    Flight::new(r1, v1, a1, sigma1).first_contact().map(|t| scaled(t, kt)).filter(|t| t.is_finite())
}

/// A relative flight, in units in which everything is of order one.
struct Flight {
    r: DVec3,
    v: DVec3,
    a: DVec3,
    /// σ², or |r|² if the spheres overlap at the start.
    contact: f64,
    /// |r|² − σ² ≥ 0.
    gap: f64,
    /// (|r|/2)²: within this squared displacement `f` is summed from the gap.
    near: f64,
}

impl Flight {
    fn new(r: DVec3, v: DVec3, a: DVec3, sigma: f64) -> Self {
        let rr = r.length_squared();
        let contact = rr.min(sigma * sigma);
        Self { r, v, a, contact, gap: rr - contact, near: 0.25 * rr }
    }

    /// f = |q|² − σ² and its derivative 2 q·w.
    fn distance(&self, t: f64) -> (f64, f64) {
        let d = (self.v + self.a * (0.5 * t)) * t;
        let q = self.r + d;
        let w = self.v + self.a * t;
        let f = if d.length_squared() <= self.near {
            // |q|² − |r|² without the rounding of |r|²: a bounce far smaller than ε σ is still resolved.
            self.gap + d.dot(self.r + q)
        } else {
            q.length_squared() - self.contact
        };
        (f, 2.0 * q.dot(w))
    }

    /// g = q·w, half the rate of the squared distance, and its derivative |w|² + q·a.
    fn rate(&self, t: f64) -> (f64, f64) {
        let q = self.r + (self.v + self.a * (0.5 * t)) * t;
        let w = self.v + self.a * t;
        (q.dot(w), w.length_squared() + q.dot(self.a))
    }

    fn first_contact(&self) -> Option<f64> {
        let (r, v, a) = (self.r, self.v, self.a);
        let (b, va, aa) = (r.dot(v), v.dot(a), a.length_squared());
        let c = v.length_squared() + r.dot(a);
        // g(t) = b + c t + (3/2) v·a t² + ½ a² t³: its sign just after the start is that of the first
        // coefficient that is not zero, and the last one is positive.
        let mut approaching = [b, c, va].into_iter().find(|&x| x != 0.0).is_some_and(|x| x < 0.0);
        if approaching && self.gap <= 0.0 {
            return Some(0.0);
        }
        // Beyond `end` g is positive (Fujiwara's bound on the zeros of a polynomial, with a small margin).
        let bound =
            (3.0 * va.abs() / aa).max((2.0 * c.abs() / aa).sqrt()).max(libm::cbrt(2.0 * b.abs() / aa));
        let turns = quadratic_roots(1.5 * aa, 3.0 * va, c);
        let end = (2.01 * bound).max(2.0 * turns[1]);
        let (mut low, mut descent) = (0.0, 0.0);
        for (high, last) in [(turns[0], false), (turns[1], false), (end, true)] {
            if high <= low {
                continue;
            }
            let rate = self.rate(high).0;
            let turned = if approaching { last || rate > 0.0 } else { !last && rate < 0.0 };
            if turned {
                let extremum = bracketed_root(low, high, approaching, |t| self.rate(t));
                let f = self.distance(extremum).0;
                if approaching {
                    if f <= 0.0 {
                        return Some(bracketed_root(descent, extremum, false, |t| self.distance(t)));
                    }
                } else if f <= 0.0 {
                    // Back before the distance has grown by more than rounding.
                    return Some(extremum);
                }
                descent = extremum;
                approaching = !approaching;
            }
            low = high;
        }
        None
    }
}

/// Zeros of `a t² + b t + c`, a > 0, in rising order; twice zero if there are none.
fn quadratic_roots(a: f64, b: f64, c: f64) -> [f64; 2] {
    let disc = b * b - 4.0 * a * c;
    if disc.is_nan() || disc < 0.0 {
        return [0.0, 0.0];
    }
    // The zero of larger magnitude first; the other from the product c/a.
    let q = -0.5 * (b + disc.sqrt().copysign(b));
    if q == 0.0 {
        return [0.0, 0.0];
    }
    let (x, y) = (q / a, c / q);
    if x <= y { [x, y] } else { [y, x] }
}
