//! When a freely cooling gas clusters, and the contact duration that keeps it from collapsing.

use std::f64::consts::PI;

use glam::DVec3;
use haff_mechanics::Restitution;

use crate::{
    model::{Boundary, Dimension, System, wall_law::WallLaw},
    simulation::initial::thermal_velocities,
};

/// Largest ratio of the contact duration to the time in which a particle moves by its diameter: contacts of
/// the TC model are then far shorter than the time between collisions, except in a collapse.
const DURATION: f64 = 1e-4;

/// Critical length L_c of a freely cooling gas \[length\]: a homogeneous gas in a longer box is unstable and
/// clusters.
///
/// L_c = 2.43/(nσ²√(1 − e²)) for spheres and 2√π/(nσ√(1 − e²)) for disks, with the number density n, the mean
/// diameter σ and the smallest e of all pairs (docs/theory.md). `None` unless the gas cools freely with a
/// constant e < 1 and smooth contacts: without the TC model, gravity, drives, drag, shear, and open axes.
pub fn critical_length(system: &System) -> Option<f64> {
    let axes = system.dimension.count();
    let closed = !system.domain.boundary[..axes].contains(&Boundary::Open);
    let free = system.domain.gravity == DVec3::ZERO
        && system.domain.shear.is_none()
        && system.domain.compression.is_none()
        && system.drives.is_empty()
        && system.drag.is_none();
    let moved = system.walls.iter().any(|wall| wall.motion.is_moving())
        || system.contacts.wall.iter().any(WallLaw::is_thermal)
        || system.classes.iter().any(|class| class.mass.is_infinite());
    if system.flow.is_some() || !closed || !free || moved || system.contacts.tc > 0.0 || system.spin.is_some()
    {
        return None;
    }
    let mut least = 1.0_f64;
    for law in &system.contacts.pair {
        let Restitution::Constant(e) = law else { return None };
        least = least.min(*e);
    }
    let count = system.bodies.len() as f64;
    let volume: f64 = system.domain.size.to_array()[..axes].iter().product();
    let radii = system.bodies.iter().map(|body| system.classes[body.class as usize].radius);
    let (density, diameter) = (count / volume, 2.0 * radii.sum::<f64>() / count);
    let loss = (1.0 - least * least).sqrt();
    let length = match system.dimension {
        Dimension::Two => 2.0 * PI.sqrt() / (density * diameter * loss),
        Dimension::Three => 2.43 / (density * diameter * diameter * loss),
    };
    (least < 1.0 && system.bodies.len() > 1).then_some(length)
}

/// A value for `contact.tc` that suits the system \[time\]: a power of ten, at most 10⁻⁴ of the time in which
/// a particle moves by its diameter. `None` if nothing moves.
pub fn suitable_contact_duration(system: &System) -> Option<f64> {
    // A motion in common does not shorten contacts.
    let movable = || {
        let classes = system.bodies_at_start().iter().map(|body| &system.classes[body.class as usize]);
        thermal_velocities(system).zip(classes).filter(|(_, class)| class.mass.is_finite())
    };
    let count = movable().count().max(1) as f64;
    let diameter = 2.0 * movable().map(|(_, class)| class.radius).sum::<f64>() / count;
    let square = movable().map(|(velocity, _)| velocity.length_squared()).sum::<f64>() / count;
    // The speed of a fall by a diameter.
    let speed = square.max(system.domain.gravity.length() * diameter).sqrt();
    let duration = DURATION * diameter / speed;
    // As text, since a product of tens is rounded.
    let power_of_ten = || format!("1e{}", duration.log10().floor()).parse().ok();
    if speed > 0.0 && duration > 0.0 { power_of_ten() } else { None }
}

/// A warning for a scene that may end in an inelastic collapse, as text without a final point.
pub fn clustering_warning(system: &System) -> Option<String> {
    let length = critical_length(system)?;
    let axes = system.dimension.count();
    let edge = system.domain.size.to_array()[..axes].iter().copied().fold(0.0, f64::max);
    let remedy = suitable_contact_duration(system)?;
    (edge > length).then(|| {
        format!(
            "the box, {} long, exceeds the critical length L_c = {}: the gas will cluster, and with a constant \
             restitution it may end in an inelastic collapse; set contact.tc, for example {remedy:e}",
            crate::significant(edge, 4),
            crate::significant(length, 4)
        )
    })
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::model::{Body, Class, Contacts, Domain, Group, Measure};

    /// N disks or spheres of diameter 1 and speed 1 in a periodic box of edge `edge`.
    pub(crate) fn gas(dimension: Dimension, count: usize, edge: f64, e: f64) -> System {
        // Half of them move to either side.
        let body = |k: usize| {
            let velocity = if k.is_multiple_of(2) { DVec3::X } else { DVec3::NEG_X };
            Body { position: DVec3::ZERO, velocity, image: [0; 3], class: 0, species: 0 }
        };
        System {
            dimension,
            domain: Domain {
                size: DVec3::splat(edge),
                boundary: [Boundary::Periodic; 3],
                gravity: DVec3::ZERO,
                shear: None,
                compression: None,
            },
            bodies: (0..count).map(body).collect(),
            classes: vec![Class { radius: 0.5, mass: 1.0, group: 0 }],
            groups: vec![Group { name: "grain".into() }],
            species: vec!["grain".into()],
            walls: Vec::new(),
            contacts: Contacts {
                pair: vec![Restitution::Constant(e)],
                wall: Vec::new(),
                tc: 0.0,
                rest_speed: 0.0,
            },
            spin: None,
            drag: None,
            drives: Vec::new(),
            seed: 0,
            measure: Measure::default(),
            flow: None,
        }
    }

    #[test]
    fn critical_length_is_that_of_the_theory() {
        // n = 1/8 and √(1 − e²) = 0.6.
        let spheres = critical_length(&gas(Dimension::Three, 64, 8.0, 0.8)).unwrap();
        assert!((spheres / (2.43 * 8.0 / 0.6) - 1.0).abs() < 1e-14, "{spheres}");
        let disks = critical_length(&gas(Dimension::Two, 32, 16.0, 0.8)).unwrap();
        assert!((disks / (2.0 * PI.sqrt() * 8.0 / 0.6) - 1.0).abs() < 1e-14, "{disks}");
        assert_eq!(clustering_warning(&gas(Dimension::Three, 64, 8.0, 0.8)), None);
        let warning = clustering_warning(&gas(Dimension::Three, 512_000, 160.0, 0.8)).unwrap();
        assert!(warning.contains("160 long") && warning.contains("L_c = 32.4"), "{warning}");
        assert!(warning.ends_with("for example 1e-4"), "{warning}");
    }

    #[test]
    fn gases_that_do_not_cool_freely_have_no_critical_length() {
        let plain = || gas(Dimension::Three, 64, 8.0, 0.8);
        assert!(critical_length(&plain()).is_some());
        let mut changed = [plain(), plain(), plain(), gas(Dimension::Three, 64, 8.0, 1.0)];
        changed[0].contacts.tc = 1e-5;
        changed[1].domain.gravity = -DVec3::Z;
        changed[2].domain.boundary[2] = Boundary::Open;
        assert_eq!(changed.map(|system| critical_length(&system)), [None; 4]);
    }
}
