//! The densest lattice of each dimension, stretched to fit the box.
//!
//! fcc is the checkerboard lattice: the points (i, j, k) of a cuboid grid with i + j + k even. So is the
//! triangular lattice in the plane, with rows √3 times closer than the points of a row are apart. One
//! enumeration supports both: it tries numbers of grid planes per axis and keeps those that leave the largest
//! distance between neighbors.

use glam::DVec3;
use haff_engine::Boundary;

use crate::random::{Purpose, Stream};
use crate::room::{Obstacles, Room};

/// Planes of grid points along one axis.
#[derive(Debug, Clone, Copy)]
struct Axis {
    start: f64,
    length: f64,
    periodic: bool,
}

impl Axis {
    /// Distance between planes when there are `planes`.
    fn step(&self, planes: usize) -> f64 {
        if self.periodic { self.length / planes as f64 } else { self.length / (planes.max(2) - 1) as f64 }
    }

    fn at(&self, plane: usize, planes: usize) -> f64 {
        if self.periodic {
            (plane as f64 + 0.5) * self.step(planes)
        } else if planes == 1 {
            self.start + 0.5 * self.length
        } else {
            self.start + plane as f64 * self.step(planes)
        }
    }
}

/// Sites of a checkerboard lattice with these numbers of planes.
fn sites(planes: [usize; 3]) -> usize {
    planes.iter().product::<usize>().div_ceil(2)
}

/// Distance between nearest sites.
fn nearest(axes: &[Axis; 3], planes: [usize; 3]) -> f64 {
    let mut least = f64::INFINITY;
    for a in 0..3 {
        let step = axes[a].step(planes[a]);
        if planes[a] > 2 || (axes[a].periodic && planes[a] > 1) {
            least = least.min(2.0 * step);
        }
        for b in a + 1..3 {
            if planes[a] > 1 && planes[b] > 1 {
                least = least.min(step.hypot(axes[b].step(planes[b])));
            }
        }
    }
    least
}

/// Numbers of planes that give at least `count` sites as far apart as can be.
fn best_planes(axes: &[Axis; 3], count: usize, dimensions: usize) -> Option<[usize; 3]> {
    // A periodic axis needs an even number of planes for the checkerboard to close, or a single one.
    let allowed =
        |axis: usize, planes: usize| !axes[axis].periodic || planes == 1 || planes.is_multiple_of(2);
    let mut best: Option<([usize; 3], f64)> = None;
    // The initial guess has equal steps, which bounds the search: no axis has steps below half the best
    // distance.
    let free: Vec<f64> = axes[..dimensions].iter().map(|axis| axis.length.max(f64::MIN_POSITIVE)).collect();
    let consider = |planes: [usize; 3], best: &mut Option<([usize; 3], f64)>| {
        if sites(planes) < count {
            return;
        }
        let distance = nearest(axes, planes);
        let better =
            best.is_none_or(|(chosen, d)| distance > d || (distance == d && sites(planes) < sites(chosen)));
        if better {
            *best = Some((planes, distance));
        }
    };
    // Along each axis at most 2·count planes; the number along the last axis follows from the count.
    let last = dimensions - 1;
    let most = |axis: usize, best: &Option<([usize; 3], f64)>| -> usize {
        let cap = 2 * count + 2;
        match best {
            Some((_, distance)) if *distance > 0.0 => {
                ((2.0 * free[axis] / distance) as usize).saturating_add(2).min(cap)
            }
            _ => cap,
        }
    };
    let fill = |planes: [usize; 3]| {
        let rest: usize = (0..3).filter(|&axis| axis != last).map(|axis| planes[axis]).product();
        let mut needed = (2 * count - 1).div_ceil(rest).max(1);
        if !allowed(last, needed) {
            needed += 1;
        }
        let mut planes = planes;
        planes[last] = needed;
        planes
    };
    // Seed: steps equal as far as integers allow.
    let mut guess = [1; 3];
    let volume: f64 = free.iter().product();
    let step = libm::pow(volume / (2.0 * count as f64), 1.0 / dimensions as f64);
    for axis in 0..last {
        let planes = (free[axis] / step).clamp(1.0, 2.0 * count as f64) as usize;
        guess[axis] = if allowed(axis, planes) { planes } else { planes + 1 };
    }
    consider(fill(guess), &mut best);
    let mut px = 1;
    while px <= most(0, &best) {
        if allowed(0, px) {
            let mut py = 1;
            while py <= if last == 2 { most(1, &best) } else { 1 } {
                if last == 1 || allowed(1, py) {
                    consider(fill([px, py, 1]), &mut best);
                }
                py += 1;
            }
        }
        px += 1;
    }
    best.map(|(planes, _)| planes)
}

/// Centres of `count` equal spheres of this radius on the densest lattice that fits, in lattice order. Where
/// the lattice has more sites than particles, the vacancies are spread at random.
///
/// # Errors
/// The largest number of sites that could be found.
pub fn lattice(room: &Room, count: usize, radius: f64, seed: u64) -> Result<Vec<DVec3>, usize> {
    let dimensions = room.dimension.count();
    let mut axes = [Axis { start: 0.0, length: 0.0, periodic: false }; 3];
    for (k, axis) in axes.iter_mut().enumerate().take(dimensions) {
        let [low, high] = room.span(k, radius).ok_or(0_usize)?;
        let periodic = room.domain.boundary[k] == Boundary::Periodic;
        *axis = Axis { start: low, length: high - low, periodic };
    }
    let obstacles = Obstacles::new(room, radius);
    // Touching is fine, and rounding may take an ulp or two of the distance.
    let contact = 2.0 * radius * (1.0 - 1e-14);
    let mut requested = count;
    let mut found = 0;
    // Each round requests more sites by the number that was missing in the last one.
    for _ in 0..64 {
        let Some(planes) = best_planes(&axes, requested, dimensions) else { break };
        if nearest(&axes, planes) < contact {
            break;
        }
        let mut out = Vec::with_capacity(sites(planes));
        for i in 0..planes[0] {
            for j in 0..planes[1] {
                let first = (i + j) % 2;
                for k in (first..planes[2]).step_by(2) {
                    let z = if dimensions == 3 { axes[2].at(k, planes[2]) } else { 0.0 };
                    let site = DVec3::new(axes[0].at(i, planes[0]), axes[1].at(j, planes[1]), z);
                    if !room.behind_a_plane(site, radius) && !obstacles.blocks(site, radius) {
                        out.push(site);
                    }
                }
            }
        }
        found = found.max(out.len());
        if out.len() >= count {
            leave_out(&mut out, count, seed);
            return Ok(out);
        }
        requested += (count - out.len()).max(requested / 50).max(1);
    }
    Err(found)
}

/// Removes sites at random until `count` are left, keeping their order (selection sampling).
fn leave_out(sites: &mut Vec<DVec3>, count: usize, seed: u64) {
    let mut random = Stream::new(seed, Purpose::Vacancy, "", 0);
    let (mut left, mut needed) = (sites.len(), count);
    sites.retain(|_| {
        let keep = needed == left || random.below(left) < needed;
        left -= 1;
        needed -= usize::from(keep);
        keep
    });
}
