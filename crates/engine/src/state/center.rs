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
    model::conserved::along,
    numerics::{
        scalars::{ScalarReader, ScalarWriter},
        sum::Sum,
        tensor::{Tensor, product},
        total::total,
    },
    state::{
        force::{self, Total},
        world::World,
    },
};

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
        let [mass, x, y, z] = total(world.particles.len(), |i| {
            let class = world.body(i);
            if class.inverse_mass == 0.0 {
                return [0.0; 4];
            }
            let p = class.mass * world.peculiar(i, world.now).1;
            [class.mass, p.x, p.y, p.z]
        });
        (self.conserved, self.mass, self.momentum) = (world.conserved, mass, Total::default());
        force::add(&mut self.momentum, DVec3::new(x, y, z));
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
