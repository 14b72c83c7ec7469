//! Sweeps: every combination is run once, each run equals a single run, and the next call runs missing
//! members.

use std::{collections::HashSet, fs, process::Stdio, thread, time::Duration};

use nix::{
    sys::signal::{Signal, kill},
    unistd::Pid,
};
use serde_json::Value;

use crate::common::{self, GAS, Haff};

const SHORT: &[&str] = &["--set", "run.until=2,3", "--set", "contact.restitution=0.8,0.95"];

fn sweep(haff: &Haff, more: &[&str]) -> Value {
    haff.report(&[&["sweep", "gas.toml"], SHORT, &["-o", "study"], more].concat())
}

fn manifest(haff: &Haff) -> Value {
    let text = fs::read_to_string(haff.path("study/manifest.json")).expect("a manifest");
    serde_json::from_str(&text).expect("the manifest is JSON")
}

fn rows(summary: &Value) -> &[Value] {
    summary["runs"].as_array().expect("rows")
}

fn hashes(summary: &Value) -> Vec<String> {
    rows(summary).iter().map(|row| row["state_hash"].as_str().expect("a hash").to_owned()).collect()
}

#[test]
fn each_member_equals_a_run_by_haff_run() {
    let haff = Haff::new();
    haff.write("gas.toml", GAS);
    let summary = sweep(&haff, &["--jobs", "2"]);
    assert_eq!((&summary["members"], &summary["complete"]), (&Value::from(4), &Value::from(4)));
    for row in rows(&summary) {
        let (until, e) = (&row["parameters"]["run.until"], &row["parameters"]["contact.restitution"]);
        let sets = [format!("run.until={until}"), format!("contact.restitution={e}")];
        let alone = haff.report(&[
            "run",
            "gas.toml",
            "-o",
            "alone.h5",
            "--overwrite",
            "--set",
            &sets[0],
            "--set",
            &sets[1],
        ]);
        let timed = ["wall_seconds", "collisions_per_second"];
        let totals: Vec<&str> = haff_engine::total_names().filter(|name| !timed.contains(name)).collect();
        for key in [&totals[..], &["state_hash", "seed", "stopped"]].concat() {
            assert!(!row[key].is_null(), "{key} is missing in {row}");
            assert_eq!(row[key], alone[key], "{key} of {row}");
        }
        assert!(timed.iter().all(|key| row[*key].as_f64().is_some_and(|number| number > 0.0)), "{row}");
        let file = format!("study/{}", row["file"].as_str().unwrap());
        let info: Value = serde_json::from_str(&haff.run(&["info", &file, "--json"]).1).unwrap();
        assert_eq!(info["finished"], true);
        for (name, _) in haff_engine::energies(&haff_engine::Ledger::default()) {
            let known = |value: &Value| value.is_null() || *value == alone[name];
            assert!(known(&info["last"][name]), "{name}: {} and {}", info["last"][name], alone[name]);
        }
    }
    assert_eq!(
        summary["events"],
        rows(&summary).iter().map(|row| row["events"].as_u64().unwrap()).sum::<u64>()
    );
    assert_eq!(summary["runs"], manifest(&haff)["runs"]);
}

#[test]
fn derived_seeds_are_distinct_and_independent_of_other_members() {
    let haff = Haff::new();
    haff.write("gas.toml", GAS);
    let list = |sets: &[&str]| -> Value {
        let arguments = [&["sweep", "gas.toml", "--list"], sets].concat();
        haff.report(&arguments)
    };
    let grid = list(&[
        "--set",
        "contact.restitution=0.8,0.9",
        "--set",
        "species.grain.count=300,400",
        "--seeds",
        "3",
    ]);
    let seeds: HashSet<u64> = rows(&grid).iter().map(|row| row["seed"].as_u64().unwrap()).collect();
    assert_eq!(seeds.len(), 12);
    let other =
        list(&["--set", "species.grain.count=400", "--set", "contact.restitution=0.9", "--seeds", "2"]);
    let find = |list: &Value, replica: u64| {
        let row = rows(list).iter().find(|row| {
            row["parameters"]["species.grain.count"] == 400
                && row["parameters"]["contact.restitution"] == 0.9
                && row["replica"] == replica
        });
        row.expect("the member")["seed"].clone()
    };
    assert_eq!((find(&grid, 0), find(&grid, 1)), (find(&other, 0), find(&other, 1)));
    // Nothing has been written.
    assert_eq!(fs::read_dir(haff.path(".")).unwrap().count(), 1);
}

