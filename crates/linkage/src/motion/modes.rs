/*!
Masses and springs on one line in normal modes.

Displacements `d` of the nodes (bodies, or several at constant distances) along the line from their initial
positions satisfy M d̈ = F₀ − K d, with F₀ all forces at the start. Each mode c of M^{−1/2} K M^{−1/2} is an
oscillator that starts at 0: c = f (1 − cos ωt)/ω² + ċ₀ sin(ωt)/ω, or ċ₀ t + ½ f t² where ω = 0. Across the
line all bodies have the same motion.
*/

use glam::DVec3;

use crate::{
    linear,
    mechanism::{End, Mechanism, Motions, Shape},
};

/// Largest deviation from the line, relative to the quantity's own size.
const ALIGNED: f64 = 1e-12;

/// A quantity that may be monitored: `constant + Σ weight·c`.
#[derive(Debug, Clone, PartialEq)]
struct AffineQuantity {
    constant: f64,
    weights: Vec<f64>,
}

/// Bodies that move along one line relative to a common flight.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Modes {
    start: Motions,
    line: DVec3,
    /// Acceleration of all bodies across the line.
    across: DVec3,
    omega: Vec<f64>,
    force: Vec<f64>,
    rate: Vec<f64>,
    /// Displacement of every body per mode, row-major: bodies × modes.
    shape: Vec<f64>,
    rows: Vec<AffineQuantity>,
    coils: Vec<AffineQuantity>,
}

/// (1 − cos ωt)/ω², sin(ωt)/ω and their derivatives; limits at ω = 0.
fn oscillator(omega: f64, tau: f64) -> ([f64; 2], [f64; 2]) {
    if omega == 0.0 {
        return ([0.5 * tau * tau, tau], [tau, 1.0]);
    }
    let (half_sin, half_cos) = libm::sincos(0.5 * omega * tau);
    let sin = 2.0 * half_sin * half_cos;
    let versed = 2.0 * half_sin * half_sin;
    ([versed / (omega * omega), sin / omega], [sin / omega, 1.0 - versed])
}

impl Modes {
    /// The modes of a mechanism of which all rows are active, if it moves along one line.
    pub fn new(mechanism: &Mechanism, bodies: &Motions) -> Option<Self> {
        let n = bodies.len();
        let line = line_of(mechanism, bodies)?;
        let aligned = |v: DVec3| v.cross(line).length() <= ALIGNED * v.length();
        let speeds: f64 = bodies.iter().map(|(_, v)| v.length()).fold(0.0, f64::max);
        let (a, forces) = mechanism.accelerations(0.0, bodies);
        let scale = mechanism.acceleration_scale(bodies);
        // Nodes: sets of bodies at constant distances by rows along the line. Some rows fix a node to a
        // point.
        let mut node: Vec<usize> = (0..n).collect();
        let mut clamped = vec![false; n];
        let mut anchored = false;
        for (row, state) in mechanism.rows.iter().zip(mechanism.row_states(0.0, bodies)) {
            if row.a.is_driven() || row.b.is_driven() {
                return None;
            }
            match (row.a.body(), row.b.body()) {
                _ if state.direction.dot(line).abs() <= ALIGNED => {
                    // A wall along which the body slides; any other row would change its direction.
                    if !matches!(row.shape, Shape::Along(..)) || row.a.body().is_some() {
                        return None;
                    }
                }
                _ if !aligned(state.direction) => return None,
                (Some(k), Some(l)) => {
                    let (from, to) = (node[k], node[l]);
                    node.iter_mut().filter(|x| **x == from).for_each(|x| *x = to);
                    let joined = clamped[from] || clamped[to];
                    clamped[to] = joined;
                }
                (Some(k), None) | (None, Some(k)) => {
                    clamped[node[k]] = true;
                    anchored |= matches!(row.shape, Shape::Distance(_));
                }
                (None, None) => return None,
            }
        }
        for coil in &mechanism.coils {
            if coil.a.is_driven() || coil.b.is_driven() {
                return None;
            }
            anchored |= coil.a.body().is_none() || coil.b.body().is_none();
            if !aligned(coil.direction(0.0, bodies).0) {
                return None;
            }
        }
        // Across the line all bodies have the same motion; bodies fixed to a point do not leave the line.
        let perpendicular = |v: DVec3| v - line * v.dot(line);
        let (slide, across) = (perpendicular(bodies[0].1), perpendicular(a[0]));
        let alike = bodies.iter().all(|(_, v)| (perpendicular(*v) - slide).length() <= ALIGNED * speeds)
            && a.iter().all(|a| (perpendicular(*a) - across).length() <= ALIGNED * scale);
        let still = slide.length() <= ALIGNED * speeds && across.length() <= ALIGNED * scale;
        if !alike || (anchored && !still) {
            return None;
        }
        let (slide, across) = if anchored { (DVec3::ZERO, DVec3::ZERO) } else { (slide, across) };
        let mut heads: Vec<usize> = (0..n).filter(|&k| node[k] == k && !clamped[k]).collect();
        heads.sort_unstable();
        let count = heads.len();
        let index = |k: usize| heads.iter().position(|&head| head == node[k]);
        let mass: Vec<f64> = heads
            .iter()
            .map(|&head| (0..n).filter(|&k| node[k] == head).map(|k| mechanism.mass[k]).sum())
            .collect();
        let free = mechanism.free_accelerations(0.0, bodies);
        let (mut stiffness, mut load, mut velocity) =
            (vec![0.0; count * count], vec![0.0; count], vec![0.0; count]);
        for k in 0..n {
            if let Some(i) = index(k) {
                load[i] += mechanism.mass[k] * free[k].dot(line);
                velocity[i] += mechanism.mass[k] * bodies[k].1.dot(line) / mass[i];
            }
        }
        for coil in &mechanism.coils {
            let ends = [coil.a.body().and_then(index), coil.b.body().and_then(index)];
            for i in ends.into_iter().flatten() {
                stiffness[i * count + i] += coil.stiffness;
            }
            if let [Some(i), Some(j)] = ends {
                stiffness[i * count + j] -= coil.stiffness;
                stiffness[j * count + i] -= coil.stiffness;
            }
        }
        let root: Vec<f64> = mass.iter().map(|m| m.sqrt()).collect();
        for i in 0..count {
            for j in 0..count {
                stiffness[i * count + j] /= root[i] * root[j];
            }
        }
        let (values, vectors) = linear::eigen(&stiffness, count);
        let largest = values.iter().fold(0.0, |m: f64, v| m.max(*v));
        let omega: Vec<f64> =
            values.iter().map(|&v| if v > 1e-13 * largest { v.sqrt() } else { 0.0 }).collect();
        let modal = |x: &dyn Fn(usize) -> f64| -> Vec<f64> {
            (0..count).map(|m| (0..count).map(|i| vectors[i * count + m] * x(i)).sum()).collect()
        };
        let force = modal(&|i| load[i] / root[i]);
        let rate = modal(&|i| velocity[i] * root[i]);
        let mut shape = vec![0.0; n * count];
        for k in 0..n {
            if let Some(i) = index(k) {
                (0..count).for_each(|m| shape[k * count + m] = vectors[i * count + m] / root[i]);
            }
        }
        let start: Motions =
            (0..n).map(|k| (bodies[k].0, slide + line * index(k).map_or(0.0, |i| velocity[i]))).collect();
        let mut of =
            Self { start, line, across, omega, force, rate, shape, rows: Vec::new(), coils: Vec::new() };
        of.set_monitored(mechanism, &forces);
        Some(of)
    }

