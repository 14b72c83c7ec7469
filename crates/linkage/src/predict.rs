//! Predictions of events: every contact, string, force and flight has one prediction, a pure function of its
//! flights.

use glam::DVec3;
use haff_mechanics::{time_to_contact, time_to_contact_accelerated, time_to_plane};

use haff_engine::Instant;

use crate::{
    crossing::{Search, first_crossing},
    flights::Flight,
    mechanism::Link,
    motion::{Monitored, Motion},
    world::World,
};

/// A search covers this many timescales of the motions at a time.
const AHEAD: f64 = 2.0;
/// Forces below this part of their scale count as zero.
const NO_FORCE: f64 = 1e-12;

/// The event that a prediction belongs to. Simultaneous events are taken in this order, and by rows within a
/// kind: impacts of a chain of touching bodies are resolved one after the other.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(crate) enum Key {
    /// Two particles collide.
    Pair(usize, usize),
    /// A particle collides with a wall.
    Wall(usize, usize),
    /// A slack string becomes taut.
    Taut(usize),
    /// A monitored quantity of a flight falls to zero.
    Monitored(usize, usize),
    /// The range of a numerical motion ends.
    Renew(usize),
    /// A completed series of bounces ends.
    Settle(Link),
}

/// Time of a prediction, and whether the event happens then or the search is to be continued from there.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Prediction {
    pub at: Instant,
    pub happens: bool,
}

impl Prediction {
    const NEVER: Self = Self { at: Instant::NEVER, happens: false };

    /// From a search that started at `start`; `to`: its end, and whether the range continues beyond it.
    fn from_search(search: Search, start: Instant, to: f64, continues: bool) -> Self {
        match search {
            Search::At(s) => Self { at: start.after(s), happens: true },
            Search::Unfinished(s) => Self { at: start.after(s), happens: false },
            Search::None if continues => Self { at: start.after(to), happens: false },
            Search::None => Self::NEVER,
        }
    }
}

/// A body on its flight.
struct Path<'a> {
    motion: &'a Motion,
    k: usize,
    offset: DVec3,
    /// Time since the flight's start at the beginning of the search.
    from: f64,
}

impl Path<'_> {
    fn state(&self, s: f64) -> (DVec3, DVec3) {
        let (x, v) = self.motion.state(self.k, self.from + s);
        (x + self.offset, v)
    }

    fn acceleration(&self, s: f64) -> DVec3 {
        self.motion.acceleration(self.k, self.from + s)
    }

    /// Bound on the speed within `length` of the beginning of the search.
    fn speed_bound(&self, length: f64) -> f64 {
        self.motion.speed_bound(self.k, self.from, self.from + length)
    }
}

impl World {
    fn path(&self, particle: usize, start: Instant) -> Option<(&Flight, Path<'_>)> {
        let body = self.body[particle];
        let flight = self.flights.get(self.flight_key[body])?;
        let k = flight.index_of(body)?;
        let from = start.since(flight.start);
        Some((flight, Path { motion: &flight.motion, k, offset: self.offset[particle], from }))
    }

    /// Start of the flight of a particle.
    fn since(&self, particle: usize) -> Instant {
        self.flights.get(self.flight_key[self.body[particle]]).map_or(self.now, |flight| flight.start)
    }

    /// The range of a search over these motions from `start`: its length, and whether it continues beyond.
    fn range(start: Instant, flights: &[&Flight]) -> (f64, bool) {
        let end = flights.iter().map(|flight| flight.end()).fold(Instant::NEVER, Instant::min);
        let ahead =
            AHEAD * flights.iter().map(|flight| flight.motion.timescale()).fold(f64::INFINITY, f64::min);
        let left = end.since(start);
        if ahead < left { (ahead, true) } else { (left, false) }
    }

