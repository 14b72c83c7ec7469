/*!
Event-driven hard spheres in arithmetic of hundreds of bits: the simplest correct code.

All particles are at the present time. After every event the two partners are predicted again with all other
particles, and the earliest of all entries is found by a linear search. By chaos a dilute gas loses some three
bits a collision: after 40 collisions a particle, more than 100 of 256 bits are correct.

f64 is used only to reject images of a pair that pass each other by a wide margin.
*/

use std::cmp::Ordering;

use glam::DVec3;
use haff_engine::{Boundary, System, WallLaw, model::Restitution};

use crate::{
    Error,
    big::{Big, BigVec, big, nearest, twice},
};

/// Relative width of the band around contact within which the f64 filter does not decide. Relative positions
/// and velocities are rounded from exact ones, so the miss distance is accurate to some 1e-15 of the
/// distance; boxes up to 10⁴ diameters have a margin of four decimal orders.
const UNDECIDED: f64 = 1e-7;

/// Rounding of a reference run.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Rounding {
    /// Only that of the arithmetic.
    #[default]
    None,
    /// Position and velocity of a particle are rounded to f64 after each of its own events: the least
    /// rounding of any program that keeps its state in double precision.
    StateToDouble,
    /// In addition, the duration of the flight since its last own event and its end position, before it is
    /// wrapped into the box, are rounded: the least rounding of a program in which flights cross the box any
    /// number of times and add v t once.
    FlightToDouble,
}

/// The next event of a pair, or of a particle and the walls.
#[derive(Debug, Clone)]
struct Entry {
    time: Big,
    /// The rounded time: an order in f64 is the exact order.
    key: f64,
    kind: Kind,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    Contact,
    /// The pair has moved so far that other images of it might come near.
    NewImages,
    Wall(usize),
}

impl Entry {
    fn new(time: Big, kind: Kind) -> Self {
        let key = nearest(&time);
        Self { time, key, kind }
    }

    fn order(&self, other: &Self) -> Ordering {
        self.key.total_cmp(&other.key).then_with(|| self.time.cmp(&other.time))
    }

    /// Keeps the earlier of the two.
    fn keep_earlier(earliest: &mut Option<Self>, entry: Self) {
        if earliest.as_ref().is_none_or(|best| entry.order(best).is_lt()) {
            *earliest = Some(entry);
        }
    }
}

/// A plane with the particles above it.
struct Plane {
    point: BigVec,
    normal: BigVec,
}

/// The state of a high-precision run.
pub struct Reference {
    bits: usize,
    rounding: Rounding,
    position: Vec<BigVec>,
    velocity: Vec<BigVec>,
    radius: Vec<Big>,
    mass: Vec<Big>,
    /// Edges of the periodic axes.
    edge: [Option<Big>; 3],
    gravity: BigVec,
    planes: Vec<Plane>,
    restitution: Big,
    wall_restitution: Big,
    /// Next event of each pair i < j, at `i * n + j`.
    pairs: Vec<Option<Entry>>,
    /// Next wall of each particle.
    walls: Vec<Option<Entry>>,
    now: Big,
    /// Time of each particle's last own event.
    since: Vec<Big>,
    collisions: u64,
    wall_collisions: u64,
}

impl Reference {
    /// A run from the state of `system`, with `bits` significant bits (at least 64).
    ///
    /// Supports one constant restitution for all pairs and one for all walls, walls at rest, finite masses,
    /// no TC model.
    pub fn new(system: &System, bits: usize, rounding: Rounding) -> Result<Self, Error> {
        let bits = bits.max(64);
        let restitutions = one_restitution(system, "the reference")?;
        let class = |body: &haff_engine::Body| system.classes[body.class as usize];
        let vector = |v: DVec3| BigVec::new(v, bits);
        let n = system.bodies.len();
        let size = system.domain.size.to_array();
        let mut reference = Self {
            bits,
            rounding,
            position: system.bodies.iter().map(|body| vector(body.position)).collect(),
            velocity: system.bodies.iter().map(|body| vector(body.velocity)).collect(),
            radius: system.bodies.iter().map(|body| big(class(body).radius, bits)).collect(),
            mass: system.bodies.iter().map(|body| big(class(body).mass, bits)).collect(),
            edge: [0, 1, 2].map(|axis| {
                (system.domain.boundary[axis] == Boundary::Periodic).then(|| big(size[axis], bits))
            }),
            gravity: vector(system.domain.gravity),
            planes: system
                .walls
                .iter()
                .map(|wall| Plane { point: vector(wall.point), normal: vector(wall.normal) })
                .collect(),
            restitution: big(restitutions.0, bits),
            wall_restitution: big(restitutions.1, bits),
            pairs: vec![None; n * n],
            walls: vec![None; n],
            now: big(0.0, bits),
            since: vec![big(0.0, bits); n],
            collisions: 0,
            wall_collisions: 0,
        };
        for i in 0..n {
            for j in i + 1..n {
                reference.predict_pair(i, j);
            }
            reference.predict_walls(i);
        }
        Ok(reference)
    }

