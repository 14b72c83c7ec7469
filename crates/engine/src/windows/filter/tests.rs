use glam::DVec3;
use haff_neighbors::{Axis, Geometry};

use super::*;
use crate::{batch::Kernel, features::With, model::SimdChoice, windows::random::Random};

/// Edge of the box [length].
const EDGE: f64 = 2048.0;

fn cells() -> Cells {
    let geometry = Geometry {
        size: DVec3::splat(EDGE),
        axes: [Axis::Periodic, Axis::Periodic, Axis::Bounded],
        reach: 1.0,
        crowding: 1.0,
        radius: 0.5,
        radii: Vec::new(),
        planes: Vec::new(),
    };
    Cells::new(&geometry, EDGE / 4.0, 1000)
}

fn direction(random: &mut Random) -> DVec3 {
    loop {
        let v = DVec3::from_array([0; 3].map(|_| random.uniform(-1.0, 1.0)));
        if v.length_squared() > 0.01 && v.length_squared() < 1.0 {
            return v.normalize();
        }
    }
}

/// A pair in a window: relative position at its start, relative displacement, start of the search, contact
/// distance.
struct Pair {
    r: DVec3,
    v: DVec3,
    from: f64,
    sigma: f64,
}

impl Pair {
    /// A pair whose way in the window is up to `way` contact distances long, of one of the kinds that are
    /// hard to tell.
    fn new(random: &mut Random, way: f64, sigma: f64) -> Self {
        let v = direction(random) * (way * sigma * libm::pow(10.0, random.uniform(-3.0, 0.0)));
        let from = if random.index(2) == 0 { 0.0 } else { random.uniform(0.0, 1.0) };
        // Within a few times the rounding of f64 of what just touches, or up to two margins off.
        let edge = [1.0 - 1e-9, 1.0 - 1e-5, 1.0 - 1e-3, 1.0, 1.0 + 1e-9, 1.0 + 1e-4, 1.0 + 3e-3];
        let distance = sigma * edge[random.index(7) as usize];
        let then = match random.index(4) {
            0 => from,
            1 => 1.0,
            _ => random.uniform(from, 1.0),
        };
        let r = match random.index(4) {
            // Grazing: nearest to each other `then`.
            0 => direction(random).cross(v).normalize() * distance - v * then,
            // At this distance `then`, in any direction.
            1 => direction(random) * distance - v * then,
            // Head on.
            2 => v.normalize() * distance - v * then,
            _ => direction(random) * (random.uniform(0.9, 3.0) * sigma) - v * random.uniform(-0.5, 1.5),
        };
        Self { r, v, from, sigma }
    }

    /// Least distance in what is left of the window [contact distances].
    fn least_distance(&self) -> f64 {
        let theta = (-self.r.dot(self.v) / self.v.length_squared()).clamp(self.from, 1.0);
        (self.r + self.v * theta).length() / self.sigma
    }

    /// A query, and its partner's compact.
    fn particles(
        &self,
        random: &mut Random,
        cells: &Cells,
        share: f64,
        margin: f32,
    ) -> (Query, CompactParticle) {
        let place = DVec3::from_array([0; 3].map(|_| random.uniform(0.3, 0.7) * EDGE));
        let v = direction(random) * (random.uniform(0.0, 1.0) * self.v.length());
        let compact = |x: DVec3, v: DVec3, radius: f64| CompactParticle {
            x: [0, 1, 2].map(|axis| cells.axes.coordinate(axis, x[axis])),
            radius: radius as f32 * margin,
            v: v.to_array().map(|v| v as f32),
            count: 0,
        };
        let own = compact(place, v, share * self.sigma);
        let other = compact(place + self.r, v + self.v, (1.0 - share) * self.sigma);
        (Query { slot: 0, compact: own, start: own.x, from: self.from as f32 }, other)
    }
}

