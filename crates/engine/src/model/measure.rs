//! What is measured while a run goes on.

use std::sync::Arc;

use super::probe::NamedProbe;

/// What to measure while the run goes on. By default nothing.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Measure {
    /// The pressure tensor, in samples.
    pub stress: bool,
    /// The force and the heat of each wall, in samples.
    pub wall_forces: bool,
    /// The rates of collisions by pair of species, in samples.
    pub pair_collisions: bool,
    /// Profiles.
    pub profiles: Vec<Grid>,
    /// Correlations in time.
    pub correlations: Correlations,
    /// Probes that another crate adds.
    pub probes: Vec<Arc<NamedProbe>>,
}

/// One axis of a grid.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GridAxis {
    /// 0, 1 or 2 for x, y or z.
    pub axis: usize,
    /// The range that the cells divide \[length\].
    pub low: f64,
    /// End of the range \[length\].
    pub high: f64,
    /// Number of cells.
    pub bins: usize,
}

impl GridAxis {
    /// Centers of the cells \[length\].
    pub fn centers(&self) -> Vec<f64> {
        let width = (self.high - self.low) / self.bins as f64;
        (0..self.bins).map(|k| self.low + width * (k as f64 + 0.5)).collect()
    }
}

/// The grid of a profile, and when it is measured.
#[derive(Debug, Clone, PartialEq)]
pub struct Grid {
    /// One to three axes. The last one varies fastest in the arrays of [`ProfileRow`].
    pub axes: Vec<GridAxis>,
    /// Time between rows \[time\].
    pub interval: f64,
    /// Number of states in the mean of a row.
    pub samples: u64,
    /// Whether the states are taken at random times, one in each part of the interval; otherwise at equal
    /// times, the last one at the end of the interval.
    pub spread: bool,
    /// Species that have fields of their own beside those of all particles.
    pub species: Vec<u32>,
}

impl Grid {
    /// The name in files: the letters of the axes.
    pub fn name(&self) -> String {
        self.axes.iter().map(|axis| ["x", "y", "z"][axis.axis]).collect()
    }

    /// Number of cells.
    pub fn cells(&self) -> usize {
        self.axes.iter().map(|axis| axis.bins).product()
    }
}

/// Whose displacements or velocities are followed.
#[derive(Debug, Clone, PartialEq, Default)]
pub enum Followed {
    /// Of no particle.
    #[default]
    Nothing,
    /// Of all particles together.
    All,
    /// Of each of these species, with a curve of its own.
    Species(Vec<u32>),
}

impl Followed {
    /// Whether anything is followed.
    pub fn any(&self) -> bool {
        *self != Self::Nothing
    }

    /// Number of curves.
    pub fn curves(&self) -> usize {
        match self {
            Self::Nothing => 0,
            Self::All => 1,
            Self::Species(species) => species.len(),
        }
    }

    /// The species of the curves; none if they are not of species.
    pub fn species(&self) -> &[u32] {
        if let Self::Species(species) = self { species } else { &[] }
    }
}

/// Which correlations to measure.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Correlations {
    /// Mean square displacement.
    pub msd: Followed,
    /// Autocorrelation of velocities.
    pub vacf: Followed,
    /// Autocorrelation of the pressure tensor, and the mean square of its integral.
    pub stress: bool,
    /// Time between states: the shortest lag \[time\].
    pub interval: f64,
    /// Largest number of particles whose displacements and velocities are followed in each curve; of more,
    /// this many are chosen at equal distances in their order.
    pub tracers: usize,
}

impl Correlations {
    /// Whether anything is measured.
    pub fn any(&self) -> bool {
        self.msd.any() || self.vacf.any() || self.stress
    }
}
