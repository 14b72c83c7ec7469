//! Damaged files give errors: no panic, no abort, no hang, and less than 1 GiB of memory.
#![cfg(unix)]

// Not in the suite: a child keeps the locks of files that this process has opened.
#[path = "suite/common/mod.rs"]
mod common;

use std::{
    env,
    fmt::Debug,
    fs,
    io::{BufRead, BufReader, Read},
    path::{Path, PathBuf},
    process::{Command, Stdio},
    sync::{Arc, Mutex, PoisonError},
    thread,
    time::Duration,
};

use haff_record::{EVENT_CHUNK, RecordError, Recorder, info, last_state, resumable};
use hdf5::{Dataset, File, H5Type};

use common::{checkpoint, events, frame, header, number, sample};

/// Set in a child process: the folder of the files, and the range of seeds.
const CHILD: &str = "HAFF_RECORD_TEST_DAMAGE";
/// Files per child process.
const BATCH: u64 = 75;
/// Limit on the memory of a child [KiB], including its libraries and threads.
const MEMORY: u64 = 1 << 20;
/// A file that takes more processor time counts as a hang: most take a few milliseconds.
const TIMEOUT: Duration = Duration::from_secs(30);

/// The original files: name, particles, whether the run is complete. Frames of 1,500 particles are
/// compressed.
const WHOLE: [(&str, usize, bool); 3] =
    [("small.h5", 3, true), ("open.h5", 5, false), ("chunks.h5", 1500, false)];

fn write(path: &Path, particles: usize, complete: bool) -> Result<(), RecordError> {
    let recorder = Recorder::create(path, header(particles), false)?;
    recorder.checkpoint(checkpoint(0, particles))?;
    for k in 0..3 {
        recorder.frame(frame(k, particles))?;
        recorder.sample(sample(k))?;
        recorder.events(events(2000 * k, 2000 * (k + 1)))?;
    }
    recorder.events(events(6000, EVENT_CHUNK as u64 + 300))?;
    recorder.checkpoint(checkpoint(1, particles))?;
    recorder.frame(frame(3, particles))?;
    recorder.finish("{\"stopped\": \"signal\"}", complete)
}

/// Every dataset of a file.
fn datasets(file: &File) -> Vec<Dataset> {
    fn walk(group: &hdf5::Group, found: &mut Vec<Dataset>) {
        found.extend(group.datasets().unwrap_or_default());
        for inner in group.groups().unwrap_or_default() {
            walk(&inner, found);
        }
    }
    let mut found = Vec::new();
    walk(file, &mut found);
    found
}

/// A number below `bound`, as a function of a seed and of the choice.
fn choose(seed: u64, choice: u64, bound: usize) -> usize {
    ((number(seed, choice) * bound as f64) as usize).min(bound - 1)
}

/// Damages the bytes of a file.
fn damage_bytes(bytes: &mut Vec<u8>, seed: u64) {
    let length = bytes.len();
    match choose(seed, 1, 6) {
        0 => (0..=choose(seed, 2, 20) as u64)
            .for_each(|k| bytes[choose(seed, 10 + k, length)] = choose(seed, 50 + k, 256) as u8),
        // Most of the metadata is at the start.
        1 => (0..=choose(seed, 2, 8) as u64)
            .for_each(|k| bytes[choose(seed, 10 + k, length.min(20_000))] ^= 1 << choose(seed, 50 + k, 8)),
        2 => bytes.truncate(choose(seed, 2, length)),
        3 => {
            let start = choose(seed, 2, length);
            let end = (start + 1 + choose(seed, 3, 600)).min(length);
            let fill = [0, 0xFF, choose(seed, 4, 256) as u8][choose(seed, 5, 3)];
            bytes[start..end].fill(fill);
        }
        // Sizes, addresses and counts.
        4 => {
            let wrong = [0, 1, 1 << 20, 1 << 34, 1 << 40, 1 << 63, u64::MAX, length as u64];
            for k in 0..=choose(seed, 2, 4) as u64 {
                let offset = choose(seed, 10 + k, length.min(40_000) / 8) * 8;
                let value: u64 = wrong[choose(seed, 20 + k, wrong.len())];
                let size = [4, 8][choose(seed, 30 + k, 2)];
                bytes[offset..offset + size].copy_from_slice(&value.to_le_bytes()[..size]);
            }
        }
        _ => {
            let (from, to) = (choose(seed, 2, length), choose(seed, 3, length));
            let size = (1 + choose(seed, 4, 4096)).min(length - from.max(to));
            bytes.copy_within(from..from + size, to);
        }
    }
}

/// Replaces a dataset by one of another type and shape, without data.
fn replace<T: H5Type>(file: &File, name: &str, shape: &[usize]) -> hdf5::Result<()> {
    file.unlink(name)?;
    let growing = shape.iter().map(|&size| hdf5::Extent::resizable(size)).collect::<Vec<_>>();
    let chunk: Vec<usize> = shape.iter().map(|&size| size.clamp(1, 8)).collect();
    match shape.len() {
        0 => file.new_dataset::<T>().create(name)?,
        _ => file.new_dataset::<T>().chunk(chunk).shape(growing).create(name)?,
    };
    Ok(())
}

