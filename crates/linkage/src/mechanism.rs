/*!
A few bodies, their constraints and springs: accelerations and constraint forces.

Every ideal constraint is a *row*: a unit direction `d` along which the relative velocity of its two ends,
d·(v_b − v_a), must vanish, or must not be negative. With the matrix G of the rows and the masses M, forces λ
and impulses J follow from the same matrix,

```text
(G M⁻¹ Gᵀ) λ = −(G a_free + κ)          κ: contribution of the turning of the directions
(G M⁻¹ Gᵀ) J = Δ(G v)
```

and n·M⁻¹·n of physics.md is 1/m reduced by the reaction of the rows.
*/

use glam::DVec3;
use haff_engine::Sum;

use crate::linear;

/// Accelerations within this part of their scale are ties: a contact then stays closed.
pub(crate) const TIE: f64 = 1e-12;
/// Errors of the energy up to this part of the kinetic energy are corrected by the velocities.
const LARGEST_CORRECTION: f64 = 1e-9;

/// Rounding of the distance of two bodies, relative to their largest coordinates.
const ROUNDING: f64 = 2.0 * f64::EPSILON;

/// The origin of a row. The order is that of ties.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(crate) enum Link {
    /// Pendulum.
    Tether(usize),
    /// Rod.
    Rod(usize),
    /// Two particles in contact.
    Pair(usize, usize),
    /// Particle and wall in contact.
    Wall(usize, usize),
    /// An impact in progress.
    Impact,
}

/// One end of a row or spring.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum End {
    /// A body of the mechanism, and the offset from it \[length\].
    Body(usize, DVec3),
    /// A point that moves uniformly: its position at τ = 0, and its velocity.
    Fixed(DVec3, DVec3),
}

/// The shape of a constraint.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Shape {
    /// |r_b − r_a| = length.
    Distance(f64),
    /// direction·(r_b − r_a) = length: walls, and points in contact.
    Along(DVec3, f64),
}

/// An ideal constraint between two ends.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Row {
    pub link: Link,
    pub a: End,
    pub b: End,
    pub shape: Shape,
    /// +1: its force pushes the ends apart (contacts, rods); −1: it pulls them together (strings).
    pub sign: f64,
    /// Whether the force is one-sided.
    pub unilateral: bool,
}

/// A spring between two ends.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Coil {
    pub a: End,
    pub b: End,
    pub stiffness: f64,
    pub natural_length: f64,
}

/// A row at one state.
#[derive(Debug, Clone, Copy)]
pub(crate) struct RowState {
    /// Direction of its force on end b.
    pub direction: DVec3,
    /// Gap of the constraint ≥ 0 \[length\].
    pub gap: f64,
    /// d(gap)/dt.
    pub rate: f64,
    /// Part of d²(gap)/dt² that does not come from accelerations.
    pub turning: f64,
}

/// Bodies with their rows and springs; rows and springs refer to bodies by their index here.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct Mechanism {
    pub mass: Vec<f64>,
    pub gravity: DVec3,
    pub rows: Vec<Row>,
    pub coils: Vec<Coil>,
}

/// Positions and velocities of the bodies of a mechanism.
pub(crate) type Motions = Vec<(DVec3, DVec3)>;

impl End {
    /// Position and velocity at τ.
    pub fn state(&self, tau: f64, bodies: &[(DVec3, DVec3)]) -> (DVec3, DVec3) {
        match *self {
            Self::Body(k, offset) => (bodies[k].0 + offset, bodies[k].1),
            Self::Fixed(point, velocity) => (point + velocity * tau, velocity),
        }
    }

    /// The index of the body, if it is one.
    pub fn body(&self) -> Option<usize> {
        match *self {
            Self::Body(k, _) => Some(k),
            Self::Fixed(..) => None,
        }
    }

    /// Whether it is a moving point.
    pub fn is_driven(&self) -> bool {
        matches!(*self, Self::Fixed(_, velocity) if velocity != DVec3::ZERO)
    }
}

impl Row {
    /// The row at a state.
    pub fn state(&self, tau: f64, bodies: &[(DVec3, DVec3)]) -> RowState {
        let ((ra, va), (rb, vb)) = (self.a.state(tau, bodies), self.b.state(tau, bodies));
        let (r, v) = (rb - ra, vb - va);
        match self.shape {
            Shape::Along(direction, length) => RowState {
                direction: direction * self.sign,
                gap: self.sign * (direction.dot(r) - length),
                rate: self.sign * direction.dot(v),
                turning: 0.0,
            },
            Shape::Distance(length) => {
                let distance = r.length();
                let d = r / distance;
                let radial = d.dot(v);
                RowState {
                    direction: d * self.sign,
                    // (r² − l²)/(r + l): no cancellation beyond that of r itself.
                    gap: self.sign * ((r.length_squared() - length * length) / (distance + length)),
                    rate: self.sign * radial,
                    turning: self.sign * ((v - d * radial).length_squared() / distance),
                }
            }
        }
    }
}

