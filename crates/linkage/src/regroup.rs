//! Between flights: ends the flights of bodies, determines contacts again, and starts new flights.

use std::collections::BTreeSet;

use glam::DVec3;
use haff_engine::{EventKind, EventRecord, Observer};

use crate::{
    error::LinkageError,
    flights::Flight,
    mechanism::{Link, Mechanism, Motions},
    motion::Motion,
    settle::Hit,
    world::World,
};

/// Speeds below this part of the scene's count as rest, if forces are balanced.
const REST: f64 = 4e-15;

impl World {
    /// Ends the flights of these bodies, now; returns all their movable bodies, in order. Flights of
    /// immovable ones continue.
    pub fn end_flights(&mut self, bodies: &[usize], observer: &mut dyn Observer) -> Vec<usize> {
        let mut taken = Vec::new();
        for &body in bodies {
            if self.immovable(body) {
                continue;
            }
            let Some(flight) = self.flights.remove(self.flight_key[body]) else { continue };
            self.ended.push(flight.bodies[0]);
            let before = self.anchors(&flight.bodies);
            let excess = flight.bodies.iter().map(|&body| std::mem::take(&mut self.excess[body])).sum();
            let (after, excess) = flight.states_at_event(&before, self.now, excess);
            self.excess[flight.bodies[0]] = excess;
            self.pressed.extend(flight.mechanism.pressed_contacts(self.now.since(flight.start), &after));
            for (k, &body) in flight.bodies.iter().enumerate() {
                self.anchor[body] = after[k];
                let (momentum, moment) = self.momentum_change(body, before[k], after[k]);
                self.accumulators.add_momentum(momentum, moment);
                taken.push(body);
            }
            self.accumulators.work.add(flight.motion.work(self.now.since(flight.start)));
        }
        taken.sort_unstable();
        let ended: Vec<Link> = self
            .pending
            .keys()
            .copied()
            .filter(|&link| self.particles_of(link).iter().any(|&i| taken.contains(&self.body[i])))
            .collect();
        for link in ended {
            self.settle(link, observer);
        }
        taken
    }

    /// Changes of a body's momentum and angular momentum between two states.
    pub fn momentum_change(
        &self,
        body: usize,
        before: (DVec3, DVec3),
        after: (DVec3, DVec3),
    ) -> (DVec3, DVec3) {
        let (mut momentum, mut moment) = (DVec3::ZERO, DVec3::ZERO);
        for i in self.members(body) {
            let (p, q) = (before.1 * self.mass[i], after.1 * self.mass[i]);
            if !self.mass[i].is_finite() {
                continue;
            }
            momentum += q - p;
            moment += (after.0 + self.offset[i]).cross(q) - (before.0 + self.offset[i]).cross(p);
        }
        (momentum, moment)
    }

    /// Ends a completed series of bounces: adds its losses to the sums.
    pub fn settle(&mut self, link: Link, observer: &mut dyn Observer) {
        let Some(rest) = self.pending.remove(&link) else { return };
        self.settled.push(link);
        self.accumulators.dissipated.add(rest.energy_loss);
        self.accumulators.carnot.add(rest.carnot_energy);
        let (kind, i, j, normal) = match link {
            Link::Wall(i, w) => (EventKind::Rest, i, w, -self.system.walls[w].normal),
            Link::Pair(i, j) => {
                let r = self.state(j, self.now).0 - self.state(i, self.now).0;
                (EventKind::Settle, i, j, r.normalize_or_zero())
            }
            Link::Tether(p) => {
                let bob = self.joints.pendulums[p].bob;
                let r = self.state(bob, self.now).0 - self.joints.pendulums[p].pivot;
                (EventKind::Taut, bob, p, r.normalize_or_zero())
            }
            Link::Rod(_) | Link::Impact => return,
        };
        if kind != EventKind::Taut {
            self.accumulators.counters.rests += 1;
        }
        if observer.wants_events() {
            observer.event(&EventRecord {
                time: self.now.time(),
                kind,
                i: i as u32,
                j: j as u32,
                approach_speed: rest.speed,
                impulse: rest.impulse,
                energy_loss: rest.energy_loss,
                carnot_energy: rest.carnot_energy,
                normal,
                position: self.state(i, self.now).0 + normal * self.radius[i],
                impulse_vector: normal * rest.impulse,
                tangential_loss: 0.0,
            });
        }
    }

    /// Reports the end of a link without impact.
    pub fn report_end(&self, link: Link, observer: &mut dyn Observer) {
        if !observer.wants_events() {
            return;
        }
        let (kind, i, j, normal) = match link {
            Link::Tether(p) => {
                let pendulum = &self.joints.pendulums[p];
                let r = self.state(pendulum.bob, self.now).0 - pendulum.pivot;
                (EventKind::Slack, pendulum.bob, p, r.normalize_or_zero())
            }
            Link::Pair(i, j) => {
                let r = self.state(j, self.now).0 - self.state(i, self.now).0;
                (EventKind::Release, i, j, r.normalize_or_zero())
            }
            Link::Wall(i, w) => (EventKind::Lift, i, w, -self.system.walls[w].normal),
            Link::Rod(_) | Link::Impact => return,
        };
        observer.event(&EventRecord {
            time: self.now.time(),
            kind,
            i: i as u32,
            j: j as u32,
            normal,
            position: self.state(i, self.now).0 + normal * self.radius[i],
            ..EventRecord::default()
        });
    }

