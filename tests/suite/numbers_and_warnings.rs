//! Numbers in text for users, and warnings: a gas that will cluster, and records at one phase.

use serde_json::Value;

use crate::common::{GAS, Haff, config};

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
fn walls_on_which_bounces_end_in_hops_are_named() {
    let haff = Haff::new();
    let hops = |scene: &str, sets: &[&str]| {
        let scene = config(scene);
        let (status, out, err) = haff.run(&[&["check", &scene, "--json"][..], sets].concat());
        assert_eq!(status, 0, "{err}");
        serde_json::from_str::<Value>(&out).unwrap()["hops"].clone()
    };
    assert_eq!(hops("drum.toml", &[]), serde_json::json!(["drum"]));
    for sets in [["--set", "contact.rest_speed=0.1"], ["--set", "domain.gravity=[0,0,0]"]] {
        assert_eq!(hops("drum.toml", &sets), serde_json::json!([]), "{sets:?}");
    }
    // On a level floor at rest series are completed in closed form.
    let floor = "textbook/bouncing_ball.toml";
    assert_eq!(hops(floor, &[]), serde_json::json!([]));
    let (_, out, _) = haff.run(&["check", &config("drum.toml")]);
    assert!(out.contains("bounces             on drum they end in hops"), "{out}");
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

/// The report of `haff check --json`.
fn checked(haff: &Haff, arguments: &[&str]) -> Value {
    let (status, out, err) = haff.run(&[&["check", "--json"], arguments].concat());
    assert_eq!(status, 0, "{err}");
    serde_json::from_str(&out).unwrap()
}

#[test]
fn temperature_and_collision_rate_are_those_of_velocities_relative_to_the_flow() {
    let haff = Haff::new();
    let scene = config("sheared_gas.toml");
    let sheared = checked(&haff, &[&scene]);
    let still = checked(&haff, &[&scene, "--set", "domain.shear.rate=1e-300"]);
    for key in ["temperature", "collision_rate", "mean_free_time"] {
        let [a, b] = [&sheared, &still].map(|report| report[key].as_f64().unwrap());
        // Adding the flow rounds velocities.
        assert!((a / b - 1.0).abs() < 1e-12, "{key}: sheared {a}, at rest {b}");
    }
    assert!((sheared["temperature"].as_f64().unwrap() - 4.0).abs() < 1e-12, "{sheared}");
}

#[test]
fn a_collision_rate_is_left_out_where_the_theory_does_not_hold_and_the_reason_is_told() {
    let haff = Haff::new();
    let post = "\n[[particle]]\nname = \"post\"\nposition = [1.0, 1.0, 1.0]\nradius = 0.1\nmass = inf\n";
    haff.write(
        "posts.toml",
        &(GAS.replace("temperature = 1.0", "temperature = 1.0\npositions = \"random\"") + post),
    );
    for (arguments, reason) in [
        (vec![config("gravity_box.toml")], "an axis is open"),
        (vec![config("breakshot.toml")], "particles placed one by one are no homogeneous gas"),
        (vec!["posts.toml".to_owned()], "the arrangement of bodies of infinite mass decides it"),
        (vec![config("stress/fcc_073.toml")], "the packing fraction is above that of freezing"),
        (
            vec![config("fluid.toml"), "--set".into(), "initial.temperature=0".into()],
            "nothing moves at the start",
        ),
    ] {
        let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
        let report = checked(&haff, &arguments);
        assert!(report["collision_rate"].is_null() && report["mean_free_time"].is_null(), "{report}");
        assert_eq!(report["collision_rate_unknown"], reason);
        let (_, out, _) = haff.run(&[&["check"], &arguments[..]].concat());
        assert!(out.contains(&format!("collision rate      unknown: {reason}")), "{out}");
    }
    assert!(checked(&haff, &[&config("fluid.toml")])["collision_rate_unknown"].is_null());
}

#[test]
fn records_at_one_phase_of_an_oscillation_get_a_warning() {
    let haff = Haff::new();
    let scene = config("vibrated_gas.toml");
    let warnings = |set: &[&str]| checked(&haff, &[&[scene.as_str()], set].concat())["warnings"].clone();
    assert_eq!(warnings(&[]).as_array().unwrap().len(), 0);
    let strobed = ["--set", "output.frames=20", "--set", "output.observables=0.75"];
    let found = warnings(&strobed);
    let text = found[0].as_str().unwrap();
    assert!(text.contains("the same phase of the oscillation of wall \"z-\", whose period is 0.5"), "{text}");
    assert!(text.ends_with("such as output.frames = 19.8, output.observables = 0.809"), "{text}");
    // The suggested intervals get none.
    assert_eq!(
        warnings(&["--set", "output.frames=19.8", "--set", "output.observables=0.809"]).to_string(),
        "[]"
    );
    let (status, _, err) =
        haff.run(&[&["run", &scene, "-o", "a.h5", "--set", "run.until=80"], &strobed[..]].concat());
    assert!(status == 0 && err.starts_with("warning: records are always taken"), "{err}");
    // Profiles spread their states, if there are enough of them.
    let profile =
        |more: &str| format!("measure.profiles=[{{ axis = \"z\", bins = 4, interval = 5.0{more} }}]");
    let of = |more: &str| warnings(&["--set", &profile(more)]).to_string();
    assert_eq!(of(""), "[]");
    assert!(of(", samples = 2").contains("samples = 2: too few states"), "{}", of(", samples = 2"));
    assert!(of(", spread = false").contains("measure.profiles.0.interval = "), "{}", of(", spread = false"));
    // A drive that changes the temperature noticeably between two of its actions.
    let gas = config("cooling.toml");
    let driven = |interval: &str| {
        let drive = format!("drive=[{{ kind = \"rescale\", temperature = 1.0, interval = {interval} }}]");
        let sets = ["--set", &drive, "--set", "output.observables=2.0", "--set", "output.frames=false"];
        checked(&haff, &[&[gas.as_str()], &sets[..]].concat())["warnings"].to_string()
    };
    assert!(driven("1.0").contains("the same phase of the drive"), "{}", driven("1.0"));
    assert_eq!(driven("0.01"), "[]");
}