    /// Row forces and lengths of springs are affine in the displacements: determines their weights by
    /// displacing each mode.
    fn set_monitored(&mut self, mechanism: &Mechanism, forces: &[f64]) {
        let count = self.omega.len();
        let at_rest: Motions = self.start.iter().map(|(x, _)| (*x, DVec3::ZERO)).collect();
        let lengths: Vec<f64> = mechanism.coils.iter().map(|coil| coil.direction(0.0, &at_rest).1).collect();
        // Large enough for accuracy, small enough that no spring reverses.
        let shortest = lengths.iter().copied().filter(|l| *l > 0.0).fold(1.0, f64::min);
        self.rows =
            forces.iter().map(|&constant| AffineQuantity { constant, weights: vec![0.0; count] }).collect();
        self.coils =
            lengths.iter().map(|&constant| AffineQuantity { constant, weights: vec![0.0; count] }).collect();
        let base = mechanism.accelerations(0.0, &at_rest).1;
        for m in 0..count {
            let largest = (0..self.start.len()).map(|k| self.shape[k * count + m].abs()).fold(0.0, f64::max);
            let by = if largest > 0.0 { 0.25 * shortest / largest } else { 0.0 };
            if by == 0.0 {
                continue;
            }
            let moved: Motions = at_rest
                .iter()
                .enumerate()
                .map(|(k, (x, v))| (*x + self.line * (self.shape[k * count + m] * by), *v))
                .collect();
            let changed = mechanism.accelerations(0.0, &moved).1;
            for (quantity, (new, old)) in self.rows.iter_mut().zip(changed.iter().zip(&base)) {
                quantity.weights[m] = (new - old) / by;
            }
            for (quantity, coil) in self.coils.iter_mut().zip(&mechanism.coils) {
                quantity.weights[m] =
                    (coil_length(coil, &moved, self.line) - coil_length(coil, &at_rest, self.line)) / by
                        * coil_sign(coil, &self.start, self.line);
            }
        }
    }

    /// Displacement and its rate in mode `m`.
    fn mode(&self, m: usize, tau: f64) -> (f64, f64) {
        let ([of_force, of_rate], [force_slope, rate_slope]) = oscillator(self.omega[m], tau);
        (
            self.force[m] * of_force + self.rate[m] * of_rate,
            self.force[m] * force_slope + self.rate[m] * rate_slope,
        )
    }

