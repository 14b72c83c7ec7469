/*!
The first zero of a function that is positive at the start, never a later one.

Conservative advancement: with f, f' at a point and a bound B ≥ −f'' ahead of it, f is above the parabola f +
f' s − ½ B s², so it has no zero before the parabola's. Repeated steps to that zero approach the first zero of
f from below: quadratically if f crosses it, linearly if f touches it, and never beyond it.
*/

/// Result of a search.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Search {
    /// The first zero, refined.
    At(f64),
    /// None up to here; the rest of the range has not been searched.
    Unfinished(f64),
    /// None in the range.
    None,
}

/// Steps after which a search returns, to be continued when that time has come: most predictions are
/// replaced before.
const MAX_STEPS: usize = 16;

/// Finds the first zero in (`from`, `to`] of a function with `f(s)` = (value, slope) and `bound(a, b)` ≥ −f''
/// on [a, b].
///
/// Values within ±`touch` of zero that do not fall faster than `slow` are no crossing: contacts that have
/// just separated, and grazing ones. A start at or below zero with a falling value is a crossing there.
pub(crate) fn first_crossing(
    f: &dyn Fn(f64) -> (f64, f64),
    bound: &dyn Fn(f64, f64) -> f64,
    from: f64,
    to: f64,
    touch: f64,
    slow: f64,
) -> Search {
    let mut s = from;
    let mut horizon = f64::INFINITY.min(to - from);
    for _ in 0..MAX_STEPS {
        if s >= to {
            return Search::None;
        }
        let (value, slope) = f(s);
        if value <= touch {
            if slope < -slow {
                return Search::At(polish(f, s, from, to));
            }
            match depart(f, bound, s, to, touch, slow) {
                Departure::Clear(next) => s = next,
                Departure::Returns(at) => return Search::At(at),
                Departure::Never => return Search::None,
            }
            continue;
        }
        // The bound may grow with its range.
        if !horizon.is_finite() {
            let b = bound(s, to);
            if b.is_finite() {
                horizon = to - s;
            } else {
                horizon = 1.0;
            }
        }
        let step = loop {
            let reach = horizon.min(to - s);
            let b = bound(s, s + reach);
            let step = safe_step(value - 0.5 * touch, slope, b);
            if step.is_finite() || b.is_finite() {
                if step > reach {
                    horizon *= 2.0;
                    break reach;
                }
                // Much shorter than the range: use a shorter range, with a tighter bound, next time.
                horizon = if step < 0.25 * reach { 4.0 * step } else { horizon };
                break step;
            }
            horizon *= 0.5;
        };
        let next = s + step;
        if next <= s {
            // Below the resolution of s.
            return Search::At(polish(f, s, from, to));
        }
        s = next;
    }
    Search::Unfinished(s)
}

/// First zero of v + s t − ½ b t², v > 0.
fn safe_step(v: f64, s: f64, b: f64) -> f64 {
    let v = v.max(0.0);
    let root = (s * s + 2.0 * b.max(0.0) * v).sqrt();
    if s < 0.0 {
        2.0 * v / (root - s)
    } else if b > 0.0 {
        (s + root) / b
    } else {
        f64::INFINITY
    }
}

enum Departure {
    /// Above `touch` again, from here on.
    Clear(f64),
    /// Returns to zero before it has left.
    Returns(f64),
    /// Within `touch` up to the end.
    Never,
}

/// Leaves the range within `touch` of zero, where rounding decides.
fn depart(
    f: &dyn Fn(f64) -> (f64, f64),
    bound: &dyn Fn(f64, f64) -> f64,
    s: f64,
    to: f64,
    touch: f64,
    slow: f64,
) -> Departure {
    let (start, slope) = f(s);
    let deepest = start.min(0.0) - touch;
    let mut reach = if slope > slow { 2.0 * touch / slope } else { 0.0 };
    let b = bound(s, s + reach.max((to - s).min(1.0)));
    if reach == 0.0 || reach * b > slope {
        // In this time the parabola changes by `touch`.
        reach = if b > 0.0 { (touch / b).sqrt() } else { touch };
    }
    let mut last = s;
    for _ in 0..2100 {
        let next = s + reach;
        if next >= to {
            return Departure::Never;
        }
        let (value, slope) = f(next);
        if value > touch {
            return Departure::Clear(next);
        }
        if value < deepest || (slope < -slow && value <= 0.0) {
            return Departure::Returns(fall(f, last, next, start.min(0.0)));
        }
        last = next;
        reach *= 1.5;
    }
    Departure::Never
}