    /// Number of collisions between spheres.
    pub fn collisions(&self) -> u64 {
        self.collisions
    }

    /// Number of collisions with walls.
    pub fn wall_collisions(&self) -> u64 {
        self.wall_collisions
    }

    /// Present time [time], rounded.
    pub fn time(&self) -> f64 {
        nearest(&self.now)
    }

    /// Present centres [length], unwrapped unless the state is rounded.
    pub fn position(&self) -> &[BigVec] {
        &self.position
    }

    /// Present velocities [length/time].
    pub fn velocity(&self) -> &[BigVec] {
        &self.velocity
    }

    /// Runs to `time` exactly.
    pub fn run_to(&mut self, time: &Big) {
        while let Some((at, event)) = self.next() {
            if at > *time {
                break;
            }
            self.process(&at, event);
        }
        self.advance_all(time);
    }

    /// Runs until there have been `collisions` between spheres in all, or no further event exists; returns
    /// the time halfway between the last event and the next one [time].
    pub fn run_to_collision(&mut self, collisions: u64) -> f64 {
        while self.collisions < collisions {
            let Some((at, event)) = self.next() else { break };
            self.process(&at, event);
        }
        // Predictions of new images are not counted; they only make the time earlier.
        let next = self.next().map_or_else(|| self.now.clone(), |(at, _)| at);
        nearest(&((&self.now + next) >> 1))
    }

    /// The earliest entry: its time, and its index and kind.
    fn next(&self) -> Option<(Big, (usize, Kind))> {
        let n = self.position.len();
        let pairs = self.pairs.iter().enumerate();
        let walls = self.walls.iter().enumerate().map(|(i, entry)| (n * n + i, entry));
        pairs
            .chain(walls)
            .filter_map(|(index, entry)| entry.as_ref().map(|entry| (index, entry)))
            .min_by(|(_, a), (_, b)| a.order(b))
            .map(|(index, entry)| (entry.time.clone(), (index, entry.kind)))
    }

    fn process(&mut self, at: &Big, (index, kind): (usize, Kind)) {
        let n = self.position.len();
        self.advance_all(at);
        let (i, j) = (index / n, index % n);
        match kind {
            Kind::NewImages => self.predict_pair(i, j),
            Kind::Contact => {
                self.end_flight(i);
                self.end_flight(j);
                self.collide(i, j);
                self.collisions += 1;
                self.predict_all(i);
                self.predict_all(j);
            }
            Kind::Wall(wall) => {
                let i = index - n * n;
                self.end_flight(i);
                self.bounce(i, wall);
                self.wall_collisions += 1;
                self.predict_all(i);
            }
        }
    }

    /// Moves all particles to a time.
    fn advance_all(&mut self, time: &Big) {
        let dt = time - &self.now;
        let fall = (&dt * &dt) >> 1;
        let has_gravity = self.has_gravity();
        for (position, velocity) in self.position.iter_mut().zip(&mut self.velocity) {
            *position = position.plus(velocity, &dt);
            if has_gravity {
                *position = position.plus(&self.gravity, &fall);
                *velocity = velocity.plus(&self.gravity, &dt);
            }
        }
        self.now.clone_from(time);
    }

    fn has_gravity(&self) -> bool {
        self.gravity.0.iter().any(|g| *g != Big::ZERO)
    }

