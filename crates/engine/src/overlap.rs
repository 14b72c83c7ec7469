//! The deepest overlap of all close pairs and of particles with walls, found with grids of its own, independent of what
//! the engine tracks.

use std::ops::Range;

use glam::DVec3;
use haff_neighbors::Geometry;
use rayon::prelude::*;

use crate::{
    grid::{Level, Slabs, Sphere, levels, meet, place},
    particles::World,
};

/// Cells looked at by one task; there are about as many as particles.
const BLOCK: usize = 4096;
/// From this many particles on grids are made of one slab of the box after the other, of at most so many.
const MANY: usize = 200_000;
const SLABS: usize = 8;
/// A pair further apart than this part beyond contact does not overlap, however squares are rounded.
const ROUNDING: f64 = 1e-14;
/// What places lose in single precision, in units of the largest coordinate or length, and what sums of radii lose of themselves: both
/// several times what they can.
const COARSE: f32 = 1e-6;

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

/// The deepest overlap that has been met, and how it is measured.
struct Meter<'a> {
    world: &'a World,
    /// Lengths along periodic axes, 0 along others [length].
    edges: [f32; 3],
    deepest: Overlap,
}

impl<'a> Meter<'a> {
    fn new(world: &'a World) -> Self {
        let edges = [0, 1, 2].map(|axis| if world.periodic[axis] { world.size[axis] as f32 } else { 0.0 });
        Self { world, edges, deepest: Overlap::NONE }
    }

    /// A sphere against some others of a level.
    #[inline]
    fn meet(&mut self, i: u32, sphere: Sphere, level: &Level, others: Range<usize>) {
        let place = sphere.position.as_vec3().to_array();
        let [mut largest, mut slack] = [0.0_f32; 2];
        for axis in 0..3 {
            largest = largest.max(place[axis].abs()).max(self.edges[axis]);
        }
        slack += COARSE * largest;
        let radius = sphere.radius as f32 * (1.0 + COARSE);
        for (&j, other) in level.rows[others.clone()].iter().zip(&level.spheres[others]) {
            let mut square = 0.0;
            for axis in 0..3 {
                let mut d = (other.position[axis] - place[axis]).abs();
                if 2.0 * d > self.edges[axis] && self.edges[axis] > 0.0 {
                    d = (d - self.edges[axis]).abs();
                }
                square += d * d;
            }
            // The other may be further out than this one, but no further than it is near.
            let near = (radius + other.radius * (1.0 + COARSE)) * (1.0 + COARSE) + slack;
            if square < near * near {
                self.look_closely(i, sphere, j);
            }
        }
    }

    /// [`Self::meet`] for one that is near.
    #[inline(never)]
    fn look_closely(&mut self, i: u32, sphere: Sphere, j: u32) {
        let r = self.world.nearest_image(place(self.world, j) - sphere.position);
        let sigma = sphere.radius + self.world.class(j).radius;
        if r.length_squared() < sigma * sigma * (1.0 + ROUNDING) {
            self.touch(i, j, r.length(), sigma);
        }
    }

    #[cold]
    fn touch(&mut self, i: u32, j: u32, distance: f64, sigma: f64) {
        let movable = |i: u32| self.world.body(i).inverse_mass != 0.0;
        let depth = 1.0 - distance / sigma;
        if depth > 0.0 && (movable(i) || movable(j)) {
            self.deepest = self.deepest.or(Overlap { depth, pair: Some((i.min(j), Some(i.max(j)))) });
        }
    }

    /// A sphere against all walls.
    fn meet_walls(&mut self, i: u32, sphere: Sphere) {
        for wall in 0..self.world.walls.len() as u32 {
            let (gap, _) =
                self.world.wall_approach(wall, sphere.radius, sphere.position, DVec3::ZERO, self.world.now);
            if gap < 0.0 && self.world.body(i).inverse_mass != 0.0 {
                self.deepest =
                    self.deepest.or(Overlap { depth: -gap / sphere.radius, pair: Some((i, None)) });
            }
        }
    }

    /// The particles of a cell of the first level against each other, those around them, those of greater levels, and walls.
    fn search(&mut self, levels: &[Level], cell: usize) {
        let own = &levels[0];
        for &i in &own.rows[own.within(cell)] {
            let sphere = Sphere { position: place(self.world, i), radius: self.world.class(i).radius };
            self.meet_walls(i, sphere);
        }
        meet(self.world, levels, cell, |i, sphere, level, others| self.meet(i, sphere, level, others));
    }
}

/// Finds the deepest overlap now.
pub(crate) fn deepest(world: &World, geometry: &Geometry) -> Overlap {
    let slabs = if world.particles.len() < MANY { 1 } else { SLABS };
    deepest_by_slabs(world, geometry, &Slabs::new(world, geometry, slabs))
}

fn deepest_by_slabs(world: &World, geometry: &Geometry, slabs: &Slabs) -> Overlap {
    let mut found = Overlap::NONE;
    for slab in 0..slabs.len() {
        let rows = (0..world.particles.len() as u32).filter(|&i| slabs.knows(slab, i));
        let levels = levels(world, geometry, &rows, 0.0, slabs);
        for k in 0..levels.len() {
            let cells = levels[k].len();
            let blocks = (0..cells.div_ceil(BLOCK)).into_par_iter().map(|block| {
                let mut meter = Meter::new(world);
                for cell in block * BLOCK..((block + 1) * BLOCK).min(cells) {
                    meter.search(&levels[k..], cell);
                }
                meter.deepest
            });
            found = found.or(blocks.reduce(|| Overlap::NONE, Overlap::or));
        }
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
                rest_speed: 0.0,
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
        let (mut pairs, mut walls, mut none, mut slabbed) = (0, 0, 0, 0);
        for seed in 0..400 {
            let system = strewn(seed, [2, 9, 80][seed as usize % 3], [0.0, 1.5, 9.0][seed as usize / 3 % 3]);
            let world = World::new(&system, -50);
            let geometry = geometry(&system, &world, f64::INFINITY);
            let (found, expected) = (deepest(&world, &geometry), by_all_pairs(&world));
            let slabs = Slabs::new(&world, &geometry, SLABS);
            slabbed += usize::from(slabs.len() > 1);
            assert_eq!(deepest_by_slabs(&world, &geometry, &slabs), found, "system {seed} by slabs");
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
            pairs > 60 && walls > 20 && none > 60 && slabbed > 200,
            "{pairs} pairs, {walls} at walls, {none} without overlap; {slabbed} by slabs"
        );
    }
}
