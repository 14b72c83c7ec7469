//! The system: its box, bodies, walls and laws, and the options of a run.

use std::f64::consts::PI;

use glam::DVec3;
use haff_mechanics::{Restitution, Shape, Surface};

use crate::model::{
    compression::Compression,
    drag::Drag,
    drive::Drive,
    flow::Flow,
    measure::Measure,
    piston::Piston,
    shear::Shear,
    spin::Spin,
    wall_law::WallLaw,
    wall_motion::{WallMotion, WallTime},
};

/// Number of space dimensions.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Dimension {
    /// Disks in the plane z = 0; every z component of positions and velocities is exactly zero.
    Two,
    /// Spheres in space.
    Three,
}

impl Dimension {
    /// Number of coordinates that can change: 2 or 3.
    pub fn count(self) -> usize {
        match self {
            Self::Two => 2,
            Self::Three => 3,
        }
    }

    /// Volume of a sphere of this radius [length³], in two dimensions the area of a disk [length²].
    #[must_use]
    pub fn volume(self, radius: f64) -> f64 {
        match self {
            Self::Two => PI * radius * radius,
            Self::Three => 4.0 / 3.0 * PI * radius * radius * radius,
        }
    }
}

/// The boundary of the domain along one axis.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Boundary {
    /// The domain repeats.
    Periodic,
    /// Two plane walls at 0 and at L, which are contained in [`System::walls`].
    Wall,
    /// Unbounded; the size of the domain along this axis has no meaning.
    Open,
}

/// The box [0, L) per axis. In two dimensions the z axis is `Open`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Domain {
    /// Edge lengths L [length].
    pub size: DVec3,
    /// The boundary along each axis.
    pub boundary: [Boundary; 3],
    /// Common acceleration of all bodies of finite mass [length/time²]; zero along periodic axes.
    pub gravity: DVec3,
    /// Simple shear; only if all axes are periodic, and not with a compression.
    pub shear: Option<Shear>,
    /// Compression or expansion; not along open axes, and along periodic ones not with gravity.
    pub compression: Option<Compression>,
}

impl Domain {
    /// Edge lengths at a time of the run \[length\].
    #[must_use]
    pub fn edges(&self, time: f64) -> DVec3 {
        self.compression.map_or(self.size, |compression| compression.edges(self.size, time))
    }

    /// The part of the box in which the particles are: 1 without a container that shrinks with it.
    fn inside(&self) -> f64 {
        self.compression.map_or(1.0, |compression| compression.inside)
    }

    /// Volume at a time of the box, or inside of a container that shrinks with it, in two dimensions the
    /// area [length^d].
    #[must_use]
    pub fn volume(&self, dimension: Dimension, time: f64) -> f64 {
        self.inside() * self.edges(time).to_array()[..dimension.count()].iter().product::<f64>()
    }

    /// The volume by which sums over an interval are divided for means of the pressure [length^d]: along axes
    /// with walls the mean edge; along periodic ones that at time 0, because the sums have weights there.
    pub(crate) fn mean_volume(&self, dimension: Dimension, [from, to]: [f64; 2]) -> f64 {
        let mean = self.edges(0.5 * (from + to));
        let edge = |axis: usize| {
            if self.boundary[axis] == Boundary::Periodic { self.size[axis] } else { mean[axis] }
        };
        self.inside() * (0..dimension.count()).map(edge).product::<f64>()
    }
}

/// Properties shared by particles: size, mass and contact group.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Class {
    /// Radius R > 0 [length].
    pub radius: f64,
    /// Mass m > 0 [mass]; infinite for fixed and driven bodies, which gravity and impulses do not affect.
    pub mass: f64,
    /// Contact group: row of the tables in [`Contacts`], index into [`System::groups`].
    pub group: u32,
}

/// Initial state of one particle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Body {
    /// Position of the center [length]; within [0, L) along periodic axes.
    pub position: DVec3,
    /// Velocity [length/time].
    pub velocity: DVec3,
    /// Box image per axis: how often the center has left the box through the upper face minus through the
    /// lower.
    pub image: [i32; 3],
    /// Index into [`System::classes`].
    pub class: u32,
    /// Species as written to output files: species in scene order, then named particles.
    pub species: u32,
}