    /// Whether two particles on these flights cannot meet until `end`, by the places where the flights began.
    fn is_far(&self, i: usize, a: (&Flight, usize), j: usize, b: (&Flight, usize), end: Instant) -> bool {
        let way = |(flight, k): (&Flight, usize)| {
            let tau = end.since(flight.start);
            flight.motion.speed_bound(k, 0.0, tau) * tau
        };
        let place = |i: usize| self.anchor[self.body[i]].0 + self.offset[i];
        let apart = (place(j) - place(i)).length() - self.contact_distance(i, j);
        // False if the range has no end.
        apart > (way(a) + way(b)) * (1.0 + 1e-9) + 1e-9 * self.length
    }

    /// Collision of two particles, searched from `from` on.
    pub fn predict_pair(&self, i: usize, j: usize, from: Instant) -> Prediction {
        if !self.can_collide(i, j) || self.closed.contains_key(&Link::Pair(i, j)) {
            return Prediction::NEVER;
        }
        let start = from.max(self.since(i)).max(self.since(j));
        let (Some((fa, a)), Some((fb, b))) = (self.path(i, start), self.path(j, start)) else {
            return Prediction::NEVER;
        };
        let sigma = self.contact_distance(i, j);
        // Bodies that stay within two separate spheres never collide.
        if let (Some((ca, ra)), Some((cb, rb))) =
            (a.motion.enclosing_sphere(a.k), b.motion.enclosing_sphere(b.k))
            && ((ca + a.offset) - (cb + b.offset)).length() > (ra + rb + sigma) * (1.0 + 1e-9)
        {
            return Prediction::NEVER;
        }
        let (to, continues) = Self::range(start, &[fa, fb]);
        if self.is_far(i, (fa, a.k), j, (fb, b.k), start.after(to)) {
            return Prediction::from_search(Search::None, start, to, continues);
        }
        let f = |s: f64| {
            let ((x, v), (y, w)) = (a.state(s), b.state(s));
            let r = y - x;
            let distance = r.length();
            ((r.length_squared() - sigma * sigma) / (distance + sigma), r.dot(w - v) / distance)
        };
        let ((x, v), (y, w)) = (a.state(0.0), b.state(0.0));
        let (touch, slow) = (self.touch(sigma), self.slow(v, w));
        let touch = if self.radius[i] + self.radius[j] == 0.0 { 0.5 * sigma } else { touch };
        let (gap, rate) = f(0.0);
        let touches = gap <= touch;
        if touches && rate < -slow {
            // The remaining gap is rounding: it must not delay the collision, or a heap would have endless
            // collisions.
            return Prediction { at: start, happens: true };
        }
        let grazes = touches && rate.abs() <= slow;
        if let (Some(p), Some(q)) = (a.motion.constant_acceleration(), b.motion.constant_acceleration())
            && !grazes
        {
            let (r, u, acceleration) = (y - x, w - v, q - p);
            let time = if acceleration == DVec3::ZERO {
                time_to_contact(r, u, sigma)
            } else {
                time_to_contact_accelerated(r, u, acceleration, sigma)
            };
            return time.map_or(Prediction::NEVER, |s| Prediction { at: start.after(s), happens: true });
        }
        let speed = a.speed_bound(to) + b.speed_bound(to);
        if gap > speed * to * (1.0 + 1e-9) {
            return Prediction::from_search(Search::None, start, to, continues);
        }
        // gap'' ≥ n·(relative acceleration): the turning of the line of centers n only increases the gap. It
        // changes the direction at most by speed/σ.
        let bound = a.motion.acceleration_bound(a.k) + b.motion.acceleration_bound(b.k);
        let change = a.motion.jerk_bound(a.k) + b.motion.jerk_bound(b.k) + bound * speed / sigma;
        let ahead = |s: f64, t: f64| {
            let n = (b.state(s).0 - a.state(s).0).normalize_or_zero();
            let now = n.dot(b.acceleration(s) - a.acceleration(s));
            let (of_b, k, at) = (b.motion, b.k, b.from + s);
            let alike = a.motion.relative_acceleration_bound(a.k, a.from + s, (of_b, k, at), t - s);
            bound.min(change * (t - s) - now).min(alike)
        };
        let search = first_crossing(&f, &ahead, 0.0, to, touch, slow);
        Prediction::from_search(search, start, to, continues)
    }

