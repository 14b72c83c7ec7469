//! Growth of all particles: a compression of the box in the units of the start.

use glam::DVec3;
use haff_engine::{Boundary, Dimension, Drive, DriveKind, System, Wall, significant};

use super::{
    Assembler,
    compression::{AXES, densest},
    domain::{DomainPlan, TOLERANCE},
    particles::{ParticlePlan, Rows, SpeciesPlan},
    plan,
    values::{LARGEST, SMALLEST, at, positive},
};
use crate::config::GrowthConfig;
use crate::model::scene::{BoxLimit, GrowthEnd, GrowthRun, RunPlan, UntilOf};

/// Longest time between two rescalings of velocities, as a part of 1/γ.
const STEP: f64 = 0.01;

/// `[growth]`, with valid values.
pub(super) struct GrowthPlan {
    /// Growth of the largest diameter [length/time].
    rate: f64,
    config: GrowthConfig,
}

impl GrowthPlan {
    /// γ: relative growth of all diameters in a unit of time [1/time].
    fn relative(&self, largest_radius: f64) -> f64 {
        self.rate / (2.0 * largest_radius)
    }

    /// The rates of the compression of the box.
    pub(super) fn rates(&self, dimension: Dimension, rows: &Rows) -> DVec3 {
        let rate = self.relative(rows.largest_radius());
        DVec3::new(rate, rate, if dimension == Dimension::Three { rate } else { 0.0 })
    }

    /// The drive that rescales velocities, if there is a temperature.
    pub(super) fn rescaling(&self, species: usize, rows: &Rows) -> Option<Drive> {
        // Near jamming heating becomes ever faster.
        let longest = STEP / self.relative(rows.largest_radius());
        let kind = DriveKind::Hold { temperature: self.config.temperature?, longest };
        Some(Drive { kind, species: (0..species as u32).collect(), rotational: false })
    }
}

/// The time at which a box that is compressed at a rate γ along all axes has a packing fraction [time]:
/// φ = φ₀ (1 − γ t)^(−d).
fn time_of(dimension: Dimension, rate: f64, from: f64, to: f64) -> f64 {
    let root = match dimension {
        Dimension::Two => (from / to).sqrt(),
        Dimension::Three => libm::cbrt(from / to),
    };
    (1.0 - root) / rate
}

impl Assembler<'_> {
    /// The growth of the particles. `extra` are the walls beside those of the domain.
    pub(super) fn growth_plan(
        &mut self,
        domain: &DomainPlan,
        extra: &[Wall],
        species: &[SpeciesPlan],
        explicit: &[ParticlePlan],
    ) -> Option<GrowthPlan> {
        let config = self.config.growth.clone()?;
        let whole = at(["growth"]);
        let path = |key: &str| at(["growth", key]);
        if config.rate.is_none() {
            self.document.report_missing(
                &path("rate"),
                "missing: the growth of the largest diameter in a unit of time",
            );
        }
        for (key, value) in [
            ("rate", config.rate),
            ("temperature", config.temperature),
            ("until_reduced_pressure", config.until_reduced_pressure),
        ] {
            if let Some(value) = value {
                positive(&mut self.document, &path(key), value);
            }
        }
        if let Some(fraction) = config.until_packing_fraction {
            if !(fraction > 0.0 && fraction < 1.0) {
                self.document.refuse(&path("until_packing_fraction"), "must be in (0, 1)");
            }
            if config.until_reduced_pressure.is_some() {
                let why = "contradicts growth.until_packing_fraction: give one of the two";
                self.document.report(&path("until_reduced_pressure"), why);
            }
        }
        let given = self.config.domain.as_ref();
        let given = [
            ("domain.compression", given.is_some_and(|domain| domain.compression.is_some())),
            ("domain.shear", given.is_some_and(|domain| domain.shear.is_some())),
        ];
        for (key, _) in given.into_iter().filter(|(_, given)| *given) {
            self.document.report(&whole, format!("contradicts {key}: give one of the two"));
        }
        let axes = self.dimension.count();
        if let Some(axis) = (0..axes).find(|&axis| domain.boundary[axis] == Boundary::Open) {
            let why = format!("needs a box without open axes: {} is open", AXES[axis]);
            self.document.report(&whole, why);
        }
        if domain.gravity == DVec3::ZERO {
            self.check_surroundings(&whole, "[growth]", &|axis| axis < axes, domain);
        } else {
            self.document.refuse(&at(["domain", "gravity"]), "must be 0 with [growth]");
        }
        self.check_container(&whole, "[growth]", true, extra);
        self.check_finite_masses("must be finite with [growth]", species, explicit);
        Some(GrowthPlan { rate: config.rate?, config })
    }

    /// Refuses a relative growth out of range.
    pub(super) fn check_growth(&mut self, plan: &GrowthPlan, rows: &Rows) {
        let relative = plan.relative(rows.largest_radius());
        if !(SMALLEST..=LARGEST).contains(&relative) {
            let why =
                format!("grows by {relative:e} of the largest diameter in a unit of time: out of range");
            self.document.report(&at(["growth", "rate"]), why);
        }
    }

    /// The end of the growth.
    pub(super) fn end_growth(
        &mut self,
        plan: &GrowthPlan,
        system: &System,
        limit: Option<&BoxLimit>,
        run: &mut RunPlan,
    ) {
        let largest = system.classes.iter().map(|class| class.radius).fold(0.0, f64::max);
        let rate = plan.relative(largest);
        let end = match (plan.config.until_packing_fraction, plan.config.until_reduced_pressure) {
            (Some(fraction), _) => Some(GrowthEnd::PackingFraction(fraction)),
            (None, Some(pressure)) => Some(GrowthEnd::ReducedPressure(pressure)),
            (None, None) => None,
        };
        run.growth = Some(GrowthRun::new(system.bodies.len(), end));
        let Some(fraction) = plan.config.until_packing_fraction else { return };
        let path = at(["growth", "until_packing_fraction"]);
        let start = plan::packing_fraction(system);
        let most = densest(system.dimension, &system.classes);
        if fraction > most * (1.0 + TOLERANCE) {
            let d = self.dimension.count();
            let why = format!(
                "must be at most {most:.6}, that of the densest packing of equal spheres in {d} dimensions"
            );
            self.document.refuse(&path, why);
            return;
        }
        if fraction <= start {
            let why = format!("must be above the packing fraction at the start, {}", significant(start, 6));
            self.document.refuse(&path, why);
            return;
        }
        let time = time_of(self.dimension, rate, start, fraction);
        if let Some(limit) = limit.filter(|limit| time > limit.time * (1.0 + TOLERANCE)) {
            let why = format!(
                "must be reached before t = {}: at that time {}",
                significant(limit.time, 6),
                limit.why
            );
            self.document.refuse(&path, why);
            return;
        }
        if run.until.is_none_or(|until| time <= until) {
            run.until = Some(time);
            run.until_of = UntilOf::PackingFraction;
        }
    }
}
