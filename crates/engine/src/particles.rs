//! The particles of the engine: one cache line each, and tables of properties by class.

use glam::DVec3;
use haff_neighbors::{Array, with_huge_pages};

use crate::{
    center::conserved_momentum,
    clock::Clock,
    contact_times::ContactTimes,
    features::{Features, With},
    flights::Summed,
    force::Force,
    measurements::WallSums,
    model::{Body, DriveKind, Restitution, System, Wall, WallLaw},
    periodicity::Periodicity,
    rest::thresholds::Thresholds,
    shear::SlidingImages,
    spin::Spins,
    wall_motion::Approach,
};

/// The *anchor* of a particle: its state at its own last event. One cache line.
#[derive(Debug, Clone, Copy, PartialEq)]
#[repr(C, align(64))]
pub(crate) struct Particle {
    pub position: DVec3,
    pub velocity: DVec3,
    /// Time of the anchor [ticks].
    pub time: i64,
    /// Number of own events so far; it invalidates older calendar entries.
    pub count: u32,
    /// Index of the class, and flags in the highest bits.
    class: u32,
}

/// Flag: walls support the particle.
const RESTING: u32 = 1 << 31;
/// Flag: the last contact of the particle was with another particle, or was repeated
/// ([`crate::rest::contact::is_repeated_wall_contact`]).
const RECENTLY_HIT: u32 = 1 << 30;
const FLAGS: u32 = RESTING | RECENTLY_HIT;

impl Particle {
    /// A particle with its anchor at `time` [ticks], without support by walls and without events.
    pub fn at(position: DVec3, velocity: DVec3, time: i64, class: u32) -> Self {
        Self { position, velocity, time, count: 0, class }
    }

    /// Sets the anchor at `time` [ticks], and counts an own event.
    #[inline(always)]
    pub fn set_anchor(&mut self, position: DVec3, velocity: DVec3, time: i64) {
        (self.position, self.velocity, self.time) = (position, velocity, time);
        self.count = self.count.wrapping_add(1);
    }

    #[inline(always)]
    pub fn class(&self) -> usize {
        (self.class & !FLAGS) as usize
    }

    #[inline(always)]
    pub fn rests(&self) -> bool {
        self.class & RESTING != 0
    }

    #[inline(always)]
    pub fn is_recently_hit(&self) -> bool {
        self.class & RECENTLY_HIT != 0
    }

    pub fn set_recently_hit(&mut self, recently_hit: bool) {
        self.class = if recently_hit { self.class | RECENTLY_HIT } else { self.class & !RECENTLY_HIT };
    }
}

/// Radius, mass and contact group of a class.
#[derive(Debug, Clone, Copy)]
pub(crate) struct ClassData {
    pub radius: f64,
    pub mass: f64,
    pub inverse_mass: f64,
    pub group: usize,
}

/// The walls that support a particle, at most three.
pub(crate) type Support = [Option<u16>; 3];