    /// Bound on |c̈| of mode `m`.
    fn mode_bound(&self, m: usize) -> f64 {
        libm::hypot(self.force[m], self.rate[m] * self.omega[m])
    }

    /// State of body `k`.
    pub fn state(&self, k: usize, tau: f64) -> (DVec3, DVec3) {
        let count = self.omega.len();
        let (mut moved, mut speed) = (0.0, 0.0);
        for m in 0..count {
            let (c, rate) = self.mode(m, tau);
            moved += self.shape[k * count + m] * c;
            speed += self.shape[k * count + m] * rate;
        }
        let (x, v) = self.start[k];
        let slide = v - self.line * v.dot(self.line);
        (
            x + (slide + self.across * (0.5 * tau)) * tau + self.line * moved,
            slide + self.across * tau + self.line * speed,
        )
    }

    /// From body `k` to body `l`, without the rounding of coordinates far away.
    pub fn separation(&self, k: usize, l: usize, tau: f64) -> DVec3 {
        let count = self.omega.len();
        let apart = (0..count)
            .map(|m| (self.shape[l * count + m] - self.shape[k * count + m]) * self.mode(m, tau).0)
            .sum::<f64>();
        (self.start[l].0 - self.start[k].0) + self.line * apart
    }

    /// Acceleration of body `k`.
    pub fn acceleration(&self, k: usize, tau: f64) -> DVec3 {
        let count = self.omega.len();
        let along = (0..count).map(|m| {
            let (sin, cos) = libm::sincos(self.omega[m] * tau);
            self.shape[k * count + m] * (self.force[m] * cos - self.rate[m] * self.omega[m] * sin)
        });
        self.across + self.line * along.sum::<f64>()
    }

    /// Bound on the rate of change of the acceleration of body `k`.
    pub fn jerk_bound(&self, k: usize) -> f64 {
        let count = self.omega.len();
        (0..count).map(|m| self.shape[k * count + m].abs() * self.omega[m] * self.mode_bound(m)).sum()
    }

    /// Bound on the acceleration of body `k`.
    pub fn acceleration_bound(&self, k: usize) -> f64 {
        let count = self.omega.len();
        self.across.length()
            + (0..count).map(|m| self.shape[k * count + m].abs() * self.mode_bound(m)).sum::<f64>()
    }

    /// Force of a row and its slope.
    pub fn row_force(&self, row: usize, tau: f64) -> (f64, f64) {
        self.value_of(&self.rows[row], tau)
    }

    /// Length of a spring along the line, negative after its ends have passed through each other, and its
    /// slope.
    pub fn coil_length(&self, coil: usize, tau: f64) -> (f64, f64) {
        self.value_of(&self.coils[coil], tau)
    }

    fn value_of(&self, quantity: &AffineQuantity, tau: f64) -> (f64, f64) {
        let (mut value, mut slope) = (quantity.constant, 0.0);
        for (m, weight) in quantity.weights.iter().enumerate() {
            let (c, rate) = self.mode(m, tau);
            value += weight * c;
            slope += weight * rate;
        }
        (value, slope)
    }

    /// Bound on the second derivative of a row's force.
    pub fn row_bound(&self, row: usize) -> f64 {
        self.bound_of(&self.rows[row])
    }

    /// Bound on the second derivative of a spring's length.
    pub fn coil_bound(&self, coil: usize) -> f64 {
        self.bound_of(&self.coils[coil])
    }

    fn bound_of(&self, quantity: &AffineQuantity) -> f64 {
        quantity.weights.iter().enumerate().map(|(m, weight)| weight.abs() * self.mode_bound(m)).sum()
    }

    /// A time over which the motion changes.
    pub fn timescale(&self) -> f64 {
        1.0 / self.omega.iter().fold(0.0, |m: f64, w| m.max(*w))
    }
}

/// Signed length of a spring along the line.
fn coil_length(coil: &crate::mechanism::Coil, bodies: &Motions, line: DVec3) -> f64 {
    (coil.b.state(0.0, bodies).0 - coil.a.state(0.0, bodies).0).dot(line)
}

/// +1 for a spring along the line, −1 for one against it.
fn coil_sign(coil: &crate::mechanism::Coil, bodies: &Motions, line: DVec3) -> f64 {
    1.0_f64.copysign(coil.direction(0.0, bodies).0.dot(line))
}

/// The line along which a mechanism may move: that of a spring, a row between bodies, or their relative
/// velocity.
fn line_of(mechanism: &Mechanism, bodies: &Motions) -> Option<DVec3> {
    let of_coil = mechanism.coils.iter().map(|coil| coil.direction(0.0, bodies).0);
    let between = mechanism
        .rows
        .iter()
        .filter(|row| matches!((row.a, row.b), (End::Body(..), End::Body(..))))
        .map(|row| row.state(0.0, bodies).direction);
    of_coil.chain(between).find(|direction| *direction != DVec3::ZERO)
}
