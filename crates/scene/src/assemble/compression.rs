//! Compression and expansion of the domain.

use glam::DVec3;
use haff_engine::{
    Boundary, Class, Compression, Dimension, Domain, System, Wall, WallLaw, bounds, significant,
};

use super::{
    Assembler,
    domain::{DENSEST_2D, DENSEST_3D, DomainPlan, TOLERANCE},
    particles::{MassLaw, ParticlePlan, Rows, SpeciesPlan},
    plan,
    values::{at, item},
};
use crate::config::document::Path;
use crate::model::scene::{BoxLimit, BoxTooSmall, GrowthEnd, GrowthRun, RunPlan, UntilOf};

/// Halvings of an interval of time in which the box becomes too full.
const HALVINGS: usize = 200;

/// Names of the axes.
pub(super) const AXES: [&str; 3] = ["x", "y", "z"];

/// The densest that particles of these sizes can be: of one size, or of several.
pub(super) fn densest(dimension: Dimension, classes: &[Class]) -> f64 {
    let equal = classes.windows(2).all(|pair| pair[0].radius == pair[1].radius);
    match dimension {
        _ if !equal => 1.0,
        Dimension::Two => DENSEST_2D,
        Dimension::Three => DENSEST_3D,
    }
}

/// The shortest that an edge along which a box is compressed can be [diameters], in words: images need as
/// much room as under shear.
fn least_edge(boundary: Boundary) -> (f64, &'static str) {
    if boundary == Boundary::Periodic {
        (bounds::LEAST_SHEARED_EDGE, "at least twice")
    } else {
        (1.0, "at least")
    }
}

/// The time from which on the box has less than a volume; infinite if it never has. The logarithm of the
/// volume is concave in time: what has become too small stays so.
fn too_full(dimension: Dimension, domain: &Domain, compression: &Compression, least: f64) -> f64 {
    let is_less = |time: f64| domain.volume(dimension, time) < least;
    if is_less(0.0) {
        return 0.0;
    }
    let [mut before, mut after] = [0.0, compression.end()];
    if after == f64::INFINITY {
        return after;
    }
    for _ in 0..HALVINGS {
        let middle = 0.5 * (before + after);
        *(if is_less(middle) { &mut after } else { &mut before }) = middle;
    }
    before
}

/// The last time at which a box that is compressed can be; `None` if there is none. Particles from row
/// `first` on were placed one by one.
pub(super) fn box_limit(system: &System, first: usize) -> Option<BoxLimit> {
    let domain = &system.domain;
    let compression = domain.compression?;
    let radius = |class: u32| system.classes[class as usize].radius;
    let diameter = 2.0 * system.classes.iter().map(|class| class.radius).fold(0.0, f64::max);
    let filled: f64 = system.bodies.iter().map(|body| system.dimension.volume(radius(body.class))).sum();
    let most = densest(system.dimension, &system.classes);
    let full = domain.volume(system.dimension, 0.0).min(filled / most);
    let is_open = domain.boundary[..system.dimension.count()].contains(&Boundary::Open);
    let mut limit = BoxLimit {
        time: if is_open { f64::INFINITY } else { too_full(system.dimension, domain, &compression, full) },
        why: BoxTooSmall::PackingFraction(most),
    };
    for axis in (0..system.dimension.count()).filter(|&axis| compression.rates[axis] > 0.0) {
        let (edge, rate) = (domain.size[axis], compression.rates[axis]);
        let mut earlier = |least: f64, why: BoxTooSmall| {
            let time = (1.0 - least / edge) / rate;
            if time < limit.time {
                limit = BoxLimit { time, why };
            }
        };
        let least = diameter * least_edge(domain.boundary[axis]).0;
        earlier(least, BoxTooSmall::Edge(axis, least));
        for (row, body) in system.bodies.iter().enumerate().skip(first) {
            let is_fixed = system.classes[body.class as usize].mass == f64::INFINITY;
            if is_fixed && body.velocity == DVec3::ZERO {
                earlier(body.position[axis] + radius(body.class), BoxTooSmall::Body(axis, row));
            }
        }
    }
    limit.time.is_finite().then_some(limit)
}