/// The data that predictions read, without the data of schedulers.
#[derive(Debug, Clone)]
pub(crate) struct World {
    pub clock: Clock,
    pub particles: Array<Particle>,
    pub images: Array<[i32; 3]>,
    /// Radius, mass and group by class. If grains are put to rest, a second copy of the classes with infinite
    /// mass follows: the classes of asleep particles.
    pub classes: Vec<ClassData>,
    /// Number of classes of the system, without the copies for asleep particles.
    pub class_count: usize,
    /// The conditions under which grains are put to rest; `None` if they never are.
    pub thresholds: Option<Thresholds>,
    /// Number of particles of finite mass, and how many of them are asleep.
    pub movable: usize,
    pub asleep: usize,
    /// Whether penetrations are corrected: if gravity, or unequal sizes or masses, can press particles
    /// together. This depends on the scene, not on the features that an engine is compiled for, so that all
    /// engines agree.
    pub corrects_penetration: bool,
    pub walls: Vec<Wall>,
    /// Whether a wall can carry grains: it oscillates, and does not reflect all of them elastically or
    /// thermally.
    pub carries: bool,
    /// The walls that support each particle; empty until the first particle rests on a wall.
    pub support: Vec<Support>,
    /// Edge lengths of the box, and its periodic images.
    pub periodicity: Periodicity,
    pub gravity: DVec3,
    pub restitution: Vec<Restitution>,
    pub wall_laws: Vec<WallLaw>,
    pub groups: usize,
    pub tc: f64,
    /// The last contacts of particles, if a law depends on them.
    pub contact_times: Option<ContactTimes>,
    /// Seed of the random numbers of drives and walls.
    pub seed: u64,
    /// 2 or 3.
    pub dimension: usize,
    /// Time of the latest event or stop [ticks].
    pub now: i64,
    /// Longest flight so far along a periodic axis that was longer than the box [length]; else 0. The
    /// rounding error of a position after such a flight is relative to its length.
    pub longest_flight: f64,
    /// Largest extent of the system when the tick was chosen \[length\]: in a tick a particle moves by no
    /// more than a part of it.
    pub extent: f64,
    /// The largest speed for which the tick is short enough [length/time], and its square, which is finite.
    pub fastest: f64,
    fastest_square: f64,
    /// Number of particles that rest on walls.
    pub resting: usize,
    /// Force of gravity and of the walls that support particles.
    pub force: Force,
    /// The axes along which momentum is conserved.
    pub conserved: [bool; 3],
    /// What is summed of the flights.
    pub flights: Summed,
    /// Speed that drives and thermal walls give to the lightest particles [length/time].
    given_speed: f64,
    /// Forces on walls, if they are measured.
    pub wall_sums: Option<Box<WallSums>>,
    /// The images of a sheared box.
    pub shear: Option<SlidingImages>,
    /// Spins and rough contacts, if there are any.
    pub spin: Option<Box<Spins>>,
}

impl World {
    pub fn new(system: &System, exponent: i32) -> Self {
        let mut particles: Vec<Particle> = with_huge_pages(system.bodies.len());
        let anchor = |body: &Body| Particle::at(body.position, body.velocity, 0, body.class);
        particles.extend(system.bodies.iter().map(anchor));
        let thresholds = Thresholds::of(system);
        let mut classes: Vec<ClassData> = system
            .classes
            .iter()
            .map(|class| ClassData {
                radius: class.radius,
                mass: class.mass,
                inverse_mass: 1.0 / class.mass,
                group: class.group as usize,
            })
            .collect();
        let class_count = classes.len();
        if thresholds.is_some() {
            let asleep = |class: &ClassData| ClassData { mass: f64::INFINITY, inverse_mass: 0.0, ..*class };
            classes.extend_from_within(..);
            classes[class_count..].iter_mut().for_each(|class| *class = asleep(class));
        }
        let mut world = Self {
            clock: Clock::new(exponent),
            particles: particles.into(),
            images: system.bodies.iter().map(|body| body.image).collect(),
            classes,
            class_count,
            thresholds,
            movable: 0,
            asleep: 0,
            corrects_penetration: false,
            walls: system.walls.clone(),
            carries: can_carry(system),
            support: Vec::new(),
            periodicity: Periodicity::of(&system.domain),
            gravity: system.domain.gravity,
            restitution: system.contacts.pair.clone(),
            wall_laws: system.contacts.wall.clone(),
            groups: system.groups.len(),
            tc: system.contacts.tc,
            contact_times: ContactTimes::of(system),
            seed: system.seed,
            dimension: system.dimension.count(),
            now: 0,
            longest_flight: 0.0,
            extent: 0.0,
            fastest: f64::MAX,
            fastest_square: f64::MAX,
            resting: 0,
            force: Force::default(),
            conserved: conserved_momentum(system),
            flights: Summed::Nothing,
            given_speed: given_speed(system),
            wall_sums: system.measure.wall_forces.then(|| Box::new(WallSums::new(system.walls.len()))),
            shear: SlidingImages::of(system),
            spin: Spins::of(system),
        };
        let alike = |class: &ClassData| {
            class.inverse_mass != 0.0
                && (class.radius, class.mass) == (world.classes[0].radius, world.classes[0].mass)
        };
        if !world.flies_straight() || world.shear.is_some() {
            world.flights = Summed::of(system);
        }
        world.corrects_penetration = !world.flies_straight() || !world.classes.iter().all(alike);
        for i in 0..world.particles.len() as u32 {
            let class = *world.class(i);
            if class.inverse_mass != 0.0 {
                let weight = class.mass * world.gravity;
                if weight != DVec3::ZERO {
                    world.force.change(weight, 0.0);
                }
                if let Some(shear) = &world.shear {
                    let momentum = class.mass * world.particles[i as usize].velocity;
                    world.force.change(shear.force(momentum), 0.0);
                }
                world.movable += 1;
            }
        }
        world
    }

