//! Small dense linear algebra, row-major: few constraints, few modes. Written out because a redundant
//! constraint must be distinguished from a small pivot, and because the order of the operations determines
//! the bits.

/// Pivots below this, relative to the original diagonal, mark a redundant row.
const REDUNDANT: f64 = 1e-12;

/// Solves A x = b for the `active` rows of a symmetric positive semidefinite A, n × n; the other rows, and
/// those that depend on earlier ones, get x = 0. Returns the solution and whether all active rows were
/// independent.
pub(crate) fn solve(a: &[f64], b: &[f64], active: &[bool]) -> (Vec<f64>, bool) {
    let n = b.len();
    let rows: Vec<usize> = (0..n).filter(|&i| active[i]).collect();
    let k = rows.len();
    let mut l = vec![0.0; k * k];
    let mut pivot = vec![0.0; k];
    let mut independent = true;
    // L D Lᵀ without square roots.
    for i in 0..k {
        let mut diagonal = a[rows[i] * n + rows[i]];
        let start = diagonal;
        for j in 0..i {
            let mut sum = a[rows[i] * n + rows[j]];
            for m in 0..j {
                sum -= l[i * k + m] * l[j * k + m] * pivot[m];
            }
            l[i * k + j] = if pivot[j] > 0.0 { sum / pivot[j] } else { 0.0 };
            diagonal -= l[i * k + j] * l[i * k + j] * pivot[j];
        }
        if diagonal > REDUNDANT * start {
            pivot[i] = diagonal;
        } else {
            independent = false;
        }
    }
    let mut y = vec![0.0; k];
    for i in 0..k {
        let mut sum = b[rows[i]];
        for j in 0..i {
            sum -= l[i * k + j] * y[j];
        }
        y[i] = if pivot[i] > 0.0 { sum } else { 0.0 };
    }
    let mut x = vec![0.0; n];
    for i in (0..k).rev() {
        if pivot[i] <= 0.0 {
            continue;
        }
        let mut sum = y[i] / pivot[i];
        for j in i + 1..k {
            sum -= l[j * k + i] * x[rows[j]];
        }
        x[rows[i]] = sum;
    }
    (x, independent)
}

/// Solves the mixed complementarity problem w = A x + q: w = 0 for bilateral rows; x ≥ 0, w ≥ 0, x w = 0 for
/// `unilateral` ones. Violations of w below `tolerance` are ignored, so that a tie (x = 0 and w = 0) stays
/// active.
///
/// Murty's least-index pivoting, started with all rows active; it terminates for every positive definite A.
pub(crate) fn complementarity(
    a: &[f64],
    q: &[f64],
    unilateral: &[bool],
    tolerance: f64,
) -> (Vec<f64>, Vec<bool>) {
    let n = q.len();
    let mut active = vec![true; n];
    let minus_q: Vec<f64> = q.iter().map(|q| -q).collect();
    let mut x = Vec::new();
    // Redundant rows could make it cycle; n rows have at most 2^n active sets.
    for _ in 0..(1 << n.min(12)) {
        x = solve(a, &minus_q, &active).0;
        let wrong = (0..n).filter(|&i| unilateral[i]).find(|&i| {
            if active[i] {
                x[i] * a[i * n + i] < -tolerance
            } else {
                let w = q[i] + (0..n).map(|j| a[i * n + j] * x[j]).sum::<f64>();
                w < -tolerance
            }
        });
        match wrong {
            Some(i) => active[i] = !active[i],
            None => break,
        }
    }
    (x, active)
}

/// Eigenvalues and orthonormal eigenvectors (columns of a row-major matrix) of a symmetric n × n matrix, by
/// cyclic Jacobi rotations: the most accurate method for small matrices, and without library calls whose bits
/// differ.
pub(crate) fn eigen(matrix: &[f64], n: usize) -> (Vec<f64>, Vec<f64>) {
    let mut a = matrix.to_vec();
    let mut v = vec![0.0; n * n];
    (0..n).for_each(|i| v[i * n + i] = 1.0);
    for _sweep in 0..60 {
        let off: f64 =
            (0..n).flat_map(|i| (0..i).map(move |j| (i, j))).map(|(i, j)| a[i * n + j].powi(2)).sum();
        let all: f64 = a.iter().map(|x| x * x).sum();
        if off <= all * 1e-36 {
            break;
        }
        for p in 0..n {
            for q in p + 1..n {
                let apq = a[p * n + q];
                if apq == 0.0 {
                    continue;
                }
                let theta = (a[q * n + q] - a[p * n + p]) / (2.0 * apq);
                let t = theta.signum() / (theta.abs() + (theta * theta + 1.0).sqrt());
                let c = 1.0 / (t * t + 1.0).sqrt();
                let s = t * c;
                for k in 0..n {
                    let (akp, akq) = (a[k * n + p], a[k * n + q]);
                    a[k * n + p] = c * akp - s * akq;
                    a[k * n + q] = s * akp + c * akq;
                }
                for k in 0..n {
                    let (apk, aqk) = (a[p * n + k], a[q * n + k]);
                    a[p * n + k] = c * apk - s * aqk;
                    a[q * n + k] = s * apk + c * aqk;
                }
                for k in 0..n {
                    let (vkp, vkq) = (v[k * n + p], v[k * n + q]);
                    v[k * n + p] = c * vkp - s * vkq;
                    v[k * n + q] = s * vkp + c * vkq;
                }
            }
        }
    }
    ((0..n).map(|i| a[i * n + i]).collect(), v)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn redundant_rows_carry_no_force() {
        let a = [2.0, 1.0, 1.0, 1.0, 3.0, 3.0, 1.0, 3.0, 3.0];
        let (x, independent) = solve(&a, &[1.0, 2.0, 2.0], &[true; 3]);
        assert!(!independent);
        assert_eq!(x[2], 0.0);
        assert!((2.0 * x[0] + x[1] - 1.0).abs() < 1e-15 && (x[0] + 3.0 * x[1] - 2.0).abs() < 1e-15);
    }

    #[test]
    fn unilateral_rows_never_pull() {
        // The force of the second row would be negative.
        let (x, active) = complementarity(&[1.0, 0.5, 0.5, 1.0], &[-1.0, 0.7], &[true, true], 1e-14);
        assert_eq!((x, active), (vec![1.0, 0.0], vec![true, false]));
    }

    #[test]
    fn eigenvectors_diagonalize() {
        let a = [4.0, 1.0, -2.0, 1.0, 2.0, 0.5, -2.0, 0.5, 3.0];
        let (values, vectors) = eigen(&a, 3);
        for k in 0..3 {
            for i in 0..3 {
                let image: f64 = (0..3).map(|j| a[i * 3 + j] * vectors[j * 3 + k]).sum();
                assert!((image - values[k] * vectors[i * 3 + k]).abs() < 1e-14);
            }
        }
    }
}
