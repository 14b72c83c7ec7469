//! The axes along which momentum is conserved.
//!
//! Temperatures and pressures are relative to the velocity of the center of mass along them.

use glam::DVec3;

use crate::model::{
    Body, Boundary, Shape, System, Wall, drive::DriveKind, thresholds::Thresholds, wall_law::WallLaw,
};

/// A component of a unit normal that is not larger is a rounding error.
const ROUNDING: f64 = 1e-15;

/// Whether momentum along each axis is conserved, so that temperatures and pressures are relative to the
/// velocity of the center of mass along it. The system must have its bodies.
///
/// It is conserved along a periodic or open axis, unless along it there is gravity, a wall, or a wall that is
/// rough or thermal; and along no axis with a body of infinite mass, with an Andersen thermostat, a drag,
/// inlets or outlets, or where grains are put to rest. Under shear it is conserved along the axis that is
/// neither that of the flow nor that of the gradient: a motion of the center of mass along the gradient leads
/// to places where the flow is faster, and the shear does work on it. In a box that is compressed it is
/// conserved along no axis.
///
/// False for the z axis in two dimensions.
#[must_use]
pub fn conserved_momentum(system: &System) -> [bool; 3] {
    let is_held = has_body(system, f64::is_infinite)
        || has_bath(system)
        || Thresholds::of(system).is_some()
        || system.flow.is_some()
        || system.drag.is_some();
    [0, 1, 2].map(|axis| {
        let sheared = system.domain.shear.is_some_and(|shear| axis == shear.flow || axis == shear.gradient);
        let is_compressed = system.domain.compression.is_some();
        axis < system.dimension.count()
            && !is_held
            && !sheared
            && !is_compressed
            && system.domain.boundary[axis] != Boundary::Wall
            && system.domain.gravity[axis] == 0.0
            && !(0..system.walls.len()).any(|wall| pushes_along(system, wall, axis))
    })
}

/// Whether a body has such a mass.
fn has_body(system: &System, condition: impl Fn(f64) -> bool) -> bool {
    system.bodies.iter().any(|body| condition(system.classes[body.class as usize].mass))
}

/// Whether an Andersen thermostat, or another drive that changes momentum, acts on a particle.
fn has_bath(system: &System) -> bool {
    let acts = |species: &[u32]| {
        let is_driven = |body: &Body| {
            species.contains(&body.species) && system.classes[body.class as usize].mass.is_finite()
        };
        system.bodies.iter().any(is_driven)
    };
    let changes_momentum = |kind: DriveKind| match kind {
        DriveKind::Andersen { .. } => true,
        DriveKind::Rescale { .. } | DriveKind::Hold { .. } | DriveKind::WhiteNoise { .. } => false,
        DriveKind::Named(named) => !named.get().keeps_momentum(),
    };
    system.drives.iter().any(|drive| changes_momentum(drive.kind) && acts(&drive.species))
}

/// Whether impacts on a wall can change momentum along an axis.
fn pushes_along(system: &System, wall: usize, axis: usize) -> bool {
    let walls = system.walls.len();
    let Wall { normal, shape, .. } = &system.walls[wall];
    if system.contacts.wall.iter().skip(wall).step_by(walls).all(|law| *law == WallLaw::Passes) {
        return false;
    }
    let is_curved = shape.is_some_and(|shape| match shape {
        Shape::Partition(partition) => partition.hole.is_some(),
        Shape::Named(named) => !named.get().is_same_along(axis),
    });
    if normal[axis].abs() > ROUNDING || is_curved {
        return true;
    }
    // The axis is tangential.
    let exchanges = |law: &WallLaw| matches!(law, WallLaw::Thermal(wall) if wall.accommodation > 0.0);
    let thermal = system.contacts.wall.iter().skip(wall).step_by(walls).any(exchanges);
    let rough = system
        .spin
        .as_ref()
        .is_some_and(|spin| spin.wall.iter().skip(wall).step_by(walls).any(|law| !law.is_smooth()));
    thermal || rough
}

/// The components of a vector along these axes; the others are zero.
pub(crate) fn along(vector: DVec3, axes: [bool; 3]) -> DVec3 {
    DVec3::from_array([0, 1, 2].map(|axis| if axes[axis] { vector[axis] } else { 0.0 }))
}

/// The velocity that temperatures and pressures are relative to, of bodies with this total momentum and mass.
#[must_use]
pub fn common_velocity(momentum: DVec3, mass: f64, conserved: [bool; 3]) -> DVec3 {
    if mass > 0.0 { along(momentum / mass, conserved) } else { DVec3::ZERO }
}
