/*!
A sphere and a plane, a centre and a cell face: one coordinate under constant acceleration.

`d(t) = d + s t + ½ a t²` with the distance `d`, its rate `s` and its acceleration `a`, all along the normal
that points to the inside. For t in ℝ, `d` falls through zero at most once: at

```text
a < 0    (s + √disc)/|a|  =  2 d/(√disc − s)          disc = s² − 2 a d
a = 0     d/(−s)                                     if s < 0
a > 0     2 d/(√disc − s)                             if s < 0 and disc ≥ 0
```

Of the two forms for a < 0 the one without cancellation is used: the first if s ≥ 0, the second if s < 0.
*/

use crate::scale::{exponent, scaled};

/// Time until a sphere touches a plane wall \[time\], or `None`.
///
/// `distance` d of the sphere's surface from the plane \[length\], its rate `speed` s [length/time] and its
/// constant `acceleration` a [length/time²], all positive towards the inside. The smallest t ≥ 0 with
/// `d + s t + ½ a t² = 0` at which the sphere moves towards the wall; an apex that just grazes the wall
/// counts.
///
/// * Touching, d ≤ 0: at once if s < 0, or s = 0 and a < 0. If s > 0, when a < 0 brings it back through zero.
///   A bounce too small to reach zero from a distance below it by rounding returns to its own level, at −2
///   s/a.
/// * Not reached, in the past, beyond the f64 range, or an argument that is not finite: `None`.
///
/// ```
/// use haff_mechanics::time_to_plane;
/// assert_eq!(time_to_plane(5.0, 0.0, -10.0), Some(1.0)); // dropped: √(2 d/g)
/// assert_eq!(time_to_plane(0.0, 5.0, -10.0), Some(1.0)); // thrown up from the floor: 2 s/g
/// assert_eq!(time_to_plane(0.0, 5.0, 0.0), None);
/// assert_eq!(time_to_plane(2.0, -2.0, 1.0), Some(2.0)); // grazes at the apex
/// assert_eq!(time_to_plane(3.0, -2.0, 1.0), None); // turns back before
/// ```
#[inline]
#[must_use]
pub fn time_to_plane(distance: f64, speed: f64, acceleration: f64) -> Option<f64> {
    let (mut d, s, a) = (distance, speed, acceleration);
    if d <= 0.0 && (s < 0.0 || (s == 0.0 && a < 0.0)) {
        return Some(0.0);
    }
    // To treat every distance below zero as zero would restore energy that rounding has removed, but not
    // remove energy that it has added. Not `max`, which would turn NaN into a contact.
    let rises_above = s * s > 2.0 * a * d;
    if d < 0.0 && !rises_above {
        d = 0.0;
    }
    if a == 0.0 {
        return (s < 0.0).then(|| d / -s).filter(|t| t.is_finite());
    }
    descending_root(d, s, a, true)
}

/// Time until a coordinate leaves its cell through a face \[time\], or `None`.
///
/// `distance` d of the coordinate from the face \[length\], its rate `speed` s [length/time] and its constant
/// `acceleration` a [length/time²], all positive towards the cell's inside. The time t ≥ 0 at which
/// `d + s t + ½ a t²` falls through zero.
///
/// The start need not lie in the cell: with d < 0 and s > 0 the coordinate enters the cell first, and the
/// time is that of its later exit. Cell exits may therefore be computed from one start for a flight through
/// many cells.
///
/// * Beyond the face without coming back through it, d ≤ 0 with s < 0 (or s = 0 and a < 0): `Some(0.0)`,
///   never a time in the past.
/// * Below the face by rounding, with an apex that rounds to just below it: the time of the apex.
/// * A flight that only grazes the face from inside (a > 0, `s² = 2 a d`) does not leave: `None`.
/// * Not reached, beyond the f64 range, or an argument that is not finite: `None`.
///
/// For a flight that turns back between two cells, both compute the same discriminant: a crossing into the
/// neighbor always has its crossing back.
///
/// ```
/// use haff_mechanics::time_to_face;
/// assert_eq!(time_to_face(3.0, -1.5, 0.0), Some(2.0));
/// assert_eq!(time_to_face(-1e-17, -1.5, 0.0), Some(0.0)); // on the face by rounding, moving out
/// assert_eq!(time_to_face(-1e-17, 1.5, 0.0), None); // on the face by rounding, moving in
/// // Thrown up from 1 below the face at speed 3 in a = −4: enters at t = ½, leaves at t = 1.
/// assert_eq!(time_to_face(-1.0, 3.0, -4.0), Some(1.0));
/// // Turns back exactly on the face: contact for a wall, no exit from a cell.
/// assert_eq!(time_to_face(2.0, -2.0, 1.0), None);
/// ```
#[inline]
#[must_use]
pub fn time_to_face(distance: f64, speed: f64, acceleration: f64) -> Option<f64> {
    let (d, s, a) = (distance, speed, acceleration);
    if d <= 0.0 && (s < 0.0 || (s == 0.0 && a < 0.0)) {
        return Some(0.0);
    }
    if a == 0.0 {
        return (s < 0.0).then(|| d / -s).filter(|t| t.is_finite());
    }
    descending_root(d, s, a, false)
}

/// The falling zero of `d + s t + ½ a t²`, a ≠ 0, for flights that have not passed it yet.
#[inline]
fn descending_root(d: f64, s: f64, a: f64, grazing: bool) -> Option<f64> {
    if a > 0.0 && s >= 0.0 {
        return None;
    }
    let (ss, ad2) = (s * s, 2.0 * a * d);
    if (1e-250..1e300).contains(&(ss + ad2.abs())) {
        return root(d, s, a, ss - ad2, grazing).filter(|t| t.is_finite());
    }
    rescaled(d, s, a, grazing)
}

/// The falling zero from the discriminant.
#[inline]
fn root(d: f64, s: f64, a: f64, disc: f64, grazing: bool) -> Option<f64> {
    if a < 0.0 {
        // disc < 0 only if the start is below the face and the apex does not reach it: take the apex.
        let w = disc.max(0.0).sqrt();
        return Some(if s >= 0.0 { (s + w) / -a } else { 2.0 * d / (w - s) });
    }
    let reached = if grazing { disc >= 0.0 } else { disc > 0.0 };
    reached.then(|| 2.0 * d / (disc.sqrt() - s))
}

/// [`descending_root`] in units that are powers of two near d and near the larger of |s| and √|a d|.
#[cold]
#[inline(never)]
fn rescaled(d: f64, s: f64, a: f64, grazing: bool) -> Option<f64> {
    if !(d.is_finite() && s.is_finite() && a.is_finite()) {
        return None;
    }
    let ka = exponent(a.abs());
    if d == 0.0 {
        // a < 0 < s: up and back.
        return Some(scaled(s / scaled(-0.5 * a, -ka), -ka)).filter(|t| t.is_finite());
    }
    let kd = exponent(d.abs());
    let fall = i32::midpoint(ka, kd);
    let ks = if s == 0.0 { fall } else { fall.max(exponent(s.abs())) };
    let (d1, s1, a1) = (scaled(d, -kd), scaled(s, -ks), scaled(a, kd - 2 * ks));
    let disc = s1 * s1 - 2.0 * a1 * d1;
    let t = if a < 0.0 && s >= 0.0 {
        // a1 may have underflowed beside s1, but the return is due to a.
        Some(scaled((s1 + disc.max(0.0).sqrt()) / scaled(-a, -ka), ks - ka))
    } else {
        root(d1, s1, a1, disc, grazing).map(|t| scaled(t, kd - ks))
    };
    t.filter(|t| t.is_finite())
}
