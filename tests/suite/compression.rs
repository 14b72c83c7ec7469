//! Boxes that are compressed and growth: how runs end, and what is told of it.

use serde_json::Value;

use crate::common::Haff;

/// 100 spheres in a periodic cube at a packing fraction of 0.1, which grow.
const GROWTH: &str = r#"
[domain]
packing_fraction = 0.1
[[species]]
name = "grain"
count = 100
radius = 0.5
mass = 1.0
[growth]
rate = 0.05
temperature = 1.0
"#;

#[test]
#[ignore = "long: scripts/test all"]
fn growth_ends_on_a_packing_fraction_at_once_and_resumed() {
    let haff = Haff::new();
    let scene = haff.write("grow.toml", &format!("{GROWTH}until_packing_fraction = 0.12\n"));
    let report = haff.report(&["run", &scene, "-o", "grown.h5"]);
    assert_eq!(report["stopped"], "packing_fraction");
    let expected = (1.0 - (0.1_f64 / 0.12).cbrt()) / 0.05;
    let time = report["simulated_time"].as_f64().unwrap();
    assert!((time / expected - 1.0).abs() < 1e-13, "at {time}, not {expected}");
    let mut parts = haff.report(&["run", &scene, "-o", "parts.h5", "--set", "run.wall_time=1e-9"]);
    assert_eq!(parts["stopped"], "wall_time");
    while parts["stopped"] == "wall_time" {
        parts = haff.report(&["run", "--resume", "parts.h5"]);
    }
    for key in ["stopped", "simulated_time", "state_hash"] {
        assert_eq!(parts[key], report[key], "{key}");
    }
    let (status, _, err) = haff.run(&["run", "--resume", "grown.h5", "-o", "more.h5"]);
    assert!(status == 2 && err.contains("growth.until_packing_fraction: the run is there"), "{err}");
    // An earlier end comes first.
    assert_eq!(haff.report(&["run", &scene, "--set", "run.until=0.1"])["stopped"], "until");
    let (_, _, err) = haff.run(&["run", &scene]);
    assert!(err.contains("reached growth.until_packing_fraction"), "{err}");
}

#[test]
fn growth_ends_on_a_reduced_pressure_with_samples_and_without() {
    let haff = Haff::new();
    let scene = haff.write("press.toml", &format!("{GROWTH}until_reduced_pressure = 1.3\n"));
    let every = "output.observables=1.0";
    let report = haff.report(&["run", &scene, "--set", every]);
    assert_eq!(report["stopped"], "reduced_pressure");
    let recorded =
        haff.report(&["run", &scene, "--set", every, "--set", "output.frames=1.0", "-o", "press.h5"]);
    for key in ["stopped", "simulated_time", "state_hash"] {
        assert_eq!(recorded[key], report[key], "{key}");
    }
    // Whenever particles have had ten collisions each.
    let report = haff.report(&["run", &scene, "--set", "output.observables=false"]);
    assert_eq!(report["stopped"], "reduced_pressure");
    assert_eq!(report["collisions"].as_u64().unwrap() % 500, 0);
}

#[test]
fn check_tells_what_becomes_of_the_box() {
    let haff = Haff::new();
    let scene = haff.write("grow.toml", &format!("{GROWTH}until_packing_fraction = 0.12\n"));
    let (status, out, err) = haff.run(&["check", &scene]);
    assert_eq!(status, 0, "{err}");
    assert!(
        out.contains("\ndeformation         edges 7.58")
            && out.contains(", packing fraction 0.12 at the end, t = 1.179"),
        "{out}"
    );
    let json: Value = serde_json::from_str(&haff.run(&["check", &scene, "--json"]).1).unwrap();
    let fraction = json["deformation"]["packing_fraction"].as_f64().unwrap();
    assert!((fraction - 0.12).abs() < 1e-14, "{fraction}");
    let press = haff.write("press.toml", &format!("{GROWTH}until_reduced_pressure = 1e6\n"));
    let (_, out, _) = haff.run(&["check", &press]);
    assert!(out.contains("packing fraction 0.74048 at most, at t = 9.7389"), "{out}");
}

#[test]
fn a_collapse_in_a_box_that_becomes_smaller_is_a_jam() {
    let haff = Haff::new();
    let scene = haff.write(
        "jam.toml",
        r#"
dimension = 2
contact.restitution = 0.5
growth = { rate = 0.1, until_reduced_pressure = 1e30 }
engine.neighbors = "cells"
domain = { size = [4.0, 4.0], boundary = ["wall", "wall"] }
species = [{ name = "disk", count = 5, radius = 0.5, mass = 1.0 }]
"#,
    );
    let (status, out, err) = haff.run(&["run", &scene, "--json"]);
    let report: Value = serde_json::from_str(&out).unwrap();
    assert_eq!((status, &report["stopped"]), (3, &Value::from("collapse")), "{err}");
    for text in [&err, report["error"].as_str().unwrap()] {
        assert!(text.contains("jammed at φ = 0.") && text.contains(", reduced pressure "), "{text}");
    }
}

#[test]
#[ignore = "long: scripts/test all"]
fn an_elastic_compression_past_jamming_ends() {
    let haff = Haff::new();
    // Without a thermostat the particles are heated ever more, and jamming takes infinitely many collisions.
    let scene = haff.write(
        "jam.toml",
        r#"
dimension = 2
domain = { packing_fraction = 0.5, compression = { rate = 0.2 } }
initial.positions = "random"
species = [{ name = "disk", count = 20, radius = { list = [0.5, 0.7] }, mass = 1.0, temperature = 1.0 }]
run.until = 1.4
output.observables = 0.1
"#,
    );
    let (status, out, err) = haff.run(&["run", &scene, "--json", "-o", "jam.h5"]);
    let report: Value = serde_json::from_str(&out).unwrap();
    assert_eq!((status, &report["stopped"]), (3, &Value::from("jammed")), "{err}");
    assert!(err.contains("jammed at φ = 0.8") && err.contains(", below the 0.964"), "{err}");
    // At the same step in parts, in another search and without rows.
    let without = ["--set", "engine.neighbors=\"all_pairs\"", "--set", "output.observables=false"];
    let (_, out, _) = haff.run(&[&["run", &scene, "--json"], &without[..]].concat());
    let other: Value = serde_json::from_str(&out).unwrap();
    let (_, out, _) = haff.run(&["run", &scene, "--json", "-o", "parts.h5", "--set", "run.wall_time=1e-9"]);
    let mut parts: Value = serde_json::from_str(&out).unwrap();
    while parts["stopped"] == "wall_time" {
        parts = serde_json::from_str(&haff.run(&["run", "--json", "--resume", "parts.h5"]).1).unwrap();
    }
    for key in ["stopped", "simulated_time", "collisions", "state_hash"] {
        assert_eq!(other[key], report[key], "{key}");
        assert_eq!(parts[key], report[key], "{key}");
    }
}
