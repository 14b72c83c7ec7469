//! Speed of the writer thread: `cargo run --release -p haff-record --example writer [DIRECTORY]`.

#[path = "../tests/suite/common/mod.rs"]
mod common;

use std::{env, error::Error, fs, path::PathBuf, time::Instant};

use common::{checkpoint, events, frame, header, sample};
use haff_record::{Header, Recorder};

fn main() -> Result<(), Box<dyn Error>> {
    let directory = env::args_os().nth(1).map_or_else(env::temp_dir, PathBuf::from);
    let path = directory.join(format!("haff-throughput-{}.h5", std::process::id()));
    let particles = 32_000;

    for dimension in [3, 2] {
        let frames: Vec<_> = (0..100)
            .map(|k| {
                let mut frame = frame(k, particles);
                // Images as in a run: small numbers.
                frame.image.iter_mut().for_each(|image| *image = image.map(|n| n % 3));
                if dimension == 2 {
                    frame.position.iter_mut().chain(&mut frame.velocity).for_each(|vector| vector.z = 0.0);
                }
                frame
            })
            .collect();
        let recorder = Recorder::create(&path, Header { dimension, ..header(particles) }, true)?;
        let started = Instant::now();
        let count = frames.len() as f64;
        for frame in frames {
            recorder.frame(frame)?;
        }
        recorder.flush()?;
        let seconds = started.elapsed().as_secs_f64();
        drop(recorder);
        let bytes = fs::metadata(&path)?.len() as f64;
        println!(
            "frames, N = {particles}, {dimension}D: {:.0} frames/s, {:.0} MB/s passed, {:.1} MB/frame in the file",
            count / seconds,
            count * 60e-6 * particles as f64 / seconds,
            bytes / count / 1e6
        );
    }

    let rows = 4_000_000;
    let batches: Vec<_> = (0..rows).step_by(8192).map(|from| events(from, (from + 8192).min(rows))).collect();
    let recorder = Recorder::create(&path, header(particles), true)?;
    let started = Instant::now();
    for batch in batches {
        recorder.events(batch)?;
    }
    recorder.flush()?;
    let seconds = started.elapsed().as_secs_f64();
    drop(recorder);
    let bytes = fs::metadata(&path)?.len() as f64;
    println!(
        "events: {:.2} M rows/s, {:.0} bytes/row in the file",
        rows as f64 / seconds / 1e6,
        bytes / rows as f64
    );

    let recorder = Recorder::create(&path, header(particles), true)?;
    let rows = 200_000;
    let started = Instant::now();
    for k in 0..rows {
        recorder.sample(sample(k))?;
    }
    recorder.flush()?;
    println!("samples: {:.3} M rows/s", rows as f64 / started.elapsed().as_secs_f64() / 1e6);

    let states: Vec<_> = (0..50).map(|k| checkpoint(k, particles)).collect();
    let (started, count) = (Instant::now(), states.len() as f64);
    for state in states {
        recorder.checkpoint(state)?;
    }
    recorder.flush()?;
    println!("checkpoints, N = {particles}: {:.2} ms each", started.elapsed().as_secs_f64() / count * 1e3);
    drop(recorder);
    fs::remove_file(&path)?;
    Ok(())
}
