//! Runs that go on: from a checkpoint with changed keys in a new file, and parts of a run with their own
//! times.

use std::{fs, thread, time::Duration};

use serde_json::Value;

use crate::common::{GAS, Haff};

fn gas() -> Haff {
    let haff = Haff::new();
    haff.write("gas.toml", GAS);
    haff
}

fn info(haff: &Haff, file: &str) -> Value {
    let (status, out, err) = haff.run(&["info", file, "--json"]);
    assert_eq!(status, 0, "{err}");
    serde_json::from_str(&out).expect("JSON")
}

/// Two grains that fall onto a floor, one above the other: an inelastic collapse.
const STACK: &str = r#"
schema = 1
[domain]
boundary = ["open", "open", "open"]
gravity = [0.0, 0.0, -1.0]
[[wall]]
name = "floor"
plane = { point = [0.0, 0.0, 0.0], normal = [0.0, 0.0, 1.0] }
[[particle]]
position = [0.0, 0.0, 1.0]
radius = 0.5
mass = 1.0
[[particle]]
position = [0.0, 0.0, 2.5]
radius = 0.5
mass = 1.0
[contact]
restitution = 0.3
[run]
until = 100.0
[output]
file = "stack.h5"
"#;

#[test]
fn a_complete_run_goes_on_to_a_later_end_with_the_same_bits() {
    let haff = gas();
    let whole = haff.report(&["run", "gas.toml", "--set", "run.until=6", "-o", "whole.h5"]);
    haff.report(&["run", "gas.toml", "--set", "run.until=2.5", "-o", "first.h5"]);
    let before = fs::read(haff.path("first.h5")).unwrap();
    let longer = haff.report(&["run", "--resume", "first.h5", "--set", "run.until=6", "-o", "longer.h5"]);
    for key in ["state_hash", "collisions", "simulated_time", "stopped", "particles"] {
        assert_eq!(longer[key], whole[key], "{key}");
    }
    assert_eq!(
        (&longer["resumed_from"], &longer["continues"]),
        (&Value::from(2.5), &Value::from("first.h5"))
    );
    let info = info(&haff, "longer.h5");
    // The state that it goes on from, and those of its schedule: 3, 4, 5, 6.
    assert_eq!((info["time_range"].to_string(), &info["frames"]), ("[2.5,6.0]".to_owned(), &Value::from(5)));
    assert_eq!(fs::read(haff.path("first.h5")).unwrap(), before, "the first file is not changed");
}

#[test]
fn a_run_goes_on_with_changed_keys_and_can_be_resumed() {
    let haff = gas();
    haff.report(&["run", "gas.toml", "--set", "run.until=3", "-o", "first.h5"]);
    let go_on = |file: &str, set: &[&str], new: &str| {
        let mut arguments = vec!["run", "--resume", file, "-o", new];
        for set in set {
            arguments.extend(["--set", set]);
        }
        haff.report(&arguments)
    };
    let inelastic = go_on("first.h5", &["contact.restitution=0.5", "run.until=8"], "inelastic.h5");
    let plain = go_on("first.h5", &["run.until=8"], "plain.h5");
    let energy = |report: &Value, key: &str| report[key].as_f64().unwrap();
    assert!(energy(&inelastic, "kinetic_energy") < 0.5 * energy(&plain, "kinetic_energy"));
    assert!(energy(&inelastic, "ledger_residual").abs() < 1e-13, "the ledger spans the change");
    // In two steps, the second with no change but the end: the same bits.
    go_on("first.h5", &["contact.restitution=0.5", "run.until=5"], "half.h5");
    let steps = go_on("half.h5", &["run.until=8"], "steps.h5");
    assert_eq!(steps["state_hash"], inelastic["state_hash"]);
    // Stopped by wall time and resumed in its file: the same bits.
    let stopped =
        go_on("first.h5", &["contact.restitution=0.5", "run.until=8", "run.wall_time=1e-9"], "stopped.h5");
    assert_eq!(stopped["stopped"], "wall_time");
    let mut report = stopped;
    while report["stopped"] == "wall_time" {
        report = haff.report(&["run", "--resume", "stopped.h5"]);
    }
    assert_eq!(report["state_hash"], inelastic["state_hash"]);
    let scene = info(&haff, "inelastic.h5")["scene"].as_str().unwrap().to_owned();
    assert!(scene.contains("restitution = 0.5"), "the new file has its own scene: {scene}");
}

