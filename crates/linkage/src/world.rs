//! The state: particles, the bodies they form, the flights of these, and the contacts.

use std::collections::{BTreeMap, BTreeSet};

use glam::DVec3;
use haff_engine::{Instant, Overlap, System, allowed_overlap, model::Restitution};

use crate::{
    accumulators::Accumulators,
    flights::Flights,
    mechanism::{Coil, End, Link, Mechanism, Motions, Row, Shape},
    model::{Joints, SpringEnd, Tether},
    motion::Motion,
};

/// The last impact of a contact.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Burst {
    pub at: Instant,
    /// Speed of separation [length/time].
    pub speed: f64,
    /// Impacts since it has opened.
    pub impacts: u64,
}

/// Two bodies touch if their gap is below this part of the scene's length, plus `TOUCH_OWN` of their contact
/// distance.
const TOUCH: f64 = 2e-14;
/// The part of the contact distance in that tolerance.
const TOUCH_OWN: f64 = 1e-13;
/// Relative speeds below this part of the bodies' own speeds, plus `SLOW_SCENE` of the scene's speed, count
/// as zero.
const SLOW: f64 = 1e-13;
/// The part of the scene's speed in that tolerance.
const SLOW_SCENE: f64 = 1e-15;
/// Contact distance of two points, as a part of the scene's length.
const POINT: f64 = 1e-12;

/// A completed series of bounces that has not ended yet.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Pending {
    pub end: Instant,
    pub speed: f64,
    pub impulse: f64,
    pub energy_loss: f64,
    pub carnot_energy: f64,
}

/// The law of a contact.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Law {
    Bounce(Restitution),
    Stick,
}

/// Everything that changes in a run, and its parameters.
#[derive(Debug, Clone)]
pub(crate) struct World {
    pub system: System,
    pub joints: Joints,
    pub mass: Vec<f64>,
    pub radius: Vec<f64>,
    pub group: Vec<usize>,
    /// Body of every particle: the first particle that is part of it.
    pub body: Vec<usize>,
    /// Position of a particle relative to its body \[length\].
    pub offset: Vec<DVec3>,
    /// By body: whether it sticks to a wall, and moves with it.
    pub sticks_to_wall: Vec<bool>,
    /// By body: mass, and state at the start of its flight.
    pub body_mass: Vec<f64>,
    pub anchor: Motions,
    /// By body: energy that rounding has given it \[energy\], at the start of its flight.
    pub excess: Vec<f64>,
    /// By body: key of its flight, which is its first body.
    pub flight_key: Vec<usize>,
    pub flights: Flights,
    /// By pendulum: whether its string or rod carries force, or could.
    pub taut: Vec<bool>,
    /// Persistent contacts; for points the direction in which they collided.
    pub closed: BTreeMap<Link, DVec3>,
    pub pending: BTreeMap<Link, Pending>,
    /// Last impacts of contacts that may not have opened since.
    pub bursts: BTreeMap<Link, Burst>,
    /// Pairs that never collide: those on one rod.
    pub joined: BTreeSet<(usize, usize)>,
    /// Links whose force has fallen to zero at an instant: none is closed again at the same instant, where
    /// rounding would decide which of several links carries no force.
    pub released: (Instant, BTreeSet<Link>),
    /// Contacts that have carried force until this instant and have not opened at it. Empty between events.
    pub pressed: BTreeSet<Link>,
    /// Flights that have ended, and series of bounces, whose predictions are to be removed.
    pub ended: Vec<usize>,
    pub settled: Vec<Link>,
    pub now: Instant,
    /// The scene's length and speed, for tolerances.
    pub length: f64,
    pub speed: f64,
    pub accumulators: Accumulators,
}

