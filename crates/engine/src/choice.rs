//! The choice of a scheduler for a state, compiled for what the system needs.

use glam::DVec3;
use haff_neighbors::{AllPairs, Cells, Geometry, Lists};

use crate::{
    batch::Kernel,
    calendar_scheduler::CalendarScheduler,
    event_loop::Engine,
    features::{
        ElasticMonodisperse, FallingMonodisperse, FallingPolydisperse, Features, Monodisperse, Polydisperse,
        Settling,
    },
    model::{NeighborChoice, System},
    nearby::{self, Nearby},
    particles::World,
    rest::thresholds::Thresholds,
    summary::{LocalDensity, SystemSummary},
    tuning::{dense, particles},
    windows::{self, Windows},
};

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
    pub summary: SystemSummary,
    kernel: Kernel,
    /// The choice of the caller.
    asked: NeighborChoice,
    /// The present choice, and the local density when it was made.
    pub neighbors: NeighborChoice,
    density: LocalDensity,
    /// Collisions, in all, and further entries after which the choice is made again.
    pub review: u64,
    pub patience: u64,
}

impl Choice {
    /// Chooses for the present state of a world.
    pub fn new(asked: NeighborChoice, kernel: Kernel, system: &System, world: &World) -> Self {
        let summary = SystemSummary::of(system, world);
        let density = LocalDensity::of(system, &summary, world);
        let mut choice =
            Self { summary, kernel, asked, neighbors: NeighborChoice::Auto, density, review: 0, patience: 0 };
        choice.neighbors = choice.best(system, world, &density);
        choice
    }

    /// Makes the choice again. Whether another scheduler, or the same with a new layout, is to go on.
    pub fn reconsider(&mut self, system: &System, world: &World) -> bool {
        let density = LocalDensity::of(system, &self.summary, world);
        let neighbors = self.best(system, world, &density);
        // A few particles in open space may have no neighbors.
        let ratio = density.packing.max(SPARSE) / self.density.packing.max(SPARSE);
        let anew = neighbors != self.neighbors
            || self.neighbors != NeighborChoice::AllPairs && !(1.0 / CHANGED..=CHANGED).contains(&ratio);
        if anew {
            (self.neighbors, self.density) = (neighbors, density);
        }
        anew
    }

    /// Volume that the particles would fill at the density around the average one [length^d].
    pub fn filled(&self) -> f64 {
        self.summary.occupied / self.density.packing
    }

    /// Sets when the choice is made again.
    pub fn after(&mut self, collisions: u64) {
        let interval = REVIEW + REVIEW_PER_PARTICLE * self.summary.count as u64;
        (self.review, self.patience) = (collisions + interval, ENTRIES * interval);
    }

    /// The search for a state: windows where they serve and it is not dense, lists where it is, cells
    /// otherwise.
    fn best(&self, system: &System, world: &World, density: &LocalDensity) -> NeighborChoice {
        let windows_possible =
            windows::unsuitable(system, &self.summary).is_none() && windows::supports(world);
        match self.asked {
            NeighborChoice::Auto => {}
            NeighborChoice::Windows if !windows_possible => return NeighborChoice::Cells,
            asked => return asked,
        }
        if self.summary.count <= particles::ALL_PAIRS {
            return NeighborChoice::AllPairs;
        }
        let windows = windows_possible && windows::is_profitable(system, &self.summary, density);
        let mixed = self.summary.least != self.summary.largest;
        let limits = match (windows, mixed) {
            (true, _) if nearby::supports(system, &self.summary) => {
                if self.summary.count < particles::PREFETCH_LISTS {
                    dense::WINDOWS
                } else {
                    dense::WINDOWS_LARGE
                }
            }
            (true, _) if system.domain.gravity != DVec3::ZERO => dense::WINDOWS_FALLING,
            (true, _) if nearby::is_wide(&self.summary) => dense::WINDOWS_WIDE,
            (true, _) => dense::WINDOWS_OTHER,
            (false, true) => dense::CELLS_MIXED,
            (false, false) => dense::CELLS,
        };
        let hysteresis = match self.neighbors {
            NeighborChoice::Auto => 1.0,
            NeighborChoice::Lists => 1.0 / HYSTERESIS,
            _ => HYSTERESIS,
        };
        let limit = limits.of(system.dimension.count()) * hysteresis;
        if density.packing > limit && self.summary.count <= Lists::MAX_PARTICLES {
            NeighborChoice::Lists
        } else if windows {
            NeighborChoice::Windows
        } else {
            NeighborChoice::Cells
        }
    }

    /// The engine for what the system needs.
    pub fn compile(&self, system: &System, geometry: &Geometry) -> Box<dyn Engine> {
        let Self { summary, kernel, density, neighbors, .. } = self;
        tracing::info!(
            search = neighbors.name(),
            asked = self.asked.name(),
            particles = summary.count,
            packing_fraction_around = density.packing,
            windows = windows::unsuitable(system, summary).as_deref().unwrap_or("possible"),
            ?kernel,
            "engine"
        );
        macro_rules! scheduler {
            ($features:ty) => {{
                let (kernel, count) = (*kernel, summary.count);
                match neighbors {
                    NeighborChoice::Windows => {
                        Box::new(Windows::<$features>::new(geometry, kernel, system, summary, density))
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
        if !gravity && summary.uniform && system.contacts.are_elastic() {
            if *neighbors == NeighborChoice::Windows {
                return Box::new(Windows::<ElasticMonodisperse>::new(
                    geometry, *kernel, system, summary, density,
                ));
            }
            if let Some(engine) = self.compile_for_lists::<ElasticMonodisperse>(system, geometry) {
                return engine;
            }
        }
        match (gravity, summary.uniform) {
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
        let engine = Nearby::<F>::new(geometry, self.kernel, system, &self.summary, &self.density)?;
        Some(Box::new(engine))
    }

    /// The engine for a system whose grains are put to rest.
    fn compile_for_rest(&self, geometry: &Geometry) -> Box<dyn Engine> {
        let (kernel, count) = (self.kernel, self.summary.count);
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
