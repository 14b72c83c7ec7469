//! `haff bench`: the requested cells, with the engine of `haff run`.

use std::{
    io::{BufRead, BufReader, Read},
    process::Stdio,
};

use nix::{
    sys::signal::{Signal, kill},
    unistd::Pid,
};
use serde_json::Value;

use crate::common::{GAS, Haff, PROMISED, config};

const STANDARD: [&str; 5] = ["fluid", "cooling", "mixture", "gravity", "disks"];

fn bench(haff: &Haff, arguments: &[&str]) -> Value {
    haff.report(&[&["bench"], arguments].concat())
}

#[test]
fn a_cell_reports_all_promised_keys() {
    let haff = Haff::new();
    let report = bench(&haff, &["--n", "500", "--phi", "0.2", "--collisions", "2000", "--threads", "1"]);
    for key in PROMISED {
        assert!(!report[key].is_null(), "{key} in {report}");
    }
    assert_eq!((&report["particles"], &report["n"]), (&500.into(), &500.into()));
    assert_eq!((&report["collisions"], &report["events"]), (&2000.into(), &2000.into()));
    assert_eq!((&report["scene"], &report["stopped"]), (&"fluid".into(), &"collisions".into()));
    assert_eq!(report["threads"], 1);
    // Ten collisions for each of 500 particles, twenty per particle, before the timing.
    assert_eq!(report["melt_collisions"], 5000);
    assert_eq!(report["total"]["collisions"], 7000);
    assert_eq!(report["phi"], 0.2);
    // The edge of the box is rounded.
    assert!((report["packing_fraction"].as_f64().unwrap() - 0.2).abs() < 1e-14, "{report}");
    let (rate, seconds) =
        (report["collisions_per_second"].as_f64().unwrap(), report["wall_seconds"].as_f64().unwrap());
    assert!((rate * seconds / 2000.0 - 1.0).abs() < 1e-12, "{rate}/s for {seconds} s");
    for counter in ["predictions", "stale", "dropped", "transfers"] {
        let (count, each) = (&report["counters"][counter], &report["per_collision"][counter]);
        assert!((count.as_f64().unwrap() / 2000.0 - each.as_f64().unwrap()).abs() < 1e-12, "{counter}");
    }
    // Each collision requires at least the first predictions of two partners.
    assert!(report["per_collision"]["predictions"].as_f64().unwrap() > 1.0, "{report}");
    assert!(report["max_overlap"].as_f64().unwrap() <= 1e-12, "{report}");
    assert!(haff.path(".").read_dir().unwrap().next().is_none(), "a benchmark writes no file");
}

#[test]
fn a_cell_equals_the_run_of_its_printed_scene() {
    let haff = Haff::new();
    for scene in STANDARD {
        let cell = ["--scene", scene, "--n", "200", "--collisions", "300", "--repeats", "2", "--melt", "4"];
        let report = bench(&haff, &cell);
        let (status, text, err) = haff.run(&[&["bench", "--print-scene"], &cell[..]].concat());
        assert_eq!(status, 0, "{err}");
        let file = haff.write("cell.toml", &text);
        let run = haff.report(&["run", &file]);
        assert_eq!(run["collisions"], 400 + 600, "{scene}: 4·200/2 to melt and 2·300 to time");
        assert_eq!(run["state_hash"], report["state_hash"], "{scene}");
        assert_eq!(run["collisions"], report["total"]["collisions"], "{scene}");
        assert_eq!(run["wall_collisions"], report["total"]["wall_collisions"], "{scene}");
        assert_eq!(run["neighbors"], report["neighbors"], "{scene}: the same engine, chosen the same way");
        assert_eq!(report["repeats"], 2);
    }
}