    /// Rounds the flight that ends now, if required.
    fn end_flight(&mut self, i: usize) {
        let since = std::mem::replace(&mut self.since[i], self.now.clone());
        if self.rounding == Rounding::FlightToDouble {
            let duration = &self.now - since;
            let off = big(nearest(&duration), self.bits) - duration;
            self.position[i] = self.position[i].plus(&self.velocity[i], &off);
            self.position[i].round_to_double(self.bits);
        }
    }

    /// Wraps one particle into the box and rounds its state, if required.
    fn round(&mut self, i: usize) {
        if self.rounding == Rounding::None {
            return;
        }
        for (x, edge) in self.position[i].0.iter_mut().zip(&self.edge) {
            if let Some(edge) = edge {
                *x = &*x - edge * (&*x / edge).floor();
            }
        }
        self.position[i].round_to_double(self.bits);
        self.velocity[i].round_to_double(self.bits);
    }

    /// r_j − r_i in the nearest image.
    fn separation(&self, i: usize, j: usize) -> BigVec {
        let mut r = self.position[j].minus(&self.position[i]);
        for (x, edge) in r.0.iter_mut().zip(&self.edge) {
            if let Some(edge) = edge {
                // At half an edge both images are equally near: f64 may decide.
                let image = (nearest(x) / nearest(edge)).round();
                if image != 0.0 {
                    *x = &*x - edge * big(image, self.bits);
                }
            }
        }
        r
    }

    /// Impact of smooth spheres, (2.14), (2.19), (2.20), with r in place of the normal.
    fn collide(&mut self, i: usize, j: usize) {
        let r = self.separation(i, j);
        let approach = self.velocity[i].minus(&self.velocity[j]).dot(&r);
        let factor = (big(1.0, self.bits) + &self.restitution) * approach / r.dot(&r);
        let total = &self.mass[i] + &self.mass[j];
        let (to_i, to_j) = (&factor * &self.mass[j] / &total, &factor * &self.mass[i] / &total);
        self.velocity[i] = self.velocity[i].plus(&r, &-to_i);
        self.velocity[j] = self.velocity[j].plus(&r, &to_j);
        self.round(i);
        self.round(j);
    }

    /// Impact on a wall at rest, (2.21).
    fn bounce(&mut self, i: usize, wall: usize) {
        let normal = &self.planes[wall].normal;
        let speed = self.velocity[i].dot(normal);
        let change = -(big(1.0, self.bits) + &self.wall_restitution) * speed / normal.dot(normal);
        self.velocity[i] = self.velocity[i].plus(normal, &change);
        self.round(i);
    }

    /// Predicts one particle with all others.
    fn predict_all(&mut self, i: usize) {
        for j in 0..self.position.len() {
            if j != i {
                self.predict_pair(i.min(j), i.max(j));
            }
        }
        self.predict_walls(i);
    }

    fn predict_pair(&mut self, i: usize, j: usize) {
        let r = self.separation(i, j);
        // Equal accelerations cancel.
        let v = self.velocity[j].minus(&self.velocity[i]);
        let sigma = &self.radius[i] + &self.radius[j];
        let mut earliest: Option<Entry> = None;
        for shift in self.images(&r, &v, &sigma) {
            let mut image = r.clone();
            for axis in 0..3 {
                if let (Some(edge), true) = (&self.edge[axis], shift[axis] != 0) {
                    image.0[axis] = &image.0[axis] - edge * Big::from(shift[axis]);
                }
            }
            if let Some(delay) = contact(&image, &v, &sigma) {
                let time = &self.now + delay;
                Entry::keep_earlier(&mut earliest, Entry::new(time, Kind::Contact));
            }
        }
        // An image two edges away is one and a half edges from the relative position, and comes within
        // contact distance only after a relative displacement of more than an edge.
        let shortest = self.edge.iter().flatten().map(nearest).reduce(f64::min);
        let speed = v.nearest().length();
        if let (Some(edge), true) = (shortest, speed > 0.0) {
            // An early prediction is harmless, so its time may be rounded.
            let time = &self.now + big(0.999 * edge / speed, self.bits);
            Entry::keep_earlier(&mut earliest, Entry::new(time, Kind::NewImages));
        }
        let n = self.position.len();
        self.pairs[i * n + j] = earliest;
    }