#[test]
fn members_run_one_by_one_give_the_same_sweep_and_only_missing_ones_are_run() {
    let haff = Haff::new();
    haff.write("gas.toml", GAS);
    for index in ["2", "0"] {
        let arguments = [&["sweep", "gas.toml"], SHORT, &["-o", "study", "--index", index]].concat();
        let row = haff.report(&arguments);
        assert_eq!((row["index"].to_string().as_str(), &row["status"]), (index, &Value::from("complete")));
        for key in common::PROMISED {
            assert!(!row[key].is_null(), "{key} in {row}");
        }
    }
    let listed = sweep(&haff, &["--list"]);
    let words: Vec<_> = rows(&listed).iter().map(|row| row["status"].as_str().unwrap()).collect();
    assert_eq!(words, ["complete", "missing", "complete", "missing"]);

    let modified =
        |k: usize| fs::metadata(haff.path(&format!("study/run-000{k}.h5"))).unwrap().modified().unwrap();
    let before = [modified(0), modified(2)];
    let whole = sweep(&haff, &[]);
    assert_eq!(whole["complete"], 4);
    assert_eq!([modified(0), modified(2)], before, "complete files are not changed");

    // A removed file is made again, and so is a manifest.
    fs::remove_file(haff.path("study/run-0001.h5")).unwrap();
    assert_eq!(hashes(&sweep(&haff, &["--jobs", "1"])), hashes(&whole));
    fs::remove_file(haff.path("study/manifest.json")).unwrap();
    assert_eq!(hashes(&sweep(&haff, &[])), hashes(&whole));
    assert_eq!([modified(0), modified(2)], before, "complete files are not changed");
}

/// Starts a sweep of long runs, and ends it by a signal during the runs; status 0 if it has ended before.
fn interrupted(haff: &Haff, arguments: &[&str], signal: Signal) -> Option<i32> {
    let mut child = haff.command(arguments).stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
    if haff.wait_for_checkpoint(&mut child, "study/run-0001.h5", 0.0).is_none() {
        kill(Pid::from_raw(child.id() as i32), signal).unwrap();
    }
    child.wait().unwrap().code()
}

#[test]
#[ignore = "long: scripts/test all"]
fn a_stopped_or_killed_sweep_continues_from_its_checkpoints() {
    let haff = Haff::new();
    haff.write("gas.toml", GAS);
    let long = &[
        "sweep",
        "gas.toml",
        "--set",
        "run.until=800",
        "--set",
        "contact.restitution=0.999,1.0",
        "--seeds",
        "2",
        "--set",
        "output.checkpoint=10",
        "--set",
        "output.frames=20",
        "-o",
    ][..];
    let whole = haff.report(&[long, &["whole"]].concat());
    for (signal, status) in [(Signal::SIGINT, Some(130)), (Signal::SIGKILL, None)] {
        let arguments = [long, &["study", "--jobs", "2"]].concat();
        // On a busy machine the sweep may end before it is interrupted: then it is made again.
        let found = loop {
            match interrupted(&haff, &arguments, signal) {
                Some(0) => fs::remove_dir_all(haff.path("study")).unwrap(),
                status => break status,
            }
        };
        assert_eq!(found, status);
        let before = haff.report(&[long, &["study", "--list"]].concat());
        assert!(before["unfinished"].as_u64() > Some(0), "{before}");
        assert_eq!(before["failed"], 0);
        let after = haff.report(&arguments);
        assert_eq!(hashes(&after), hashes(&whole), "{signal}");
        let from: Vec<f64> = rows(&after).iter().filter_map(|row| row["resumed_from"].as_f64()).collect();
        assert_eq!(from.len() as u64, before["unfinished"].as_u64().unwrap(), "{after}");
        assert!(from.iter().any(|&time| time > 0.0), "{after}");
        fs::remove_dir_all(haff.path("study")).unwrap();
    }
}

#[test]
fn failed_member_does_not_stop_the_others() {
    let haff = Haff::new();
    haff.write("gas.toml", GAS);
    let arguments = [
        "sweep",
        "gas.toml",
        "--set",
        "run.until=1",
        "--set",
        "contact.restitution=0.9,1.2,0.8",
        "-o",
        "study",
    ];
    let (status, out, err) = haff.run(&[&arguments[..], &["--json"]].concat());
    assert_eq!(status, 2, "{err}");
    assert!(err.contains("run 1") && err.contains("restitution=1.2: must be in [0, 1]"), "{err}");
    let summary: Value = serde_json::from_str(&out).unwrap();
    assert_eq!((&summary["complete"], &summary["failed"]), (&Value::from(2), &Value::from(1)));

    // A foreign file at a member's path is neither read as a run nor replaced.
    fs::remove_file(haff.path("study/run-0002.h5")).unwrap();
    haff.write("study/run-0002.h5", "precious");
    let (status, _, err) = haff.run(&arguments);
    assert_eq!(status, 4, "the worst of 2 and 4: {err}");
    assert!(err.contains("run-0002.h5 is not an HDF5 file") && err.contains("run 1"), "{err}");
    assert_eq!(fs::read_to_string(haff.path("study/run-0002.h5")).unwrap(), "precious");
    fs::copy(haff.path("study/run-0000.h5"), haff.path("study/run-0002.h5")).unwrap();
    let (status, _, err) = haff.run(&arguments);
    assert!(status == 4 && err.contains("run-0002.h5 holds another run"), "{status}: {err}");
}

