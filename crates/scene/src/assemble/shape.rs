//! Walls of other shapes than half-spaces: cylinders, spheres, cones, finite planes and meshes.

use std::f64::consts::FRAC_PI_2;

use glam::DVec3;
use haff_engine::{Boundary, Dimension, Rotation, Shape, Wall, WallMotion};
use haff_mechanics::NamedSurface;
use haff_surfaces::{Rectangle, Revolution, Side, Sphere};

use super::Assembler;
use super::domain::DomainPlan;
use super::values::{item, not_negative, positive};
use crate::config::{ConeConfig, CylinderConfig, PlaneConfig, SideConfig, SphereConfig, WallConfig};

/// Axes are parallel, and points are on an axis, up to this part of lengths.
const ALIGNED: f64 = 1e-9;

/// A shape that has been read.
struct Made {
    surface: &'static NamedSurface,
    turns: Turns,
}

/// About which axes a wall turns in itself.
#[derive(Debug, Clone, Copy)]
pub(super) enum Turns {
    /// None.
    Not,
    /// One, through a point along a unit vector: a cylinder and a cone.
    About(DVec3, DVec3),
    /// All through its center: a sphere.
    AboutCenter(DVec3),
    /// All along its normal, of which the given one through a point is usual: a plane.
    AlongNormal(DVec3, DVec3),
}

/// The side in a scene file.
pub(super) fn side(config: Option<SideConfig>) -> Side {
    match config.unwrap_or(SideConfig::Inside) {
        SideConfig::Inside => Side::Inside,
        SideConfig::Outside => Side::Outside,
        SideConfig::Both => Side::Both,
    }
}