/// What the vector filters say, those that the processor has; `place` tells the lane.
fn pass_vectors<F: Features>(
    other: &CompactParticle,
    unit: [f32; 3],
    query: &Query,
    place: usize,
) -> Vec<bool> {
    let mut found = Vec::new();
    #[cfg(target_arch = "x86_64")]
    {
        let particles = [query.compact, *other, query.compact];
        let kernel = Kernel::choose(SimdChoice::Auto);
        let scratch = |groups: usize| {
            let mut scratch = Scratch::new();
            let lane = place % (groups * LANES);
            scratch.candidates.slots[..groups * LANES].fill(query.slot);
            scratch.candidates.slots[lane] = 1;
            // The other group belongs to another search.
            for group in 0..groups {
                scratch.candidates.owner[group] = u32::from(group != lane / LANES);
            }
            scratch.candidates.len = groups * LANES;
            scratch
        };
        // Of another particle, which meets all others.
        let queries = [*query, Query { slot: 2, ..*query }];
        if kernel != Some(Kernel::Portable) {
            for groups in [1, 2] {
                let mut scratch = scratch(groups);
                // SAFETY: the features have just been found.
                unsafe { avx2::filter::<F>(&particles, unit, &queries, &mut scratch) };
                found.push(scratch.pairs.contains(&(0, 1)));
            }
        }
    }
    found
}

/// What the filters make of hard pairs, in counts.
#[derive(Debug, PartialEq)]
struct Verdict {
    contacts: usize,
    /// Contacts that one of the filters rejects.
    missed: usize,
    /// Pairs that one of them passes though they stay further apart than twice the margin.
    vain: usize,
    /// Pairs that only one of them passes though they touch, or stay further apart than twice the margin.
    different: usize,
}

/// Judges `count` pairs that go up to `way` contact distances relative to each other.
fn judge<F: Features>(way: f64, count: usize) -> Verdict {
    let cells = cells();
    let unit = cells.axes.unit;
    let mut random = Random(way.to_bits());
    let margin = margin(0.5 * way, 0.0);
    let outside = 1.0 + 2.0 * (f64::from(margin) - 1.0);
    let mut verdict = Verdict { contacts: 0, missed: 0, vain: 0, different: 0 };
    for k in 0..count {
        let (sigma, share) =
            if F::UNIFORM { (1.0, 0.5) } else { (random.uniform(0.2, 1.0), random.uniform(0.1, 0.9)) };
        let pair = Pair::new(&mut random, way, sigma);
        let (query, other) = pair.particles(&mut random, &cells, share, margin);
        let least = pair.least_distance();
        let portable = passes::<F>(&other, unit, &query);
        let vectors = pass_vectors::<F>(&other, unit, &query, k);
        let all = vectors.iter().all(|&passes| passes);
        let any = vectors.iter().any(|&passes| passes);
        let touches = least <= 1.0;
        let apart = least > outside;
        verdict.contacts += usize::from(touches);
        verdict.missed += usize::from(touches && !(portable && all));
        verdict.vain += usize::from(apart && (portable || any));
        verdict.different +=
            usize::from((touches || apart) && vectors.iter().any(|&passes| passes != portable));
    }
    verdict
}

/// Against f64, for pairs that graze, touch at the start or the end of the search, or pass by within the
/// margin, slow ones and such as go as far as windows allow.
#[test]
fn no_contact_is_ever_rejected() {
    for way in [0.1, 1.0, 3.0, 10.0, 30.0, 2.0 * NEAR, 100.0, 200.0, 300.0, 2.0 * FARTHEST] {
        for (kind, verdict) in [
            ("one size", judge::<With<false, true>>(way, 30_000)),
            ("sizes", judge::<With<false, false>>(way, 30_000)),
        ] {
            assert!(verdict.contacts > 10_000, "{kind}, way {way}: {verdict:?}");
            let none = Verdict { missed: 0, vain: 0, different: 0, ..verdict };
            assert_eq!(verdict, none, "{kind}, way {way}");
        }
    }
}

#[test]
fn a_particle_does_not_find_itself() {
    let cells = cells();
    let compact = CompactParticle { x: [1, 2, 3], radius: 0.5, v: [1.0, 0.0, 0.0], count: 0 };
    let query = Query { slot: 1, compact, start: compact.x, from: 0.0 };
    for lane in 0..2 * LANES {
        // Lane `lane` holds slot 1, which is the query's own.
        let found = pass_vectors::<With<false, true>>(&compact, cells.axes.unit, &query, lane);
        assert!(!found.contains(&true), "{lane}: {found:?}");
    }
}
