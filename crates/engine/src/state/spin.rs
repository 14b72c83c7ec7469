//! Angular velocities. They never enter a prediction: only impacts and the walls that support a grain change
//! them, and a scene without them has no data for them.
//!
//! Spin is data of its own in the world, absent in smooth scenes. No prediction reads it: impacts resolve
//! their normal part as for smooth particles, and `rough` adds the tangential one. Blocks save and restore
//! spins with their particles. A wall that supports a rough grain exerts friction on it (`slide`): a
//! constant acceleration until the slip ends, which is an event of the calendar.

use std::collections::BTreeMap;

use glam::DVec3;
use haff_mechanics::{RoughBody, Roughness};
use haff_neighbors::Array;

use crate::{
    model::System,
    numerics::clock::Clock,
    state::{particle::ClassData, slide::Slide},
};

/// The spins of a world.
#[derive(Debug, Clone)]
pub(crate) struct Spins {
    /// Angular velocity of each particle [1/time]; of one that slides on a wall, when the slide began.
    pub angular_velocity: Array<DVec3>,
    pub inertia: Vec<f64>,
    pub pair: Vec<Roughness>,
    pub wall: Vec<Roughness>,
    /// Whether a drag acts on rotations, too: what is stored decays as the velocities of anchors do.
    pub damped: bool,
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
            damped: system.drag.is_some_and(|drag| drag.rotational),
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
            damped: self.damped,
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

    /// Particle i as a body in a rough contact. `decay` is what a drag has left of its angular velocity.
    pub fn body(&self, i: u32, class: &ClassData, velocity: DVec3, decay: f64) -> RoughBody {
        RoughBody {
            velocity,
            angular_velocity: self.angular_velocity[i as usize] * decay,
            radius: class.radius,
            inverse_mass: class.inverse_mass,
            inertia: self.inertia[class.group],
        }
    }
}
