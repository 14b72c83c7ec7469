//! The choice of a scheduler for a state, compiled for the features of the system.
//!
//! The choice (its measured limits, and all numbers of particles that follow caches, are in
//! `numerics/tuning.rs`): all pairs up to 12 particles; windows for closed boxes from 100 particles on (also
//! in sheared boxes, with cells for the rest), if speeds, sizes and walls are within
//! `windows::is_profitable`, up to a packing fraction of 0.24 (disks: 0.3), from 15,000 particles on 0.29
//! (0.34), and of 0.46 (0.7) where sizes differ by more than twice; lists above that, and elsewhere above
//! 0.18 (disks: 0.42; unequal sizes: 0.26 and 0.5); cells for the rest. The packing fraction is the one
//! around the average particle (`summary::LocalDensity`), not that of the box. Every 16 collisions a
//! particle, or earlier if a scheduler takes too many entries for them, the choice is made again.
//! `engine.neighbors` overrules it, and is refused (`EngineError::Unsuitable`) where that search cannot run
//! the system.

use glam::DVec3;
use haff_neighbors::{AllPairs, Cells, DeformingCells, DeformingPairs, Geometry};

use crate::{
    laws::event::{AnyEvent, Impact},
    model::{
        Boundary, NeighborChoice, Options, System,
        features::{
            Damped, DeformingMonodisperse, DeformingPolydisperse, ElasticMonodisperse, FallingMonodisperse,
            FallingPolydisperse, Features, Monodisperse, Polydisperse, Pressed, Settling,
        },
        thresholds::Thresholds,
    },
    numerics::error::EngineError,
    numerics::tuning::{cells, lists_above, particles},
    search::{
        batch::Kernel,
        calendar_scheduler::CalendarScheduler,
        case::Case,
        event_loop::Engine,
        lists::{self, ListSearch, ListedEvent},
        matrix::Search,
        pistons::WithPistons,
        summary::{LocalDensity, SystemSummary},
        windows::{self, Windows},
    },
    state::{deformation::Deformation, surroundings::can_carry, world::World},
};

/// A scheduler is replaced only when the density is beyond the limit by this factor: frequent changes back
/// and forth cost more than they gain.
const HYSTERESIS: f64 = 1.15;
/// An engine is built again when the density around the average particle has changed by this factor.
const DENSITY_CHANGE: f64 = 2.0;
/// Packing fractions below this are treated as equal to it.
const SPARSE: f64 = 1e-9;
/// The choice is made again after this many collisions per particle, plus [`REVIEW`]: it takes less than a
/// hundredth of their time.
const REVIEW_PER_PARTICLE: u64 = 16;
/// See [`REVIEW_PER_PARTICLE`].
const REVIEW: u64 = 2000;
/// Sizes are wide if radii differ by more than this factor.
const WIDE: f64 = 2.0;
/// The choice is made again earlier if a scheduler takes more entries than this per collision: then windows
/// are too short, or collisions are rare.
const ENTRIES: u64 = 2;

/// The choice of a scheduler, and the data that it is based on.
pub(crate) struct Choice {
    pub summary: SystemSummary,
    pub kernel: Kernel,
    /// The search that the caller requests.
    requested: NeighborChoice,
    /// The number of blocks that the caller requests.
    blocks: Option<u16>,
    /// The present choice; none before the first one.
    search: Option<Search>,
    /// The local density when this choice was made.
    density: LocalDensity,
    /// Total number of collisions after which the choice is made again.
    pub review: u64,
    /// Number of further entries after which the choice is made again.
    pub entries_left: u64,
}

impl Choice {
    /// Chooses for the present state of a world.
    ///
    /// # Errors
    /// The search that the caller requests cannot run the system.
    pub fn new(
        options: Options,
        kernel: Kernel,
        system: &System,
        world: &World,
    ) -> Result<Self, EngineError> {
        let summary = SystemSummary::of(system, world);
        let density = LocalDensity::of(system, &summary, world);
        let mut choice = Self {
            summary,
            kernel,
            requested: options.neighbors,
            blocks: options.blocks,
            search: None,
            density,
            review: 0,
            entries_left: 0,
        };
        let case = Case { system, summary: &summary, density: &density, world };
        match Search::of(options.neighbors, &case) {
            Err(reason) if !reason.passes => {
                return Err(EngineError::Unsuitable {
                    choice: options.neighbors.name(),
                    why: reason.text.into_owned(),
                });
            }
            _ => choice.search = Some(choice.best(&case)),
        }
        Ok(choice)
    }

