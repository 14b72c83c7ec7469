//! Integration methods, behind one trait.

mod engine;
mod pairs;
mod peer;
mod soft;
mod stepper;

use std::time::Duration;

use glam::DVec3;
use haff_engine::{Boundary, System};

use crate::Error;

pub use engine::Engine;
pub use peer::{Peer, Program};
pub use soft::SoftSpheres;
pub use stepper::Stepper;

/// All particles at one time.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct State {
    /// Centres [length], wrapped along periodic axes or not.
    pub position: Vec<DVec3>,
    /// Velocities [length/time].
    pub velocity: Vec<DVec3>,
}

/// Result of a method on a scene.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Run {
    /// One state for each requested time.
    pub states: Vec<State>,
    /// Wall time of the integration, including the set-up.
    pub wall: Duration,
    /// Time steps, or events.
    pub steps: u64,
    /// Z = ⟨P V⟩/⟨⅔ T⟩ with the kinetic energy T, means over the whole run, of a periodic scene; `None` if
    /// the method does not provide it.
    pub compressibility: Option<f64>,
}

/// A method that integrates a scene from its initial state, at time 0.
pub trait Method {
    /// Short name for tables: the same for all values of its parameter.
    fn name(&self) -> &str;

    /// The parameter that determines its error, in units of the scene, such as `dt = 0.001`; empty if it has
    /// no parameter.
    fn parameter(&self) -> String;

    /// The number in [`Self::parameter`].
    fn value(&self) -> Option<f64>;

    /// States at ascending times ≥ 0 [time].
    fn run(&self, system: &System, times: &[f64]) -> Result<Run, Error>;
}

/// The particles of a scene for the time-stepping methods: in arrays, positions unwrapped.
#[derive(Debug, Clone)]
struct Spheres {
    position: Vec<DVec3>,
    velocity: Vec<DVec3>,
    radius: Vec<f64>,
    inverse_mass: Vec<f64>,
    /// Edges [length]; 0 along axes that are not periodic.
    period: DVec3,
    gravity: DVec3,
    planes: Vec<Plane>,
    restitution: f64,
    wall_restitution: f64,
}

/// A wall: points with (x − point)·normal ≥ 0 are inside.
#[derive(Debug, Clone, Copy)]
struct Plane {
    point: DVec3,
    normal: DVec3,
}

impl Spheres {
    fn new(system: &System, method: &str) -> Result<Self, Error> {
        let (restitution, wall_restitution) = crate::reference::one_restitution(system, method)?;
        let class = |body: &haff_engine::Body| system.classes[body.class as usize];
        let periodic = |axis: usize| system.domain.boundary[axis] == Boundary::Periodic;
        Ok(Self {
            position: system.bodies.iter().map(|body| body.position).collect(),
            velocity: system.bodies.iter().map(|body| body.velocity).collect(),
            radius: system.bodies.iter().map(|body| class(body).radius).collect(),
            inverse_mass: system.bodies.iter().map(|body| 1.0 / class(body).mass).collect(),
            period: DVec3::from_array(
                [0, 1, 2].map(|axis| if periodic(axis) { system.domain.size[axis] } else { 0.0 }),
            ),
            gravity: system.domain.gravity,
            planes: system
                .walls
                .iter()
                .map(|wall| Plane { point: wall.point, normal: wall.normal })
                .collect(),
            restitution,
            wall_restitution,
        })
    }

    fn state(&self) -> State {
        State { position: self.position.clone(), velocity: self.velocity.clone() }
    }

    fn largest_radius(&self) -> f64 {
        self.radius.iter().copied().fold(0.0, f64::max)
    }
}

/// Steps of at most `dt` that end exactly at each of the times: their number and length for each stretch.
fn stretches(times: &[f64], dt: f64) -> impl Iterator<Item = (u64, f64)> {
    times.iter().scan(0.0, move |before, &time| {
        let span = time - std::mem::replace(before, time);
        // A stretch that is a whole number of steps except for rounding gets that number.
        let steps = (span / dt * (1.0 - 1e-9)).ceil().max(0.0);
        Some((steps as u64, if steps > 0.0 { span / steps } else { 0.0 }))
    })
}

/// Sums for the compressibility.
#[derive(Debug, Clone, Copy, Default)]
struct Virial {
    /// ∫ Σ F·r dt, or Σ J |r| over collisions [energy·time].
    contacts: f64,
    /// ∫ 2T dt [energy·time].
    kinetic: f64,
}

impl Virial {
    /// Adds a step: ∫ Σ F·r dt during it, and the velocities at its end.
    fn add(&mut self, contacts: f64, spheres: &Spheres, dt: f64) {
        self.contacts += contacts;
        let twice = |(velocity, inverse_mass): (&DVec3, &f64)| velocity.length_squared() / inverse_mass;
        self.kinetic += spheres.velocity.iter().zip(&spheres.inverse_mass).map(twice).sum::<f64>() * dt;
    }

    /// Z = 1 + ∫ Σ F·r dt/∫ 2T dt.
    fn compressibility(&self, spheres: &Spheres) -> Option<f64> {
        (spheres.period.min_element() > 0.0).then(|| 1.0 + self.contacts / self.kinetic)
    }
}
