//! Collisions per second of whole scenes, through the public interfaces: scene text, scene, simulation.
//!
//! `cargo bench --bench scenes`; `-- fluid` selects a scene. An element is a collision. `haff bench` measures
//! the same scenes at any size and density. `-- observing` measures the times of a frame, a row of
//! observables and the search for overlaps; an element is a particle, and `RAYON_NUM_THREADS` is the number
//! of threads.

#[path = "../crates/cli/commands/bench/scenes.rs"]
#[allow(dead_code)]
mod scenes;

use std::{hint::black_box, time::Duration};

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use haff_engine::{Silent, Simulation, Until};

/// Particles: all of them fit in the second-level cache.
const PARTICLES: u64 = 4000;
/// Collisions of an iteration.
const STRETCH: u64 = 4000;
/// Size ratio 10 requires a thousand small grains for each large one, and its collisions take more time.
const MIXTURE: &str = "mixture";

/// Particles of the observed system.
const OBSERVED: u64 = 32_000;

/// The scene after twenty collisions a particle.
fn melted(name: &str, particles: u64, phi: f64) -> Simulation {
    let standard = scenes::find(name).expect("a standard scene");
    let text = standard.scene(particles, phi, 1, u64::MAX >> 1);
    let scene = haff_scene::parse(name, &text, &[], &haff_scene::NoStates).expect("a valid scene");
    let mut simulation = Simulation::new(scene.system, scene.options).expect("an engine for it");
    let per_particle = if name == MIXTURE { 1 } else { 10 };
    advance(&mut simulation, per_particle * particles);
    simulation
}

fn advance(simulation: &mut Simulation, collisions: u64) {
    let goal = simulation.counters().collisions + collisions;
    simulation
        .advance(Until { collisions: goal, ..Until::default() }, &mut Silent)
        .expect("the run continues");
}

fn whole_scenes(criterion: &mut Criterion) {
    for standard in &scenes::STANDARD {
        let mut group = criterion.benchmark_group(standard.name);
        let stretch = if standard.name == MIXTURE { STRETCH / 40 } else { STRETCH };
        group
            .throughput(Throughput::Elements(stretch))
            .sample_size(20)
            .measurement_time(Duration::from_secs(4));
        let fractions: &[f64] =
            if standard.name == "fluid" { &[0.01, 0.1, 0.3, 0.49] } else { &[standard.phi] };
        for &phi in fractions {
            let mut simulation = None;
            group.bench_function(BenchmarkId::new("phi", phi), |b| {
                // Melted on demand: a filter on the command line skips it.
                let simulation = simulation.get_or_insert_with(|| melted(standard.name, PARTICLES, phi));
                b.iter(|| advance(simulation, stretch));
            });
        }
        group.finish();
    }
}

fn observing(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("observing");
    group.throughput(Throughput::Elements(OBSERVED));
    for phi in [0.05, 0.49] {
        let mut melted_gas = None;
        let mut observe = |what: &str, look: fn(&mut Simulation)| {
            group.bench_function(BenchmarkId::new(what, phi), |b| {
                let simulation = melted_gas.get_or_insert_with(|| melted("fluid", OBSERVED, phi));
                b.iter(|| look(simulation));
            });
        };
        observe("overlaps", |simulation| {
            black_box(simulation.measure_overlap().is_ok());
        });
        observe("observables", |simulation| {
            black_box(simulation.sample());
        });
        observe("frame", |simulation| {
            black_box(simulation.frame());
        });
    }
    group.finish();
}

criterion_group!(benches, whole_scenes, observing);
criterion_main!(benches);
