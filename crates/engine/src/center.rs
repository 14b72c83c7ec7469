/*!
The motion of the center of mass, which temperatures and pressures do not contain.

Temperature and pressure are those of the velocities v − V. V is the velocity of the center of mass along the
axes on which momentum is conserved ([`conserved_momentum`]), and 0 along the others. On an axis where it is
conserved, V is a constant that the initial state has chosen: a system that moves past an observer is as hot
as one at rest. Walls, bodies of infinite mass and baths are at rest, or have a motion of their own, and
exchange momentum with the particles. There V is a thermal motion like that of every particle, which belongs
to Σ m v²: only with it the pressure on the walls is that of the virial, also for a single particle.

Kicks at Poisson times (white noise) change V, too, but not by its value: there is no frame of rest, and
without a friction M V² grows without bound. They leave V out, as with conserved momentum. V is then a step
function of the time, and so is its part of the pressure ([`Center`]).
*/

use glam::DVec3;

use crate::{
    drive::DriveKind,
    force::{self, Total},
    measure::Totals,
    measurements::{Tensor, product},
    model::{Body, Boundary, System, Wall, WallLaw},
    particles::World,
    rest::thresholds::Thresholds,
    scalars::{ScalarReader, ScalarWriter},
    shear::SlidingImages,
    sum::Sum,
};

/// A component of a unit normal that is not larger is a rounding error.
const ROUNDING: f64 = 1e-15;

/// Whether momentum along each axis is conserved, so that temperatures and pressures are relative to the
/// velocity of the center of mass along it. The system must have its bodies.
///
/// It is conserved along a periodic or open axis, unless along it there is gravity, a wall, or a wall that is
/// rough or thermal; and along no axis with a body of infinite mass, with an Andersen thermostat, or where
/// grains are put to rest. Under shear it is conserved along the axis that is neither that of the flow nor
/// that of the gradient: a motion of the center of mass along the gradient leads to places where the flow is
/// faster, and the shear does work on it.
///
/// False for the z axis in two dimensions.
#[must_use]
pub fn conserved_momentum(system: &System) -> [bool; 3] {
    let is_held = has_body(system, f64::is_infinite) || has_bath(system) || Thresholds::of(system).is_some();
    [0, 1, 2].map(|axis| {
        let sheared = system.domain.shear.is_some_and(|shear| axis == shear.flow || axis == shear.gradient);
        axis < system.dimension.count()
            && !is_held
            && !sheared
            && system.domain.boundary[axis] != Boundary::Wall
            && system.domain.gravity[axis] == 0.0
            && !(0..system.walls.len()).any(|wall| pushes_along(system, wall, axis))
    })
}

/// Whether a body has such a mass.
fn has_body(system: &System, condition: impl Fn(f64) -> bool) -> bool {
    system.bodies.iter().any(|body| condition(system.classes[body.class as usize].mass))
}

/// Whether an Andersen thermostat acts on a particle.
fn has_bath(system: &System) -> bool {
    let acts = |species: &[u32]| {
        let is_driven = |body: &Body| {
            species.contains(&body.species) && system.classes[body.class as usize].mass.is_finite()
        };
        system.bodies.iter().any(is_driven)
    };
    system.drives.iter().any(|drive| matches!(drive.kind, DriveKind::Andersen { .. }) && acts(&drive.species))
}

/// Whether impacts on a wall can change momentum along an axis.
fn pushes_along(system: &System, wall: usize, axis: usize) -> bool {
    let walls = system.walls.len();
    let Wall { normal, partition, .. } = &system.walls[wall];
    if normal[axis].abs() > ROUNDING || partition.is_some_and(|partition| partition.hole.is_some()) {
        return true;
    }
    // The axis is tangential.
    let exchanges = |law: &WallLaw| matches!(law, WallLaw::Thermal(wall) if wall.accommodation > 0.0);
    let thermal = system.contacts.wall.iter().skip(wall).step_by(walls).any(exchanges);
    let rough = system
        .spin
        .as_ref()
        .is_some_and(|spin| spin.wall.iter().skip(wall).step_by(walls).any(|law| !law.is_smooth()));
    thermal || rough
}

/// The center of mass along the axes on which momentum is conserved, and integrals of its velocity V over
/// time.
#[derive(Debug, Clone, Default)]
pub(crate) struct Center {
    conserved: [bool; 3],
    /// M of the bodies of finite mass.
    mass: f64,
    /// Their momentum.
    pub momentum: Total,
    /// Up to `until`, since they were taken.
    pub integrals: Integrals,
    pub until: f64,
}

/// Integrals of the motion of the center of mass; zero along the axes on which momentum is not conserved.
#[derive(Debug, Clone, Default)]
pub(crate) struct Integrals {
    conserved: [bool; 3],
    /// ∫ M V ⊗ V dt.
    pub energy: [Sum; 9],
    /// ∫ V dt.
    pub path: Total,
}

