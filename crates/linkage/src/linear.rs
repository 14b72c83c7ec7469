//! Small dense linear algebra, row-major: few constraints, few modes. Written out because a redundant
//! constraint must be distinguished from a small pivot, and because the order of the operations determines
//! the bits.

/// Pivots below this, relative to the original diagonal, mark a redundant row.
const REDUNDANT: f64 = 1e-12;
/// Ties are active only above this pivot: the forces of other rows must not depend on the rounding of theirs.
const TIE_INDEPENDENT: f64 = 1e-6;

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

/// A factorization L D Lᵀ of independent rows of a symmetric positive semidefinite matrix A, n × n, which
/// rows are added to and removed from.
struct Factor<'a> {
    a: &'a [f64],
    n: usize,
    rows: Vec<usize>,
    /// Rows of L, without its diagonal of ones.
    l: Vec<Vec<f64>>,
    d: Vec<f64>,
}

impl<'a> Factor<'a> {
    fn new(a: &'a [f64], n: usize) -> Self {
        Self { a, n, rows: Vec::new(), l: Vec::new(), d: Vec::new() }
    }

    /// L⁻¹ b.
    fn forward(&self, mut b: Vec<f64>) -> Vec<f64> {
        for i in 1..b.len() {
            b[i] -= (0..i).map(|j| self.l[i][j] * b[j]).sum::<f64>();
        }
        b
    }

    /// A⁻¹ b.
    fn solve(&self, b: Vec<f64>) -> Vec<f64> {
        let mut x = self.forward(b);
        x.iter_mut().zip(&self.d).for_each(|(x, d)| *x /= d);
        for i in (0..x.len()).rev() {
            for j in 0..i {
                x[j] -= self.l[i][j] * x[i];
            }
        }
        x
    }

    /// Row of L and pivot of a further row.
    fn extension(&self, row: usize) -> (Vec<f64>, f64) {
        let y = self.forward(self.rows.iter().map(|&k| self.a[row * self.n + k]).collect());
        let mut pivot = self.a[row * self.n + row];
        let l: Vec<f64> = y
            .iter()
            .zip(&self.d)
            .map(|(y, d)| {
                pivot -= y * y / d;
                y / d
            })
            .collect();
        (l, pivot)
    }

    /// Whether a further row with this pivot is independent.
    fn is_independent(&self, row: usize, pivot: f64, least: f64) -> bool {
        pivot > least * self.a[row * self.n + row]
    }

    /// Adds a row unless it depends on the others.
    fn push(&mut self, row: usize, least: f64) -> bool {
        let (l, pivot) = self.extension(row);
        let independent = self.is_independent(row, pivot, least);
        if independent {
            self.rows.push(row);
            self.l.push(l);
            self.d.push(pivot);
        }
        independent
    }

    /// Removes the k-th row.
    fn remove(&mut self, k: usize) {
        let later = self.rows.split_off(k + 1);
        self.rows.truncate(k);
        self.l.truncate(k);
        self.d.truncate(k);
        for row in later {
            self.push(row, 0.0);
        }
    }

    /// Whether a row is among them.
    fn contains(&self, row: usize) -> bool {
        self.rows.contains(&row)
    }
}