    /// A world with the same laws, without particles.
    pub fn without_particles(&self) -> Self {
        Self {
            particles: Array::default(),
            images: Array::default(),
            classes: self.classes.clone(),
            walls: self.walls.clone(),
            support: Vec::new(),
            restitution: self.restitution.clone(),
            wall_laws: self.wall_laws.clone(),
            force: Force::default(),
            wall_sums: None,
            spin: self.spin.as_deref().map(|spins| Box::new(spins.without_particles())),
            contact_times: self.contact_times.as_ref().map(|_| ContactTimes::without_particles()),
            ..*self
        }
    }

    /// Gives this world the particles of another one.
    ///
    /// # Safety
    ///
    /// As for [`Array::alias`].
    pub unsafe fn share_particles(&mut self, other: &mut Self) {
        // SAFETY: guaranteed by the caller.
        (self.particles, self.images) = unsafe { (other.particles.alias(), other.images.alias()) };
        if let (Some(spins), Some(other)) = (&mut self.spin, &mut other.spin) {
            // SAFETY: guaranteed by the caller.
            spins.angular_velocity = unsafe { other.angular_velocity.alias() };
        }
        if let (Some(times), Some(other)) = (&mut self.contact_times, &mut other.contact_times) {
            // SAFETY: guaranteed by the caller.
            *times = unsafe { other.alias() };
        }
    }

    #[inline(always)]
    pub fn class(&self, i: u32) -> &ClassData {
        &self.classes[self.particles[i as usize].class()]
    }

    /// The radius, mass and group of particle i, with its own mass even if it is asleep.
    #[inline(always)]
    pub fn body(&self, i: u32) -> &ClassData {
        let class = self.particles[i as usize].class();
        &self.classes[if class < self.class_count { class } else { class - self.class_count }]
    }

    /// The class of particle i in the system, whether it is asleep or not.
    pub fn system_class(&self, i: u32) -> usize {
        self.particles[i as usize].class() % self.class_count
    }

    /// Whether particle i has been put to rest. Until it wakes, it has the properties of a body of infinite
    /// mass.
    #[inline(always)]
    pub fn is_asleep(&self, i: u32) -> bool {
        self.particles[i as usize].class() >= self.class_count
    }

    /// Puts particle i to rest at its position at `ticks`, or wakes it. In both cases its velocity and its
    /// spin become zero, and walls no longer support it.
    pub fn set_asleep(&mut self, i: u32, asleep: bool, ticks: i64) {
        let (position, _) = self.state(i, ticks);
        if self.particles[i as usize].rests() {
            self.set_support(i, [None; 3], ticks);
        }
        let mass = self.body(i).mass;
        let before = mass * self.acceleration(i);
        self.restore_asleep(i, asleep);
        self.change_force(mass * self.acceleration(i) - before, ticks);
        self.particles[i as usize].set_anchor(position, DVec3::ZERO, ticks);
        // It is in contact with what supports it, or has just been hit.
        self.note_contact(i, ticks);
        if let Some(spins) = &mut self.spin {
            spins.angular_velocity[i as usize] = DVec3::ZERO;
        }
    }

