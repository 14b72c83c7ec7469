//! The deepest overlap of all close pairs and of particles with walls, found with grids of its own, independent of what
//! the engine tracks: one grid for every octave of radius, so that a few large bodies cost little.

use std::collections::BTreeMap;

use glam::DVec3;
use haff_neighbors::{Axis, Geometry};
use rayon::prelude::*;

use crate::particles::World;

/// Particles looked at by one task.
const BLOCK: usize = 4096;

/// The deepest overlap of all close pairs and of particles with walls.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Overlap {
    /// Overlap in contact distances (σ of the pair; the radius at a wall); 0 if nothing overlaps.
    pub depth: f64,
    /// The particle, and its partner's row (the greater of the two) or, at a wall, `None`.
    pub pair: Option<(u32, Option<u32>)>,
}

impl Overlap {
    const NONE: Self = Self { depth: 0.0, pair: None };

    /// The deeper of two; of equal ones that of the first rows, so that the order of work does not show.
    fn or(self, other: Self) -> Self {
        let equal = other.depth == self.depth && other.pair.is_some() && other.pair < self.pair;
        if other.depth > self.depth || equal { other } else { self }
    }
}

/// Particles of one octave of radius, sorted by cell. Cells are at least a largest diameter wide; along axes that do not
/// repeat the grid is folded onto itself.
struct Level {
    /// Cells per axis and per length.
    cells: [i64; 3],
    density: [f64; 3],
    /// Where each cell's particles begin, and where the last one's end.
    start: Vec<u32>,
    rows: Vec<u32>,
    /// Places of `rows` now, wrapped into the box.
    position: Vec<DVec3>,
}

impl Level {
    fn new(world: &World, geometry: &Geometry, mut rows: Vec<u32>) -> Self {
        let largest = rows.iter().map(|&i| world.class(i).radius).fold(0.0, f64::max);
        // One part in 10⁹ more, so that the rounding of a coordinate cannot lose a pair.
        let width = 2.0 * largest * (1.0 + 1e-9);
        let mut cells = [0, 1, 2].map(|axis| match geometry.axes[axis] {
            Axis::Flat => 1,
            _ => ((geometry.size[axis] / width).floor() as i64).max(1),
        });
        // No more cells than particles, or nearly.
        while cells.iter().map(|&n| n as f64).product::<f64>() > rows.len() as f64 + 64.0 {
            if let Some(most) = cells.iter_mut().max() {
                *most = (*most / 2).max(1);
            }
        }
        let density = std::array::from_fn(|axis| match geometry.axes[axis] {
            Axis::Periodic => cells[axis] as f64 / geometry.size[axis],
            _ => 1.0 / width,
        });
        let count = cells.iter().product::<i64>() as usize;
        let mut level =
            Self { cells, density, start: vec![0; count + 1], rows: Vec::new(), position: Vec::new() };
        let home: Vec<u32> =
            rows.par_iter().map(|&i| level.index(level.cell(place(world, i)), [0; 3]) as u32).collect();
        for &cell in &home {
            level.start[cell as usize + 1] += 1;
        }
        for cell in 0..count {
            level.start[cell + 1] += level.start[cell];
        }
        let mut fill = level.start.clone();
        level.rows = vec![0; rows.len()];
        for (i, cell) in rows.drain(..).zip(home) {
            let next = &mut fill[cell as usize];
            level.rows[*next as usize] = i;
            *next += 1;
        }
        level.position = level.rows.par_iter().map(|&i| place(world, i)).collect();
        level
    }

    fn cell(&self, position: DVec3) -> [i64; 3] {
        std::array::from_fn(|axis| (position[axis] * self.density[axis]).floor() as i64)
    }

    /// Index of the cell `step` away from `cell`.
    fn index(&self, cell: [i64; 3], step: [i64; 3]) -> usize {
        let [x, y, z] = [0, 1, 2].map(|axis| (cell[axis] + step[axis]).rem_euclid(self.cells[axis]) as usize);
        (x * self.cells[1] as usize + y) * self.cells[2] as usize + z
    }

    /// Steps to the cells around one along an axis, each cell once.
    fn steps(&self, axis: usize) -> std::ops::Range<i64> {
        match self.cells[axis] {
            1 => 0..1,
            2 => 0..2,
            _ => -1..2,
        }
    }

    /// Calls `visit` for every particle of this level in the cells around `position`.
    fn around(&self, position: DVec3, mut visit: impl FnMut(u32, DVec3)) {
        let cell = self.cell(position);
        for x in self.steps(0) {
            for y in self.steps(1) {
                for z in self.steps(2) {
                    let index = self.index(cell, [x, y, z]);
                    for k in self.start[index] as usize..self.start[index + 1] as usize {
                        visit(self.rows[k], self.position[k]);
                    }
                }
            }
        }
    }
}

/// Where particle i is now, in the box.
fn place(world: &World, i: u32) -> DVec3 {
    world.wrap(world.state(i, world.now).0).0
}

