//! Estimates of memory, for `haff check`.

use haff_engine::{Correlations, Followed, Grid, Measure, System, initial_temperature};
use haff_scene::Scene;

/// Temperature of the bodies of finite mass at the start, as the first sample has it; 0 without any.
pub fn temperature(scene: &Scene) -> f64 {
    let conserved = scene.joints.conserved_momentum(&scene.system);
    initial_temperature(&scene.system, conserved).unwrap_or(0.0)
}

/// Memory of a run [bytes], to about a fifth: data of the engine per particle and per cell, and temporary
/// copies.
pub fn memory(particles: usize) -> u64 {
    // Measured: peak resident memory of elastic gases with 10⁵ and 10⁶ particles, with frames.
    particles as u64 * 250 + (12 << 20)
}

/// The collisions of a run until a time, at a rate \[1/time\] at the start.
pub struct Collisions {
    pub count: f64,
    /// Whether the rate changes in a way that is not known, so that it is taken to be that of the start.
    pub guessed: bool,
}

/// Collisions until a time. While a gas cools by Haff's law, dT/dt = −ζT with ζ = (1 − e²)ω/d and ω ∝ √T, the
/// rate falls by 1/(1 + ζ₀t/2).
pub fn collisions(scene: &Scene, rate: f64, until: f64) -> Collisions {
    let system = &scene.system;
    match cooling_rate(scene, rate) {
        None => Collisions { count: rate * until, guessed: !system.contacts.are_elastic() },
        Some(zeta) => {
            Collisions { count: rate * (2.0 / zeta) * (0.5 * zeta * until).ln_1p(), guessed: false }
        }
    }
}

/// The time after which there have been so many collisions: the inverse of [`collisions`].
pub fn duration(scene: &Scene, rate: f64, collisions: f64) -> f64 {
    match cooling_rate(scene, rate) {
        None => collisions / rate,
        Some(zeta) => (0.5 * zeta * collisions / rate).exp_m1() * 2.0 / zeta,
    }
}

/// ζ₀ of a gas that cools by Haff's law, with so many collisions a time at the start \[1/time\].
fn cooling_rate(scene: &Scene, rate: f64) -> Option<f64> {
    let of_a_particle = 2.0 * rate / scene.system.bodies.len() as f64;
    Some(scene.cooling_loss()? * of_a_particle / scene.system.dimension.count() as f64)
}

/// Numbers that measurements add to rows of observables.
pub fn measured(system: &System, samples: u64) -> u64 {
    let (measure, d) = (&system.measure, system.dimension.count() as u64);
    let stress = if measure.stress { 3 * d * d } else { 0 };
    let walls = if measure.wall_forces { 4 * system.walls.len() as u64 } else { 0 };
    let species = system.species.len() as u64;
    let pairs = if measure.pair_collisions { species * species + species } else { 0 };
    samples * (stress + walls + pairs)
}

/// Profiles of a file, with the numbers of their rows until a time.
pub fn profiles(measure: &Measure, until: f64) -> Vec<(u64, &Grid)> {
    let rows = |grid: &Grid| if until.is_finite() { (until / grid.interval) as u64 } else { 0 };
    measure.profiles.iter().map(|grid| (rows(grid), grid)).collect()
}

/// Memory for earlier states of correlations \[bytes\]: sixteen at each level of lags.
/// The lags of a level are twice those of the one before.
pub fn correlations(measure: &Measure, particles: usize, until: f64) -> u64 {
    let Correlations { msd, vacf, tracers, interval, .. } = &measure.correlations;
    let followed = |followed: &Followed| particles.min(tracers * followed.curves()) as u64;
    let levels = (until / interval / 16.0).max(0.5).log2() + 2.0;
    let levels = if until.is_finite() { levels } else { 10.0 };
    (followed(msd) + followed(vacf)) * (levels * 16.0 * 24.0) as u64
}
