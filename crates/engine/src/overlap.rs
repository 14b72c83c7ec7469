//! The deepest overlap of all close pairs and of particles with walls, found with grids of its own,
//! independent of what the engine tracks.

use std::ops::Range;

use glam::{DVec3, Vec3, Vec4};
use haff_neighbors::Geometry;
use rayon::prelude::*;

use crate::{
    grid::{Level, Slabs, levels, meet, place},
    particles::World,
    periodicity::Periodicity,
    tuning::particles,
};

/// Cells, or particles, looked at by one task.
const BLOCK: usize = 4096;
/// Slabs of the box for which grids are made one after the other, at most, where particles are many.
const SLABS: usize = 8;
/// A pair further apart than this part beyond contact does not overlap, however squares are rounded.
const ROUNDING: f64 = 1e-14;
/// What places lose in single precision, in units of the largest coordinate or length, and what sums of radii
/// lose of themselves: both several times what they can.
const COARSE: f32 = 1e-6;

/// Largest overlap that a run goes on with [contact distances], …
const ALLOWED: f64 = 1e-12;
/// … or this many roundings of the coordinates, or of the free path where that is longer, if that is more.
const ROUNDINGS: f64 = 16.0;

/// Largest overlap \[length\] that a run goes on with: of bodies whose contact distance is `sigma` \[length\]
/// and whose largest coordinate, with the way since their last own events, is `reach` \[length\].
pub fn allowed_overlap(sigma: f64, reach: f64) -> f64 {
    f64::max(ALLOWED * sigma, ROUNDINGS * f64::EPSILON * reach)
}

/// The deepest overlap of all close pairs and of particles with walls.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Overlap {
    /// Overlap in contact distances (σ of the pair; the radius at a wall); 0 if nothing overlaps.
    pub depth: f64,
    /// The particle, and its partner's row (the greater of the two) or, at a wall, `None`.
    pub pair: Option<(u32, Option<u32>)>,
}

impl Overlap {
    pub(crate) const NONE: Self = Self { depth: 0.0, pair: None };

    /// The deeper of two; of equal ones that of the first rows, so that the order of work does not show.
    fn or(self, other: Self) -> Self {
        let equal = other.depth == self.depth && other.pair.is_some() && other.pair < self.pair;
        if other.depth > self.depth || equal { other } else { self }
    }
}

/// What a search for overlaps has found.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Found {
    pub deepest: Overlap,
    /// The deepest of those that are more than rounding.
    pub beyond: Overlap,
}

impl Found {
    const NONE: Self = Self { deepest: Overlap::NONE, beyond: Overlap::NONE };

    fn or(self, other: Self) -> Self {
        Self { deepest: self.deepest.or(other.deepest), beyond: self.beyond.or(other.beyond) }
    }

    /// Adds an overlap of bodies with this contact distance and these coordinates.
    fn add(&mut self, overlap: Overlap, sigma: f64, places: DVec3) {
        self.deepest = self.deepest.or(overlap);
        if overlap.depth * sigma > allowed_overlap(sigma, places.max_element() + sigma) {
            self.beyond = self.beyond.or(overlap);
        }
    }
}

/// The deepest overlap that has been met, and how it is measured.
struct Meter<'a> {
    world: &'a World,
    /// Lengths along periodic axes, infinite along others and beside a radius [length].
    edges: Vec4,
    /// The longest of the finite ones [length].
    longest: f32,
    found: Found,
}

impl<'a> Meter<'a> {
    fn new(world: &'a World) -> Self {
        let Periodicity { size, along, .. } = world.periodicity;
        let edges = [0, 1, 2].map(|k| if along[k] { size[k] as f32 } else { f32::INFINITY });
        let longest = edges.into_iter().filter(|edge| edge.is_finite()).fold(0.0, f32::max);
        Self { world, edges: Vec3::from(edges).extend(f32::INFINITY), longest, found: Found::NONE }
    }

    /// The sphere at `k` in a level against some others of that or another level.
    #[inline]
    fn meet(&mut self, own: &Level, k: usize, level: &Level, others: Range<usize>) {
        let sphere = own.spheres[k];
        let slack = COARSE * sphere.truncate().abs().max_element().max(self.longest);
        // The difference of last components is the sum of radii.
        let sphere = sphere * Vec4::new(1.0, 1.0, 1.0, -1.0);
        for (&j, &other) in level.rows[others.clone()].iter().zip(&level.spheres[others]) {
            let d = (other - sphere).abs();
            let nearest = d.min((d - self.edges).abs());
            // The other may be further out than this one, but no further than it is near.
            let near = nearest.w * (1.0 + 4.0 * COARSE) + slack;
            if nearest.truncate().length_squared() < near * near {
                self.look_closely(own.rows[k], j);
            }
        }
    }

