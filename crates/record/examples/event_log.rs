//! Cost of an event log: made-up events of a gas of 32,000 particles go to a recorder at full speed, or at a
//! given rate. Prints the time, the part of it spent waiting, the processor time of all threads and the size.
//!
//! ```sh
//! cargo run --release -p haff-record --example event_log -- FILE ROWS [MILLIONS_PER_SECOND [COLUMNS [none]]]
//! ```
//!
//! A rate of 0: full speed. COLUMNS: `all`, or names separated by commas; `none`: uncompressed.

use std::{
    env, fs,
    time::{Duration, Instant},
};

use glam::DVec3;
use haff_engine::{Boundary, EventColumn, EventKind, EventRecord, SceneFeatures};
use haff_record::{Header, Recorder};
use haff_testing::Random;

const BATCH: usize = 1 << 13;
const PARTICLES: u32 = 32_000;

/// Elastic collisions of unit spheres: approach speeds of the Rayleigh distribution, normals on the sphere.
fn events(count: usize) -> Vec<EventRecord> {
    let mut random = Random(1);
    let box_size = 70.0;
    let mut time = 0.0;
    (0..count)
        .map(|_| {
            time -= random.uniform(0.0, 1.0).ln() * 1e-5;
            let (a, b) = (random.bits() as u32 % PARTICLES, random.bits() as u32 % PARTICLES);
            let speed = 2.0 * (-random.uniform(0.0, 1.0).ln()).sqrt();
            let (z, angle) =
                (2.0 * random.uniform(0.0, 1.0) - 1.0, std::f64::consts::TAU * random.uniform(0.0, 1.0));
            let rho = (1.0 - z * z).sqrt();
            EventRecord {
                time,
                kind: EventKind::Collision,
                i: a.min(b),
                j: a.max(b),
                approach_speed: speed,
                impulse: speed,
                energy_loss: 0.0,
                carnot_energy: speed * speed,
                normal: DVec3::new(rho * angle.cos(), rho * angle.sin(), z),
                position: box_size
                    * DVec3::new(
                        random.uniform(0.0, 1.0),
                        random.uniform(0.0, 1.0),
                        random.uniform(0.0, 1.0),
                    ),
                ..EventRecord::default()
            }
        })
        .collect()
}

fn processor_seconds() -> f64 {
    // utime and stime in ticks of 1/100 s, the 14th and 15th field.
    let text = fs::read_to_string("/proc/self/stat").unwrap_or_default();
    let fields: Vec<f64> = text.split_whitespace().skip(13).take(2).filter_map(|f| f.parse().ok()).collect();
    fields.iter().sum::<f64>() / 100.0
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = env::args().skip(1);
    let path = arguments.next().ok_or("FILE ROWS [MILLIONS_PER_SECOND]")?;
    let rows: usize = arguments.next().ok_or("FILE ROWS [MILLIONS_PER_SECOND]")?.parse()?;
    let rate = arguments.next().map_or(Ok(0.0), |rate| rate.parse::<f64>())? * 1e6;
    let columns = arguments.next().unwrap_or_else(|| "all".to_owned());
    let uncompressed = arguments.next().is_some_and(|word| word == "none");
    let columns: Vec<_> = EventColumn::ALL
        .into_iter()
        .filter(|column| columns == "all" || columns.split(',').any(|name| name == column.name()))
        .collect();
    let particles = PARTICLES as usize;
    let header = Header {
        earlier: String::new(),
        title: String::new(),
        scene_toml: String::new(),
        seed: 0,
        version: String::new(),
        git_revision: String::new(),
        schema: haff_record::SCHEMA,
        trajectory_version: 0,
        dimension: 3,
        box_size: DVec3::splat(70.0),
        box_origin: DVec3::ZERO,
        boundary: [Boundary::Periodic; 3],
        conserved_momentum: [true; 3],
        species: vec![0; particles],
        inertia: vec![0.4; particles],
        species_names: vec!["grain".to_owned()],
        mass: vec![1.0; particles],
        radius: vec![0.5; particles],
        wall_names: Vec::new(),
        pistons: Vec::new(),
        frames: false,
        observables: false,
        used: particles,
        meshes: Vec::new(),
        events: columns,
        compressed: !uncompressed,
        present: SceneFeatures {
            springs: false,
            volume: true,
            angular_momentum: false,
            ..SceneFeatures::all()
        },
        measure: haff_engine::Measure::default(),
    };
    // The same rows repeatedly: longer than deflate's window, so that it cannot use the repetition.
    let made = events(64 * BATCH);
    let recorder = Recorder::create(&path, header, true)?;
    let (started, processor) = (Instant::now(), processor_seconds());
    let mut waited = Duration::ZERO;
    let mut longest = Duration::ZERO;
    let mut done = 0;
    while done < rows {
        let from = done % made.len();
        let mut batch = recorder.event_buffer();
        batch.extend_from_slice(&made[from..from + BATCH]);
        if rate > 0.0 {
            // A busy loop, as if a simulation were running.
            while started.elapsed().as_secs_f64() - waited.as_secs_f64() < (done + BATCH) as f64 / rate {
                std::hint::spin_loop();
            }
        }
        let handed = Instant::now();
        recorder.events(batch)?;
        waited += handed.elapsed();
        longest = longest.max(handed.elapsed());
        done += BATCH;
    }
    let producing = started.elapsed();
    recorder.flush()?;
    drop(recorder);
    let total = started.elapsed();
    let size = fs::metadata(&path)?.len();
    println!(
        "{:.3} M rows/s to the last call, {:.3} to the end; waited {:.3} of {:.3} s, at most {:.0} ms; processor {:.2} s; \
         {:.1} bytes a row",
        done as f64 / producing.as_secs_f64() / 1e6,
        done as f64 / total.as_secs_f64() / 1e6,
        waited.as_secs_f64(),
        producing.as_secs_f64(),
        longest.as_secs_f64() * 1e3,
        processor_seconds() - processor,
        size as f64 / done as f64
    );
    fs::remove_file(&path)?;
    Ok(())
}