/// Finds the deepest overlap now.
pub(crate) fn deepest(world: &World, geometry: &Geometry) -> Overlap {
    let mut octaves: BTreeMap<u64, Vec<u32>> = BTreeMap::new();
    for i in 0..world.particles.len() as u32 {
        octaves.entry(world.class(i).radius.to_bits() >> 52).or_default().push(i);
    }
    // Smallest first.
    let levels: Vec<Level> = octaves.into_values().map(|rows| Level::new(world, geometry, rows)).collect();
    let mut found = Overlap::NONE;
    for (k, own) in levels.iter().enumerate() {
        let blocks =
            own.rows.par_chunks(BLOCK).zip(own.position.par_chunks(BLOCK)).map(|(rows, positions)| {
                let mut deepest = Overlap::NONE;
                for (&i, &position) in rows.iter().zip(positions) {
                    let class = world.class(i);
                    // A pair of one level is found from both sides, any other from the smaller one.
                    for (m, level) in levels.iter().enumerate().skip(k) {
                        level.around(position, |j, partner| {
                            let other = world.class(j);
                            if (m == k && j <= i) || class.inverse_mass + other.inverse_mass == 0.0 {
                                return;
                            }
                            let distance = world.nearest_image(partner - position).length();
                            let depth = 1.0 - distance / (class.radius + other.radius);
                            if depth > 0.0 {
                                let pair = Some((i.min(j), Some(i.max(j))));
                                deepest = deepest.or(Overlap { depth, pair });
                            }
                        });
                    }
                    if class.inverse_mass != 0.0 {
                        for wall in 0..world.walls.len() as u32 {
                            let (gap, _) =
                                world.wall_approach(wall, class.radius, position, DVec3::ZERO, world.now);
                            if gap < 0.0 {
                                deepest =
                                    deepest.or(Overlap { depth: -gap / class.radius, pair: Some((i, None)) });
                            }
                        }
                    }
                }
                deepest
            });
        found = found.or(blocks.reduce(|| Overlap::NONE, Overlap::or));
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        measure::geometry,
        model::{Body, Boundary, Class, Contacts, Dimension, Domain, Group, Restitution, System, Wall},
    };

    /// A number in [0, 1) (SplitMix64).
    fn number(state: &mut u64) -> f64 {
        *state = state.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = *state;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// Spheres strewn at random, radii over `octaves` powers of two, some of infinite mass, and an oblique plane.
    fn strewn(seed: u64, count: usize, octaves: f64) -> System {
        let mut state = seed;
        let kinds = [Boundary::Periodic, Boundary::Wall, Boundary::Open];
        let boundary = std::array::from_fn(|_| kinds[(3.0 * number(&mut state)) as usize]);
        let size = DVec3::from_array([0.0; 3].map(|_: f64| 4.0 + 30.0 * number(&mut state)));
        let classes: Vec<Class> = (0..count)
            .map(|_| Class {
                radius: (-octaves * number(&mut state)).exp2(),
                mass: if number(&mut state) < 0.1 { f64::INFINITY } else { 1.0 },
                group: 0,
            })
            .collect();
        let bodies = (0..count)
            .map(|i| Body {
                position: size * DVec3::from_array([0.0; 3].map(|_: f64| number(&mut state))),
                velocity: DVec3::ZERO,
                image: [0; 3],
                class: i as u32,
                species: 0,
            })
            .collect();
        let plane = Wall {
            name: "plane".to_owned(),
            point: 0.1 * size,
            normal: DVec3::ONE.normalize(),
            velocity: DVec3::ZERO,
        };
        System {
            dimension: Dimension::Three,
            domain: Domain { size, boundary, gravity: DVec3::ZERO },
            bodies,
            classes,
            groups: vec![Group { name: "grain".to_owned() }],
            species: vec!["grain".to_owned()],
            walls: if seed.is_multiple_of(2) { vec![plane] } else { Vec::new() },
            contacts: Contacts {
                pair: vec![Restitution::Constant(1.0)],
                wall: vec![Restitution::Constant(1.0)],
                tc: 0.0,
            },
        }
    }

    /// Every pair and every wall, one after the other.
    fn by_all_pairs(world: &World) -> Overlap {
        let mut deepest = Overlap::NONE;
        let count = world.particles.len() as u32;
        for i in 0..count {
            let (class, position) = (world.class(i), place(world, i));
            for j in i + 1..count {
                let other = world.class(j);
                let distance = world.nearest_image(place(world, j) - position).length();
                let depth = 1.0 - distance / (class.radius + other.radius);
                if class.mass.is_finite() || other.mass.is_finite() {
                    deepest = deepest.or(Overlap { depth, pair: Some((i, Some(j))) });
                }
            }
            for wall in &world.walls {
                let depth = 1.0 - (position - wall.point).dot(wall.normal) / class.radius;
                if class.mass.is_finite() {
                    deepest = deepest.or(Overlap { depth, pair: Some((i, None)) });
                }
            }
        }
        deepest
    }

    #[test]
    fn grids_and_all_pairs_find_the_same_deepest_overlap_at_any_size_ratio() {
        let (mut pairs, mut walls, mut none) = (0, 0, 0);
        for seed in 0..400 {
            let system = strewn(seed, [2, 9, 80][seed as usize % 3], [0.0, 1.5, 9.0][seed as usize / 3 % 3]);
            let world = World::new(&system, -50);
            let (found, expected) = (deepest(&world, &geometry(&system)), by_all_pairs(&world));
            assert_eq!(found.pair, expected.pair, "system {seed}: {found:?}, {expected:?}");
            // The sum of a distance from a plane is rounded in two ways.
            assert!(
                (found.depth - expected.depth).abs() < 1e-12 * (1.0 + expected.depth),
                "system {seed}: {found:?}, {expected:?}"
            );
            match found.pair {
                Some((_, Some(_))) => pairs += 1,
                Some((_, None)) => walls += 1,
                None => none += 1,
            }
        }
        assert!(
            pairs > 60 && walls > 20 && none > 60,
            "{pairs} pairs, {walls} at walls, {none} without overlap"
        );
    }
}
