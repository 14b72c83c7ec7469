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

/// A change of a scene with which it is not valid, and a part of the message.
fn refuses(scene: &str, set: &str, expected: &str) {
    let output = program(&["check", scene, "--set", set]);
    let error = text(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{set}: {error}");
    assert!(error.contains(expected), "{set}: {error}");
}

/// A file in a folder of the build.
fn file(name: &str) -> PathBuf {
    let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    let _ = std::fs::remove_file(&path);
    path
}

/// Runs a scene in one go and in two.
fn ends_alike(scene: &str, [half, whole_set]: [&str; 2]) {
    let name = |part: &str| file(&format!("{scene}_{part}.h5"));
    let (whole, first, end) = (name("whole"), name("first"), name("end"));
    let hash = |path: &Path| {
        let info = passes(&["info", path.to_str().unwrap(), "--json"]);
        let (_, rest) = info.split_once("\"state_hash\"").expect(&info);
        rest.split('"').nth(1).expect(&info).to_owned()
    };
    let run = |path: &Path, set: &str| {
        passes(&["run", scene, "--quiet", "-o", path.to_str().unwrap(), "--set", set]);
    };
    run(&whole, whole_set);
    run(&first, half);
    let go_on = ["--quiet", "--set", whole_set, "-o", end.to_str().unwrap()];
    passes(&[&["run", "--resume", first.to_str().unwrap()][..], &go_on].concat());
    assert_eq!(hash(&whole), hash(&end));
    assert_ne!(hash(&whole), hash(&first));
}

/// Runs a program in Python, with the package of haff, on a file.
fn python(path: &Path, program: &str) {
    let python = std::env::var("PYTHON").unwrap_or_else(|_| "python3".to_owned());
    let output = Command::new(python).args(["-c", program]).arg(path).output().expect("Python starts");
    assert!(output.status.success(), "{}{}", text(&output.stdout), text(&output.stderr));
}

#[test]
fn a_resumed_run_of_a_scene_ends_like_a_whole_one() {
    ends_alike("layer.toml", ["run.collisions=50000", "run.collisions=100000"]);
    ends_alike("flow.toml", ["run.until=7.3", "run.until=20.0"]);
    ends_alike("ring.toml", ["run.until=17.0", "run.until=60.0"]);
}

/// Python's package reads the file: the energies that contacts give and take, one by one.
#[test]
fn every_contact_separates_at_the_speed_of_the_law() {
    let path = file("law.h5");
    passes(&["run", "layer.toml", "--quiet", "-o", path.to_str().unwrap(), "--set", "run.collisions=20000"]);
    python(
        &path,
        "
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
",
    );
}

/// The columns of the probe, with their units, against frames and events.
#[test]
fn the_columns_of_the_probe_are_in_the_file() {
    let path = file("flow.h5");
    let name = path.to_str().unwrap();
    passes(&["run", "flow.toml", "--quiet", "-o", name, "--set", "run.until=30.0"]);
    python(
        &path,
        "
import sys, haff, h5py, numpy as np
run = haff.open(sys.argv[1])
samples = run.samples
time = samples['time']
flow = np.stack([samples['flow_amplitude_0'], samples['flow_amplitude_1']], axis=1)
for frame in run.frames:
    phase = 2 * np.pi * frame.position[:, 1] / 20
    along = [2 * np.mean(frame.velocity[:, 0] * f(phase)) for f in (np.cos, np.sin)]
    assert np.allclose(flow[time == frame.time][0], along, rtol=0, atol=1e-14), frame.time
rows = run.events.to_pandas()
impulse = rows.impulse[rows.kind == 'collision'].sum()
exchanged = samples['exchanged_momentum'].sum()
assert abs(exchanged - 2 * impulse) < 1e-11 * exchanged and exchanged > 1000, (exchanged, impulse)
assert abs(samples['ledger_residual']).max() < 1e-13
assert samples['drive_work'][-1] > 1
# The force keeps the flow: along the cosine, not along the sine.
late = flow[time > 10]
assert late[:, 0].min() > 0.3 and abs(late[:, 1]).max() < 0.3, late
with h5py.File(sys.argv[1]) as file:
    units = [file['observables/' + name].attrs['unit'] for name in ('flow_amplitude', 'exchanged_momentum')]
assert units == ['length/time', 'mass length/time'], units
from haff import figures
panels = figures.draw(run, 'probes').axes
assert [len(panel.lines) for panel in panels] == [2, 1]
assert '[length/time]' in panels[0].get_ylabel() and np.array_equal(panels[1].lines[0].get_xdata(), time)
",
    );
}

/// Inside of the torus all the time, and with the energy and the angular momentum about its axis.
#[test]
fn grains_stay_in_the_surface_and_keep_what_its_symmetry_keeps() {
    let path = file("ring.h5");
    passes(&["run", "ring.toml", "--quiet", "-o", path.to_str().unwrap()]);
    python(
        &path,
        "
import sys, haff, numpy as np
run = haff.open(sys.argv[1])
center = np.array([7.0, 7.0, 2.0])
def middle(position):
    r = position - center
    ring = np.hypot(r[:, 0], r[:, 1])
    return np.hypot(ring - 5.0, r[:, 2])
turning = []
for frame in run.frames:
    assert middle(frame.position).max() <= 1.8 - 0.2 + 1e-14
    (x, y, _), (u, v, _) = (frame.position - center).T, frame.velocity.T
    turning.append((x * v - y * u).sum())
scale = 200 * 5.0
assert np.ptp(turning) < 1e-12 * scale, turning
samples = run.samples
assert np.ptp(samples['kinetic_energy']) < 1e-12 * samples['kinetic_energy'][0]
rows = run.events.to_pandas()
wall = rows[rows.kind == 'wall']
assert len(wall) > 20_000
contact = wall[['position_x', 'position_y', 'position_z']].to_numpy()
assert abs(middle(contact) - 1.8).max() < 1e-12
haff.figures.draw(run, 'snapshot')
",
    );
}

#[test]
fn wrong_surfaces_drives_and_probes_are_refused_with_their_keys() {
    for (set, expected) in [
        ("wall.pipe.parameters.pipe=6.0", "wall.0.parameters.pipe = 6.0: must be below ring"),
        ("wall.pipe.surface=\"cone\"", "must be one of these surfaces: \"torus\""),
        ("wall.pipe.rotation={ rate = 1.0 }", "would sweep through the particles"),
        ("domain.boundary=[\"wall\", \"wall\", \"periodic\"]", "does not repeat with the box along z"),
        ("wall.pipe.sticks=true", "nothing sticks to a wall of this shape"),
    ] {
        refuses("ring.toml", set, expected);
    }
    for (set, expected) in [
        ("drive.0.kind=\"stirrer\"", ", \"kolmogorov\""),
        ("drive.0.parameters.wavelength=0.0", "drive.0.parameters.wavelength=0.0: must be a positive number"),
        ("drive.0.rate=1.0", "a drive of kind \"kolmogorov\" has no rate, but parameters"),
        (
            "drive.0.kind=\"andersen\"",
            "a drive of kind \"andersen\" has no parameters, but temperature, rate",
        ),
        ("measure.probes.0.kind=\"heat\"", "must be one of these probes: \"flow\""),
        ("measure.probes.0.parameters={}", "wavelength: missing: this model needs it"),
        ("measure.probes.0.wavelength=20.0", "measure.probes.0.wavelength"),
        (
            "measure.probes=[{ kind = \"flow\", parameters = { wavelength = 1.0 } }, \
             { kind = \"flow\", parameters = { wavelength = 2.0 } }]",
            "its column \"flow_amplitude\" has the name of another column",
        ),
    ] {
        refuses("flow.toml", set, expected);
    }
    let schema = passes(&["schema"]);
    assert!(schema.contains("\"kolmogorov\"") && schema.contains("\"flow\""));
}

#[test]
fn wrong_parameters_are_refused_with_their_keys() {
    for (set, expected) in [
        ("parameters.restitution=1.5", "parameters.restitution=1.5: must be in [0, 1]"),
        ("parameters.added_speed=\"fast\"", "must be 0 or a positive number"),
        ("parameters.added_sped=1.0", "is no parameter of this model: restitution, added_speed"),
        ("parameters={}", "parameters.restitution: missing: this model needs it"),
        ("model=\"viscoelastic\"", "contact.restitution.parameters"),
        ("model=\"gamma\"", ", \"delta\""),
    ] {
        refuses("layer.toml", &format!("contact.restitution.{set}"), expected);
    }
    assert!(passes(&["schema"]).contains("\"delta\""));
}