    /// Notes that particle i is in contact with another particle or a wall at `ticks`.
    #[inline(always)]
    pub fn note_contact(&mut self, i: u32, ticks: i64) {
        if let Some(times) = &mut self.contact_times {
            times.set(i, ticks);
        }
    }

    /// Notes that two particles are in contact at `ticks`. Not inlined: most scenes have no times of
    /// contacts.
    #[cold]
    #[inline(never)]
    pub fn note_contacts(&mut self, pair: [u32; 2], ticks: i64) {
        for i in pair {
            self.note_contact(i, ticks);
        }
    }

    /// Time from the last contact of particle i to `ticks` \[time\]; infinite without contacts so far, or if
    /// no law depends on it.
    #[inline]
    pub fn contact_age(&self, i: u32, ticks: i64) -> f64 {
        self.contact_times.as_ref().map_or(f64::INFINITY, |times| times.age(i, &self.clock, ticks))
    }

    /// [`Self::set_asleep`] without changing the force, the support or the anchor.
    pub fn restore_asleep(&mut self, i: u32, asleep: bool) {
        let class_count = self.class_count as u32;
        if asleep == self.is_asleep(i) {
            return;
        }
        let class = &mut self.particles[i as usize].class;
        if asleep {
            *class += class_count;
            self.asleep += 1;
        } else {
            *class -= class_count;
            self.asleep -= 1;
        }
    }

    /// Changes the total force of gravity and of supporting walls from `ticks` on.
    fn change_force(&mut self, change: DVec3, ticks: i64) {
        if change != DVec3::ZERO {
            self.force.change(change, self.clock.time(ticks));
        }
    }

    /// Magnitudes to which the rounding error of the position of particle i is relative \[length\]: those of
    /// its coordinates at its own last event, or the longest flight if that is longer.
    pub fn coordinates(&self, i: u32) -> DVec3 {
        self.particles[i as usize].position.abs().max(DVec3::splat(self.longest_flight))
    }

    /// Bound of the length of the flight of particle i from its own last event to `ticks` \[length\], to
    /// which the rounding error of its position is relative: |v| t + ½ |a| t². Under gravity it can be far
    /// longer than the distance of both ends.
    pub fn flight_length(&self, i: u32, ticks: i64) -> f64 {
        let age = self.age(i, ticks);
        let particle = &self.particles[i as usize];
        age * (particle.velocity.length() + 0.5 * self.acceleration(i).length() * age)
    }

    /// The system for which the present tick has been chosen: its extent \[length\] and its largest speed
    /// [length/time].
    pub fn set_scale(&mut self, extent: f64, speed: f64) {
        // The second bound, where a tick cannot be as short as the speed needs.
        self.set_fastest(extent, (extent * RESOLUTION / self.clock.tick).max(2.0 * speed));
    }

    /// [`Self::set_scale`] with the largest speed for which the tick is short enough [length/time].
    pub fn set_fastest(&mut self, extent: f64, fastest: f64) {
        (self.extent, self.fastest) = (extent, fastest);
        self.fastest_square = (fastest * fastest).min(f64::MAX);
    }

    /// Whether the tick is short enough for a velocity; false if it is not finite.
    #[inline(always)]
    pub fn is_resolved(&self, velocity: DVec3) -> bool {
        velocity.length_squared() <= self.fastest_square
    }

    /// Whether particles have no acceleration in their flights.
    pub fn flies_straight(&self) -> bool {
        self.gravity == DVec3::ZERO && !self.carries
    }

    /// Acceleration of a particle in its flight [length/time²], without that of a wall that carries it.
    #[inline(always)]
    pub fn acceleration(&self, i: u32) -> DVec3 {
        let particle = &self.particles[i as usize];
        if self.classes[particle.class()].inverse_mass == 0.0 {
            DVec3::ZERO
        } else if particle.rests() {
            self.supported_acceleration(i)
        } else {
            self.gravity
        }
    }

