//! Bracketed root finding on monotone pieces.

/// The zero of a function that is monotone between `low` and `high`, 0 ≤ `low` < `high`, and changes sign
/// there.
///
/// `function` returns value and slope. `rises` is whether it is negative at `low` and positive at `high` (it
/// is not evaluated there). Newton's method; where a step leaves the bracket or does not halve the previous
/// one, the bracket is bisected instead, in the middle *of its bit patterns*: numbers that differ by hundreds
/// of orders of magnitude are then at most 64 bisections apart.
pub(crate) fn bracketed_root(low: f64, high: f64, rises: bool, function: impl Fn(f64) -> (f64, f64)) -> f64 {
    // A hundred would suffice: each bisection halves the distance in bits, each accepted Newton step halves
    // the step.
    const MAX_STEPS: u32 = 256;
    let (mut low, mut high) = (low, high);
    let mut t = low;
    let mut last_step = f64::INFINITY;
    let (mut value, mut slope) = function(t);
    for _ in 0..MAX_STEPS {
        let step = -value / slope;
        let newton = t + step;
        let next = if newton >= low && newton <= high && step.abs() <= 0.5 * last_step {
            last_step = step.abs();
            newton
        } else {
            let middle = f64::from_bits(low.to_bits() + (high.to_bits() - low.to_bits()) / 2);
            last_step = high - low;
            middle
        };
        if next == t || high.to_bits() - low.to_bits() <= 1 {
            return next;
        }
        t = next;
        (value, slope) = function(t);
        if value == 0.0 {
            return t;
        }
        if (value < 0.0) == rises {
            low = t;
        } else {
            high = t;
        }
    }
    t
}

#[cfg(test)]
mod tests {
    use super::bracketed_root;

    #[test]
    fn simple_multiple_and_distant_roots_are_found() {
        let root = bracketed_root(0.0, 2.0, true, |t| (t * t - 2.0, 2.0 * t));
        assert!((root - 2f64.sqrt()).abs() <= 2.0 * f64::EPSILON, "{root}");
        // Triple root: the value vanishes to rounding within ε^{1/3} of it.
        let root = bracketed_root(0.0, 7.0, false, |t| ((1.0 - t).powi(3), -3.0 * (1.0 - t).powi(2)));
        assert!((root - 1.0).abs() <= 1e-5, "{root}");
        // Brackets over the whole range of f64.
        for target in [1e-300, 1e-12, 3.0, 1e200] {
            let root = bracketed_root(0.0, f64::MAX, true, |t| (t - target, 1.0));
            assert!((root - target).abs() <= 2.0 * f64::EPSILON * target, "{root} against {target}");
        }
        // Slopes that lead Newton's method out of the bracket, or are NaN.
        let root = bracketed_root(0.0, 1e9, true, |t| (libm::atan(t - 5.0), f64::NAN));
        assert!((root - 5.0).abs() <= 4.0 * 5.0 * f64::EPSILON, "{root}");
    }
}
