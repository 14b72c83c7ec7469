//! The deepest overlap of all close pairs and of particles with walls. It is found with separate grids,
//! independently of the engine's search.

use std::ops::Range;

use glam::{Vec3, Vec4};
use haff_neighbors::Geometry;
use rayon::prelude::*;

use crate::{
    model::bounds::allowed_overlap,
    numerics::tuning::particles,
    state::{periodicity::Periodicity, sliding_images::SlidingImages, world::World},
    support::grid::{Level, Slabs, levels, visit_pairs, visit_pairs_across_sheared_faces, wrapped_position},
};

/// Cells or particles per parallel task.
const BLOCK: usize = 4096;
/// Largest number of slabs of the box, if there are many particles. Grids are built for one slab after the
/// other.
const SLABS: usize = 8;
/// Bound on the relative rounding error of squared distances: a pair whose squared distance is larger than σ²
/// by more than this fraction does not overlap.
const ROUNDING: f64 = 1e-14;
/// Bound on rounding errors in single precision: of positions, relative to the largest coordinate or length,
/// and of sums of radii, relative to the sum. Several times the largest possible error.
const COARSE: f32 = 1e-6;

/// The deepest overlap of all close pairs and of particles with walls.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Overlap {
    /// Overlap [contact distances: σ of the pair; the radius at a wall]; 0 if nothing overlaps.
    pub depth: f64,
    /// The particle, and its partner, which has the higher index, or `None` for a wall.
    pub pair: Option<(u32, Option<u32>)>,
}

impl Overlap {
    pub(crate) const NONE: Self = Self { depth: 0.0, pair: None };

    /// The deeper of two overlaps. Of equal ones the pair of lower indices, so that the result does not
    /// depend on the order of work.
    fn or(self, other: Self) -> Self {
        let equal = other.depth == self.depth && other.pair.is_some() && other.pair < self.pair;
        if other.depth > self.depth || equal { other } else { self }
    }
}

/// The result of a search for overlaps.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Found {
    /// The deepest overlap.
    pub deepest: Overlap,
    /// The deepest of those that are more than rounding.
    pub beyond: Overlap,
}

impl Found {
    const NONE: Self = Self { deepest: Overlap::NONE, beyond: Overlap::NONE };

    fn or(self, other: Self) -> Self {
        Self { deepest: self.deepest.or(other.deepest), beyond: self.beyond.or(other.beyond) }
    }

    /// Adds an overlap of bodies with this contact distance and this [reach](OverlapSearch::reach).
    fn add(&mut self, overlap: Overlap, sigma: f64, reach: f64) {
        self.deepest = self.deepest.or(overlap);
        if overlap.depth * sigma > allowed_overlap(sigma, reach + sigma) {
            self.beyond = self.beyond.or(overlap);
        }
    }
}

/// A search for overlaps, and its result so far.
struct OverlapSearch<'a> {
    world: &'a World,
    /// Edge lengths along periodic axes; infinite along other axes and in the component of the radius
    /// [length].
    edges: Vec4,
    /// The longest finite edge [length].
    longest: f32,
    found: Found,
}

impl<'a> OverlapSearch<'a> {
    fn new(world: &'a World) -> Self {
        let Periodicity { size, is_periodic, .. } = world.periodicity(world.now);
        let edges = [0, 1, 2].map(|k| if is_periodic[k] { size[k] as f32 } else { f32::INFINITY });
        let longest = edges.into_iter().filter(|edge| edge.is_finite()).fold(0.0, f32::max);
        Self { world, edges: Vec3::from(edges).extend(f32::INFINITY), longest, found: Found::NONE }
    }

    /// Tests the sphere with index `k` of a level against some spheres of the same or another level.
    #[inline]
    fn test_candidates(&mut self, own: &Level, k: usize, level: &Level, others: Range<usize>) {
        let sphere = own.spheres[k];
        let slack = COARSE * sphere.truncate().abs().max_element().max(self.longest);
        // With its last component negated, the difference of last components is the sum of the radii.
        let sphere = sphere * Vec4::new(1.0, 1.0, 1.0, -1.0);
        for (&j, &other) in level.rows[others.clone()].iter().zip(&level.spheres[others]) {
            let d = (other - sphere).abs();
            let nearest = d.min((d - self.edges).abs());
            // The coordinates of the other sphere can be larger than those in `slack`, but only by the
            // distance itself, which the first term covers.
            let near = nearest.w * (1.0 + 4.0 * COARSE) + slack;
            if nearest.truncate().length_squared() < near * near {
                self.test_exactly(own.rows[k], j);
            }
        }
    }