    /// The part of gravity that the walls under a particle do not balance, or that is along its carrier; with
    /// the friction on it.
    #[inline(never)]
    fn supported_acceleration(&self, i: u32) -> DVec3 {
        if let Some(wall) = self.carrier(i) {
            // A wall that accelerates carries a grain also against gravity.
            let n = self.walls[wall as usize].normal;
            let along = self.gravity - n * self.gravity.dot(n);
            let along = along - n * along.dot(n);
            // Other walls that support it are perpendicular to its carrier.
            let others = self.support[i as usize][1..].iter().flatten();
            return unbalanced_gravity(along, &others.map(|&wall| self.walls[usize::from(wall)].normal));
        }
        let walls = self.support[i as usize].iter().flatten();
        let unbalanced =
            unbalanced_gravity(self.gravity, &walls.map(|&wall| self.walls[wall as usize].normal));
        if self.spin.is_some() { unbalanced + self.friction(i) } else { unbalanced }
    }

    /// Time from the anchor of particle i to `ticks` [time].
    #[inline(always)]
    pub fn age(&self, i: u32, ticks: i64) -> f64 {
        (ticks - self.particles[i as usize].time) as f64 * self.clock.tick
    }

    /// Position (in anchor coordinates) and velocity of particle i at `ticks`.
    #[inline]
    pub fn flight<F: Features>(&self, i: u32, ticks: i64) -> (DVec3, DVec3) {
        let particle = &self.particles[i as usize];
        let dt = self.age(i, ticks);
        if F::GRAVITY {
            let a = self.acceleration(i);
            let flight = (
                haff_mechanics::free_flight(particle.position, particle.velocity, a, dt),
                haff_mechanics::free_flight_velocity(particle.velocity, a, dt),
            );
            match self.carrier(i) {
                Some(wall) => self.carried(i, wall, ticks, flight),
                None => flight,
            }
        } else {
            (haff_mechanics::drift(particle.position, particle.velocity, dt), particle.velocity)
        }
    }

    /// [`Self::flight`] for code that is not compiled per feature. Returns the same bits.
    pub fn state(&self, i: u32, ticks: i64) -> (DVec3, DVec3) {
        if self.flies_straight() {
            self.flight::<With<false, false>>(i, ticks)
        } else {
            self.flight::<With<true, false>>(i, ticks)
        }
    }

    /// Wraps the anchor of particle i into the box. Returns the number of box lengths per axis.
    #[inline(always)]
    pub fn wrap_anchor(&mut self, i: u32) -> [i32; 3] {
        let position = self.particles[i as usize].position;
        if self.periodicity.contains(position) {
            return [0; 3];
        }
        self.wrap_anchor_outside(i, position)
    }

    /// [`Self::wrap_anchor`] for an anchor at `position`, outside of the box.
    #[cold]
    fn wrap_anchor_outside(&mut self, i: u32, position: DVec3) -> [i32; 3] {
        let before = position;
        let (position, wraps, velocity) = self.wrap(before, self.particles[i as usize].time);
        if wraps != [0; 3] {
            let particle = &mut self.particles[i as usize];
            particle.position = position;
            if self.shear.is_some() {
                particle.velocity += velocity;
            }
            for (image, turns) in self.images[i as usize].iter_mut().zip(wraps) {
                *image += turns;
            }
            if let Some(shear) = &self.shear {
                // Wraps along the flow are not the length of a flight.
                let path = before[shear.flow].abs();
                if path > 2.0 * self.periodicity.size[shear.flow] {
                    self.longest_flight = self.longest_flight.max(path);
                }
                return wraps;
            }
            for (axis, turns) in wraps.into_iter().enumerate().filter(|(_, turns)| turns.abs() > 1) {
                self.longest_flight =
                    self.longest_flight.max(f64::from(turns).abs() * self.periodicity.size[axis]);
            }
        }
        wraps
    }