    /// [`Self::meet`] for one that is near.
    #[inline(never)]
    fn look_closely(&mut self, i: u32, j: u32) {
        let r = self.world.periodicity.nearest(place(self.world, j) - place(self.world, i));
        let sigma = self.world.class(i).radius + self.world.class(j).radius;
        if r.length_squared() < sigma * sigma * (1.0 + ROUNDING) {
            self.touch(i, j, r.length(), sigma);
        }
    }

    #[cold]
    fn touch(&mut self, i: u32, j: u32, distance: f64, sigma: f64) {
        let movable = |i: u32| self.world.body(i).inverse_mass != 0.0;
        let depth = 1.0 - distance / sigma;
        if depth > 0.0 && (movable(i) || movable(j)) {
            let overlap = Overlap { depth, pair: Some((i.min(j), Some(i.max(j)))) };
            self.found.add(overlap, sigma, self.coordinates(i).max(self.coordinates(j)));
        }
    }

    /// A particle against all walls.
    fn meet_walls(&mut self, i: u32) {
        let (position, radius) = (place(self.world, i), self.world.class(i).radius);
        for wall in 0..self.world.walls.len() as u32 {
            let (gap, _) = self.world.wall_approach(wall, radius, position, DVec3::ZERO, self.world.now);
            if gap < 0.0 && self.world.body(i).inverse_mass != 0.0 {
                let overlap = Overlap { depth: -gap / radius, pair: Some((i, None)) };
                let point = self.world.walls[wall as usize].point.abs();
                self.found.add(overlap, radius, self.coordinates(i).max(point));
            }
        }
    }

    /// Sizes of the coordinates of particle i, at its last own event and now \[length\].
    fn coordinates(&self, i: u32) -> DVec3 {
        self.world.coordinates(i).max(self.world.state(i, self.world.now).0.abs())
    }
}

/// The deepest overlap of all the blocks that there are for `count` cells or particles.
fn deepest_of_blocks(world: &World, count: usize, search: impl Fn(&mut Meter<'_>, usize) + Sync) -> Found {
    let blocks = (0..count.div_ceil(BLOCK)).into_par_iter().map(|block| {
        let mut meter = Meter::new(world);
        for k in block * BLOCK..((block + 1) * BLOCK).min(count) {
            search(&mut meter, k);
        }
        meter.found
    });
    blocks.reduce(|| Found::NONE, Found::or)
}

/// Finds the deepest overlap now.
pub(crate) fn deepest(world: &World, geometry: &Geometry) -> Found {
    let slabs = if world.particles.len() < particles::SLABS { 1 } else { SLABS };
    deepest_by_slabs(world, geometry, &Slabs::new(world, geometry, slabs))
}

fn deepest_by_slabs(world: &World, geometry: &Geometry, slabs: &Slabs) -> Found {
    let count = world.particles.len();
    let mut found = Found::NONE;
    if !world.walls.is_empty() {
        found = deepest_of_blocks(world, count, |meter, i| meter.meet_walls(i as u32));
    }
    for slab in 0..slabs.len() {
        let rows = (0..count as u32).filter(|&i| slabs.knows(slab, i));
        let levels = levels(world, geometry, &rows, 0.0, slabs);
        for k in 0..levels.len() {
            // The particles of a cell against each other, those around them, and those of greater levels.
            let (own, greater) = (&levels[k], &levels[k..]);
            found = found.or(deepest_of_blocks(world, own.len(), |meter, cell| {
                meet(world, greater, cell, |k, level, others| meter.meet(own, k, level, others));
            }));
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

    /// Spheres strewn at random, radii over `octaves` powers of two, some of infinite mass, and an oblique
    /// plane.
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
            motion: crate::WallMotion::Fixed,
        };
        System {
            drives: Vec::new(),
            seed: 0,
            dimension: Dimension::Three,
            domain: Domain { size, boundary, gravity: DVec3::ZERO },
            bodies,
            classes,
            groups: vec![Group { name: "grain".to_owned() }],
            species: vec!["grain".to_owned()],
            walls: if seed.is_multiple_of(2) { vec![plane] } else { Vec::new() },
            contacts: Contacts {
                pair: vec![Restitution::Constant(1.0)],
                wall: vec![Restitution::Constant(1.0).into()],
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
                let distance = world.periodicity.nearest(place(world, j) - position).length();
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
            let (found, expected) = (deepest(&world, &geometry).deepest, by_all_pairs(&world));
            let slabs = Slabs::new(&world, &geometry, SLABS);
            slabbed += usize::from(slabs.len() > 1);
            assert_eq!(deepest_by_slabs(&world, &geometry, &slabs).deepest, found, "system {seed} by slabs");
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
