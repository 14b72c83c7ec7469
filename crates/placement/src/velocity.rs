//! Maxwell velocities.

use glam::DVec3;
use haff_engine::Dimension;

use crate::random::{Purpose, Stream};

/// Particles that share a temperature.
#[derive(Debug)]
pub struct Bath {
    /// T = Σ m|v|²/(dN) at zero total momentum [energy].
    pub temperature: f64,
    /// Rows of its particles, all of finite mass.
    pub members: Vec<usize>,
}

/// A velocity with independent normal components of variance T/m.
pub fn maxwell(seed: u64, species: &str, index: usize, variance: f64, dimension: Dimension) -> DVec3 {
    let mut random = Stream::new(seed, Purpose::Velocity, species, index);
    let [x, y] = random.normal_pair();
    let z = match dimension {
        Dimension::Two => 0.0,
        Dimension::Three => random.normal_pair()[0],
    };
    DVec3::new(x, y, z) * variance.sqrt()
}

/// Shifts the velocities to zero total momentum and rescales each bath to its temperature.
///
/// The order is shift, then rescale: with one temperature for all, one round makes both exact. With several
/// temperatures each bath's factor changes the momentum; then rounds repeat until the momentum
/// stays zero. A single particle keeps its direction: its temperature is read as m|v|²/d.
pub fn equilibrate(velocity: &mut [DVec3], mass: &[f64], baths: &[Bath], dimension: Dimension) {
    let members = || baths.iter().flat_map(|bath| bath.members.iter().copied());
    let total_mass: f64 = members().map(|i| mass[i]).sum();
    let several = members().nth(1).is_some();
    let rounds = if baths.iter().filter(|bath| bath.temperature > 0.0).count() > 1 { 60 } else { 2 };
    for _ in 0..rounds {
        if several {
            let momentum: DVec3 = members().map(|i| velocity[i] * mass[i]).sum();
            let shift = momentum / total_mass;
            for i in members() {
                velocity[i] -= shift;
            }
        }
        for bath in baths {
            let twice_energy: f64 =
                bath.members.iter().map(|&i| mass[i] * velocity[i].length_squared()).sum();
            let target = bath.temperature * (dimension.count() * bath.members.len()) as f64;
            let factor = if twice_energy > 0.0 { (target / twice_energy).sqrt() } else { 0.0 };
            for &i in &bath.members {
                velocity[i] *= factor;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn temperature(velocity: &[DVec3], mass: &[f64], members: &[usize], d: f64) -> f64 {
        members.iter().map(|&i| mass[i] * velocity[i].length_squared()).sum::<f64>()
            / (d * members.len() as f64)
    }

    #[test]
    fn two_temperatures_are_exact_at_zero_momentum() {
        let n = 300;
        let mass: Vec<f64> = (0..n).map(|i| if i < 100 { 1.0 } else { 5.0 }).collect();
        let baths = [
            Bath { temperature: 1.0, members: (0..100).collect() },
            Bath { temperature: 3.0, members: (100..n).collect() },
        ];
        let mut velocity: Vec<DVec3> =
            (0..n).map(|i| maxwell(7, "grain", i, 1.0 / mass[i], Dimension::Three)).collect();
        equilibrate(&mut velocity, &mass, &baths, Dimension::Three);
        let momentum: DVec3 = (0..n).map(|i| velocity[i] * mass[i]).sum();
        assert!(momentum.length() < 1e-10, "momentum {momentum}");
        for bath in &baths {
            let found = temperature(&velocity, &mass, &bath.members, 3.0);
            assert!(
                (found / bath.temperature - 1.0).abs() < 1e-13,
                "T = {found}, expected {}",
                bath.temperature
            );
        }
    }

    #[test]
    fn components_are_normal() {
        // Second and fourth moments of 3·10^5 components: 1 ± √(2/n), 3 ± √(96/n).
        let n = 100_000;
        let (mut second, mut fourth) = (0.0, 0.0);
        for i in 0..n {
            for x in maxwell(3, "gas", i, 1.0, Dimension::Three).to_array() {
                second += x * x;
                fourth += x.powi(4);
            }
        }
        let count = 3.0 * n as f64;
        let (second, fourth) = (second / count, fourth / count);
        assert!((second - 1.0).abs() < 4.0 * (2.0 / count).sqrt(), "⟨x²⟩ = {second}, theory 1");
        assert!((fourth - 3.0).abs() < 4.0 * (96.0 / count).sqrt(), "⟨x⁴⟩ = {fourth}, theory 3");
    }

    #[test]
    fn one_particle_keeps_its_energy() {
        let mut velocity = [maxwell(1, "one", 0, 2.0, Dimension::Two)];
        let bath = Bath { temperature: 2.0, members: vec![0] };
        equilibrate(&mut velocity, &[1.0], &[bath], Dimension::Two);
        assert!(
            (velocity[0].length_squared() - 4.0).abs() < 1e-14,
            "|v|² = {}",
            velocity[0].length_squared()
        );
    }
}