/// The point between `from` and `to` where a function falls below a level, below which it is at `to`.
fn fall(f: &dyn Fn(f64) -> (f64, f64), mut from: f64, mut to: f64, level: f64) -> f64 {
    loop {
        let middle = from + 0.5 * (to - from);
        if middle <= from || middle >= to {
            return to;
        }
        let (value, slope) = f(middle);
        if value <= level && slope < 0.0 {
            to = middle;
        } else {
            from = middle;
        }
    }
}

/// Newton's method from a point next to a crossing; returns the best point.
fn polish(f: &dyn Fn(f64) -> (f64, f64), s: f64, from: f64, to: f64) -> f64 {
    let mut best = (s, f(s));
    let mut at = s;
    for _ in 0..8 {
        let (value, slope) = f(at);
        if value.abs() < best.1.0.abs() {
            best = (at, (value, slope));
        }
        if slope >= 0.0 || value == 0.0 {
            break;
        }
        let next = (at - value / slope).clamp(from, to);
        if next == at {
            break;
        }
        at = next;
    }
    best.0
}

#[cfg(test)]
mod tests {
    use super::*;

    fn part(f: &dyn Fn(f64) -> (f64, f64), bound: f64, from: f64, to: f64) -> Search {
        first_crossing(f, &|_, _| bound, from, to, 1e-14, 1e-13)
    }

    fn search(f: impl Fn(f64) -> (f64, f64), bound: f64, to: f64) -> Search {
        let mut found = part(&f, bound, 0.0, to);
        while let Search::Unfinished(from) = found {
            found = part(&f, bound, from, to);
        }
        found
    }

    #[test]
    fn the_first_of_two_close_crossings_is_found() {
        // Below zero for 2e-6 only.
        let dip = 1e-12;
        let f = |s: f64| ((s - 1.0).powi(2) - dip, 2.0 * (s - 1.0));
        // A loose bound: −f'' = −2 ≤ 5.
        let Search::At(at) = search(f, 5.0, 10.0) else { panic!("missed") };
        assert!((at - (1.0 - 1e-6)).abs() < 1e-9, "{at}");
    }

    #[test]
    fn the_crossing_after_a_near_miss_is_found() {
        let f = |s: f64| {
            (s.cos() + 1.0 + 1e-11 - 0.01 * (s - 5.0).max(0.0).powi(2), -s.sin() - 0.02 * (s - 5.0).max(0.0))
        };
        let Search::At(at) = search(f, 1.1, 100.0) else { panic!("missed") };
        assert!(at > 5.0 && f(at).0.abs() < 1e-12, "{at} {:?}", f(at));
        assert!((1..10_000).all(|k| f(at * f64::from(k) / 10_000.0 * 0.999_999).0 > 0.0));
    }

    #[test]
    fn a_function_that_starts_at_zero_crosses_only_when_it_returns() {
        let f = |s: f64| (s - 0.5 * s * s, 1.0 - s);
        assert_eq!(search(f, 1.0, 10.0), Search::At(2.0));
        // Leaves with the third power of time, as a contact does when its force has fallen to zero.
        let f = |s: f64| (s.powi(3) - s.powi(4), 3.0 * s * s - 4.0 * s.powi(3));
        let Search::At(at) = search(f, 12.0, 3.0) else { panic!("missed") };
        assert!((at - 1.0).abs() < 1e-15, "{at}");
    }

    #[test]
    fn a_positive_function_has_no_crossing() {
        assert_eq!(search(|s| (2.0 + s.sin(), s.cos()), 1.0, 100.0), Search::None);
        // Long ranges are searched in parts.
        let Search::Unfinished(at) = part(&|s: f64| (2.0 + s.sin(), s.cos()), 1.0, 0.0, 1e9) else {
            panic!()
        };
        assert!(at > MAX_STEPS as f64);
    }
}