/// Solves the mixed complementarity problem w = A x + q: w = 0 for bilateral rows; x ≥ 0, w ≥ 0, x w = 0 for
/// `unilateral` ones. Returns x and the rows that are active. Violations of w below `tolerance` are ignored.
/// A tie (x = 0 and w = 0) is active if its row is independent of the others; of rows that depend on each
/// other a part is active, so that the active one-sided rows are always independent.
///
/// The dual active-set method of D. Goldfarb and A. Idnani, Math. Programming 27, 1 (1983), for the smallest
/// change of the velocities or accelerations that satisfies all rows: the most violated row is added, and
/// rows whose x would become negative are removed, until no row is violated. Every step increases the dual
/// objective, so that no set of rows occurs twice.
pub(crate) fn complementarity(
    a: &[f64],
    q: &[f64],
    unilateral: &[bool],
    tolerance: f64,
) -> (Vec<f64>, Vec<bool>) {
    let n = q.len();
    let mut factor = Factor::new(a, n);
    for row in (0..n).filter(|&row| !unilateral[row]) {
        factor.push(row, REDUNDANT);
    }
    let mut x = vec![0.0; n];
    let solve = |factor: &Factor, x: &mut [f64], added: Option<usize>| {
        let b =
            factor.rows.iter().map(|&k| -q[k] - added.map_or(0.0, |row| a[row * n + k] * x[row])).collect();
        let solution = factor.solve(b);
        (0..n).filter(|&row| added != Some(row)).for_each(|row| x[row] = 0.0);
        factor.rows.iter().zip(solution).for_each(|(&k, value)| x[k] = value);
    };
    solve(&factor, &mut x, None);
    let mut given_up = vec![false; n];
    // Far more than are needed; rounding must not make it endless.
    for _ in 0..20 * n {
        let worst = (0..n)
            .filter(|&row| unilateral[row] && !given_up[row] && !factor.contains(row))
            .filter_map(|row| {
                let (w, rounding) = violation_of(a, q, &x, row);
                (w < -tolerance - rounding).then_some((row, w))
            })
            .reduce(|worst, next| if next.1 < worst.1 { next } else { worst });
        let Some((row, _)) = worst else { break };
        // x of the new row is increased until the row is satisfied.
        loop {
            let (_, pivot) = factor.extension(row);
            let independent = factor.is_independent(row, pivot, REDUNDANT);
            let full = if independent { -violation_of(a, q, &x, row).0 / pivot } else { f64::INFINITY };
            let slope = factor.solve(factor.rows.iter().map(|&k| a[row * n + k]).collect());
            let first = (0..factor.rows.len())
                .filter(|&k| unilateral[factor.rows[k]] && slope[k] > 0.0)
                .map(|k| (k, (x[factor.rows[k]] / slope[k]).max(0.0)))
                .reduce(|first, next| if next.1 < first.1 { next } else { first });
            match first {
                Some((k, step)) if step < full => {
                    x[row] += step;
                    let removed = factor.rows[k];
                    factor.remove(k);
                    x[removed] = 0.0;
                    solve(&factor, &mut x, Some(row));
                }
                _ if independent => {
                    factor.push(row, REDUNDANT);
                    solve(&factor, &mut x, None);
                    break;
                }
                // The row depends on the others, which hold it.
                _ => {
                    given_up[row] = true;
                    x[row] = 0.0;
                    solve(&factor, &mut x, None);
                    break;
                }
            }
        }
    }
    let before = factor.rows.len();
    for row in (0..n).filter(|&row| unilateral[row]) {
        let (w, rounding) = violation_of(a, q, &x, row);
        if !factor.contains(row) && w.abs() <= tolerance + rounding {
            factor.push(row, TIE_INDEPENDENT);
        }
    }
    if factor.rows.len() > before {
        solve(&factor, &mut x, None);
    }
    let active = (0..n).map(|row| !unilateral[row] || factor.contains(row)).collect();
    (x, active)
}

/// w of a row, and its rounding error.
fn violation_of(a: &[f64], q: &[f64], x: &[f64], row: usize) -> (f64, f64) {
    let n = q.len();
    let (mut w, mut size) = (q[row], q[row].abs());
    for (a, x) in a[row * n..(row + 1) * n].iter().zip(x) {
        w += a * x;
        size += (a * x).abs();
    }
    (w, 4.0 * f64::EPSILON * size)
}

/// Energies ½ r A⁻¹ r that are lost where the rates `r` of these rows become zero one after the other, each
/// while those before it stay zero: none is negative. Rows that depend on earlier ones lose nothing.
pub(crate) fn losses(a: &[f64], r: &[f64], order: &[usize]) -> Vec<(usize, f64)> {
    let mut factor = Factor::new(a, r.len());
    for &row in order {
        factor.push(row, REDUNDANT);
    }
    let y = factor.forward(factor.rows.iter().map(|&row| r[row]).collect());
    let loss = |k: usize| 0.5 * y[k] * y[k] / factor.d[k];
    factor.rows.iter().enumerate().map(|(k, &row)| (row, loss(k))).collect()
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