    /// Tests one pair in double precision.
    #[inline(never)]
    fn test_exactly(&mut self, i: u32, j: u32) {
        let difference = wrapped_position(self.world, j) - wrapped_position(self.world, i);
        let (r, _) = self.world.nearest_image(difference, self.world.now);
        let sigma = self.world.class(i).radius + self.world.class(j).radius;
        if r.length_squared() < sigma * sigma * (1.0 + ROUNDING) {
            self.add_pair(i, j, r.length(), sigma);
        }
    }

    /// Adds a pair at this distance, if it overlaps.
    #[cold]
    fn add_pair(&mut self, i: u32, j: u32, distance: f64, sigma: f64) {
        let movable = |i: u32| self.world.body(i).inverse_mass != 0.0;
        let depth = 1.0 - distance / sigma;
        if depth > 0.0 && (movable(i) || movable(j)) {
            let overlap = Overlap { depth, pair: Some((i.min(j), Some(i.max(j)))) };
            self.found.add(overlap, sigma, self.reach(i).max(self.reach(j)));
        }
    }

    /// Tests a particle against all walls.
    fn test_walls(&mut self, i: u32) {
        let (position, radius) = (wrapped_position(self.world, i), self.world.class(i).radius);
        for wall in 0..self.world.boundary.walls.len() as u32 {
            let gap = self.world.wall_distance(i, wall, position) - radius;
            if gap < 0.0 && self.world.body(i).inverse_mass != 0.0 {
                let overlap = Overlap { depth: -gap / radius, pair: Some((i, None)) };
                let point = self.world.boundary.walls[wall as usize].coordinates().max_element();
                self.found.add(overlap, radius, self.reach(i).max(point));
            }
        }
    }

    /// The length to which the rounding error of the position of particle i is relative \[length\]: its
    /// coordinates at its own last event and now, the length of its flight since then, and the extent of the
    /// system, which bounds earlier flights and the displacement in a tick.
    fn reach(&self, i: u32) -> f64 {
        let (now, extent) = (self.world.now, self.world.resolution.extent);
        let coordinates = self.world.coordinates(i).max(self.world.state(i, now).0.abs());
        coordinates.max_element().max(self.world.flight_length(i, now)) + extent
    }
}

