//! Impacts: the laws of physics.md 4, with the reactions of all rods and taut strings.

use glam::DVec3;
use haff_engine::{EventKind, EventRecord, Observer};
use haff_mechanics::{Impact, impact};

use crate::{
    linear,
    mechanism::{End, Link, Mechanism, Motions, Row, RowState, Shape},
    world::World,
};

/// Velocities below this part of the approach speed count as zero in an impact.
const SQUARE: f64 = 1e-13;

impl World {
    /// The mechanism of bodies in an impact: rods, and taut strings.
    fn impact_mechanism(&self, bodies: &[usize]) -> Mechanism {
        let links = self.rigid_links(bodies);
        self.mechanism(bodies, &links, self.now)
    }

    /// Applies the impulse along `row` to the bodies, J = (1 + e) v_n/Λ, with the reactions of rods, taut
    /// strings and plastic contacts at rest; strings that would have to push go slack, contacts that would
    /// have to pull open. `None` if the ends do not approach, or nothing can move.
    pub fn collide(&mut self, bodies: &[usize], links: &[Link], row: Row, e: f64) -> Option<Impact> {
        let mut mechanism = self.mechanism(bodies, links, self.now);
        mechanism.rows.push(Row { link: Link::Impact, ..row });
        let contact = mechanism.rows.len() - 1;
        let mut states = self.anchors(bodies);
        let rows = mechanism.row_states(0.0, &states);
        let approach = -rows[contact].rate;
        let matrix = mechanism.compliance(&rows);
        // Rods, strings and contacts at rest remain so, or open.
        let mut q: Vec<f64> = vec![0.0; rows.len()];
        q[contact] = -(1.0 + e) * approach;
        let one_sided: Vec<bool> =
            mechanism.rows.iter().map(|row| row.unilateral && row.link != Link::Impact).collect();
        // The normal has the rounding error of the positions over the distance of the centers; within that, a
        // string hit at a right angle stays taut.
        let size = match row.shape {
            Shape::Distance(length) => length,
            Shape::Along(..) => self.length,
        };
        let farthest = states.iter().map(|(x, _)| x.length()).fold(self.length, f64::max);
        let tolerance = approach.abs() * (SQUARE + 16.0 * f64::EPSILON * farthest / size);
        let (mut impulses, active) = linear::complementarity(&matrix, &q, &one_sided, tolerance);
        let hit = impulses[contact];
        if approach <= 0.0 || hit <= 0.0 || !hit.is_finite() {
            return None;
        }
        let lambda = (1.0 + e) * approach / hit;
        self.apply_impulses(bodies, &mechanism, &rows, &impulses, &mut states);
        // A correction for rounding, which would have a preferred sign: v_n' = −e v_n, and zero for the other
        // rows.
        let after = mechanism.row_states(0.0, &states);
        let rest: Vec<f64> = (0..after.len())
            .map(|k| if k == contact { e * approach - after[k].rate } else { -after[k].rate })
            .collect();
        (impulses, _) = linear::solve(&matrix, &rest, &active);
        self.apply_impulses(bodies, &mechanism, &rows, &impulses, &mut states);
        for (&body, state) in bodies.iter().zip(&states) {
            self.anchor[body] = *state;
        }
        let impact = impact(approach, e, lambda);
        self.accumulators.dissipated.add(impact.energy_loss);
        self.accumulators.carnot.add(impact.carnot_energy);
        Some(impact)
    }

    /// Applies impulses along rows to bodies and adds the external ones to the sums.
    pub fn apply_impulses(
        &mut self,
        bodies: &[usize],
        mechanism: &Mechanism,
        rows: &[RowState],
        impulses: &[f64],
        states: &mut Motions,
    ) {
        let mut change = vec![DVec3::ZERO; bodies.len()];
        mechanism.apply(rows, impulses, &mut change);
        states.iter_mut().zip(&change).for_each(|(state, by)| state.1 += *by);
        for ((row, state), &impulse) in mechanism.rows.iter().zip(rows).zip(impulses) {
            let mut outside = |fixed: End, other: End, sign: f64| {
                if let (End::Fixed(_, velocity), Some(_)) = (fixed, other.body()) {
                    let push = state.direction * (sign * impulse);
                    let at = other.state(0.0, states).0;
                    self.accumulators.add_impulse(at, push);
                    self.accumulators.work.add(push.dot(velocity));
                }
            };
            outside(row.a, row.b, 1.0);
            outside(row.b, row.a, -1.0);
        }
    }

