//! All impacts of one instant: the first one, and those of contacts that touch and approach after it, in the
//! order of their keys. Flights begin again after the last of them.

use std::collections::BTreeSet;

use haff_engine::{EventKind, Observer};

use crate::{
    error::LinkageError,
    mechanism::{Link, Shape},
    predict::Key,
    settle::Hit,
    world::{Law, World},
};

/// What takes part in the impacts of an instant.
#[derive(Default)]
struct Cluster {
    /// Bodies without flights.
    bodies: Vec<usize>,
    /// Contacts that have had impacts.
    hits: Vec<Hit>,
    /// Bodies that stick to walls or bodies of infinite mass from now on.
    stuck: Vec<usize>,
    /// Strings that have gone slack.
    slack: Vec<usize>,
}

impl Cluster {
    fn add(&mut self, bodies: &[usize]) {
        self.bodies.extend(bodies);
        self.bodies.sort_unstable();
        self.bodies.dedup();
    }
}

impl World {
    fn count_collision(&mut self, i: usize, j: usize) {
        let fixed = self.mass[i].is_infinite() || self.mass[j].is_infinite();
        let counters = &mut self.accumulators.counters;
        counters.collisions += 1;
        counters.fixed_collisions += u64::from(fixed);
    }

    /// Resolves an impact and all that follow at this instant, at most `most`. Returns the bodies that have
    /// new flights, and the number of impacts.
    pub fn resolve_impacts(
        &mut self,
        first: Key,
        most: u64,
        observer: &mut dyn Observer,
    ) -> Result<(Vec<usize>, u64), LinkageError> {
        let mut cluster = Cluster::default();
        let (mut known, mut links) = (Vec::new(), BTreeSet::new());
        let mut impacts = 0;
        let mut next = Some(first);
        while let Some(key) = next {
            match key {
                Key::Pair(i, j) => self.collide_pair(i, j, &mut cluster, observer),
                Key::Wall(i, wall) => self.collide_wall(i, wall, &mut cluster, observer),
                Key::Taut(p) => self.string_taut(p, &mut cluster, observer),
                Key::Monitored(..) | Key::Renew(_) | Key::Settle(_) => break,
            }
            let is_contact = matches!(key, Key::Pair(..) | Key::Wall(..));
            self.accumulators.counters.simultaneous += u64::from(impacts > 0 && is_contact);
            impacts += 1;
            self.slacken(&mut cluster);
            if impacts >= most {
                break;
            }
            let new: Vec<usize> =
                cluster.bodies.iter().copied().filter(|body| !known.contains(body)).collect();
            if !new.is_empty() {
                links.extend(self.touching_links(&new));
                known.clone_from(&cluster.bodies);
            }
            next =
                links.iter().filter(|&&link| self.approaches(link)).filter_map(|&link| impact_of(link)).min();
        }
        let mut changed = self.regroup(cluster.bodies, &BTreeSet::new(), &cluster.hits, observer)?;
        changed.extend(cluster.stuck);
        for &p in cluster.slack.iter().filter(|&&p| !self.taut[p]) {
            self.report_end(Link::Tether(p), observer);
        }
        Ok((changed, impacts))
    }

    /// Strings whose bobs move towards the pivot, and contacts that open, take no part in further impacts.
    fn slacken(&mut self, cluster: &mut Cluster) {
        let pressed = std::mem::take(&mut self.pressed);
        self.pressed = pressed
            .into_iter()
            .filter(|&link| {
                let (rate, slow) = self.opening(link);
                rate.abs() <= slow
            })
            .collect();
        for p in 0..self.taut.len() {
            let link = Link::Tether(p);
            let body = self.body[self.joints.pendulums[p].bob];
            if self.taut[p] && !self.is_two_sided(link) && cluster.bodies.contains(&body) {
                let (rate, slow) = self.opening(link);
                if rate > slow {
                    self.taut[p] = false;
                    cluster.slack.push(p);
                }
            }
        }
    }

    /// Whether a touching contact closes at a speed that is resolved.
    fn approaches(&self, link: Link) -> bool {
        let open = match link {
            Link::Pair(i, j) => self.can_collide(i, j),
            Link::Wall(i, _) => !self.immovable(self.body[i]),
            Link::Tether(p) => !self.taut[p] && !self.immovable(self.body[self.joints.pendulums[p].bob]),
            Link::Rod(_) | Link::Impact => false,
        };
        let (rate, slow) = self.opening(link);
        open && rate < 0.0 && !self.might_rest(link, rate, slow)
    }

    /// Impact of particles i and j.
    fn collide_pair(&mut self, i: usize, j: usize, cluster: &mut Cluster, observer: &mut dyn Observer) {
        let mut bodies = self.take(&[i, j], cluster, observer);
        let ((x, v), (y, w)) = (self.state(i, self.now), self.state(j, self.now));
        let point = self.radius[i] + self.radius[j] == 0.0;
        // Two points collide along their relative velocity.
        let normal = if point { (v - w).normalize_or_zero() } else { (y - x).normalize_or_zero() };
        let link = Link::Pair(i, j);
        let restitution = match self.pair_law(i, j) {
            Law::Bounce(restitution) => restitution,
            Law::Stick => {
                self.count_collision(i, j);
                let impact = self.stop_relative_motion(&bodies, self.row(link, &bodies, self.now), normal);
                self.record(EventKind::Stick, i, j, &impact, normal, observer);
                cluster.bodies = self.merge(self.body[i], self.body[j], std::mem::take(&mut cluster.bodies));
                cluster.stuck.push(self.body[i]);
                return;
            }
        };
        let approach = (v - w).dot(normal);
        let e = self.coefficient_in_burst(link, restitution, approach);
        let links = self.links_of_impact(link, e, approach, &mut bodies, cluster, observer);
        let mut row = self.row(link, &bodies, self.now);
        if point {
            row.shape = Shape::Along(normal, normal.dot(y - x));
        }
        if let Some(impact) = self.collide(&bodies, &links, row, e) {
            self.count_collision(i, j);
            self.record(EventKind::Collision, i, j, &impact, normal, observer);
            if point && e == 0.0 {
                self.closed.insert(link, normal);
            }
            cluster.hits.push((link, restitution));
        }
    }