#[test]
fn lists_of_values_give_separate_cells_in_order() {
    let haff = Haff::new();
    let all =
        ["--n", "100,1_03", "--phi", "0.1,0.3", "--collisions", "1e2", "--threads", "1,2", "--seed", "9"];
    let reports = bench(&haff, &all);
    let cells: Vec<_> = reports.as_array().expect("an array").iter().collect();
    let found: Vec<_> = cells
        .iter()
        .map(|cell| {
            (cell["n"].as_u64().unwrap(), cell["phi"].as_f64().unwrap(), cell["threads"].as_u64().unwrap())
        })
        .collect();
    let mut expected = Vec::new();
    for n in [100, 103] {
        for phi in [0.1, 0.3] {
            expected.extend([(n, phi, 1), (n, phi, 2)]);
        }
    }
    assert_eq!(found, expected);
    for pair in cells.chunks(2) {
        assert_eq!(pair[0]["state_hash"], pair[1]["state_hash"], "threads change no trajectory");
        assert_eq!((&pair[0]["seed"], &pair[0]["collisions"]), (&9.into(), &100.into()));
    }
    assert_ne!(cells[0]["state_hash"], cells[2]["state_hash"]);
    // A cell run in its own process equals the cell requested alone.
    let alone =
        bench(&haff, &["--n", "103", "--phi", "0.3", "--collisions", "100", "--threads", "1", "--seed", "9"]);
    assert_eq!(alone["state_hash"], cells[6]["state_hash"]);
}

#[test]
fn search_and_kernel_options_change_no_bit() {
    let haff = Haff::new();
    let cell = ["--n", "150", "--collisions", "500"];
    let cells = bench(&haff, &[&cell[..], &["--neighbors", "cells", "--simd", "portable"]].concat());
    let pairs = bench(&haff, &[&cell[..], &["--neighbors", "all_pairs"]].concat());
    assert_eq!((&cells["neighbors"], &pairs["neighbors"]), (&"cells".into(), &"all_pairs".into()));
    assert_eq!(cells["state_hash"], pairs["state_hash"]);
    let seeded = bench(&haff, &[&cell[..], &["--seed", "2"]].concat());
    assert_ne!(cells["state_hash"], seeded["state_hash"], "another seed is another gas");
}

#[test]
fn several_searches_are_cells_of_their_own_in_csv_with_machine_and_date() {
    let haff = Haff::new();
    let (status, out, err) = haff.run(&[
        "bench",
        "--n",
        "108,150",
        "--neighbors",
        "cells,lists",
        "--collisions",
        "100",
        "--csv",
        "-q",
    ]);
    assert_eq!(status, 0, "{err}");
    let rows: Vec<Vec<&str>> = out.lines().map(|line| line.split(',').collect()).collect();
    let column = |name: &str| rows[0].iter().position(|head| *head == name).expect(name);
    let found: Vec<_> = rows[1..].iter().map(|row| (row[column("n")], row[column("neighbors")])).collect();
    assert_eq!(found, [("108", "cells"), ("108", "lists"), ("150", "cells"), ("150", "lists")]);
    for row in &rows[1..] {
        assert_eq!(row.len(), rows[0].len(), "{row:?}");
        assert!(row[column("collisions_per_second")].parse::<f64>().unwrap() > 0.0);
        assert!(row[column("date")].ends_with('Z') && row[column("date")].starts_with("20"), "{row:?}");
        assert!(row[column("processors")].parse::<u32>().unwrap() >= 1);
    }
    assert_eq!(rows[1][column("state_hash")], rows[2][column("state_hash")]);
}

#[test]
fn memory_per_particle_is_without_that_of_the_program() {
    let haff = Haff::new();
    let report = bench(&haff, &["--n", "100,20000", "--collisions", "10", "--melt", "0"]);
    for cell in report.as_array().expect("two cells") {
        let value = |key: &str| cell[key].as_f64().unwrap_or_else(|| panic!("{key} in {cell}"));
        let own = (value("peak_memory_bytes") - value("process_bytes")) / value("n");
        assert!((value("bytes_per_particle") / own - 1.0).abs() < 1e-12, "{cell}");
        assert!(cell["machine"]["processors"].as_u64() >= Some(1), "{cell}");
        assert!(cell["date"].is_string(), "{cell}");
    }
    // Peak over number was 90,000 bytes for 100 particles.
    assert!(report[1]["bytes_per_particle"].as_f64().unwrap() < 1000.0, "{report}");
}