    /// Removes all relative velocity of the ends of a contact, whose normal points from the first to the
    /// second.
    pub fn stop_relative_motion(&mut self, bodies: &[usize], of: Row, normal: DVec3) -> Impact {
        let mut mechanism = self.impact_mechanism(bodies);
        let before = mechanism.rows.len();
        for axis in [DVec3::X, DVec3::Y, DVec3::Z] {
            mechanism.rows.push(Row {
                link: Link::Impact,
                shape: Shape::Along(axis, 0.0),
                unilateral: false,
                ..of
            });
        }
        let mut states = self.anchors(bodies);
        let rows = mechanism.row_states(0.0, &states);
        let matrix = mechanism.compliance(&rows);
        let relative = DVec3::new(rows[before].rate, rows[before + 1].rate, rows[before + 2].rate);
        let q: Vec<f64> =
            rows.iter().enumerate().map(|(k, row)| if k < before { 0.0 } else { row.rate }).collect();
        let one_sided: Vec<bool> = mechanism.rows.iter().map(|row| row.unilateral).collect();
        let (impulses, active) = linear::complementarity(&matrix, &q, &one_sided, SQUARE * relative.length());
        self.apply_impulses(bodies, &mechanism, &rows, &impulses, &mut states);
        let rest: Vec<f64> = mechanism.row_states(0.0, &states).iter().map(|row| -row.rate).collect();
        let (correction, _) = linear::solve(&matrix, &rest, &active);
        self.apply_impulses(bodies, &mechanism, &rows, &correction, &mut states);
        for (&body, state) in bodies.iter().zip(&states) {
            self.anchor[body] = *state;
        }
        let impulse = DVec3::from_slice(&impulses[before..]);
        // Carnot's theorem for bodies that do not separate, (2.32): ½ P·(w1 − w2), since no other row does
        // work.
        let loss = -0.5 * impulse.dot(relative);
        self.accumulators.dissipated.add(loss);
        self.accumulators.carnot.add(loss);
        Impact {
            approach_speed: -normal.dot(relative),
            impulse: impulse.length(),
            energy_loss: loss,
            carnot_energy: loss,
            ..Impact::default()
        }
    }

    /// Makes a body move with a wall from now on; returns the movable bodies that remain.
    pub fn stick_to_wall(&mut self, body: usize, velocity: DVec3, mut bodies: Vec<usize>) -> Vec<usize> {
        self.sticks_to_wall[body] = true;
        self.body_mass[body] = f64::INFINITY;
        self.anchor[body].1 = velocity;
        let own: Vec<Link> = self
            .closed
            .keys()
            .copied()
            .filter(|&link| matches!(link, Link::Wall(i, _) if self.body[i] == body))
            .collect();
        for link in own {
            self.closed.remove(&link);
        }
        bodies.retain(|&other| other != body);
        self.start_immovable_flight(body);
        bodies
    }

    /// Merges two bodies; returns the movable bodies that remain.
    pub fn merge(&mut self, a: usize, b: usize, mut bodies: Vec<usize>) -> Vec<usize> {
        let (keep, gone) = (a.min(b), a.max(b));
        for body in [keep, gone] {
            if !self.immovable(body) {
                continue;
            }
            self.anchor[body] = self.body_state(body, self.now);
            if let Some(flight) = self.flights.remove(self.flight_key[body]) {
                self.accumulators.work.add(flight.motion.work(self.now.since(flight.start)));
            }
        }
        let shift = self.anchor[gone].0 - self.anchor[keep].0;
        let heavy = if self.body_mass[gone] > self.body_mass[keep] { gone } else { keep };
        self.anchor[keep].1 = self.anchor[heavy].1;
        for i in 0..self.count() {
            if self.body[i] == gone {
                self.body[i] = keep;
                self.offset[i] += shift;
            }
        }
        self.body_mass[keep] += self.body_mass[gone];
        self.excess[keep] += std::mem::take(&mut self.excess[gone]);
        self.sticks_to_wall[keep] |= self.sticks_to_wall[gone];
        let inside: Vec<Link> = self
            .closed
            .keys()
            .copied()
            .filter(|&link| matches!(link, Link::Pair(i, j) if self.body[i] == self.body[j]))
            .collect();
        for link in inside {
            self.closed.remove(&link);
        }
        bodies.retain(|&body| body != gone && body != keep);
        if self.immovable(keep) {
            self.start_immovable_flight(keep);
        } else {
            bodies.push(keep);
        }
        bodies.sort_unstable();
        bodies
    }

    /// Reports an impact.
    pub fn record(
        &self,
        kind: EventKind,
        i: usize,
        j: usize,
        impact: &Impact,
        normal: DVec3,
        observer: &mut dyn Observer,
    ) {
        if !observer.wants_events() {
            return;
        }
        observer.event(&EventRecord {
            time: self.now.time(),
            kind,
            i: i as u32,
            j: j as u32,
            approach_speed: impact.approach_speed,
            impulse: impact.impulse,
            energy_loss: impact.energy_loss,
            carnot_energy: impact.carnot_energy,
            normal,
            position: self.state(i, self.now).0 + normal * self.radius[i],
            impulse_vector: normal * impact.impulse,
            tangential_loss: 0.0,
        });
    }
}
