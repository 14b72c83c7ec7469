//! Writers that are killed, or whose disk is full, leave files that open, are correct, and can be continued.
#![cfg(unix)]

// Not in the suite: a child keeps the locks of files that this process has opened.
#[path = "suite/common/mod.rs"]
mod common;

use std::{
    env, fs,
    io::{BufRead, BufReader, Read, Write},
    path::Path,
    process::{Command, Stdio},
    sync::{Mutex, PoisonError},
    thread,
    time::Duration,
};

use haff_record::{RecordError, Recorder, info};
use hdf5::File;

use common::{checkpoint, event, events, frame, header, number, sample};

/// Set in the process that writes: the path of its file.
const CHILD: &str = "HAFF_RECORD_TEST_FILE";
/// Its number of particles.
const PARTICLES: &str = "HAFF_RECORD_TEST_PARTICLES";
const EVENTS_PER_ROW: u64 = 700;
/// HDF5 leaves its files open to child processes, which then hold their locks: one test at a time.
static ALONE: Mutex<()> = Mutex::new(());

/// Records row `k` of the synthetic run.
fn record(recorder: &Recorder, particles: usize, k: u64) -> Result<(), RecordError> {
    recorder.frame(frame(k, particles))?;
    recorder.sample(sample(k))?;
    recorder.events(events(k * EVENTS_PER_ROW, (k + 1) * EVENTS_PER_ROW))?;
    if k % 5 == 4 { recorder.checkpoint(checkpoint(k + 1, particles)) } else { Ok(()) }
}

/// Writes rows until it is killed or fails, with a pause after each, and prints the number of flushed rows.
fn write(path: &Path, particles: usize, pause: Duration) -> Result<(), RecordError> {
    let recorder = Recorder::create(path, header(particles), false)?;
    recorder.checkpoint(checkpoint(0, particles))?;
    for k in 0.. {
        record(&recorder, particles, k)?;
        if k % 5 == 4 {
            recorder.flush()?;
            println!("flushed {}", k + 1);
        }
        thread::sleep(pause);
    }
    Ok(())
}

fn child() -> Option<(std::path::PathBuf, usize)> {
    let path = env::var_os(CHILD)?;
    let particles = env::var(PARTICLES).ok()?.parse().ok()?;
    Some((path.into(), particles))
}

/// Starts this test program again, to run one test as a child.
fn spawn(test: &str, path: &Path, particles: usize, shell: Option<&str>) -> std::process::Child {
    let program = env::current_exe().expect("the test program");
    let mut command = match shell {
        None => Command::new(program),
        Some(limits) => {
            let mut command = Command::new("sh");
            command.arg("-c").arg(format!("{limits}; exec \"$0\" \"$@\"")).arg(program);
            command
        }
    };
    command.args([test, "--exact", "--nocapture"]).env(CHILD, path).env(PARTICLES, particles.to_string());
    command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().expect("the child starts")
}

/// The largest number of flushed rows that the child has printed.
fn flushed(output: impl std::io::Read) -> u64 {
    let lines = BufReader::new(output).lines().map_while(Result::ok);
    lines.filter_map(|line| line.strip_prefix("flushed ")?.parse().ok()).max().unwrap_or(0)
}

