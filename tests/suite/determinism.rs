//! The same scene gives the same trajectory: on any number of threads, with any search and kernel, with and
//! without interruptions, in debug and release builds.

use std::{process::Stdio, time::Duration};

use nix::{
    sys::signal::{Signal, kill},
    unistd::Pid,
};
use serde_json::Value;

use crate::common::{self, GAS, Haff};

fn hash(report: &Value) -> String {
    report["state_hash"].as_str().unwrap().to_owned()
}

#[test]
fn state_hashes_are_pinned_for_every_build() {
    let haff = Haff::new();
    let scene = haff.write("gas.toml", GAS);
    let pins: Value = serde_json::from_str(include_str!("../pinned_hashes.json")).unwrap();
    for pin in pins["scenes"].as_array().unwrap() {
        let mut arguments = vec!["run", &scene, "--overwrite"];
        for set in pin["set"].as_array().unwrap() {
            arguments.extend(["--set", set.as_str().unwrap()]);
        }
        let found = hash(&haff.report(&arguments));
        assert_eq!(found, pin["state_hash"], "{}: if this is meant, raise TRAJECTORY_VERSION", pin["name"]);
    }
}

#[test]
fn trajectory_is_independent_of_search_kernel_threads_and_output() {
    let haff = Haff::new();
    let scene = haff.write("gas.toml", GAS);
    let short = ["run", &scene, "--overwrite", "--set", "run.until=5"];
    let expected = hash(&haff.report(&short));
    for choice in [
        &["--threads", "1"][..],
        &["--threads", "2"],
        &["--set", "engine.neighbors=\"cells\""],
        &["--set", "engine.neighbors=\"all_pairs\""],
        &["--set", "engine.simd=\"portable\""],
        &["--set", "output.events=false", "--set", "output.frames=0.37", "--set", "output.observables=false"],
    ] {
        assert_eq!(hash(&haff.report(&[&short, choice].concat())), expected, "{choice:?}");
    }
}

/// Starts a long run, sends it a signal after a checkpoint later than `time`, and returns its exit status: 0
/// if it has ended before.
fn interrupt(haff: &Haff, file: &str, arguments: &[&str], signal: Signal, time: f64) -> i32 {
    let mut child = haff.command(arguments).stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
    if haff.wait_for_checkpoint(&mut child, file, time).is_none() {
        kill(Pid::from_raw(child.id() as i32), signal).unwrap();
    }
    child.wait().unwrap().code().unwrap_or(-1)
}

#[test]
#[ignore = "long: scripts/test all"]
fn an_interrupted_run_resumes_to_the_state_of_an_uninterrupted_one() {
    let haff = Haff::new();
    let scene = haff.write("gas.toml", GAS);
    let long = [
        "run",
        &scene,
        "--set",
        "run.until=3000",
        "--set",
        "output.frames=100",
        "--set",
        "output.checkpoint=50",
    ];
    let whole = haff.report(&[&long[..], &["-o", "whole.h5"]].concat());

    for (signal, status) in [(Signal::SIGINT, 130), (Signal::SIGTERM, 143)] {
        let arguments = [&long[..], &["-o", "gas.h5", "--overwrite"]].concat();
        // On a busy machine the run may end before it is interrupted: then it is made again.
        let found = loop {
            match interrupt(&haff, "gas.h5", &arguments, signal, 0.0) {
                0 => std::fs::remove_file(haff.path("gas.h5")).unwrap(),
                status => break status,
            }
        };
        assert_eq!(found, status);
        let info: Value = serde_json::from_str(&haff.run(&["info", "gas.h5", "--json"]).1).unwrap();
        assert_eq!((&info["finished"], &info["resumable"]), (&Value::from(false), &Value::from(true)));
        let resumed = haff.report(&["run", "--resume", "gas.h5"]);
        assert!(resumed["resumed_from"].as_f64() > Some(0.0), "{resumed}");
        for key in ["state_hash", "collisions", "events", "simulated_time", "dissipated_energy", "stopped"] {
            assert_eq!(resumed[key], whole[key], "{key} after {signal}");
        }
        assert_eq!(recorded(&haff, "gas.h5"), recorded(&haff, "whole.h5"), "after {signal}");
        // A finished file resumes to the same totals.
        let again = haff.report(&["run", "--resume", "gas.h5"]);
        assert_eq!(again["state_hash"], whole["state_hash"]);
        std::fs::remove_file(haff.path("gas.h5")).unwrap();
    }
}

