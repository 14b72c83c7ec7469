/*!
Motion without a closed form: a few steps of DOP853 at a time, with a continuous extension of degree nine.

Positions and velocities of the bodies are integrated with the constraint forces eliminated
([`Mechanism::accelerations`]); the state at its end, or at an event before, is projected onto the
constraints. In between, they are the Hermite polynomials through positions, velocities and accelerations at
the ends of the steps, with rigorous bounds for the search for events. A stretch is accepted only if the
method's own estimate is_fixed_or_carried below [`TOLERANCE`] in every step, and if the polynomials satisfy
the equations of motion in its interior.

The method's own dense output is not used: in version 0.7 of the crate it converges with order 5 instead of 7
(5·10⁻⁸ for an oscillator at a step of 0.2/ω, where the steps themselves are accurate to 3·10⁻¹⁴).

Steps are powers of two. The method's own proposal comes from a power function whose last bits differ between
machines; it is only compared with twice the step.
*/

use differential_equations::{
    methods::ExplicitRungeKutta,
    ode::{ODE, OrdinaryNumericalMethod},
    status::Status,
};
use glam::DVec3;

use super::polynomial::Polynomial;
use crate::mechanism::{Mechanism, Motions};

/// Error of a step, relative to the lengths and speeds of the mechanism.
const TOLERANCE: f64 = 3e-15;
/// Error of the polynomials: of the velocity against the acceleration, over a stretch.
const DENSE: f64 = 3e-13;
/// Attempts, each with half the step, before the tolerances are widened, and by which factors: where
/// rounding is larger than the tolerance, shorter steps do not help.
const ATTEMPTS: i32 = 24;
const WIDENING: [f64; 6] = [1.0, 4.0, 64.0, 1024.0, 32_768.0, 1_048_576.0];
/// Steps of a stretch.
const STEPS: usize = 4;
/// Nodes of a polynomial of degree 2 (STEPS + 1) − 1.
const NODES: usize = 2 * (STEPS + 1);
/// Nodes for row forces.
const FORCE_NODES: usize = 14;

/// One stretch.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Numeric {
    /// Its length [time].
    pub length: f64,
    /// Step proposed for the next stretch.
    pub next: f64,
    /// Positions at the start.
    start: Vec<DVec3>,
    /// x, y, z of the displacement and of the velocity of every body. Displacements, because the rounding of
    /// coordinates far from the origin would be larger than the error of the method.
    paths: Vec<[Polynomial; 6]>,
    /// Bounds on speed, acceleration and its rate of change, of every body.
    bounds: Vec<[f64; 3]>,
    /// Row forces; `None` for two-sided rows.
    forces: Vec<Option<Polynomial>>,
    /// Work of moving points since its start.
    work: Option<Polynomial>,
}

/// The equations of motion in the form of the method: positions relative to the start, velocities, work.
struct Equations<'a> {
    mechanism: &'a Mechanism,
    start: &'a Motions,
    driven: bool,
}

impl Equations<'_> {
    fn bodies(&self, y: &[f64]) -> Motions {
        let vector = |k: usize| DVec3::new(y[3 * k], y[3 * k + 1], y[3 * k + 2]);
        let n = self.start.len();
        (0..n).map(|k| (self.start[k].0 + vector(k), vector(n + k))).collect()
    }
}

impl ODE<f64, Vec<f64>> for Equations<'_> {
    fn diff(&self, t: f64, y: &Vec<f64>, dydt: &mut Vec<f64>) {
        let n = self.start.len();
        let bodies = self.bodies(y);
        let (a, forces) = self.mechanism.accelerations(t, &bodies);
        for k in 0..n {
            bodies[k].1.write_to_slice(&mut dydt[3 * k..]);
            a[k].write_to_slice(&mut dydt[3 * (n + k)..]);
        }
        dydt[6 * n] = if self.driven { self.mechanism.power_of_points(t, &bodies, &forces) } else { 0.0 };
    }
}