/// Checks every frame and sample in a file, and that there are at least `at_least` of them. Returns the
/// number of frames.
fn check(path: &Path, particles: usize, at_least: u64) -> u64 {
    let file = File::open(path).expect("the file opens");
    let all = "particles/all";
    // Rows whose time is NaN do not count.
    let clock = |name: &str| -> Vec<f64> {
        let mut times = file.dataset(name).expect(name).read_raw::<f64>().expect(name);
        times.truncate(times.iter().rposition(|time| !time.is_nan()).map_or(0, |last| last + 1));
        times
    };
    let times = clock(&format!("{all}/position/time"));
    let frames = times.len() as u64;
    assert!(frames >= at_least, "{frames} frames; {at_least} had been flushed");
    for k in 0..frames {
        let expected = frame(k, particles);
        let select = ndarray::s![k as usize, .., ..];
        let read = |name: &str| -> Vec<f64> {
            let dataset = file.dataset(&format!("{all}/{name}/value")).expect(name);
            dataset.read_slice_2d::<f64, _>(select).expect("a frame").into_raw_vec_and_offset().0
        };
        let flat =
            |vectors: &[glam::DVec3]| vectors.iter().flat_map(glam::DVec3::to_array).collect::<Vec<_>>();
        assert!(read("position") == flat(&expected.position), "positions of frame {k} of {frames}");
        assert!(read("velocity") == flat(&expected.velocity), "velocities of frame {k} of {frames}");
        let images = file.dataset(&format!("{all}/image/value")).expect("images");
        let images = images.read_slice_2d::<i32, _>(select).expect("a frame").into_raw_vec_and_offset().0;
        assert!(images == expected.image.as_flattened(), "images of frame {k} of {frames}");
    }
    assert_eq!(times, (0..frames).map(|k| frame(k, 0).time).collect::<Vec<_>>());
    let samples = clock("observables/momentum/time").len();
    assert!(samples as u64 >= at_least, "{samples} samples; {at_least} had been flushed");
    let kinetic: Vec<f64> =
        file.dataset("observables/kinetic_energy/value").expect("energies").read_raw().expect("energies");
    assert!(kinetic.len() >= samples, "{} energies for {samples} samples", kinetic.len());
    for (k, kinetic) in kinetic[..samples].iter().enumerate() {
        assert_eq!(*kinetic, sample(k as u64).ledger.kinetic, "sample {k}");
    }
    let column = |name: &str| -> Vec<f64> {
        file.dataset(&format!("events/{name}")).expect(name).read_raw().expect("a column")
    };
    let (times, impulses) = (clock("events/time"), column("impulse"));
    for (k, (time, impulse)) in times.iter().zip(&impulses).enumerate() {
        assert_eq!((*time, *impulse), (event(k as u64).time, event(k as u64).impulse), "event {k}");
    }
    frames
}

/// Resumes a file, checks the row from which it continues, and finishes it.
fn resume(path: &Path, particles: usize, flushed: u64) {
    let (recorder, resumed) = Recorder::append(path).expect("the file is resumed");
    let rows = resumed.frames;
    assert!(
        rows >= flushed / 5 * 5 && rows.is_multiple_of(5),
        "resumed at {rows}; {flushed} had been flushed"
    );
    assert_eq!(resumed.checkpoint, checkpoint(rows, particles));
    assert_eq!((resumed.samples, resumed.event_rows), (rows, rows * EVENTS_PER_ROW));
    for k in rows..rows + 3 {
        record(&recorder, particles, k).expect("a row");
    }
    recorder.finish("{}", true).expect("a finished file");
    assert_eq!(check(path, particles, rows + 3), rows + 3);
    let found = info(path).expect("the file is read");
    assert_eq!(found.event_rows, Some((rows + 3) * EVENTS_PER_ROW));
    let file = File::open(path).expect("the file opens");
    let times: Vec<f64> = file.dataset("events/time").expect("times").read_raw().expect("times");
    let expected = (0..(rows + 3) * EVENTS_PER_ROW).map(|k| event(k).time);
    assert!(times.iter().copied().eq(expected), "event times after the resume");
}

#[test]
fn a_killed_writer_leaves_a_file_that_is_readable_and_resumable() {
    if let Some((path, particles)) = child() {
        // Forty checkpoints, each with its flushes, a second: far more than in any run.
        write(&path, particles, Duration::from_millis(5)).expect("the child is killed before it fails");
        return;
    }
    kill_writers(20);
}

#[test]
#[ignore = "long: scripts/test all"]
fn many_killed_writers_leave_files_that_are_readable_and_resumable() {
    kill_writers(60);
}