    /// Impact of a particle on a wall.
    fn collide_wall(&mut self, i: usize, wall: usize, cluster: &mut Cluster, observer: &mut dyn Observer) {
        let mut bodies = self.take(&[i], cluster, observer);
        let (normal, velocity) = (-self.system.walls[wall].normal, self.wall_velocity(wall, self.now));
        let link = Link::Wall(i, wall);
        let restitution = match self.wall_law(i, wall) {
            Law::Bounce(restitution) => restitution,
            Law::Stick => {
                let row = self.row(link, &bodies, self.now);
                let impact = self.stop_relative_motion(&bodies, row, -normal);
                self.accumulators.counters.wall_collisions += 1;
                self.record(EventKind::Wall, i, wall, &impact, normal, observer);
                let all = std::mem::take(&mut cluster.bodies);
                cluster.bodies = self.stick_to_wall(self.body[i], velocity, all);
                cluster.stuck.push(self.body[i]);
                return;
            }
        };
        let approach = (self.state(i, self.now).1 - velocity).dot(normal);
        let e = self.coefficient_in_burst(link, restitution, approach);
        let links = self.links_of_impact(link, e, approach, &mut bodies, cluster, observer);
        let row = self.row(link, &bodies, self.now);
        if let Some(impact) = self.collide(&bodies, &links, row, e) {
            self.accumulators.counters.wall_collisions += 1;
            self.record(EventKind::Wall, i, wall, &impact, normal, observer);
            cluster.hits.push((link, restitution));
        }
    }

    /// A string becomes taut: the velocity along it is lost.
    fn string_taut(&mut self, p: usize, cluster: &mut Cluster, observer: &mut dyn Observer) {
        let bob = self.joints.pendulums[p].bob;
        let mut bodies = self.take(&[bob], cluster, observer);
        let link = Link::Tether(p);
        let stretching = -self.opening(link).0;
        let links = self.links_of_impact(link, 0.0, stretching, &mut bodies, cluster, observer);
        let row = self.row(link, &bodies, self.now);
        let normal = -row.state(0.0, &self.anchors(&bodies)).direction;
        if let Some(impact) = self.collide(&bodies, &links, row, 0.0) {
            self.record(EventKind::Taut, bob, p, &impact, normal, observer);
        }
        self.taut[p] = true;
    }

    /// Takes particles out of their flights. Returns the movable bodies that rods join to theirs.
    fn take(
        &mut self,
        particles: &[usize],
        cluster: &mut Cluster,
        observer: &mut dyn Observer,
    ) -> Vec<usize> {
        let bodies: Vec<usize> = particles.iter().map(|&i| self.body[i]).collect();
        let ended = self.end_flights(&bodies, observer);
        cluster.add(&ended);
        self.joined(&bodies)
    }

    /// The rods, taut strings and pressed contacts that take part in an impact, and the plastic contacts if
    /// it is plastic; their bodies are added.
    fn links_of_impact(
        &mut self,
        hit: Link,
        e: f64,
        approach: f64,
        bodies: &mut Vec<usize>,
        cluster: &mut Cluster,
        observer: &mut dyn Observer,
    ) -> Vec<Link> {
        let mut contacts = BTreeSet::new();
        if e == 0.0 {
            contacts.extend(self.plastic_neighbors(bodies, hit, approach, observer));
            cluster.add(bodies);
            *bodies = self.joined(bodies);
        }
        let mine = self.among(bodies);
        let pressed = self.pressed.iter().copied();
        contacts.extend(
            pressed.filter(|&link| {
                link != hit && self.particles_of(link).into_iter().any(|i| mine[self.body[i]])
            }),
        );
        let mut links = self.rigid_links(bodies);
        links.extend(contacts);
        links
    }

    /// The movable ones of these bodies, and those that are joined to them by rods and pressed contacts,
    /// directly or by others.
    fn joined(&self, bodies: &[usize]) -> Vec<usize> {
        let rods = self.joints.rods.iter().map(|rod| rod.ends);
        let contacts = self.pressed.iter().filter_map(|link| match *link {
            Link::Pair(i, j) => Some([i, j]),
            _ => None,
        });
        let pairs: Vec<[usize; 2]> = rods.chain(contacts).map(|pair| pair.map(|i| self.body[i])).collect();
        let mut joined: Vec<usize> = bodies.iter().copied().filter(|&body| !self.immovable(body)).collect();
        let mut from = 0;
        while from < joined.len() {
            for &[a, b] in &pairs {
                for (end, other) in [(a, b), (b, a)] {
                    if end == joined[from] && !joined.contains(&other) && !self.immovable(other) {
                        joined.push(other);
                    }
                }
            }
            from += 1;
        }
        joined.sort_unstable();
        joined.dedup();
        joined
    }
}

/// The impact of a contact or string that closes.
fn impact_of(link: Link) -> Option<Key> {
    match link {
        Link::Pair(i, j) => Some(Key::Pair(i, j)),
        Link::Wall(i, wall) => Some(Key::Wall(i, wall)),
        Link::Tether(p) => Some(Key::Taut(p)),
        Link::Rod(_) | Link::Impact => None,
    }
}
