//! Contacts and strings that touch at present.

use std::collections::BTreeSet;

use glam::DVec3;
use haff_engine::Observer;

use crate::{mechanism::Link, model::Tether, world::World};

impl World {
    /// Contacts and strings of these bodies, which have no flights, whose gap is closed within the
    /// resolution; their pendulums on rods, and rods.
    pub fn touching_links(&self, bodies: &[usize]) -> BTreeSet<Link> {
        let mine = self.among(bodies);
        let mine = |i: usize| mine[self.body[i]];
        let mut links = BTreeSet::new();
        for (p, pendulum) in self.joints.pendulums.iter().enumerate() {
            if mine(pendulum.bob) && !self.immovable(self.body[pendulum.bob]) {
                let distance = (self.state(pendulum.bob, self.now).0 - pendulum.pivot).length();
                let gap = pendulum.length - distance;
                if pendulum.tether == Tether::Rod || gap <= self.touch(pendulum.length) {
                    links.insert(Link::Tether(p));
                }
            }
        }
        links.extend(self.rigid_links(bodies).into_iter().filter(|link| matches!(link, Link::Rod(_))));
        for k in (0..self.count()).filter(|&k| mine(k)) {
            let x = self.state(k, self.now).0;
            for l in (0..self.count()).filter(|&l| l < k || (l > k && !mine(l))) {
                if self.is_out_of_reach(k, l) || !self.can_collide(k, l) {
                    continue;
                }
                let link = Link::Pair(k.min(l), k.max(l));
                let sigma = self.contact_distance(k, l);
                let gap = (self.state(l, self.now).0 - x).length() - sigma;
                // Rounding determines the positions of points in contact: only their closed contacts touch.
                let point = self.radius[k] + self.radius[l] == 0.0;
                if gap <= self.touch(sigma) && (!point || self.closed.contains_key(&link)) {
                    links.insert(link);
                }
            }
            for (w, wall) in self.system.walls.iter().enumerate() {
                let gap = wall.normal.dot(x - self.wall_point(w, self.now)) - self.radius[k];
                if gap <= self.touch(self.radius[k]) && !self.immovable(self.body[k]) {
                    links.insert(Link::Wall(k, w));
                }
            }
        }
        links
    }

    /// The rate at which a contact or string opens, and the speed below which it is rounding.
    pub fn opening(&self, link: Link) -> (f64, f64) {
        match link {
            Link::Pair(i, j) => {
                let ((x, v), (y, w)) = (self.state(i, self.now), self.state(j, self.now));
                let direction = match self.closed.get(&link) {
                    Some(axis) if *axis != DVec3::ZERO => *axis,
                    _ => (y - x).normalize_or_zero(),
                };
                (direction.dot(w - v), self.slow(v, w))
            }
            Link::Wall(i, wall) => {
                let (v, w) = (self.state(i, self.now).1, self.wall_velocity(wall, self.now));
                (self.system.walls[wall].normal.dot(v - w), self.slow(v, w))
            }
            Link::Tether(p) => {
                let pendulum = &self.joints.pendulums[p];
                let (x, v) = self.state(pendulum.bob, self.now);
                (-(x - pendulum.pivot).normalize_or_zero().dot(v), self.slow(v, DVec3::ZERO))
            }
            Link::Rod(_) | Link::Impact => (0.0, 0.0),
        }
    }

    /// Whether a link holds in both directions.
    pub fn is_two_sided(&self, link: Link) -> bool {
        match link {
            Link::Tether(p) => self.joints.pendulums[p].tether == Tether::Rod,
            Link::Rod(_) => true,
            Link::Pair(..) | Link::Wall(..) | Link::Impact => false,
        }
    }

    /// Links that touch and are `accepted`, given the rate at which they open and the speed below which it is
    /// rounding; includes further bodies that touch.
    pub fn touching(
        &mut self,
        bodies: &mut Vec<usize>,
        accepted: impl Fn(&Self, Link, f64, f64) -> bool,
        observer: &mut dyn Observer,
    ) -> Vec<Link> {
        let mut links = self.touching_links(bodies);
        loop {
            links.retain(|&link| {
                let (rate, slow) = self.opening(link);
                self.is_two_sided(link) || accepted(self, link, rate, slow)
            });
            let mine = self.among(bodies);
            let flying = links
                .iter()
                .flat_map(|&link| self.particles_of(link))
                .map(|i| self.body[i])
                .find(|&body| !mine[body] && !self.immovable(body));
            let Some(body) = flying else { return links.into_iter().collect() };
            let mut more = self.end_flights(&[body], observer);
            if more.is_empty() {
                // It has no flight at present.
                more.push(body);
            }
            links.extend(self.touching_links(&more));
            bodies.extend(more);
            bodies.sort_unstable();
            bodies.dedup();
        }
    }

    /// Whether a particle that has no flight is too far from one on a flight to touch it.
    fn is_out_of_reach(&self, i: usize, flying: usize) -> bool {
        let body = self.body[flying];
        let Some(flight) = self.flights.get(self.flight_key[body]) else { return false };
        let Some(k) = flight.index_of(body) else { return false };
        let tau = self.now.since(flight.start);
        let way = flight.motion.speed_bound(k, 0.0, tau) * tau;
        let place = self.anchor[body].0 + self.offset[flying];
        let sigma = self.contact_distance(i, flying);
        let apart = (place - self.anchor[self.body[i]].0 - self.offset[i]).length();
        apart - way > 1.000_001 * sigma + self.touch(sigma)
    }
}
