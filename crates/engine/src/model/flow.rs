//! Inlets and outlets: particles that come in and go out while a run goes on.

use glam::DVec3;

/// A box with edges along the axes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cuboid {
    /// Lower corner [length].
    pub low: DVec3,
    /// Upper corner [length].
    pub high: DVec3,
}

impl Cuboid {
    /// Whether a position is in the box, faces included.
    #[must_use]
    pub fn contains(&self, position: DVec3) -> bool {
        position.cmpge(self.low).all() && position.cmple(self.high).all()
    }

    /// The position at some part of the way from the lower to the upper corner along each axis; 0 along an
    /// axis without a part.
    #[must_use]
    pub fn at(&self, mut part: impl FnMut(usize) -> Option<f64>) -> DVec3 {
        let along = |axis: usize| {
            let (low, high) = (self.low[axis], self.high[axis]);
            part(axis).map_or(0.0, |part| low + (high - low) * part)
        };
        DVec3::from_array([0, 1, 2].map(along))
    }

    /// The shortest of the first `dimension` edges [length].
    #[must_use]
    pub fn thickness(&self, dimension: usize) -> f64 {
        let edges = (self.high - self.low).to_array();
        edges.into_iter().take(dimension).fold(f64::INFINITY, f64::min)
    }
}

/// A place where particles come in.
#[derive(Debug, Clone, PartialEq)]
pub struct Inlet {
    /// Centers of new particles are in it.
    pub place: Cuboid,
    /// Their mean velocity [length/time].
    pub velocity: DVec3,
    /// Temperature of their velocities relative to it \[energy\].
    pub temperature: f64,
    /// Which particles come in, and when.
    pub supply: Supply,
}

/// What an inlet has to give.
#[derive(Debug, Clone, PartialEq)]
pub enum Supply {
    /// Particles of the system that are not there at the start, one after the other, at the times of a
    /// Poisson process.
    Rate {
        /// Mean number of particles per time [1/time].
        rate: f64,
        /// Index of the first of these particles, and their number.
        first: u32,
        /// See `first`.
        count: u32,
    },
    /// Particles of these species that outlets have taken out.
    Refill {
        /// Indices into [`System::species`](crate::System::species).
        species: Vec<u32>,
        /// At most so many entries.
        count: u64,
    },
}

/// A place where particles are taken out.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Outlet {
    /// Particles with their centers in it are taken out.
    pub place: Cuboid,
    /// Time between two searches for such particles [time]; chosen by the speeds if there is none.
    pub interval: Option<f64>,
}

/// Inlets and outlets.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Flow {
    /// Where particles come in.
    pub inlets: Vec<Inlet>,
    /// Where they go out.
    pub outlets: Vec<Outlet>,
    /// Number of particles at the start: the first ones of the system. The others wait.
    pub present: usize,
}

impl Flow {
    /// Number of all particles that ever are there.
    pub(crate) fn all(&self) -> u64 {
        let counts = self.inlets.iter().map(|inlet| match inlet.supply {
            Supply::Rate { count, .. } => u64::from(count),
            Supply::Refill { .. } => 0,
        });
        self.present as u64 + counts.sum::<u64>()
    }
}
