//! Numbers in text for users, and the warning of a gas that will cluster.

mod common;

use common::{GAS, Haff, config};
use serde_json::Value;

#[test]
fn numbers_have_the_digits_and_words_that_a_person_writes() {
    let haff = Haff::new();
    let fluid = config("fluid.toml");
    let (status, out, err) = haff.run(&["check", &fluid, "--set", "initial.temperature=300"]);
    assert_eq!(status, 0, "{err}");
    for line in ["temperature         300", "mean free time 0.00754"] {
        assert!(out.contains(line), "{line}: {out}");
    }
    let rate = out.lines().find(|line| line.starts_with("collision rate")).unwrap();
    assert!(
        rate.contains(" collisions per unit time at the start, ") && rate.contains(" per particle"),
        "{rate}"
    );
    let ball = config("textbook/bouncing_ball.toml");
    let (_, out, _) = haff.run(&["check", &ball]);
    assert!(out.contains("1 sphere, 1 wall\n"), "{out}");
    let (_, _, err) = haff.run(&["run", &ball, "-o", "ball.h5", "-v"]);
    assert!(err.contains("\n1 particle to t = "), "{err}");
    // Not more than nine digits of any number, in the log, the result and the summary.
    let (_, out, _) = haff.run(&["info", "ball.h5"]);
    for line in err.lines().chain(out.lines()) {
        let hash = line.starts_with("state hash") || line.starts_with("written by");
        let digits = |word: &str| word.chars().filter(char::is_ascii_digit).count();
        let longest = line.split([' ', '=', ',', ':']).filter(|word| word.contains('.')).map(digits).max();
        assert!(hash || longest.unwrap_or(0) <= 12, "{line}");
    }
    haff.write("gas.toml", &GAS.replace("file = \"gas.h5\"\n", "").replace("events = true\n", ""));
    let (_, out, _) = haff.run(&["check", "gas.toml"]);
    assert!(out.contains("no output file: results are not saved"), "{out}");
}

#[test]
fn a_gas_that_will_cluster_gets_a_warning() {
    let haff = Haff::new();
    let scene = config("disks.toml");
    let set = ["--set", "contact.restitution=0.7", "--set", "run.until=0.01"];
    let (status, out, _) = haff.run(&[&["check", &scene], &set[..]].concat());
    let warning = "exceeds the critical length L_c = ";
    assert!(status == 0 && out.contains("warning: the box, ") && out.contains(warning), "{out}");
    assert!(out.contains("set contact.tc, for example 1e-5"), "{out}");
    let (_, out, _) = haff.run(&[&["check", &scene, "--json"], &set[..]].concat());
    let json: Value = serde_json::from_str(&out).unwrap();
    assert!(json["warnings"][0].as_str().unwrap().contains(warning), "{json}");
    let (_, _, err) = haff.run(&[&["run", &scene, "-o", "a.h5"], &set[..]].concat());
    assert!(err.starts_with("warning: the box, "), "{err}");
    for quiet in [&["-q"][..], &["--set", "contact.tc=1e-5"], &["--set", "contact.restitution=1"]] {
        let (_, _, err) =
            haff.run(&[&["run", &scene, "-o", "a.h5", "--overwrite"], &set[..], quiet].concat());
        assert!(!err.contains("warning"), "{err}");
    }
}
