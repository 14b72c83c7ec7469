/*!
Motion without a closed form: one step of DOP853 at a time, with its dense output.

Positions and velocities of the bodies are integrated with the constraint forces eliminated ([`Mechanism::accelerations`]); at the
end of every step they are brought back onto the constraints. The continuous extension is kept as polynomials, of
which the search for events knows rigorous bounds. A step is taken only if the method's own estimate stays below
[`TOLERANCE`] and the extension satisfies the equations of motion in the interior of the step.

Steps are powers of two. The method's own proposal comes from a power function whose last bits differ between machines; it is
only compared with twice the step.
*/

use differential_equations::{
    interpolate::Interpolation,
    methods::ExplicitRungeKutta,
    ode::{ODE, OrdinaryNumericalMethod},
    status::Status,
};
use glam::DVec3;

use super::polynomial::Polynomial;
use crate::mechanism::{Mechanism, Motions};

/// Error of a step, relative to the lengths and speeds of the mechanism.
const TOLERANCE: f64 = 3e-15;
/// Error of the dense output: of the velocity against the acceleration, over the step.
const DENSE: f64 = 3e-13;
/// Attempts, each of half the length, before the tolerances widen, and how far they may.
const PATIENCE: i32 = 12;
const WIDEST: f64 = 1e6;
/// Nodes of a polynomial: the dense output has degree 7.
const NODES: usize = 8;
/// Nodes for row forces.
const FORCE_NODES: usize = 14;

/// One step.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Numeric {
    /// Length of the step [time].
    pub length: f64,
    /// Length proposed for the next.
    pub next: f64,
    /// State at the end, on the constraints.
    pub end: Motions,
    /// x, y, z of the position and of the velocity of every body.
    paths: Vec<[Polynomial; 6]>,
    /// Row forces; `None` for two-sided rows.
    forces: Vec<Option<Polynomial>>,
    /// Work of driven points since the start of the step.
    work: Option<Polynomial>,
}

/// The equations of motion as the method wants them: positions relative to the start, velocities, work.
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
        dydt[6 * n] =
            if self.driven { self.mechanism.power_of_points(t, &bodies, &forces) } else { 0.0 };
    }
}

impl Numeric {
    /// The step from `start`; `hint` is the last step's proposal, 0 at the beginning. `None` if no step is short enough.
    pub fn new(mechanism: &Mechanism, start: &Motions, hint: f64) -> Option<Self> {
        let driven = mechanism.rows.iter().any(|row| row.a.is_driven() || row.b.is_driven())
            || mechanism.coils.iter().any(|coil| coil.a.is_driven() || coil.b.is_driven());
        let n = start.len();
        let equations = Equations { mechanism, start, driven };
        let (acceleration, _) = mechanism.accelerations(0.0, start);
        let length = length_scale(mechanism);
        let speed = start.iter().map(|(_, v)| v.length()).fold(0.0, f64::max);
        let scale = mechanism.acceleration_scale(start)
            + acceleration.iter().map(|a| a.length()).fold(0.0, f64::max);
        let speed = speed + (scale * length).sqrt();
        let energy = mechanism.mass.iter().sum::<f64>() * speed * speed;
        let mut tolerance = vec![TOLERANCE * length; 3 * n];
        tolerance.resize(6 * n, TOLERANCE * speed);
        tolerance.push(TOLERANCE * energy);
        let mut y0 = vec![0.0; 3 * n];
        start.iter().for_each(|(_, v)| y0.extend(v.to_array()));
        y0.push(0.0);
        let mut h = if hint > 0.0 { hint } else { power_of_two(length / speed) };
        let mut wider = 1.0;
        for attempt in 0..200 {
            // Where rounding is larger than the tolerance, shorter steps do not help.
            if attempt > PATIENCE {
                wider *= 2.0;
                tolerance.iter_mut().for_each(|t| *t *= 2.0);
            }
            if wider > WIDEST {
                return None;
            }
            let mut method = ExplicitRungeKutta::dop853().rtol(0.0).atol(tolerance.clone()).h0(h);
            let taken = method
                .init(&equations, 0.0, h, &y0)
                .and_then(|_| method.step(&equations))
                .is_ok()
                && *method.status() != Status::RejectedStep
                && method.y().iter().all(|y| y.is_finite());
            if taken
                && let Some(paths) = dense(&mut method, n, h, start)
                && satisfies(mechanism, &paths, h, speed * wider)
            {
                let next = if method.h() >= 2.0 * h { 2.0 * h } else { h };
                let mut end = equations.bodies(method.y());
                mechanism.project(h, &mut end);
                let work = driven.then(|| sampled(&mut method, 6 * n, h)).flatten();
                let mut step =
                    Self { length: h, next, end, paths, forces: vec![None; mechanism.rows.len()], work };
                step.sample_forces(mechanism);
                return Some(step);
            }
            h *= 0.5;
        }
        None
    }

