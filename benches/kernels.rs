//! Times of single operations: contact times, impacts, the calendar and the cells.
//!
//! `cargo bench --bench kernels`; `-- calendar` selects a group. The time of one pair is that of dependent
//! operations; a batch of independent pairs shows the time per pair when the processor overlaps them.

use std::hint::black_box;

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use glam::DVec3;
use haff_calendar::{Calendar, Event, Heap, Ladder};
use haff_mechanics::{resolve_contact, time_to_contact, time_to_plane};
use haff_neighbors::{Axis, Cells, Geometry, Search};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

/// Pairs in a batch: their data, 50 kB, fit in the second-level cache. A processor may learn the branches of
/// so few; the scenes show the times without that.
const BATCH: usize = 1024;

fn random() -> Pcg64Mcg {
    Pcg64Mcg::seed_from_u64(1)
}

fn vector(random: &mut Pcg64Mcg, half_width: f64) -> DVec3 {
    let mut one = || random.random_range(-half_width..half_width);
    DVec3::new(one(), one(), one())
}

/// Relative positions and velocities as a search finds them: neighbors up to three diameters away, of which
/// about one in twenty collides.
fn pairs() -> Vec<(DVec3, DVec3)> {
    let mut random = random();
    let mut pairs = Vec::with_capacity(BATCH);
    while pairs.len() < BATCH {
        let r = vector(&mut random, 3.0);
        if r.length() > 1.0 {
            pairs.push((r, vector(&mut random, 2.0)));
        }
    }
    pairs
}

fn contact_times(criterion: &mut Criterion) {
    let pairs = pairs();
    let mut group = criterion.benchmark_group("contact_time");
    let (r, v) = (DVec3::new(2.0, 0.3, -0.2), DVec3::new(-1.0, 0.1, 0.1));
    group.bench_function("one pair that collides", |b| {
        b.iter(|| time_to_contact(black_box(r), black_box(v), black_box(1.0)));
    });
    group.bench_function("one pair that recedes", |b| {
        b.iter(|| time_to_contact(black_box(r), black_box(-v), black_box(1.0)));
    });
    group.throughput(Throughput::Elements(BATCH as u64));
    group.bench_function("batch, earliest of all", |b| {
        b.iter(|| {
            let times = black_box(&pairs).iter().filter_map(|&(r, v)| time_to_contact(r, v, 1.0));
            times.fold(f64::INFINITY, f64::min)
        });
    });
    group.finish();
}

fn impacts(criterion: &mut Criterion) {
    let mut random = random();
    let contacts: Vec<(DVec3, DVec3, DVec3)> = (0..BATCH)
        .map(|_| {
            let normal = vector(&mut random, 1.0).normalize();
            // Approaching: the first is behind the second and faster along the normal.
            let v = vector(&mut random, 1.0);
            (v + normal * (1.0 + v.length()), v, normal)
        })
        .collect();
    let mut group = criterion.benchmark_group("impact");
    group.bench_function("one contact", |b| {
        let (w1, w2, r) = contacts[0];
        b.iter(|| resolve_contact(black_box(w1), black_box(w2), 1.0, 1.0, black_box(r), black_box(0.9)));
    });
    group.throughput(Throughput::Elements(BATCH as u64));
    group.bench_function("batch", |b| {
        b.iter(|| {
            for &(w1, w2, r) in black_box(&contacts) {
                black_box(resolve_contact(w1, w2, 1.0, 1.0, r, 0.9));
            }
        });
    });
    group.finish();
}

fn wall_times(criterion: &mut Criterion) {
    let mut random = random();
    let flights: Vec<(f64, f64)> =
        (0..BATCH).map(|_| (random.random_range(0.0..3.0), random.random_range(-2.0..2.0))).collect();
    let mut group = criterion.benchmark_group("wall_time");
    group.throughput(Throughput::Elements(BATCH as u64));
    for (name, acceleration) in [("batch, straight flight", 0.0), ("batch, under gravity", -1.0)] {
        group.bench_function(name, |b| {
            b.iter(|| {
                let times = black_box(&flights)
                    .iter()
                    .filter_map(|&(distance, speed)| time_to_plane(distance, speed, black_box(acceleration)));
                times.fold(f64::INFINITY, f64::min)
            });
        });
    }
    group.finish();
}

/// A calendar entry of the engine's size.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Entry {
    time: i64,
    owner: u32,
    partner: u32,
    counts: u64,
}

impl Event for Entry {
    fn time(&self) -> i64 {
        self.time
    }
}

/// The hold model: the earliest event is taken and its successor added, so the number of events stays
/// constant. Delays are exponential with mean 2^40 ticks, as between the collisions of a gas.
fn hold<C: Calendar<Entry>>(events: usize) -> impl FnMut() {
    let mut random = random();
    let delays: Vec<i64> = (0..1 << 12)
        .map(|_| (-(1.0 - random.random_range(0.0..1.0_f64)).ln() * (1_u64 << 40) as f64) as i64)
        .collect();
    let mut next = 0;
    let mut delay = move || {
        next = (next + 1) % delays.len();
        delays[next]
    };
    let mut calendar = C::with_capacity(events);
    for owner in 0..events as u32 {
        calendar.push(Entry { time: delay(), owner, partner: 0, counts: 0 });
    }
    let mut step = move || {
        let entry = calendar.pop_until(i64::MAX).expect("every event leaves a successor");
        calendar.push(Entry { time: entry.time + delay(), ..entry });
    };
    // The ladder reaches its steady state after some turnovers.
    for _ in 0..5 * events {
        step();
    }
    step
}

fn calendars(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("calendar");
    group.throughput(Throughput::Elements(1));
    for events in [4_000, 500_000] {
        group.bench_function(BenchmarkId::new("ladder pop and push", events), |b| {
            b.iter(hold::<Ladder<_>>(events));
        });
        group.bench_function(BenchmarkId::new("heap pop and push", events), |b| {
            b.iter(hold::<Heap<_>>(events));
        });
    }
    group.finish();
}

fn cells(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("cells");
    group.sample_size(20);
    for count in [32_000, 500_000] {
        // A tenth full; overlaps do not matter for the construction.
        let edge = (f64::from(count) * std::f64::consts::FRAC_PI_6 / 0.1).cbrt();
        let geometry = Geometry {
            size: DVec3::splat(edge),
            axes: [Axis::Periodic; 3],
            reach: 1.0,
            crowding: 1.0,
            radius: 0.5,
            radii: Vec::new(),
            planes: Vec::new(),
            deforming: None,
        };
        let mut random = random();
        let middle = DVec3::splat(0.5 * edge);
        let positions: Vec<DVec3> = (0..count).map(|_| middle + vector(&mut random, 0.5 * edge)).collect();
        group.throughput(Throughput::Elements(u64::from(count as u32)));
        group.bench_function(BenchmarkId::new("build", count), |b| {
            b.iter(|| Cells::new(black_box(&geometry), black_box(&positions)));
        });
    }
    group.finish();
}

criterion_group!(kernels, contact_times, impacts, wall_times, calendars, cells);
criterion_main!(kernels);