#[test]
fn two_builds_are_measured_in_turn() {
    let haff = Haff::new();
    let other = env!("CARGO_BIN_EXE_haff");
    let cells = ["--n", "108,150", "--collisions", "200", "--against", other, "--repeats", "3"];
    let reports = bench(&haff, &cells);
    assert_eq!(reports.as_array().map(Vec::len), Some(2));
    for report in reports.as_array().unwrap() {
        assert_eq!((&report["rounds"], &report["same_trajectory"]), (&3.into(), &true.into()), "{report}");
        let rates = |side: &str| -> Vec<f64> {
            let rounds = report[side]["collisions_per_second_rounds"].as_array().expect("rates of rounds");
            rounds.iter().map(|rate| rate.as_f64().unwrap()).collect()
        };
        let (this, with) = (rates("this"), rates("other"));
        let mut ratios: Vec<f64> = this.iter().zip(&with).map(|(this, with)| this / with).collect();
        ratios.sort_by(f64::total_cmp);
        assert_eq!(report["ratio"].as_f64(), Some(ratios[1]));
        assert!(report["ratio_error"].as_f64() > Some(0.0), "{report}");
        assert_eq!(report["other"]["program"], other);
    }
    let (status, out, err) = haff.run(&[&["bench", "-q"], &cells[..]].concat());
    assert_eq!((status, out.lines().count()), (0, 3), "{err}");
    assert!(out.lines().next().is_some_and(|head| head.contains("ratio") && head.contains("error")), "{out}");
    let (status, _, err) = haff.run(&["bench", "--n", "108", "--against", "./no-such-haff"]);
    assert!(status == 4 && err.contains("no-such-haff"), "{err}");
}

#[test]
fn the_benchmark_of_a_scene_file_equals_its_run() {
    let haff = Haff::new();
    let scene = haff.write("gas.toml", GAS);
    let run = haff.report(&["run", &scene, "-o", "gas.h5"]);
    let whole = bench(&haff, &["--scene", &scene]);
    for key in
        ["state_hash", "collisions", "wall_collisions", "particles", "stopped", "simulated_time", "seed"]
    {
        assert_eq!(whole[key], run[key], "{key}");
    }
    let part = bench(&haff, &["--scene", &scene, "--melt", "2", "--collisions", "1000"]);
    assert_eq!((&part["melt_collisions"], &part["collisions"]), (&500.into(), &1000.into()));
    let set = bench(&haff, &["--scene", &scene, "--set", "species.0.count=108", "--collisions", "50"]);
    assert_eq!(set["n"], 108);
    // Spheres never collide here: there are only wall collisions.
    let ball = bench(&haff, &["--scene", &config("textbook/bouncing_ball.toml")]);
    assert!(ball["collisions"] == 0 && ball["events"].as_u64() > Some(0), "{ball}");
}

#[test]
fn table_goes_to_standard_output_and_progress_to_standard_error() {
    let haff = Haff::new();
    let cells = ["bench", "--n", "100,200", "--collisions", "100"];
    let (status, out, err) = haff.run(&cells);
    assert_eq!(status, 0, "{err}");
    let lines: Vec<_> = out.lines().collect();
    assert!(lines.len() == 3 && lines[0].contains("M coll/s") && lines[0].contains("stale"), "{out}");
    for (line, n) in [(lines[1], "100"), (lines[2], "200")] {
        let words: Vec<_> = line.split_whitespace().collect();
        assert_eq!(&words[..3], ["fluid", n, "0.1"], "{line}");
    }
    assert!(err.contains("N = 200") && err.contains("melting") && !err.contains("stale"), "{err}");
    assert_eq!(haff.run(&[&cells[..], &["--quiet"]].concat()).2, "");
}

#[test]
fn the_standard_scenes_are_listed() {
    let (status, out, _) = Haff::new().run(&["bench", "--list"]);
    let names: Vec<_> = out.lines().filter_map(|line| line.split_whitespace().next()).collect();
    assert_eq!(status, 0);
    assert_eq!(names, STANDARD);
}

