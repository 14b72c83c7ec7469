//! The particles of the engine: one cache line each, and tables of properties by class.

use std::sync::Arc;

use glam::DVec3;
use haff_neighbors::{Array, with_huge_pages};

use crate::{
    model::{Body, System, WallLaw, conserved::conserved_momentum, thresholds::Thresholds},
    numerics::clock::Clock,
    state::{
        flight_sums::Summed,
        force::Force,
        laws::Laws,
        particle::{ClassData, Particle},
        resolution::Resolution,
        spin::Spins,
        supported::Supported,
        surroundings::Surroundings,
    },
};

/// The data that predictions read, without the data of schedulers: the particles, and beside them what is
/// around them.
#[derive(Debug, Clone)]
pub(crate) struct World {
    pub clock: Clock,
    /// Time of the latest event or stop [ticks].
    pub now: i64,
    pub particles: Array<Particle>,
    pub images: Array<[i32; 3]>,
    /// Ids of the particles, ascending, where they come and go ([`crate::state::population`]).
    pub ids: Option<Arc<[u32]>>,
    /// Radius, mass and group by class. If grains are put to rest, a second copy of the classes with infinite
    /// mass follows: the classes of asleep particles.
    pub classes: Vec<ClassData>,
    /// Number of classes of the system, without the copies for asleep particles.
    pub class_count: usize,
    /// Number of particles of finite mass, and how many of them are asleep.
    pub movable: usize,
    pub asleep: usize,
    /// 2 or 3.
    pub dimension: usize,
    pub gravity: DVec3,
    /// Seed of the random numbers of drives and walls.
    pub seed: u64,
    /// The axes along which momentum is conserved.
    pub conserved: [bool; 3],
    pub boundary: Surroundings,
    pub laws: Laws,
    pub supported: Supported,
    pub resolution: Resolution,
    /// Force of gravity and of the walls that support particles.
    pub force: Force,
    /// What is summed of the flights.
    pub flights: Summed,
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
            clock: Clock { drag: system.drag.map(|drag| drag.time), ..Clock::new(exponent) },
            particles: particles.into(),
            images: system.bodies.iter().map(|body| body.image).collect(),
            ids: None,
            classes,
            class_count,
            movable: 0,
            asleep: 0,
            boundary: Surroundings::of(system),
            laws: Laws::of(system, thresholds),
            supported: Supported::default(),
            resolution: Resolution::of(system),
            gravity: system.domain.gravity,
            seed: system.seed,
            dimension: system.dimension.count(),
            now: 0,
            force: Force::default(),
            conserved: conserved_momentum(system),
            flights: Summed::Nothing,
            spin: Spins::of(system),
        };
        let alike = |class: &ClassData| {
            class.inverse_mass != 0.0
                && (class.radius, class.mass) == (world.classes[0].radius, world.classes[0].mass)
        };
        if let Some(images) = &world.boundary.deformation {
            world.force.rates = images.rates;
        }
        if !world.flies_straight() || world.boundary.deformation.is_some() || world.is_damped() {
            world.flights = Summed::of(system);
        }
        world.laws.corrects_penetration = !world.flies_straight() || !world.classes.iter().all(alike);
        for i in 0..world.particles.len() as u32 {
            let class = *world.class(i);
            if class.inverse_mass != 0.0 {
                let weight = class.mass * world.gravity;
                if weight != DVec3::ZERO {
                    world.force.change(weight, 0.0);
                }
                if let Some(images) = &world.boundary.deformation {
                    let particle = &world.particles[i as usize];
                    let velocity = particle.velocity - images.velocity(particle.position, 0.0);
                    world.force.change(images.force(class.mass * velocity, 0.0), 0.0);
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
            ids: self.ids.clone(),
            classes: self.classes.clone(),
            boundary: self.boundary.of_block(),
            laws: self.laws.without_particles(),
            supported: Supported { support: Vec::new(), ..self.supported },
            force: Force::default(),
            spin: self.spin.as_deref().map(|spins| Box::new(spins.without_particles())),
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
        if let (Some(times), Some(other)) = (&mut self.laws.contact_times, &mut other.laws.contact_times) {
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

    /// The index of particle i in the list of all that ever are there.
    #[inline]
    pub fn id(&self, i: u32) -> u32 {
        self.ids.as_ref().map_or(i, |ids| ids[i as usize])
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
        if let Some(times) = &mut self.laws.contact_times {
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
        self.laws.contact_times.as_ref().map_or(f64::INFINITY, |times| times.age(i, &self.clock, ticks))
    }

    /// Law of impact of a class with a wall.
    #[inline]
    pub fn wall_law(&self, class: &ClassData, wall: u32) -> WallLaw {
        self.laws.of_walls[class.group * self.boundary.walls.len() + wall as usize]
    }
}
