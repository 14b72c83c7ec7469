//! Velocities of a system before it moves, for estimates.

use glam::DVec3;

use crate::{
    model::{Body, System, conserved::common_velocity},
    state::deformation::Deformation,
};

/// Velocities of all bodies at the start relative to the flow of a box that deforms, and to the center of
/// mass of those of finite mass.
pub fn thermal_velocities(system: &System) -> impl Iterator<Item = DVec3> {
    let images = Deformation::of(system);
    let relative = move |body: &Body| {
        let flow = images.map_or(DVec3::ZERO, |images| images.velocity(body.position, 0.0));
        body.velocity - flow
    };
    let (mut mass, mut momentum) = (0.0, DVec3::ZERO);
    for body in system.bodies_at_start() {
        let own = system.classes[body.class as usize].mass;
        if own.is_finite() {
            mass += own;
            momentum += own * relative(body);
        }
    }
    let common = if mass > 0.0 { momentum / mass } else { DVec3::ZERO };
    system.bodies_at_start().iter().map(move |body| relative(body) - common)
}

/// Temperature of a system at the start, the one of [`Sample::temperature`](crate::Sample::temperature)
/// \[energy\]; `None` without bodies of finite mass. Momentum is conserved along these axes
/// ([`conserved_momentum`]).
#[must_use]
pub fn initial_temperature(system: &System, conserved: [bool; 3]) -> Option<f64> {
    let images = Deformation::of(system);
    let peculiar = |body: &Body| {
        body.velocity - images.map_or(DVec3::ZERO, |images| images.velocity(body.position, 0.0))
    };
    let movable = || {
        let bodies = system.bodies_at_start().iter();
        let all = bodies.map(|body| (system.classes[body.class as usize].mass, peculiar(body)));
        all.filter(|(mass, _)| mass.is_finite())
    };
    let (count, mass) = (movable().count() as f64, movable().map(|(mass, _)| mass).sum());
    let momentum = movable().map(|(mass, velocity)| mass * velocity).sum();
    let common = common_velocity(momentum, mass, conserved);
    let sum: f64 = movable().map(|(mass, velocity)| mass * (velocity - common).length_squared()).sum();
    (count > 0.0).then(|| sum / (system.dimension.count() as f64 * count))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        model::{Dimension, Shear},
        simulation::clustering::tests::gas,
    };

    #[test]
    fn a_motion_in_common_and_a_flow_do_not_change_thermal_velocities() {
        let mut system = gas(Dimension::Three, 64, 8.0, 0.8);
        for (k, body) in system.bodies.iter_mut().enumerate() {
            let angle = k as f64;
            body.velocity = DVec3::new(angle.sin(), angle.cos(), (2.0 * angle).sin());
            body.position = DVec3::new(0.1 * angle, 8.0 - 0.1 * angle, 0.0);
        }
        let plain = thermal_velocities(&system).collect::<Vec<_>>();
        let shear = Shear { flow: 0, gradient: 1, rate: 3.0, offset: 0.0 };
        system.domain.shear = Some(shear);
        for body in &mut system.bodies {
            body.velocity += DVec3::new(3.0 * body.position.y, 0.0, 0.0) + DVec3::new(20.0, -5.0, 1.0);
        }
        for (found, expected) in thermal_velocities(&system).zip(plain) {
            assert!((found - expected).length() < 1e-13, "{found} and {expected}");
        }
    }
}
