//! Range of the neighbor lists.

use std::f64::consts::PI;

use crate::{Axis, Geometry};

/// Least distance at which two particles of the mean diameter become neighbors [mean diameters]. Between 1.5
/// and 1.8 the cost of a collision differs by less than 10 % at every density where lists are profitable.
const SHELL: f64 = 1.6;
/// Mean number of other particles within that distance, if the shell is wider than that because the gas is
/// dilute: a thin shell is left many times between two contacts (choice.md).
const MEMBERS: f64 = 3.0;
/// Largest skin [shortest edge].
const LARGEST: f64 = 0.5;

/// Half of the skin of this many particles [length]. It is the radius of the sphere around a reference
/// position; a particle leaves this sphere by a crossing.
pub(crate) fn half_skin(geometry: &Geometry, count: usize) -> f64 {
    let radii = &geometry.radii;
    let diameter =
        if radii.is_empty() { geometry.reach } else { 2.0 * radii.iter().sum::<f64>() / radii.len() as f64 };
    let edges = || (0..3).filter(|&k| geometry.axes[k] != Axis::Flat).map(|k| geometry.lengths()[k]);
    let (volume, shortest) = edges()
        .fold((1.0, f64::INFINITY), |(volume, shortest), edge| (volume * edge, f64::min(shortest, edge)));
    // Volume of the sphere with that many members.
    let sphere = (MEMBERS + 1.0) * volume / (geometry.crowding * count.max(1) as f64);
    let wide = if edges().count() == 2 { (sphere / PI).sqrt() } else { (0.75 * sphere / PI).cbrt() };
    let skin = (SHELL * diameter).max(wide) - diameter;
    0.5 * skin.min((LARGEST * shortest).max((SHELL - 1.0) * diameter))
}

/// Number of words per list, the header included, from the lengths of a sample of lists.
pub(crate) fn words_per_list(mut lengths: Vec<usize>) -> usize {
    lengths.sort_unstable();
    let mean = lengths.iter().sum::<usize>() as f64 / lengths.len().max(1) as f64;
    let most = lengths.get(lengths.len() * 99 / 100).copied().unwrap_or(0);
    // Particles that start on a lattice have no fluctuations of density yet, so these are added to the mean.
    let most = most.max((mean + 2.0 * mean.sqrt()) as usize);
    (most + 2).next_multiple_of(8)
}