/// Particles with the same contact laws: a species, or the explicit particles of one name.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Group {
    /// Name as in the scene.
    pub name: String,
}

/// A plane wall. Particles are on the side to which `normal` points; the other side is solid, unless it is a
/// partition.
#[derive(Debug, Clone, PartialEq)]
pub struct Wall {
    /// Name as in the scene; `x-`, `x+`, … for the walls of the domain.
    pub name: String,
    /// A point of the plane at the reference time of a constant velocity, or on average [length]; of another
    /// shape its displacement from where its surface has it.
    pub point: DVec3,
    /// Unit normal, towards the particles; of another shape the direction of its oscillation, or 0.
    pub normal: DVec3,
    /// Its motion.
    pub motion: WallMotion,
    /// Its shape, if it is no half-space: the same plane with particles on both sides, or another surface. No
    /// grain rests on it.
    pub shape: Option<Shape>,
}

impl Wall {
    /// The surface of a wall that is neither a half-space nor a partition.
    pub(crate) fn surface(&self) -> Option<&'static dyn Surface> {
        match self.shape {
            Some(Shape::Named(named)) => Some(named.get()),
            Some(Shape::Partition(_)) | None => None,
        }
    }

    /// The motion of a wall of finite mass.
    pub(crate) fn piston(&self) -> Option<&Piston> {
        match &self.motion {
            WallMotion::Piston(piston) => Some(piston),
            _ => None,
        }
    }

    /// Signed distance of a position from the wall at a time \[length\]; of a partition, and of a surface
    /// with particles on both sides, without sign.
    #[must_use]
    pub fn distance(&self, position: DVec3, at: impl WallTime) -> f64 {
        match &self.shape {
            None => (position - (self.point + self.motion.displacement(self.normal, at))).dot(self.normal),
            Some(shape) => {
                let scale = self.motion.scale(at);
                scale * shape.surface().distance((position - self.moved(at)) / scale)
            }
        }
    }

    /// Where the coordinates of the surface begin at its reference time or on average \[length\]: those of a
    /// partition are those of the box.
    pub(crate) fn origin(&self) -> DVec3 {
        if matches!(self.shape, Some(Shape::Partition(_))) { DVec3::ZERO } else { self.point }
    }

    /// Where the coordinates of the surface begin at a time \[length\].
    pub(crate) fn moved(&self, at: impl WallTime) -> DVec3 {
        self.origin() + self.motion.displacement(self.normal, at)
    }

    /// Unit normal of the wall at the point that is the nearest to a position at a time: the gradient of the
    /// distance.
    #[must_use]
    pub fn normal_at(&self, position: DVec3, at: impl WallTime) -> DVec3 {
        match &self.shape {
            None => self.normal,
            Some(shape) => shape.surface().normal((position - self.moved(at)) / self.motion.scale(at)),
        }
    }

    /// The largest coordinates of a wall that has an end; of one without, those of a point \[length\].
    pub(crate) fn coordinates(&self) -> DVec3 {
        let around = match self.surface().map(Surface::bounds) {
            Some((center, extent)) if extent.is_finite() => center.abs() + extent,
            _ => DVec3::ZERO,
        };
        self.point.abs() + around
    }
}

/// Laws of impact of every pair of contact groups and of every group with every wall.
#[derive(Debug, Clone, PartialEq)]
pub struct Contacts {
    /// Row-major `groups × groups`, symmetric.
    pub pair: Vec<Restitution>,
    /// Row-major `groups × walls`.
    pub wall: Vec<WallLaw>,
    /// Contact duration of the TC model [time]: a contact within `tc` of the last contact of either body is
    /// elastic. 0 turns the model off.
    pub tc: f64,
    /// The speed v of rest under gravity [length/time]: supported particles slower than v/2 are put to rest.
    /// 0: never.
    pub rest_speed: f64,
}

