//! A hierarchy of hashed cell grids, one per octave of radius: close pairs among particles of any size ratio,
//! in a box of any extent, periodic or not.

use std::collections::BTreeMap;

use glam::DVec3;
use haff_engine::{Boundary, Domain};
use rayon::prelude::*;

const NONE: u32 = u32::MAX;

/// Cell coordinates stay within ±2^30 so that a neighbor's coordinate cannot overflow.
const FAR: f64 = (1 << 30) as f64;

/// Periods of the box, `None` along axes that are not periodic.
#[derive(Debug, Clone, Copy)]
pub struct Periods([Option<f64>; 3]);

impl Periods {
    /// The edges of the periodic axes of a box.
    pub fn new(domain: &Domain) -> Self {
        Self(std::array::from_fn(|axis| {
            (domain.boundary[axis] == Boundary::Periodic).then_some(domain.size[axis])
        }))
    }

    /// Periods for a search of overlaps: without that along the gradient if images across it are displaced.
    pub fn aligned(domain: &Domain) -> Self {
        let mut periods = Self::new(domain);
        if let Some(shear) = domain.shear.filter(|shear| shear.offset != 0.0) {
            periods.0[shear.gradient] = None;
        }
        periods
    }

    /// The shortest image of the difference `d` of two positions in the box.
    pub fn nearest(&self, mut d: DVec3) -> DVec3 {
        for axis in 0..3 {
            if let Some(length) = self.0[axis] {
                let x = &mut d[axis];
                // Both positions lie in [0, L): one step suffices, and ± L/2 keep their sign, so that the
                // difference of (j, i) is exactly the negative of that of (i, j).
                if *x > 0.5 * length {
                    *x -= length;
                } else if *x < -0.5 * length {
                    *x += length;
                }
            }
        }
        d
    }

    /// Wraps a position into the box along periodic axes.
    pub fn wrap(&self, mut position: DVec3) -> DVec3 {
        for axis in 0..3 {
            if let Some(length) = self.0[axis] {
                let x = position[axis];
                if (0.0..length).contains(&x) {
                    continue;
                }
                let x = x.rem_euclid(length);
                // rem_euclid of a tiny negative number rounds to the length itself.
                position[axis] = if x < length { x } else { 0.0 };
            }
        }
        position
    }
}

struct Level {
    radius: f64,
    /// Cells along periodic axes, 0 along others.
    count: [i32; 3],
    /// Cells per length.
    density: [f64; 3],
}

/// Particles in cells. Each particle has a level radius, at least its own radius: [`Grid::visit`] finds all
/// particles whose level is at least that of the query and whose level radius, with the query's, spans the
/// distance.
pub struct Grid {
    periods: Periods,
    levels: Vec<Level>,
    members: Vec<Member>,
    heads: Vec<u32>,
}

/// Data of a particle, stored together because they are read together.
#[derive(Clone, Copy)]
struct Member {
    cell: [i32; 3],
    next: u32,
    level: u16,
}

impl Grid {
    /// An empty grid for particles with these level radii; pairs closer than the sum of their level radii
    /// plus `skin` will be found.
    pub fn new(level_radius: &[f64], skin: f64, periods: Periods) -> Self {
        let mut octaves: BTreeMap<u64, f64> = BTreeMap::new();
        for &radius in level_radius {
            let largest = octaves.entry(octave(radius)).or_insert(radius);
            *largest = largest.max(radius);
        }
        let levels: Vec<Level> = octaves
            .values()
            .map(|&radius| {
                // Wider by 10^-9, so that rounding of a coordinate cannot lose a pair.
                let width = (2.0 * radius + skin) * (1.0 + 1e-9);
                let mut level = Level { radius, count: [0; 3], density: [1.0 / width; 3] };
                for axis in 0..3 {
                    if let Some(length) = periods.0[axis] {
                        let count = (length / width).floor().clamp(1.0, FAR);
                        level.count[axis] = count as i32;
                        level.density[axis] = count / length;
                    }
                }
                level
            })
            .collect();
        let keys: Vec<u64> = octaves.into_keys().collect();
        let members = level_radius
            .iter()
            .map(|&radius| {
                let level = keys.partition_point(|&key| key < octave(radius)) as u16;
                Member { cell: [0; 3], next: NONE, level }
            })
            .collect();
        let buckets = (2 * level_radius.len()).next_power_of_two().max(64);
        Self { periods, levels, members, heads: vec![NONE; buckets] }
    }

    /// Removes all particles.
    pub fn clear(&mut self) {
        self.heads.fill(NONE);
    }

    /// Inserts particle `index` at `position`.
    pub fn insert(&mut self, index: usize, position: DVec3) {
        let level = self.members[index].level;
        let cell = self.cell_of(&self.levels[level as usize], position);
        let bucket = self.bucket(level, cell);
        self.members[index] = Member { cell, next: self.heads[bucket], level };
        self.heads[bucket] = index as u32;
    }