#[test]
fn invalid_sweeps_are_refused_before_any_file_is_written() {
    let haff = Haff::new();
    haff.write("gas.toml", GAS);
    for (arguments, status, why) in [
        (&["--set", "contact.restitutoin=0.8,0.9"][..], 2, "did you mean `restitution`"),
        (&["--set", "contact.restitution="], 2, "a value is missing"),
        (&["--set", "contact.restitution=0.8,,0.9"], 2, "a value is missing"),
        (&["--set", "contact.restitution"], 2, "must read KEY=V1,V2"),
        (&["--set", "contact.restitution=1.5,2"], 2, "must be in [0, 1]"),
        (&["--set", "contact.restitution=0.8,0.8"], 2, "is given twice"),
        (&["--set", "seed=1", "--set", "seed=2"], 2, "given twice"),
        (&["--set", "seed=1,2", "--seeds", "2"], 2, "either --seeds N or"),
        (
            &["--set", "contact.restitution=0.8,0.9", "--index", "2"],
            2,
            "the sweep has 2 runs, counted from 0",
        ),
        (&["--set", "contact.restitution=0.8,0.9", "--index", "-1"], 2, "--index"),
        (
            &["--set", "run.until=lin(1,2,1000)", "--set", "seed=lin(0,9999,10000)"],
            2,
            "more than 1000000 runs",
        ),
        (&["--seeds", "0"], 2, "--seeds"),
        (&[], 2, "nothing to vary"),
    ] {
        let all = [&["sweep", "gas.toml", "-o", "study"], arguments].concat();
        let (found, out, err) = haff.run(&all);
        assert_eq!(found, status, "{arguments:?}: {err}");
        assert!(err.contains(why) && err.starts_with("error: ") && out.is_empty(), "{arguments:?}: {err}");
        assert!(!haff.path("study").exists(), "{arguments:?}");
    }
    assert_eq!(haff.run(&["sweep", "none.toml", "--seeds", "2", "-o", "study"]).0, 4);
    assert_eq!(haff.run(&["sweep", "gas.toml", "--seeds", "2"]).0, 2, "no folder");
}

#[test]
fn a_folder_with_another_sweep_is_refused_and_not_changed() {
    let haff = Haff::new();
    let gas = GAS.replace("[output]", "wall_time = \"2h\"\n[output]");
    haff.write("gas.toml", &gas);
    sweep(&haff, &[]);
    let before = fs::read(haff.path("study/manifest.json")).unwrap();
    let other_scene = gas.replace("seed = 3", "seed = 4");
    haff.write("other.toml", &other_scene);
    haff.write("comment.toml", &format!("# Only a comment more\n{gas}"));
    for (scene, more, why) in [
        (
            "gas.toml",
            &["--set", "run.until=2,4", "--set", "contact.restitution=0.8,0.95"][..],
            "--set run.until=2,3",
        ),
        ("gas.toml", &[SHORT, &["--seeds", "2"]].concat(), "no --seeds"),
        ("other.toml", SHORT, "its scene is not that of other.toml"),
    ] {
        let (status, _, err) = haff.run(&[&["sweep", scene, "-o", "study"], more].concat());
        assert!(
            status == 4 && err.contains("belongs to another sweep") && err.contains(why),
            "{status}: {err}"
        );
    }
    assert_eq!(haff.run(&[&["sweep", "comment.toml", "-q", "-o", "study"], SHORT].concat()).0, 0);
    // Values in another notation are the same values, in the manifest, the scene and the files.
    let respelled = gas.replace("temperature = 1.0", "temperature = 1").replace("\"2h\"", "7200");
    assert!(respelled.contains("temperature = 1\n") && respelled.contains("wall_time = 7200"));
    haff.write("respelled.toml", &respelled);
    let spelled = ["--set", "run.until=2.0,3e0", "--set", "contact.restitution=0.80,9.5e-1"];
    for one in [&[][..], &["--index", "3"]] {
        let arguments = [&["sweep", "respelled.toml", "-o", "study", "--json"][..], &spelled, one].concat();
        let (status, out, err) = haff.run(&arguments);
        assert_eq!(status, 0, "{err}");
        let summary: Value = serde_json::from_str(&out).unwrap();
        assert!(summary["complete"] == 4 && err.contains("4 since before") || summary["index"] == 3, "{err}");
    }
    fs::write(haff.path("study/manifest.json"), "{").unwrap();
    let (status, _, err) = haff.run(&[&["sweep", "gas.toml", "-o", "study"], SHORT].concat());
    assert!(status == 4 && err.contains("is not the manifest of a sweep"), "{err}");
    let text = String::from_utf8(before).unwrap();
    let version =
        text.split("\"trajectory_version\": ").nth(1).and_then(|rest| rest.split(',').next()).unwrap();
    let newer = text.replace(&format!("\"trajectory_version\": {version}"), "\"trajectory_version\": 999");
    fs::write(haff.path("study/manifest.json"), newer).unwrap();
    let (status, _, err) = haff.run(&[&["sweep", "gas.toml", "-o", "study"], SHORT].concat());
    assert!(status == 4 && err.contains("begun with trajectory version 999"), "{err}");
}

