//! Integrals over the motion of an oscillating plane against sums over many short steps.

use haff_mechanics::{Oscillation, Waveform};

/// ∫ f over [−half, half], with breaks of f only between the steps: Gauss's rule with four points in each.
fn gauss(breaks: &[f64], f: impl Fn(f64) -> f64) -> f64 {
    const POINTS: [(f64, f64); 2] = [
        (0.339_981_043_584_856_26, 0.652_145_154_862_546_1),
        (0.861_136_311_594_052_6, 0.347_854_845_137_453_86),
    ];
    // Compensated, so that the sum itself has no error.
    let (mut sum, mut rest) = (0.0_f64, 0.0_f64);
    for pair in breaks.windows(2) {
        const STEPS: usize = 200;
        let width = (pair[1] - pair[0]) / STEPS as f64;
        for step in 0..STEPS {
            let middle = pair[0] + width * (step as f64 + 0.5);
            for (x, weight) in POINTS {
                let term = 0.5 * width * weight * (f(middle - 0.5 * width * x) + f(middle + 0.5 * width * x));
                let total = sum + term;
                rest += if sum.abs() >= term.abs() { sum - total + term } else { term - total + sum };
                sum = total;
            }
        }
    }
    sum + rest
}

#[test]
fn integrals_are_those_of_the_velocity() {
    for waveform in [Waveform::Sine, Waveform::Triangle] {
        let plate = Oscillation { waveform, amplitude: 0.3, frequency: 1.7 };
        for duration in [1e-3, 0.03, 0.2, 0.41, 1.3, 7.9] {
            for k in 0..24 {
                let middle = f64::from(k) / 24.0 + 1.0 / 97.0;
                let half = 0.5 * duration;
                let phase = |t: f64| middle + plate.frequency * t;
                // Corners of the triangle.
                let mut breaks = vec![-half];
                let mut corner = (2.0 * (phase(-half) + 0.25)).ceil();
                while 0.5 * corner - 0.25 < phase(half) {
                    breaks.push((0.5 * corner - 0.25 - middle) / plate.frequency);
                    corner += 1.0;
                }
                breaks.push(half);
                let velocity = |t: f64| plate.velocity(phase(t));
                let expected = [
                    gauss(&breaks, velocity),
                    gauss(&breaks, |t| t * velocity(t)),
                    gauss(&breaks, |t| velocity(t).powi(2)),
                ];
                let found = plate.integrals(middle, duration);
                // Some tens of roundings of the largest value that the integral can have.
                let (speed, rounding) = (plate.max_speed(), 64.0 * f64::EPSILON);
                let scales = [speed * duration, speed * duration * half, speed * speed * duration];
                for ((found, expected), scale) in found.into_iter().zip(expected).zip(scales) {
                    assert!(
                        (found - expected).abs() <= rounding * scale,
                        "{waveform:?}, {duration} around {middle}: {found:e}, quadrature {expected:e}"
                    );
                }
            }
        }
    }
}

/// Where a sine turns, the square of the velocity over a short time is V² ω² τ³/12: nothing is lost by the
/// cancellation of τ and sin ωτ/ω.
#[test]
fn short_times_keep_their_digits() {
    let plate = Oscillation { waveform: Waveform::Sine, amplitude: 2.0, frequency: 0.5 };
    let omega = std::f64::consts::PI;
    for duration in [1e-2, 1e-4, 1e-6] {
        let [moved, moment, square] = plate.integrals(0.25, duration);
        let (angle, acceleration) = (omega * duration, plate.max_acceleration());
        let speed = plate.max_speed();
        let first = -acceleration * duration.powi(3) / 12.0;
        assert!(moved.abs() < 1e-16 * speed, "{moved:e}: the plane returns");
        assert!(
            (moment / first - 1.0 + angle * angle / 40.0).abs() < 1e-12 + angle.powi(4),
            "{moment:e} {first:e}"
        );
        let second = (speed * omega).powi(2) * duration.powi(3) / 12.0;
        assert!((square / second - 1.0 + angle * angle / 20.0).abs() < 1e-12 + angle.powi(4), "{square:e}");
    }
}
