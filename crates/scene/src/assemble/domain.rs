//! The box, its faces and gravity.

use glam::DVec3;
use haff_engine::{Boundary, Compression, Dimension, Domain, Shear, Wall, WallMotion, bounds, significant};

use super::Assembler;
use super::flow::motion_of_upper_wall;
use super::particles::{Rows, SpeciesPlan};
use super::values::{LARGEST, SMALLEST, at, item, positive};
use crate::config::{BoundaryConfig, DomainConfig, PackingConfig, PositionsConfig};
use crate::model::state::State;

/// π/(3√2): no packing of equal spheres is denser.
pub(super) const DENSEST_3D: f64 = 0.740_480_489_693_061;
/// π/(2√3): no packing of equal disks is denser.
pub(super) const DENSEST_2D: f64 = 0.906_899_682_117_109;
/// Random packings beyond these fail or take very long: random close packing is at 0.64 (2D: 0.84).
const RANDOM_3D: f64 = 0.58;
const RANDOM_2D: f64 = 0.78;

/// Tolerance for rounding in comparisons of lengths.
pub(super) const TOLERANCE: f64 = 1e-12;

/// The domain before its size is known.
pub(super) struct DomainPlan {
    pub(super) size: Option<DVec3>,
    pub(super) boundary: [Boundary; 3],
    pub(super) gravity: DVec3,
}

impl DomainPlan {
    /// Names of the walls of the domain, in axis order, lower before upper.
    pub(super) fn wall_names(&self) -> Vec<String> {
        let named = |axis: usize| ["-", "+"].map(|side| format!("{}{side}", ["x", "y", "z"][axis]));
        (0..3).filter(|&axis| self.boundary[axis] == Boundary::Wall).flat_map(named).collect()
    }

    /// The domain, with a placeholder for z in two dimensions.
    pub(super) fn finish(
        &self,
        dimension: Dimension,
        rows: &Rows,
        shear: Option<Shear>,
        compression: Option<Compression>,
    ) -> Domain {
        let mut size = self.size.unwrap_or(DVec3::ONE);
        if dimension == Dimension::Two {
            // Of formal meaning: a length that files can have where no disk is there yet.
            let diameter = 2.0 * rows.largest_radius();
            size.z = if diameter > 0.0 { diameter } else { 1.0 };
        }
        Domain { size, boundary: self.boundary, gravity: self.gravity, shear, compression }
    }

    /// All walls: those of the domain, then `extra`.
    pub(super) fn walls(&self, domain: &Domain, extra: Vec<Wall>) -> Vec<Wall> {
        let mut walls = Vec::new();
        let names = self.wall_names();
        let axes = (0..3).filter(|&axis| self.boundary[axis] == Boundary::Wall);
        for (axis, pair) in axes.zip(names.chunks(2)) {
            let normal = DVec3::AXES[axis];
            let upper = normal * domain.size[axis];
            let motions = [WallMotion::Fixed, motion_of_upper_wall(domain, axis)];
            let places = [(&pair[0], DVec3::ZERO, normal), (&pair[1], upper, -normal)];
            for ((name, point, normal), motion) in places.into_iter().zip(motions) {
                walls.push(Wall { name: name.clone(), point, normal, motion, shape: None });
            }
        }
        walls.extend(extra);
        walls
    }
}

/// How to give particles more room, by the key that sets it.
pub(super) fn more_room(by_fraction: bool) -> &'static str {
    if by_fraction { "lower domain.packing_fraction" } else { "enlarge the box" }
}