impl Numeric {
    /// The stretch from `start`; `hint` is the proposal of the last stretch, 0 at the beginning. `None` if no
    /// step is short enough.
    pub fn new(mechanism: &Mechanism, start: &Motions, hint: f64) -> Option<Self> {
        let driven = mechanism.is_driven();
        let n = start.len();
        // Near the origin, for the same reason.
        let origin = start.first()?.0;
        let mechanism = &mechanism.shifted(-origin);
        let near: Motions = start.iter().map(|(x, v)| (*x - origin, *v)).collect();
        let equations = Equations { mechanism, start: &near, driven };
        let (acceleration, _) = mechanism.accelerations(0.0, &near);
        let length = length_scale(mechanism);
        let speed = start.iter().map(|(_, v)| v.length()).fold(0.0, f64::max);
        let scale =
            mechanism.acceleration_scale(&near) + acceleration.iter().map(|a| a.length()).fold(0.0, f64::max);
        let speed = speed + (scale * length).sqrt();
        let energy = mechanism.mass.iter().sum::<f64>() * speed * speed;
        let mut tolerance = vec![TOLERANCE * length; 3 * n];
        tolerance.resize(6 * n, TOLERANCE * speed);
        tolerance.push(TOLERANCE * energy);
        let mut y0 = vec![0.0; 3 * n];
        y0.extend(start.iter().flat_map(|(_, v)| v.to_array()));
        y0.push(0.0);
        let first = if hint > 0.0 { hint } else { power_of_two(0.25 * length / speed) };
        for wider in WIDENING {
            let tolerance: Vec<f64> = tolerance.iter().map(|tolerance| tolerance * wider).collect();
            let mut h = first;
            for _ in 0..ATTEMPTS {
                let mut method = ExplicitRungeKutta::dop853().rtol(0.0).atol(tolerance.clone()).h0(h);
                if let Some(ends) = steps(&mut method, &equations, &y0, h) {
                    let stretch = STEPS as f64 * h;
                    let paths = paths(n, &ends, h);
                    if satisfies(&equations, &paths, stretch, speed * wider, length * wider) {
                        let next = if method.h() >= 2.0 * h { 2.0 * h } else { h };
                        let work = driven.then(|| extension(&ends, 6 * n, h));
                        let forces = vec![None; mechanism.rows.len()];
                        let start = start.iter().map(|(x, _)| *x).collect();
                        let bounds = paths.iter().map(bounds).collect();
                        let mut of = Self { bounds, length: stretch, next, start, paths, forces, work };
                        of.sample_forces(mechanism, &near);
                        return Some(of);
                    }
                }
                h *= 0.5;
            }
        }
        None
    }

    fn sample_forces(&mut self, mechanism: &Mechanism, start: &Motions) {
        if !mechanism.rows.iter().any(|row| row.unilateral) {
            return;
        }
        let samples: Vec<Vec<f64>> = Polynomial::nodes(FORCE_NODES)
            .into_iter()
            .map(|s| {
                let tau = s * self.length;
                let bodies: Motions = (0..self.paths.len())
                    .map(|k| {
                        let (displacement, velocity) = self.moved(k, tau);
                        (start[k].0 + displacement, velocity)
                    })
                    .collect();
                mechanism.accelerations(tau, &bodies).1
            })
            .collect();
        for (i, row) in mechanism.rows.iter().enumerate() {
            if row.unilateral {
                let values: Vec<f64> = samples.iter().map(|forces| forces[i]).collect();
                self.forces[i] = Some(Polynomial::through(&values, self.length));
            }
        }
    }

    /// State of body `k`.
    pub fn state(&self, k: usize, tau: f64) -> (DVec3, DVec3) {
        let (displacement, velocity) = self.moved(k, tau);
        (self.start[k] + displacement, velocity)
    }

    /// Displacement and velocity of body `k`.
    fn moved(&self, k: usize, tau: f64) -> (DVec3, DVec3) {
        let [x, y, z, u, v, w] = &self.paths[k];
        let of = |p: &Polynomial| p.value(tau);
        (DVec3::new(of(x), of(y), of(z)), DVec3::new(of(u), of(v), of(w)))
    }

    /// Acceleration of body `k`.
    pub fn acceleration(&self, k: usize, tau: f64) -> DVec3 {
        DVec3::from_array(std::array::from_fn(|c| self.paths[k][3 + c].at(tau).1))
    }

    /// Bounds on the speed and the acceleration of body `k`, and on the rate of change of the latter.
    pub fn bounds(&self, k: usize) -> [f64; 3] {
        self.bounds[k]
    }

    /// Force of a one-sided row and its slope.
    pub fn row_force(&self, row: usize, tau: f64) -> (f64, f64) {
        self.forces[row].as_ref().map_or((0.0, 0.0), |p| p.at(tau))
    }

    /// Bound on the second derivative of a row's force.
    pub fn row_bound(&self, row: usize) -> f64 {
        self.forces[row].as_ref().map_or(0.0, |p| p.derivative_bounds().1)
    }

    /// Work of moving points since its start \[energy\].
    pub fn work(&self, tau: f64) -> f64 {
        self.work.as_ref().map_or(0.0, |p| p.value(tau) - p.value(0.0))
    }
}

