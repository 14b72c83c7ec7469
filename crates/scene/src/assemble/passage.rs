//! Inlets and outlets.

use glam::DVec3;
use haff_engine::{
    Body, Boundary, Dimension, Domain, Flow, Inlet, Outlet, Supply, System, Wall, WallMotion, bounds,
};
use haff_placement::random::{Purpose, Stream};

use super::{
    Assembler,
    names::{Names, among},
    particles::{MassLaw, Rows, SpeciesPlan},
    values::{at, item, not_negative, positive},
};
use crate::config::{FollowedConfig, InletConfig, OutletConfig, SpeciesConfig};

/// Particles that come in at a rate.
pub(super) struct Supplied {
    /// Index of the inlet, and of its species.
    inlet: usize,
    species: usize,
    count: usize,
}

/// Inlets and outlets, and the particles that inlets with a rate will let in.
pub(super) struct Passages {
    flow: Flow,
    supplied: Vec<Supplied>,
}

impl Assembler<'_> {
    /// The inlets and outlets of the scene; `None` if it has none.
    pub(super) fn passages(&mut self, species: &[SpeciesPlan], names: &Names) -> Option<Passages> {
        let inlets = self.config.inlet.clone().unwrap_or_default();
        let outlets = self.config.outlet.clone().unwrap_or_default();
        self.check_empty_species(&inlets);
        if inlets.is_empty() && outlets.is_empty() {
            return None;
        }
        self.refuse_beside_passages(if inlets.is_empty() { "outlet" } else { "inlet" });
        let mut passages = Passages { flow: Flow::default(), supplied: Vec::new() };
        for (k, config) in inlets.iter().enumerate() {
            if let Some(inlet) = self.inlet(k, config, species, names, outlets.is_empty(), &mut passages) {
                passages.flow.inlets.push(inlet);
            }
        }
        for (k, config) in outlets.iter().enumerate() {
            if let Some(outlet) = self.outlet(k, config) {
                passages.flow.outlets.push(outlet);
            }
        }
        Some(passages)
    }

    /// A species can have no particles at the start beside others, for a simulation that adds some, or if it
    /// comes in by an inlet.
    fn check_empty_species(&mut self, inlets: &[InletConfig]) {
        let counts = |species: &SpeciesConfig| species.count.is_some_and(|count| count > 0);
        let others = self.config.species.iter().flatten().any(counts)
            || self.config.particle.as_ref().is_some_and(|particles| !particles.is_empty());
        if others {
            return;
        }
        for (k, species) in self.config.species.clone().iter().flatten().enumerate() {
            let comes_in = |inlet: &InletConfig| inlet.rate.is_some() && inlet.species == species.name;
            if species.count == Some(0) && !inlets.iter().any(comes_in) {
                let why = "must be 1 or more: there is no other particle, and no [[inlet]] with a rate lets this species in";
                self.document.refuse(&item("species", k, "count"), why);
            }
        }
    }

    /// What does not work where particles come and go.
    fn refuse_beside_passages(&mut self, list: &str) {
        let domain = self.config.domain.clone().unwrap_or_default();
        let measure = self.config.measure.clone().unwrap_or_default();
        let others = [
            (domain.shear.is_some(), "domain.shear"),
            (domain.compression.is_some(), "domain.compression"),
            (self.config.growth.is_some(), "growth"),
            (self.config.drive.as_ref().is_some_and(|drives| !drives.is_empty()), "a drive"),
            (self.has_joints(), "pendulums, springs, rods or sticking contacts"),
            (
                measure.msd.as_ref().is_some_and(FollowedConfig::any),
                "measure.msd, which follows all particles from the start",
            ),
            (
                measure.vacf.as_ref().is_some_and(FollowedConfig::any),
                "measure.vacf, which follows all particles from the start",
            ),
        ];
        for (_, what) in others.into_iter().filter(|(given, _)| *given) {
            self.document.report(&at([list]), format!("does not work with {what}"));
        }
    }

    fn inlet(
        &mut self,
        k: usize,
        config: &InletConfig,
        species: &[SpeciesPlan],
        names: &Names,
        is_closed: bool,
        passages: &mut Passages,
    ) -> Option<Inlet> {
        let path = |key: &str| item("inlet", k, key);
        let errors = self.document.count();
        let place = self.cuboid(("inlet", k), "box", config.cuboid.as_ref());
        let velocity =
            config.velocity.as_ref().map_or(DVec3::ZERO, |given| self.vector(&path("velocity"), given));
        let temperature = config.temperature.unwrap_or(0.0);
        not_negative(&mut self.document, &path("temperature"), temperature);
        let known = || names.all.iter().map(String::as_str);
        let given = match &config.species {
            None => None,
            Some(name) => {
                let index = names.all.iter().position(|known| known == name);
                if index.is_none() {
                    let why = format!("no species is named {}", among(name, known));
                    self.document.report(&path("species"), why);
                }
                index
            }
        };
        if config.count.is_some_and(|count| count < 1) {
            self.document.refuse(&path("count"), "must be 1 or more");
        }
        let supply = match (config.rate, config.refill.unwrap_or(false)) {
            (Some(_), true) => {
                let why = "either rate (new particles) or refill = true (those that have left), not both";
                self.document.report(&path("refill"), why);
                return None;
            }
            (None, false) => {
                let why = "missing: give rate (new particles) or refill = true (those that have left)";
                self.document.report_missing(&path("rate"), why);
                return None;
            }
            (None, true) => {
                if is_closed {
                    let why = "there is no [[outlet]] that takes particles out";
                    self.document.report(&path("refill"), why);
                }
                let species = given.map_or_else(|| (0..names.all.len() as u32).collect(), |k| vec![k as u32]);
                Supply::Refill { species, count: config.count.map_or(u64::MAX, |count| count as u64) }
            }
            (Some(rate), false) => {
                positive(&mut self.document, &path("rate"), rate);
                if config.species.is_none() {
                    let why = "missing: which species comes in";
                    self.document.report_missing(&path("species"), why);
                }
                if config.count.is_none() {
                    let why = "missing: how many particles come in at most; files have a place for each";
                    self.document.report_missing(&path("count"), why);
                }
                let (index, count) = (given?, config.count.filter(|&count| count >= 1)? as usize);
                let Some(plan) = species.get(index) else {
                    let why = "must be one of [[species]]: particles placed by hand have no law of sizes";
                    self.document.report(&path("species"), why);
                    return None;
                };
                if plan.mass == MassLaw::Mass(f64::INFINITY) {
                    self.document.report(&path("species"), "has infinite mass: such bodies cannot come in");
                }
                let first = passages.supplied.iter().map(|supplied| supplied.count).sum::<usize>() as u32;
                passages.supplied.push(Supplied { inlet: k, species: index, count });
                Supply::Rate { rate, first, count: count as u32 }
            }
        };
        let place = place?;
        (self.document.count() == errors).then_some(Inlet { place, velocity, temperature, supply })
    }

    fn outlet(&mut self, k: usize, config: &OutletConfig) -> Option<Outlet> {
        if let Some(interval) = config.interval {
            positive(&mut self.document, &item("outlet", k, "interval"), interval);
        }
        let place = self.cuboid(("outlet", k), "box", config.cuboid.as_ref())?;
        Some(Outlet { place, interval: config.interval })
    }

    /// Checks where inlets are, and the sizes of what comes in.
    pub(super) fn check_passages(
        &mut self,
        passages: &Passages,
        domain: &Domain,
        walls: &[Wall],
        species: &[SpeciesPlan],
    ) {
        let (inlets, outlets) = (&passages.flow.inlets, &passages.flow.outlets);
        let inlets = inlets.iter().enumerate().map(|(k, inlet)| ("inlet", k, &inlet.place));
        let outlets = outlets.iter().enumerate().map(|(k, outlet)| ("outlet", k, &outlet.place));
        for (kind, k, place) in inlets.chain(outlets) {
            for axis in (0..self.dimension.count()).filter(|&axis| domain.boundary[axis] != Boundary::Open) {
                let (low, high, size) = (place.low[axis], place.high[axis], domain.size[axis]);
                let name = ["x", "y", "z"][axis];
                // Grains come in anywhere in an inlet, and leave where an outlet is in the box.
                if kind == "inlet" && (low < 0.0 || high > size) {
                    let why = format!("must be within the box along {name}, from 0 to {size}");
                    self.document.refuse(&item(kind, k, "box"), why);
                } else if high < 0.0 || low > size {
                    let why = format!("must reach into the box along {name}, from 0 to {size}");
                    self.document.refuse(&item(kind, k, "box"), why);
                }
            }
        }
        self.check_room(passages, domain, walls, species);
        for supplied in &passages.supplied {
            let [least, largest] = species[supplied.species].radius.range();
            let place = &passages.flow.inlets[supplied.inlet].place;
            let extent = place.low.abs().max(place.high.abs());
            let extent = (0..self.dimension.count()).map(|axis| extent[axis].max(domain.size[axis]));
            let path = item("inlet", supplied.inlet, "species");
            if let Err(why) = bounds::resolved(least, extent.fold(0.0, f64::max)) {
                self.document.report(&path, format!("has radii of {least}, which {why}"));
            }
            let axes = 0..self.dimension.count();
            if let Some(axis) = axes.into_iter().find(|&axis| {
                domain.boundary[axis] == Boundary::Periodic && domain.size[axis] < 2.0 * largest
            }) {
                let name = ["x", "y", "z"][axis];
                let why =
                    format!("has radii of {largest}: a particle would touch its own image along {name}");
                self.document.report(&path, why);
            }
            let holes = walls.iter().filter_map(|wall| wall.shape.as_ref()?.hole());
            if holes.into_iter().any(|hole| hole.radius < largest * bounds::LEAST_HOLE) {
                self.document
                    .report(&path, format!("has radii of {largest}, larger than a hole of the walls"));
            }
        }
    }

    /// Checks that the smallest particle of each inlet has a place between the walls of the box.
    fn check_room(&mut self, passages: &Passages, domain: &Domain, walls: &[Wall], species: &[SpeciesPlan]) {
        // A wall that oscillates may leave room at other times.
        let is_walled = |axis: &usize| {
            let name = ["x", "y", "z"][*axis];
            let oscillates = |wall: &Wall| {
                matches!(wall.motion, WallMotion::Oscillating(_))
                    && wall.name.strip_suffix(['-', '+']) == Some(name)
            };
            domain.boundary[*axis] == Boundary::Wall && !walls.iter().any(oscillates)
        };
        for (k, inlet) in passages.flow.inlets.iter().enumerate() {
            let supplied = passages.supplied.iter().find(|supplied| supplied.inlet == k);
            let comes_in = match (&inlet.supply, supplied) {
                (Supply::Refill { species, .. }, _) => species.iter().map(|&k| k as usize).collect(),
                (Supply::Rate { .. }, Some(supplied)) => vec![supplied.species],
                (Supply::Rate { .. }, None) => Vec::new(),
            };
            // Of particles placed by hand only those that are there are known.
            let plans = comes_in.iter().map(|&k| species.get(k).map(|plan| plan.radius.range()[0]));
            let Some(least) = plans.collect::<Option<Vec<f64>>>() else { continue };
            let least = least.into_iter().fold(f64::INFINITY, f64::min);
            for axis in (0..self.dimension.count()).filter(&is_walled) {
                let (from, to) = (least, domain.size[axis] - least);
                if least.is_finite() && (inlet.place.high[axis] <= from || inlet.place.low[axis] >= to) {
                    let name = ["x", "y", "z"][axis];
                    let why = format!(
                        "must have places for centers of particles of radius {least}: along {name} between {from} and {to}"
                    );
                    self.document.refuse(&item("inlet", k, "box"), why);
                }
            }
        }
    }
}

