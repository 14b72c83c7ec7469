use glam::DVec3;
use haff_neighbors::{Axis, Geometry};
use haff_testing::Random;

use crate::{
    model::{
        SimdChoice,
        features::{Features, With},
    },
    search::{
        batch::Kernel,
        compact::CompactParticle,
        windows::{
            axes::{Axes, Tilt},
            cells::Cells,
            filter::{MAX_DISPLACEMENT, SHORT_DISPLACEMENT},
        },
    },
};

use super::*;

/// Edge of the box [length].
const EDGE: f64 = 2048.0;

/// The tilt of a window in a sheared box.
const TILT: Tilt =
    Tilt { start: 0.45, change: -0.2, stretch: [-0.04, 0.0, 0.03], end: [1.0 / 0.96, 1.0, 1.0 / 1.03] };
/// Factor of displacements and coordinates by which windows in a sheared cube widen their margin.
const WIDENED: f64 = 2.0;

fn cells() -> Cells {
    let geometry = Geometry {
        size: DVec3::splat(EDGE),
        axes: [Axis::Periodic, Axis::Periodic, Axis::Bounded],
        reach: 1.0,
        crowding: 1.0,
        radius: 0.5,
        radii: Vec::new(),
        planes: Vec::new(),
        deforming: None,
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
    /// A pair with a relative displacement of up to `displacement` contact distances, close to the limit
    /// between contact and no contact.
    fn new(random: &mut Random, displacement: f64, sigma: f64) -> Self {
        let v = direction(random) * (displacement * sigma * libm::pow(10.0, random.uniform(-3.0, 0.0)));
        let from = if random.index(2) == 0 { 0.0 } else { random.uniform(0.0, 1.0) };
        // Distances that differ from the contact distance by 0 to 3·10⁻³ of it.
        let edge = [1.0 - 1e-9, 1.0 - 1e-5, 1.0 - 1e-3, 1.0, 1.0 + 1e-9, 1.0 + 1e-4, 1.0 + 3e-3];
        let distance = sigma * edge[random.index(7)];
        let theta = match random.index(4) {
            0 => from,
            1 => 1.0,
            _ => random.uniform(from, 1.0),
        };
        let r = match random.index(4) {
            // Grazing: the closest approach is at `theta`.
            0 => direction(random).cross(v).normalize() * distance - v * theta,
            // At this distance at `theta`, in any direction.
            1 => direction(random) * distance - v * theta,
            // Head-on.
            2 => v.normalize() * distance - v * theta,
            _ => direction(random) * (random.uniform(0.9, 3.0) * sigma) - v * random.uniform(-0.5, 1.5),
        };
        Self { r, v, from, sigma }
    }

    /// Smallest distance in the rest of the window [contact distances].
    fn least_distance(&self) -> f64 {
        let theta = (-self.r.dot(self.v) / self.v.length_squared()).clamp(self.from, 1.0);
        (self.r + self.v * theta).length() / self.sigma
    }

    /// The query of one particle, and its partner.
    fn particles(
        &self,
        random: &mut Random,
        cells: &Cells,
        share: f64,
        margin: f32,
    ) -> (WindowQuery, CompactParticle) {
        let position = DVec3::from_array([0; 3].map(|_| random.uniform(0.3, 0.7) * EDGE));
        let v = direction(random) * (random.uniform(0.0, 1.0) * self.v.length());
        let compact = |x: DVec3, v: DVec3, radius: f64| CompactParticle {
            x: [0, 1, 2].map(|axis| cells.axes.coordinate(axis, x[axis])),
            radius: radius as f32 * margin,
            v: v.to_array().map(|v| v as f32),
            count: 0,
        };
        // The coordinates of a sheared box, from positions and from displacements relative to the flow.
        let (k, g) = (f64::from(cells.axes.tilt.start), f64::from(cells.axes.tilt.change));
        let tilted = |x: DVec3| x - DVec3::X * (k * x.y);
        let own = compact(tilted(position), tilted(v), share * self.sigma);
        let stretch = DVec3::from_array(cells.axes.tilt.stretch.map(f64::from));
        let relative_to_flow = v + self.v - DVec3::X * (g * self.r.y) - stretch * self.r;
        let other = compact(tilted(position + self.r), tilted(relative_to_flow), (1.0 - share) * self.sigma);
        (WindowQuery { slot: 0, compact: own, start: own.x, from: self.from as f32 }, other)
    }
}

/// Whether the pair passes the vector filter, for one vector and for two; `lane` selects the lane that tests
/// it. Empty if the processor has no vectors.
fn pass_vectors<F: Features>(
    other: &CompactParticle,
    axes: &Axes,
    query: &WindowQuery,
    lane: usize,
) -> Vec<bool> {
    let mut found = Vec::new();
    #[cfg(target_arch = "x86_64")]
    {
        let particles = [query.compact, *other, query.compact];
        let kernel = Kernel::choose(SimdChoice::Auto);
        let scratch = |groups: usize| {
            let mut scratch = Scratch::new();
            let lane = lane % (groups * LANES);
            scratch.candidates.slots[..groups * LANES].fill(query.slot);
            scratch.candidates.slots[lane] = 1;
            // The other vector belongs to another query.
            for group in 0..groups {
                scratch.candidates.owner[group] = u32::from(group != lane / LANES);
            }
            scratch.candidates.len = groups * LANES;
            scratch
        };
        // The other query is that of another particle, for which all slots are candidates.
        let queries = [*query, WindowQuery { slot: 2, ..*query }];
        if kernel != Some(Kernel::Portable) {
            for groups in [1, 2] {
                let mut scratch = scratch(groups);
                // SAFETY: `Kernel::choose` has just detected the features.
                unsafe { avx2::filter::<F>(&particles.to_vec().into(), axes, &queries, &mut scratch) };
                found.push(scratch.pairs.contains(&(0, 1)));
            }
        }
    }
    found
}

/// Results of the filters, in numbers of pairs.
#[derive(Debug, PartialEq)]
struct Counts {
    contacts: usize,
    /// Contacts that at least one filter rejects.
    missed: usize,
    /// Pairs that at least one filter passes although their distance always exceeds twice the margin.
    unnecessary: usize,
    /// Pairs, outside the range between contact and twice the margin, for which the filters differ.
    different: usize,
}

/// Tests `count` pairs with relative displacements of up to `displacement` contact distances.
fn check<F: Features>(displacement: f64, count: usize) -> Counts {
    let mut cells = cells();
    let widened = if F::DEFORMS { WIDENED } else { 1.0 };
    if F::DEFORMS {
        cells.axes.tilt = TILT;
    }
    let mut random = Random(displacement.to_bits());
    let margin = margin(0.5 * displacement * widened, 0.0);
    let outside = 1.0 + 2.0 * (f64::from(margin) - 1.0);
    let mut counts = Counts { contacts: 0, missed: 0, unnecessary: 0, different: 0 };
    for k in 0..count {
        let (sigma, share) =
            if F::UNIFORM { (1.0, 0.5) } else { (random.uniform(0.2, 1.0), random.uniform(0.1, 0.9)) };
        let pair = Pair::new(&mut random, displacement, sigma);
        let (query, other) = pair.particles(&mut random, &cells, share, margin);
        let least = pair.least_distance();
        let portable = passes::<F>(&other, &cells.axes, &query);
        let vectors = pass_vectors::<F>(&other, &cells.axes, &query, k);
        let all = vectors.iter().all(|&passes| passes);
        let any = vectors.iter().any(|&passes| passes);
        let touches = least <= 1.0;
        let apart = least > outside;
        counts.contacts += usize::from(touches);
        counts.missed += usize::from(touches && !(portable && all));
        counts.unnecessary += usize::from(apart && (portable || any));
        counts.different +=
            usize::from((touches || apart) && vectors.iter().any(|&passes| passes != portable));
    }
    counts
}

/// The reference is the smallest distance in `f64`. The pairs graze, touch at the start or the end of the
/// search, or pass within the margin; their displacements range from short ones to the longest that windows
/// allow.
#[test]
fn no_contact_is_rejected() {
    for displacement in
        [0.1, 1.0, 3.0, 10.0, 30.0, 2.0 * SHORT_DISPLACEMENT, 100.0, 200.0, 300.0, 2.0 * MAX_DISPLACEMENT]
    {
        for (kind, counts) in [
            ("one size", check::<With<false, true>>(displacement, 30_000)),
            ("sizes", check::<With<false, false>>(displacement, 30_000)),
            ("sheared", check::<With<false, false, false, false, true>>(displacement, 30_000)),
        ] {
            assert!(counts.contacts > 10_000, "{kind}, displacement {displacement}: {counts:?}");
            let expected = Counts { missed: 0, unnecessary: 0, different: 0, ..counts };
            assert_eq!(counts, expected, "{kind}, displacement {displacement}");
        }
    }
}

#[test]
fn a_particle_does_not_find_itself() {
    let cells = cells();
    let compact = CompactParticle { x: [1, 2, 3], radius: 0.5, v: [1.0, 0.0, 0.0], count: 0 };
    let query = WindowQuery { slot: 1, compact, start: compact.x, from: 0.0 };
    for lane in 0..2 * LANES {
        // Lane `lane` holds slot 1, the slot of the query.
        let found = pass_vectors::<With<false, true>>(&compact, &cells.axes, &query, lane);
        assert!(!found.contains(&true), "{lane}: {found:?}");
    }
}
