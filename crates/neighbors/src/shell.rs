//! Range of the neighbor lists.

use crate::Geometry;

/// Distance at which two particles of the mean diameter become neighbors [mean diameters]. Between 1.5 and
/// 1.8 the cost of a collision differs by less than a tenth at every density where lists are profitable.
const SHELL: f64 = 1.6;

/// Half of the skin: radius of the sphere around the reference position that a particle leaves by a crossing
/// [length].
pub(crate) fn half_skin(geometry: &Geometry) -> f64 {
    let count = geometry.radii.len();
    let diameter =
        if count == 0 { geometry.reach } else { 2.0 * geometry.radii.iter().sum::<f64>() / count as f64 };
    0.5 * (SHELL - 1.0) * diameter
}

/// Words per list, one of them the header, for a sample of lists of these lengths.
pub(crate) fn words_per_list(mut lengths: Vec<usize>) -> usize {
    lengths.sort_unstable();
    let mean = lengths.iter().sum::<usize>() as f64 / lengths.len().max(1) as f64;
    let most = lengths.get(lengths.len() * 99 / 100).copied().unwrap_or(0);
    // A start on a lattice has no fluctuations yet.
    let most = most.max((mean + 2.0 * mean.sqrt()) as usize);
    (most + 2).next_multiple_of(8)
}
