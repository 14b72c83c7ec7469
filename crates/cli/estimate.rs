//! Estimates of memory and initial temperature, for `haff check`.

use haff_engine::System;

/// Temperature T = Σ m|v − V|²/(dN) of the bodies of finite mass at the start; 0 without any.
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

/// Memory of a run [bytes], to about a fifth: data of the engine per particle and per cell, and temporary
/// copies.
pub fn memory(particles: usize) -> u64 {
    // Measured: peak resident memory of elastic gases with 10⁵ and 10⁶ particles, with frames.
    particles as u64 * 250 + (12 << 20)
}