    /// Collision of a particle with a wall.
    pub fn predict_wall(&self, i: usize, wall: usize, from: Instant) -> Prediction {
        if self.immovable(self.body[i]) || self.closed.contains_key(&Link::Wall(i, wall)) {
            return Prediction::NEVER;
        }
        let start = from.max(self.since(i));
        let Some((flight, a)) = self.path(i, start) else { return Prediction::NEVER };
        let of = &self.system.walls[wall];
        // Walls of scenes with joints move at a constant velocity, if at all.
        let (point, velocity) = (self.wall_point(wall, start), self.wall_velocity(wall, start));
        let f = |s: f64| {
            let (x, v) = a.state(s);
            (of.normal.dot(x - (point + velocity * s)) - self.radius[i], of.normal.dot(v - velocity))
        };
        let (gap, rate) = f(0.0);
        let slow = self.slow(a.state(0.0).1, velocity);
        let touch = self.touch(self.radius[i]);
        if gap <= touch && rate < -slow {
            return Prediction { at: start, happens: true };
        }
        if let Some(acceleration) = a.motion.constant_acceleration()
            && !(gap <= touch && rate.abs() <= slow)
        {
            let time = time_to_plane(gap, rate, of.normal.dot(acceleration));
            return time.map_or(Prediction::NEVER, |s| Prediction { at: start.after(s), happens: true });
        }
        let (to, continues) = Self::range(start, &[flight]);
        if gap > (a.speed_bound(to) + velocity.length()) * to * (1.0 + 1e-9) {
            return Prediction::from_search(Search::None, start, to, continues);
        }
        let (bound, change) = (a.motion.acceleration_bound(a.k), a.motion.jerk_bound(a.k));
        let ahead = |s: f64, t: f64| bound.min(change * (t - s) - of.normal.dot(a.acceleration(s)));
        let search = first_crossing(&f, &ahead, 0.0, to, touch, slow);
        Prediction::from_search(search, start, to, continues)
    }

    /// Time at which a slack string becomes taut.
    pub fn predict_taut(&self, p: usize, from: Instant) -> Prediction {
        let pendulum = &self.joints.pendulums[p];
        if self.taut[p] || self.immovable(self.body[pendulum.bob]) {
            return Prediction::NEVER;
        }
        let start = from.max(self.since(pendulum.bob));
        let Some((flight, a)) = self.path(pendulum.bob, start) else { return Prediction::NEVER };
        let (pivot, length) = (pendulum.pivot, pendulum.length);
        // (l² − r²)/2l, because the second derivative of the distance itself is unbounded at the pivot.
        let f = |s: f64| {
            let (x, v) = a.state(s);
            let r = x - pivot;
            let distance = r.length();
            ((length - distance) * (length + distance) / (2.0 * length), -r.dot(v) / length)
        };
        let slow = self.slow(a.state(0.0).1, DVec3::ZERO);
        let (acceleration, jerk) = (a.motion.acceleration_bound(a.k), a.motion.jerk_bound(a.k));
        // −f'' = (v² + r·a)/l changes at most by (3 v a + l j)/l.
        let bound = |s: f64, t: f64| {
            let speed = a.motion.speed_bound(a.k, a.from + s, a.from + t);
            let (x, v) = a.state(s);
            let now = (v.length_squared() + (x - pivot).dot(a.acceleration(s))) / length;
            let change = 3.0 * speed * acceleration / length + jerk;
            (speed * speed / length + acceleration).min(now + change * (t - s))
        };
        let (to, continues) = Self::range(start, &[flight]);
        let search = first_crossing(&f, &bound, 0.0, to, self.touch(length), slow);
        Prediction::from_search(search, start, to, continues)
    }

