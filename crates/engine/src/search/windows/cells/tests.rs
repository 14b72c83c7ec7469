//! The guarantee of the grid, tested for straight and bent paths and for particles of one size and of many.

use glam::DVec3;
use haff_neighbors::{
    Axis::{self, Bounded, Flat, Periodic},
    Geometry,
};
use haff_testing::Random;

use crate::search::{
    compact::LANES,
    windows::cells::{Candidates, Cells},
};

fn geometry(size: DVec3, axes: [Axis; 3]) -> Geometry {
    Geometry {
        size,
        axes,
        reach: 1.0,
        crowding: 1.0,
        radius: 0.5,
        radii: Vec::new(),
        planes: Vec::new(),
        deforming: None,
    }
}

/// A path through a window: a first displacement, and a second one from the fraction `bend` of the window on.
struct Path {
    start: [f64; 3],
    displacements: [[f64; 3]; 2],
    bend: f64,
    extent: f64,
}

impl Path {
    fn new(random: &mut Random, geometry: &Geometry, longest: f64, extent: f64) -> Self {
        let mut path = Self { start: [0.0; 3], displacements: [[0.0; 3]; 2], bend: 1.0, extent };
        if random.index(3) == 0 {
            path.bend = random.uniform(0.1, 0.9);
        }
        for axis in (0..3).filter(|&axis| geometry.axes[axis] != Axis::Flat) {
            let length = geometry.size[axis];
            path.start[axis] = random.uniform(0.0, length);
            for displacement in &mut path.displacements {
                // Some paths are along an axis or have no length.
                let limit = if random.index(4) == 0 { 0.0 } else { longest };
                displacement[axis] = random.uniform(-limit, limit) * length;
            }
        }
        path
    }

    fn at(&self, theta: f64) -> [f64; 3] {
        let (before, after) = (theta.min(self.bend), (theta - self.bend).max(0.0));
        [0, 1, 2]
            .map(|k| self.start[k] + before * self.displacements[0][k] + after * self.displacements[1][k])
    }
}

fn coordinates(cells: &Cells, p: [f64; 3]) -> [i32; 3] {
    [0, 1, 2].map(|axis| cells.axes.coordinate(axis, p[axis]))
}

/// Empties the cells and registers slots 0 to `count` − 1 as if all had been sorted into the first row.
/// Returns their lowest cells.
fn fill(cells: &mut Cells, count: u32, path: impl Fn(u32) -> ([i32; 3], [f32; 3], f32)) -> Vec<u32> {
    let axes = cells.axes;
    let rows: Vec<u32> = (0..=axes.n[1] * axes.n[2]).map(|row| if row == 0 { 0 } else { count }).collect();
    let (mut lowest, mut leftover) = (vec![0; count as usize], Vec::new());
    for part in cells.parts(&rows, &mut lowest) {
        part.fill(&axes, &path, &mut leftover);
    }
    cells.complete(&leftover);
    lowest
}

/// Grids: size, axes, width of the cells, longest displacement along an axis [edges].
const GRIDS: [(DVec3, [Axis; 3], f64, f64); 10] = [
    (DVec3::new(20.0, 14.0, 17.0), [Periodic; 3], 1.0, 0.05),
    (DVec3::new(20.0, 14.0, 17.0), [Periodic; 3], 1.0, 0.22),
    (DVec3::new(9.0, 30.0, 12.0), [Bounded; 3], 0.9, 0.4),
    (DVec3::new(12.0, 11.0, 10.0), [Periodic, Bounded, Periodic], 1.1, 0.2),
    (DVec3::new(300.0, 250.0, 1.0), [Periodic, Bounded, Flat], 1.0, 0.22),
    // One, two and three cells along an edge.
    (DVec3::new(5.0, 10.0, 15.0), [Periodic; 3], 5.0, 0.2),
    (DVec3::new(5.0, 10.0, 15.0), [Bounded, Bounded, Periodic], 5.0, 0.4),
    // As many cells as searches extend over.
    (DVec3::new(5.5, 5.7, 1.0), [Periodic, Periodic, Flat], 2.7, 0.05),
    (DVec3::new(6.0, 6.1, 6.2), [Periodic; 3], 1.5, 0.1),
    // A grid with several parts.
    (DVec3::new(20.0, 20.0, 30.0), [Periodic; 3], 0.98, 0.03),
];

