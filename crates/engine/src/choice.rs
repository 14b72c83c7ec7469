//! The choice of a scheduler for a state, compiled for what the system needs.

use glam::DVec3;
use haff_neighbors::{AllPairs, Cells, Geometry, Lists};

use crate::{
    batch::Kernel,
    calendar_scheduler::CalendarScheduler,
    census::{Census, Crowd},
    event_loop::Engine,
    features::{
        ElasticMonodisperse, FallingMonodisperse, FallingPolydisperse, Features, Monodisperse, Polydisperse,
        Settling,
    },
    model::{Dimension, NeighborChoice, System},
    nearby::{self, Nearby},
    particles::World,
    rest::thresholds::Thresholds,
    windows::{self, Windows},
};

/// Up to this many particles all pairs are tested.
const FEW: usize = 12;
/// Packing fraction of spheres, and of disks, above which lists are faster than cells if all have one size…
const DENSE: [f64; 2] = [0.18, 0.42];
/// … and if they have not: the cells' width follows the largest, that of the lists' shell the mean.
const DENSE_MIXED: [f64; 2] = [0.26, 0.5];
/// The same where windows compete (benches/record/throughput.md): with the lists of [`nearby`], …
const DENSE_FOR_WINDOWS: [f64; 2] = [0.24, 0.3];
/// … from [`nearby::AWAY`] on, when their members are in no near cache, …
const DENSE_FOR_WINDOWS_AWAY: [f64; 2] = [0.29, 0.34];
/// … with those for all systems, and with these under gravity and where sizes differ too much for [`nearby`].
const DENSE_FOR_WINDOWS_ELSE: [f64; 2] = [0.38, 0.7];
const DENSE_FOR_WINDOWS_FALLING: [f64; 2] = [0.55, 0.7];
const DENSE_FOR_WINDOWS_WIDE: [f64; 2] = [0.46, 0.7];
/// A scheduler is replaced by another when the density is beyond the bound by this factor: changing to and
/// fro costs more than it gains.
const HYSTERESIS: f64 = 1.15;
/// An engine is laid out anew when the density around the particles has changed by this factor.
const CHANGED: f64 = 2.0;
/// Packing fractions below this make no difference.
const SPARSE: f64 = 1e-9;
/// The choice is made again after so many collisions per particle, and in all: that takes less than a
/// hundredth of their time.
const REVIEW_PER_PARTICLE: u64 = 16;
const REVIEW: u64 = 2000;
/// The choice is made again earlier if a scheduler takes more entries than this for a collision: windows are
/// too short, or particles hardly meet.
const ENTRIES: u64 = 2;

/// What the choice of an engine rests on.
pub(crate) struct Choice {
    pub census: Census,
    kernel: Kernel,
    /// The choice of the caller.
    asked: NeighborChoice,
    /// The present choice, and the local density when it was made.
    pub neighbors: NeighborChoice,
    crowd: Crowd,
    /// Collisions, in all, and further entries after which the choice is made again.
    pub review: u64,
    pub patience: u64,
}

impl Choice {
    /// Chooses for the present state of a world.
    pub fn new(asked: NeighborChoice, kernel: Kernel, system: &System, world: &World) -> Self {
        let census = Census::of(system, world);
        let crowd = Crowd::of(system, &census, world);
        let mut choice =
            Self { census, kernel, asked, neighbors: NeighborChoice::Auto, crowd, review: 0, patience: 0 };
        choice.neighbors = choice.best(system, world, &crowd);
        choice
    }

    /// Makes the choice again. Whether another scheduler, or the same with a new layout, is to go on.
    pub fn reconsider(&mut self, system: &System, world: &World) -> bool {
        let crowd = Crowd::of(system, &self.census, world);
        let neighbors = self.best(system, world, &crowd);
        // A few particles in open space may have no neighbors.
        let ratio = crowd.packing.max(SPARSE) / self.crowd.packing.max(SPARSE);
        let anew = neighbors != self.neighbors
            || self.neighbors != NeighborChoice::AllPairs && !(1.0 / CHANGED..=CHANGED).contains(&ratio);
        if anew {
            (self.neighbors, self.crowd) = (neighbors, crowd);
        }
        anew
    }

    /// Volume that the particles would fill at the density around the average one [length^d].
    pub fn filled(&self) -> f64 {
        self.census.occupied / self.crowd.packing
    }

    /// Sets when the choice is made again.
    pub fn after(&mut self, collisions: u64) {
        let interval = REVIEW + REVIEW_PER_PARTICLE * self.census.count as u64;
        (self.review, self.patience) = (collisions + interval, ENTRIES * interval);
    }