/// Changes the content of a file through HDF5, so that its metadata stays consistent.
fn damage_content(path: &Path, seed: u64) -> hdf5::Result<()> {
    let file = File::open_rw(path)?;
    let all = datasets(&file);
    let dataset = &all[choose(seed, 1, all.len())];
    let (name, shape) = (dataset.name(), dataset.get_shape()?);
    match choose(seed, 2, 7) {
        0 => file.unlink(&name),
        1 => replace::<f64>(&file, &name, &[1 << 34]),
        2 => replace::<u8>(&file, &name, &shape),
        3 => replace::<f64>(&file, &name, &[1 << 20, 1 << 14]),
        4 => replace::<hdf5::types::VarLenUnicode>(&file, &name, &shape),
        5 => {
            let mut wrong: Vec<usize> = shape;
            wrong
                .iter_mut()
                .enumerate()
                .for_each(|(k, size)| *size = choose(seed, 10 + k as u64, 40) * *size / 9);
            dataset.resize(wrong).or(Ok(()))
        }
        _ => {
            let values = vec![[f64::NAN, -1.0, 1e300, 0.0][choose(seed, 3, 4)]; dataset.size()];
            dataset.write_raw(&values).or(Ok(()))
        }
    }
}

/// Reads a file with all functions, and continues its run. Errors must name the file. What cannot be
/// continued is not changed.
fn read(path: &Path) {
    fn check<T: Debug>(path: &Path, result: &Result<T, RecordError>) {
        if let Err(error) = result {
            let (text, name) = (error.to_string(), path.file_name().unwrap_or_default().to_string_lossy());
            assert!(text.contains(&*name), "{name} is not named: {text}");
        }
    }
    check(path, &info(path));
    check(path, &last_state(path));
    check(path, &resumable(path));
    let before = fs::read(path).expect("the file is there");
    let continued = Recorder::append(path).map(|(_, resumed)| resumed);
    check(path, &continued);
    if let Err(error) = continued {
        assert!(before == fs::read(path).expect("the file is there"), "changed, then refused: {error}");
    }
}

/// In the child: damages and reads files one after the other, and prints the seed of each.
fn child(task: &str) {
    let words: Vec<&str> = task.split(' ').collect();
    let [folder, from, to] = words[..] else { panic!("{task}") };
    for seed in from.parse().expect("a number")..to.parse().expect("a number") {
        println!("damage {seed}");
        let whole = Path::new(folder).join(WHOLE[(seed % 3) as usize].0);
        let path = Path::new(folder).join(format!("damage-{seed}.h5"));
        if seed % 4 == 3 {
            fs::copy(&whole, &path).expect("a copy");
            let _ = damage_content(&path, seed);
        } else {
            let mut bytes = fs::read(&whole).expect("the whole file");
            damage_bytes(&mut bytes, seed);
            fs::write(&path, bytes).expect("a damaged file");
        }
        read(&path);
        let _ = fs::remove_file(&path);
    }
    println!("done");
}

/// Processor time that a process has used, which other processes do not change; zero where it is not known.
fn processor_time(process: u32) -> Duration {
    let stat = fs::read_to_string(format!("/proc/{process}/stat")).unwrap_or_default();
    let fields = stat.rsplit(')').next().unwrap_or_default().split_whitespace();
    // User and system time, in hundredths of a second.
    let ticks: u64 = fields.skip(11).take(2).filter_map(|field| field.parse::<u64>().ok()).sum();
    Duration::from_millis(10 * ticks)
}

/// Runs this test in a child process with limited memory. The error contains the last line it printed.
fn run(test: &str, task: &str) -> Result<(), String> {
    let program = env::current_exe().expect("the test program");
    let mut command = Command::new("sh");
    command.arg("-c").arg(format!("ulimit -v {MEMORY}; exec \"$0\" \"$@\"")).arg(program);
    command
        .args([test, "--exact", "--nocapture", "--test-threads=1"])
        .env(CHILD, task)
        .env("RUST_BACKTRACE", "0");
    let mut child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().expect("the child starts");
    // The last line that the child has printed, and the processor time that it had used.
    let process = child.id();
    let last_line = Arc::new(Mutex::new(("none".to_owned(), Duration::ZERO)));
    let lines = BufReader::new(child.stdout.take().expect("a pipe")).lines().map_while(Result::ok);
    let out = thread::spawn({
        let last_line = Arc::clone(&last_line);
        move || {
            for line in lines.filter(|line| line.starts_with("damage") || line == "done") {
                let used = processor_time(process);
                *last_line.lock().unwrap_or_else(PoisonError::into_inner) = (line, used);
            }
        }
    });
    let mut pipe = child.stderr.take().expect("a pipe");
    let err = thread::spawn(move || {
        let mut text = Vec::new();
        pipe.read_to_end(&mut text).map(|_| String::from_utf8_lossy(&text).into_owned())
    });
    let last = || last_line.lock().unwrap_or_else(PoisonError::into_inner).clone();
    let status = loop {
        match child.try_wait().expect("the child is ours") {
            Some(status) => break status,
            None if processor_time(process).saturating_sub(last().1) > TIMEOUT => {
                child.kill().expect("the child is ours");
                break child.wait().expect("the child is ours");
            }
            None => thread::sleep(Duration::from_millis(5)),
        }
    };
    out.join().expect("lines are read");
    let err = err.join().expect("errors are read").unwrap_or_default();
    let (line, _) = last();
    if status.success() && line == "done" {
        return Ok(());
    }
    Err(format!("{line}: {status}; {}", err.trim()))
}