    /// Starts new flights for bodies whose flights were [ended](Self::end_flights), and reports links that
    /// open. `excluded`: links that have just opened; `hits`: the contacts of impacts that have just
    /// happened. Returns all bodies that have new flights.
    pub fn regroup(
        &mut self,
        mut bodies: Vec<usize>,
        excluded: &BTreeSet<Link>,
        hits: &[Hit],
        observer: &mut dyn Observer,
    ) -> Result<Vec<usize>, LinkageError> {
        for &link in excluded {
            self.open(link);
        }
        let could_stay = |world: &Self, link: Link, rate: f64, slow: f64| {
            !excluded.contains(&link) && world.might_rest(link, rate, slow)
        };
        let candidates = self.touching(&mut bodies, could_stay, observer);
        self.pressed.clear();
        // Bodies that separate, or that are about to collide, are not in contact.
        let mine = |world: &Self, i: usize| bodies.contains(&world.body[i]);
        let lost: Vec<Link> = self
            .closed
            .keys()
            .copied()
            .chain((0..self.taut.len()).filter(|&p| self.taut[p]).map(Link::Tether))
            .filter(|&link| {
                self.particles_of(link).iter().any(|&i| mine(self, i)) && !candidates.contains(&link)
            })
            .collect();
        for link in lost {
            self.open(link);
            if matches!(link, Link::Tether(_)) {
                self.report_end(link, observer);
            }
        }
        let mut active_links = Vec::new();
        for part in self.parts(&bodies, &candidates) {
            let links = self.links_of(&part, &candidates);
            let closed = self.settle_contacts(&part, links.clone(), hits, observer);
            for link in links {
                if closed.contains(&link) {
                    active_links.push(link);
                    self.close(link);
                } else if self.open(link) {
                    self.report_end(link, observer);
                }
            }
        }
        for part in self.parts(&bodies, &active_links) {
            let links = self.links_of(&part, &active_links);
            let mechanism = self.mechanism(&part, &links, self.now);
            let states = self.rested(&mechanism, self.anchors(&part));
            self.start_flight_on_constraints(part, mechanism, states, 0.0)?;
        }
        Ok(bodies)
    }

    /// The links with an end on one of these bodies.
    fn links_of(&self, part: &[usize], links: &[Link]) -> Vec<Link> {
        let mut of: Vec<Link> = links
            .iter()
            .copied()
            .filter(|&link| self.particles_of(link).iter().any(|&i| part.contains(&self.body[i])))
            .collect();
        of.sort_unstable();
        of
    }

    /// Bodies in balance whose speeds are zero within rounding are set to rest.
    fn rested(&self, mechanism: &Mechanism, states: Motions) -> Motions {
        if states.iter().any(|(_, v)| v.length() > REST * self.speed) {
            return states;
        }
        let rest: Motions = states.iter().map(|(x, _)| (*x, DVec3::ZERO)).collect();
        match Motion::still(mechanism, &rest) {
            Some(_) => rest,
            None => states,
        }
    }

    /// Starts a flight now, of bodies that may be off their constraints by less than the resolution.
    pub fn start_flight_on_constraints(
        &mut self,
        bodies: Vec<usize>,
        mut mechanism: Mechanism,
        mut states: Motions,
        hint: f64,
    ) -> Result<(), LinkageError> {
        let before = states.clone();
        self.excess[bodies[0]] += mechanism.restore_lengths(&mut states);
        for ((&body, before), after) in bodies.iter().zip(&before).zip(&states) {
            let (momentum, moment) = self.momentum_change(body, *before, *after);
            self.accumulators.add_momentum(momentum, moment);
        }
        self.start_flight(bodies, mechanism, &states, hint)
    }

    /// Starts a flight now.
    pub fn start_flight(
        &mut self,
        bodies: Vec<usize>,
        mut mechanism: Mechanism,
        states: &Motions,
        hint: f64,
    ) -> Result<(), LinkageError> {
        mechanism.hold_present_lengths(states, |_| true);
        for (&body, state) in bodies.iter().zip(states) {
            self.anchor[body] = *state;
            self.flight_key[body] = bodies[0];
        }
        let motion = Motion::new(&mechanism, states, hint)
            .ok_or(LinkageError::Singular { time: self.now.time(), particle: bodies[0] })?;
        self.flights.insert(Flight { start: self.now, bodies, mechanism, motion, hint });
        Ok(())
    }

    /// Starts the flight of an immovable body.
    pub fn start_immovable_flight(&mut self, body: usize) {
        let (position, velocity) = self.anchor[body];
        // The body supports the weight of the particles that stick to it.
        let weight: DVec3 = self
            .members(body)
            .filter(|&i| self.mass[i].is_finite())
            .map(|i| self.system.domain.gravity * self.mass[i])
            .sum();
        let power = -weight.dot(velocity);
        let motion = Motion::Ballistic { position, velocity, acceleration: DVec3::ZERO, power };
        self.flight_key[body] = body;
        self.flights.insert(Flight {
            start: self.now,
            bodies: vec![body],
            mechanism: Mechanism::default(),
            motion,
            hint: 0.0,
        });
    }

    /// Marks a link as carrying force.
    fn close(&mut self, link: Link) {
        match link {
            Link::Tether(p) => self.taut[p] = true,
            Link::Pair(..) | Link::Wall(..) => {
                self.closed.entry(link).or_insert(DVec3::ZERO);
            }
            Link::Rod(_) | Link::Impact => {}
        }
    }

    /// Marks a link as open; returns whether it was closed.
    pub fn open(&mut self, link: Link) -> bool {
        match link {
            Link::Tether(p) => std::mem::replace(&mut self.taut[p], false),
            Link::Pair(..) | Link::Wall(..) => self.closed.remove(&link).is_some(),
            Link::Rod(_) | Link::Impact => false,
        }
    }
}