impl Assembler<'_> {
    pub(super) fn domain_plan(&mut self, species: bool, explicit: bool) -> DomainPlan {
        let d = self.dimension.count();
        let mut config = self.config.domain.get_or_insert_with(DomainConfig::default).clone();
        let from_file = matches!(
            self.config.initial.as_ref().and_then(|initial| initial.positions.as_ref()),
            Some(PositionsConfig::File(_))
        );
        let grown = match self.config.initial.as_ref().and_then(|initial| initial.positions.as_ref()) {
            Some(PositionsConfig::Grown(grown)) => grown.packing,
            _ => None,
        };
        // The packing makes its box.
        if let (Some(packing), None, None) = (grown, &config.size, config.packing_fraction) {
            config.packing_fraction = Some(packing);
            if let Some(domain) = &mut self.config.domain {
                domain.packing_fraction = Some(packing);
            }
        }
        let size_path = at(["domain", "size"]);
        let has_size = config.size.is_some() || config.packing_fraction.is_some() || (species && from_file);
        let size = config.size.as_ref().and_then(|given| {
            if given.len() != d {
                self.document.refuse(&size_path, format!("must have {d} numbers, one per dimension"));
                return None;
            }
            let mut sound = true;
            for (k, &length) in given.iter().enumerate() {
                let mut path = size_path.clone();
                path.push(k.to_string());
                sound &= positive(&mut self.document, &path, length);
            }
            sound.then(|| DVec3::new(given[0], given[1], if d == 3 { given[2] } else { 1.0 }))
        });

        let fraction_path = at(["domain", "packing_fraction"]);
        if let Some(fraction) = config.packing_fraction {
            if config.size.is_some() {
                self.document.report(&fraction_path, "contradicts domain.size: give one of the two");
            } else if !(fraction > 0.0 && fraction < 1.0) {
                self.document.refuse(&fraction_path, "must be in (0, 1)");
            } else if !species {
                self.document.report(&fraction_path, "needs [[species]] to make a box for; give domain.size");
            }
        }

        let default = if has_size { Boundary::Periodic } else { Boundary::Open };
        let mut boundary = [default; 3];
        let boundary_path = at(["domain", "boundary"]);
        if let Some(given) = &config.boundary {
            if given.len() != d && given.len() != 3 {
                self.document.refuse(&boundary_path, format!("must have {d} entries, one per dimension"));
            } else {
                for (k, kind) in given.iter().enumerate() {
                    boundary[k] = match kind {
                        BoundaryConfig::Periodic => Boundary::Periodic,
                        BoundaryConfig::Wall => Boundary::Wall,
                        BoundaryConfig::Open => Boundary::Open,
                    };
                }
                if d == 2 && boundary[2] == Boundary::Wall {
                    self.document.refuse(&boundary_path, "must not have walls along z in two dimensions");
                }
            }
        }
        if d == 2 {
            boundary[2] = Boundary::Open;
        }
        if !has_size && !self.document.was_reported(&size_path) && !self.document.was_reported(&fraction_path)
        {
            let closed = boundary[..d].iter().any(|&b| b != Boundary::Open);
            if species || (closed && explicit) {
                self.document
                    .report_missing(&size_path, "missing: give domain.size or domain.packing_fraction");
            }
        }

        let gravity = match &config.gravity {
            Some(given) => self.vector(&at(["domain", "gravity"]), given),
            None => DVec3::ZERO,
        };
        for axis in 0..d {
            if gravity[axis] != 0.0 && boundary[axis] == Boundary::Periodic && config.gravity.is_some() {
                let name = ["x", "y", "z"][axis];
                let message = format!(
                    "must be 0 along {name}, which is periodic: bodies would fall forever; make it \"wall\" or \"open\""
                );
                self.document.refuse(&at(["domain", "gravity"]), message);
            }
        }
        let names = boundary.map(|b| match b {
            Boundary::Periodic => BoundaryConfig::Periodic,
            Boundary::Wall => BoundaryConfig::Wall,
            Boundary::Open => BoundaryConfig::Open,
        });
        let components = self.components(gravity);
        if let Some(resolved) = &mut self.config.domain {
            resolved.boundary = Some(names[..d].to_vec());
            resolved.gravity = Some(components);
        }
        DomainPlan { size, boundary, gravity }
    }

    /// Computes the size if the scene does not give it: from the species, the state or the particles.
    pub(super) fn fix_size(
        &mut self,
        plan: &mut DomainPlan,
        species: &[SpeciesPlan],
        rows: &Rows,
        state: Option<&State>,
    ) {
        let d = self.dimension.count();
        let fraction = self.config.domain.as_ref().and_then(|domain| domain.packing_fraction);
        let fraction_path = at(["domain", "packing_fraction"]);
        if let Some(fraction) = fraction {
            let count: usize = species.iter().map(|s| s.count).sum();
            let equal = species.windows(2).all(|pair| pair[0].radius == pair[1].radius)
                && species.iter().all(|s| s.radius.is_fixed());
            let densest = if d == 3 { DENSEST_3D } else { DENSEST_2D };
            if equal && fraction > densest * (1.0 + TOLERANCE) {
                let message =
                    format!("is impossible: equal spheres fill at most {densest:.6} in {d} dimensions");
                self.document.report(&fraction_path, message);
                return;
            }
            let volume: f64 = (0..count).map(|k| rows.volume(k, self.dimension)).sum();
            let edge = libm::pow(volume / fraction, 1.0 / d as f64);
            if !(SMALLEST..LARGEST).contains(&edge) {
                let message = format!("makes a box of edge {edge:e}, which must be between 1e-50 and 1e50");
                self.document.report(&fraction_path, message);
                return;
            }
            // A perfect lattice of touching spheres must not fail by the rounding of a cube root.
            plan.size = Some(DVec3::splat(edge * (1.0 + 4.0 * f64::EPSILON)));
        } else if let (None, Some(state)) = (plan.size, state) {
            let path = at(["initial", "positions"]);
            if let Some(size) =
                state.size.filter(|size| (0..d).all(|axis| (SMALLEST..=LARGEST).contains(&size[axis])))
            {
                plan.size = Some(size);
            } else {
                self.document.report(&path, "the file has no box: give domain.size");
                return;
            }
        } else if plan.size.is_none() {
            // Only for open axes, whose size is a placeholder.
            let mut size = DVec3::splat(2.0 * rows.largest_radius());
            for (k, body) in rows.bodies.iter().enumerate() {
                size = size.max(body.position + DVec3::splat(rows.radius(k)));
            }
            plan.size = Some(size.clamp(DVec3::splat(SMALLEST), DVec3::splat(LARGEST)));
        }
        let components = plan.size.map(|size| self.components(size));
        if let Some(resolved) = &mut self.config.domain {
            resolved.size = components;
            resolved.packing_fraction = None;
        }
    }

    /// Radii against the rounding of coordinates. Along open axes the largest coordinate is that of the
    /// start.
    pub(super) fn check_resolution(
        &mut self,
        domain: &Domain,
        species: &[SpeciesPlan],
        rows: &Rows,
        positions: Option<&PositionsConfig>,
    ) {
        let packed = matches!(positions, Some(PositionsConfig::Packing(_)));
        let mut extent = 0.0_f64;
        for axis in 0..self.dimension.count() {
            if packed || domain.boundary[axis] != Boundary::Open {
                extent = extent.max(domain.size[axis]);
            }
            extent = rows.bodies.iter().map(|body| body.position[axis].abs()).fold(extent, f64::max);
        }
        for (k, plan) in species.iter().enumerate() {
            if let Err(why) = bounds::resolved(plan.radius.range()[0], extent) {
                self.document.report(&item("species", k, "radius"), why);
            }
        }
        for row in rows.species..rows.bodies.len() {
            if let Err(why) = bounds::resolved(rows.radius(row), extent) {
                self.document.report(&item("particle", row - rows.species, "radius"), why);
            }
        }
    }

    /// The box against the sizes and volumes of its particles.
    pub(super) fn check_box(&mut self, domain: &Domain, rows: &Rows, positions: Option<&PositionsConfig>) {
        let d = self.dimension.count();
        let diameter = 2.0 * rows.largest_radius();
        let mut box_volume = 1.0;
        let mut closed = true;
        let by_fraction = self.document.get_is_some(&at(["domain", "packing_fraction"]));
        let path = at(["domain", if by_fraction { "packing_fraction" } else { "size" }]);
        for axis in 0..d {
            let length = domain.size[axis];
            box_volume *= length;
            let name = ["x", "y", "z"][axis];
            let message = match domain.boundary[axis] {
                Boundary::Open => {
                    closed = false;
                    continue;
                }
                Boundary::Periodic => "a particle would touch its own image",
                Boundary::Wall => "a particle does not fit between the walls",
            };
            if length < diameter * (1.0 - TOLERANCE) {
                let text = format!(
                    "box too small: {length} along {name}, the largest diameter is {diameter}: {message}"
                );
                self.document.report(&path, text);
            }
        }
        let n = rows.bodies.len();
        let volume: f64 = (0..n).map(|k| rows.volume(k, self.dimension)).sum();
        let fraction = volume / box_volume;
        let random = matches!(positions, Some(PositionsConfig::Packing(PackingConfig::Random)));
        let densest = match (random && rows.species > 0, d) {
            (true, 3) => RANDOM_3D,
            (true, _) => RANDOM_2D,
            (false, _) => 1.0,
        };
        if closed && fraction > densest {
            let why = if random { "random packings reach" } else { "all particles together fill at most" };
            let (lattice, reached) = if d == 3 { ("fcc", 0.74) } else { ("hexagonal", 0.907) };
            let more_room = more_room(by_fraction);
            let remedy = if random && fraction < reached {
                let fraction = significant(fraction, 6);
                format!(
                    "{more_room}, or take initial.positions = {{ packing = {fraction} }} or \"{lattice}\""
                )
            } else {
                more_room.to_owned()
            };
            let fraction = significant(fraction, 4);
            let text = format!("impossible packing fraction {fraction}: {why} {densest}; {remedy}");
            self.document.report(&path, text);
        }
    }
}