/// Calls `test` for all indices below `count`, of cells or particles, in parallel blocks. Returns the
/// overlaps that it has found.
fn search_blocks(world: &World, count: usize, test: impl Fn(&mut OverlapSearch<'_>, usize) + Sync) -> Found {
    let blocks = (0..count.div_ceil(BLOCK)).into_par_iter().map(|block| {
        let mut search = OverlapSearch::new(world);
        for k in block * BLOCK..((block + 1) * BLOCK).min(count) {
            test(&mut search, k);
        }
        search.found
    });
    blocks.reduce(|| Found::NONE, Found::or)
}

/// Finds the deepest present overlap.
pub(crate) fn deepest(world: &World, geometry: &Geometry) -> Found {
    let slabs = if world.particles.len() < particles::SLABS { 1 } else { SLABS };
    deepest_by_slabs(world, geometry, &Slabs::new(world, geometry, slabs))
}

/// [`deepest`], for the grids of these slabs.
fn deepest_by_slabs(world: &World, geometry: &Geometry, slabs: &Slabs) -> Found {
    let count = world.particles.len();
    let mut found = Found::NONE;
    if !world.boundary.walls.is_empty() {
        found = search_blocks(world, count, |search, i| search.test_walls(i as u32));
    }
    if let Some(shear) = world.shear() {
        found = found.or(across_sheared_faces(world, shear, geometry.reach));
    }
    for slab in 0..slabs.len() {
        let rows = (0..count as u32).filter(|&i| slabs.contains(slab, i));
        let levels = levels(world, geometry, &rows, 0.0, slabs);
        for k in 0..levels.len() {
            // Pairs within a cell, with neighbor cells, and with levels of larger particles.
            let (own, greater) = (&levels[k], &levels[k..]);
            found = found.or(search_blocks(world, own.len(), |search, cell| {
                visit_pairs(world, greater, cell, |k, level, others| {
                    search.test_candidates(own, k, level, others);
                });
            }));
        }
    }
    found
}

/// Overlaps of pairs across the faces of the gradient axis of a sheared box, where images are displaced; the
/// grids find all others.
fn across_sheared_faces(world: &World, shear: &SlidingImages, reach: f64) -> Found {
    let mut search = OverlapSearch::new(world);
    visit_pairs_across_sheared_faces(world, shear, reach * (1.0 + 1e-9), |i, j| search.test_exactly(i, j));
    search.found
}

#[cfg(test)]
mod tests {
    use glam::DVec3;
    use haff_testing::Random;

    use super::*;
    use crate::{
        model::{Body, Boundary, Class, Contacts, Dimension, Domain, Group, Restitution, System, Wall},
        support::geometry::geometry,
    };

    /// Spheres at random positions, with radii over `octaves` powers of two, some of infinite mass; and an
    /// oblique plane for even seeds.
    fn random_system(seed: u64, count: usize, octaves: f64) -> System {
        let mut random = Random(seed);
        let kinds = [Boundary::Periodic, Boundary::Wall, Boundary::Open];
        let boundary = std::array::from_fn(|_| kinds[(3.0 * random.uniform(0.0, 1.0)) as usize]);
        let size = DVec3::from_array([0.0; 3].map(|_: f64| 4.0 + 30.0 * random.uniform(0.0, 1.0)));
        let classes: Vec<Class> = (0..count)
            .map(|_| Class {
                radius: (-octaves * random.uniform(0.0, 1.0)).exp2(),
                mass: if random.uniform(0.0, 1.0) < 0.1 { f64::INFINITY } else { 1.0 },
                group: 0,
            })
            .collect();
        let bodies = (0..count)
            .map(|i| Body {
                position: size * DVec3::from_array([0.0; 3].map(|_: f64| random.uniform(0.0, 1.0))),
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
            shape: None,
        };
        System {
            spin: None,
            drag: None,
            drives: Vec::new(),
            measure: crate::Measure::default(),
            flow: None,
            seed: 0,
            dimension: Dimension::Three,
            domain: Domain { size, boundary, gravity: DVec3::ZERO, shear: None, compression: None },
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

    /// The deepest overlap by a test of every pair and every wall.
    fn by_all_pairs(world: &World) -> Overlap {
        let mut deepest = Overlap::NONE;
        let count = world.particles.len() as u32;
        for i in 0..count {
            let (class, position) = (world.class(i), wrapped_position(world, i));
            for j in i + 1..count {
                let other = world.class(j);
                let distance =
                    world.boundary.periodicity.nearest(wrapped_position(world, j) - position).length();
                let depth = 1.0 - distance / (class.radius + other.radius);
                if class.mass.is_finite() || other.mass.is_finite() {
                    deepest = deepest.or(Overlap { depth, pair: Some((i, Some(j))) });
                }
            }
            for wall in &world.boundary.walls {
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
            let system =
                random_system(seed, [2, 9, 80][seed as usize % 3], [0.0, 1.5, 9.0][seed as usize / 3 % 3]);
            let world = World::new(&system, -50);
            let geometry = geometry(&system, &world, f64::INFINITY);
            let (found, expected) = (deepest(&world, &geometry).deepest, by_all_pairs(&world));
            let slabs = Slabs::new(&world, &geometry, SLABS);
            slabbed += usize::from(slabs.len() > 1);
            assert_eq!(deepest_by_slabs(&world, &geometry, &slabs).deepest, found, "system {seed} by slabs");
            assert_eq!(found.pair, expected.pair, "system {seed}: {found:?}, {expected:?}");
            // The two distances from a plane are rounded differently.
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
