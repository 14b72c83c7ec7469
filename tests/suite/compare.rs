//! `haff compare`: two files and two sweeps side by side.

use serde_json::Value;

use crate::common::{GAS, Haff};

/// An elastic gas with a file of observables.
fn gas() -> String {
    let elastic = GAS.replace("events = true\n", "").replace("restitution = 0.9", "restitution = 1.0");
    assert!(elastic.contains("restitution = 1.0"), "{elastic}");
    elastic
}

fn json(haff: &Haff, arguments: &[&str]) -> Value {
    let (status, out, err) = haff.run(&[arguments, &["--json"]].concat());
    assert_eq!(status, 0, "{err}");
    serde_json::from_str(&out).unwrap()
}

#[test]
fn two_files_are_compared_in_standard_errors() {
    let haff = Haff::new();
    haff.write("gas.toml", &gas());
    for (name, seed, temperature) in [("a.h5", "1", "1.0"), ("b.h5", "2", "1.0"), ("hot.h5", "3", "1.5")] {
        let sets = [format!("seed={seed}"), format!("initial.temperature={temperature}")];
        let sets = ["--set", &sets[0], "--set", &sets[1], "--set", "output.observables=0.1", "-q"];
        let (status, _, err) = haff.run(&[&["run", "gas.toml", "-o", name][..], &sets].concat());
        assert_eq!(status, 0, "{err}");
    }
    let z = |report: &Value, name: &str| report["runs"][0]["means"][name]["z"].as_f64().unwrap();
    let same = json(&haff, &["compare", "a.h5", "b.h5"]);
    for name in ["pressure", "collision_rate"] {
        assert!(z(&same, name).abs() < 4.0, "{same}");
    }
    let one = &same["runs"][0]["means"]["pressure"];
    let [a, b] =
        ["a", "b"].map(|side| [&one[side]["mean"], &one[side]["error"]].map(|x| x.as_f64().unwrap()));
    let expected = (b[0] - a[0]) / a[1].hypot(b[1]);
    assert!((z(&same, "pressure") / expected - 1.0).abs() < 1e-12, "{one}");
    // The means are those of `haff info`.
    let info = json(&haff, &["info", "a.h5"]);
    assert_eq!(info["means"]["pressure"]["mean"], one["a"]["mean"]);
    // The pressure of a gas is proportional to its temperature.
    let hotter = json(&haff, &["compare", "a.h5", "hot.h5"]);
    // 0.5 of the pressure and 0.22 of the rate, with errors of half a per cent and of one and a half.
    assert!(z(&hotter, "pressure") > 20.0 && z(&hotter, "collision_rate") > 10.0, "{hotter}");
    let (_, text, _) = haff.run(&["compare", "a.h5", "hot.h5"]);
    let line = text.lines().find(|line| line.starts_with("pressure ")).unwrap();
    assert!(line.contains(" ± ") && line.ends_with(" *"), "{text}");
    assert!(text.contains("* more than 3 standard errors apart"), "{text}");
}

#[test]
fn sweeps_are_compared_run_by_run() {
    let haff = Haff::new();
    haff.write("gas.toml", &gas());
    for (folder, values) in [("first", "0.1,0.2"), ("second", "0.2,0.1,0.3")] {
        let set = format!("domain.packing_fraction={values}");
        let sets = ["--set", &set, "--seeds", "2", "--set", "output.observables=0.1", "-q", "-o", folder];
        let (status, _, err) = haff.run(&[&["sweep", "gas.toml"][..], &sets].concat());
        assert_eq!(status, 0, "{err}");
    }
    let report = json(&haff, &["compare", "first", "second"]);
    assert_eq!(report["alone"], serde_json::json!([0, 1]));
    let runs = report["runs"].as_array().unwrap();
    assert_eq!(runs.len(), 2);
    for (run, fraction) in runs.iter().zip([0.1, 0.2]) {
        assert_eq!(run["parameters"]["domain.packing_fraction"], fraction);
        let pressure = &run["means"]["pressure"];
        assert!(
            pressure["error"].as_f64().unwrap() > 0.0 && pressure["z"].as_f64().unwrap().abs() < 4.0,
            "{run}"
        );
    }
    let (status, text, _) = haff.run(&["compare", "first", "second"]);
    assert!(status == 0 && text.contains("domain.packing_fraction = 0.1"), "{text}");
    assert!(text.contains("1 parameter set of B without a partner"), "{text}");
}

#[test]
fn what_cannot_be_compared_is_said() {
    let haff = Haff::new();
    haff.write("gas.toml", &gas());
    haff.run(&["run", "gas.toml", "-o", "a.h5", "-q"]);
    haff.run(&["run", "gas.toml", "-o", "none.h5", "-q", "--set", "output.observables=false"]);
    haff.run(&["sweep", "gas.toml", "--set", "contact.restitution=0.9", "-o", "sweep", "-q"]);
    haff.run(&["sweep", "gas.toml", "--set", "contact.restitution=0.8", "-o", "other", "-q"]);
    std::fs::create_dir(haff.path("empty")).unwrap();
    for (a, b, status, expected) in [
        ("a.h5", "missing.h5", 4, "missing.h5: no such file"),
        ("a.h5", "none.h5", 4, "none.h5: no observables with a mean"),
        ("a.h5", "sweep", 2, "one is a file, the other the folder of a sweep"),
        ("sweep", "empty", 4, "empty: no manifest.json, so it is not the folder of a sweep"),
        ("sweep", "other", 2, "no complete runs of both have the same parameters"),
        ("a.h5", "gas.toml", 4, "gas.toml"),
    ] {
        let (found, _, err) = haff.run(&["compare", a, b]);
        assert!(found == status && err.contains(expected), "{a} {b}: {found} {err}");
    }
}