impl Assembler<'_> {
    /// Wall `k`, which has a shape of its own that is no half-space and no partition; `None` if it is not
    /// valid.
    pub(super) fn shaped_wall(&mut self, k: usize, config: &WallConfig, domain: &DomainPlan) -> Option<Wall> {
        let shapes = config.shapes();
        let mut given = shapes.into_iter().filter(|(_, given)| *given).map(|(key, _)| key);
        let key = given.next()?;
        for other in given {
            let why = format!("a wall has one shape, and this one has {key}: give either of them");
            self.document.report(&item("wall", k, other), why);
        }
        if config.parameters.is_some() && config.surface.is_none() {
            self.document.report(&item("wall", k, "parameters"), "are those of a surface: name it");
        }
        self.refuse_with_shapes(k, key, config);
        let made = match (&config.cylinder, &config.sphere, &config.cone, &config.mesh, &config.surface) {
            (Some(cylinder), ..) => self.cylinder(k, cylinder),
            (_, Some(sphere), ..) => self.sphere(k, sphere),
            (_, _, Some(cone), ..) => self.cone(k, cone),
            (_, _, _, Some(mesh), _) => self.mesh(k, mesh).map(|surface| Made { surface, turns: Turns::Not }),
            (.., Some(name)) => {
                self.surface(k, name, config).map(|surface| Made { surface, turns: Turns::Not })
            }
            _ => self.rectangle(k, config.plane.as_ref()?),
        }?;
        self.check_periodic(k, key, made.surface, domain);
        let mut wall = Wall {
            name: config.name.clone().unwrap_or_default(),
            point: DVec3::ZERO,
            normal: self.direction_of_shift(k, config),
            motion: WallMotion::Fixed,
            shape: Some(Shape::Named(made.surface)),
        };
        if let Some(velocity) = &config.velocity {
            wall.motion = WallMotion::from(self.vector(&item("wall", k, "velocity"), velocity));
        }
        if let (Some(time), WallMotion::Constant(motion)) = (self.reference_time(k, config), &mut wall.motion)
        {
            motion.reference_time = time;
        }
        if let Some(offset) = &config.offset {
            wall.point = self.vector(&item("wall", k, "offset"), offset);
        }
        if let Some(rotation) = self.rotation(k, config, made.turns) {
            wall.motion = WallMotion::Rotating(rotation);
        }
        Some(wall)
    }

    /// What does not work with walls of other shapes.
    fn refuse_with_shapes(&mut self, k: usize, key: &str, config: &WallConfig) {
        if config.sticks == Some(true) {
            self.document.report(&item("wall", k, "sticks"), "nothing sticks to a wall of this shape");
        }
        if config.displacement.is_some() {
            let why = "is for walls of domain.boundary: a shape has its place in its own keys";
            self.document.report(&item("wall", k, "displacement"), why);
        }
        self.refuse_piston(k, config);
        if self.has_joints() {
            let why = "does not work with pendulums, springs, rods or sticking contacts";
            self.document.report(&item("wall", k, key), why);
        }
    }

    /// A shape does not repeat with the box: along periodic axes it must be the same everywhere.
    fn check_periodic(&mut self, k: usize, key: &str, surface: &NamedSurface, domain: &DomainPlan) {
        let breaks = |axis: &usize| {
            domain.boundary[*axis] == Boundary::Periodic && !surface.get().is_same_along(*axis)
        };
        if let Some(axis) = (0..self.dimension.count()).find(breaks) {
            let name = ["x", "y", "z"][axis];
            let why = format!(
                "does not repeat with the box along {name}, which is periodic: make {name} \"wall\" or \"open\" in \
                 domain.boundary, or take a cylinder without end along it"
            );
            self.document.report(&item("wall", k, key), why);
        }
    }

    /// The direction in which a shape oscillates; 0 if it does not.
    fn direction_of_shift(&mut self, k: usize, config: &WallConfig) -> DVec3 {
        let Some(motion) = &config.motion else { return DVec3::ZERO };
        let path = item("wall", k, "motion.direction");
        let Some(direction) = &motion.direction else {
            self.document
                .report_missing(&path, "missing: a shape that is no plane oscillates along a direction");
            return DVec3::ZERO;
        };
        let direction = self.vector(&path, direction);
        self.unit(&path, direction)
    }

    /// A vector of unit length along a direction, which must not be zero.
    fn unit(&mut self, path: &[String], direction: DVec3) -> DVec3 {
        // Scaled by the largest component first, so that tiny and huge vectors do not under- or overflow.
        let unit = (direction / direction.abs().max_element()).normalize();
        if !unit.is_finite() {
            self.document.refuse(path, "must not be zero");
            return DVec3::ZERO;
        }
        unit
    }

    /// A required vector and a required length of an entry of `list`, if both are valid.
    pub(super) fn point_and_length(
        &mut self,
        (list, k): (&str, usize),
        keys: [&str; 2],
        (point, length): (&Option<Vec<f64>>, Option<f64>),
    ) -> Option<(DVec3, f64)> {
        let paths = keys.map(|key| item(list, k, key));
        let errors = self.document.count();
        for (path, missing) in paths.iter().zip([point.is_none(), length.is_none()]) {
            if missing {
                self.document.report_missing(path, "missing: the shape needs it");
            }
        }
        let point = point.as_ref().map(|point| self.vector(&paths[0], point));
        let length = length.filter(|&length| positive(&mut self.document, &paths[1], length));
        point.zip(length).filter(|_| self.document.count() == errors)
    }

    /// An optional length of an entry of `list`.
    pub(super) fn length(&mut self, (list, k): (&str, usize), key: &str, value: Option<f64>) -> Option<f64> {
        value.filter(|&value| positive(&mut self.document, &item(list, k, key), value))
    }

    /// The axis of a cylinder in an entry of `list`, of unit length; in two dimensions z, or a direction in
    /// the plane.
    pub(super) fn axis(&mut self, (list, k): (&str, usize), key: &str, given: Option<&Vec<f64>>) -> DVec3 {
        let path = item(list, k, key);
        let Some(given) = given else {
            if self.dimension == Dimension::Three {
                self.document.report_missing(&path, "missing: the shape needs it");
            }
            return DVec3::Z;
        };
        let is_z =
            matches!(given.as_slice(), [x, y, z] if *x == 0.0 && *y == 0.0 && *z != 0.0 && z.is_finite());
        if self.dimension == Dimension::Two && is_z {
            return DVec3::Z;
        }
        let axis = self.vector(&path, given);
        self.unit(&path, axis)
    }

    fn cylinder(&mut self, k: usize, config: &CylinderConfig) -> Option<Made> {
        let errors = self.document.count();
        let keys = ["cylinder.point", "cylinder.radius"];
        let found = self.point_and_length(("wall", k), keys, (&config.point, config.radius));
        let axis = self.axis(("wall", k), "cylinder.axis", config.axis.as_ref());
        let length = self.length(("wall", k), "cylinder.length", config.length);
        if length.is_some() && self.dimension == Dimension::Two && axis == DVec3::Z {
            let why = "does not belong to a circle, a cylinder along z in two dimensions";
            self.document.report(&item("wall", k, "cylinder.length"), why);
        }
        let (point, radius) = found.filter(|_| self.document.count() == errors)?;
        let side = side(config.side);
        let surface = match length {
            None => Revolution::cylinder(point, axis, radius, side),
            Some(length) => Revolution::finite_cylinder(point, axis, radius, length, side),
        };
        let surface = named("cylinder", surface);
        Some(Made { surface, turns: Turns::About(point, axis) })
    }

    fn sphere(&mut self, k: usize, config: &SphereConfig) -> Option<Made> {
        let keys = ["sphere.center", "sphere.radius"];
        let (center, radius) = self.point_and_length(("wall", k), keys, (&config.center, config.radius))?;
        let surface = named("sphere", Sphere { center, radius, side: side(config.side) });
        Some(Made { surface, turns: Turns::AboutCenter(center) })
    }

    fn cone(&mut self, k: usize, config: &ConeConfig) -> Option<Made> {
        let errors = self.document.count();
        let keys = ["cone.apex", "cone.angle"];
        let found = self.point_and_length(("wall", k), keys, (&config.apex, config.angle));
        let path = item("wall", k, "cone.axis");
        let axis = if let Some(axis) = &config.axis {
            let axis = self.vector(&path, axis);
            self.unit(&path, axis)
        } else {
            self.document.report_missing(&path, "missing: the shape needs it");
            DVec3::ZERO
        };
        let length = self.length(("wall", k), "cone.length", config.length);
        let start = config.start.unwrap_or(0.0);
        not_negative(&mut self.document, &item("wall", k, "cone.start"), start);
        if length.is_some_and(|length| length <= start) {
            let why = format!("must be more than its start, {start}: both are lengths from the apex");
            self.document.refuse(&item("wall", k, "cone.length"), why);
        }
        if found.is_some_and(|(_, angle)| angle >= FRAC_PI_2) {
            self.document.refuse(&item("wall", k, "cone.angle"), "must be below π/2 = 1.5708 radians");
        }
        let (apex, angle) = found.filter(|_| self.document.count() == errors)?;
        let ends = [start, length.unwrap_or(f64::INFINITY)];
        let surface = named("cone", Revolution::cone(apex, axis, angle, ends, side(config.side)));
        Some(Made { surface, turns: Turns::About(apex, axis) })
    }

    /// A plane of finite extent.
    fn rectangle(&mut self, k: usize, config: &PlaneConfig) -> Option<Made> {
        let errors = self.document.count();
        for (key, given) in
            [("plane.hole", config.hole.is_some()), ("plane.two-sided", config.two_sided == Some(false))]
        {
            if given {
                let why = "does not work with plane.extent, a finite plane with particles on both sides";
                self.document.report(&item("wall", k, key), why);
            }
        }
        let mut vector = |key: &str, value: &Option<Vec<f64>>| {
            let path = item("wall", k, key);
            let Some(value) = value else {
                self.document.report_missing(&path, "missing: a plane needs it");
                return DVec3::ZERO;
            };
            self.vector(&path, value)
        };
        let center = vector("plane.point", &config.point);
        let normal = vector("plane.normal", &config.normal);
        let normal = self.unit(&item("wall", k, "plane.normal"), normal);
        let extent = config.extent.clone().unwrap_or_default();
        let edges = self.dimension.count() - 1;
        if extent.len() != edges {
            let form = if edges == 2 { "two lengths" } else { "one length in two dimensions" };
            self.document.refuse(&item("wall", k, "plane.extent"), format!("must have {form}"));
        }
        for (n, &edge) in extent.iter().enumerate() {
            positive(&mut self.document, &item("wall", k, &format!("plane.extent.{n}")), edge);
        }
        let along = if self.dimension == Dimension::Two {
            DVec3::new(-normal.y, normal.x, 0.0)
        } else if let Some(along) = &config.along {
            let path = item("wall", k, "plane.along");
            let along = self.vector(&path, along);
            let along = self.unit(&path, along);
            if along.dot(normal).abs() > ALIGNED {
                self.document.refuse(&path, "must be in the plane, perpendicular to its normal");
            }
            along
        } else {
            let size = normal.abs();
            let nearest = (0..3).fold(0, |least, axis| if size[axis] < size[least] { axis } else { least });
            DVec3::AXES[nearest]
        };
        if self.document.count() != errors {
            return None;
        }
        let along = (along - normal * along.dot(normal)).normalize();
        let half = [extent[0] / 2.0, extent.get(1).map_or(f64::INFINITY, |edge| edge / 2.0)];
        let along = [along, normal.cross(along)];
        let surface = named("rectangle", Rectangle { center, normal, along, half });
        Some(Made { surface, turns: Turns::Not })
    }

    /// The rotation of wall `k`, if it has one and may have it.
    pub(super) fn rotation(&mut self, k: usize, config: &WallConfig, turns: Turns) -> Option<Rotation> {
        let rotation = config.rotation.as_ref()?;
        let errors = self.document.count();
        let path = |key: &str| item("wall", k, key);
        let moves = [("velocity", config.velocity.is_some()), ("motion", config.motion.is_some())];
        for (key, _) in moves.into_iter().filter(|(_, given)| *given) {
            self.document.report(&path(key), "does not work with rotation: give one of the two");
        }
        let (own_point, own_axis) = match turns {
            Turns::Not => {
                let why = "would sweep through the particles: only cylinders, cones, spheres and planes without end \
                           rotate, about their own axis";
                self.document.report(&path("rotation"), why);
                return None;
            }
            Turns::About(point, axis) | Turns::AlongNormal(point, axis) => (point, Some(axis)),
            Turns::AboutCenter(center) => (center, None),
        };
        let rate = rotation.rate.unwrap_or_else(|| {
            self.document.report_missing(&path("rotation.rate"), "missing: a rotation needs a rate");
            0.0
        });
        if haff_engine::bounds::component(rate).is_err() {
            self.document.refuse(&path("rotation.rate"), haff_engine::bounds::FINITE);
        }
        let axis = match (&rotation.axis, own_axis) {
            (None, Some(own)) => own,
            // In two dimensions z is the only one.
            (given, None) => self.axis(("wall", k), "rotation.axis", given.as_ref()),
            (Some(given), Some(own)) => {
                let given = self.axis(("wall", k), "rotation.axis", Some(given));
                if given.cross(own).length() > ALIGNED {
                    let why = format!(
                        "must be along the axis of the wall, ({}, {}, {}): about another one the wall would sweep \
                         through the particles",
                        own.x, own.y, own.z
                    );
                    self.document.refuse(&path("rotation.axis"), why);
                }
                given
            }
        };
        if self.dimension == Dimension::Two && axis.abs() != DVec3::Z && self.document.count() == errors {
            let why = "must be about z in two dimensions: the wall would leave the plane";
            self.document.report(&path("rotation"), why);
        }
        let mut point = own_point;
        if let Some(given) = &rotation.point {
            point = self.vector(&path("rotation.point"), given);
            let off = point - own_point;
            let off = off - axis * off.dot(axis);
            let is_any = matches!(turns, Turns::AlongNormal(..));
            let size = point.abs().max(own_point.abs()).max_element();
            if !is_any && off.length() > ALIGNED * size.max(haff_engine::bounds::SMALLEST) {
                let why = "must be on the axis of the wall: about another one the wall would sweep through the \
                           particles";
                self.document.refuse(&path("rotation.point"), why);
            }
        }
        (self.document.count() == errors).then(|| Rotation { point, angular_velocity: axis * rate })
    }

    /// Checks that the species of `passes` exist; true for each group that passes through wall `k`.
    pub(super) fn passing(&mut self, k: usize, config: &WallConfig, groups: &[String]) -> Vec<bool> {
        let mut passing = vec![false; groups.len()];
        for (n, name) in config.passes.iter().flatten().enumerate() {
            let path = item("wall", k, &format!("passes.{n}"));
            if let Some(group) = groups.iter().position(|group| group == name) {
                passing[group] = true;
                continue;
            }
            let known = || groups.iter().map(String::as_str);
            let why = format!("no species or particle is named {}", super::names::among(name, known));
            self.document.report(&path, why);
        }
        if config.passes.as_ref().is_some_and(|names| !names.is_empty()) && self.has_joints() {
            let why = "does not work with pendulums, springs, rods or sticking contacts";
            self.document.report(&item("wall", k, "passes"), why);
        }
        passing
    }
}

/// A surface by its name and its numbers.
fn named<S: haff_mechanics::Surface + 'static>(name: &str, surface: S) -> &'static NamedSurface {
    let numbers = format!("{surface:?}");
    NamedSurface::of(name, &numbers, Box::new(surface))
}
