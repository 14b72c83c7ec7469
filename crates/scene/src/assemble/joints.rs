//! Pendulums, springs and rods: positions that follow from their angles, and the joints themselves.

use std::collections::HashMap;

use glam::DVec3;
use haff_engine::System;
use haff_linkage::{Joints, LinkageError, Pendulum, Rod, Spring, SpringEnd, Tether};

use super::Assembler;
use super::names::among;
use super::values::{at, item, not_negative, positive, storable};
use crate::config::document::Path;
use crate::config::joints::TetherConfig;

/// Tolerance between a position and an angle that are both given, relative to the length.
const AGREES: f64 = 1e-9;

impl Assembler<'_> {
    /// Whether the scene has features that the granular engine does not support.
    pub(super) fn has_joints(&self) -> bool {
        let config = &self.config;
        config.pendulum.is_some()
            || config.spring.is_some()
            || config.rod.is_some()
            || !self.sticking.is_empty()
            || !self.sticking_to_walls.is_empty()
    }

    /// Fills in the positions of particles that an angle places.
    pub(super) fn place_by_angles(&mut self) {
        let gravity =
            self.config.domain.as_ref().and_then(|domain| domain.gravity.clone()).unwrap_or_default();
        let vector = |values: &[f64]| {
            DVec3::from_array(std::array::from_fn(|k| {
                values.get(k).copied().filter(|x| x.is_finite()).unwrap_or(0.0)
            }))
        };
        let lowest = if self.dimension.count() == 2 { DVec3::NEG_Y } else { DVec3::NEG_Z };
        let gravity = vector(&gravity);
        let down = if gravity == DVec3::ZERO { lowest } else { gravity / gravity.length() };
        let aside = |axis: DVec3| axis - down * axis.dot(down);
        let side = if aside(DVec3::X).length() > 1e-9 { aside(DVec3::X) } else { aside(DVec3::Y) };
        let side = side / side.length();
        // Of several particles of a name, the first.
        let mut rows: HashMap<String, usize> = HashMap::new();
        for (row, particle) in self.config.particle.iter().flatten().enumerate() {
            if let Some(name) = &particle.name {
                rows.entry(name.clone()).or_insert(row);
            }
        }
        for (k, pendulum) in self.config.pendulum.clone().unwrap_or_default().into_iter().enumerate() {
            let Some(angle) = pendulum.angle else { continue };
            let path = item("pendulum", k, "angle");
            if !angle.is_finite() {
                self.document.refuse(&path, "must be a finite number");
                continue;
            }
            let Some(length) = pendulum.length else {
                self.document
                    .report_missing(&item("pendulum", k, "length"), "missing: an angle needs a length");
                continue;
            };
            let (Some(pivot), Some(bob)) = (&pendulum.pivot, &pendulum.bob) else { continue };
            let (sin, cos) = libm::sincos(angle);
            let place = vector(pivot) + (down * cos + side * sin) * length;
            self.place(rows.get(bob), place, length, &path);
        }
        for (k, rod) in self.config.rod.clone().unwrap_or_default().into_iter().enumerate() {
            let Some(angle) = rod.angle else { continue };
            let path = item("rod", k, "angle");
            if !angle.is_finite() {
                self.document.refuse(&path, "must be a finite number");
                continue;
            }
            let Some(length) = rod.length else {
                self.document.report_missing(&item("rod", k, "length"), "missing: an angle needs a length");
                continue;
            };
            let Some([first, second]) = rod.between.as_deref() else { continue };
            let particles = self.config.particle.as_deref().unwrap_or_default();
            let from = rows.get(first).and_then(|&row| particles[row].position.as_ref());
            let Some(from) = from else { continue };
            let (sin, cos) = libm::sincos(angle);
            let place = vector(from) + DVec3::new(cos, sin, 0.0) * length;
            self.place(rows.get(second), place, length, &path);
        }
    }

    /// Sets the position of a particle, or compares it with the given one.
    fn place(&mut self, row: Option<&usize>, place: DVec3, length: f64, path: &[String]) {
        let components = self.components(place);
        let (Some(&row), Some(particles)) = (row, &mut self.config.particle) else { return };
        let particle = &mut particles[row];
        let name = particle.name.as_deref().unwrap_or_default();
        match &particle.position {
            None => particle.position = Some(components),
            Some(given) => {
                let apart = given.iter().zip(&components).map(|(x, y)| (x - y).powi(2)).sum::<f64>().sqrt();
                if apart > AGREES * length {
                    let message = format!(
                        "puts \"{name}\" at {components:?}, its position says {given:?}: give one of the two, or the same"
                    );
                    self.document.report(path, message);
                }
            }
        }
    }

    /// Rows of explicit particles by their names, beginning at `species`; `None` for a name that several
    /// have.
    fn rows_by_name(&self, species: usize) -> HashMap<String, Option<usize>> {
        let mut rows: HashMap<String, Option<usize>> = HashMap::new();
        for (k, particle) in self.config.particle.iter().flatten().enumerate() {
            if let Some(name) = &particle.name {
                let known = rows.contains_key(name);
                rows.insert(name.clone(), (!known).then_some(species + k));
            }
        }
        rows
    }

    /// The row of the one particle of a name.
    fn row_of(&mut self, path: &Path, name: &str, rows: &HashMap<String, Option<usize>>) -> Option<usize> {
        match rows.get(name) {
            Some(Some(row)) => return Some(*row),
            Some(None) => {
                let message = format!(
                    "several particles are named \"{name}\": the one that is meant needs a name of its own"
                );
                self.document.report(path, message);
            }
            None => {
                let particles = self.config.particle.as_deref().unwrap_or_default();
                let known = || particles.iter().filter_map(|particle| particle.name.as_deref());
                let message = format!("no [[particle]] is named {}", among(name, known));
                self.document.report(path, message);
            }
        }
        None
    }

    /// The joints of the scene; `species`: number of particles before the first `[[particle]]`.
    pub(super) fn joints(&mut self, species: usize, position: &dyn Fn(usize) -> DVec3) -> Joints {
        let rows = self.rows_by_name(species);
        self.check_joint_names();
        let mut joints = Joints {
            sticking: self.sticking.clone(),
            sticking_to_walls: self.sticking_to_walls.clone(),
            ..Joints::default()
        };
        for (k, config) in self.config.pendulum.clone().unwrap_or_default().into_iter().enumerate() {
            let path = |key: &str| item("pendulum", k, key);
            let Some(pivot) = &config.pivot else {
                self.document.report_missing(&path("pivot"), "missing: the point that it hangs from");
                continue;
            };
            let pivot = self.vector(&path("pivot"), pivot);
            let Some(bob) = &config.bob else {
                self.document
                    .report_missing(&path("bob"), "missing: the name of the particle that hangs on it");
                continue;
            };
            let Some(bob) = self.row_of(&path("bob"), bob, &rows) else { continue };
            let length = config.length.unwrap_or_else(|| (position(bob) - pivot).length());
            if !positive(&mut self.document, &path("length"), length) {
                continue;
            }
            joints.pendulums.push(Pendulum {
                name: config.name.clone().unwrap_or_else(|| format!("pendulum.{k}")),
                pivot,
                length,
                bob,
                tether: match config.tether.unwrap_or(TetherConfig::String) {
                    TetherConfig::String => Tether::String,
                    TetherConfig::Rod => Tether::Rod,
                },
                slack: config.slack.unwrap_or(false),
            });
        }
        for (k, config) in self.config.spring.clone().unwrap_or_default().into_iter().enumerate() {
            let path = |key: &str| item("spring", k, key);
            let names = config.between.clone().unwrap_or_default();
            let expected = if config.point.is_some() { 1 } else { 2 };
            if names.len() != expected {
                let message = "must have two names, or one beside point";
                self.document.report_missing(&path("between"), message);
                continue;
            }
            let mut ends = Vec::new();
            for name in &names {
                ends.extend(self.row_of(&path("between"), name, &rows).map(SpringEnd::Particle));
            }
            if let Some(point) = &config.point {
                ends.push(SpringEnd::Point(self.vector(&path("point"), point)));
            }
            let Some(stiffness) = config.stiffness else {
                self.document.report_missing(&path("stiffness"), "missing: force per length");
                continue;
            };
            let sound = positive(&mut self.document, &path("stiffness"), stiffness);
            let (Ok(ends), true) = (<[SpringEnd; 2]>::try_from(ends), sound) else { continue };
            let place = |end: SpringEnd| match end {
                SpringEnd::Particle(row) => position(row),
                SpringEnd::Point(point) => point,
            };
            let natural_length = config.length.unwrap_or_else(|| (place(ends[1]) - place(ends[0])).length());
            if !not_negative(&mut self.document, &path("length"), natural_length) {
                continue;
            }
            let name = config.name.clone().unwrap_or_else(|| format!("spring.{k}"));
            joints.springs.push(Spring { name, ends, stiffness, natural_length });
        }
        for (k, config) in self.config.rod.clone().unwrap_or_default().into_iter().enumerate() {
            let path = |key: &str| item("rod", k, key);
            let names = config.between.clone().unwrap_or_default();
            if names.len() != 2 {
                self.document.report_missing(&path("between"), "must have the names of two particles");
                continue;
            }
            let ends: Vec<usize> =
                names.iter().filter_map(|name| self.row_of(&path("between"), name, &rows)).collect();
            let Ok(ends) = <[usize; 2]>::try_from(ends) else { continue };
            let length = config.length.unwrap_or_else(|| (position(ends[1]) - position(ends[0])).length());
            if !positive(&mut self.document, &path("length"), length) {
                continue;
            }
            let name = config.name.clone().unwrap_or_else(|| format!("rod.{k}"));
            joints.rods.push(Rod { name, ends, length });
        }
        joints
    }

    /// Names of joints are used in messages and files.
    fn check_joint_names(&mut self) {
        let config = &self.config;
        let pendulums = config.pendulum.iter().flatten().map(|joint| &joint.name).enumerate();
        let springs = config.spring.iter().flatten().map(|joint| &joint.name).enumerate();
        let rods = config.rod.iter().flatten().map(|joint| &joint.name).enumerate();
        let all = pendulums.map(|(k, name)| ("pendulum", k, name));
        let all = all.chain(springs.map(|(k, name)| ("spring", k, name)));
        for (list, k, name) in all.chain(rods.map(|(k, name)| ("rod", k, name))) {
            storable(&mut self.document, &item(list, k, "name"), name.as_deref().unwrap_or_default());
        }
    }

    /// Whether the joints fit together and fit the system.
    pub(super) fn check_joints(&mut self, system: &System, joints: &Joints) {
        if !self.has_joints() {
            return;
        }
        let Err(error) = haff_linkage::check(system, joints) else { return };
        let path = match &error {
            LinkageError::Parameter { element, index, key, .. } => item(element, *index, key),
            LinkageError::Distance { element, index, .. } => item(element, *index, "length"),
            LinkageError::NoParticle { element, index, .. }
            | LinkageError::Ends { element, index, .. }
            | LinkageError::Stretching { element, index, .. }
            | LinkageError::OverConstrained { element, index } => item(element, *index, ""),
            LinkageError::Twice(..) => at(["contact", "pair"]),
            LinkageError::Unsupported(_)
            | LinkageError::Collapse { .. }
            | LinkageError::Overlap(_)
            | LinkageError::Singular { .. }
            | LinkageError::Checkpoint(_) => Vec::new(),
        };
        let one_key = matches!(error, LinkageError::Parameter { .. } | LinkageError::Distance { .. });
        if one_key && self.document.get_is_some(&path) {
            self.document.report(&path, error.to_string());
        } else {
            self.document.report_missing(&path, error.to_string());
        }
    }
}