impl Integrals {
    /// The trace of ∫ M V ⊗ V dt.
    pub fn trace(&self) -> f64 {
        [0, 4, 8].map(|k| self.energy[k].value()).iter().sum()
    }

    /// What the mean over `span` of Σ m v ⊗ v contains of the motion of the center of mass, for the mean
    /// momentum in it.
    pub fn mean(&self, momentum: DVec3, span: f64) -> Tensor {
        let velocity = force::value(&self.path) / span;
        std::array::from_fn(|k| {
            let (a, b) = (k / 3, k % 3);
            let mixed = match (self.conserved[a], self.conserved[b]) {
                (true, false) => velocity[a] * momentum[b],
                (false, true) => momentum[a] * velocity[b],
                _ => 0.0,
            };
            self.energy[k].value() / span + mixed
        })
    }
}

impl Center {
    /// The center of mass of a world at `time`.
    pub fn of(world: &World, time: f64) -> Self {
        let mut center = Self { until: time, ..Self::default() };
        center.replace(world, time);
        center
    }

    /// Continues with the particles of another world from `time` on.
    pub fn replace(&mut self, world: &World, time: f64) {
        self.advance(time);
        let totals = Totals::of(world);
        (self.conserved, self.mass, self.momentum) = (world.conserved, totals.mass, Total::default());
        force::add(&mut self.momentum, totals.momentum);
    }

    /// Changes the momentum at `time`.
    pub fn change(&mut self, momentum: DVec3, time: f64) {
        self.advance(time);
        force::add(&mut self.momentum, momentum);
    }

    /// Adds its numbers to a checkpoint.
    pub fn save(&self, scalars: &mut ScalarWriter) {
        scalars.total("center.momentum", &self.momentum);
        for (k, sum) in self.integrals.energy.iter().enumerate() {
            scalars.sum(&format!("center.energy.{k}"), sum);
        }
        scalars.total("center.path", &self.integrals.path);
        scalars.real("center.until", self.until);
    }

    /// Loads what [`Self::save`] has saved.
    pub fn load(&mut self, scalars: &mut ScalarReader) {
        self.momentum = scalars.total("center.momentum");
        self.integrals.energy = std::array::from_fn(|k| scalars.sum(&format!("center.energy.{k}")));
        self.integrals.path = scalars.total("center.path");
        self.until = scalars.real("center.until");
    }

    /// Takes the integrals up to `time`, and begins the next ones.
    pub fn take(&mut self, time: f64) -> Integrals {
        self.advance(time);
        Integrals { conserved: self.conserved, ..std::mem::take(&mut self.integrals) }
    }

    fn advance(&mut self, time: f64) {
        let span = time - std::mem::replace(&mut self.until, time);
        if span == 0.0 || self.mass == 0.0 || self.conserved == [false; 3] {
            return;
        }
        let momentum = along(force::value(&self.momentum), self.conserved);
        let velocity = momentum / self.mass;
        force::add(&mut self.integrals.path, velocity * span);
        for (sum, term) in self.integrals.energy.iter_mut().zip(product(momentum, velocity)) {
            sum.add(term * span);
        }
    }
}

/// The components of a vector along these axes; the others are zero.
pub(crate) fn along(vector: DVec3, axes: [bool; 3]) -> DVec3 {
    DVec3::from_array([0, 1, 2].map(|axis| if axes[axis] { vector[axis] } else { 0.0 }))
}

/// The velocity that temperatures and pressures are relative to, of bodies with this total momentum and mass.
#[must_use]
pub fn common_velocity(momentum: DVec3, mass: f64, conserved: [bool; 3]) -> DVec3 {
    if mass > 0.0 { along(momentum / mass, conserved) } else { DVec3::ZERO }
}

/// Temperature of a system at the start, the one of [`Sample::temperature`](crate::Sample::temperature)
/// \[energy\]; `None` without bodies of finite mass. Momentum is conserved along these axes
/// ([`conserved_momentum`]).
#[must_use]
pub fn initial_temperature(system: &System, conserved: [bool; 3]) -> Option<f64> {
    let shear = SlidingImages::of(system);
    let peculiar = |body: &Body| {
        body.velocity - shear.as_ref().map_or(DVec3::ZERO, |shear| shear.velocity(body.position))
    };
    let movable = || {
        let all = system.bodies.iter().map(|body| (system.classes[body.class as usize].mass, peculiar(body)));
        all.filter(|(mass, _)| mass.is_finite())
    };
    let (count, mass) = (movable().count() as f64, movable().map(|(mass, _)| mass).sum());
    let momentum = movable().map(|(mass, velocity)| mass * velocity).sum();
    let common = common_velocity(momentum, mass, conserved);
    let sum: f64 = movable().map(|(mass, velocity)| mass * (velocity - common).length_squared()).sum();
    (count > 0.0).then(|| sum / (system.dimension.count() as f64 * count))
}