    fn sample_forces(&mut self, mechanism: &Mechanism) {
        if !mechanism.rows.iter().any(|row| row.unilateral) {
            return;
        }
        let samples: Vec<Vec<f64>> = Polynomial::nodes(FORCE_NODES)
            .into_iter()
            .map(|s| {
                let tau = s * self.length;
                let bodies: Motions = (0..self.paths.len()).map(|k| self.state(k, tau)).collect();
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
        let [x, y, z, u, v, w] = &self.paths[k];
        let of = |p: &Polynomial| p.at(tau).0;
        (DVec3::new(of(x), of(y), of(z)), DVec3::new(of(u), of(v), of(w)))
    }

    /// Bounds on speed and acceleration of body `k`.
    pub fn bounds(&self, k: usize) -> (f64, f64) {
        let bound = |of: usize| {
            DVec3::new(
                self.paths[k][of].derivative_bounds().0,
                self.paths[k][of + 1].derivative_bounds().0,
                self.paths[k][of + 2].derivative_bounds().0,
            )
            .length()
        };
        (bound(0), bound(3))
    }

    /// Force of a one-sided row, its slope, and a bound on its second derivative.
    pub fn row_force(&self, row: usize, tau: f64) -> (f64, f64) {
        self.forces[row].as_ref().map_or((0.0, 0.0), |p| p.at(tau))
    }

    /// Bound on the second derivative of a row's force.
    pub fn row_bound(&self, row: usize) -> f64 {
        self.forces[row].as_ref().map_or(0.0, |p| p.derivative_bounds().1)
    }

    /// Work of driven points since the start of the step \[energy\].
    pub fn work(&self, tau: f64) -> f64 {
        self.work.as_ref().map_or(0.0, |p| p.at(tau).0 - p.at(0.0).0)
    }
}

/// The dense output as polynomials.
fn dense<M: Interpolation<f64, Vec<f64>>>(
    method: &mut M,
    n: usize,
    h: f64,
    start: &Motions,
) -> Option<Vec<[Polynomial; 6]>> {
    let samples: Option<Vec<Vec<f64>>> =
        Polynomial::nodes(NODES).into_iter().map(|s| method.interpolate(s * h).ok()).collect();
    let samples = samples?;
    let path = |index: usize, offset: f64| {
        let values: Vec<f64> = samples.iter().map(|y| y[index] + offset).collect();
        Polynomial::through(&values, h)
    };
    let body = |k: usize| {
        let x = start[k].0.to_array();
        std::array::from_fn(|c| if c < 3 { path(3 * k + c, x[c]) } else { path(3 * n + 3 * k + c - 3, 0.0) })
    };
    Some((0..n).map(body).collect())
}

/// One component of the dense output.
fn sampled<M: Interpolation<f64, Vec<f64>>>(method: &mut M, index: usize, h: f64) -> Option<Polynomial> {
    let values: Option<Vec<f64>> =
        Polynomial::nodes(NODES).into_iter().map(|s| method.interpolate(s * h).ok().map(|y| y[index])).collect();
    Some(Polynomial::through(&values?, h))
}

/// Whether the dense output obeys the equations of motion inside the step.
fn satisfies(mechanism: &Mechanism, paths: &[[Polynomial; 6]], h: f64, speed: f64) -> bool {
    [0.2, 0.45, 0.75].into_iter().all(|s| {
        let tau = s * h;
        let vector = |p: &[Polynomial; 6], of: usize| DVec3::from_array(std::array::from_fn(|c| p[of + c].at(tau).0));
        let slope = |p: &[Polynomial; 6], of: usize| DVec3::from_array(std::array::from_fn(|c| p[of + c].at(tau).1));
        let bodies: Motions = paths.iter().map(|p| (vector(p, 0), vector(p, 3))).collect();
        let (a, _) = mechanism.accelerations(tau, &bodies);
        paths.iter().zip(&a).all(|(p, a)| {
            (slope(p, 3) - *a).length() * h <= DENSE * speed
                && (slope(p, 0) - vector(p, 3)).length() <= DENSE * speed
        })
    })
}

/// A length that the mechanism's motion changes over \[length\].
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