    /// Time at which a monitored quantity of a flight falls to zero.
    pub fn predict_monitored(&self, flight: usize, index: usize, from: Instant) -> Prediction {
        let Some(flight) = self.flights.get(flight) else { return Prediction::NEVER };
        let Some(what) = Self::monitored(flight, index) else { return Prediction::NEVER };
        let start = from.max(flight.start);
        let offset = start.since(flight.start);
        let f = |s: f64| flight.motion.monitored_value(&flight.mechanism, what, offset + s);
        let bound = flight.motion.monitored_bound(&flight.mechanism, what);
        let (to, continues) = Self::range(start, &[flight]);
        let scale = match what {
            Monitored::Row(i) => {
                let row = &flight.mechanism.rows[i];
                let mass = |k: Option<usize>| k.map_or(0.0, |k| flight.mechanism.mass[k]);
                let states = flight.states(flight.start);
                (mass(row.a.body()) + mass(row.b.body())) * flight.mechanism.acceleration_scale(&states)
            }
            Monitored::Coil(i) => flight.mechanism.coils[i].natural_length,
        };
        let touch = NO_FORCE * scale;
        // Slopes that cross the tolerance in no less than a hundred ranges count as zero.
        let slow = 0.01 * touch / to.min(1e300);
        let search = first_crossing(&f, &|_, _| bound, 0.0, to, touch, slow);
        Prediction::from_search(search, start, to, continues)
    }

    /// The monitored quantity of a flight with this index.
    pub fn monitored(flight: &Flight, index: usize) -> Option<Monitored> {
        flight.motion.monitored(&flight.mechanism).get(index).copied()
    }

    /// The prediction of a key.
    pub fn predict(&self, key: Key, from: Instant) -> Prediction {
        let prediction = match key {
            Key::Pair(i, j) => self.predict_pair(i, j, from),
            Key::Wall(i, wall) => self.predict_wall(i, wall, from),
            Key::Taut(p) => self.predict_taut(p, from),
            Key::Monitored(flight, index) => self.predict_monitored(flight, index, from),
            Key::Renew(flight) => self
                .flights
                .get(flight)
                .map_or(Prediction::NEVER, |flight| Prediction { at: flight.end(), happens: true }),
            Key::Settle(link) => self
                .pending
                .get(&link)
                .map_or(Prediction::NEVER, |rest| Prediction { at: rest.end, happens: true }),
        };
        if !prediction.happens {
            // The parts of a search do not depend on the present, so that a resumed run has the same ones.
            return prediction;
        }
        // Rounding may put an event an ulp into the past: it is due now.
        Prediction { at: prediction.at.max(self.now), ..prediction }
    }

    /// All keys that concern these bodies and their flights.
    pub fn keys_of(&self, bodies: &[usize]) -> Vec<Key> {
        let n = self.count();
        let mine = self.among(bodies);
        let mine = |i: usize| mine[self.body[i]];
        let mut keys = Vec::new();
        for i in (0..n).filter(|&i| mine(i)) {
            // Each pair once; those that cannot collide, too, whose predictions are then removed.
            keys.extend(
                (0..n).filter(|&j| j < i || (j > i && !mine(j))).map(|j| Key::Pair(i.min(j), i.max(j))),
            );
            keys.extend((0..self.system.walls.len()).map(|wall| Key::Wall(i, wall)));
        }
        for (p, pendulum) in self.joints.pendulums.iter().enumerate() {
            if mine(pendulum.bob) {
                keys.push(Key::Taut(p));
            }
        }
        let mut flight_keys: Vec<usize> = bodies.iter().map(|&body| self.flight_key[body]).collect();
        flight_keys.sort_unstable();
        flight_keys.dedup();
        for flight_key in flight_keys {
            let Some(flight) = self.flights.get(flight_key) else { continue };
            keys.extend(
                (0..flight.motion.monitored(&flight.mechanism).len())
                    .map(|index| Key::Monitored(flight_key, index)),
            );
            keys.push(Key::Renew(flight_key));
        }
        keys.extend(
            self.pending
                .keys()
                .filter(|&&link| self.particles_of(link).into_iter().any(mine))
                .map(|&link| Key::Settle(link)),
        );
        keys
    }
}
