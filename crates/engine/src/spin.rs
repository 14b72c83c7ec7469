//! Angular velocities. They never enter a prediction: only impacts and the walls that support a grain change
//! them, and a scene without them has no data for them.

use std::collections::BTreeMap;

use glam::DVec3;
use haff_mechanics::{RoughBody, Roughness};
use haff_neighbors::Array;

use crate::{
    clock::Clock,
    measure::total,
    model::System,
    particles::{ClassData, World},
    slide::Slide,
};

/// What a system needs for spin.
#[derive(Debug, Clone, PartialEq)]
pub struct Spin {
    /// q = I/(m R²) of the particles of each contact group.
    pub inertia: Vec<f64>,
    /// Angular velocity of each body at the start [1/time]; along z in two dimensions.
    pub angular_velocity: Vec<DVec3>,
    /// The tangential law of pairs of groups: row-major `groups × groups`, symmetric.
    pub pair: Vec<Roughness>,
    /// The same of groups with walls: row-major `groups × walls`.
    pub wall: Vec<Roughness>,
}

/// The spins of a world.
#[derive(Debug, Clone)]
pub(crate) struct Spins {
    /// Angular velocity of each particle [1/time]; of one that slides on a wall, when the slide began.
    pub angular_velocity: Array<DVec3>,
    pub inertia: Vec<f64>,
    pub pair: Vec<Roughness>,
    pub wall: Vec<Roughness>,
    /// Friction on grains that walls support.
    pub slides: BTreeMap<u32, Slide>,
}

impl Spins {
    pub fn of(system: &System) -> Option<Box<Self>> {
        let spin = system.spin.as_ref()?;
        Some(Box::new(Self {
            angular_velocity: spin.angular_velocity.clone().into(),
            inertia: spin.inertia.clone(),
            pair: spin.pair.clone(),
            wall: spin.wall.clone(),
            slides: BTreeMap::new(),
        }))
    }

    /// The same laws, without particles.
    pub fn without_particles(&self) -> Self {
        Self {
            angular_velocity: Array::default(),
            inertia: self.inertia.clone(),
            pair: self.pair.clone(),
            wall: self.wall.clone(),
            slides: BTreeMap::new(),
        }
    }

    /// Describes all slides from the end of an epoch at `now` \[ticks\] on, and sets their start to the
    /// start of the next one. Returns their ends, which are still those of the old epoch.
    pub fn end_epoch(&mut self, clock: &Clock, now: i64) -> impl Iterator<Item = &mut i64> {
        let Self { angular_velocity, slides, .. } = self;
        for (&i, slide) in &mut *slides {
            angular_velocity[i as usize] += slide.spin_change(clock, now);
            *slide = Slide { since: 0, ..slide.moved_to(clock, now) };
        }
        slides.values_mut().filter_map(|slide| slide.end.as_mut())
    }

    /// Particle i as a body in a rough contact.
    pub fn body(&self, i: u32, class: &ClassData, velocity: DVec3) -> RoughBody {
        RoughBody {
            velocity,
            angular_velocity: self.angular_velocity[i as usize],
            radius: class.radius,
            inverse_mass: class.inverse_mass,
            inertia: self.inertia[class.group],
        }
    }
}

impl ClassData {
    /// Moment of inertia I = q m R² [mass·length²], for the number q of its group.
    pub fn moment_of_inertia(&self, inertia: &[f64]) -> f64 {
        inertia[self.group] * self.mass * self.radius * self.radius
    }
}

impl World {
    /// The angular velocity of particle i at `ticks` [1/time]; zero without spin.
    pub fn angular_velocity(&self, i: u32, ticks: i64) -> DVec3 {
        let Some(spins) = &self.spin else { return DVec3::ZERO };
        let start = spins.angular_velocity[i as usize];
        match spins.slides.get(&i) {
            Some(slide) => start + slide.spin_change(&self.clock, ticks),
            None => start,
        }
    }

    /// Sets the angular velocity of particle i. Returns the energy that this gives to it.
    pub fn set_spin(&mut self, i: u32, spin: DVec3) -> f64 {
        let class = *self.body(i);
        let Some(spins) = &mut self.spin else { return 0.0 };
        let before = std::mem::replace(&mut spins.angular_velocity[i as usize], spin);
        0.5 * class.moment_of_inertia(&spins.inertia) * (spin - before).dot(spin + before)
    }

    /// Energy and angular momentum of the rotation of particle i at `ticks`; zero for a body of infinite
    /// mass.
    pub fn rotation(&self, i: u32, ticks: i64) -> (f64, DVec3) {
        let Some(spins) = &self.spin else { return Default::default() };
        let body = self.body(i);
        if body.inverse_mass == 0.0 {
            return Default::default();
        }
        let (moment, spin) = (body.moment_of_inertia(&spins.inertia), self.angular_velocity(i, ticks));
        (0.5 * moment * spin.length_squared(), moment * spin)
    }

    /// Kinetic energy of the rotation of all bodies of finite mass at the present, and their angular momentum
    /// about their own centers.
    pub fn all_rotation(&self) -> (f64, DVec3) {
        if self.spin.is_none() {
            return Default::default();
        }
        let [energy, x, y, z] = total(self.particles.len(), |i| {
            let (energy, momentum) = self.rotation(i, self.now);
            [energy, momentum.x, momentum.y, momentum.z]
        });
        (energy, DVec3::new(x, y, z))
    }
}

/// Number of axes about which particles rotate.
pub(crate) fn rotations(dimension: usize) -> usize {
    if dimension == 2 { 1 } else { 3 }
}
