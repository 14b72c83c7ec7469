//! Rounding of many impacts: the energy and the momentum of a gas perform a random walk without drift.

use glam::DVec3;
use haff_mechanics::resolve_contact;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

const EPS: f64 = f64::EPSILON;

fn vector(random: &mut Pcg64Mcg, flat: bool) -> DVec3 {
    // The sum of twelve uniform numbers is nearly normal.
    let mut normal = || (0..12).map(|_| random.random::<f64>() - 0.5).sum::<f64>();
    DVec3::new(normal(), normal(), if flat { 0.0 } else { normal() })
}

/// Compensated sums, exact far below the expected walk.
fn sum(terms: impl Iterator<Item = f64>) -> f64 {
    let (mut high, mut low) = (0.0, 0.0);
    for term in terms {
        let next: f64 = high + term;
        let part = next - high;
        low += (high - (next - part)) + (term - part);
        high = next;
    }
    high + low
}

/// Energy [ε T] and momentum [ε √(mT)] after `impacts` of random pairs, from a gas of 64 with two `masses`,
/// relative to √impacts.
fn walk(masses: [f64; 2], sigma: f64, flat: bool, impacts: u32) -> (f64, f64) {
    let mut random = Pcg64Mcg::seed_from_u64(5);
    let mass: Vec<f64> = (0..64).map(|i| masses[i % 2]).collect();
    let mut velocity: Vec<DVec3> = mass.iter().map(|m| vector(&mut random, flat) / f64::sqrt(*m)).collect();
    let energy = |v: &[DVec3]| sum(v.iter().zip(&mass).map(|(v, m)| 0.5 * m * v.length_squared()));
    let momentum =
        |v: &[DVec3]| DVec3::from_array([0, 1, 2].map(|k| sum(v.iter().zip(&mass).map(|(v, m)| m * v[k]))));
    let before = (energy(&velocity), momentum(&velocity));
    let mut done = 0;
    while done < impacts {
        let (i, j) = (random.random_range(0..64), random.random_range(0..64));
        // The difference of two positions in a box: as in contacts, |r| is within a few ulp of σ.
        let normal = vector(&mut random, flat).normalize() * sigma;
        let position = DVec3::new(random.random(), random.random(), random.random()) * 7.0;
        let r = (position + normal) - position;
        if i == j || (velocity[i] - velocity[j]).dot(r) <= 0.0 {
            continue;
        }
        (velocity[i], velocity[j], _) =
            resolve_contact(velocity[i], velocity[j], 1.0 / mass[i], 1.0 / mass[j], r, 1.0);
        done += 1;
    }
    let temperature = before.0 / (64.0 * if flat { 1.0 } else { 1.5 });
    let steps = f64::from(impacts).sqrt() * EPS;
    let heat = (energy(&velocity) - before.0) / (temperature * steps);
    let push =
        (momentum(&velocity) - before.1).length() / ((temperature * masses[0].max(masses[1])).sqrt() * steps);
    (heat, push)
}

/// A bias of 0.01 ε T an impact, which a correction of Newton's law alone leaves, would be detected.
#[test]
fn energy_and_momentum_of_an_elastic_gas_do_not_drift() {
    for (masses, sigma, flat) in [
        ([1.0, 1.0], 1.0, false),
        ([1.0, 1.0], 1.0, true),
        ([1.0, 1.0], 0.8, false),
        ([0.7, 0.7], 1.0, false),
        ([0.3, 0.7], 1.0, false),
        ([1.0, 3.0], 1.0, true),
    ] {
        let (heat, push) = walk(masses, sigma, flat, 2_000_000);
        println!("masses {masses:?}, σ = {sigma}: energy {heat:+.2} ε T, momentum {push:.2}, by √impacts");
        // One step of the walk is 2.4 to 2.7 ε T and about 0.6 ε √(mT): four standard deviations.
        assert!(heat.abs() < 10.0, "masses {masses:?}, σ = {sigma}: energy {heat:+.2} ε T √impacts");
        assert!(push < 3.0, "masses {masses:?}, σ = {sigma}: momentum {push:.2} ε √(mT) √impacts");
    }
}

/// An impact along an axis is as exact as its arguments.
#[test]
fn impacts_along_an_axis_are_exact() {
    let mut random = Pcg64Mcg::seed_from_u64(6);
    for axis in DVec3::AXES {
        for _ in 0..1000 {
            let velocity = vector(&mut random, false);
            let w = if velocity.dot(axis) > 0.0 { velocity } else { -velocity };
            // A wall reverses the normal velocity, and leaves the other components.
            let inverse_mass = random.random_range(0.01..100.0);
            let (after, _, _) = resolve_contact(w, DVec3::ZERO, inverse_mass, 0.0, axis, 1.0);
            assert_eq!(after, w - axis * (2.0 * w.dot(axis)));
            // Equal masses: the body hit at rest takes over the velocity.
            let (u1, u2, _) = resolve_contact(axis * 0.7, DVec3::ZERO, inverse_mass, inverse_mass, axis, 1.0);
            assert_eq!((u1, u2), (DVec3::ZERO, axis * 0.7));
        }
    }
}
