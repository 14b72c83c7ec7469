//! The promise of the grid, kept for straight and bent paths, one size and many.

use glam::DVec3;
use haff_neighbors::{
    Axis::{self, Bounded, Flat, Periodic},
    Geometry,
};

use super::*;
use crate::windows::random::Random;

fn geometry(size: DVec3, axes: [Axis; 3]) -> Geometry {
    Geometry { size, axes, reach: 1.0, crowding: 1.0, radius: 0.5, radii: Vec::new(), planes: Vec::new() }
}

/// A path through a window, bent once.
struct Path {
    start: [f64; 3],
    ways: [[f64; 3]; 2],
    bend: f64,
    extent: f64,
}

impl Path {
    fn new(random: &mut Random, geometry: &Geometry, longest: f64, extent: f64) -> Self {
        let mut path = Self { start: [0.0; 3], ways: [[0.0; 3]; 2], bend: 1.0, extent };
        if random.index(3) == 0 {
            path.bend = random.uniform(0.1, 0.9);
        }
        for axis in (0..3).filter(|&axis| geometry.axes[axis] != Axis::Flat) {
            let length = geometry.size[axis];
            path.start[axis] = random.uniform(0.0, length);
            for way in &mut path.ways {
                // Some along an axis, or at rest.
                let part = if random.index(4) == 0 { 0.0 } else { longest };
                way[axis] = random.uniform(-part, part) * length;
            }
        }
        path
    }

    fn at(&self, theta: f64) -> [f64; 3] {
        let (before, after) = (theta.min(self.bend), (theta - self.bend).max(0.0));
        [0, 1, 2].map(|k| self.start[k] + before * self.ways[0][k] + after * self.ways[1][k])
    }
}

fn coordinates(cells: &Cells, p: [f64; 3]) -> [i32; 3] {
    [0, 1, 2].map(|axis| cells.axes.coordinate(axis, p[axis]))
}

/// Empties the cells and registers slots 0 … `count`, all of them found in the first row when they were
/// sorted; their lowest cells.
fn fill(cells: &mut Cells, count: u32, path: impl Fn(u32) -> ([i32; 3], [f32; 3], f32)) -> Vec<u32> {
    let axes = cells.axes;
    let rows: Vec<u32> = (0..=axes.n[1] * axes.n[2]).map(|row| if row == 0 { 0 } else { count }).collect();
    let (mut lowest, mut left) = (vec![0; count as usize], Vec::new());
    for part in cells.parts(&rows, &mut lowest) {
        part.fill(&axes, &path, &mut left);
    }
    cells.complete(&left);
    lowest
}

/// Grids: size, axes, width of the cells, longest way along an axis [edges].
const GRIDS: [(DVec3, [Axis; 3], f64, f64); 8] = [
    (DVec3::new(20.0, 14.0, 17.0), [Periodic; 3], 1.0, 0.05),
    (DVec3::new(20.0, 14.0, 17.0), [Periodic; 3], 1.0, 0.22),
    (DVec3::new(9.0, 30.0, 12.0), [Bounded; 3], 0.9, 0.4),
    (DVec3::new(12.0, 11.0, 10.0), [Periodic, Bounded, Periodic], 1.1, 0.2),
    (DVec3::new(300.0, 250.0, 1.0), [Periodic, Bounded, Flat], 1.0, 0.22),
    // One, two and three cells to an edge.
    (DVec3::new(5.0, 10.0, 15.0), [Periodic; 3], 5.0, 0.2),
    (DVec3::new(5.0, 10.0, 15.0), [Bounded, Bounded, Periodic], 5.0, 0.4),
    // Cells in several parts.
    (DVec3::new(20.0, 20.0, 30.0), [Periodic; 3], 0.98, 0.03),
];

/// Whether two come within `reach` of each other, along every axis, from `from` on: seen at 41 instants.
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

/// What searches make of paths, in counts.
#[derive(Default)]
struct Verdict {
    near: usize,
    /// Others gathered, and those that whole searches gather, each as often as it is registered there.
    gathered: usize,
    whole: usize,
    found: usize,
    pairs: usize,
}

/// Slots gathered that are not those of the searches themselves; searches have the numbers of their slots.
fn others(candidates: &Candidates) -> usize {
    (0..candidates.len).filter(|k| candidates.owner[k / LANES] != candidates.slots[*k]).count()
}

