/*!
Jacobi's elliptic functions, and the complete integral K.

Not from a crate, because those available take only the parameter m: near the separatrix of a pendulum m is 1
within rounding, and all digits of the period are in 1 − m. Here both are arguments.
*/

/// sn, cn and dn of `u` for the parameter `m` = k² in [0, 1], with its complement `m1` = 1 − m ≥ 0 given
/// separately.
///
/// Descending Landen transformation over the arithmetic-geometric mean (Abramowitz and Stegun 16.4). Its
/// angles are computed with `atan2`, which is accurate near m = 1, where their sines are near 1.
pub(crate) fn jacobi(u: f64, m: f64, m1: f64) -> (f64, f64, f64) {
    if m1 <= 0.0 {
        let cn = 1.0 / libm::cosh(u);
        return (libm::tanh(u), cn, cn);
    }
    // Quadratic convergence: with m1 ≥ 5e-324, fewer than 16 steps.
    let mut ladder = [(0.0, 0.0); 16];
    let (mut a, mut b, mut c) = (1.0_f64, m1.sqrt(), m.sqrt());
    let mut steps = 0;
    while c > a * 1e-17 && steps < ladder.len() {
        let mean = 0.5 * (a + b);
        // c' = (a − b)/2 = c²/4a', without the cancellation.
        c = c * c / (4.0 * mean);
        b = (a * b).sqrt();
        a = mean;
        ladder[steps] = (c / a, b / a);
        steps += 1;
    }
    let mut phi = libm::ldexp(a, steps as i32) * u;
    for &(k, k1) in ladder[..steps].iter().rev() {
        let (sin, cos) = libm::sincos(phi);
        // sin(2φ' − φ) = k sin φ, on the branch of φ.
        phi = 0.5 * (phi + libm::atan2(k * sin, (cos * cos + k1 * k1 * sin * sin).sqrt()));
    }
    let (sn, cn) = libm::sincos(phi);
    (sn, cn, (cn * cn + m1 * sn * sn).sqrt())
}

/// Complete elliptic integral of the first kind K from the complement `m1` = 1 − m of its parameter: the
/// quarter period of a pendulum of amplitude α is √(l/g) K, m = sin²(α/2).
///
/// ```
/// use haff_linkage::complete_elliptic_integral;
/// assert!((complete_elliptic_integral(0.5) - 1.854_074_677_301_371_9).abs() < 1e-15);
/// ```
#[must_use]
pub fn complete_elliptic_integral(m1: f64) -> f64 {
    let (mut a, mut b) = (1.0_f64, m1.sqrt());
    for _ in 0..40 {
        if (a - b).abs() <= f64::EPSILON * a {
            break;
        }
        (a, b) = (0.5 * (a + b), (a * b).sqrt());
    }
    std::f64::consts::PI / (a + b)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn jacobi_functions_satisfy_their_definition() {
        // sn' = cn dn, sn(K) = 1, sn odd, and sn² + cn² = 1, dn² + m sn² = 1 over the whole range of m.
        for m1 in [1.0, 0.9, 0.5, 0.1, 1e-3, 1e-9, 1e-15] {
            let m = 1.0 - m1;
            let k = complete_elliptic_integral(m1);
            let (sn, cn, dn) = jacobi(k, m, m1);
            assert!((sn - 1.0).abs() < 1e-15, "sn(K) = {sn} at m1 = {m1}");
            assert!(cn.abs() < 1e-15 * k / m1.sqrt().max(1e-8), "cn(K) = {cn}");
            assert!((dn - m1.sqrt()).abs() < 1e-15, "dn(K) = {dn}, {}", m1.sqrt());
            for i in -20..20 {
                let u = f64::from(i) * 0.37;
                let (sn, cn, dn) = jacobi(u, m, m1);
                assert!((sn * sn + cn * cn - 1.0).abs() < 1e-15);
                assert!((dn * dn + m * sn * sn - 1.0).abs() < 4e-15);
                let h = 1e-4;
                let slope = (8.0 * (jacobi(u + h, m, m1).0 - jacobi(u - h, m, m1).0)
                    - (jacobi(u + 2.0 * h, m, m1).0 - jacobi(u - 2.0 * h, m, m1).0))
                    / (12.0 * h);
                assert!(
                    (slope - cn * dn).abs() < 2e-11,
                    "sn' = {slope}, cn dn = {} at {u}, m1 = {m1}",
                    cn * dn
                );
            }
        }
    }

    #[test]
    fn jacobi_functions_match_tabulated_values() {
        // scipy.special.ellipj(0.7, 0.3)
        let (sn, cn, dn) = jacobi(0.7, 0.3, 0.7);
        assert!((sn - 0.632_304_776_310_864_6).abs() < 2e-16, "{sn}");
        assert!((cn - 0.774_719_736_326_929_8).abs() < 3e-16, "{cn}");
        assert!((dn - 0.938_113_639_681_430_4).abs() < 3e-16, "{dn}");
    }
}
