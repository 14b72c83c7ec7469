//! Simple shear of the domain.

use glam::DVec3;
use haff_engine::{Boundary, Domain, Options, Shear, Simulation, System, bounds};

use super::{
    Assembler,
    domain::{DomainPlan, TOLERANCE},
    particles::{Initial, ParticlePlan, Rows, SpeciesPlan},
    values::at,
};
use crate::{config::PositionsConfig, model::state::State};

/// A position beyond a face of the gradient, moved along the flow by the displacement of the image there.
pub(super) fn beside_displaced_images(domain: &Domain, mut position: DVec3) -> DVec3 {
    if let Some(shear) = domain.shear {
        let up = (position[shear.gradient] / domain.size[shear.gradient]).floor();
        position[shear.flow] -= up * shear.offset;
    }
    position
}

impl Assembler<'_> {
    /// The shear of the domain. `walls` is the number of walls beside those of the domain.
    pub(super) fn shear_plan(&mut self, domain: &DomainPlan, walls: usize) -> Option<Shear> {
        let config = self.config.domain.as_ref()?.shear.clone()?;
        let path = |key: &str| at(["domain", "shear", key]);
        let whole = at(["domain", "shear"]);
        let flow = self.shear_axis("flow", config.flow.as_deref());
        let gradient = self.shear_axis("gradient", config.gradient.as_deref());
        let rate = match config.rate {
            Some(rate) if bounds::component(rate).is_ok() => rate,
            Some(_) => {
                self.document.refuse(&path("rate"), bounds::FINITE);
                0.0
            }
            None => {
                self.document.report_missing(&path("rate"), "missing: the shear rate");
                0.0
            }
        };
        let offset = config.offset.unwrap_or(0.0);
        if bounds::component(offset).is_err() {
            self.document.refuse(&path("offset"), bounds::FINITE);
        }
        let axes = self.dimension.count();
        if domain.boundary[..axes].iter().any(|&boundary| boundary != Boundary::Periodic) {
            let why = "needs a box that is periodic along all axes: leave domain.boundary out, and give the box a size";
            self.document.report(&whole, why);
        } else if walls > 0 {
            self.document.report(&whole, "does not work with walls");
        }
        if self.has_joints() {
            let why = "does not work with pendulums, springs, rods or sticking contacts";
            self.document.report(&whole, why);
        }
        let (flow, gradient) = (flow?, gradient?);
        if flow == gradient {
            self.document.refuse(&path("gradient"), "must be another axis than domain.shear.flow");
            return None;
        }
        Some(Shear { flow, gradient, rate, offset })
    }

    fn shear_axis(&mut self, key: &str, name: Option<&str>) -> Option<usize> {
        let letters = &["x", "y", "z"][..self.dimension.count()];
        let path = at(["domain", "shear", key]);
        let Some(name) = name else {
            let what = if key == "flow" { "the axis of the flow" } else { "the axis of the gradient" };
            self.document.report_missing(&path, format!("missing: {what}, such as \"x\""));
            return None;
        };
        let found = letters.iter().position(|&letter| letter == name);
        if found.is_none() {
            let known = if letters.len() == 2 { "\"x\" or \"y\"" } else { "\"x\", \"y\" or \"z\"" };
            self.document.refuse(&path, format!("must be {known}"));
        }
        found
    }

    /// Refuses bodies of infinite mass in a sheared box.
    pub(super) fn check_sheared_masses(
        &mut self,
        shear: Option<&Shear>,
        species: &[SpeciesPlan],
        explicit: &[ParticlePlan],
    ) {
        if shear.is_none() {
            return;
        }
        self.check_finite_masses("must be finite in a sheared box (domain.shear)", species, explicit);
    }

    /// Takes the displacement of the images from the file that the run starts from, and checks the box.
    pub(super) fn fix_shear(
        &mut self,
        domain: &mut Domain,
        rows: &Rows,
        initial: &Initial,
        state: Option<&State>,
    ) {
        let edges = state.and_then(|state| state.sheared_edges);
        let tilt = |row: usize, axis: usize| edges.map_or(0.0, |edges| edges[row][axis]);
        let is_tilted =
            |[row, axis]: [usize; 2]| tilt(row, axis).abs() > TOLERANCE * domain.size.max_element();
        let axes = [[0, 1], [0, 2], [1, 0], [1, 2], [2, 0], [2, 1]];
        let path = at(["initial", "positions"]);
        let Some(shear) = &mut domain.shear else {
            if axes.into_iter().any(is_tilted) {
                self.document.report(&path, "the box of the file is sheared: the scene needs domain.shear");
            }
            return;
        };
        if axes.into_iter().filter(|&pair| pair != [shear.gradient, shear.flow]).any(is_tilted) {
            let why = "the box of the file is sheared along other axes than that of the scene";
            self.document.report(&path, why);
            return;
        }
        let edge = domain.size[shear.gradient];
        let diameter = 2.0 * rows.largest_radius();
        if edge < bounds::LEAST_SHEARED_EDGE * diameter * (1.0 - TOLERANCE) {
            let text = format!(
                "box too small for shear: {edge} along the gradient, it must be at least twice the largest diameter, {diameter}"
            );
            let by_fraction = self.document.get_is_some(&at(["domain", "packing_fraction"]));
            let key = if by_fraction { "packing_fraction" } else { "size" };
            self.document.report(&at(["domain", key]), text);
        }
        let config = self.config.domain.as_mut().and_then(|domain| domain.shear.as_mut());
        if let Some(config) = config {
            if config.offset.is_none() {
                shear.offset = tilt(shear.gradient, shear.flow);
            }
            config.offset = Some(shear.offset);
        }
        if shear.offset != 0.0 && matches!(initial.positions, Some(PositionsConfig::Packing(_))) {
            let why = "needs positions from a file or [[particle]]: packings are made for a box without displacement";
            self.document.report(&at(["domain", "shear", "offset"]), why);
        }
    }

    /// Checks positions across the faces of the gradient for a box whose images are displaced.
    pub(super) fn check_displaced_images(&mut self, system: &System, from_file: bool) {
        if system.domain.shear.is_none_or(|shear| shear.offset == 0.0) {
            return;
        }
        let found = Simulation::new(system.clone(), Options::default())
            .and_then(|mut simulation| simulation.measure_overlap());
        if let Err(error) = found {
            let path =
                if from_file { at(["initial", "positions"]) } else { at(["domain", "shear", "offset"]) };
            self.document.report(&path, error.to_string());
        }
    }
}