    /// [`Self::new`] for particles that come and go. Where the search that is asked for cannot run those that
    /// are there now, another one does, such as for lists a particle that is too large for them.
    pub fn of_passing(
        options: Options,
        kernel: Kernel,
        system: &System,
        world: &World,
    ) -> Result<Self, EngineError> {
        let any = Options { neighbors: NeighborChoice::Auto, ..options };
        Self::new(options, kernel, system, world).or_else(|_| Self::new(any, kernel, system, world))
    }

    /// Makes the choice again. Returns whether the engine has to be replaced, by another scheduler or by the
    /// same one for the present density.
    pub fn reconsider(&mut self, system: &System, world: &World) -> bool {
        let density = LocalDensity::of(system, &self.summary, world);
        let case = Case { system, summary: &self.summary, density: &density, world };
        let search = Some(self.best(&case));
        // In open space the density is 0 if no particle has neighbors.
        let ratio = density.packing.max(SPARSE) / self.density.packing.max(SPARSE);
        let changed = search != self.search
            || self.search != Some(Search::AllPairs)
                && !(1.0 / DENSITY_CHANGE..=DENSITY_CHANGE).contains(&ratio);
        if changed {
            (self.search, self.density) = (search, density);
            self.log(system, world);
        }
        changed
    }

    /// [`Self::reconsider`] for an engine that is made again in any case, for the present edges of a box: it
    /// is made for the present density.
    pub fn renew(&mut self, system: &System, world: &World) {
        if !self.reconsider(system, world) {
            self.density = LocalDensity::of(system, &self.summary, world);
        }
    }

