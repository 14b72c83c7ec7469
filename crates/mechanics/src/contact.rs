/*!
Contact of two spheres in straight relative flight.

The time is the smaller root of `|r + v t| = σ`. The usual discriminant `b² − v² (r² − σ²)`, with `b = r·v`,
cancels where the spheres start many diameters apart; the equal expression `v²σ² − |r × v|²` does not. The
root `gap/(−b + √disc)`, `gap = r² − σ²`, is `(−b − √disc)/v²` without its cancellation. It is limited to
`t ≤ −b/v²`, the closest approach: where spheres touch and slide along each other, the three numbers of the
quotient are only rounding errors.
*/

use crate::scale::{exponent, magnitude, scaled, scaled_vector};
use glam::DVec3;

/// Between these, squares of speeds and their products with squares of lengths stay far from overflow and
/// underflow.
const SMALL: f64 = 1e-140;
const LARGE: f64 = 1e140;

/// Time until two spheres in straight relative flight touch \[time\], or `None`.
///
/// `r = r_j − r_i` \[length\] and `v = v_j − v_i` [length/time] at the start; `sigma = R_i + R_j` > 0
/// \[length\]. Equal accelerations cancel. Smaller root of `|r + v t| = σ`.
///
/// * Only approaching spheres, `r·v < 0`, touch.
/// * Touching or overlapping and approaching: `Some(0.0)`. See [`is_rounding_noise`].
/// * Touching or overlapping and not approaching: `None`.
/// * A time beyond the f64 range, or an argument that is not finite: `None`.
///
/// Even: `(−r, −v)` gives the same bits. Powers of two as units of length and time scale the result exactly.
/// The error is that of moving the arguments by a few ulp (table in the crate's README).
///
/// ```
/// use glam::DVec3;
/// use haff_mechanics::time_to_contact;
/// let (r, v) = (DVec3::new(5.0, 0.0, 0.0), DVec3::new(-2.0, 0.0, 0.0));
/// assert_eq!(time_to_contact(r, v, 1.0), Some(2.0));
/// assert_eq!(time_to_contact(r, -v, 1.0), None);
/// assert_eq!(time_to_contact(DVec3::X, v, 1.0), Some(0.0));
/// ```
#[inline]
#[must_use]
pub fn time_to_contact(r: DVec3, v: DVec3, sigma: f64) -> Option<f64> {
    let b = r.dot(v);
    // Above this, no product lost in underflow can have hidden an approach. Half of all pairs end here.
    if b > SMALL {
        return None;
    }
    let (rr, vv, ss) = (r.length_squared(), v.length_squared(), sigma * sigma);
    if vv > SMALL && vv * ss > SMALL && vv * (rr + ss) < LARGE {
        return time_to_contact_unscaled(r, v, ss);
    }
    time_to_contact_rescaled(r.x, r.y, r.z, v.x, v.y, v.z, sigma)
}

/// [`time_to_contact`] for arguments whose squares and products of squares neither overflow nor underflow,
/// which a caller that has tested its units once need not test for every pair; `sigma2` = σ² \[length²\].
///
/// ```
/// use glam::DVec3;
/// use haff_mechanics::{time_to_contact, time_to_contact_unscaled};
/// let (r, v) = (DVec3::new(5.0, 0.3, 0.0), DVec3::new(-2.0, 0.1, 0.0));
/// assert_eq!(time_to_contact_unscaled(r, v, 1.44), time_to_contact(r, v, 1.2));
/// ```
#[expect(clippy::neg_cmp_op_on_partial_ord, reason = "not a number gives no contact")]
#[inline(always)]
#[must_use]
pub fn time_to_contact_unscaled(r: DVec3, v: DVec3, sigma2: f64) -> Option<f64> {
    let (b, rr, vv, ss) = (r.dot(v), r.length_squared(), v.length_squared(), sigma2);
    if b >= 0.0 {
        return None;
    }
    // (|r| − σ)(|r| + σ) takes one square root more and has a larger error: at most 2.1 ε (r² + σ²) against
    // 1.4.
    let gap = rr - ss;
    if gap <= 0.0 {
        // Before the discriminant, which may round below zero in a grazing contact.
        return Some(0.0);
    }
    let disc = vv * ss - r.cross(v).length_squared();
    if !(disc >= 0.0) {
        return None;
    }
    let denominator = disc.sqrt() - b;
    // No contact is later than the closest approach, at −b/v². For a pair that touches and slides along, b,
    // gap and disc are near zero, each with its own rounding error: their quotient could be any time.
    if gap * vv > -b * denominator {
        return Some(-b / vv);
    }
    Some(gap / denominator)
}

/// [`time_to_contact`] in units of length and time that are powers of two near |r|, σ and |v|.
///
/// Scalars, because vectors would be passed by pointer and the caller would keep them in memory: 20 ns a pair
/// instead of 9.
#[cold]
#[inline(never)]
fn time_to_contact_rescaled(x: f64, y: f64, z: f64, vx: f64, vy: f64, vz: f64, sigma: f64) -> Option<f64> {
    let (r, v) = (DVec3::new(x, y, z), DVec3::new(vx, vy, vz));
    let (length, speed) = (magnitude(r).max(sigma), magnitude(v));
    if !(r.is_finite() && v.is_finite() && sigma > 0.0 && sigma.is_finite() && speed > 0.0) {
        return None;
    }
    let (kl, kv) = (exponent(length), exponent(speed));
    let (r, v, sigma) = (scaled_vector(r, -kl), scaled_vector(v, -kv), scaled(sigma, -kl));
    time_to_contact_unscaled(r, v, sigma * sigma).map(|t| scaled(t, kl - kv)).filter(|t| t.is_finite())
}

/// Whether the approach of a touching pair is only rounding error.
///
/// `r = r_j − r_i` \[length\], `v = v_j − v_i`, `speed_scale` = the larger of `|v_i|` and `|v_j|`
/// [length/time]. True if the pair approaches no faster than `4 ε speed_scale`, ε = 2⁻⁵², or does not
/// approach at all.
///
/// An impact with e = 0 should leave no normal velocity, but velocities are stored with an error of half an
/// ulp each, so that an approach of a few ulp may remain; [`time_to_contact`] of a pair that then overlaps by
/// rounding is `Some(0.0)`, and resolving that contact leaves the same few ulp, without end. An engine that
/// predicts a contact **at zero time** should therefore drop it when this function returns true: the pair is
/// at rest in contact, and until another contact moves one of them it can overlap by at most 4 ε times the
/// path flown. A contact at a positive time needs no such check, because time advances.
///
/// ```
/// use glam::DVec3;
/// use haff_mechanics::{is_rounding_noise, time_to_contact};
/// let r = DVec3::new(1.0 - 2e-16, 0.0, 0.0);
/// let residue = DVec3::new(-2e-16, 0.0, 0.0); // both bodies move at speed 1
/// assert_eq!(time_to_contact(r, residue, 1.0), Some(0.0));
/// assert!(is_rounding_noise(r, residue, 1.0));
/// assert!(!is_rounding_noise(r, residue, 1e-6)); // for slow bodies the same approach is motion
/// ```
#[inline]
#[must_use]
pub fn is_rounding_noise(r: DVec3, v: DVec3, speed_scale: f64) -> bool {
    -r.dot(v) <= CONTACT_NOISE * r.length() * speed_scale
}

/// Approach speeds up to this fraction of the bodies' speeds are rounding: 4 ε, one ε for each stored
/// velocity, its normal component and their difference.
pub const CONTACT_NOISE: f64 = 4.0 * f64::EPSILON;
