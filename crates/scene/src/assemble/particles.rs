//! Particles: numbers, sizes and masses.

use std::collections::HashMap;
use std::path::PathBuf;

use glam::DVec3;
use haff_engine::{Body, Class, Dimension};

use super::Assembler;
use super::names::Names;
use super::sizes::RadiusLaw;
use super::values::{at, item, mass, not_negative, positive, storable};
use crate::config::{InitialConfig, PackingConfig, PositionsConfig};
use haff_placement::random::{Purpose, Stream};
use haff_placement::room::Region;

/// Mass of a body, given or from its density.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum MassLaw {
    Mass(f64),
    Density(f64),
}

impl MassLaw {
    pub(super) fn of(self, radius: f64, dimension: Dimension) -> f64 {
        match self {
            Self::Mass(mass) => mass,
            Self::Density(density) => density * dimension.volume(radius),
        }
    }
}

pub(super) struct SpeciesPlan {
    pub(super) name: String,
    pub(super) count: usize,
    pub(super) radius: RadiusLaw,
    pub(super) mass: MassLaw,
    pub(super) temperature: Option<f64>,
    pub(super) region: Option<Region>,
}

pub(super) struct ParticlePlan {
    position: DVec3,
    velocity: DVec3,
    radius: f64,
    pub(super) mass: MassLaw,
}

pub(super) struct Initial {
    pub(super) positions: Option<PositionsConfig>,
    pub(super) temperature: Option<f64>,
}

impl Initial {
    /// The state file that the species start from.
    pub(super) fn state_file(&self) -> Option<PathBuf> {
        match &self.positions {
            Some(PositionsConfig::File(file)) => file.file.as_ref().map(PathBuf::from),
            _ => None,
        }
    }
}

/// Bodies under construction, species first.
pub(super) struct Rows {
    pub(super) bodies: Vec<Body>,
    pub(super) classes: Vec<Class>,
    /// Rows of species; the rest are explicit particles.
    pub(super) species: usize,
    pub(super) index: HashMap<(u64, u64, u32), u32>,
}

impl Rows {
    pub(super) fn radius(&self, row: usize) -> f64 {
        self.classes[self.bodies[row].class as usize].radius
    }

    pub(super) fn mass(&self, row: usize) -> f64 {
        self.classes[self.bodies[row].class as usize].mass
    }

    /// Whether a body has infinite mass.
    pub(super) fn is_fixed(&self, row: usize) -> bool {
        self.mass(row) == f64::INFINITY
    }

    pub(super) fn largest_radius(&self) -> f64 {
        self.classes.iter().map(|class| class.radius).fold(0.0, f64::max)
    }

    /// Volume of a body [length³], in two dimensions its area [length²].
    pub(super) fn volume(&self, row: usize, dimension: Dimension) -> f64 {
        dimension.volume(self.radius(row))
    }

    pub(super) fn class(&mut self, radius: f64, mass: f64, group: u32) -> u32 {
        let classes = &mut self.classes;
        *self.index.entry((radius.to_bits(), mass.to_bits(), group)).or_insert_with(|| {
            classes.push(Class { radius, mass, group });
            classes.len() as u32 - 1
        })
    }

    fn push(&mut self, position: DVec3, velocity: DVec3, radius: f64, mass: f64, group: u32) {
        let class = self.class(radius, mass, group);
        self.bodies.push(Body { position, velocity, image: [0; 3], class, species: group });
    }
}

