//! Particles: sizes and masses, places, velocities.

use std::collections::HashMap;
use std::f64::consts::PI;
use std::path::Path;

use glam::DVec3;
use haff_engine::{Body, Boundary, Class, Dimension, Domain, Wall};

use super::contact::Names;
use super::domain::TOLERANCE;
use super::values::{at, item, mass, not_negative, positive};
use super::{Builder, Refused};
use crate::config::{InitialConfig, PackingConfig, PositionsConfig, RadiusConfig};
use crate::grid::{Periods, overlaps};
use crate::packing::{Room, lattice::lattice, loose};
use crate::random::{Purpose, Stream};
use crate::state::State;
use crate::velocity::{Bath, equilibrate, maxwell};

/// Overlaps named one by one; the rest are counted.
const NAMED_OVERLAPS: usize = 20;

/// How radii of a species come about.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum RadiusLaw {
    Fixed(f64),
    Uniform(f64, f64),
    Normal { mean: f64, sd: f64, min: f64, max: f64 },
}

impl RadiusLaw {
    pub(super) fn is_fixed(self) -> bool {
        matches!(self, Self::Fixed(_))
    }

    /// Smallest and largest radius.
    fn range(self) -> [f64; 2] {
        match self {
            Self::Fixed(radius) => [radius, radius],
            Self::Uniform(a, b) => [a, b],
            Self::Normal { min, max, .. } => [min, max],
        }
    }

    fn draw(self, random: &mut Stream) -> f64 {
        match self {
            Self::Fixed(radius) => radius,
            Self::Uniform(a, b) => random.between(a, b),
            Self::Normal { mean, sd, min, max } => {
                (mean + sd * random.truncated_normal((min - mean) / sd, (max - mean) / sd)).clamp(min, max)
            }
        }
    }
}

/// Mass of a body, or what it follows from.
#[derive(Debug, Clone, Copy, PartialEq)]
enum MassLaw {
    Mass(f64),
    Density(f64),
}

impl MassLaw {
    fn of(self, radius: f64, dimension: Dimension) -> f64 {
        match self {
            Self::Mass(mass) => mass,
            Self::Density(density) => density * volume(radius, dimension),
        }
    }
}

pub(super) struct SpeciesPlan {
    name: String,
    pub(super) count: usize,
    pub(super) radius: RadiusLaw,
    mass: MassLaw,
    temperature: Option<f64>,
}

pub(super) struct ParticlePlan {
    position: DVec3,
    velocity: DVec3,
    radius: f64,
    mass: MassLaw,
}

pub(super) struct Initial {
    pub(super) positions: Option<PositionsConfig>,
    temperature: Option<f64>,
}

/// Bodies under construction, species first.
pub(super) struct Rows {
    pub(super) bodies: Vec<Body>,
    pub(super) classes: Vec<Class>,
    /// Rows of species; the rest are explicit particles.
    pub(super) species: usize,
    index: HashMap<(u64, u64, u32), u32>,
}

impl Rows {
    pub(super) fn radius(&self, row: usize) -> f64 {
        self.classes[self.bodies[row].class as usize].radius
    }

    fn mass(&self, row: usize) -> f64 {
        self.classes[self.bodies[row].class as usize].mass
    }

    pub(super) fn largest_radius(&self) -> f64 {
        self.classes.iter().map(|class| class.radius).fold(0.0, f64::max)
    }

    /// Volume of a body [length³], in two dimensions its area [length²].
    pub(super) fn volume(&self, row: usize, dimension: Dimension) -> f64 {
        volume(self.radius(row), dimension)
    }