/// Whether a process handles SIGINT itself already.
fn handles_interrupts(process: u32) -> bool {
    let Ok(status) = std::fs::read_to_string(format!("/proc/{process}/status")) else { return true };
    let caught = status.lines().find_map(|line| line.strip_prefix("SigCgt:")).map(str::trim);
    caught.is_none_or(|signals| u64::from_str_radix(signals, 16).is_ok_and(|signals| signals & 2 != 0))
}

#[test]
fn a_signal_ends_the_generation_of_a_packing() {
    let haff = Haff::new();
    // Growing such a dense packing takes far longer than the wait.
    let scene = "dimension = 3\n[domain]\npacking_fraction = 0.49\n[[species]]\nname = \"grain\"\ncount = 300000\n\
                 radius = 0.5\nmass = 1.0\n[initial]\npositions = \"random\"\n[run]\nuntil = 1.0\n";
    let packing = haff.write("packing.toml", scene);
    let mut child =
        haff.command(&["run", &packing]).stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
    while !handles_interrupts(child.id()) {
        std::thread::sleep(Duration::from_millis(1));
    }
    std::thread::sleep(Duration::from_millis(400));
    kill(Pid::from_raw(child.id() as i32), Signal::SIGINT).unwrap();
    assert_eq!(child.wait().unwrap().code(), Some(130));
    // After the generation it would have been, before the run looks for signals.
    assert!(!haff.path("packing.h5").exists(), "no file has been created");
}

/// The part of `haff info` that must not depend on interruptions.
fn recorded(haff: &Haff, file: &str) -> Vec<Value> {
    let info: Value = serde_json::from_str(&haff.run(&["info", file, "--json"]).1).unwrap();
    ["frames", "samples", "events", "event_rows", "last", "finished"].map(|key| info[key].clone()).to_vec()
}

#[test]
#[ignore = "long: scripts/test all"]
fn a_linkage_killed_repeatedly_resumes_to_the_state_of_an_uninterrupted_one() {
    let haff = Haff::new();
    // Bobs that collide away from the bottom, strings that go slack: thousands of events of all kinds.
    let scene = common::config("textbook/pendulums.toml");
    let mut long = vec!["run", &scene];
    for set in ["run.until=30000", "output.frames=10", "output.observables=10", "output.checkpoint=5"] {
        long.extend(["--set", set]);
    }
    long.extend(["--set", "contact.restitution=0.9999"]);
    let whole = haff.report(&[&long[..], &["-o", "whole.h5"]].concat());
    let start = [&long[..], &["-o", "swing.h5"]].concat();
    let mut kills = 0;
    // On a busy machine the run may end before it is killed: then it is made again.
    while kills == 0 {
        let _ = std::fs::remove_file(haff.path("swing.h5"));
        for legs in 0..4 {
            let resume = ["run", "--resume", "swing.h5"];
            let arguments = if legs == 0 { &start[..] } else { &resume[..] };
            let after = haff.checkpoint_time("swing.h5").max(0.0);
            kills += i32::from(interrupt(&haff, "swing.h5", arguments, Signal::SIGKILL, after) == -1);
        }
    }
    let resumed = haff.report(&["run", "--resume", "swing.h5"]);
    assert!(resumed["resumed_from"].as_f64() > Some(0.0), "{resumed}");
    for key in
        ["state_hash", "collisions", "simulated_time", "dissipated_energy", "ledger_residual", "stopped"]
    {
        assert_eq!(resumed[key], whole[key], "{key}");
    }
    assert_eq!(recorded(&haff, "swing.h5"), recorded(&haff, "whole.h5"));
}

#[test]
#[ignore = "long: scripts/test all"]
fn wall_time_stops_a_run_that_can_be_resumed() {
    let haff = Haff::new();
    let scene = haff.write("gas.toml", GAS);
    let whole = haff.report(&["run", &scene, "-o", "whole.h5", "--set", "run.until=500"]);
    let report = haff.report(&["run", &scene, "--set", "run.until=500", "--set", "run.wall_time=0.02"]);
    assert_eq!(report["stopped"], "wall_time");
    assert!(report["simulated_time"].as_f64() < Some(500.0));
    // The scene's own wall_time ends each part of the run; the parts add up to the whole.
    let mut last = report;
    for _ in 0..1000 {
        if last["stopped"] != "wall_time" {
            break;
        }
        last = haff.report(&["run", "--resume", "gas.h5"]);
    }
    assert_eq!(last["stopped"], "until");
    assert_eq!(last["state_hash"], whole["state_hash"]);
}