#[test]
fn the_number_of_simultaneous_runs_is_limited_to_the_cores() {
    let haff = Haff::new();
    haff.write("gas.toml", GAS);
    let (status, _, err) = haff.run(&[
        "sweep",
        "gas.toml",
        "--set",
        "run.until=1,2",
        "-o",
        "study",
        "--jobs",
        "1024",
        "--threads",
        "2",
    ]);
    assert!(status == 0 && err.contains("runs at a time") && err.contains("cores"), "{err}");
    assert!(err.contains("2 of 2 runs are complete"), "{err}");
}

/// A child process that is killed if its test fails.
struct Sweeping(std::process::Child);

impl Sweeping {
    /// Starts it, and waits until it holds the lock of this name.
    fn start(haff: &Haff, arguments: &[&str], lock: &str) -> Self {
        let mut child = haff.command(arguments).stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
        let process = format!("{}\n", child.id());
        while fs::read_to_string(haff.path(lock)).ok().as_ref() != Some(&process) {
            assert!(child.try_wait().unwrap().is_none(), "{lock} is not taken");
            thread::sleep(Duration::from_millis(5));
        }
        Self(child)
    }

    fn stop(mut self) -> Option<i32> {
        kill(Pid::from_raw(self.0.id() as i32), Signal::SIGINT).unwrap();
        self.0.wait().unwrap().code()
    }
}

impl Drop for Sweeping {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

#[test]
fn a_second_sweep_in_the_same_folder_is_refused_and_the_first_continues() {
    let haff = Haff::new();
    haff.write("gas.toml", GAS);
    let study = ["sweep", "gas.toml", "--set", "run.until=4000,4001", "-o", "study"];
    let first = Sweeping::start(&haff, &study, "study/.sweep.lock");
    while !haff.path("study/run-0000.h5").exists() {
        thread::sleep(Duration::from_millis(5));
    }
    let (status, out, err) = haff.run(&study);
    let process = first.0.id();
    assert_eq!((status, out.as_str()), (4, ""), "{err}");
    let message = format!("error: study: another process ({process}) runs a sweep in this folder: wait");
    assert!(err.starts_with(&message) && err.lines().count() == 1, "{err}");
    let listed = haff.report(&[&study[..], &["--list"]].concat());
    assert!(rows(&listed).iter().any(|row| row["status"] == "running"), "{listed}");
    assert_eq!(first.stop(), Some(130), "the first one continues until it is stopped");
    let rows = manifest(&haff)["runs"].as_array().unwrap().clone();
    assert!(rows.iter().all(|row| row["error"].is_null()), "{rows:?}");
    // No lock file remains, and a killed sweep leaves no lock.
    let killed = Sweeping::start(&haff, &study, "study/.sweep.lock");
    drop(killed);
    let again = Sweeping::start(&haff, &study, "study/.sweep.lock");
    assert_eq!(again.stop(), Some(130));
    let left = fs::read_dir(haff.path("study")).unwrap().map(|entry| entry.unwrap().file_name());
    let locks: Vec<_> = left.filter(|name| name.to_string_lossy().ends_with(".lock")).collect();
    assert!(locks.is_empty(), "{locks:?}");
}

#[test]
fn different_members_run_simultaneously_but_the_same_member_only_once() {
    let haff = Haff::new();
    haff.write("gas.toml", GAS);
    let study = ["sweep", "gas.toml", "--set", "run.until=4000,1", "-o", "study", "--index"];
    let member = |index| [&study[..], &[index]].concat();
    let first = Sweeping::start(&haff, &member("0"), "study/.run-0000.h5.lock");
    let (status, _, err) = haff.run(&member("0"));
    assert_eq!(status, 4, "{err}");
    let message = format!("study/run-0000.h5: another process ({}) is at work on this run", first.0.id());
    assert!(err.contains(&message), "{err}");
    assert_eq!(haff.report(&member("1"))["status"], "complete");
    assert_eq!(first.stop(), Some(130));
}