#[test]
fn runs_that_cannot_go_on_are_refused_and_no_file_is_made() {
    let haff = gas();
    haff.report(&["run", "gas.toml", "--set", "run.until=1", "-o", "gas.h5"]);
    for (arguments, why) in [
        (&["--set", "run.until=2"][..], "name a new file for it (-o)"),
        (&["--overwrite"], "name the file that may be replaced (-o)"),
        (&["-o", "gas.h5", "--set", "run.until=2"], "is the file that the run goes on from"),
        (
            &["-o", "new.h5", "--set", "species.0.count=3"],
            "species.0.count=3: cannot change in a run that goes on",
        ),
        (&["-o", "new.h5", "--set", "domain.size=[9.0,9.0,9.0]"], "(allowed: contact, domain.gravity,"),
        (&["-o", "new.h5", "--set", "contact.tcc=1"], "did you mean `tc`"),
        (&["-o", "new.h5", "--set", "run.until=0.5"], "run.until = 0.5: the run is at t = 1 already"),
        (&["-o", "new.h5"], "run.until = 1: the run is at t = 1 already"),
    ] {
        let (status, _, err) = haff.run(&[&["run", "--resume", "gas.h5"], arguments].concat());
        assert!(status == 2 && err.contains(why), "{arguments:?}: {status}: {err}");
    }
    assert!(!haff.path("new.h5").exists());
    // Not even the state that the scene of the run started from is replaced.
    let text = GAS
        .replace("[initial]", "[initial]\npositions = { file = \"gas.h5\" }")
        .replace("temperature = 1.0\n", "");
    haff.write("later.toml", &text.replace("packing_fraction = 0.1", ""));
    haff.report(&["run", "later.toml", "--set", "run.until=1", "-o", "later.h5"]);
    let on = ["run", "--resume", "later.h5", "--set", "run.until=2", "-o", "gas.h5", "--overwrite"];
    let (status, _, err) = haff.run(&on);
    assert!(status == 2 && err.contains("is the state that the scene starts from"), "{status}: {err}");
    let (status, _, err) = haff.run(&["run", "--resume", "none.h5", "--set", "run.until=2", "-o", "new.h5"]);
    assert!(status == 4 && err.contains("no such file"), "{err}");
}

#[test]
fn a_collapse_is_the_same_after_every_resumption_and_goes_on_with_a_remedy() {
    let haff = Haff::new();
    haff.write("stack.toml", STACK);
    let message = |arguments: &[&str]| {
        let (status, out, err) = haff.run(&[arguments, &["--json"]].concat());
        let report: Value = serde_json::from_str(&out).expect("JSON");
        assert_eq!((status, &report["stopped"]), (3, &Value::from("collapse")), "{err}");
        (report["error"].as_str().unwrap().to_owned(), report["simulated_time"].clone(), err)
    };
    let (error, time, text) = message(&["run", "stack.toml"]);
    assert!(error.contains("so fast that the clock") && error.contains("(inelastic collapse)"), "{error}");
    // At √(g d) = 1 a grain moves by its diameter in 1.
    assert!(error.contains("for example contact.tc = 1e-4"), "{error}");
    assert!(error.contains("set contact.rest_speed, for example 0.05"), "{error}");
    assert!(text.contains("--resume stack.h5 --set contact.rest_speed=0.05 -o NEW.h5"), "{text}");
    for _ in 0..2 {
        let (again, then, _) = message(&["run", "--resume", "stack.h5"]);
        assert_eq!((&again, &then), (&error, &time));
    }
    let on = ["run", "--resume", "stack.h5", "--set", "contact.rest_speed=0.05", "-o", "on.h5"];
    let report = haff.report(&on);
    assert_eq!((&report["resumed_from"], &report["stopped"]), (&time, &Value::from("rest")));
}

#[test]
fn parts_of_a_run_have_their_own_times_and_are_summed() {
    let haff = gas();
    let mut report =
        haff.report(&["run", "gas.toml", "--set", "run.wall_time=\"1ms\"", "--set", "run.until=3000"]);
    let mut seconds = 0.0;
    for k in 1.. {
        let parts = report["parts"].as_array().unwrap();
        assert_eq!(parts.len(), k);
        let part = parts.last().unwrap();
        seconds += part["wall_seconds"].as_f64().unwrap();
        let collisions: u64 = parts.iter().map(|part| part["collisions"].as_u64().unwrap()).sum();
        assert_eq!(
            (&report["collisions"], &report["simulated_time"]),
            (&Value::from(collisions), &part["to"])
        );
        assert!((report["wall_seconds"].as_f64().unwrap() - seconds).abs() < 1e-12);
        let rate = collisions as f64 / seconds;
        assert!((report["collisions_per_second"].as_f64().unwrap() / rate - 1.0).abs() < 1e-12);
        if k == 3 {
            break;
        }
        report = haff.report(&["run", "--resume", "gas.h5"]);
    }
    let (_, text, _) = haff.run(&["info", "gas.h5"]);
    assert!(text.contains("  part 3          t = "), "{text}");
    let (_, _, text) = haff.run(&["run", "--resume", "gas.h5"]);
    assert!(text.contains("of them in this part") && text.contains("4 parts took"), "{text}");
}

#[test]
fn a_killed_part_has_collisions_but_no_wall_time() {
    let haff = gas();
    let mut child = haff
        .command(&["run", "gas.toml", "-q", "--set", "run.until=1e7", "--set", "output.checkpoint=1.0"])
        .spawn()
        .unwrap();
    // A checkpoint after that of the start.
    while !haff.path("gas.h5").exists() || info(&haff, "gas.h5")["checkpoint_time"].as_f64() <= Some(1.0) {
        thread::sleep(Duration::from_millis(20));
    }
    let running = info(&haff, "gas.h5");
    assert_eq!((&running["running"], &running["resumable"]), (&Value::from(true), &Value::from(false)));
    let (_, text, _) = haff.run(&["info", "gas.h5"]);
    assert!(text.contains("running: another process is writing the file"), "{text}");
    child.kill().unwrap();
    child.wait().unwrap();
    assert_eq!(info(&haff, "gas.h5")["running"], false);
    let on = ["run", "--resume", "gas.h5", "-o", "on.h5", "--set", "run.wall_time=\"1ms\""];
    let report = haff.report(&on);
    let parts = report["parts"].as_array().unwrap();
    assert!(parts[0]["wall_seconds"].is_null() && parts[0]["collisions"].as_u64() > Some(0), "{report}");
    assert_eq!(report["wall_seconds"], parts[1]["wall_seconds"]);
}
