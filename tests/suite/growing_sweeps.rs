//! Sweeps that get more values or seeds in the same folder: only the new runs are made.

use std::{collections::BTreeMap, fs, time::SystemTime};

use serde_json::Value;

use crate::common::{GAS, Haff};

fn sweep(haff: &Haff, arguments: &[&str]) -> Value {
    haff.report(&[&["sweep", "gas.toml", "-o", "study"], arguments].concat())
}

fn rows(summary: &Value) -> &[Value] {
    summary["runs"].as_array().expect("rows")
}

/// The file and the state of each run, by its parameters and its number among the seeds.
fn files(summary: &Value) -> BTreeMap<String, (String, String)> {
    let text = |row: &Value, key: &str| row[key].as_str().unwrap_or_default().to_owned();
    let entry = |row: &Value| {
        let key = format!("{} {}", row["parameters"], row["replica"]);
        (key, (text(row, "file"), text(row, "state_hash")))
    };
    rows(summary).iter().map(entry).collect()
}

/// When each file of a run was last written.
fn written(haff: &Haff) -> BTreeMap<String, SystemTime> {
    let entries = fs::read_dir(haff.path("study")).unwrap().map(Result::unwrap);
    let times = entries.map(|entry| {
        (entry.file_name().to_string_lossy().into_owned(), entry.metadata().unwrap().modified().unwrap())
    });
    times.filter(|(name, _)| name.starts_with("run-")).collect()
}

#[test]
fn more_values_and_seeds_add_runs_and_keep_the_others() {
    let haff = Haff::new();
    haff.write("gas.toml", GAS);
    let first =
        sweep(&haff, &["--set", "run.until=2", "--set", "contact.restitution=0.8,0.95", "--seeds", "2"]);
    let before = written(&haff);
    assert_eq!(before.len(), 4);
    // A value between the others, a seed more, and the keys in another order.
    let more = ["--set", "contact.restitution=0.8,0.9,0.95", "--set", "run.until=2.0", "--seeds", "3"];
    let list = sweep(&haff, &[&more[..], &["--list"]].concat());
    assert_eq!((&list["members"], &list["complete"]), (&Value::from(9), &Value::from(4)));
    let grown = sweep(&haff, &more);
    assert_eq!((&grown["members"], &grown["complete"]), (&Value::from(9), &Value::from(9)));
    let after = written(&haff);
    assert_eq!(after.len(), 9);
    for (name, time) in before {
        assert_eq!(after[&name], time, "{name} was written again");
    }
    let (had, has) = (files(&first), files(&grown));
    let kept = |(key, run): (&String, &(String, String))| {
        let found: Vec<_> = has.iter().filter(|(_, other)| other.0 == run.0).collect();
        assert!(found.len() == 1 && found[0].1 == run, "{key}: {found:?}");
    };
    had.iter().for_each(kept);
    let names: Vec<&str> = rows(&grown).iter().map(|row| row["file"].as_str().unwrap()).collect();
    let expected = [0, 1, 4, 5, 6, 7, 2, 3, 8].map(|number| format!("run-{number:04}.h5"));
    assert_eq!(names, expected, "rows are in the order of the grid");
    let indices: Vec<u64> = rows(&grown).iter().map(|row| row["index"].as_u64().unwrap()).collect();
    assert_eq!(indices, (0..9).collect::<Vec<_>>());
    // Each new run is that of a sweep of its own, since seeds depend on parameters alone.
    let alone = haff.report(&[
        "sweep",
        "gas.toml",
        "-o",
        "alone",
        "--set",
        "run.until=2",
        "--set",
        "contact.restitution=0.9",
        "--seeds",
        "3",
    ]);
    for row in rows(&alone) {
        let same = rows(&grown).iter().find(|other| other["seed"] == row["seed"]).expect("the same seed");
        assert_eq!(same["state_hash"], row["state_hash"]);
    }
    // The same command once more, and single members, find everything done.
    let (status, _, err) = haff.run(&[&["sweep", "gas.toml", "-o", "study"], &more[..]].concat());
    assert!(status == 0 && err.contains("9 since before"), "{err}");
    let member = sweep(&haff, &[&more[..], &["--index", "8"]].concat());
    assert_eq!(member["file"], "run-0008.h5");
}

#[test]
fn a_member_of_a_job_array_grows_the_sweep() {
    let haff = Haff::new();
    haff.write("gas.toml", GAS);
    sweep(&haff, &["--set", "contact.restitution=0.8,0.9", "--set", "run.until=2"]);
    let more = ["--set", "contact.restitution=0.7,0.8,0.9", "--set", "run.until=2"];
    let row = sweep(&haff, &[&more[..], &["--index", "0"]].concat());
    assert_eq!((&row["file"], &row["status"]), (&Value::from("run-0002.h5"), &Value::from("complete")));
    let (_, _, err) = haff.run(&[&["sweep", "gas.toml", "-o", "study"], &more[..]].concat());
    assert!(err.contains("3 of 3 runs are complete"), "{err}");
    assert_eq!(written(&haff).len(), 3);
}

#[test]
fn fewer_values_or_seeds_and_other_keys_are_refused() {
    let haff = Haff::new();
    haff.write("gas.toml", GAS);
    sweep(&haff, &["--set", "contact.restitution=0.8,0.9", "--set", "run.until=1", "--seeds", "2"]);
    let manifest = fs::read(haff.path("study/manifest.json")).unwrap();
    for (given, why) in [
        ("contact.restitution=0.8,0.95 run.until=1 2", "may get more values of these keys"),
        ("contact.restitution=0.8 run.until=1 2", "may get more values of these keys"),
        ("contact.restitution=0.8,0.9 2", "may get more values of these keys"),
        ("contact.restitution=0.8,0.9 run.until=1 contact.tc=0.0 2", "may get more values of these keys"),
        ("contact.restitution=0.8,0.9 run.until=1 1", "it has --seeds 2, not --seeds 1"),
    ] {
        let words: Vec<&str> = given.split(' ').collect();
        let (seeds, sets) = words.split_last().unwrap();
        let mut arguments = vec!["sweep", "gas.toml", "-o", "study", "--seeds", seeds];
        for set in sets {
            arguments.extend(["--set", set]);
        }
        let (status, _, err) = haff.run(&arguments);
        assert!(
            status == 4 && err.contains("belongs to another sweep") && err.contains(why),
            "{status}: {err}"
        );
    }
    assert_eq!(fs::read(haff.path("study/manifest.json")).unwrap(), manifest);
}