impl World {
    /// Particles at their initial positions, without flights.
    pub fn new(system: System, joints: Joints) -> Self {
        let n = system.bodies.len();
        let class = |i: usize| system.classes[system.bodies[i].class as usize];
        let mass: Vec<f64> = (0..n).map(|i| class(i).mass).collect();
        let radius: Vec<f64> = (0..n).map(|i| class(i).radius).collect();
        let group = (0..n).map(|i| class(i).group as usize).collect();
        let anchor: Motions = system.bodies.iter().map(|body| (body.position, body.velocity)).collect();
        let mut length = radius.iter().copied().fold(0.0, f64::max);
        for (x, _) in &anchor {
            length = length.max((*x - anchor[0].0).length());
        }
        let joint_lengths = joints
            .pendulums
            .iter()
            .map(|pendulum| pendulum.length)
            .chain(joints.rods.iter().map(|rod| rod.length))
            .chain(joints.springs.iter().map(|spring| spring.natural_length));
        length = joint_lengths.fold(length, f64::max);
        let fastest = anchor.iter().map(|(_, v)| v.length()).fold(0.0, f64::max);
        let mut speed = fastest + (system.domain.gravity.length() * length).sqrt();
        for spring in &joints.springs {
            let light = spring
                .ends
                .iter()
                .filter_map(|end| if let SpringEnd::Particle(i) = end { Some(mass[*i]) } else { None })
                .fold(f64::INFINITY, f64::min);
            let state = |end: &SpringEnd| match *end {
                SpringEnd::Particle(i) => anchor[i].0,
                SpringEnd::Point(x) => x,
            };
            let stretch = (state(&spring.ends[0]) - state(&spring.ends[1])).length() - spring.natural_length;
            speed += stretch.abs() * (spring.stiffness / light).sqrt();
        }
        let joined = joints
            .rods
            .iter()
            .map(|rod| (rod.ends[0].min(rod.ends[1]), rod.ends[0].max(rod.ends[1])))
            .collect();
        Self {
            body: (0..n).collect(),
            offset: vec![DVec3::ZERO; n],
            sticks_to_wall: vec![false; n],
            body_mass: mass.clone(),
            excess: vec![0.0; n],
            anchor,
            flight_key: (0..n).collect(),
            flights: Flights::of(n),
            taut: vec![false; joints.pendulums.len()],
            closed: BTreeMap::new(),
            pending: BTreeMap::new(),
            bursts: BTreeMap::new(),
            joined,
            released: (Instant::ZERO, BTreeSet::new()),
            pressed: BTreeSet::new(),
            ended: Vec::new(),
            settled: Vec::new(),
            now: Instant::ZERO,
            length: if length > 0.0 { length } else { 1.0 },
            speed,
            accumulators: Accumulators::default(),
            mass,
            radius,
            group,
            system,
            joints,
        }
    }

    /// Number of particles.
    pub fn count(&self) -> usize {
        self.mass.len()
    }

    /// Whether a body has infinite mass.
    pub fn immovable(&self, body: usize) -> bool {
        self.body_mass[body] == f64::INFINITY
    }

    /// State of a body, from its flight or, if it has none at present, from its anchor.
    pub fn body_state(&self, body: usize, at: Instant) -> (DVec3, DVec3) {
        match self.flights.get(self.flight_key[body]) {
            Some(flight) => {
                let k = flight.index_of(body);
                k.map_or(self.anchor[body], |k| flight.motion.state(k, at.since(flight.start)))
            }
            None => self.anchor[body],
        }
    }

    /// State of a particle.
    pub fn state(&self, particle: usize, at: Instant) -> (DVec3, DVec3) {
        let (x, v) = self.body_state(self.body[particle], at);
        (x + self.offset[particle], v)
    }

    /// Distance of two centers in contact.
    pub fn contact_distance(&self, i: usize, j: usize) -> f64 {
        let sigma = self.radius[i] + self.radius[j];
        if sigma > 0.0 { sigma } else { POINT * self.length }
    }

    /// Gaps below this count as contact \[length\].
    pub fn touch(&self, own: f64) -> f64 {
        TOUCH * self.length + TOUCH_OWN * own
    }

    /// Relative speeds of bodies at these velocities below this count as zero [length/time].
    pub fn slow(&self, v: DVec3, w: DVec3) -> f64 {
        SLOW * (v.length() + w.length()) + SLOW_SCENE * self.speed
    }

    /// The law of a pair.
    pub fn pair_law(&self, i: usize, j: usize) -> Law {
        let (a, b) = (self.group[i], self.group[j]);
        let sticks = self.joints.sticking.iter().any(|&[x, y]| {
            let (x, y) = (x as usize, y as usize);
            (x, y) == (a, b) || (y, x) == (a, b)
        });
        if sticks {
            Law::Stick
        } else {
            Law::Bounce(self.system.contacts.pair[a * self.system.groups.len() + b])
        }
    }

    /// The law of a particle with a wall.
    pub fn wall_law(&self, i: usize, wall: usize) -> Law {
        if self.joints.sticking_to_walls.contains(&[self.group[i] as u32, wall as u32]) {
            return Law::Stick;
        }
        Law::Bounce(self.system.contacts.wall[self.group[i] * self.system.walls.len() + wall].restitution())
    }

    /// Mass of a body by its particles, and by whether it sticks to a wall.
    pub fn mass_of(&self, body: usize) -> f64 {
        if self.sticks_to_wall[body] { f64::INFINITY } else { self.members(body).map(|i| self.mass[i]).sum() }
    }

    /// Whether two particles can collide.
    pub fn can_collide(&self, i: usize, j: usize) -> bool {
        let (a, b) = (self.body[i], self.body[j]);
        a != b && !(self.immovable(a) && self.immovable(b)) && !self.joined.contains(&(i.min(j), i.max(j)))
    }