impl Coil {
    /// Unit vector from a to b and the length; for ends that coincide, the direction of their relative
    /// velocity, along which they are about to separate.
    pub fn direction(&self, tau: f64, bodies: &[(DVec3, DVec3)]) -> (DVec3, f64) {
        let ((ra, va), (rb, vb)) = (self.a.state(tau, bodies), self.b.state(tau, bodies));
        let r = rb - ra;
        let length = r.length();
        if length > 1e-13 * self.natural_length {
            (r / length, length)
        } else {
            ((vb - va).normalize_or_zero(), length)
        }
    }
}

impl Mechanism {
    /// Accelerations without the rows.
    pub fn free_accelerations(&self, tau: f64, bodies: &[(DVec3, DVec3)]) -> Vec<DVec3> {
        let mut a = vec![self.gravity; self.mass.len()];
        for coil in &self.coils {
            let (direction, length) = coil.direction(tau, bodies);
            let force = direction * (coil.stiffness * (length - coil.natural_length));
            if let Some(k) = coil.a.body() {
                a[k] += force / self.mass[k];
            }
            if let Some(k) = coil.b.body() {
                a[k] -= force / self.mass[k];
            }
        }
        a
    }

    /// Change of the kinetic and potential energy between two states, without the cancellation of their
    /// values.
    pub fn energy_change(&self, from: &[(DVec3, DVec3)], to: &[(DVec3, DVec3)]) -> f64 {
        let mut change = Sum::default();
        for ((mass, (x, v)), (y, w)) in self.mass.iter().zip(from).zip(to) {
            change.add(mass * (0.5 * (*w - *v).dot(*w + *v) - self.gravity.dot(*y - *x)));
        }
        for coil in &self.coils {
            let (before, after) = (coil.direction(0.0, from).1, coil.direction(0.0, to).1);
            let stretch = 0.5 * (before + after) - coil.natural_length;
            change.add(coil.stiffness * (after - before) * stretch);
        }
        change.value()
    }

    /// Whether points that hold its bodies move, and do work.
    pub fn is_driven(&self) -> bool {
        self.rows.iter().any(|row| row.a.is_driven() || row.b.is_driven())
            || self.coils.iter().any(|coil| coil.a.is_driven() || coil.b.is_driven())
    }

    /// Gives a state at the end of a flight, after `tau`, the energy of its start plus the work done since,
    /// by a factor of the velocities relative to the points that hold its bodies: rounding and the errors of
    /// integration would add up over all flights. `excess` is what earlier flights could not correct: errors
    /// below the rounding of the velocities, or where hardly anything moves. Returns what remains.
    pub fn restore_energy(
        &self,
        tau: f64,
        start: &[(DVec3, DVec3)],
        end: &mut [(DVec3, DVec3)],
        work: f64,
        excess: f64,
    ) -> f64 {
        let gained = self.energy_change(start, end) - work + excess;
        if gained == 0.0 {
            return 0.0;
        }
        let carried = if self.is_driven() {
            // The smallest velocities that the moving points impose.
            let still: Vec<(DVec3, DVec3)> = end.iter().map(|(x, _)| (*x, DVec3::ZERO)).collect();
            self.kicks(tau, &still)
        } else {
            vec![DVec3::ZERO; end.len()]
        };
        // Both parts are orthogonal in the metric of the masses.
        let free = end.iter().zip(&carried).map(|((_, v), carried)| *v - *carried);
        let kinetic: f64 = free.zip(&self.mass).map(|(v, mass)| 0.5 * mass * v.length_squared()).sum();
        if gained.abs() > LARGEST_CORRECTION * kinetic {
            return gained;
        }
        let change = -0.5 * gained / kinetic;
        end.iter_mut().zip(&carried).for_each(|(body, carried)| body.1 += (body.1 - *carried) * change);
        self.energy_change(start, end) - work + excess
    }

    /// The rows at a state.
    pub fn row_states(&self, tau: f64, bodies: &[(DVec3, DVec3)]) -> Vec<RowState> {
        self.rows.iter().map(|row| row.state(tau, bodies)).collect()
    }

    /// G M⁻¹ Gᵀ, row-major.
    pub fn compliance(&self, states: &[RowState]) -> Vec<f64> {
        let n = self.rows.len();
        let mut matrix = vec![0.0; n * n];
        for i in 0..n {
            for j in 0..=i {
                let dot = states[i].direction.dot(states[j].direction);
                let mut sum = 0.0;
                for (end_i, sign_i) in [(self.rows[i].a, -1.0), (self.rows[i].b, 1.0)] {
                    for (end_j, sign_j) in [(self.rows[j].a, -1.0), (self.rows[j].b, 1.0)] {
                        if let (Some(k), Some(l)) = (end_i.body(), end_j.body())
                            && k == l
                        {
                            sum += sign_i * sign_j * dot / self.mass[k];
                        }
                    }
                }
                matrix[i * n + j] = sum;
                matrix[j * n + i] = sum;
            }
        }
        matrix
    }

