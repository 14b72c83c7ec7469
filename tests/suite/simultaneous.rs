//! Contacts of one body at one instant: their count, and what `haff check` says of them.

use serde_json::Value;

use crate::common::{Haff, config};

/// A ball that hits two balls at rest that touch each other, and a ball that hits one of two that are apart.
const BREAK: &str = "
schema = 1
[domain]
size = [10, 10, 10]
boundary = [\"open\", \"open\", \"open\"]
[[particle]]
position = [-1, 0, 0]
velocity = [1, 0, 0]
radius = 0.5
mass = 1
[[particle]]
position = [0.8660254037844386, 0.5, 0]
radius = 0.5
mass = 1
[[particle]]
position = [0.8660254037844386, -0.5, 0]
radius = 0.5
mass = 1
[run]
until = 2
";

fn json(haff: &Haff, arguments: &[&str]) -> Value {
    let (status, out, err) = haff.run(arguments);
    assert_eq!(status, 0, "{err}");
    serde_json::from_str(&out).unwrap()
}

#[test]
fn check_names_the_first_body_with_two_contacts_at_one_instant() {
    let haff = Haff::new();
    haff.write("break.toml", BREAK);
    let found = json(&haff, &["check", "break.toml", "--json"]);
    assert_eq!(found["simultaneous"]["particle"], 0);
    assert!((found["simultaneous"]["time"].as_f64().unwrap() - 1.0).abs() < 1e-12);
    let (_, out, _) = haff.run(&["check", "break.toml"]);
    assert!(out.contains("simultaneous        particle 0 has two contacts at t = 1;"), "{out}");
    // A ball that comes from the side hits one after the other.
    let aside = ["check", "break.toml", "--json", "--set", "particle.0.position=[-1, 1e-9, 0]"];
    assert_eq!(json(&haff, &aside)["simultaneous"], Value::Null);
    for (scene, has) in [
        ("textbook/newtons_cradle.toml", true),
        ("breakshot.toml", false),
        ("cooling.toml", false),
        ("textbook/direct_impact.toml", false),
    ] {
        let found = json(&haff, &["check", &config(scene), "--json"]);
        assert_eq!(found["simultaneous"].is_object(), has, "{scene}: {}", found["simultaneous"]);
    }
}

#[test]
fn contacts_at_the_instant_of_another_event_of_the_body_are_counted() {
    let haff = Haff::new();
    haff.write("break.toml", BREAK);
    let found = json(&haff, &["run", "break.toml", "-o", "break.h5", "--json"]);
    assert_eq!((&found["collisions"], &found["simultaneous_contacts"]), (&2.into(), &1.into()));
    assert_eq!(json(&haff, &["info", "break.h5", "--json"])["simultaneous_contacts"], 1);
    let (_, _, err) = haff.run(&["run", "break.toml"]);
    assert!(err.contains("1 contact at the instant of another event of the same body"), "{err}");
    // Through a cradle of five balls the impulse passes in one instant.
    let cradle = config("textbook/newtons_cradle.toml");
    let found = json(&haff, &["run", &cradle, "--json", "--set", "output.file=cradle.h5"]);
    assert!(found["simultaneous_contacts"].as_u64().unwrap() >= 3, "{found}");
    // A gas has none, with any search.
    for search in ["all_pairs", "cells", "lists", "windows"] {
        let choice = format!("engine.neighbors={search}");
        let gas = config("cooling.toml");
        let mut arguments = vec!["run", &gas, "--json", "--set", &choice, "--set", "species.grain.count=300"];
        arguments.extend(["--set", "run.until=5", "--set", "output.file=gas.h5", "--overwrite"]);
        let found = json(&haff, &arguments);
        assert_eq!(
            (found["collisions"].as_u64() > Some(100), &found["simultaneous_contacts"]),
            (true, &0.into())
        );
    }
}