    /// The state for which the choice was made.
    pub fn case<'a>(&'a self, system: &'a System, world: &'a World) -> Case<'a> {
        Case { system, summary: &self.summary, density: &self.density, world }
    }

    /// Writes to the log what has been chosen, and which searches cannot run the state.
    pub fn log(&self, system: &System, world: &World) {
        let case = self.case(system, world);
        let possible = |search: Search| match search.can_run(&case) {
            Ok(()) => "possible".to_owned(),
            Err(reason) => reason.text.into_owned(),
        };
        tracing::info!(
            search = self.search().name(),
            asked = self.requested.name(),
            particles = self.summary.count,
            packing_fraction_around = self.density.packing,
            lists = possible(Search::Lists),
            windows = possible(Search::Windows),
            kernel = ?self.kernel,
            "engine"
        );
    }

    /// The present choice.
    pub fn search(&self) -> Search {
        self.search.unwrap_or(Search::Cells)
    }

    /// Volume that the particles fill at the density around the average particle [length^d].
    pub fn filled(&self) -> f64 {
        self.summary.occupied / self.density.packing
    }

    /// Sets when the choice is made again, if `collisions` have happened so far.
    pub fn after(&mut self, collisions: u64) {
        let interval = REVIEW + REVIEW_PER_PARTICLE * self.summary.count as u64;
        (self.review, self.entries_left) = (collisions + interval, ENTRIES * interval);
    }

    /// The best search for a state: lists for dense states, windows for other states that they can run, cells
    /// otherwise.
    fn best(&self, case: &Case) -> Search {
        let &Case { system, density, .. } = case;
        if self.requested != NeighborChoice::Auto {
            return Search::of(self.requested, case).unwrap_or(Search::Cells);
        }
        if self.summary.count <= particles::ALL_PAIRS {
            return Search::AllPairs;
        }
        let windows =
            Search::Windows.can_run(case).is_ok() && windows::is_profitable(system, &self.summary, density);
        let lists = lists::is_profitable(case);
        let mixed = self.summary.least != self.summary.largest;
        let is_wide = self.summary.largest > WIDE * self.summary.least;
        let limits = match Deformation::of(system) {
            Some(images) if !images.stretches() && windows => lists_above::WINDOWS_SHEARED,
            Some(images) if !images.stretches() => lists_above::CELLS_SHEARED,
            Some(_) if !windows => lists_above::CELLS_STRETCHED,
            Some(_) if !is_wide => lists_above::WINDOWS_STRETCHED,
            _ if windows && is_wide => lists_above::WINDOWS_WIDE,
            _ if windows && self.summary.count < particles::PREFETCH_LISTS => lists_above::WINDOWS,
            _ if windows => lists_above::WINDOWS_LARGE,
            _ if mixed => lists_above::CELLS_MIXED,
            _ => lists_above::CELLS,
        };
        let hysteresis = match self.search {
            None => 1.0,
            Some(Search::Lists) => 1.0 / HYSTERESIS,
            Some(_) => HYSTERESIS,
        };
        let axes = system.dimension.count();
        let is_dense = density.packing > limits.of(axes) * hysteresis;
        // The width of cells follows from the largest particles, the shell of lists from the mean one.
        let are_cells_full = !windows
            && mixed
            && self.candidates_of_cells(system, density) > cells::FULL.of(axes) * hysteresis;
        if lists && (is_dense || are_cells_full) {
            Search::Lists
        } else if windows || are_cells_full && Search::Windows.can_run(case).is_ok() {
            Search::Windows
        } else {
            Search::Cells
        }
    }

    /// Mean number of particles in the cells around a particle.
    fn candidates_of_cells(&self, system: &System, density: &LocalDensity) -> f64 {
        let SystemSummary { count, occupied, contact, .. } = self.summary;
        let (axes, count) = (system.dimension.count(), count as f64);
        let volume = occupied / density.packing;
        let width = contact.max(self.summary.spacing(density.packing));
        let block: f64 = (0..axes)
            .map(|axis| match system.domain.boundary[axis] {
                Boundary::Open => 3.0 * width,
                Boundary::Periodic | Boundary::Wall => system.domain.size[axis].min(3.0 * width),
            })
            .product();
        count * (block / volume).min(1.0)
    }

    /// Whether the engine is one for particles of one size.
    fn is_uniform(&self) -> bool {
        self.summary.uniform && self.kernel.has_engines_of_one_size()
    }

    /// The engine for the features of the system.
    pub fn compile(&self, system: &System, geometry: &Geometry) -> Box<dyn Engine> {
        let Self { summary, kernel, density, .. } = self;
        let search = self.search();
        macro_rules! scheduler {
            ($features:ty) => {{
                let (kernel, count) = (*kernel, summary.count);
                match search {
                    Search::Windows => Box::new(Windows::<$features>::new(
                        geometry,
                        kernel,
                        system,
                        summary,
                        density,
                        self.blocks,
                    )) as Box<dyn Engine>,
                    // Very small systems need no special engine for equal sizes.
                    Search::AllPairs if <$features>::GRAVITY => {
                        Box::new(CalendarScheduler::<FallingPolydisperse, AllPairs>::new(
                            geometry, kernel, count,
                        ))
                    }
                    Search::AllPairs if <$features>::DAMPED => {
                        Box::new(CalendarScheduler::<Damped, AllPairs>::new(geometry, kernel, count))
                    }
                    Search::AllPairs => {
                        Box::new(CalendarScheduler::<Polydisperse, AllPairs>::new(geometry, kernel, count))
                    }
                    Search::Cells | Search::Lists => {
                        Box::new(CalendarScheduler::<$features, Cells>::new(geometry, kernel, count))
                    }
                }
            }};
        }
        if system.piston_count() > 0 {
            return self.compile_with_pistons(system, geometry);
        }
        if Thresholds::of(system).is_some() {
            return self.compile_for_rest(system, geometry);
        }
        if Deformation::of(system).is_some() {
            return self.compile_for_deformation(system, geometry);
        }
        if system.drag.is_some() {
            return self.compile_for_lists::<Damped, Impact>(system).unwrap_or_else(|| scheduler!(Damped));
        }
        let gravity = system.domain.gravity != DVec3::ZERO || can_carry(system);
        // The elastic engine keeps no times of contacts, which a law may need after a change.
        let is_elastic = system.contacts.are_elastic() && system.contacts.tc == 0.0;
        if !gravity && self.is_uniform() && is_elastic && system.spin.is_none() {
            if search == Search::Windows {
                return Box::new(Windows::<ElasticMonodisperse>::new(
                    geometry,
                    *kernel,
                    system,
                    summary,
                    density,
                    self.blocks,
                ));
            }
            if let Some(engine) = self.compile_for_lists::<ElasticMonodisperse, Impact>(system) {
                return engine;
            }
        }
        match (gravity, self.is_uniform()) {
            (true, true) => self
                .compile_for_lists::<FallingMonodisperse, AnyEvent>(system)
                .unwrap_or_else(|| scheduler!(FallingMonodisperse)),
            (true, false) => self
                .compile_for_lists::<FallingPolydisperse, AnyEvent>(system)
                .unwrap_or_else(|| scheduler!(FallingPolydisperse)),
            (false, true) => self
                .compile_for_lists::<Monodisperse, Impact>(system)
                .unwrap_or_else(|| scheduler!(Monodisperse)),
            (false, false) => self
                .compile_for_lists::<Polydisperse, Impact>(system)
                .unwrap_or_else(|| scheduler!(Polydisperse)),
        }
    }

    /// The engine of [`crate::search::lists`], if it is chosen and can run the system at the present
    /// density.
    fn compile_for_lists<F: Features, E: ListedEvent + 'static>(
        &self,
        system: &System,
    ) -> Option<Box<dyn Engine>> {
        if self.search != Some(Search::Lists) {
            return None;
        }
        let engine = ListSearch::<F, E>::new(self.kernel, system, &self.summary, &self.density, self.blocks);
        debug_assert!(engine.is_ok(), "lists are chosen, but cannot run the system");
        Some(Box::new(engine.ok()?))
    }

    /// The engine for a box that deforms.
    fn compile_for_deformation(&self, system: &System, geometry: &Geometry) -> Box<dyn Engine> {
        if self.is_uniform() {
            self.compile_deforming::<DeformingMonodisperse>(system, geometry)
        } else {
            self.compile_deforming::<DeformingPolydisperse>(system, geometry)
        }
    }

    fn compile_deforming<F: Features>(&self, system: &System, geometry: &Geometry) -> Box<dyn Engine> {
        let Self { kernel, summary, density, .. } = self;
        match self.search {
            Some(Search::AllPairs) => {
                Box::new(CalendarScheduler::<DeformingPolydisperse, DeformingPairs>::new(
                    geometry,
                    *kernel,
                    summary.count,
                ))
            }
            Some(Search::Lists) if let Some(engine) = self.compile_for_lists::<F, Impact>(system) => engine,
            Some(Search::Windows) => {
                Box::new(Windows::<F>::new(geometry, *kernel, system, summary, density, self.blocks))
            }
            _ => Box::new(CalendarScheduler::<F, DeformingCells>::new(geometry, *kernel, summary.count)),
        }
    }

    /// The engine for a system with pistons.
    fn compile_with_pistons(&self, system: &System, geometry: &Geometry) -> Box<dyn Engine> {
        let (kernel, count) = (self.kernel, self.summary.count);
        let pistons = system.pistons().map(|(wall, _)| wall);
        if self.search == Some(Search::AllPairs) {
            let scheduler = CalendarScheduler::<Pressed, AllPairs>::new(geometry, kernel, count);
            return Box::new(WithPistons::new(scheduler, pistons));
        }
        let scheduler = CalendarScheduler::<Pressed, Cells>::new(geometry, kernel, count);
        Box::new(WithPistons::new(scheduler, pistons))
    }

    /// The engine for a system whose grains can come to rest.
    fn compile_for_rest(&self, system: &System, geometry: &Geometry) -> Box<dyn Engine> {
        let (kernel, count) = (self.kernel, self.summary.count);
        if let Some(engine) = self.compile_for_lists::<Settling, AnyEvent>(system) {
            return engine;
        }
        match self.search {
            Some(Search::AllPairs) => {
                Box::new(CalendarScheduler::<Settling, AllPairs>::new(geometry, kernel, count))
            }
            _ => Box::new(CalendarScheduler::<Settling, Cells>::new(geometry, kernel, count)),
        }
    }
}