    /// Adds the effect of forces or impulses along the rows to accelerations or velocities.
    pub fn apply(&self, states: &[RowState], strengths: &[f64], to: &mut [DVec3]) {
        for ((row, state), &strength) in self.rows.iter().zip(states).zip(strengths) {
            if strength == 0.0 {
                continue;
            }
            if let Some(k) = row.a.body() {
                to[k] -= state.direction * (strength / self.mass[k]);
            }
            if let Some(k) = row.b.body() {
                to[k] += state.direction * (strength / self.mass[k]);
            }
        }
    }

    /// d(rate)/dt of a row for given accelerations; points do not accelerate.
    pub fn row_acceleration(row: &Row, state: &RowState, a: &[DVec3]) -> f64 {
        let of = |end: End| end.body().map_or(DVec3::ZERO, |k| a[k]);
        state.direction.dot(of(row.b) - of(row.a)) + state.turning
    }

    /// Accelerations and row forces with all rows active.
    pub fn accelerations(&self, tau: f64, bodies: &[(DVec3, DVec3)]) -> (Vec<DVec3>, Vec<f64>) {
        let mut a = self.free_accelerations(tau, bodies);
        if self.rows.is_empty() {
            return (a, Vec::new());
        }
        let states = self.row_states(tau, bodies);
        let matrix = self.compliance(&states);
        let target: Vec<f64> = self
            .rows
            .iter()
            .zip(&states)
            .map(|(row, state)| -Self::row_acceleration(row, state, &a))
            .collect();
        let (forces, _) = linear::solve(&matrix, &target, &vec![true; self.rows.len()]);
        self.apply(&states, &forces, &mut a);
        (a, forces)
    }

    /// Contacts whose force at a state is more than a tie's.
    pub fn pressed_contacts(&self, tau: f64, bodies: &[(DVec3, DVec3)]) -> Vec<Link> {
        let is_contact = |row: &Row| matches!(row.link, Link::Pair(..) | Link::Wall(..));
        if !self.rows.iter().any(is_contact) {
            return Vec::new();
        }
        let forces = self.accelerations(tau, bodies).1;
        let tolerance = TIE * self.acceleration_scale(bodies);
        let inverse_mass = |end: End| end.body().map_or(0.0, |k| 1.0 / self.mass[k]);
        let rows = self.rows.iter().zip(forces);
        rows.filter(|(row, force)| {
            is_contact(row) && force * (inverse_mass(row.a) + inverse_mass(row.b)) > tolerance
        })
        .map(|(row, _)| row.link)
        .collect()
    }

    /// Determines the rows that carry force, so that no one-sided force has the wrong sign and no row is
    /// violated; also returns accelerations and forces. A row whose force and acceleration are both zero
    /// within `tolerance` [length/time²] stays active.
    pub fn active_rows(
        &self,
        bodies: &[(DVec3, DVec3)],
        tolerance: f64,
    ) -> (Vec<bool>, Vec<DVec3>, Vec<f64>) {
        let mut a = self.free_accelerations(0.0, bodies);
        let states = self.row_states(0.0, bodies);
        let matrix = self.compliance(&states);
        let q: Vec<f64> = self
            .rows
            .iter()
            .zip(&states)
            .map(|(row, state)| Self::row_acceleration(row, state, &a))
            .collect();
        let unilateral: Vec<bool> = self.rows.iter().map(|row| row.unilateral).collect();
        let (forces, active) = linear::complementarity(&matrix, &q, &unilateral, tolerance);
        self.apply(&states, &forces, &mut a);
        (active, a, forces)
    }

    /// The same mechanism at another place.
    pub fn shifted(&self, by: DVec3) -> Self {
        let mut of = self.clone();
        let shift = |end: &mut End| {
            if let End::Fixed(point, _) = end {
                *point += by;
            }
        };
        for row in &mut of.rows {
            shift(&mut row.a);
            shift(&mut row.b);
        }
        for coil in &mut of.coils {
            shift(&mut coil.a);
            shift(&mut coil.b);
        }
        of
    }