/// Whether two particles come within `reach` of each other along every axis after the fraction `from` of the
/// window, tested at 41 instants.
fn come_near(a: &Path, b: &Path, from: f64, reach: f64, (size, axes): (DVec3, [Axis; 3])) -> bool {
    (0..=40).any(|k| {
        let theta = from + (1.0 - from) * f64::from(k) / 40.0;
        let (a, b) = (a.at(theta), b.at(theta));
        (0..3).all(|axis| {
            let mut d = b[axis] - a[axis];
            if axes[axis] == Periodic {
                d -= (d / size[axis]).round() * size[axis];
            }
            d.abs() <= reach
        })
    })
}

/// Results of the searches, in numbers of particles.
#[derive(Default)]
struct Counts {
    /// Pairs that come near each other.
    near: usize,
    /// Candidates other than the particle itself, counted once per entry.
    gathered: usize,
    /// The same for searches without `HALF`.
    whole: usize,
    /// Pairs of a search and one of its candidates.
    found: usize,
    /// Pairs of a search and a particle.
    pairs: usize,
}

/// Number of candidates other than the searching slots; the index of a search is that of its slot.
fn others(candidates: &Candidates) -> usize {
    (0..candidates.len).filter(|k| candidates.owner[k / LANES] != candidates.slots[*k]).count()
}

/// Searches for the partners of all paths. With `HALF` all paths are straight, and searches start with the
/// window; otherwise they start at the bend of a path, or at a random fraction of the window.
fn check<const HALF: bool>(seed: u64) -> Counts {
    let mut random = Random(seed);
    let mut counts = Counts::default();
    for (size, axes, width, longest) in GRIDS {
        let geometry = geometry(size, axes);
        for largest in [0.0, 1.6] {
            let mut cells = Cells::new(&geometry, width, 100_000);
            let mut paths: Vec<Path> = (0..150)
                .map(|k| {
                    let extent = if k % 3 == 0 { random.uniform(0.0, largest) } else { 0.0 };
                    Path::new(&mut random, &geometry, longest, extent)
                })
                .collect();
            if HALF {
                for path in &mut paths {
                    path.bend = 1.0;
                }
            }
            let starts: Vec<_> = paths.iter().map(|path| coordinates(&cells, path.start)).collect();
            let lowest = fill(&mut cells, paths.len() as u32, |slot| {
                let path = &paths[slot as usize];
                (starts[slot as usize], path.displacements[0].map(|d| d as f32), path.extent as f32)
            });
            for (slot, path) in paths.iter().enumerate().filter(|(_, path)| path.bend < 1.0) {
                let displacement = path.displacements[1].map(|d| d as f32);
                let start = coordinates(&cells, path.at(path.bend));
                cells.register(slot as u32, start, displacement, 1.0 - path.bend as f32, path.extent as f32);
            }
            let (mut candidates, mut whole) = (Candidates::new(), Candidates::new());
            let searches: Vec<(f64, f64)> = paths
                .iter()
                .map(|path| {
                    let later = if HALF { 0.0 } else { random.index(2) as f64 * random.uniform(0.0, 1.0) };
                    (if path.bend < 1.0 { path.bend } else { later }, random.uniform(0.0, 1.2))
                })
                .collect();
            // With `HALF` all searches have the same range, because only one particle of a pair finds the
            // other.
            let common = random.uniform(0.3, 1.2);
            let reach = |own: usize| paths[own].extent + if HALF { common } else { searches[own].1 };
            for (own, &(from, _)) in searches.iter().enumerate() {
                let path = &paths[own];
                let displacement = path.displacements[usize::from(path.bend < 1.0)].map(|d| d as f32);
                let start = coordinates(&cells, path.at(from));
                let own = own as u32;
                let (reaches, low) = ([reach(own as usize) as f32, path.extent as f32], lowest[own as usize]);
                let fraction = 1.0 - from as f32;
                cells.gather::<HALF>(own, own, start, displacement, fraction, reaches, low, &mut candidates);
                cells.gather::<false>(own, own, start, displacement, fraction, reaches, low, &mut whole);
            }
            let mut found = vec![vec![false; paths.len()]; searches.len()];
            for k in 0..candidates.len {
                found[candidates.owner[k / LANES] as usize][candidates.slots[k] as usize] = true;
            }
            counts.gathered += others(&candidates);
            counts.whole += others(&whole);
            counts.found += found.iter().flatten().filter(|&&found| found).count();
            counts.pairs += searches.len() * paths.len();
            for (own, found) in found.iter().enumerate() {
                for (slot, path) in paths.iter().enumerate() {
                    let other = HALF && (lowest[slot], slot) < (lowest[own], own);
                    let within = reach(own) + path.extent;
                    let near = !other && come_near(&paths[own], path, searches[own].0, within, (size, axes));
                    counts.near += usize::from(near);
                    assert!(!near || found[slot], "{axes:?}, {size}: {own} does not find {slot}");
                }
            }
        }
    }
    counts
}