    /// Signed distance of a particle's surface from a wall and its rate of change, for a particle at
    /// `position` with `velocity` at `ticks`.
    #[inline]
    pub fn wall_approach(
        &self,
        wall: u32,
        radius: f64,
        position: DVec3,
        velocity: DVec3,
        ticks: i64,
    ) -> (f64, f64) {
        if let Some(partition) = &self.walls[wall as usize].partition {
            let r = partition.from_nearest(position);
            let distance = r.length();
            return (distance - radius, velocity.dot(r) / distance);
        }
        if self.is_level(wall) {
            let wall = &self.walls[wall as usize];
            let contact = wall.point.dot(wall.normal) + radius;
            return (position.dot(wall.normal) - contact, velocity.dot(wall.normal));
        }
        let wall = &self.walls[wall as usize];
        let mut point = wall.point;
        let mut relative = velocity;
        if wall.motion.is_moving() {
            point += wall.motion.displacement(wall.normal, (&self.clock, ticks));
            relative -= wall.motion.velocity(wall.normal, (&self.clock, ticks));
        }
        ((position - point).dot(wall.normal) - radius, relative.dot(wall.normal))
    }

    /// Time from an anchor until its flight touches a wall \[ticks\]; `None` if it never does.
    #[inline(always)]
    pub fn wall_contact(
        &self,
        anchor: &Particle,
        radius: f64,
        acceleration: DVec3,
        wall: u32,
    ) -> Option<f64> {
        if let Some(partition) = &self.walls[wall as usize].partition {
            let delay = partition.time_to_contact(anchor.position, anchor.velocity, acceleration, radius)?;
            return Some(delay * self.clock.per_time);
        }
        let (distance, rate) =
            self.wall_approach(wall, radius, anchor.position, anchor.velocity, anchor.time);
        let wall = &self.walls[wall as usize];
        let approach = Approach {
            distance,
            rate,
            speed: anchor.velocity.dot(wall.normal),
            acceleration: acceleration.dot(wall.normal),
        };
        let delay = wall.motion.time_to_contact(&approach, (&self.clock, anchor.time))?;
        Some(delay * self.clock.per_time)
    }

    /// Whether the prediction of particle i from its anchor has a contact with a wall before the present.
    ///
    /// After an impact with e = 0 a grain and a wall have the same velocity, but for rounding. A new tick
    /// changes the rounding, and a contact can appear at the time of an anchor that had none.
    pub fn has_past_wall_contact(&self, i: u32) -> bool {
        let anchor = self.particles[i as usize];
        let class = *self.class(i);
        if class.inverse_mass == 0.0 || anchor.rests() || anchor.time >= self.now {
            return false;
        }
        let (acceleration, age) = (self.acceleration(i), (self.now - anchor.time) as f64);
        let is_past = |wall: u32| {
            self.wall_contact(&anchor, class.radius, acceleration, wall).is_some_and(|ticks| ticks < age)
        };
        (0..self.walls.len() as u32).any(is_past)
    }

    /// Moves the anchor of particle i along its flight to the present, which is no own event.
    pub fn move_anchor(&mut self, i: u32) {
        let (position, velocity) = self.state(i, self.now);
        let particle = &mut self.particles[i as usize];
        (particle.position, particle.velocity, particle.time) = (position, velocity, self.now);
        self.wrap_anchor(i);
    }

    /// Whether a wall is at rest, under gravity, and perpendicular to an axis. A contact with such a wall has
    /// a fixed coordinate: every bounce starts and ends at exactly the same height, and rounding changes no
    /// energy.
    #[inline]
    pub fn is_level(&self, wall: u32) -> bool {
        let wall = &self.walls[wall as usize];
        self.gravity != DVec3::ZERO
            && !wall.motion.is_moving()
            && wall.partition.is_none()
            && wall.normal.abs().max_element() == 1.0
    }