    /// The shifts of those images of the pair that may come into contact.
    fn images(&self, r: &BigVec, v: &BigVec, sigma: &Big) -> Vec<[i32; 3]> {
        let (r, v, sigma) = (r.nearest(), v.nearest(), nearest(sigma));
        let vv = v.length_squared();
        let edge = [0, 1, 2].map(|axis| self.edge[axis].as_ref().map(nearest));
        let range = |axis: usize| if edge[axis].is_some() { -1..=1 } else { 0..=0 };
        let mut found = Vec::new();
        for x in range(0) {
            for y in range(1) {
                for z in range(2) {
                    let shift = [x, y, z];
                    let offset = DVec3::from_array(
                        [0, 1, 2].map(|axis| edge[axis].unwrap_or(0.0) * f64::from(shift[axis])),
                    );
                    let image = r - offset;
                    let miss = image.cross(v).length_squared();
                    // For squares: twice the band, and the rounding of a long distance.
                    let reach =
                        vv * (sigma * sigma * (1.0 + 2.0 * UNDECIDED) + image.length_squared() * 1e-14);
                    if miss <= reach && image.dot(v) <= UNDECIDED * (image.length_squared() * vv).sqrt() {
                        found.push(shift);
                    }
                }
            }
        }
        found
    }

    fn predict_walls(&mut self, i: usize) {
        let mut earliest: Option<Entry> = None;
        for (wall, plane) in self.planes.iter().enumerate() {
            let d = self.position[i].minus(&plane.point).dot(&plane.normal) - &self.radius[i];
            let s = self.velocity[i].dot(&plane.normal);
            let a = self.gravity.dot(&plane.normal);
            if let Some(delay) = fall(&d, &s, &a) {
                let time = &self.now + delay;
                Entry::keep_earlier(&mut earliest, Entry::new(time, Kind::Wall(wall)));
            }
        }
        self.walls[i] = earliest;
    }
}

/// Smaller root of |r + v t| = σ of an approaching pair, not before now.
fn contact(r: &BigVec, v: &BigVec, sigma: &Big) -> Option<Big> {
    let b = r.dot(v);
    if b >= Big::ZERO {
        return None;
    }
    let gap = r.dot(r) - sigma * sigma;
    let disc = &b * &b - v.dot(v) * &gap;
    if disc < Big::ZERO {
        return None;
    }
    let delay = gap / (disc.sqrt() - b);
    Some(delay.max(Big::ZERO))
}

/// The time at which the height d + s t + ½ a t² falls to zero, not before now.
fn fall(d: &Big, s: &Big, a: &Big) -> Option<Big> {
    if *a == Big::ZERO {
        return (*s < Big::ZERO).then(|| (-(d / s)).max(Big::ZERO));
    }
    let disc = s * s - twice(&(a * d));
    if *a > Big::ZERO && (*s >= Big::ZERO || disc < Big::ZERO) {
        return None;
    }
    // The falling root for both signs of a.
    Some((-(s + disc.max(Big::ZERO).sqrt()) / a).max(Big::ZERO))
}

/// The restitution of all pairs and that of all walls; fails if `method` does not support the scene.
pub(crate) fn one_restitution(system: &System, method: &str) -> Result<(f64, f64), Error> {
    let unsupported = |feature| Error::Unsupported { method: method.to_owned(), feature };
    let one = |rules: &[Restitution]| {
        let mut constants = rules.iter().map(|rule| match rule {
            Restitution::Constant(e) => Some(*e),
            _ => None,
        });
        let Some(first) = constants.next() else { return Ok(1.0) };
        let first = first.ok_or_else(|| unsupported("restitution that depends on speed"))?;
        if constants.all(|e| e == Some(first)) {
            return Ok(first);
        }
        Err(unsupported("several restitutions"))
    };
    if system.contacts.tc != 0.0 {
        return Err(unsupported("the TC model"));
    }
    if system.classes.iter().any(|class| !class.mass.is_finite()) {
        return Err(unsupported("bodies of infinite mass"));
    }
    if system.walls.iter().any(|wall| wall.motion.is_moving()) {
        return Err(unsupported("moving walls"));
    }
    if !system.drives.is_empty() || system.drag.is_some() {
        return Err(unsupported("drives"));
    }
    let walls: Vec<Restitution> = system.contacts.wall.iter().map(WallLaw::restitution).collect();
    Ok((one(&system.contacts.pair)?, one(&walls)?))
}
