//! The flow of a domain that deforms: the mean velocity at every place.

use glam::DVec3;
use haff_engine::{Boundary, ConstantVelocity, Domain, System, WallMotion, thermal_velocities};

use super::particles::{Initial, Rows, SpeciesPlan};
use crate::model::state::State;

/// Velocity of the flow at a position, at time 0 [length/time]. Between walls that approach each other there
/// is none: the walls give it to the particles.
pub(super) fn velocity(domain: &Domain, position: DVec3) -> DVec3 {
    if let Some(shear) = domain.shear {
        return DVec3::AXES[shear.flow] * (shear.rate * position[shear.gradient]);
    }
    let Some(compression) = domain.compression else { return DVec3::ZERO };
    let mut flow = DVec3::ZERO;
    for axis in (0..3).filter(|&axis| domain.boundary[axis] == Boundary::Periodic) {
        flow[axis] = -compression.rates[axis] * position[axis];
    }
    flow
}

/// The change of velocity of a particle that only the `precision` of its file has put beyond a face of the
/// box. Other positions outside the box are images of particles whose velocities are those in the box.
fn change_at_rounded_faces(domain: &Domain, position: DVec3, precision: f64) -> DVec3 {
    if precision == 0.0 || domain.shear.is_none() && domain.compression.is_none() {
        return DVec3::ZERO;
    }
    let mut change = DVec3::ZERO;
    for axis in (0..3).filter(|&axis| domain.boundary[axis] == Boundary::Periodic) {
        let (x, edge) = (position[axis], domain.size[axis]);
        let rounding = 2.0 * precision * edge;
        let across = if (edge..=edge + rounding).contains(&x) {
            -1.0
        } else if (-rounding..0.0).contains(&x) {
            1.0
        } else {
            continue;
        };
        change += velocity(domain, DVec3::AXES[axis] * edge) * across;
    }
    change
}

/// Adds the flow to the velocities that the scene has drawn: those of species with a temperature.
pub(super) fn add(
    domain: &Domain,
    species: &[SpeciesPlan],
    rows: &mut Rows,
    initial: &Initial,
    state: Option<&State>,
) {
    if domain.shear.is_none() && domain.compression.is_none() {
        return;
    }
    let mut row = 0;
    for plan in species {
        let drawn = plan.temperature.or(initial.temperature).is_some();
        for (k, body) in rows.bodies[row..row + plan.count].iter_mut().enumerate() {
            if drawn {
                body.velocity += velocity(domain, body.position);
            } else if let Some(state) = state {
                body.velocity += change_at_rounded_faces(domain, state.position[row + k], state.precision);
            }
        }
        row += plan.count;
    }
}

/// Velocities relative to the flow and to the center of mass, at the start [length/time].
pub(super) fn thermal(system: &System) -> Vec<DVec3> {
    if system.domain.compression.is_none() {
        return thermal_velocities(system).collect();
    }
    let relative: Vec<DVec3> =
        system.bodies.iter().map(|body| body.velocity - velocity(&system.domain, body.position)).collect();
    let (mut mass, mut momentum) = (0.0, DVec3::ZERO);
    for (body, velocity) in system.bodies.iter().zip(&relative) {
        let own = system.classes[body.class as usize].mass;
        if own.is_finite() {
            mass += own;
            momentum += own * *velocity;
        }
    }
    let common = if mass > 0.0 { momentum / mass } else { DVec3::ZERO };
    relative.into_iter().map(|velocity| velocity - common).collect()
}

/// The motion of the upper wall of an axis; the lower one stays.
pub(super) fn motion_of_upper_wall(domain: &Domain, axis: usize) -> WallMotion {
    let rate = domain.compression.map_or(0.0, |compression| compression.rates[axis]);
    if rate == 0.0 {
        return WallMotion::Fixed;
    }
    let velocity = DVec3::AXES[axis] * (-rate * domain.size[axis]);
    WallMotion::Constant(ConstantVelocity { velocity, reference_time: 0.0 })
}