    /// The search for a state: windows where they serve and it is not dense, lists where it is, cells
    /// otherwise.
    fn best(&self, system: &System, world: &World, crowd: &Crowd) -> NeighborChoice {
        let windows_possible =
            windows::unsuitable(system, &self.census).is_none() && windows::supports(world);
        match self.asked {
            NeighborChoice::Auto => {}
            NeighborChoice::Windows if !windows_possible => return NeighborChoice::Cells,
            asked => return asked,
        }
        if self.census.count <= FEW {
            return NeighborChoice::AllPairs;
        }
        let windows = windows_possible && windows::is_profitable(system, &self.census, crowd);
        let mixed = self.census.least != self.census.largest;
        let limits = match (windows, mixed) {
            (true, _) if nearby::supports(system, &self.census) => {
                if self.census.count < nearby::AWAY {
                    DENSE_FOR_WINDOWS
                } else {
                    DENSE_FOR_WINDOWS_AWAY
                }
            }
            (true, _) if system.domain.gravity != DVec3::ZERO => DENSE_FOR_WINDOWS_FALLING,
            (true, _) if nearby::is_wide(&self.census) => DENSE_FOR_WINDOWS_WIDE,
            (true, _) => DENSE_FOR_WINDOWS_ELSE,
            (false, true) => DENSE_MIXED,
            (false, false) => DENSE,
        };
        let hysteresis = match self.neighbors {
            NeighborChoice::Auto => 1.0,
            NeighborChoice::Lists => 1.0 / HYSTERESIS,
            _ => HYSTERESIS,
        };
        let limit = limits[usize::from(system.dimension == Dimension::Two)] * hysteresis;
        if crowd.packing > limit && self.census.count <= Lists::MAX_PARTICLES {
            NeighborChoice::Lists
        } else if windows {
            NeighborChoice::Windows
        } else {
            NeighborChoice::Cells
        }
    }

    /// The engine for what the system needs.
    pub fn compile(&self, system: &System, geometry: &Geometry) -> Box<dyn Engine> {
        let Self { census, kernel, crowd, neighbors, .. } = self;
        tracing::info!(
            search = neighbors.name(),
            asked = self.asked.name(),
            particles = census.count,
            packing_fraction_around = crowd.packing,
            windows = windows::unsuitable(system, census).as_deref().unwrap_or("possible"),
            ?kernel,
            "engine"
        );
        macro_rules! scheduler {
            ($features:ty) => {{
                let (kernel, count) = (*kernel, census.count);
                match neighbors {
                    NeighborChoice::Windows => {
                        Box::new(Windows::<$features>::new(geometry, kernel, system, census, crowd))
                            as Box<dyn Engine>
                    }
                    // For a few, one engine does for all sizes.
                    NeighborChoice::AllPairs if <$features>::GRAVITY => {
                        Box::new(CalendarScheduler::<FallingPolydisperse, AllPairs>::new(
                            geometry, kernel, count,
                        ))
                    }
                    NeighborChoice::AllPairs => {
                        Box::new(CalendarScheduler::<Polydisperse, AllPairs>::new(geometry, kernel, count))
                    }
                    NeighborChoice::Lists => {
                        Box::new(CalendarScheduler::<$features, Lists>::new(geometry, kernel, count))
                    }
                    NeighborChoice::Auto | NeighborChoice::Cells => {
                        Box::new(CalendarScheduler::<$features, Cells>::new(geometry, kernel, count))
                    }
                }
            }};
        }
        if Thresholds::of(system).is_some() {
            return self.compile_for_rest(geometry);
        }
        let gravity = system.domain.gravity != DVec3::ZERO;
        if !gravity && census.uniform && system.contacts.are_elastic() {
            if *neighbors == NeighborChoice::Windows {
                return Box::new(Windows::<ElasticMonodisperse>::new(
                    geometry, *kernel, system, census, crowd,
                ));
            }
            if let Some(engine) = self.compile_for_lists::<ElasticMonodisperse>(system, geometry) {
                return engine;
            }
        }
        match (gravity, census.uniform) {
            (true, true) => scheduler!(FallingMonodisperse),
            (true, false) => scheduler!(FallingPolydisperse),
            (false, true) => self
                .compile_for_lists::<Monodisperse>(system, geometry)
                .unwrap_or_else(|| scheduler!(Monodisperse)),
            (false, false) => self
                .compile_for_lists::<Polydisperse>(system, geometry)
                .unwrap_or_else(|| scheduler!(Polydisperse)),
        }
    }

    /// The engine of [`nearby`], where lists are chosen and it serves the system.
    fn compile_for_lists<F: Features>(
        &self,
        system: &System,
        geometry: &Geometry,
    ) -> Option<Box<dyn Engine>> {
        if self.neighbors != NeighborChoice::Lists {
            return None;
        }
        let engine = Nearby::<F>::new(geometry, self.kernel, system, &self.census, &self.crowd)?;
        Some(Box::new(engine))
    }

    /// The engine for a system whose grains are put to rest.
    fn compile_for_rest(&self, geometry: &Geometry) -> Box<dyn Engine> {
        let (kernel, count) = (self.kernel, self.census.count);
        match self.neighbors {
            NeighborChoice::AllPairs => {
                Box::new(CalendarScheduler::<Settling, AllPairs>::new(geometry, kernel, count))
            }
            NeighborChoice::Lists => {
                Box::new(CalendarScheduler::<Settling, Lists>::new(geometry, kernel, count))
            }
            NeighborChoice::Auto | NeighborChoice::Cells | NeighborChoice::Windows => {
                Box::new(CalendarScheduler::<Settling, Cells>::new(geometry, kernel, count))
            }
        }
    }
}
