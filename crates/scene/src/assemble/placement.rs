//! Positions and velocities: from a recorded state, by hand, or from a packing and a temperature.

use std::path::Path;

use glam::DVec3;
use haff_engine::{
    Boundary, Class, Contacts, Dimension, Domain, Instant, Wall, WallLaw, bounds, significant,
};

use super::domain::{TOLERANCE, more_room};
use super::motion::is_displaced;
use super::particles::{Initial, Rows, SpeciesPlan};
use super::shear::beside_displaced_images;
use super::values::{at, item};
use super::{Assembler, Refused};
use crate::config::{OutputFileConfig, PackingConfig, PositionsConfig};
use crate::model::state::State;
use crate::placement::growth::{self, Company, packing_fraction};
use crate::placement::import;
use haff_placement::grid::{Periods, overlaps};
use haff_placement::random::{Purpose, Stream};
use haff_placement::velocity::{Bath, equilibrate, maxwell};
use haff_placement::{
    lattice::lattice,
    loose,
    room::{Region, Room},
};

/// Overlaps named one by one; the rest are counted.
const NAMED_OVERLAPS: usize = 20;

impl Assembler<'_> {
    /// The recorded state, if the species start from one; radii and masses of distributions are taken from
    /// it.
    pub(super) fn read_state(
        &mut self,
        initial: &Initial,
        species: &[SpeciesPlan],
        rows: &mut Rows,
    ) -> Result<Option<State>, Refused> {
        let Some(PositionsConfig::File(file)) = &initial.positions else { return Ok(None) };
        let path = at(["initial", "positions"]);
        let name = file.file.clone().unwrap_or_default();
        let state = self.states.state(Path::new(&name), file.index.unwrap_or(-1)).map_err(|why| {
            let hint = import::hint(Path::new(&name));
            self.document.report(&path, why + &hint);
            self.unreadable = true;
            Refused
        })?;
        let state = match &file.scale_to {
            Some(to) => self.scaled(state, to)?,
            None => state,
        };
        let n = state.position.len();
        let tolerance = TOLERANCE.max(state.precision);
        let dimension = self.dimension;
        let mut fail = |message: String| {
            self.document.report(&path, message);
            Err(Refused)
        };
        let lengths = [
            Some(state.radius.len()),
            state.velocity.as_ref().map(Vec::len),
            state.angular_velocity.as_ref().map(Vec::len),
            state.image.as_ref().map(Vec::len),
            state.mass.as_ref().map(Vec::len),
        ];
        if lengths.into_iter().flatten().any(|length| length != n) {
            return fail(format!(
                "the file holds {n} positions but other numbers of velocities, radii or masses"
            ));
        }
        let heated = initial.temperature.is_some() || species.iter().all(|plan| plan.temperature.is_some());
        if state.velocity.is_none() && !heated {
            return fail("the file has no velocities: give initial.temperature".to_owned());
        }
        if n != rows.species && n != rows.bodies.len() {
            return fail(format!("the file holds {n} particles, the species ask for {}", rows.species));
        }
        // Recorded values replace drawn ones.
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
                    x >= low * (1.0 - tolerance) && x <= high * (1.0 + tolerance)
                };
                if !fits(radius, low, high) {
                    return fail(format!(
                        "particle {row} of the file has radius {radius}, species \"{}\" wants {low} to {high}",
                        plan.name
                    ));
                }
                let radius = if plan.radius.is_fixed() { low } else { radius };
                let mass = plan.mass.of(radius, dimension);
                let found = state.mass.as_ref().map_or(mass, |masses| masses[row]);
                if !(mass == found || fits(found, mass, mass)) {
                    return fail(format!(
                        "particle {row} of the file has mass {found}, species \"{}\" wants {mass}",
                        plan.name
                    ));
                }
                let velocity = state.velocity.as_ref().map_or(DVec3::ZERO, |velocities| velocities[row]);
                let position = state.position[row];
                for (name, value) in [("position", position), ("velocity", velocity)] {
                    if let Err((axis, why)) = bounds::vector(value) {
                        return fail(format!(
                            "particle {row} of the file has the {name} {} along {}: it {why}",
                            significant(value[axis], 6),
                            ["x", "y", "z"][axis]
                        ));
                    }
                }
                let spin = state.angular_velocity.as_ref().map_or(DVec3::ZERO, |spins| spins[row]);
                let flat = dimension == Dimension::Two;
                if bounds::vector(spin).is_err() || flat && (spin.x, spin.y) != (0.0, 0.0) {
                    let along = if flat { " along z" } else { "" };
                    return fail(format!(
                        "particle {row} of the file has no angular velocity up to 1e50 in size{along}"
                    ));
                }
                if dimension == Dimension::Two && (position.z != 0.0 || velocity.z != 0.0) {
                    return fail(format!("particle {row} of the file leaves the plane z = 0"));
                }
                rows.bodies[row].class = rows.class(radius, mass, k as u32);
                rows.bodies[row].position = position;
                if let Some(images) = &state.image {
                    rows.bodies[row].image = images[row];
                }
                row += 1;
            }
        }
        Ok(Some(state))
    }

    /// Checks bodies with positions against the box, the walls and each other.
    pub(super) fn check_places(
        &mut self,
        domain: &Domain,
        walls: &[Wall],
        rows: &mut Rows,
        state: Option<&State>,
        contacts: &Contacts,
    ) {
        let d = self.dimension.count();
        let from_file = at(["initial", "positions"]);
        let periods = Periods::new(domain);
        if let Some(state) = state {
            let tolerance = TOLERANCE.max(state.precision);
            for axis in (0..d).filter(|_| state.size.is_some()) {
                let (here, there) = (domain.size[axis], state.size.unwrap_or(domain.size)[axis]);
                if domain.boundary[axis] == Boundary::Periodic
                    && (there.is_nan() || (here - there).abs() > tolerance * here)
                {
                    let name = ["x", "y", "z"][axis];
                    let text =
                        format!("the box of the file is {there} long along {name}, that of the scene {here}");
                    self.document.report(&from_file, text);
                    return;
                }
            }
            for body in &mut rows.bodies[..rows.species] {
                body.position = periods.wrap(beside_displaced_images(domain, body.position));
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
            let group = rows.classes[rows.bodies[row].class as usize].group as usize;
            for (index, wall) in walls.iter().enumerate() {
                if contacts.wall[group * walls.len() + index] == WallLaw::Passes {
                    continue;
                }
                let distance = wall.distance(position, Instant::ZERO);
                // Far from the origin the rounding of coordinates is significant.
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
        if !self.document.is_sound() {
            return;
        }
        let position: Vec<DVec3> = rows.bodies[first..].iter().map(|body| body.position).collect();
        let radius: Vec<f64> = (first..rows.bodies.len()).map(|row| rows.radius(row)).collect();
        // Fixed bodies that share a velocity may overlap each other: they never touch.
        let are_glued = |i: usize, j: usize| {
            let [i, j] = [i + first, j + first];
            rows.is_fixed(i) && rows.is_fixed(j) && rows.bodies[i].velocity == rows.bodies[j].velocity
        };
        let pairs = overlaps(&position, &radius, Periods::aligned(domain), TOLERANCE, &are_glued);
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

    /// Places the species in their packing.
    pub(super) fn place_species(
        &mut self,
        domain: &Domain,
        walls: &[Wall],
        species: &[SpeciesPlan],
        rows: &mut Rows,
        initial: &Initial,
    ) {
        let count = rows.species;
        if count == 0 {
            // All come in by inlets.
            return;
        }
        if let Some(PositionsConfig::Grown(grown)) = &initial.positions {
            self.grow_species(domain, walls, rows, grown.packing.unwrap_or_default());
            return;
        }
        let Some(PositionsConfig::Packing(packing)) = initial.positions else { return };
        let obstacles: Vec<(DVec3, f64)> =
            (count..rows.bodies.len()).map(|row| (rows.bodies[row].position, rows.radius(row))).collect();
        let of_domain = 2 * domain.boundary.iter().filter(|&&boundary| boundary == Boundary::Wall).count();
        let moved = |(index, wall): (usize, &Wall)| {
            let is_plane = index >= of_domain || wall.motion.is_moving() || is_displaced(wall, domain);
            is_plane.then(|| wall.clone())
        };
        let planes: Vec<Wall> = walls.iter().enumerate().filter_map(moved).collect();
        let planes = &planes[..];
        let has_regions = species.iter().any(|plan| plan.region.is_some());
        let bodies = rows.bodies[..count].iter().filter(|_| has_regions);
        let regions: Vec<Option<&Region>> =
            bodies.map(|body| species[body.species as usize].region.as_ref()).collect();
        let room =
            Room { dimension: self.dimension, domain, planes, obstacles: &obstacles, regions: &regions };
        let radius: Vec<f64> = (0..count).map(|row| rows.radius(row)).collect();
        let largest = radius.iter().copied().fold(0.0, f64::max);
        let path = at(["initial", "positions"]);
        let more_room = more_room(self.document.get_is_some(&at(["domain", "packing_fraction"])));
        let sites = if packing == PackingConfig::Random {
            let found = loose::random(&room, &radius, &self.insertion(rows));
            match found {
                Ok(sites) => sites,
                Err(overlap) => {
                    let text = format!(
                        "no random packing without overlap was found for {count} particles (deepest left: {overlap:.1e}); \
                         {more_room}, or take {{ packing = {:.3} }}, which grows, or \"lattice\"",
                        packing_fraction(self.dimension, domain.size, &radius)
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
                        "the lattice has room for {found} particles of radius {largest} here, {count} are required; \
                         {more_room} or take \"random\""
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

    /// The random numbers that place each particle of the species.
    fn insertion(&self, rows: &Rows) -> impl Fn(usize) -> Stream {
        let names: Vec<String> =
            self.config.species.iter().flatten().filter_map(|s| s.name.clone()).collect();
        let species: Vec<u32> = rows.bodies[..rows.species].iter().map(|body| body.species).collect();
        let mut first = vec![0; names.len()];
        for (row, &species) in species.iter().enumerate().rev() {
            first[species as usize] = row;
        }
        let seed = self.seed;
        move |row: usize| {
            let species = species[row] as usize;
            Stream::new(seed, Purpose::Insertion, &names[species], row - first[species])
        }
    }

    /// Places the species in a dense random packing.
    fn grow_species(&mut self, domain: &Domain, walls: &[Wall], rows: &mut Rows, wanted: f64) {
        /// Relative difference of packing fractions that rounding explains.
        const ROUNDING: f64 = 1e-9;
        let path = at(["initial", "positions"]);
        let axes = self.dimension.count();
        let of_domain = 2 * domain.boundary.iter().filter(|&&kind| kind == Boundary::Wall).count();
        let placed = |(index, wall): (usize, &Wall)| index >= of_domain || is_displaced(wall, domain);
        if domain.boundary[..axes].contains(&Boundary::Open) {
            self.document.report(&path, "needs a box without open axes: a packing grows in a closed box");
            return;
        }
        if walls.iter().enumerate().any(placed) || rows.bodies.len() > rows.species {
            let why = "needs a box of its own: it does not work with [[wall]] and [[particle]]";
            self.document.report(&path, why);
            return;
        }
        let radius: Vec<f64> = (0..rows.species).map(|row| rows.radius(row)).collect();
        let given = packing_fraction(self.dimension, domain.size, &radius);
        if (given / wanted - 1.0).abs() > ROUNDING {
            let what = format!(
                "packing = {wanted} contradicts the box, in which the packing fraction is {}: leave domain.size and domain.packing_fraction out",
                significant(given, 6)
            );
            self.document.report(&path, what);
            return;
        }
        let output = match self.config.output.as_ref().and_then(|output| output.file.as_ref()) {
            Some(OutputFileConfig::Path(path)) => Some(path.clone()),
            _ => None,
        };
        let company = Company { states: self.states, output: output.as_deref().map(Path::new) };
        let stream = self.insertion(rows);
        let grown = growth::dense(domain, self.dimension, &radius, self.seed, stream, company);
        match grown {
            Ok(sites) => {
                for (body, site) in rows.bodies.iter_mut().zip(sites) {
                    body.position = site;
                }
            }
            Err(jammed) => {
                let what = format!(
                    "packing = {wanted} has not been reached: these sizes have jammed at a packing fraction of {}",
                    significant(jammed.packing_fraction, 5)
                );
                self.document.report(&path, what);
            }
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
        // Species at the common temperature form one bath, each of the others a separate one.
        let mut baths: Vec<Bath> = Vec::new();
        let mut common = Vec::new();
        let mut row = 0;
        for plan in species {
            let rows_here = row..row + plan.count;
            row += plan.count;
            let Some(temperature) = plan.temperature.or(initial.temperature) else {
                if let Some(velocities) = state.and_then(|state| state.velocity.as_ref()) {
                    velocity[rows_here.clone()].copy_from_slice(&velocities[rows_here]);
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