/// State and derivative at the ends of [`STEPS`] steps, if all of them are accurate.
fn steps<M: OrdinaryNumericalMethod<f64, Vec<f64>>>(
    method: &mut M,
    equations: &Equations<'_>,
    y0: &Vec<f64>,
    h: f64,
) -> Option<Vec<(Vec<f64>, Vec<f64>)>> {
    let derivative = |t: f64, y: &Vec<f64>| {
        let mut dydt = vec![0.0; y.len()];
        equations.diff(t, y, &mut dydt);
        dydt
    };
    method.init(equations, 0.0, STEPS as f64 * h, y0).ok()?;
    let mut ends = vec![(y0.clone(), derivative(0.0, y0))];
    for k in 1..=STEPS {
        method.set_h(h);
        method.step(equations).ok()?;
        if *method.status() == Status::RejectedStep || !method.y().iter().all(|y| y.is_finite()) {
            return None;
        }
        ends.push((method.y().clone(), derivative(k as f64 * h, method.y())));
    }
    Some(ends)
}

/// Bounds on speed, acceleration and its rate of change on a path.
fn bounds(path: &[Polynomial; 6]) -> [f64; 3] {
    let of: [(f64, f64); 6] = std::array::from_fn(|c| path[c].derivative_bounds());
    let length = |x: [f64; 3]| DVec3::from_array(x).length();
    [
        length([of[0].0, of[1].0, of[2].0]),
        length([of[3].0, of[4].0, of[5].0]),
        length([of[3].1, of[4].1, of[5].1]),
    ]
}

/// The paths of n bodies.
fn paths(n: usize, ends: &[(Vec<f64>, Vec<f64>)], h: f64) -> Vec<[Polynomial; 6]> {
    let component = |k: usize, c: usize| if c < 3 { 3 * k + c } else { 3 * (n + k) + c - 3 };
    (0..n).map(|k| std::array::from_fn(|c| extension(ends, component(k, c), h))).collect()
}

/// Hermite interpolation polynomial of one component, by divided differences over the doubled ends of the
/// steps.
fn extension(ends: &[(Vec<f64>, Vec<f64>)], index: usize, h: f64) -> Polynomial {
    // In units of a step.
    let at = |k: usize| (k / 2) as f64;
    let mut table: Vec<f64> = (0..NODES).map(|k| ends[k / 2].0[index]).collect();
    for order in 1..NODES {
        for k in (order..NODES).rev() {
            table[k] = if order == 1 && k % 2 == 1 {
                ends[k / 2].1[index] * h
            } else {
                (table[k] - table[k - 1]) / (at(k) - at(k - order))
            };
        }
    }
    let value = |t: f64| (0..NODES - 1).rev().fold(table[NODES - 1], |sum, k| sum * (t - at(k)) + table[k]);
    let values: Vec<f64> = Polynomial::nodes(NODES).into_iter().map(|s| value(s * STEPS as f64)).collect();
    Polynomial::through(&values, STEPS as f64 * h)
}

/// Whether the polynomials satisfy the equations of motion inside a stretch.
fn satisfies(equations: &Equations<'_>, paths: &[[Polynomial; 6]], h: f64, speed: f64, length: f64) -> bool {
    [0.1, 0.4, 0.65, 0.9].into_iter().all(|s| {
        let tau = s * h;
        let vector =
            |p: &[Polynomial; 6], of: usize| DVec3::from_array(std::array::from_fn(|c| p[of + c].at(tau).0));
        let slope =
            |p: &[Polynomial; 6], of: usize| DVec3::from_array(std::array::from_fn(|c| p[of + c].at(tau).1));
        let bodies: Motions = paths
            .iter()
            .zip(equations.start)
            .map(|(p, start)| (start.0 + vector(p, 0), vector(p, 3)))
            .collect();
        let (a, _) = equations.mechanism.accelerations(tau, &bodies);
        paths.iter().zip(&a).all(|(p, a)| {
            (slope(p, 3) - *a).length() * h <= DENSE * speed
                && (slope(p, 0) - vector(p, 3)).length() * h <= DENSE * length
        })
    })
}

/// A length over which the motion of the mechanism changes \[length\].
fn length_scale(mechanism: &Mechanism) -> f64 {
    let rows = mechanism.rows.iter().map(|row| match row.shape {
        crate::mechanism::Shape::Distance(length) | crate::mechanism::Shape::Along(_, length) => length.abs(),
    });
    let coils = mechanism.coils.iter().map(|coil| coil.natural_length);
    let longest = rows.chain(coils).fold(0.0, f64::max);
    if longest > 0.0 { longest } else { 1.0 }
}

/// The power of two at or below x > 0.
fn power_of_two(x: f64) -> f64 {
    let (_, exponent) = libm::frexp(x);
    libm::ldexp(1.0, exponent - 1)
}
