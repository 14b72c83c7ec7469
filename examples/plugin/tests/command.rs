//! The program as its user runs it.

use std::{
    path::{Path, PathBuf},
    process::{Command, Output},
};

fn program(arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_granular-layer"));
    command.current_dir(env!("CARGO_MANIFEST_DIR")).args(arguments);
    command.output().expect("the program starts")
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

/// Runs the program, which must end with exit status 0, and returns what it prints to standard output.
fn passes(arguments: &[&str]) -> String {
    let output = program(arguments);
    assert!(output.status.success(), "{arguments:?}: {}", text(&output.stderr));
    text(&output.stdout)
}

/// A file in a folder of the build.
fn file(name: &str) -> PathBuf {
    let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    let _ = std::fs::remove_file(&path);
    path
}

#[test]
fn a_resumed_run_of_the_scene_ends_like_a_whole_one() {
    let (whole, first, end) = (file("whole.h5"), file("first.h5"), file("end.h5"));
    let hash = |path: &Path| {
        let info = passes(&["info", path.to_str().unwrap(), "--json"]);
        let (_, rest) = info.split_once("\"state_hash\"").expect(&info);
        rest.split('"').nth(1).expect(&info).to_owned()
    };
    passes(&["run", "layer.toml", "--quiet", "-o", whole.to_str().unwrap()]);
    let half = ["--set", "run.collisions=50000"];
    passes(&[&["run", "layer.toml", "--quiet", "-o", first.to_str().unwrap()][..], &half].concat());
    let go_on = ["--quiet", "--set", "run.collisions=100000", "-o", end.to_str().unwrap()];
    passes(&[&["run", "--resume", first.to_str().unwrap()][..], &go_on].concat());
    assert_eq!(hash(&whole), hash(&end));
    assert_ne!(hash(&whole), hash(&first));
}

/// Python's package reads the file: the energies that contacts give and take, one by one.
#[test]
fn every_contact_separates_at_the_speed_of_the_law() {
    let path = file("law.h5");
    passes(&["run", "layer.toml", "--quiet", "-o", path.to_str().unwrap(), "--set", "run.collisions=20000"]);
    let program = "
import sys, haff, numpy as np
f = haff.open(sys.argv[1])
rows = f.events.to_pandas()
u, loss = rows.approach_speed.to_numpy(), rows.energy_loss.to_numpy()
after = 0.9 * u + 2 * 0.1
wrong = abs(loss - 0.25 * (u**2 - after**2)).max()
off = abs(loss.sum() - f.samples['dissipated_energy'][-1])
residual = abs(f.samples['ledger_residual']).max()
print(wrong, off, residual, (loss < 0).mean())
assert wrong < 1e-13 and off < 1e-9 and residual < 1e-13 and 0.1 < (loss < 0).mean() < 0.9
";
    let python = std::env::var("PYTHON").unwrap_or_else(|_| "python3".to_owned());
    let output = Command::new(python).args(["-c", program]).arg(&path).output().expect("Python starts");
    assert!(output.status.success(), "{}{}", text(&output.stdout), text(&output.stderr));
}

#[test]
fn wrong_parameters_are_refused_with_their_keys() {
    for (set, expected) in [
        ("parameters.restitution=1.5", "parameters.restitution=1.5: must be in [0, 1]"),
        ("parameters.added_speed=\"fast\"", "must be 0 or a positive number"),
        ("parameters.added_sped=1.0", "is no parameter of this model: restitution, added_speed"),
        ("parameters={}", "parameters.restitution: missing: this model needs it"),
        ("model=\"viscoelastic\"", "contact.restitution.parameters"),
        ("model=\"gamma\"", "must be one of \"viscoelastic\", \"cutoff\", \"delta\""),
    ] {
        let output = program(&["check", "layer.toml", "--set", &format!("contact.restitution.{set}")]);
        let error = text(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{set}: {error}");
        assert!(error.contains(expected), "{set}: {error}");
    }
    assert!(passes(&["schema"]).contains("\"delta\""));
}