#[test]
fn particles_near_a_path_are_candidates() {
    let counts = check::<false>(11);
    // The test is not trivial: many pairs come near each other, and most pairs are not candidates.
    assert!(counts.near > 3000, "{}", counts.near);
    assert!(2 * counts.found < counts.pairs, "{} of {}", counts.found, counts.pairs);
}

#[test]
fn half_a_search_finds_every_near_pair() {
    let counts = check::<true>(11);
    assert!(counts.near > 3000, "{}", counts.near);
    let Counts { gathered, whole, .. } = counts;
    // Less than half is saved, because of long paths and of paths across edges.
    assert!(10 * gathered < 9 * whole, "{gathered} of {whole}");
}

#[test]
fn a_cell_holds_any_number_of_slots_and_is_emptied() {
    let geometry = geometry(DVec3::splat(8.0), [Axis::Periodic; 3]);
    let mut cells = Cells::new(&geometry, 1.0, 100_000);
    let mut candidates = Candidates::new();
    let count = 10_000;
    let start = coordinates(&cells, [4.5; 3]);
    let search = |cells: &Cells, search: u32, position: [f64; 3], candidates: &mut Candidates| {
        candidates.len = 0;
        let x = coordinates(cells, position);
        cells.gather::<false>(search, count, x, [0.0; 3], 1.0, [0.5, 0.0], 0, candidates);
    };
    for round in 0..2 {
        fill(&mut cells, count, |_| (start, [0.0; 3], 0.0));
        for (number, position) in [[4.5; 3], [5.2, 4.5, 3.9]].into_iter().enumerate() {
            search(&cells, number as u32, position, &mut candidates);
            let mut slots = candidates.slots[..candidates.len].to_vec();
            slots.retain(|&slot| slot != count);
            slots.sort_unstable();
            assert!(slots.into_iter().eq(0..count), "round {round}, from {position:?}");
            let owner = &candidates.owner[..candidates.len / LANES];
            assert!(owner.iter().all(|&owner| owner == number as u32));
        }
        fill(&mut cells, 0, |_| (start, [0.0; 3], 0.0));
        search(&cells, 0, [4.5; 3], &mut candidates);
        assert!(candidates.slots[..candidates.len].iter().all(|&slot| slot == count), "round {round}");
    }
}
