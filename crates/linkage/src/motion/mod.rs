/*!
Motions: states of the bodies of one mechanism until the next event of one of them.

Each motion provides its state at any τ since its start, bounds on speed and acceleration for the search for
contacts, and the forces of its one-sided rows for the search for their end.
*/

mod modes;
mod numeric;
mod polynomial;
mod spin;
mod swing;

use glam::DVec3;

use crate::mechanism::{End, Link, Mechanism, Motions, Row, Shape};
pub(crate) use modes::Modes;
pub(crate) use numeric::Numeric;
pub(crate) use spin::Spin;
pub(crate) use swing::Swing;

/// Relative deviation within which two pendulums swing in phase. For contact distances smaller than the
/// length of the pendulums a larger one is used, because the line of centers has a larger rounding error.
const IN_PHASE: f64 = 1e-12;
/// Upper limit of that deviation.
const MAX_IN_PHASE: f64 = 1e-9;
/// Velocities and accelerations below this part of their scale count as zero.
const STILL: f64 = 1e-13;

/// A motion, by its kind.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Motion {
    /// At rest, in equilibrium.
    Still(Vec<DVec3>),
    /// Constant acceleration of one body: free, or along walls.
    Ballistic { position: DVec3, velocity: DVec3, acceleration: DVec3, power: f64 },
    /// Pendulums, several if they swing in phase.
    Swing(Vec<Swing>),
    /// A circle without gravity.
    Circle { center: DVec3, arm: DVec3, across: DVec3, omega: f64 },
    /// A rod.
    Spin(Spin),
    /// Springs on a line.
    Modes(Modes),
    /// All other motions, integrated numerically.
    Numeric(Numeric),
}

/// A quantity of a motion whose zero is an event.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Monitored {
    /// The force of a one-sided row: the row opens where it changes its sign.
    Row(usize),
    /// The length of a spring: beyond zero its direction reverses.
    Coil(usize),
}

impl Motion {
    /// The motion of a mechanism with all rows active. `hint`: initial step of a numerical motion that is
    /// continued, or 0.
    pub fn new(mechanism: &Mechanism, bodies: &Motions, hint: f64) -> Option<Self> {
        if let Some(still) = still_motion(mechanism, bodies) {
            return Some(still);
        }
        if mechanism.coils.is_empty() {
            if bodies.len() == 1
                && let Some(motion) = alone(mechanism, bodies[0])
            {
                return Some(motion);
            }
            if let Some(swing) = in_phase(mechanism, bodies) {
                return Some(swing);
            }
            if let [row] = &mechanism.rows[..]
                && let (End::Body(k, at_k), End::Body(l, at_l), Shape::Distance(length)) =
                    (row.a, row.b, row.shape)
                && matches!(row.link, Link::Rod(_))
            {
                let offset = if k < l { [at_k, at_l] } else { [at_l, at_k] };
                let mass = [mechanism.mass[0], mechanism.mass[1]];
                return Some(Self::Spin(Spin::new(
                    [bodies[0], bodies[1]],
                    offset,
                    mass,
                    length,
                    mechanism.gravity,
                )));
            }
        }
        if let Some(modes) = Modes::new(mechanism, bodies) {
            return Some(Self::Modes(modes));
        }
        Numeric::new(mechanism, bodies, hint).map(Self::Numeric)
    }

    /// Rest, if nothing moves and the forces balance.
    pub fn still(mechanism: &Mechanism, bodies: &Motions) -> Option<Self> {
        still_motion(mechanism, bodies)
    }

    /// State of body `k` at `tau`.
    pub fn state(&self, k: usize, tau: f64) -> (DVec3, DVec3) {
        match self {
            Self::Still(positions) => (positions[k], DVec3::ZERO),
            Self::Ballistic { position, velocity, acceleration, .. } => (
                haff_mechanics::free_flight(*position, *velocity, *acceleration, tau),
                haff_mechanics::free_flight_velocity(*velocity, *acceleration, tau),
            ),
            Self::Swing(swings) => swings[k].state(tau),
            Self::Circle { center, arm, across, omega } => {
                let (sin, cos) = libm::sincos(omega * tau);
                (*center + *arm * cos + *across * sin, (*across * cos - *arm * sin) * *omega)
            }
            Self::Spin(spin) => spin.state(k, tau),
            Self::Modes(modes) => modes.state(k, tau),
            Self::Numeric(step) => step.state(k, tau),
        }
    }

