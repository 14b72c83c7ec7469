/*!
The first contact on any path whose acceleration is bounded.
*/

use crate::duration;

/// Contacts are found before the distance is this far below zero, in units of the scale.
const TOLERANCE: f64 = 1e-14;

/// Time until a distance first falls to zero \[time\], if it does so before `stop`; a later one is returned
/// or not.
///
/// `distance` gives the distance \[length\] and its rate [length/time] at a time from 0 to `until`. The
/// second derivative of the distance is nowhere there below −`bound` [length/time²]. What is found does not
/// depend on `stop` ≤ `until`. The search advances by steps in which the distance cannot reach zero with that
/// acceleration, and ends with Newton's method: no contact is missed, however short, unless the distance is
/// below zero by less than 10⁻¹⁴ `scale`.
///
/// * Touching or behind by rounding, and approaching: `Some(0.0)`.
/// * Touching and receding: the next contact.
///
/// ```
/// use haff_mechanics::first_contact_bounded;
/// // cos t falls to zero at π/2; its second derivative is at least −1.
/// let t = first_contact_bounded(|t| (t.cos(), -t.sin()), 1.0, 1.0, 10.0, 10.0).unwrap();
/// assert!((t - std::f64::consts::FRAC_PI_2).abs() < 1e-15);
/// ```
#[must_use]
pub fn first_contact_bounded(
    distance: impl Fn(f64) -> (f64, f64),
    bound: f64,
    scale: f64,
    until: f64,
    stop: f64,
) -> Option<f64> {
    let tolerance = TOLERANCE * scale;
    let mut time = 0.0;
    loop {
        let (gap, rate) = distance(time);
        if !(gap.is_finite() && rate.is_finite()) {
            return None;
        }
        if gap <= tolerance && rate < 0.0 {
            return Some(approach(time, (gap, rate), until, &distance));
        }
        let gap = gap.max(0.0);
        // The zero of gap + rate t − ½ bound t².
        let root = (rate * rate + 2.0 * bound * gap).sqrt();
        let step = if rate > 0.0 {
            (rate + root) / bound
        } else if gap > 0.0 {
            2.0 * gap / (root - rate)
        } else {
            0.0
        };
        // Within this time the distance does not fall by more than the tolerance.
        let least = if bound > 0.0 { duration(tolerance, rate.abs(), bound) } else { 0.0 };
        // Not shortened to `stop`: where a least step passes a contact, what is found must not depend on it.
        let next = (time + step.max(least)).min(until);
        // Nearer than the rounding of the time.
        if next == time && rate < 0.0 && step < f64::EPSILON * time {
            return Some(time);
        }
        // Also if nothing accelerates and the distance does not fall.
        if !(time + step < stop && next > time) {
            return None;
        }
        time = next;
    }
}

/// Newton's method from a time at which the distance is nearly zero and falls, within [0, `until`].
fn approach(time: f64, (gap, rate): (f64, f64), until: f64, distance: impl Fn(f64) -> (f64, f64)) -> f64 {
    let (mut time, mut gap, mut rate) = (time, gap, rate);
    for _ in 0..8 {
        let next = (time - gap / rate).clamp(0.0, until);
        let (next_gap, next_rate) = distance(next);
        // Where rounding decides, the steps do not become smaller any more.
        if next == time || next_rate >= 0.0 || next_gap.abs() >= gap.abs() {
            break;
        }
        (time, gap, rate) = (next, next_gap, next_rate);
    }
    time
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn contacts_of_oscillating_distances_are_the_first_ones() {
        for depth in [0.5_f64, 1e-6] {
            // Below zero only around t = π.
            let found =
                first_contact_bounded(|t| (t.cos() + 1.0 - depth, -t.sin()), 1.0, 1.0, 100.0, 100.0).unwrap();
            assert!((found - (depth - 1.0).acos()).abs() < 1e-12, "{depth}: {found}");
        }
        // Never below zero: from above by 10⁻⁹.
        assert_eq!(
            first_contact_bounded(|t| (t.cos() + 1.0 + 1e-9, -t.sin()), 1.0, 1.0, 1000.0, 1000.0),
            None
        );
    }

    #[test]
    fn a_contact_that_has_just_ended_is_not_found_again() {
        let bounce = |t: f64| (-1e-16 + 0.5 * t - 0.5 * t * t, 0.5 - t);
        let found = first_contact_bounded(bounce, 1.0, 1.0, 10.0, 10.0).unwrap();
        assert!((found - 1.0).abs() < 1e-12, "{found}");
        assert_eq!(first_contact_bounded(|t| (-1e-16 - t, -1.0), 1.0, 1.0, 10.0, 10.0), Some(0.0));
        assert_eq!(first_contact_bounded(|t| (1.0 + t, 1.0), 0.0, 1.0, 10.0, 10.0), None);
        assert_eq!(first_contact_bounded(|t| (1.0 - t, -1.0), 0.0, 1.0, 10.0, 10.0), Some(1.0));
        assert_eq!(first_contact_bounded(|t| (1.0 - t, -1.0), 0.0, 1.0, 0.5, 0.5), None);
        // At rest, touching, and pulled together.
        let pulled = |t: f64| (-0.5 * t * t, -t);
        assert!(first_contact_bounded(pulled, 1.0, 1.0, 1.0, 1.0).is_some_and(|t| t < 2e-7));
        assert!(first_contact_bounded(pulled, 1.0, 1.0, 1e-8, 1e-8).is_some_and(|t| t < 1e-8));
        // A least step leads beyond the stop, and the contact is that of a longer search.
        let near = |t: f64| (1e-10 - 0.05 * t, -0.05);
        let found = first_contact_bounded(near, 1.0, 1.0, 1.0, 1e-8);
        assert!(found.is_some_and(|t| (t - 2e-9).abs() < 1e-23), "{found:?}");
        assert_eq!(found, first_contact_bounded(near, 1.0, 1.0, 1.0, 1.0));
        assert_eq!(first_contact_bounded(near, 1.0, 1.0, 1.0, 1.9e-9), None);
        // A distance that rounding keeps above the tolerance: steps become shorter than the rounding of the
        // time.
        let rounded = |t: f64| ((12.0 - t).max(4e-16), -1.0);
        assert_eq!(first_contact_bounded(rounded, 0.0, 1e-3, 30.0, 30.0), Some(12.0));
        // A rate that is only rounding: Newton's step does not leave the interval.
        let barely = |t: f64| {
            assert!(t <= 0.5, "{t}");
            (1e-15, -1e-18)
        };
        assert_eq!(first_contact_bounded(barely, 1.0, 1.0, 0.5, 0.5), Some(0.0));
    }
}
