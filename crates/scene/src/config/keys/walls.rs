//! Keys of `[[wall]]`.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::config::{keys::contact::RestitutionConfig, named::names_of_surfaces};

/// A wall: a plane, which fills the half-space behind it, or another shape.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
#[schemars(extend("required" = ["name"]))]
pub struct WallConfig {
    /// Name, used by `contact.pair`. The name of a wall of `domain.boundary` (`x-`, `x+`, `y-`, …) without a
    /// shape sets that wall's properties.
    pub name: Option<String>,
    /// Its plane.
    pub plane: Option<PlaneConfig>,
    /// Instead of a plane, a cylinder; in two dimensions a circle.
    pub cylinder: Option<CylinderConfig>,
    /// Instead of a plane, a sphere; in two dimensions a circle.
    pub sphere: Option<SphereConfig>,
    /// Instead of a plane, a cone; in two dimensions a wedge.
    pub cone: Option<ConeConfig>,
    /// Instead of a plane, a mesh of triangles. Only in three dimensions.
    pub mesh: Option<MeshConfig>,
    /// Instead of a plane, a surface that the program has from another crate.
    #[schemars(schema_with = "names_of_surfaces")]
    pub surface: Option<String>,
    /// Parameters of the surface.
    pub parameters: Option<BTreeMap<String, serde_json::Value>>,
    /// Restitution of contacts with this wall; default `contact.wall_restitution`. On a thermal wall, of the
    /// reflections that are not thermal.
    pub restitution: Option<RestitutionConfig>,
    /// Speed Δ ≥ 0 of the Δ model [length/time]: each contact adds 2 Δ to the speed of separation. Default
    /// `contact.added_speed`.
    #[schemars(range(min = 0.0))]
    pub added_speed: Option<f64>,
    /// Coefficient of tangential restitution β of rough contacts, in [−1, 1]: −1 smooth, 1 perfectly rough.
    /// Default `contact.tangential_restitution`.
    #[schemars(range(min = -1.0, max = 1.0))]
    pub tangential_restitution: Option<f64>,
    /// Coulomb's coefficient of friction μ, which bounds the tangential impulse of a rough contact by μ times
    /// the normal one. Default `contact.friction`.
    #[schemars(range(min = 0.0))]
    pub friction: Option<f64>,
    /// `true`: all particles stick to this wall, except those with a `contact.pair`. Default false.
    pub sticks: Option<bool>,
    /// Temperature of a thermal wall \[energy\], which particles leave with velocities of that temperature.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub temperature: Option<f64>,
    /// Probability that a reflection from a thermal wall is thermal; default 1. Otherwise
    /// `contact.wall_restitution` applies.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub accommodation: Option<f64>,
    /// Velocity of the wall [length/time]; default 0. A wall of `domain.boundary` moves along itself: rough
    /// and thermal contacts are with the moving surface. In a run that goes on the wall moves so from where
    /// it is; zero stops it there, also an oscillation.
    #[schemars(length(min = 2, max = 3))]
    pub velocity: Option<Vec<f64>>,
    /// Time at which a wall with a velocity goes through its `plane.point` [time]; default 0. Set when a run
    /// goes on with another velocity.
    pub reference_time: Option<f64>,
    /// Displacement of a wall of `domain.boundary` from its face, to the inside [length]; default 0. Set when
    /// a run goes on with another amplitude. Other walls have their `plane.point`.
    pub displacement: Option<f64>,
    /// Displacement of a shape that is no plane from where its own keys have it [length]; default 0. Set when
    /// a run goes on with another velocity or amplitude.
    #[schemars(length(min = 2, max = 3))]
    pub offset: Option<Vec<f64>>,
    /// Oscillation along the normal, of other shapes than planes along `motion.direction`; also of a wall of
    /// `domain.boundary`.
    pub motion: Option<MotionConfig>,
    /// Rotation of a cylinder, a cone or a sphere about its axis, or of a plane about a normal: the place of
    /// its surface does not change, and rough or thermal contacts are with the moving surface.
    pub rotation: Option<RotationConfig>,
    /// Mass of a piston \[mass\]: a plane that moves along its normal as a body of this mass, by its impacts,
    /// its load and its weight. Its `velocity` is that at the start.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub mass: Option<f64>,
    /// Constant load on a piston along its normal, besides its weight [mass length/time²]; default 0.
    /// Positive values push it to the side of the particles.
    pub force: Option<f64>,
    /// Names of species, or of particles, that pass through this wall. Default: none.
    pub passes: Option<Vec<String>>,
}