    /// Bound on the acceleration of body `k` [length/time²].
    pub fn acceleration_bound(&self, k: usize) -> f64 {
        match self {
            Self::Still(_) => 0.0,
            Self::Ballistic { acceleration, .. } => acceleration.length(),
            Self::Swing(swings) => swings[k].acceleration_bound(),
            Self::Circle { arm, omega, .. } => omega * omega * arm.length(),
            Self::Spin(spin) => spin.acceleration_bound(k),
            Self::Modes(modes) => modes.acceleration_bound(k),
            Self::Numeric(step) => step.bounds(k)[1],
        }
    }

    /// Acceleration of body `k` at `tau` [length/time²].
    pub fn acceleration(&self, k: usize, tau: f64) -> DVec3 {
        match self {
            Self::Still(_) => DVec3::ZERO,
            Self::Ballistic { acceleration, .. } => *acceleration,
            Self::Swing(swings) => swings[k].acceleration(tau),
            Self::Circle { arm, across, omega, .. } => {
                let (sin, cos) = libm::sincos(omega * tau);
                (*arm * cos + *across * sin) * -(omega * omega)
            }
            Self::Spin(spin) => spin.acceleration(k, tau),
            Self::Modes(modes) => modes.acceleration(k, tau),
            Self::Numeric(step) => step.acceleration(k, tau),
        }
    }

    /// Bound on the rate of change of the acceleration of body `k` [length/time³].
    pub fn jerk_bound(&self, k: usize) -> f64 {
        match self {
            Self::Still(_) | Self::Ballistic { .. } => 0.0,
            Self::Swing(swings) => swings[k].jerk_bound(),
            Self::Circle { arm, omega, .. } => omega * omega * omega * arm.length(),
            Self::Spin(spin) => spin.jerk_bound(k),
            Self::Modes(modes) => modes.jerk_bound(k),
            Self::Numeric(step) => step.bounds(k)[2],
        }
    }

    /// A bound on the relative acceleration of two pendulums up to a time `t` after `tau` and `other_tau`.
    /// Nearly equal motions have nearly equal accelerations.
    pub fn relative_acceleration_bound(
        &self,
        k: usize,
        tau: f64,
        (other, l, other_tau): (&Self, usize, f64),
        t: f64,
    ) -> f64 {
        match (self, other) {
            (Self::Swing(a), Self::Swing(b)) => a[k].relative_acceleration_bound(tau, &b[l], other_tau, t),
            _ => f64::INFINITY,
        }
    }

    /// Bound on the speed of body `k` between two times [length/time].
    pub fn speed_bound(&self, k: usize, from: f64, to: f64) -> f64 {
        match self {
            Self::Still(_) => 0.0,
            // The maximum of a convex function is at an end.
            Self::Ballistic { velocity, acceleration, .. } => {
                (*velocity + *acceleration * from).length().max((*velocity + *acceleration * to).length())
            }
            Self::Swing(swings) => swings[k].speed_bound(),
            Self::Circle { arm, omega, .. } => omega * arm.length(),
            Self::Spin(spin) => spin.speed_bound(k, from.abs().max(to.abs())),
            Self::Modes(modes) => modes.state(k, from).1.length() + modes.acceleration_bound(k) * (to - from),
            Self::Numeric(step) => step.bounds(k)[0],
        }
    }

    /// Acceleration, if it is constant.
    pub fn constant_acceleration(&self) -> Option<DVec3> {
        match self {
            Self::Still(_) => Some(DVec3::ZERO),
            Self::Ballistic { acceleration, .. } => Some(*acceleration),
            Self::Swing(_) | Self::Circle { .. } | Self::Spin(_) | Self::Modes(_) | Self::Numeric(_) => None,
        }
    }

    /// A sphere that body `k` never leaves, if there is one: center and radius.
    pub fn enclosing_sphere(&self, k: usize) -> Option<(DVec3, f64)> {
        match self {
            Self::Still(positions) => Some((positions[k], 0.0)),
            Self::Swing(swings) => Some(swings[k].enclosing_sphere()),
            Self::Circle { center, arm, .. } => Some((*center, arm.length())),
            Self::Ballistic { .. } | Self::Spin(_) | Self::Modes(_) | Self::Numeric(_) => None,
        }
    }