    /// Calls `found` for every particle near `position` in the level of `level_radius` and above, until it
    /// returns `false`. The order depends on the order of insertion only.
    pub fn visit(&self, position: DVec3, level_radius: f64, mut found: impl FnMut(usize) -> bool) {
        let key = octave(level_radius);
        for (k, level) in self.levels.iter().enumerate() {
            if octave(level.radius) < key {
                continue;
            }
            let centre = self.cell_of(level, position);
            let steps = |axis: usize| match level.count[axis] {
                1 => 0..1,
                2 => 0..2,
                _ => -1..2,
            };
            for dx in steps(0) {
                for dy in steps(1) {
                    for dz in steps(2) {
                        let step = [dx, dy, dz];
                        let cell: [i32; 3] = std::array::from_fn(|axis| {
                            let c = centre[axis] + step[axis];
                            if level.count[axis] > 0 { c.rem_euclid(level.count[axis]) } else { c }
                        });
                        let mut j = self.heads[self.bucket(k as u16, cell)];
                        while j != NONE {
                            let member = self.members[j as usize];
                            if member.cell == cell && member.level == k as u16 && !found(j as usize) {
                                return;
                            }
                            j = member.next;
                        }
                    }
                }
            }
        }
    }

    fn cell_of(&self, level: &Level, position: DVec3) -> [i32; 3] {
        std::array::from_fn(|axis| {
            let c = (position[axis] * level.density[axis]).floor();
            if self.periods.0[axis].is_some() {
                c.clamp(0.0, f64::from(level.count[axis] - 1)) as i32
            } else {
                c.clamp(-FAR, FAR) as i32
            }
        })
    }

    /// Consecutive cells along z have consecutive buckets, which are visited together.
    fn bucket(&self, level: u16, cell: [i32; 3]) -> usize {
        let mut h = u64::from(level) ^ 0x9E37_79B9_7F4A_7C15;
        for c in &cell[..2] {
            h = (h ^ u64::from(*c as u32)).wrapping_mul(0xD6E8_FEB8_6659_FD93);
            h ^= h >> 32;
        }
        h.wrapping_add(u64::from(cell[2] as u32)) as usize & (self.heads.len() - 1)
    }
}

/// The binary exponent of a positive number.
fn octave(radius: f64) -> u64 {
    radius.to_bits() >> 52
}

/// Two particles that overlap.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Overlap {
    /// The first of them, by its index.
    pub i: usize,
    /// The second.
    pub j: usize,
    /// Contact distance less distance [length].
    pub depth: f64,
}

/// Pairs that overlap by more than `tolerance` of their contact distance, ordered by (i, j): at most a few
/// for each particle. Pairs for which `skip` is true are left out.
pub fn overlaps(
    position: &[DVec3],
    radius: &[f64],
    periods: Periods,
    tolerance: f64,
    skip: &(dyn Fn(usize, usize) -> bool + Sync),
) -> Vec<Overlap> {
    let mut grid = Grid::new(radius, 0.0, periods);
    for (k, &p) in position.iter().enumerate() {
        grid.insert(k, p);
    }
    let mut pairs: Vec<Overlap> = (0..position.len())
        .into_par_iter()
        .flat_map_iter(|i| {
            let mut mine = Vec::new();
            let own = octave(radius[i]);
            grid.visit(position[i], radius[i], |j| {
                // A pair of one level is found from both sides, any other from the smaller particle only.
                if (octave(radius[j]) == own && j <= i) || skip(i, j) {
                    return true;
                }
                let contact = radius[i] + radius[j];
                let distance = periods.nearest(position[j] - position[i]).length();
                if distance < contact * (1.0 - tolerance) {
                    mine.push(Overlap { i: i.min(j), j: i.max(j), depth: contact - distance });
                }
                mine.len() < 4
            });
            mine
        })
        .collect();
    pairs.sort_by_key(|pair| (pair.i, pair.j));
    pairs
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::{Purpose, Stream};
    use haff_engine::Boundary::{Open, Periodic, Wall};

    #[test]
    fn grid_and_all_pairs_find_the_same_overlaps_at_any_size_ratio() {
        for case in 0..200 {
            let mut random = Stream::new(case, Purpose::Insertion, "overlaps", 0);
            let kinds = [Periodic, Wall, Open];
            let domain = Domain {
                size: DVec3::from_array(std::array::from_fn(|_| random.between(2.1, 40.0))),
                boundary: std::array::from_fn(|_| kinds[random.below(3)]),
                gravity: DVec3::ZERO,
                shear: None,
                compression: None,
            };
            let n = 60;
            let radius: Vec<f64> = (0..n).map(|_| libm::pow(10.0, random.between(-6.0, 0.0))).collect();
            let position: Vec<DVec3> = (0..n)
                .map(|_| domain.size * DVec3::from_array(std::array::from_fn(|_| random.unit())))
                .collect();
            let periods = Periods::new(&domain);
            // At most three overlaps a particle, so that the limit of four does not affect the comparison.
            let mut expected = Vec::new();
            let mut most = vec![0; n];
            for i in 0..n {
                for j in i + 1..n {
                    if periods.nearest(position[j] - position[i]).length() < radius[i] + radius[j] {
                        expected.push((i, j));
                        most[i] += 1;
                        most[j] += 1;
                    }
                }
            }
            if most.iter().any(|&m| m > 3) {
                continue;
            }
            let found: Vec<_> = overlaps(&position, &radius, periods, 0.0, &|_, _| false);
            let found: Vec<_> = found.iter().map(|pair| (pair.i, pair.j)).collect();
            assert_eq!(found, expected, "case {case}");
        }
    }
}