impl Contacts {
    /// Whether no contact ever loses energy.
    #[must_use]
    pub fn are_elastic(&self) -> bool {
        self.pair.iter().all(|&law| law == Restitution::Constant(1.0))
            && self.wall.iter().all(WallLaw::is_elastic)
    }
}

/// The complete input of the engine, already validated.
#[derive(Debug, Clone, PartialEq)]
pub struct System {
    /// 2 or 3.
    pub dimension: Dimension,
    /// Box, boundaries and gravity.
    pub domain: Domain,
    /// Particles in output order.
    pub bodies: Vec<Body>,
    /// Sizes and masses.
    pub classes: Vec<Class>,
    /// Contact groups.
    pub groups: Vec<Group>,
    /// Names of species by [`Body::species`].
    pub species: Vec<String>,
    /// Walls: those of the domain first (`x-`, `x+`, `y-`, …), then those of the scene.
    pub walls: Vec<Wall>,
    /// Laws of impact.
    pub contacts: Contacts,
    /// Spins and rough contacts; `None` for smooth particles.
    pub spin: Option<Spin>,
    /// A drag on all particles.
    pub drag: Option<Drag>,
    /// Drives: actions that add energy to the particles, or remove it, at stated times.
    pub drives: Vec<Drive>,
    /// Seed of the random numbers of drives and walls.
    pub seed: u64,
    /// What to measure while the run goes on.
    pub measure: Measure,
    /// Inlets and outlets, if there are any.
    pub flow: Option<Box<Flow>>,
}

impl System {
    /// The walls that are pistons, by their indices.
    pub fn pistons(&self) -> impl Iterator<Item = (usize, &Piston)> {
        self.walls.iter().enumerate().filter_map(|(index, wall)| Some((index, wall.piston()?)))
    }

    /// Number of walls that are pistons.
    #[must_use]
    pub fn piston_count(&self) -> usize {
        self.pistons().count()
    }

    /// The bodies that are there at the start: all, unless others come in by inlets.
    #[must_use]
    pub fn bodies_at_start(&self) -> &[Body] {
        let present = self.flow.as_ref().map_or(self.bodies.len(), |flow| flow.present);
        &self.bodies[..present.min(self.bodies.len())]
    }

    /// The system with those of its bodies only that have these indices.
    pub(crate) fn with_bodies(mut self, ids: &[u32]) -> Self {
        self.bodies = ids.iter().map(|&id| self.bodies[id as usize]).collect();
        if let Some(spin) = &mut self.spin {
            spin.angular_velocity = ids.iter().map(|&id| spin.angular_velocity[id as usize]).collect();
        }
        self
    }
}

/// The search for collision partners. The choice never changes the trajectory.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum NeighborChoice {
    /// The engine chooses, depending on the system.
    #[default]
    Auto,
    /// A grid of cells whose width is at least the largest diameter.
    Cells,
    /// Windows of time: all contacts within a window are found together, with a grid. For gases in closed
    /// boxes.
    Windows,
    /// Neighbor lists: for each particle those within a shell around it.
    Lists,
    /// Every pair is tested: for very small systems, and the reference for every other method.
    AllPairs,
}

/// The instructions of the prediction kernel. The choice never changes the trajectory.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum SimdChoice {
    /// The best kernel that the processor supports.
    #[default]
    Auto,
    /// 256-bit vectors (AVX2); an error if the processor does not support them.
    Avx2,
    /// The baseline instructions of the target.
    Portable,
}

/// Choices of algorithm; none of them changes the trajectory.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Options {
    /// The search for collision partners.
    pub neighbors: NeighborChoice,
    /// The prediction kernel.
    pub simd: SimdChoice,
    /// Number of blocks of space whose events are taken at the same time, as long as the scene uses windows
    /// and suits; 1 for one event after the other. `None`: that of threads, in large systems.
    pub blocks: Option<u16>,
}

impl NeighborChoice {
    /// The name in scene files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Auto => "auto",
            Self::Cells => "cells",
            Self::Windows => "windows",
            Self::Lists => "lists",
            Self::AllPairs => "all_pairs",
        }
    }
}
