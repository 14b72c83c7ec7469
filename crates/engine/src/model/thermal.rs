//! Thermal walls: particles leave with velocities drawn from a Maxwell distribution at the wall's
//! temperature.
//!
//! Velocities are relative to the wall. The normal component has the density of the flux,
//! p(v) = (m v/T) exp(−m v²/2T), so that it is √(−2 T ln u/m) for a uniform random number u. Each tangential
//! component is Gaussian with variance T/m. Detailed balance then holds: a gas that is in contact with such
//! walls only comes to equilibrium at T.

use glam::DVec3;
use haff_mechanics::{Restitution, random::Draw};

/// The law of a thermal wall.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ThermalWall {
    /// Temperature T > 0 \[energy\].
    pub temperature: f64,
    /// Probability that a reflection is thermal; otherwise `restitution` applies.
    pub accommodation: f64,
    /// Law of the other reflections.
    pub restitution: Restitution,
}

impl ThermalWall {
    /// Draws the angular velocity of a particle with this moment of inertia after a thermal reflection: each
    /// component is Gaussian with variance T/I. The numbers do not depend on those of the velocity.
    pub(crate) fn angular_velocity(&self, mut draw: Draw, moment: f64, dimension: usize) -> DVec3 {
        // More than the velocity takes.
        (0..8).for_each(|_| _ = draw.uniform());
        let mut component = || draw.normal() * (self.temperature / moment).sqrt();
        if dimension == 2 {
            DVec3::Z * component()
        } else {
            DVec3::new(component(), component(), component())
        }
    }

    /// Draws the velocity of a particle of this mass after a contact, relative to the wall; `None` if the
    /// reflection is not thermal. `n` points into the wall.
    pub(crate) fn velocity(&self, mut draw: Draw, mass: f64, n: DVec3, dimension: usize) -> Option<DVec3> {
        if draw.uniform() >= self.accommodation {
            return None;
        }
        let spread = (self.temperature / mass).sqrt();
        let normal = (2.0 * draw.exponential()).sqrt();
        let tangential = if dimension == 2 {
            DVec3::new(-n.y, n.x, 0.0) * draw.normal()
        } else {
            let (first, second) = n.any_orthonormal_pair();
            first * draw.normal() + second * draw.normal()
        };
        Some((tangential - n * normal) * spread)
    }
}