    /// A time over which the motion changes; infinite for motions without a timescale.
    pub fn timescale(&self) -> f64 {
        match self {
            Self::Still(_) | Self::Ballistic { .. } | Self::Numeric(_) => f64::INFINITY,
            Self::Swing(swings) => swings.iter().map(Swing::timescale).fold(f64::INFINITY, f64::min),
            Self::Circle { omega, .. } => 1.0 / omega,
            Self::Spin(spin) => spin.timescale(),
            Self::Modes(modes) => modes.timescale(),
        }
    }

    /// Range of the motion [time].
    pub fn length(&self) -> f64 {
        match self {
            Self::Numeric(step) => step.length,
            _ => f64::INFINITY,
        }
    }

    /// Work of moving points on the bodies since the start \[energy\].
    pub fn work(&self, tau: f64) -> f64 {
        match self {
            // Power of the force on the moving body.
            Self::Ballistic { power, .. } => power * tau,
            Self::Numeric(step) => step.work(tau),
            _ => 0.0,
        }
    }

    /// All monitored quantities.
    pub fn monitored(&self, mechanism: &Mechanism) -> Vec<Monitored> {
        let one_sided = |i: &usize| mechanism.rows[*i].unilateral;
        let rows = (0..mechanism.rows.len()).filter(one_sided).map(Monitored::Row);
        match self {
            Self::Still(_) | Self::Ballistic { .. } | Self::Circle { .. } | Self::Spin(_) => Vec::new(),
            // The rows between bodies that swing in phase carry no force.
            Self::Swing(_) => rows
                .filter(|monitored| {
                    matches!(monitored, Monitored::Row(i) if mechanism.rows[*i].a.body().is_none()
                        || mechanism.rows[*i].b.body().is_none())
                })
                .collect(),
            Self::Modes(_) => {
                let turning = |i: &usize| mechanism.coils[*i].natural_length > 0.0;
                rows.chain((0..mechanism.coils.len()).filter(turning).map(Monitored::Coil)).collect()
            }
            Self::Numeric(_) => rows.collect(),
        }
    }

    /// Value and slope of a monitored quantity; the event is where it falls below zero.
    pub fn monitored_value(&self, mechanism: &Mechanism, what: Monitored, tau: f64) -> (f64, f64) {
        match (self, what) {
            (Self::Swing(swings), Monitored::Row(i)) => {
                let row = &mechanism.rows[i];
                let Some(k) = row.a.body().or(row.b.body()) else { return (1.0, 0.0) };
                let (tension, slope) = swings[k].tension(tau);
                let inwards = -row.sign * mechanism.mass[k];
                (inwards * tension, inwards * slope)
            }
            (Self::Modes(modes), Monitored::Row(i)) => modes.row_force(i, tau),
            (Self::Modes(modes), Monitored::Coil(i)) => modes.coil_length(i, tau),
            (Self::Numeric(step), Monitored::Row(i)) => step.row_force(i, tau),
            _ => (1.0, 0.0),
        }
    }

    /// Bound on the second derivative of a monitored quantity.
    pub fn monitored_bound(&self, mechanism: &Mechanism, what: Monitored) -> f64 {
        match (self, what) {
            (Self::Swing(swings), Monitored::Row(i)) => {
                let row = &mechanism.rows[i];
                row.a.body().or(row.b.body()).map_or(0.0, |k| mechanism.mass[k] * swings[k].tension_bound())
            }
            (Self::Modes(modes), Monitored::Row(i)) => modes.row_bound(i),
            (Self::Modes(modes), Monitored::Coil(i)) => modes.coil_bound(i),
            (Self::Numeric(step), Monitored::Row(i)) => step.row_bound(i),
            _ => 0.0,
        }
    }

    /// Name of the kind.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Still(_) => "rest",
            Self::Ballistic { .. } => "free flight",
            Self::Swing(_) => "pendulum",
            Self::Circle { .. } => "circle",
            Self::Spin(_) => "rod",
            Self::Modes(_) => "normal modes",
            Self::Numeric(_) => "numerical",
        }
    }
}

/// Rest in equilibrium.
fn still_motion(mechanism: &Mechanism, bodies: &Motions) -> Option<Motion> {
    if mechanism.is_driven() {
        return None;
    }
    let (a, _) = mechanism.accelerations(0.0, bodies);
    let scale = mechanism.acceleration_scale(bodies);
    let quiet =
        bodies.iter().all(|(_, v)| *v == DVec3::ZERO) && a.iter().all(|a| a.length() <= STILL * scale);
    quiet.then(|| Motion::Still(bodies.iter().map(|(x, _)| *x).collect()))
}