impl Assembler<'_> {
    pub(super) fn species_plans(&mut self) -> Vec<SpeciesPlan> {
        let configs = self.config.species.clone().unwrap_or_default();
        let mut plans = Vec::with_capacity(configs.len());
        for (k, config) in configs.iter().enumerate() {
            let path = |key: &str| item("species", k, key);
            let count = match config.count {
                // Which species may have none is checked with the inlets.
                Some(count) if count >= 0 => count as usize,
                Some(_) => {
                    self.document.refuse(&path("count"), "must be 1 or more");
                    1
                }
                None => {
                    self.document.report_missing(&path("count"), "missing: the number of particles");
                    1
                }
            };
            let radius = self.radius_law(k, config.radius.as_ref());
            let mass = self.mass_law("species", k, config.mass, config.density);
            if let Some(temperature) = config.temperature {
                not_negative(&mut self.document, &path("temperature"), temperature);
            }
            let region = config.region.as_ref().and_then(|region| self.region(k, region));
            let name = config.name.clone().unwrap_or_default();
            let temperature = config.temperature;
            plans.push(SpeciesPlan { name, count, radius, mass, temperature, region });
        }
        plans
    }

    fn mass_law(&mut self, list: &str, k: usize, given: Option<f64>, density: Option<f64>) -> MassLaw {
        let path = |key: &str| item(list, k, key);
        match (given, density) {
            (Some(_), Some(_)) => {
                self.document.report(&path("density"), "contradicts mass: give one of the two");
                MassLaw::Mass(1.0)
            }
            (Some(value), None) => {
                mass(&mut self.document, &path("mass"), value);
                MassLaw::Mass(value)
            }
            (None, Some(value)) => {
                positive(&mut self.document, &path("density"), value);
                MassLaw::Density(value)
            }
            (None, None) => {
                if !self.document.was_reported(&path("density")) {
                    self.document.report_missing(&path("mass"), "missing: give mass or density");
                }
                MassLaw::Mass(1.0)
            }
        }
    }

    pub(super) fn particle_plans(&mut self) -> Vec<ParticlePlan> {
        let configs = self.config.particle.clone().unwrap_or_default();
        let mut plans = Vec::with_capacity(configs.len());
        for (k, config) in configs.iter().enumerate() {
            let path = |key: &str| item("particle", k, key);
            let position = if let Some(position) = &config.position {
                self.vector(&path("position"), position)
            } else {
                self.document.report_missing(&path("position"), "missing: where the particle is");
                DVec3::ZERO
            };
            let velocity = match &config.velocity {
                Some(velocity) => self.vector(&path("velocity"), velocity),
                None => DVec3::ZERO,
            };
            let radius = if let Some(radius) = config.radius {
                positive(&mut self.document, &path("radius"), radius);
                radius
            } else {
                self.document.report_missing(&path("radius"), "missing: a particle needs a radius");
                1.0
            };
            let mass = self.mass_law("particle", k, config.mass, config.density);
            plans.push(ParticlePlan { position, velocity, radius, mass });
        }
        plans
    }

    pub(super) fn initial(&mut self, species: usize) -> Initial {
        if let Some(temperature) = self.config.initial.as_ref().and_then(|initial| initial.temperature) {
            not_negative(&mut self.document, &at(["initial", "temperature"]), temperature);
        }
        if species == 0 {
            return Initial { positions: None, temperature: None };
        }
        let regions = self.config.species.iter().flatten().filter(|species| species.region.is_some()).count();
        let usual = if regions > 0 { PackingConfig::Random } else { PackingConfig::Lattice };
        let initial = self.config.initial.get_or_insert_with(InitialConfig::default);
        let positions = initial.positions.get_or_insert(PositionsConfig::Packing(usual)).clone();
        if regions > 0 && positions != PositionsConfig::Packing(PackingConfig::Random) {
            let why = "must be \"random\" for species with a region";
            self.document.report(&at(["initial", "positions"]), why);
        }
        let path = at(["initial", "positions"]);
        match &positions {
            PositionsConfig::File(file) => {
                if file.file.as_ref().is_none_or(String::is_empty) {
                    self.document.report_missing(&path, "must name a file: { file = \"state.h5\" }");
                }
                storable(&mut self.document, &path, file.file.as_deref().unwrap_or_default());
                if file.packing.is_some() {
                    self.document.report(&path, "is either a packing or a file: give one of the two");
                }
            }
            PositionsConfig::Grown(grown) => {
                initial.temperature.get_or_insert(1.0);
                if !grown.packing.is_some_and(|fraction| fraction > 0.0 && fraction < 1.0) {
                    self.document.refuse(&path, "must have a packing in (0, 1)");
                }
            }
            PositionsConfig::Packing(packing) => {
                initial.temperature.get_or_insert(1.0);
                if *packing == PackingConfig::Fcc && self.dimension == Dimension::Two {
                    self.document.report(&path, "is a lattice of three dimensions; take \"hexagonal\"");
                } else if *packing == PackingConfig::Hexagonal && self.dimension == Dimension::Three {
                    self.document.report(&path, "is a lattice of two dimensions; take \"fcc\"");
                }
            }
        }
        let temperature = self.config.initial.as_ref().and_then(|initial| initial.temperature);
        Initial { positions: Some(positions), temperature }
    }

    /// Checks that there are particles, and not more than fit into memory.
    pub(super) fn count_particles(&mut self, species: &[SpeciesPlan], explicit: usize, to_come: usize) {
        if species.is_empty() && explicit == 0 {
            let path = at([if self.config.particle.is_some() { "particle" } else { "species" }]);
            self.document.report_missing(&path, "no particles: give [[species]] or [[particle]]");
        }
        let mut total = explicit as u64;
        for (k, plan) in species.iter().enumerate() {
            total = total.saturating_add(plan.count as u64);
            if total > self.limits.particles {
                let text = format!(
                    "too many particles: {total} so far, the memory of this machine holds about {}",
                    self.limits.particles
                );
                self.document.report(&item("species", k, "count"), text);
                return;
            }
        }
        total = total.saturating_add(to_come as u64);
        if total > self.limits.particles {
            let text = format!(
                "too many particles: {total} with those that come in, the memory of this machine holds about {}",
                self.limits.particles
            );
            self.document.report(&at(["inlet"]), text);
        }
    }

    /// Radii, masses and classes of all rows.
    pub(super) fn draw_rows(
        &mut self,
        species: &[SpeciesPlan],
        explicit: &[ParticlePlan],
        names: &Names,
    ) -> Rows {
        let total: usize = species.iter().map(|plan| plan.count).sum();
        let mut rows = Rows {
            bodies: Vec::with_capacity(total + explicit.len()),
            classes: Vec::new(),
            species: total,
            index: HashMap::new(),
        };
        for (k, plan) in species.iter().enumerate() {
            for i in 0..plan.count {
                let mut random = Stream::new(self.seed, Purpose::Radius, &plan.name, i);
                let radius = plan.radius.draw(i, &mut random);
                let mass = plan.mass.of(radius, self.dimension);
                rows.push(DVec3::ZERO, DVec3::ZERO, radius, mass, k as u32);
            }
            if let MassLaw::Density(_) = plan.mass
                && plan
                    .radius
                    .range()
                    .iter()
                    .any(|&r| !(1e-200..=1e200).contains(&plan.mass.of(r, self.dimension)))
            {
                self.document.report(&item("species", k, "density"), "makes a mass out of range");
            }
        }
        for (k, plan) in explicit.iter().enumerate() {
            let mass = plan.mass.of(plan.radius, self.dimension);
            if !(1e-200..=f64::INFINITY).contains(&mass) {
                self.document.report(&item("particle", k, "density"), "makes a mass out of range");
            }
            rows.push(plan.position, plan.velocity, plan.radius, mass, names.of_particle[k]);
        }
        rows
    }
}