/// `HAFF_RECORD_KILLS` sets another number.
fn kill_writers(kills: u64) {
    let _alone = ALONE.lock().unwrap_or_else(PoisonError::into_inner);
    let directory = tempfile::tempdir().expect("a directory for the test");
    let kills = env::var("HAFF_RECORD_KILLS").ok().and_then(|count| count.parse().ok()).unwrap_or(kills);
    let (mut most, mut too_early) = (0, 0);
    for kill in 0.. {
        if kill >= kills && most > 10 && too_early < kill / 2 {
            break;
        }
        assert!(kill < 20 * kills, "{too_early} of {kill} were killed too early, at most {most} frames");
        // Small frames that share chunks, and large ones with their own.
        let particles = if kill % 2 == 0 { 60 } else { 3000 };
        let path = directory.path().join(format!("{kill}.h5"));
        let mut child =
            spawn("a_killed_writer_leaves_a_file_that_is_readable_and_resumable", &path, particles, None);
        let mut output = BufReader::new(child.stdout.take().expect("its output"));
        // After some flushes, however long they take; sometimes at the very start.
        let mut text = String::new();
        for _ in 0..(13.0 * number(kill, 2)) as usize {
            output.read_line(&mut text).expect("a line");
        }
        thread::sleep(Duration::from_secs_f64(0.03 * number(kill, 1)));
        child.kill().expect("the child is killed");
        output.read_to_string(&mut text).expect("the rest");
        let flushed = flushed(text.as_bytes());
        child.wait().expect("the child ends");
        if !path.exists() {
            // Killed before the file was created: then there is no file at its path.
            assert_eq!(flushed, 0);
            too_early += 1;
            continue;
        }
        most = most.max(check(&path, particles, flushed));
        assert!(info(&path).expect("the file is read").resumable);
        resume(&path, particles, flushed);
        fs::remove_file(&path).expect("the file is removed");
    }
    let _ = writeln!(
        std::io::stderr(),
        "{kills} kills, {too_early} before the file existed, up to {most} frames"
    );
}

#[test]
#[cfg(target_os = "linux")]
fn a_full_disk_is_an_error_and_flushed_rows_stay() {
    if let Some((path, particles)) = child() {
        let error = write(&path, particles, Duration::ZERO).expect_err("the limit is reached");
        println!("error {error}");
        assert!(matches!(error, RecordError::Full { .. }), "{error:?}");
        return;
    }
    let _alone = ALONE.lock().unwrap_or_else(PoisonError::into_inner);
    let directory = tempfile::tempdir().expect("a directory for the test");
    // Limits in blocks of 512 bytes; the signal is ignored, so that the write fails like one to a full disk.
    for (k, blocks) in [100, 2000, 4001, 7001, 10_007, 20_011].into_iter().enumerate() {
        for particles in [60, 3000] {
            let path = directory.path().join(format!("{k}-{particles}.h5"));
            let limits = format!("trap '' XFSZ; ulimit -f {blocks}");
            let child =
                spawn("a_full_disk_is_an_error_and_flushed_rows_stay", &path, particles, Some(&limits));
            let output = child.wait_with_output().expect("the child ends");
            let text = String::from_utf8_lossy(&output.stdout);
            let errors = String::from_utf8_lossy(&output.stderr);
            assert!(output.status.success(), "{blocks} blocks, {particles} particles: {text}\n{errors}");
            assert!(
                text.contains("error ") && text.contains("the limit on the size of files is reached"),
                "{text}"
            );
            assert!(!errors.contains("HDF5"), "the library's own messages: {errors}");
            let flushed = flushed(&*output.stdout);
            if blocks > 7000 {
                assert!(flushed > 0, "{blocks} blocks, {particles} particles: nothing was flushed");
            }
            if flushed > 0 {
                check(&path, particles, flushed);
                resume(&path, particles, flushed);
            }
        }
    }
}