#[test]
fn damaged_files_give_errors() {
    if let Ok(task) = env::var(CHILD) {
        return child(&task);
    }
    damage_files(80);
}

#[test]
#[ignore = "long: scripts/test all"]
fn many_damaged_files_give_errors() {
    damage_files(300);
}

/// `HAFF_MUTATIONS` sets another number of files, `HAFF_MUTATION` the first seed.
fn damage_files(count: u64) {
    let directory = tempfile::tempdir().expect("a directory for the test");
    for (name, particles, complete) in WHOLE {
        write(&directory.path().join(name), particles, complete).expect("a file");
    }
    let count = env::var("HAFF_MUTATIONS").ok().and_then(|text| text.parse().ok()).unwrap_or(count);
    let folder = directory.path().display();
    let mut failures = Vec::new();
    let mut from = env::var("HAFF_MUTATION").ok().and_then(|text| text.parse().ok()).unwrap_or(0);
    while from < count {
        let to = (from + BATCH).min(count);
        match run("damaged_files_give_errors", &format!("{folder} {from} {to}")) {
            Ok(()) => from = to,
            Err(failure) => {
                let last = failure.split(' ').nth(1).and_then(|text| text.trim_end_matches(':').parse().ok());
                from = last.map_or(to, |seed: u64| seed + 1);
                failures.push(failure);
            }
        }
    }
    assert!(failures.is_empty(), "{} of {count}:\n{}", failures.len(), failures.join("\n"));
}

/// One dataset at a time declares 2^34 rows, 128 GiB of numbers, and contains none. The error names it.
#[test]
fn shapes_without_data_are_refused_before_memory_is_allocated() {
    let enlarge = |path: &Path, name: &str| -> hdf5::Result<()> {
        let file = File::open_rw(path)?;
        let dataset = file.dataset(name)?;
        let mut shape = dataset.get_shape()?;
        shape[0] = 1 << 34;
        match dataset.dtype()?.size() {
            _ if name.ends_with("_names") && name.starts_with("parameters") => {
                file.unlink(name)?;
                file.new_dataset::<hdf5::types::VarLenUnicode>().shape(shape).create(name).map(drop)
            }
            1 => replace::<u8>(&file, name, &shape),
            4 => replace::<u32>(&file, name, &shape),
            8 => replace::<f64>(&file, name, &shape),
            _ => replace::<[f64; 12]>(&file, name, &shape),
        }
    };
    if let Ok(task) = env::var(CHILD) {
        let (path, whole) = (PathBuf::from(&task), PathBuf::from(&task).with_file_name("open.h5"));
        for name in [
            "particles/all/mass",
            "particles/all/species",
            "particles/all/radius",
            "particles/all/id",
            "particles/all/position/value",
            "particles/all/position/time",
            "particles/all/image/value",
            "particles/all/box/edges/value",
            "observables/kinetic_energy/value",
            "observables/kinetic_energy/time",
            "observables/momentum/value",
            "observables/species_temperature/value",
            "events/time",
            "events/i",
            "events/normal",
            "checkpoint/0/position",
            "checkpoint/1/anchor",
            "checkpoint/0/header",
            "checkpoint/0/scalars",
            "checkpoint/1/scalar_names",
            "checkpoint/0/resting",
            "parameters/species_names",
            "parameters/wall_names",
            "parameters/box_size",
        ] {
            println!("damage {name}");
            fs::copy(&whole, &path).expect("a copy");
            enlarge(&path, name).expect(name);
            let part = name.rsplit('/').find(|part| !["value", "time"].contains(part)).expect("a name");
            for error in
                [info(&path).map(|_| ()), resumable(&path).map(|_| ()), Recorder::append(&path).map(|_| ())]
            {
                let error = error.expect_err(name).to_string();
                assert!(error.contains(part) && error.contains("damaged.h5"), "{name}: {error}");
            }
            last_state(&path).expect_err(name);
        }
        println!("done");
        return;
    }
    let directory = tempfile::tempdir().expect("a directory for the test");
    write(&directory.path().join("open.h5"), 5, false).expect("a file");
    let path = directory.path().join("damaged.h5");
    let done = run("shapes_without_data_are_refused_before_memory_is_allocated", &path.display().to_string());
    done.unwrap_or_else(|failure| panic!("{failure}"));
}