/// A rotation about an axis.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
#[schemars(extend("required" = ["rate"]))]
pub struct RotationConfig {
    /// Direction of the axis; need not have unit length. Default: the axis of the shape, the normal of a
    /// plane; in two dimensions z.
    #[schemars(length(min = 3, max = 3))]
    pub axis: Option<Vec<f64>>,
    /// A point of the axis [length]. Default: that of the shape.
    #[schemars(length(min = 2, max = 3))]
    pub point: Option<Vec<f64>>,
    /// Angular velocity, positive by the right-hand rule about the axis [1/time].
    pub rate: Option<f64>,
}

/// The side of a surface on which the particles are.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum SideConfig {
    /// Inside: the shape is a container.
    Inside,
    /// Outside: the shape is an obstacle.
    Outside,
    /// On both sides of a surface without thickness.
    Both,
}

/// A cylinder.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
#[schemars(extend("required" = ["point", "radius"]))]
pub struct CylinderConfig {
    /// A point of its axis [length]; if it has a `length`, the center of one end.
    #[schemars(length(min = 2, max = 3))]
    pub point: Option<Vec<f64>>,
    /// Direction of its axis; need not have unit length. In two dimensions default z: a circle.
    #[schemars(length(min = 2, max = 3))]
    pub axis: Option<Vec<f64>>,
    /// Its radius [length].
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub radius: Option<f64>,
    /// Its length along the axis [length]: it has flat ends then, but for `side = "both"`. Default: without
    /// end.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub length: Option<f64>,
    /// Where the particles are: `inside` (default), `outside`, or `both`, of a tube without thickness.
    pub side: Option<SideConfig>,
}

/// A sphere.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
#[schemars(extend("required" = ["center", "radius"]))]
pub struct SphereConfig {
    /// Its center [length].
    #[schemars(length(min = 2, max = 3))]
    pub center: Option<Vec<f64>>,
    /// Its radius [length].
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub radius: Option<f64>,
    /// Where the particles are: `inside` (default), `outside`, or `both`, of a shell without thickness.
    pub side: Option<SideConfig>,
}

/// A cone; its apex may be cut off.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
#[schemars(extend("required" = ["apex", "axis", "angle"]))]
pub struct ConeConfig {
    /// Its apex [length].
    #[schemars(length(min = 2, max = 3))]
    pub apex: Option<Vec<f64>>,
    /// Direction from the apex into the cone; need not have unit length.
    #[schemars(length(min = 2, max = 3))]
    pub axis: Option<Vec<f64>>,
    /// Angle between the axis and the surface, below π/2 [radians].
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub angle: Option<f64>,
    /// Where it begins, along the axis from the apex [length]; default 0. It has a flat end there, but for
    /// `side = "both"`.
    #[schemars(range(min = 0.0))]
    pub start: Option<f64>,
    /// Where it ends, along the axis from the apex [length]: it has a flat end there, but for
    /// `side = "both"`. Default: without end.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub length: Option<f64>,
    /// Where the particles are: `inside` (default), `outside`, or `both`, of a funnel without thickness.
    pub side: Option<SideConfig>,
}

/// A mesh of triangles.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
#[schemars(extend("required" = ["file"]))]
pub struct MeshConfig {
    /// An STL or OBJ file, relative to the current directory or to that of the scene.
    pub file: Option<String>,
    /// Factor of all its coordinates; default 1: 0.001 for a drawing in millimetres.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub scale: Option<f64>,
    /// Where its origin is [length]; default 0.
    #[schemars(length(min = 3, max = 3))]
    pub point: Option<Vec<f64>>,
    /// Rotation about its origin, before it is displaced: axis, and angle by the right-hand rule [radians].
    pub rotation: Option<(Vec<f64>, f64)>,
    /// Where the particles are: `inside` or `outside` of a closed mesh, or on `both` sides of any (default).
    pub side: Option<SideConfig>,
    /// Hash of the file, set by the program: a run goes on only with the mesh with which it began.
    pub hash: Option<String>,
}

