//! What a scene can be expected to do, from kinetic theory, before it runs.

use std::f64::consts::PI;

use haff_engine::{Dimension, System};

/// Sizes and masses are sorted into at most this many groups.
const GROUPS: usize = 60;

/// Particles of (nearly) one size and mass.
#[derive(Debug, Clone, Copy)]
struct Group {
    count: f64,
    diameter: f64,
    mass: f64,
}

/// Temperature T = Σ m|v − V|²/(dN) of the bodies of finite mass at the start.
pub fn temperature(system: &System) -> f64 {
    let movable = || {
        let all = system.bodies.iter().map(|body| (body.velocity, system.classes[body.class as usize].mass));
        all.filter(|(_, mass)| mass.is_finite())
    };
    let count = movable().count() as f64;
    let mass: f64 = movable().map(|(_, mass)| mass).sum();
    let drift = movable().map(|(velocity, mass)| velocity * mass).sum::<glam::DVec3>() / mass;
    let sum: f64 = movable().map(|(velocity, mass)| mass * (velocity - drift).length_squared()).sum();
    if count > 0.0 { sum / (system.dimension.count() as f64 * count) } else { 0.0 }
}

/// Sphere–sphere collisions per time in the box from Enskog's theory, with the contact values of Boublík, Mansoori,
/// Carnahan, Starling and Leland (3D) and of Jenkins and Mancini (2D); for one size they are Carnahan and
/// Starling's and Henderson's.
pub fn collision_rate(system: &System, temperature: f64) -> f64 {
    let groups = groups(system);
    let size = system.domain.size;
    let three = system.dimension == Dimension::Three;
    let volume = if three { size.x * size.y * size.z } else { size.x * size.y };
    // ξ_k = (π/6) Σ n d^k in 3D, (π/4) Σ n d^k in 2D; the largest k gives the packing fraction.
    let factor = if three { PI / 6.0 } else { PI / 4.0 };
    let moment = |k: i32| factor * groups.iter().map(|g| g.count * g.diameter.powi(k)).sum::<f64>() / volume;
    let (packing, lower) = if three { (moment(3), moment(2)) } else { (moment(2), moment(1)) };
    let free = 1.0 - packing;
    let mut rate = 0.0;
    for a in &groups {
        for b in &groups {
            let mean = a.diameter * b.diameter / (a.diameter + b.diameter);
            let sigma = 0.5 * (a.diameter + b.diameter);
            let reduced = a.mass * b.mass / (a.mass + b.mass);
            let pairs = a.count * b.count / volume;
            rate += if three {
                let g = 1.0 / free
                    + 3.0 * mean * lower / free.powi(2)
                    + 2.0 * (mean * lower).powi(2) / free.powi(3);
                0.5 * pairs * g * sigma * sigma * (8.0 * PI * temperature / reduced).sqrt()
            } else {
                let g = 1.0 / free + 9.0 / 8.0 * mean * lower / free.powi(2);
                0.5 * pairs * g * sigma * (2.0 * PI * temperature / reduced).sqrt()
            };
        }
    }
    rate
}

fn groups(system: &System) -> Vec<Group> {
    let mut bodies: Vec<(f64, f64)> = system
        .bodies
        .iter()
        .map(|body| system.classes[body.class as usize])
        .filter(|class| class.mass.is_finite())
        .map(|class| (2.0 * class.radius, class.mass))
        .collect();
    bodies.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1)));
    let mut distinct: Vec<Group> = Vec::new();
    for &(diameter, mass) in &bodies {
        match distinct.last_mut().filter(|group| group.diameter == diameter && group.mass == mass) {
            Some(group) => group.count += 1.0,
            None => distinct.push(Group { count: 1.0, diameter, mass }),
        }
    }
    if distinct.len() <= GROUPS {
        return distinct;
    }
    bodies
        .chunks(bodies.len().div_ceil(GROUPS))
        .map(|chunk| {
            let count = chunk.len() as f64;
            let mean = |value: fn(&(f64, f64)) -> f64| chunk.iter().map(value).sum::<f64>() / count;
            Group { count, diameter: mean(|body| body.0), mass: mean(|body| body.1) }
        })
        .collect()
}

/// Memory of a run [bytes], without output buffers: what the engine keeps per particle and per cell.
pub fn memory(particles: usize) -> u64 {
    // 64 hot record, 12 image, 16 memory, 12 cell coordinate, 16 cell, 24 calendar entry and its slack, 96 system,
    // and 76 for the largest of the passing copies (frame, checkpoint).
    particles as u64 * 340 + (8 << 20)
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;
    use haff_engine::{Body, Boundary, Class, Contacts, Domain};

    fn system(dimension: Dimension, count: usize, edge: f64, split: bool) -> System {
        let class = Class { radius: 0.5, mass: 1.0, group: 0 };
        let body = |i: usize| Body {
            position: DVec3::ZERO,
            velocity: DVec3::ZERO,
            image: [0; 3],
            class: u32::from(split && i.is_multiple_of(3)),
            species: 0,
        };
        System {
            dimension,
            domain: Domain {
                size: DVec3::splat(edge),
                boundary: [Boundary::Periodic; 3],
                gravity: DVec3::ZERO,
            },
            bodies: (0..count).map(body).collect(),
            // The same sphere by two names must not change anything.
            classes: vec![class, Class { radius: 0.5 * (1.0 + 1e-15), ..class }],
            groups: Vec::new(),
            species: Vec::new(),
            walls: Vec::new(),
            contacts: Contacts { pair: Vec::new(), wall: Vec::new(), tc: 0.0 },
        }
    }

    #[test]
    fn one_size_gives_the_textbook_rates() {
        let (count, edge, temperature) = (500, 10.0, 2.0);
        let eta = PI / 6.0 * 0.5;
        let g = (1.0 - eta / 2.0) / (1.0 - eta).powi(3);
        let omega = 4.0 * 0.5 * g * (PI * temperature).sqrt();
        for split in [false, true] {
            let rate = collision_rate(&system(Dimension::Three, count, edge, split), temperature);
            assert!((rate / (0.5 * omega * count as f64) - 1.0).abs() < 1e-13, "{rate}, ω = {omega}");
        }
        let (count, eta) = (40, PI / 4.0 * 0.4);
        let g = (1.0 - 7.0 * eta / 16.0) / (1.0 - eta).powi(2);
        let omega = 2.0 * 0.4 * g * (PI * temperature).sqrt();
        let rate = collision_rate(&system(Dimension::Two, count, edge, true), temperature);
        assert!((rate / (0.5 * omega * count as f64) - 1.0).abs() < 1e-13, "{rate}, ω = {omega}");
    }
}