impl Passages {
    /// Number of particles that inlets with a rate let in.
    pub(super) fn count(&self) -> usize {
        self.supplied.iter().map(|supplied| supplied.count).sum()
    }

    /// Inlets and outlets for the particles of the start.
    pub(super) fn of_start(&self, present: usize) -> Flow {
        let mut flow = self.flow.clone();
        flow.present = present;
        for inlet in &mut flow.inlets {
            if let Supply::Rate { first, .. } = &mut inlet.supply {
                *first += present as u32;
            }
        }
        flow
    }

    /// Adds the particles that will come in to those of the start.
    pub(super) fn add_waiting(
        &self,
        (seed, dimension): (u64, Dimension),
        system: &mut System,
        species: &[SpeciesPlan],
        mut rows: Rows,
    ) {
        rows.classes = std::mem::take(&mut system.classes);
        let mut drawn: Vec<usize> = species.iter().map(|plan| plan.count).collect();
        for supplied in &self.supplied {
            let plan = &species[supplied.species];
            let next = &mut drawn[supplied.species];
            for i in *next..*next + supplied.count {
                let mut random = Stream::new(seed, Purpose::Radius, &plan.name, i);
                let radius = plan.radius.draw(i, &mut random);
                let group = supplied.species as u32;
                let class = rows.class(radius, plan.mass.of(radius, dimension), group);
                // Where it comes in is drawn when it does.
                let place = self.flow.inlets[supplied.inlet].place;
                let position = place.at(|axis| (axis < dimension.count()).then_some(0.5));
                let velocity = DVec3::ZERO;
                system.bodies.push(Body { position, velocity, image: [0; 3], class, species: group });
            }
            *next += supplied.count;
        }
        system.classes = rows.classes;
        if let Some(spin) = &mut system.spin {
            spin.angular_velocity.resize(system.bodies.len(), DVec3::ZERO);
        }
    }
}