/// The oscillation of a wall: a shift along its normal, about its given position.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
#[schemars(extend("required" = ["kind", "amplitude", "frequency"]))]
pub struct MotionConfig {
    /// Form of the shift.
    pub kind: Option<MotionKindConfig>,
    /// Largest shift A [length].
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub amplitude: Option<f64>,
    /// Cycles in a unit of time, f [1/time].
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub frequency: Option<f64>,
    /// Phase at time 0 [radians]; default 0, in a run that goes on the phase that the wall has.
    pub phase: Option<f64>,
    /// Direction of the shift of a shape that is no plane; need not have unit length.
    #[schemars(length(min = 2, max = 3))]
    pub direction: Option<Vec<f64>>,
}

/// Form of an oscillation.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum MotionKindConfig {
    /// A sin(2π f t + phase)
    Sine,
    /// Between ±A at the constant speed 4 A f, in phase with the sine.
    Triangle,
}

impl WallConfig {
    /// Whether the entry is for the wall of the boundary that has this name.
    pub(crate) fn names_boundary(&self, name: &str) -> bool {
        let is_boundary = name.len() == 2 && "xyz".contains(&name[..1]) && "-+".contains(&name[1..]);
        !self.has_shape() && is_boundary && self.name.as_deref() == Some(name)
    }

    /// The keys that give the entry a shape of its own, and whether they are there.
    pub(crate) fn shapes(&self) -> [(&'static str, bool); 6] {
        [
            ("plane", self.plane.is_some()),
            ("cylinder", self.cylinder.is_some()),
            ("sphere", self.sphere.is_some()),
            ("cone", self.cone.is_some()),
            ("mesh", self.mesh.is_some()),
            ("surface", self.surface.is_some()),
        ]
    }

    /// Whether the entry is a wall of its own, not one of the boundary.
    pub(crate) fn has_shape(&self) -> bool {
        self.shapes().iter().any(|(_, given)| *given)
    }
}

/// A plane.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
#[schemars(extend("required" = ["point", "normal"]))]
pub struct PlaneConfig {
    /// A point of the plane [length]: of a wall with a velocity at its `reference_time`, of one that
    /// oscillates at its mean position.
    #[schemars(length(min = 2, max = 3))]
    pub point: Option<Vec<f64>>,
    /// Normal to the inside, where the particles are; need not have unit length. Its components along
    /// periodic axes must be exactly 0, so that the plane repeats with the box.
    #[schemars(length(min = 2, max = 3))]
    pub normal: Option<Vec<f64>>,
    /// A round hole; in two dimensions a gap. The plane is then a partition, with particles on both sides.
    pub hole: Option<HoleConfig>,
    /// `true`: a partition without a hole. Default false: behind the plane is nothing.
    #[serde(rename = "two-sided")]
    pub two_sided: Option<bool>,
    /// Edges of a rectangle around `point` [length], which has particles on both sides: the first along
    /// `along`, the second perpendicular to it; in two dimensions the length of a line. Default: without end.
    #[schemars(length(min = 1, max = 2))]
    pub extent: Option<Vec<f64>>,
    /// Direction of the first edge of `extent`, in the plane. Default: the first axis that is the nearest to
    /// the plane, x for a normal along z.
    #[schemars(length(min = 3, max = 3))]
    pub along: Option<Vec<f64>>,
}

/// A hole in a plane.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
#[schemars(extend("required" = ["center", "radius"]))]
pub struct HoleConfig {
    /// Its center, a point of the plane [length].
    #[schemars(length(min = 2, max = 3))]
    pub center: Option<Vec<f64>>,
    /// Its radius [length], larger than that of every particle.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub radius: Option<f64>,
}
