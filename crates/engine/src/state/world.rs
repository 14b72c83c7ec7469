//! The particles of the engine: one cache line each, and tables of properties by class.

use glam::DVec3;
use haff_neighbors::{Array, with_huge_pages};

use crate::{
    model::{
        Body, DriveKind, Restitution, System, Wall, WallLaw, conserved::conserved_momentum,
        thresholds::Thresholds,
    },
    numerics::clock::Clock,
    state::{
        contact_times::ContactTimes,
        flight_sums::Summed,
        force::Force,
        particle::{ClassData, Particle, Support},
        periodicity::Periodicity,
        sliding_images::SlidingImages,
        spin::Spins,
        wall_sums::WallSums,
    },
};

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
    pub fastest_square: f64,
    /// Number of particles that rest on walls.
    pub resting: usize,
    /// Force of gravity and of the walls that support particles.
    pub force: Force,
    /// The axes along which momentum is conserved.
    pub conserved: [bool; 3],
    /// What is summed of the flights.
    pub flights: Summed,
    /// Speed that drives and thermal walls give to the lightest particles [length/time].
    pub given_speed: f64,
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
}

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
        // Unknown: the tick becomes shorter when it is needed.
        DriveKind::Named(_) => 0.0,
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