    /// Unit normal of a wall towards a particle in contact.
    #[inline]
    pub fn wall_normal(&self, wall: u32, position: DVec3) -> DVec3 {
        let wall = &self.walls[wall as usize];
        match &wall.partition {
            Some(partition) => partition.from_nearest(position).normalize_or(wall.normal),
            None => wall.normal,
        }
    }

    /// Sets the walls that support particle i from `ticks` on, and changes the force.
    pub fn set_support(&mut self, i: u32, support: Support, ticks: i64) {
        let before = self.acceleration(i);
        self.change_support_of_walls(i, -1.0, ticks);
        self.replace_support(i, support);
        self.change_support_of_walls(i, 1.0, ticks);
        let change = self.acceleration(i) - before;
        self.change_force(self.class(i).mass * change, ticks);
    }

    /// [`Self::set_support`] without changing the force.
    pub fn replace_support(&mut self, i: u32, support: Support) {
        if self.support.is_empty() {
            self.support = vec![[None; 3]; self.particles.len()];
        }
        self.support[i as usize] = support;
        let (before, after) = (self.particles[i as usize].rests(), support != [None; 3]);
        self.resting = self.resting + usize::from(after) - usize::from(before);
        let class = &mut self.particles[i as usize].class;
        *class = if after { *class | RESTING } else { *class & !RESTING };
    }

    /// The walls that support particle i.
    pub fn support(&self, i: u32) -> Support {
        if self.particles[i as usize].rests() { self.support[i as usize] } else { [None; 3] }
    }

    /// Restitution law of a pair of classes.
    #[inline]
    pub fn restitution(&self, a: &ClassData, b: &ClassData) -> Restitution {
        self.restitution[a.group * self.groups + b.group]
    }

    /// Law of impact of a class with a wall.
    #[inline]
    pub fn wall_law(&self, class: &ClassData, wall: u32) -> WallLaw {
        self.wall_laws[class.group * self.walls.len() + wall as usize]
    }

    /// Whether nothing moves and nothing will.
    pub fn is_at_rest(&self) -> bool {
        let free = self.classes.iter().any(|class| class.inverse_mass != 0.0);
        (self.gravity == DVec3::ZERO || self.resting + self.asleep > 0 || !free)
            && !self.walls.iter().any(|wall| wall.motion.is_moving())
            && (0..self.particles.len() as u32).all(|i| {
                self.particles[i as usize].velocity == DVec3::ZERO && self.acceleration(i) == DVec3::ZERO
            })
    }

    /// A bound on the speed of particles: the largest present speed of bodies and walls, plus the gain of a
    /// fall through `extent`.
    pub fn largest_speed(&self, extent: f64) -> f64 {
        let fastest = (0..self.particles.len() as u32)
            .map(|i| self.state(i, self.now).1.length_squared())
            .chain(self.walls.iter().map(|wall| wall.motion.max_speed().powi(2)))
            .chain(self.shear.iter().map(|shear| shear.speed.powi(2)))
            .fold(0.0, f64::max);
        let present = (fastest + 2.0 * self.gravity.length() * extent).sqrt();
        // What is given soon, if the present speeds are much lower: the tick is chosen for a whole epoch.
        if self.given_speed > GIVEN_RATIO * present { self.given_speed } else { present }
    }

    /// Largest extent of the system along any axis [length].
    pub fn extent(&self, open: [bool; 3]) -> f64 {
        let mut extent: f64 = 0.0;
        let radius = self.classes.iter().map(|class| class.radius).fold(0.0, f64::max);
        for axis in 0..3 {
            if open[axis] {
                for i in 0..self.particles.len() as u32 {
                    extent = extent.max(self.state(i, self.now).0[axis].abs());
                }
            } else {
                extent = extent.max(self.periodicity.size[axis]);
            }
        }
        extent.max(2.0 * radius)
    }
}

