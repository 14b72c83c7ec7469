//! Laws of impact with walls.
//!
//! To add a law, add a variant of [`WallLaw`] and a file that resolves it.

use haff_mechanics::Restitution;

use crate::model::thermal::ThermalWall;

/// The law of impact of a particle with a wall.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum WallLaw {
    /// The normal component of the relative velocity is reversed and multiplied by the coefficient of
    /// restitution.
    Restitution(Restitution),
    /// The particle leaves with a velocity drawn at the temperature of the wall.
    Thermal(ThermalWall),
    /// None: the particle passes through the wall.
    Passes,
}

impl From<Restitution> for WallLaw {
    fn from(law: Restitution) -> Self {
        Self::Restitution(law)
    }
}

impl WallLaw {
    /// The law of restitution; of a thermal wall, that of the reflections that are not thermal.
    pub fn restitution(&self) -> Restitution {
        match self {
            Self::Restitution(law) => *law,
            Self::Thermal(wall) => wall.restitution,
            Self::Passes => Restitution::Constant(1.0),
        }
    }

    /// Whether bounces under gravity may form an infinite series, which is then completed in closed form.
    pub(crate) fn has_series(&self) -> bool {
        match self {
            Self::Restitution(law) => law.loses_energy(),
            // A thermal reflection would end the series.
            Self::Thermal(wall) => wall.accommodation == 0.0 && wall.restitution.loses_energy(),
            Self::Passes => false,
        }
    }

    /// Whether impacts exchange heat.
    pub fn is_thermal(&self) -> bool {
        matches!(self, Self::Thermal(_))
    }

    /// Whether restitution takes no energy; a thermal wall may exchange heat.
    pub fn is_elastic(&self) -> bool {
        self.restitution() == Restitution::Constant(1.0)
    }
}
