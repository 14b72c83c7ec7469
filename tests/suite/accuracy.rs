//! `haff bench --accuracy`: the tables and their JSON, and refused options.

use serde_json::Value;

use crate::common::Haff;

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().expect("an array").iter().map(|x| x.as_f64().unwrap_or(f64::NAN)).collect()
}

#[test]
#[ignore = "long: scripts/test all"]
fn quick_report_shows_haff_at_rounding_and_other_methods_with_larger_errors() {
    let haff = Haff::new();
    // With a peer that refuses every scene: this is reported, and the peer is omitted.
    let answer = r#"{"error": "spheres are not supported"}"#;
    let script = haff.write("peer.sh", &format!("while read -r line; do printf '%s\\n' '{answer}'; done\n"));
    let peer = format!("shell=sh {script}");
    let (status, out, err) = haff.run(&["bench", "--accuracy", "--quick", "--json", "--peer", &peer]);
    assert_eq!(status, 0, "{err}");
    assert!(err.contains("shell: spheres are not supported"), "{err}");
    assert!(!out.contains("\"method\":\"shell\""), "{out}");
    let report: Value = serde_json::from_str(&out).expect("one JSON object");
    let scenes = report["scenes"].as_array().unwrap();
    let names: Vec<_> = scenes.iter().map(|scene| scene["name"].as_str().unwrap()).collect();
    assert_eq!(names, ["ball", "billiard", "oblique", "chain", "gas"]);
    for scene in scenes {
        let trials = scene["trials"].as_array().unwrap();
        let error = |name: &str| {
            let errors = trials.iter().filter(|trial| trial["method"] == name).map(|trial| &trial["error"]);
            errors.map(|error| error.as_f64().unwrap()).fold(f64::INFINITY, f64::min)
        };
        // Four collisions per particle in a gas amplify rounding by about 2^15; errors of other scenes do not
        // grow.
        let bound = if scene["name"] == "gas" { 1e-9 } else { 1e-11 };
        assert!(error("haff") < bound, "{}: {}", scene["name"], error("haff"));
        assert!(error("fixed step") > 1e-4, "{}: {}", scene["name"], error("fixed step"));
        assert!(error("soft spheres") > 1e-4, "{}: {}", scene["name"], error("soft spheres"));
        assert!(err.contains(scene["description"].as_str().unwrap()), "also on standard error: {err}");
    }
    for quantity in report["statistics"].as_array().unwrap() {
        let ours = &quantity["estimates"][0];
        assert_eq!(ours["method"], "haff");
        let [off, error] =
            ["relative_error", "relative_standard_error"].map(|key| ours[key].as_f64().unwrap());
        // Few runs: the estimate of their scatter is poor, so six standard errors; and less than 2 %.
        assert!(off.abs() < 6.0 * error + 1e-3 && error < 2e-2, "{}: {off} ± {error}", quantity["name"]);
    }
    for gas in report["growth"].as_array().unwrap() {
        assert_eq!(gas["identical"], true, "{}", gas["machineries"]);
        let haff = &gas["kinds"]["haff"];
        assert!(haff["bits_per_collision"]["mean"].as_f64().unwrap() > 1.0, "chaos: {haff}");
        for run in haff["runs"].as_array().unwrap() {
            let (collisions, deviation) =
                (numbers(&run["collisions_per_particle"]), numbers(&run["deviation"]));
            assert!(collisions.is_sorted() && deviation[0] < 1e-9, "{run}");
        }
    }
}

#[test]
fn options_of_the_speed_benchmark_are_refused() {
    let haff = Haff::new();
    for option in
        [["--n", "100"], ["--phi", "0.1"], ["--scene", "fluid"], ["--melt", "3"], ["--repeats", "2"]]
    {
        let (status, _, err) = haff.run(&[&["bench", "--accuracy"], &option[..]].concat());
        assert_eq!(status, 2, "{err}");
        assert!(err.contains(option[0]) && err.contains("--accuracy"), "{err}");
    }
    for option in [&["--quick"][..], &["--peer", "a=b"]] {
        let (status, _, err) = haff.run(&[&["bench"], option].concat());
        assert_eq!(status, 2, "{err}");
        assert!(err.contains("--accuracy"), "{err}");
    }
}

#[test]
fn error_names_a_peer_that_cannot_start() {
    let haff = Haff::new();
    let (status, _, err) = haff.run(&["bench", "--accuracy", "--peer", "missing=./no-such-program"]);
    assert_eq!(status, 2, "{err}");
    assert!(err.contains("missing: cannot start ./no-such-program"), "{err}");
    let (status, _, err) = haff.run(&["bench", "--accuracy", "--peer", "missing"]);
    assert_eq!(status, 2, "{err}");
    assert!(err.contains("NAME=COMMAND"), "{err}");
}