/// The tick is made shorter before a particle moves by more than this part of the extent in it: a time that
/// is rounded to a tick must not change a distance by more than [`allowed_overlap`](crate::allowed_overlap),
/// which is this part of the extent, too.
const RESOLUTION: f64 = 16.0 * f64::EPSILON;
/// A tick that is chosen for a speed serves for speeds up to this many times as large.
const GIVEN_RATIO: f64 = 4.0;
/// Few particles are faster than this many thermal speeds.
const FAST: f64 = 3.0;

/// Speed that drives and thermal walls give to the lightest particles [length/time].
fn given_speed(system: &System) -> f64 {
    let finite = system.classes.iter().map(|class| class.mass).filter(|mass| mass.is_finite());
    let lightest = finite.fold(f64::INFINITY, f64::min);
    let extent = system.domain.size.max_element();
    let driven = system.drives.iter().map(|drive| match drive.kind {
        DriveKind::Rescale { temperature, .. } | DriveKind::Andersen { temperature, .. } => {
            (temperature / lightest).sqrt()
        }
        // The speed that a particle reaches while it crosses the system.
        DriveKind::WhiteNoise { strength, .. } => (strength * extent).cbrt(),
    });
    let thermal = system.contacts.wall.iter().filter_map(|law| match law {
        WallLaw::Thermal(wall) => Some((wall.temperature / lightest).sqrt()),
        WallLaw::Restitution(_) => None,
    });
    FAST * driven.chain(thermal).fold(0.0, f64::max)
}

/// Whether a wall can carry grains: it oscillates, and grains bounce on it with losses.
pub(crate) fn can_carry(system: &System) -> bool {
    let walls = system.walls.len();
    (0..walls)
        .filter(|&wall| system.walls[wall].motion.carries())
        .any(|wall| system.contacts.wall.iter().skip(wall).step_by(walls).any(WallLaw::has_series))
}

/// The part of `gravity` that walls with these inward normals do not balance: the vector nearest to `gravity`
/// that points into none of the walls.
pub(crate) fn unbalanced_gravity(gravity: DVec3, normals: &(impl Iterator<Item = DVec3> + Clone)) -> DVec3 {
    let bound = -1e-12 * gravity.length();
    let mut best = DVec3::ZERO; // points into no wall
    let mut consider = |a: DVec3| {
        let allowed = normals.clone().all(|n| a.dot(n) >= bound);
        if allowed && (a - gravity).length_squared() < (best - gravity).length_squared() {
            best = a;
        }
    };
    consider(gravity);
    for (k, n) in normals.clone().enumerate() {
        let slide = gravity - n * gravity.dot(n);
        // The projection is repeated: the rounding error of the first one would let a grain at rest on a
        // tilted wall fall into it.
        consider(slide - n * slide.dot(n));
        for m in normals.clone().skip(k + 1) {
            let edge = n.cross(m);
            if edge != DVec3::ZERO {
                consider(edge * (gravity.dot(edge) / edge.length_squared()));
            }
        }
    }
    best
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_particle_is_one_cache_line() {
        assert_eq!((size_of::<Particle>(), align_of::<Particle>()), (64, 64));
    }

    #[test]
    fn walls_balance_their_part_of_gravity() {
        let g = DVec3::new(1.0, 0.0, -10.0);
        assert_eq!(unbalanced_gravity(g, &[DVec3::Z].into_iter()), DVec3::X);
        assert_eq!(unbalanced_gravity(g, &[DVec3::Z, DVec3::NEG_X].into_iter()), DVec3::ZERO);
        assert_eq!(unbalanced_gravity(g, &[DVec3::X].into_iter()), g, "a wall does not attract");
        // Two walls that are not perpendicular leave only the component along their common edge.
        let wedge = [DVec3::Z, DVec3::new(0.6, 0.0, 0.8)];
        assert_eq!(
            unbalanced_gravity(DVec3::new(-1.0, 2.0, -10.0), &wedge.into_iter()),
            DVec3::new(0.0, 2.0, 0.0)
        );
    }
}