/// One body without springs: free, on walls, or at a constant distance from a point at rest.
fn alone(mechanism: &Mechanism, (position, velocity): (DVec3, DVec3)) -> Option<Motion> {
    let walls = mechanism.rows.iter().all(|row| matches!(row.shape, Shape::Along(..)));
    if walls {
        let bodies = vec![(position, velocity)];
        let (a, forces) = mechanism.accelerations(0.0, &bodies);
        let power = mechanism.power_of_points(0.0, &bodies, &forces);
        let (mut velocity, mut acceleration) = (velocity, a[0]);
        // Rounding must not let it drift away from the walls.
        for (row, state) in mechanism.rows.iter().zip(mechanism.row_states(0.0, &bodies)) {
            let n = state.direction;
            let fixed = if row.a.body().is_none() { row.a } else { row.b };
            velocity -= n * n.dot(velocity - fixed.state(0.0, &bodies).1);
            acceleration -= n * n.dot(acceleration);
        }
        return Some(Motion::Ballistic { position, velocity, acceleration, power });
    }
    let [row] = &mechanism.rows[..] else { return None };
    let (point, length) = center_of(row)?;
    let arm = position - point;
    let direction = arm.normalize();
    let tangential = velocity - direction * velocity.dot(direction);
    if mechanism.gravity == DVec3::ZERO {
        let speed = tangential.length();
        if speed == 0.0 {
            return None;
        }
        return Some(Motion::Circle {
            center: point,
            arm: direction * length,
            across: tangential * (length / speed),
            omega: speed / length,
        });
    }
    Swing::new(point, length, position, velocity, mechanism.gravity).map(|swing| Motion::Swing(vec![swing]))
}

/// The fixed point at a constant distance from the body's own center, by a row, and the distance.
fn center_of(row: &Row) -> Option<(DVec3, f64)> {
    let Shape::Distance(length) = row.shape else { return None };
    match (row.a, row.b) {
        (End::Fixed(point, DVec3::ZERO), End::Body(_, offset))
        | (End::Body(_, offset), End::Fixed(point, DVec3::ZERO)) => Some((point - offset, length)),
        _ => None,
    }
}

/// Pendulums in contact that swing in phase: the contacts carry no force.
fn in_phase(mechanism: &Mechanism, bodies: &Motions) -> Option<Motion> {
    let mut center: Vec<Option<(DVec3, f64)>> = vec![None; bodies.len()];
    for row in &mechanism.rows {
        match (row.a.body(), row.b.body()) {
            (Some(_), Some(_)) => {
                if !matches!(row.link, Link::Pair(..)) {
                    return None;
                }
            }
            (Some(k), None) | (None, Some(k)) => {
                if center[k].replace(center_of(row)?).is_some() {
                    return None;
                }
            }
            (None, None) => return None,
        }
    }
    let centers: Vec<(DVec3, f64)> = center.into_iter().collect::<Option<_>>()?;
    let (first, length) = centers[0];
    let relative = bodies[0].0 - first;
    let speed = bodies[0].1.length();
    let tolerance = mechanism
        .rows
        .iter()
        .filter(|row| matches!(row.link, Link::Pair(..)))
        .map(|row| match row.shape {
            Shape::Distance(sigma) => IN_PHASE * (1.0 + length / sigma),
            Shape::Along(..) => IN_PHASE,
        })
        .fold(IN_PHASE, f64::max)
        .min(MAX_IN_PHASE);
    let same = centers.iter().zip(bodies).all(|(&(point, of), &(x, v))| {
        (of - length).abs() <= IN_PHASE * length
            && ((x - point) - relative).length() <= tolerance * length
            && (v - bodies[0].1).length() <= tolerance * speed
    });
    if !same {
        return None;
    }
    // All have exactly the same motion, so that their distances stay as they are however long they swing.
    let total: f64 = mechanism.mass.iter().sum();
    let mean = |of: &dyn Fn(usize) -> DVec3| -> DVec3 {
        (0..bodies.len()).map(|k| of(k) * (mechanism.mass[k] / total)).sum()
    };
    let relative = mean(&|k| bodies[k].0 - centers[k].0);
    let velocity = mean(&|k| bodies[k].1);
    let swing = Swing::new(DVec3::ZERO, length, relative, velocity, mechanism.gravity)?;
    let start = swing.state(0.0).0;
    Some(Motion::Swing(bodies.iter().map(|(x, _)| swing.about(*x - start)).collect()))
}