#[test]
fn invalid_cells_are_errors_with_exit_status_2() {
    let haff = Haff::new();
    let gas = haff.write("gas.toml", GAS);
    let cases: [(&[&str], &str); 15] = [
        (&["--scene", "flud"], "the standard scenes are\nerror: fluid"),
        (&["--n", "1"], "at least 2"),
        (&["--n", "1.5"], "whole number"),
        (&["--n", "-5"], "whole number"),
        (&["--n", ""], "whole number"),
        (&["--phi", "0"], "in (0, 1)"),
        (&["--phi", "nan"], "in (0, 1)"),
        (&["--n", "100", "--phi", "0.1,0.75"], "--phi 0.75: must be at most 0.7404"),
        (&["--n", "10", "--phi", "0.74"], "the lattice has room for"),
        (&["--collisions", "0"], "at least 1"),
        (&["--neighbors", "magic"], "possible values"),
        (&["--scene", &gas, "--n", "100"], "--n is for the standard scenes"),
        (&["--scene", &gas, "--repeats", "2"], "needs --collisions"),
        (&["--scene", &gas, "--melt", "1e6"], "nothing left to time"),
        (&["--print-scene", "--n", "100,200"], "prints one scene; 2 are asked for"),
    ];
    for (arguments, expected) in cases {
        let (status, out, err) = haff.run(&[&["bench"], arguments].concat());
        assert_eq!(status, 2, "{arguments:?}: {err}");
        assert!(
            err.contains(expected) && err.contains("error: "),
            "{arguments:?}: {err}\nexpected {expected}"
        );
        assert!(out.is_empty() && !err.contains("panicked"), "{arguments:?}: {out}{err}");
    }
    let (status, _, err) = haff.run(&["bench", "--scene", "missing.toml"]);
    assert!(status == 4 && err.contains("missing.toml"), "{err}");
}

#[test]
fn cells_measured_before_a_failure_are_reported() {
    let haff = Haff::new();
    let (status, out, err) =
        haff.run(&["bench", "--n", "108,10", "--phi", "0.74", "--collisions", "50", "--json", "-q"]);
    assert_eq!(status, 2, "{err}");
    let reports: Value = serde_json::from_str(&out).unwrap();
    assert_eq!(reports.as_array().unwrap().len(), 1, "{out}");
    assert_eq!(reports[0]["n"], 108);
    assert!(err.contains("the lattice has room for"), "{err}");
}

#[test]
fn peak_memory_excludes_the_parent_process() {
    let haff = Haff::new();
    // Initialized, so that it is resident while the command is started.
    let ballast = std::hint::black_box(vec![1_u8; 256 << 20]);
    let report = bench(&haff, &["--n", "100", "--collisions", "10"]);
    let peak = report["peak_memory_bytes"].as_u64().unwrap();
    assert!(peak < 128 << 20, "{peak} bytes for 100 particles beside {} in the parent", ballast.len());
}

#[test]
fn a_signal_ends_all_cells_and_finished_cells_are_reported() {
    let haff = Haff::new();
    let endless = ["bench", "--n", "100,200", "--collisions", "1e12", "--json"];
    let mut child = haff
        .command(&endless)
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("the command starts");
    let progress = BufReader::new(child.stderr.take().unwrap());
    assert!(
        progress.lines().map_while(Result::ok).any(|line| line.contains("timing")),
        "the timing has not started"
    );
    kill(Pid::from_raw(child.id() as i32), Signal::SIGTERM).unwrap();
    let mut out = String::new();
    child.stdout.take().unwrap().read_to_string(&mut out).unwrap();
    assert_eq!(child.wait().unwrap().code(), Some(143));
    let reports: Value = serde_json::from_str(&out).unwrap();
    assert_eq!(reports.as_array().unwrap().len(), 1, "the second cell never starts: {out}");
    assert_eq!((&reports[0]["stopped"], &reports[0]["n"]), (&"signal".into(), &100.into()));
}