    /// A point of a wall at an instant.
    pub fn wall_point(&self, wall: usize, at: Instant) -> DVec3 {
        let wall = &self.system.walls[wall];
        wall.point + wall.motion.displacement(wall.normal, at)
    }

    /// Velocity of a wall at an instant.
    pub fn wall_velocity(&self, wall: usize, at: Instant) -> DVec3 {
        let wall = &self.system.walls[wall];
        wall.motion.velocity(wall.normal, at)
    }

    /// By body: whether it is one of these.
    pub fn among(&self, bodies: &[usize]) -> Vec<bool> {
        let mut among = vec![false; self.count()];
        for &body in bodies {
            among[body] = true;
        }
        among
    }

    /// Particles of a body.
    pub fn members(&self, body: usize) -> impl Iterator<Item = usize> + '_ {
        (0..self.count()).filter(move |&i| self.body[i] == body)
    }

    /// A particle as an end, for bodies numbered by their index in `bodies`, at an instant.
    fn end(&self, particle: usize, bodies: &[usize], at: Instant) -> End {
        let body = self.body[particle];
        match bodies.iter().position(|&b| b == body) {
            Some(k) if !self.immovable(body) => End::Body(k, self.offset[particle]),
            _ => {
                let (x, v) = self.state(particle, at);
                End::Fixed(x, v)
            }
        }
    }

    /// The row of a link.
    pub fn row(&self, link: Link, bodies: &[usize], at: Instant) -> Row {
        match link {
            Link::Tether(p) => {
                let pendulum = &self.joints.pendulums[p];
                let string = pendulum.tether == Tether::String;
                Row {
                    link,
                    a: End::Fixed(pendulum.pivot, DVec3::ZERO),
                    b: self.end(pendulum.bob, bodies, at),
                    shape: Shape::Distance(pendulum.length),
                    sign: if string { -1.0 } else { 1.0 },
                    unilateral: string,
                }
            }
            Link::Rod(r) => {
                let rod = &self.joints.rods[r];
                Row {
                    link,
                    a: self.end(rod.ends[0], bodies, at),
                    b: self.end(rod.ends[1], bodies, at),
                    shape: Shape::Distance(rod.length),
                    sign: 1.0,
                    unilateral: false,
                }
            }
            Link::Pair(i, j) => Row {
                link,
                a: self.end(i, bodies, at),
                b: self.end(j, bodies, at),
                shape: match self.closed.get(&link) {
                    Some(axis) if *axis != DVec3::ZERO => {
                        Shape::Along(*axis, axis.dot(self.state(j, at).0 - self.state(i, at).0))
                    }
                    _ => Shape::Distance(self.contact_distance(i, j)),
                },
                sign: 1.0,
                unilateral: true,
            },
            Link::Wall(i, w) => Row {
                link,
                a: End::Fixed(self.wall_point(w, at), self.wall_velocity(w, at)),
                b: self.end(i, bodies, at),
                shape: Shape::Along(self.system.walls[w].normal, self.radius[i]),
                sign: 1.0,
                unilateral: true,
            },
            Link::Impact => unreachable!("an impact is not a link of a flight"),
        }
    }

    /// Particles of a link.
    pub fn particles_of(&self, link: Link) -> Vec<usize> {
        match link {
            Link::Tether(p) => vec![self.joints.pendulums[p].bob],
            Link::Rod(r) => self.joints.rods[r].ends.to_vec(),
            Link::Pair(i, j) => vec![i, j],
            Link::Wall(i, _) => vec![i],
            Link::Impact => Vec::new(),
        }
    }

    /// The mechanism of movable `bodies` with these links and their springs.
    pub fn mechanism(&self, bodies: &[usize], links: &[Link], at: Instant) -> Mechanism {
        let mut of = Mechanism {
            mass: bodies.iter().map(|&b| self.body_mass[b]).collect(),
            gravity: self.system.domain.gravity,
            rows: Vec::new(),
            coils: Vec::new(),
        };
        for &link in links {
            let row = self.row(link, bodies, at);
            // Ends that have become one body, or between which nothing can move, are no constraint.
            if row.a.body() != row.b.body() {
                of.rows.push(row);
            }
        }
        for spring in &self.joints.springs {
            let [a, b] = spring.ends.map(|end| match end {
                SpringEnd::Particle(i) => self.end(i, bodies, at),
                SpringEnd::Point(x) => End::Fixed(x, DVec3::ZERO),
            });
            if a.body() != b.body() {
                of.coils.push(Coil {
                    a,
                    b,
                    stiffness: spring.stiffness,
                    natural_length: spring.natural_length,
                });
            }
        }
        of
    }

    /// Rods and taut strings with an end on any of these bodies.
    pub fn rigid_links(&self, bodies: &[usize]) -> Vec<Link> {
        let mine = |i: usize| bodies.contains(&self.body[i]) && !self.immovable(self.body[i]);
        let tethers = (0..self.joints.pendulums.len())
            .filter(|&p| mine(self.joints.pendulums[p].bob) && self.taut[p])
            .map(Link::Tether);
        let rods = (0..self.joints.rods.len())
            .filter(|&r| self.joints.rods[r].ends.iter().any(|&i| mine(i)))
            .map(Link::Rod);
        tethers.chain(rods).collect()
    }

    /// Present states of bodies without flights.
    pub fn anchors(&self, bodies: &[usize]) -> Motions {
        bodies.iter().map(|&b| self.anchor[b]).collect()
    }

    /// Groups bodies by the links and springs that couple them.
    pub fn parts(&self, bodies: &[usize], links: &[Link]) -> Vec<Vec<usize>> {
        let mut label: BTreeMap<usize, usize> = bodies.iter().map(|&b| (b, b)).collect();
        let mut join = |i: usize, j: usize| {
            let (a, b) = (self.body[i], self.body[j]);
            if self.immovable(a) || self.immovable(b) {
                return;
            }
            if let (Some(&from), Some(&to)) = (label.get(&a), label.get(&b)) {
                let (from, to) = (from.max(to), from.min(to));
                label.values_mut().filter(|l| **l == from).for_each(|l| *l = to);
            }
        };
        for link in links {
            if let [i, j] = self.particles_of(*link)[..] {
                join(i, j);
            }
        }
        for spring in &self.joints.springs {
            if let [SpringEnd::Particle(i), SpringEnd::Particle(j)] = spring.ends {
                join(i, j);
            }
        }
        let mut parts: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
        for (&body, &first) in &label {
            parts.entry(first).or_default().push(body);
        }
        parts.into_values().collect()
    }

    /// Present overlaps [contact distances, for walls radii]: the deepest, 0 without overlap, and one that
    /// exceeds rounding.
    pub fn overlaps(&self) -> (f64, Option<Overlap>) {
        let n = self.count();
        let states: Vec<DVec3> = (0..n).map(|i| self.state(i, self.now).0).collect();
        let (mut deepest, mut beyond) = (0.0_f64, None);
        let mut add = |depth: f64, sigma: f64, places: DVec3, pair| {
            deepest = deepest.max(depth);
            if depth * sigma > allowed_overlap(sigma, places.max_element() + sigma) {
                beyond = Some(Overlap { depth, pair: Some(pair) });
            }
        };
        for i in 0..n {
            for j in i + 1..n {
                if self.can_collide(i, j) && self.radius[i] + self.radius[j] > 0.0 {
                    let sigma = self.contact_distance(i, j);
                    let depth = 1.0 - (states[j] - states[i]).length() / sigma;
                    let places = states[i].abs().max(states[j].abs());
                    add(depth, sigma, places, (i as u32, Some(j as u32)));
                }
            }
            for (w, wall) in self.system.walls.iter().enumerate() {
                if self.radius[i] > 0.0 && !self.immovable(self.body[i]) {
                    let gap = wall.normal.dot(states[i] - self.wall_point(w, self.now)) - self.radius[i];
                    add(-gap / self.radius[i], self.radius[i], states[i].abs(), (i as u32, None));
                }
            }
        }
        (deepest, beyond)
    }

    /// From particle i to particle j at an instant \[length\].
    fn separation(&self, i: usize, j: usize, at: Instant) -> DVec3 {
        let (a, b) = (self.body[i], self.body[j]);
        if self.flight_key[a] == self.flight_key[b]
            && let Some(flight) = self.flights.get(self.flight_key[a])
            && let Motion::Modes(modes) = &flight.motion
            && let (Some(k), Some(l)) = (flight.index_of(a), flight.index_of(b))
        {
            return modes.separation(k, l, at.since(flight.start)) + (self.offset[j] - self.offset[i]);
        }
        self.state(j, at).0 - self.state(i, at).0
    }

    /// Energy of gravity and of the springs at an instant.
    pub fn potential(&self, at: Instant) -> (f64, f64) {
        let g = self.system.domain.gravity;
        let gravity: haff_engine::Sum = (0..self.count())
            .filter(|&i| self.mass[i].is_finite())
            .map(|i| -self.mass[i] * g.dot(self.state(i, at).0))
            .collect();
        let springs: haff_engine::Sum = self
            .joints
            .springs
            .iter()
            .map(|spring| {
                let place = |end| match end {
                    SpringEnd::Particle(i) => self.state(i, at).0,
                    SpringEnd::Point(x) => x,
                };
                let apart = match spring.ends {
                    [SpringEnd::Particle(i), SpringEnd::Particle(j)] => self.separation(i, j, at),
                    [a, b] => place(b) - place(a),
                };
                let stretch = apart.length() - spring.natural_length;
                0.5 * spring.stiffness * stretch * stretch
            })
            .collect();
        (gravity.value(), springs.value())
    }
}
