//! What is simulated: particles, walls, contact rules and the domain, as plain validated data.

use glam::DVec3;
pub use haff_mechanics::Restitution;

pub use crate::{
    drive::{Drive, DriveKind},
    wall_law::WallLaw,
    wall_motion::WallMotion,
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
}

/// What limits the domain along one axis.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Boundary {
    /// The domain repeats.
    Periodic,
    /// Two plane walls at 0 and at L; they stand in [`System::walls`] like any other wall.
    Wall,
    /// Unbounded; the size of the domain is a placeholder.
    Open,
}

/// The box [0, L) per axis. In two dimensions the z axis is `Open`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Domain {
    /// Edge lengths L [length].
    pub size: DVec3,
    /// What happens at the faces of each axis.
    pub boundary: [Boundary; 3],
    /// Common acceleration of all bodies of finite mass [length/time²]; zero along periodic axes.
    pub gravity: DVec3,
}

/// What particles have in common: size and mass. Every particle names its class.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Class {
    /// Radius R > 0 [length].
    pub radius: f64,
    /// Mass m > 0 [mass]; infinite for fixed and driven bodies, which feel neither gravity nor impulses.
    pub mass: f64,
    /// Contact group: row of the tables in [`Contacts`], index into [`System::groups`].
    pub group: u32,
}

/// State of one particle at the start.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Body {
    /// Centre [length]; within [0, L) along periodic axes.
    pub position: DVec3,
    /// Velocity [length/time].
    pub velocity: DVec3,
    /// How often the centre has left the box through each periodic face (upper +1, lower −1).
    pub image: [i32; 3],
    /// Index into [`System::classes`].
    pub class: u32,
    /// Species as written to output files: species in scene order, then named particles.
    pub species: u32,
}

/// Particles that share contact rules: a species, or the explicit particles of one name.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Group {
    /// Name as in the scene.
    pub name: String,
}

/// A plane wall. It fills the half-space behind it; `normal` points to the inside.
#[derive(Debug, Clone, PartialEq)]
pub struct Wall {
    /// Name as in the scene; `x-`, `x+`, … for the walls of the domain.
    pub name: String,
    /// A point of the plane at time 0 [length].
    pub point: DVec3,
    /// Unit normal, towards the particles.
    pub normal: DVec3,
    /// How it moves.
    pub motion: WallMotion,
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
    /// Speed below which a supported particle is put to rest, where gravity acts [length/time]. 0: never.
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

/// Everything the engine needs to know, already validated.
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
    /// Contact rules.
    pub contacts: Contacts,
    /// What gives energy to the particles, or takes it, at stated times.
    pub drives: Vec<Drive>,
    /// Seed of the random numbers of drives and walls.
    pub seed: u64,
}

/// How partners are searched for. A choice never changes the trajectory.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum NeighborChoice {
    /// The engine chooses from the system.
    #[default]
    Auto,
    /// A grid of cells at least one largest diameter wide.
    Cells,
    /// Windows of time in which all pairs of a grid are tested at once: for gases in closed boxes, without
    /// gravity.
    Windows,
    /// Lists of those within a shell around each particle.
    Lists,
    /// Every pair is tested: for tiny systems, and the twin of every other method.
    AllPairs,
}

/// Which build of the prediction kernel runs. A choice never changes the trajectory.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum SimdChoice {
    /// The best the processor has.
    #[default]
    Auto,
    /// 256-bit vectors; an error where the processor has none.
    Avx2,
    /// Baseline instructions of the target.
    Portable,
}

/// Choices of machinery; none of them changes the trajectory.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Options {
    /// Partner search.
    pub neighbors: NeighborChoice,
    /// Prediction kernel.
    pub simd: SimdChoice,
}

impl NeighborChoice {
    /// The name scenes use.
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