impl Assembler<'_> {
    /// Refuses what a box that is compressed does not have: profiles, whose cells would change, and along
    /// periodic axes walls that act along themselves, past which the particles flow.
    pub(super) fn check_compressed(&mut self, system: &System) {
        let domain = &system.domain;
        let Some(compression) = domain.compression else { return };
        let path = self.rate_path();
        let whole = at([path[0].as_str()]);
        if !system.measure.profiles.is_empty() {
            self.document.report(&at(["measure", "profiles"]), "does not work in a box that is compressed");
        }
        let images =
            (0..3).any(|axis| compression.rates[axis] != 0.0 && domain.boundary[axis] == Boundary::Periodic);
        let thermal = system.contacts.wall.iter().any(WallLaw::is_thermal);
        let rough = system.spin.as_ref().is_some_and(|spin| spin.wall.iter().any(|law| !law.is_smooth()));
        if images && (thermal || rough) {
            let why = "does not work with thermal and rough walls along a periodic axis that is compressed";
            self.document.report(&whole, why);
        }
    }

    /// The key of the rates, as written.
    pub(super) fn rate_path(&self) -> Path {
        if self.config.growth.is_some() {
            return at(["growth", "rate"]);
        }
        let config = self.config.domain.as_ref().and_then(|domain| domain.compression.as_ref());
        let each = config.is_some_and(|config| config.rates.is_some());
        at(["domain", "compression", if each { "rates" } else { "rate" }])
    }

    /// The rates of the compression of the domain, if not all are 0. `extra` are the walls beside those of
    /// the domain.
    pub(super) fn compression_plan(
        &mut self,
        domain: &DomainPlan,
        extra: &[Wall],
        species: &[SpeciesPlan],
        explicit: &[ParticlePlan],
    ) -> Option<DVec3> {
        let config = self.config.domain.as_ref()?.compression.clone()?;
        let whole = at(["domain", "compression"]);
        let path = self.rate_path();
        let axes = self.dimension.count();
        let rates = match (config.rate, &config.rates) {
            (Some(_), Some(_)) => {
                self.document.report(&path, "contradicts domain.compression.rate: give one of the two");
                return None;
            }
            (None, None) => {
                let why = "missing: the rate of all axes, or rates, one per axis";
                self.document.report_missing(&path, why);
                return None;
            }
            (Some(rate), None) if bounds::component(rate).is_err() => {
                self.document.refuse(&path, bounds::FINITE);
                return None;
            }
            (Some(rate), None) => DVec3::new(rate, rate, if axes == 3 { rate } else { 0.0 }),
            (None, Some(rates)) => self.vector(&path, rates),
        };
        if rates == DVec3::ZERO {
            return None;
        }
        if self.config.domain.as_ref().is_some_and(|domain| domain.shear.is_some()) {
            self.document.report(&whole, "contradicts domain.shear: give one of the two");
        }
        let is_compressed = |axis: usize| rates[axis] != 0.0;
        if let Some(axis) =
            (0..axes).find(|&axis| is_compressed(axis) && domain.boundary[axis] == Boundary::Open)
        {
            let why = format!(
                "must be 0 along {}, which is open: make it \"periodic\" or \"wall\", and give the box a size",
                AXES[axis]
            );
            self.document.refuse(&path, why);
        }
        self.check_surroundings(&whole, "domain.compression", &is_compressed, domain);
        let is_uniform = (0..axes).all(|axis| rates[axis] == rates.x);
        self.check_container(&whole, "domain.compression", is_uniform, extra);
        if (0..axes).any(|axis| is_compressed(axis) && domain.boundary[axis] == Boundary::Periodic) {
            let why = "must be finite in a box whose images move (domain.compression)";
            self.check_finite_masses(why, species, explicit);
        }
        Some(rates)
    }

    /// Refuses what does not work in a box whose edges move along some axes, by the key `name` at `path`.
    pub(super) fn check_surroundings(
        &mut self,
        path: &Path,
        name: &str,
        is_compressed: &dyn Fn(usize) -> bool,
        domain: &DomainPlan,
    ) {
        let images = (0..3).any(|axis| is_compressed(axis) && domain.boundary[axis] == Boundary::Periodic);
        let gravity = (0..3).find(|&axis| {
            let here = is_compressed(axis) && domain.boundary[axis] == Boundary::Wall;
            domain.gravity[axis] != 0.0 && (images || here)
        });
        if let Some(axis) = gravity {
            let why = if images { "images move" } else { "a wall of the box moves" };
            let why = format!("must be 0 along {}: with {name}, {why}", AXES[axis]);
            self.document.refuse(&at(["domain", "gravity"]), why);
        }
        if self.has_joints() {
            let why = "does not work with pendulums, springs, rods or sticking contacts";
            self.document.report(path, why);
        }
        let configs = self.config.wall.clone().unwrap_or_default();
        for (k, config) in configs.iter().enumerate() {
            let moves = (0..3).any(|axis| {
                let is_of = |side: &str| config.names_boundary(&format!("{}{side}", AXES[axis]));
                is_compressed(axis) && (is_of("-") || is_of("+"))
            });
            let keys = [
                ("motion", config.motion.is_some()),
                ("velocity", config.velocity.is_some()),
                ("displacement", config.displacement.is_some_and(|shift| shift != 0.0)),
            ];
            for (key, _) in keys.into_iter().filter(|(_, given)| moves && *given) {
                let why = format!("does not work for a wall of an axis whose edge changes ({name})");
                self.document.report(&item("wall", k, key), why);
            }
        }
    }

    /// Refuses bodies of infinite mass.
    pub(super) fn check_finite_masses(
        &mut self,
        why: &str,
        species: &[SpeciesPlan],
        explicit: &[ParticlePlan],
    ) {
        let infinite = |mass: MassLaw| matches!(mass, MassLaw::Mass(mass) if mass == f64::INFINITY);
        for (k, _) in species.iter().enumerate().filter(|(_, plan)| infinite(plan.mass)) {
            self.document.refuse(&item("species", k, "mass"), why);
        }
        for (k, _) in explicit.iter().enumerate().filter(|(_, plan)| infinite(plan.mass)) {
            self.document.refuse(&item("particle", k, "mass"), why);
        }
    }

    /// Refuses a box that is too short at the start for edges that move.
    pub(super) fn check_compressed_edges(&mut self, domain: &Domain, rows: &Rows) {
        let Some(compression) = domain.compression else { return };
        let diameter = 2.0 * rows.largest_radius();
        let by_fraction = self.document.get_is_some(&at(["domain", "packing_fraction"]));
        let size = at(["domain", if by_fraction { "packing_fraction" } else { "size" }]);
        for axis in (0..self.dimension.count()).filter(|&axis| compression.rates[axis] != 0.0) {
            let (least, which) = least_edge(domain.boundary[axis]);
            let edge = domain.size[axis];
            if edge < least * diameter * (1.0 - TOLERANCE) {
                let text = format!(
                    "box too small for edges that move: {edge} along {}, it must be {which} the largest diameter, {diameter}",
                    AXES[axis]
                );
                self.document.report(&size, text);
            }
        }
    }

    /// Bounds the run by the limit of the box, and refuses ends beyond it. `rate`: collisions of a particle
    /// in a unit of time.
    pub(super) fn check_compression(
        &mut self,
        system: &System,
        limit: Option<&BoxLimit>,
        rate: f64,
        run: &mut RunPlan,
    ) {
        let Some(compression) = system.domain.compression else { return };
        let path = self.rate_path();
        let until_path = at(["run", "until"]);
        if let Some(until) = run.until {
            let edge = compression.edges(system.domain.size, until).max_element();
            let radius = system.classes.iter().map(|class| class.radius).fold(f64::INFINITY, f64::min);
            if let Err(why) = bounds::resolved(radius, edge) {
                let why =
                    format!("the edges at that time are up to {}: the radius {why}", significant(edge, 6));
                self.document.report(&until_path, why);
            }
        }
        let Some(limit) = limit else { return };
        if limit.time <= 0.0 {
            let why = format!("must be negative: at the start {}", limit.why);
            self.document.refuse(&path, why);
            return;
        }
        if compression.end() * rate < 1.0 {
            let why = format!(
                "ends the box at t = {}, within the mean free time, {}",
                significant(compression.end(), 6),
                significant(1.0 / rate, 4)
            );
            self.document.report(&path, why);
            return;
        }
        match run.until {
            Some(until) if run.until_of == UntilOf::Run && until >= limit.time => {
                let why =
                    format!("must be less than {}: at that time {}", significant(limit.time, 12), limit.why);
                self.document.refuse(&until_path, why);
            }
            Some(_) => {}
            None => {
                run.until = Some(limit.time);
                run.until_of = UntilOf::Box;
            }
        }
        // Towards jamming collisions become ever more frequent: without a test such a run would not end.
        if let Some(until) = run.until
            && run.collisions.is_none()
            && run.growth.is_none()
        {
            let [start, end] = [0.0, until].map(|time| plan::packing_fraction_at(system, time));
            let end = (end > start).then_some(GrowthEnd::Compressed { until, packing_fraction: end });
            run.growth = end.map(|end| GrowthRun::new(system.bodies.len(), Some(end)));
        }
    }
}