    fn class(&mut self, radius: f64, mass: f64, group: u32) -> u32 {
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

pub(super) fn volume(radius: f64, dimension: Dimension) -> f64 {
    match dimension {
        Dimension::Two => PI * radius * radius,
        Dimension::Three => 4.0 / 3.0 * PI * radius * radius * radius,
    }
}

impl Builder<'_> {
    pub(super) fn species_plans(&mut self) -> Vec<SpeciesPlan> {
        let configs = self.config.species.clone().unwrap_or_default();
        let mut plans = Vec::with_capacity(configs.len());
        for (k, config) in configs.iter().enumerate() {
            let path = |key: &str| item("species", k, key);
            let count = match config.count {
                Some(count) if count >= 1 => count as usize,
                Some(_) => {
                    self.document.report(&path("count"), "must be 1 or more");
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
            let name = config.name.clone().unwrap_or_default();
            plans.push(SpeciesPlan { name, count, radius, mass, temperature: config.temperature });
        }
        plans
    }

    fn radius_law(&mut self, k: usize, config: Option<&RadiusConfig>) -> RadiusLaw {
        let path = |key: &str| item("species", k, key);
        let fallback = RadiusLaw::Fixed(1.0);
        let distribution = match config {
            None => {
                let why = "missing: a number, { uniform = [a, b] } or { normal = [mean, sd] }";
                self.document.report_missing(&path("radius"), why);
                return fallback;
            }
            Some(RadiusConfig::Fixed(radius)) => {
                positive(&mut self.document, &path("radius"), *radius);
                return RadiusLaw::Fixed(*radius);
            }
            Some(RadiusConfig::Distribution(distribution)) => distribution.clone(),
        };
        let mut pair = |key: &str, values: &[f64]| -> Option<[f64; 2]> {
            let path = path(key);
            let &[a, b] = values else {
                self.document.report(&path, "must have two numbers");
                return None;
            };
            let sound = positive(&mut self.document, &path, a) && positive(&mut self.document, &path, b);
            sound.then_some([a, b])
        };
        match (&distribution.uniform, &distribution.normal) {
            (Some(values), None) => {
                let Some([a, b]) = pair("radius.uniform", values) else { return fallback };
                if a > b {
                    self.document.report(&path("radius.uniform"), "must have the smaller radius first");
                }
                for (key, value) in [("radius.min", distribution.min), ("radius.max", distribution.max)] {
                    if value.is_some() {
                        self.document.report(&path(key), "belongs to normal distributions only");
                    }
                }
                RadiusLaw::Uniform(a, b)
            }
            (None, Some(values)) => {
                let Some([mean, sd]) = pair("radius.normal", values) else { return fallback };
                let min = distribution.min.unwrap_or(0.1 * mean);
                let max = distribution.max.unwrap_or(mean + 8.5 * sd);
                let mut sound = true;
                for (key, value) in [("radius.min", min), ("radius.max", max)] {
                    sound &= positive(&mut self.document, &path(key), value);
                }
                if sound && min > max {
                    self.document.report(&path("radius"), format!("must have min ≤ max, not {min} > {max}"));
                } else if sound && (min > mean + 8.0 * sd || max < mean - 8.0 * sd) {
                    let text = "the range from min to max lies more than 8 standard deviations from the mean";
                    self.document.report(&path("radius"), text);
                }
                RadiusLaw::Normal { mean, sd, min, max }
            }
            (Some(_), Some(_)) => {
                self.document.report(&path("radius"), "contradiction: give uniform or normal, not both");
                fallback
            }
            (None, None) => {
                self.document
                    .report_missing(&path("radius"), "must have uniform = [a, b] or normal = [mean, sd]");
                fallback
            }
        }
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
        let initial = self.config.initial.get_or_insert_with(InitialConfig::default);
        let positions =
            initial.positions.get_or_insert(PositionsConfig::Packing(PackingConfig::Lattice)).clone();
        let path = at(["initial", "positions"]);
        match &positions {
            PositionsConfig::File(file) => {
                if file.file.as_ref().is_none_or(String::is_empty) {
                    self.document.report_missing(&path, "must name a file: { file = \"state.h5\" }");
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

    /// There are particles, and not more than the machine holds.
    pub(super) fn count_particles(&mut self, species: &[SpeciesPlan], explicit: usize) {
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
                break;
            }
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
                let radius = plan.radius.draw(&mut random);
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

    /// The recorded state, if the species start from one; radii and masses of distributions are taken from it.
    pub(super) fn read_state(
        &mut self,
        initial: &Initial,
        species: &[SpeciesPlan],
        rows: &mut Rows,
    ) -> Result<Option<State>, Refused> {
        let Some(PositionsConfig::File(file)) = &initial.positions else { return Ok(None) };
        let path = at(["initial", "positions"]);
        let name = file.file.clone().unwrap_or_default();
        let state = self.states.last_state(Path::new(&name)).map_err(|why| {
            self.document.report(&path, why);
            self.unreadable = true;
            Refused
        })?;
        let n = state.position.len();
        let dimension = self.dimension;
        let mut fail = |message: String| {
            self.document.report(&path, message);
            Err(Refused)
        };
        let lengths = [state.velocity.len(), state.image.len(), state.radius.len(), state.mass.len()];
        if lengths.iter().any(|&length| length != n) {
            return fail(format!(
                "the file holds {n} positions but other numbers of velocities, radii or masses"
            ));
        }
        if n != rows.species && n != rows.bodies.len() {
            return fail(format!("the file holds {n} particles, the species ask for {}", rows.species));
        }
        // What was drawn gives way to what was recorded.
        let drawn = std::mem::take(&mut rows.classes);
        rows.index.clear();
        for row in rows.species..rows.bodies.len() {
            let Class { radius, mass, group } = drawn[rows.bodies[row].class as usize];
            rows.bodies[row].class = rows.class(radius, mass, group);
        }
        let mut row = 0;
        for (k, plan) in species.iter().enumerate() {
            for _ in 0..plan.count {
                let [low, high] = plan.radius.range();
                let radius = state.radius[row];
                let fits = |x: f64, low: f64, high: f64| {
                    x >= low * (1.0 - TOLERANCE) && x <= high * (1.0 + TOLERANCE)
                };
                if !fits(radius, low, high) {
                    return fail(format!(
                        "particle {row} of the file has radius {radius}, species \"{}\" wants {low} to {high}",
                        plan.name
                    ));
                }
                let radius = if plan.radius.is_fixed() { low } else { radius };
                let mass = plan.mass.of(radius, dimension);
                if !(mass == state.mass[row] || fits(state.mass[row], mass, mass)) {
                    let found = state.mass[row];
                    return fail(format!(
                        "particle {row} of the file has mass {found}, species \"{}\" wants {mass}",
                        plan.name
                    ));
                }
                let (position, velocity) = (state.position[row], state.velocity[row]);
                if !(position.is_finite() && velocity.is_finite()) {
                    return fail(format!("particle {row} of the file has no finite position and velocity"));
                }
                if dimension == Dimension::Two && (position.z != 0.0 || velocity.z != 0.0) {
                    return fail(format!("particle {row} of the file leaves the plane z = 0"));
                }
                rows.bodies[row].class = rows.class(radius, mass, k as u32);
                rows.bodies[row].position = position;
                rows.bodies[row].image = state.image[row];
                row += 1;
            }
        }
        Ok(Some(state))
    }

    /// Bodies that have places against the box, the walls and each other.
    pub(super) fn check_places(
        &mut self,
        domain: &Domain,
        walls: &[Wall],
        rows: &mut Rows,
        state: Option<&State>,
    ) {
        let d = self.dimension.count();
        let from_file = at(["initial", "positions"]);
        let periods = Periods::new(domain);
        if let Some(state) = state {
            for axis in 0..d {
                let (here, there) = (domain.size[axis], state.size[axis]);
                if domain.boundary[axis] == Boundary::Periodic
                    && (there.is_nan() || (here - there).abs() > TOLERANCE * here)
                {
                    let name = ["x", "y", "z"][axis];
                    let text =
                        format!("the box of the file is {there} long along {name}, that of the scene {here}");
                    self.document.report(&from_file, text);
                    return;
                }
            }
            for body in &mut rows.bodies[..rows.species] {
                body.position = periods.wrap(body.position);
            }
        }
        let first = if state.is_some() { 0 } else { rows.species };
        for row in first..rows.bodies.len() {
            let (position, radius) = (rows.bodies[row].position, rows.radius(row));
            let path = if row < rows.species {
                from_file.clone()
            } else {
                item("particle", row - rows.species, "position")
            };
            for axis in 0..d {
                let (x, length) = (position[axis], domain.size[axis]);
                if domain.boundary[axis] == Boundary::Periodic && !(0.0..length).contains(&x) {
                    let name = ["x", "y", "z"][axis];
                    let text =
                        format!("particle {row} is outside the box: {name} = {x} must be in [0, {length})");
                    self.document.report(&path, text);
                }
            }
            for wall in walls {
                let distance = (position - wall.point).dot(wall.normal);
                // Rounding of the coordinates themselves counts, far from the origin.
                let slack = TOLERANCE
                    * (radius + wall.point.abs().max_element().max(position.abs().max_element()) * 1e-3);
                if distance < radius - slack {
                    let text = format!(
                        "particle {row} reaches {:.1e} outside wall \"{}\": its centre is {distance} inside, must be at least its radius {radius}",
                        radius - distance,
                        wall.name
                    );
                    self.document.report(&path, text);
                }
            }
        }
        if !self.document.errors.is_empty() {
            return;
        }
        let position: Vec<DVec3> = rows.bodies[first..].iter().map(|body| body.position).collect();
        let radius: Vec<f64> = (first..rows.bodies.len()).map(|row| rows.radius(row)).collect();
        let pairs = overlaps(&position, &radius, periods, TOLERANCE, |_, _| false);
        for (k, pair) in pairs.iter().enumerate().take(NAMED_OVERLAPS) {
            let (i, j) = (pair.i + first, pair.j + first);
            let more = match pairs.len().saturating_sub(NAMED_OVERLAPS) {
                more @ 1.. if k + 1 == NAMED_OVERLAPS => format!("; {more} more pairs overlap"),
                _ => String::new(),
            };
            let text = format!("particles {i} and {j} overlap by {:.1e}{more}", pair.depth);
            let path = if j < rows.species {
                from_file.clone()
            } else {
                item("particle", j - rows.species, "position")
            };
            self.document.report(&path, text);
        }
    }

    /// Puts the species into their packing.
    pub(super) fn place_species(
        &mut self,
        domain: &Domain,
        walls: &[Wall],
        rows: &mut Rows,
        initial: &Initial,
    ) {
        let count = rows.species;
        let Some(PositionsConfig::Packing(packing)) = initial.positions else { return };
        let obstacles: Vec<(DVec3, f64)> =
            (count..rows.bodies.len()).map(|row| (rows.bodies[row].position, rows.radius(row))).collect();
        let listed = self.config.wall.as_ref().map_or(0, Vec::len);
        let planes = &walls[walls.len() - listed..];
        let room = Room { dimension: self.dimension, domain, planes, obstacles: &obstacles };
        let radius: Vec<f64> = (0..count).map(|row| rows.radius(row)).collect();
        let largest = radius.iter().copied().fold(0.0, f64::max);
        let path = at(["initial", "positions"]);
        let sites = if packing == PackingConfig::Random {
            let names: Vec<String> =
                self.config.species.iter().flatten().filter_map(|s| s.name.clone()).collect();
            let mut first = vec![0; names.len()];
            for (row, body) in rows.bodies[..count].iter().enumerate().rev() {
                first[body.species as usize] = row;
            }
            let seed = self.seed;
            let stream = |row: usize| {
                let species = rows.bodies[row].species as usize;
                Stream::new(seed, Purpose::Insertion, &names[species], row - first[species])
            };
            match loose::random(&room, &radius, stream) {
                Ok(sites) => sites,
                Err(overlap) => {
                    let text = format!(
                        "no random packing without overlap was found for {count} particles (deepest left: {overlap:.1e}); \
                         enlarge the box or take \"lattice\""
                    );
                    self.document.report(&path, text);
                    return;
                }
            }
        } else {
            match lattice(&room, count, largest, self.seed) {
                Ok(sites) => self.mixed(sites, rows),
                Err(found) => {
                    let text = format!(
                        "the lattice has room for {found} particles of radius {largest} here, {count} are asked for; \
                         enlarge the box or take \"random\""
                    );
                    self.document.report(&path, text);
                    return;
                }
            }
        };
        for (body, site) in rows.bodies.iter_mut().zip(sites) {
            body.position = site;
        }
    }

    /// Spreads species over lattice sites at random; within a species, sites stay in lattice order.
    fn mixed(&self, sites: Vec<DVec3>, rows: &Rows) -> Vec<DVec3> {
        let mut labels: Vec<u32> = rows.bodies[..rows.species].iter().map(|body| body.species).collect();
        if labels.first() == labels.last() {
            return sites;
        }
        let mut random = Stream::new(self.seed, Purpose::Mixing, "", 0);
        for k in (1..labels.len()).rev() {
            labels.swap(k, random.below(k + 1));
        }
        let mut order: Vec<usize> = (0..sites.len()).collect();
        order.sort_by_key(|&k| labels[k]);
        order.into_iter().map(|k| sites[k]).collect()
    }

    /// Velocities of the species.
    pub(super) fn draw_velocities(
        &mut self,
        species: &[SpeciesPlan],
        rows: &mut Rows,
        initial: &Initial,
        state: Option<&State>,
    ) {
        let mut velocity: Vec<DVec3> = rows.bodies[..rows.species].iter().map(|body| body.velocity).collect();
        let mass: Vec<f64> = (0..rows.species).map(|row| rows.mass(row)).collect();
        // Species at the common temperature form one bath, each of the others its own.
        let mut baths: Vec<Bath> = Vec::new();
        let mut common = Vec::new();
        let mut row = 0;
        for plan in species {
            let rows_here = row..row + plan.count;
            row += plan.count;
            let Some(temperature) = plan.temperature.or(initial.temperature) else {
                if let Some(state) = state {
                    velocity[rows_here.clone()].copy_from_slice(&state.velocity[rows_here]);
                }
                continue;
            };
            let mut members = Vec::with_capacity(plan.count);
            for (i, k) in rows_here.enumerate() {
                if mass[k].is_finite() {
                    velocity[k] = maxwell(self.seed, &plan.name, i, temperature / mass[k], self.dimension);
                    members.push(k);
                }
            }
            if plan.temperature.is_some() {
                baths.push(Bath { temperature, members });
            } else {
                common.extend(members);
            }
        }
        if let Some(temperature) = initial.temperature
            && !common.is_empty()
        {
            baths.push(Bath { temperature, members: common });
        }
        baths.retain(|bath| !bath.members.is_empty());
        if !baths.is_empty() {
            equilibrate(&mut velocity, &mass, &baths, self.dimension);
        }
        for (body, velocity) in rows.bodies.iter_mut().zip(velocity) {
            body.velocity = velocity;
        }
    }
}
