//! Laws of impact with walls.
//!
//! A new law is one more variant of [`WallLaw`], resolved in a file of its own.

use glam::DVec3;
use haff_mechanics::Restitution;

use crate::{
    error::EngineError, features::Features, report::Observer, resolve, state::State, thermal::ThermalWall,
};

/// What happens to a particle that touches a wall.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum WallLaw {
    /// The normal component of the relative velocity is reversed and multiplied by the coefficient of
    /// restitution.
    Restitution(Restitution),
    /// The particle leaves with a velocity drawn at the temperature of the wall.
    Thermal(ThermalWall),
}

impl From<Restitution> for WallLaw {
    fn from(law: Restitution) -> Self {
        Self::Restitution(law)
    }
}

/// A contact of a particle with a wall, before its impact.
pub(crate) struct WallContact {
    pub i: u32,
    pub wall: u32,
    /// [ticks]
    pub time: i64,
    pub position: DVec3,
    pub velocity: DVec3,
    /// Unit normal into the wall.
    pub n: DVec3,
    pub wall_velocity: DVec3,
}

impl WallLaw {
    /// The law of restitution, also of the impacts to which it alone applies.
    pub fn restitution(&self) -> Restitution {
        match self {
            Self::Restitution(law) => *law,
            Self::Thermal(wall) => wall.restitution,
        }
    }

    /// Whether bounces under gravity may become an infinite series, which is then completed in closed form.
    pub(crate) fn has_series(&self) -> bool {
        match self {
            Self::Restitution(law) => !law.is_elastic(),
            // A thermal reflection would end it.
            Self::Thermal(wall) => wall.accommodation == 0.0 && !wall.restitution.is_elastic(),
        }
    }

    /// Whether impacts exchange heat.
    pub fn is_thermal(&self) -> bool {
        matches!(self, Self::Thermal(_))
    }

    /// Whether no impact loses energy.
    pub fn is_elastic(&self) -> bool {
        self.restitution() == Restitution::Constant(1.0)
    }

    /// Resolves a contact.
    #[inline(always)]
    pub(crate) fn resolve<F: Features, const EVENTS: bool>(
        &self,
        state: &mut State,
        contact: &WallContact,
        observer: &mut dyn Observer,
    ) -> Result<(), EngineError> {
        match self {
            Self::Restitution(law) => resolve::bounce::<F, EVENTS>(state, contact, *law, observer),
            Self::Thermal(wall) => match wall.velocity(state, contact) {
                Some(velocity) => ThermalWall::reflect::<EVENTS>(state, contact, velocity, observer),
                None => resolve::bounce::<F, EVENTS>(state, contact, wall.restitution, observer),
            },
        }
    }
}