    /// Makes rows hold the lengths of this state, which differ from the nominal ones by less than the
    /// resolution. Bodies moved to the nominal lengths would gain or lose energy.
    pub fn hold_present_lengths(&mut self, bodies: &[(DVec3, DVec3)], which: impl Fn(Link) -> bool) {
        for row in self.rows.iter_mut().filter(|row| which(row.link)) {
            let r = row.b.state(0.0, bodies).0 - row.a.state(0.0, bodies).0;
            row.shape = match row.shape {
                Shape::Distance(_) => Shape::Distance(r.length()),
                Shape::Along(direction, _) => Shape::Along(direction, direction.dot(r)),
            };
        }
    }

    /// A measure of the accelerations at a state, for tolerances [length/time²].
    pub fn acceleration_scale(&self, bodies: &[(DVec3, DVec3)]) -> f64 {
        let mut scale = self.gravity.length();
        for coil in &self.coils {
            let (_, length) = coil.direction(0.0, bodies);
            for k in [coil.a, coil.b].iter().filter_map(End::body) {
                scale += coil.stiffness * length.max(coil.natural_length) / self.mass[k];
            }
        }
        for row in &self.rows {
            let v = row.b.state(0.0, bodies).1 - row.a.state(0.0, bodies).1;
            let length = match row.shape {
                Shape::Distance(length) => length,
                Shape::Along(..) => continue,
            };
            scale += v.length_squared() / length;
        }
        scale
    }

    /// Projects positions and velocities onto the constraints, by the smallest change in the metric of the
    /// masses.
    pub fn project(&self, tau: f64, bodies: &mut [(DVec3, DVec3)]) {
        if self.rows.is_empty() {
            return;
        }
        self.shift(tau, bodies);
        let kicks = self.kicks(tau, bodies);
        bodies.iter_mut().zip(&kicks).for_each(|(body, by)| body.1 += *by);
    }

    /// Moves the bodies onto the constraints.
    fn shift(&self, tau: f64, bodies: &mut [(DVec3, DVec3)]) {
        let all = vec![true; self.rows.len()];
        for _ in 0..3 {
            let states = self.row_states(tau, bodies);
            let target: Vec<f64> = states.iter().map(|state| -state.gap).collect();
            let (shift, _) = linear::solve(&self.compliance(&states), &target, &all);
            let mut moves = vec![DVec3::ZERO; bodies.len()];
            self.apply(&states, &shift, &mut moves);
            bodies.iter_mut().zip(&moves).for_each(|(body, by)| body.0 += *by);
        }
    }

    /// Gives strings and rods their nominal lengths, unless they differ from them only by the rounding of
    /// coordinates: deviations would add up. Contacts keep their gaps. Returns the change of the energy.
    pub fn restore_lengths(&mut self, bodies: &mut [(DVec3, DVec3)]) -> f64 {
        self.hold_present_lengths(bodies, |link| !matches!(link, Link::Tether(_) | Link::Rod(_)));
        let wide = self.rows.iter().zip(self.row_states(0.0, bodies)).any(|(row, state)| {
            let (x, y) = (row.a.state(0.0, bodies).0, row.b.state(0.0, bodies).0);
            state.gap.abs() > ROUNDING * (x.abs().max_element() + y.abs().max_element())
        });
        if !wide {
            return 0.0;
        }
        let before = bodies.to_vec();
        self.shift(0.0, bodies);
        self.energy_change(&before, bodies)
    }

    /// The smallest changes of velocities after which the constraints hold.
    fn kicks(&self, tau: f64, bodies: &[(DVec3, DVec3)]) -> Vec<DVec3> {
        let states = self.row_states(tau, bodies);
        let target: Vec<f64> = states.iter().map(|state| -state.rate).collect();
        let (kick, _) = linear::solve(&self.compliance(&states), &target, &vec![true; self.rows.len()]);
        let mut kicks = vec![DVec3::ZERO; bodies.len()];
        self.apply(&states, &kick, &mut kicks);
        kicks
    }

    /// Power of the moving points on the bodies, for given row forces [energy/time].
    pub fn power_of_points(&self, tau: f64, bodies: &[(DVec3, DVec3)], forces: &[f64]) -> f64 {
        let mut power = 0.0;
        for ((row, state), force) in self.rows.iter().zip(self.row_states(tau, bodies)).zip(forces) {
            let force_b = state.direction * *force;
            if let End::Fixed(_, velocity) = row.a {
                power += force_b.dot(velocity);
            }
            if let End::Fixed(_, velocity) = row.b {
                power -= force_b.dot(velocity);
            }
        }
        for coil in &self.coils {
            let (direction, length) = coil.direction(tau, bodies);
            let force = direction * (coil.stiffness * (length - coil.natural_length));
            // Force on a: +force, on b: −force; the point at the other end carries the opposite.
            if let End::Fixed(_, velocity) = coil.a {
                power -= force.dot(velocity);
            }
            if let End::Fixed(_, velocity) = coil.b {
                power += force.dot(velocity);
            }
        }
        power
    }
}