/// Searches all paths; with `HALF` at the start of the window, where all of them are straight, otherwise from
/// where each bends or from somewhere on it.
fn judge<const HALF: bool>(seed: u64) -> Verdict {
    let mut random = Random(seed);
    let mut verdict = Verdict::default();
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
                (starts[slot as usize], path.ways[0].map(|way| way as f32), path.extent as f32)
            });
            for (slot, path) in paths.iter().enumerate().filter(|(_, path)| path.bend < 1.0) {
                let way = path.ways[1].map(|way| way as f32);
                let place = coordinates(&cells, path.at(path.bend));
                cells.register(slot as u32, place, way, 1.0 - path.bend as f32, path.extent as f32);
            }
            let (mut candidates, mut whole) = (Candidates::new(), Candidates::new());
            let searches: Vec<(f64, f64)> = paths
                .iter()
                .map(|path| {
                    let later = if HALF { 0.0 } else { random.index(2) as f64 * random.uniform(0.0, 1.0) };
                    (if path.bend < 1.0 { path.bend } else { later }, random.uniform(0.0, 1.2))
                })
                .collect();
            // One reach for all in a window, as the promise of half a search is one of pairs.
            let common = random.uniform(0.3, 1.2);
            let reach = |own: usize| paths[own].extent + if HALF { common } else { searches[own].1 };
            for (own, &(from, _)) in searches.iter().enumerate() {
                let path = &paths[own];
                let way = path.ways[usize::from(path.bend < 1.0)].map(|way| way as f32);
                let place = coordinates(&cells, path.at(from));
                let own = own as u32;
                let (reaches, low) = ([reach(own as usize) as f32, path.extent as f32], lowest[own as usize]);
                let part = 1.0 - from as f32;
                cells.gather::<HALF>(own, own, place, way, part, reaches, low, &mut candidates);
                cells.gather::<false>(own, own, place, way, part, reaches, low, &mut whole);
            }
            let mut found = vec![vec![false; paths.len()]; searches.len()];
            for k in 0..candidates.len {
                found[candidates.owner[k / LANES] as usize][candidates.slots[k] as usize] = true;
            }
            verdict.gathered += others(&candidates);
            verdict.whole += others(&whole);
            verdict.found += found.iter().flatten().filter(|&&found| found).count();
            verdict.pairs += searches.len() * paths.len();
            for (own, found) in found.iter().enumerate() {
                for (slot, path) in paths.iter().enumerate() {
                    let other = HALF && (lowest[slot], slot) < (lowest[own], own);
                    let within = reach(own) + path.extent;
                    let near = !other && come_near(&paths[own], path, searches[own].0, within, (size, axes));
                    verdict.near += usize::from(near);
                    assert!(!near || found[slot], "{axes:?}, {size}: {own} does not find {slot}");
                }
            }
        }
    }
    verdict
}

#[test]
fn whoever_comes_near_a_path_is_among_its_candidates() {
    let verdict = judge::<false>(11);
    // There were contacts to be missed, and finding all particles would not pass.
    assert!(verdict.near > 3000, "{}", verdict.near);
    assert!(2 * verdict.found < verdict.pairs, "{} of {}", verdict.found, verdict.pairs);
}

#[test]
fn of_two_who_come_near_each_other_the_lower_one_finds_the_other() {
    let verdict = judge::<true>(11);
    assert!(verdict.near > 3000, "{}", verdict.near);
    let Verdict { gathered, whole, .. } = verdict;
    // Long ways, and edges that they cross, leave less than half to be spared.
    assert!(10 * gathered < 9 * whole, "{gathered} of {whole}");
}

#[test]
fn a_cell_holds_any_number_and_forgets_all() {
    let geometry = geometry(DVec3::splat(8.0), [Axis::Periodic; 3]);
    let mut cells = Cells::new(&geometry, 1.0, 100_000);
    let mut candidates = Candidates::new();
    let count = 10_000;
    let start = coordinates(&cells, [4.5; 3]);
    let search = |cells: &Cells, search: u32, place: [f64; 3], candidates: &mut Candidates| {
        candidates.len = 0;
        let x = coordinates(cells, place);
        cells.gather::<false>(search, count, x, [0.0; 3], 1.0, [0.5, 0.0], 0, candidates);
    };
    for round in 0..2 {
        fill(&mut cells, count, |_| (start, [0.0; 3], 0.0));
        for (number, place) in [[4.5; 3], [5.2, 4.5, 3.9]].into_iter().enumerate() {
            search(&cells, number as u32, place, &mut candidates);
            let mut slots = candidates.slots[..candidates.len].to_vec();
            slots.retain(|&slot| slot != count);
            slots.sort_unstable();
            assert!(slots.into_iter().eq(0..count), "round {round}, from {place:?}");
            let owner = &candidates.owner[..candidates.len / LANES];
            assert!(owner.iter().all(|&owner| owner == number as u32));
        }
        fill(&mut cells, 0, |_| (start, [0.0; 3], 0.0));
        search(&cells, 0, [4.5; 3], &mut candidates);
        assert!(candidates.slots[..candidates.len].iter().all(|&slot| slot == count), "round {round}");
    }
}
