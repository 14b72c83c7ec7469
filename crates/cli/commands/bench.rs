//! `haff bench`: collisions per second of the engine that `haff run` uses, on standard scenes or on any scene
//! file.
//!
//! A cell is a scene file in memory, processed as every scene: text, [`haff_scene::Scene`], engine. Several
//! cells run one after the other, each in a separate process, so that peak memory, allocator and thread pool
//! are not shared.

mod accuracy;
mod against;
mod csv;
mod measure;
mod report;
mod scenes;

use std::{
    io::Read,
    os::unix::process::ExitStatusExt,
    path::Path,
    process::{Child, Command, Stdio},
    time::Duration,
};

use measure::{Outcome, Plan, Source};
use nix::{
    sys::signal::{Signal, kill},
    unistd::Pid,
};
use serde_json::Value;

use crate::{
    arguments::Bench,
    commands::run::set_threads,
    running::session::Ending,
    terminal::{
        failure::{Failure, Status, simulation_failure},
        output::{self, shown},
        signals::{Signals, end_with_this_process},
    },
};

/// Default number of particles of a standard scene.
const PARTICLES: u64 = 32_000;

/// One combination of the given values.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Cell<'a> {
    n: Option<u64>,
    phi: Option<f64>,
    threads: Option<u16>,
    neighbors: Option<&'a str>,
}

/// Measures the cells given by the options.
pub fn bench(options: &Bench) -> Result<u8, Failure> {
    if options.list {
        return output::line(scenes::list()).map(|()| 0);
    }
    if options.accuracy {
        return accuracy::accuracy(options);
    }
    check(options)?;
    let cells = cells(options);
    if options.print_scene {
        return print_scene(options, &cells);
    }
    let signals = Signals::watch()?;
    signals.begin();
    if let Some(other) = &options.against {
        return against::against(options, other, &cells, &signals);
    }
    match cells[..] {
        [cell] => measure_here(options, cell, &signals),
        _ => measure_in_children(options, &cells, &signals),
    }
}

/// Rejects options that are invalid for all cells, before the first one runs.
fn check(options: &Bench) -> Result<(), Failure> {
    let invalid = |message: String| Err(Failure::new(Status::Invalid, message));
    if let Some(standard) = scenes::find(&options.scene) {
        return options.phi.iter().try_for_each(|&phi| standard.check(phi).or_else(invalid));
    }
    if !Path::new(&options.scene).exists() && !options.scene.contains(['/', '.']) {
        return invalid(format!(
            "--scene {}: no such scene or file; the standard scenes are\n{}",
            shown(&options.scene),
            scenes::list()
        ));
    }
    for (option, given) in [("--n", !options.n.is_empty()), ("--phi", !options.phi.is_empty())] {
        if given {
            return invalid(format!(
                "{option} is for the standard scenes; change a scene file by --set, such as --set species.0.count=4000"
            ));
        }
    }
    if options.seed.is_some() {
        return invalid("--seed is for the standard scenes; use --set seed=…".to_owned());
    }
    if options.repeats.unwrap_or(1) > 1 && options.against.is_none() && options.collisions.is_none() {
        return invalid("--repeats of a scene file needs --collisions, the length of each".to_owned());
    }
    Ok(())
}

/// Every combination, particles slowest.
fn cells(options: &Bench) -> Vec<Cell<'_>> {
    fn each<T>(values: &[T]) -> Vec<Option<&T>> {
        if values.is_empty() { vec![None] } else { values.iter().map(Some).collect() }
    }
    let mut cells = Vec::new();
    for n in each(&options.n) {
        for phi in each(&options.phi) {
            for threads in each(&options.threads) {
                cells.extend(each(&options.neighbors).into_iter().map(|neighbors| Cell {
                    n: n.copied(),
                    phi: phi.copied(),
                    threads: threads.copied(),
                    neighbors: neighbors.map(String::as_str),
                }));
            }
        }
    }
    cells
}

/// What a cell measures.
fn plan<'a>(options: &'a Bench, cell: Cell<'_>) -> Plan<'a> {
    let source = match scenes::find(&options.scene) {
        Some(scene) => Source::Standard {
            scene,
            n: cell.n.unwrap_or(PARTICLES),
            phi: cell.phi.unwrap_or(scene.phi),
            seed: options.seed.unwrap_or(1),
        },
        None => Source::File(Path::new(&options.scene)),
    };
    let mut set = options.set.clone();
    for (key, value) in [("neighbors", cell.neighbors), ("simd", options.simd.as_deref())] {
        set.extend(value.iter().map(|value| format!("engine.{key}=\"{value}\"")));
    }
    set.extend(options.blocks.map(|blocks| format!("engine.blocks={blocks}")));
    Plan {
        source,
        collisions: options.collisions,
        melt: options.melt,
        repeats: options.repeats.unwrap_or(1),
        set,
    }
}

fn print_scene(options: &Bench, cells: &[Cell<'_>]) -> Result<u8, Failure> {
    let &[cell] = cells else {
        let message = format!("--print-scene prints one scene; {} are asked for", cells.len());
        return Err(Failure::new(Status::Invalid, message));
    };
    output::print(plan(options, cell).scene()?.resolved).map(|()| 0)
}

/// Measures a cell in this process.
fn measure_here(options: &Bench, cell: Cell<'_>, signals: &Signals) -> Result<u8, Failure> {
    set_threads(cell.threads)?;
    let announce = |what: &str| {
        if !options.quiet {
            output::message(format_args!("{}: {what}", name(options, cell)));
        }
    };
    let measured = match plan(options, cell).measure(signals, announce)? {
        Outcome::Measured(measured) => measured,
        Outcome::Interrupted(signal) => return Ok(128 + signal as u8),
    };
    let phi = scenes::find(&options.scene).map(|standard| cell.phi.unwrap_or(standard.phi));
    let report = report::report(&measured, &options.scene, phi);
    if options.json {
        output::line(report)?;
    } else if options.csv {
        csv::print(&[report])?;
    } else {
        output::lines(format_args!("{}\n{}", report::head(), report::line(&report)))?;
    }
    match &measured.ending {
        Ending::Signal(signal) => Ok(128 + *signal as u8),
        Ending::Failed(error) => Err(simulation_failure(error)),
        _ => Ok(0),
    }
}

/// A cell in words.
fn name(options: &Bench, cell: Cell<'_>) -> String {
    let mut parts = vec![shown(&options.scene)];
    if let Some(standard) = scenes::find(&options.scene) {
        parts.push(format!("N = {}", cell.n.unwrap_or(PARTICLES)));
        parts.push(format!("φ = {}", cell.phi.unwrap_or(standard.phi)));
    }
    parts.extend(cell.threads.map(|threads| format!("threads = {threads}")));
    parts.extend(cell.neighbors.map(str::to_owned));
    parts.join(", ")
}

/// Measures each cell in a separate process.
fn measure_in_children(options: &Bench, cells: &[Cell<'_>], signals: &Signals) -> Result<u8, Failure> {
    let program = std::env::current_exe()
        .map_err(|error| Failure::new(Status::File, format!("this program is not known: {error}")))?;
    let mut reports = Vec::new();
    let mut status = 0;
    for &cell in cells {
        let (code, report) = child(&program, options, cell, options.repeats.unwrap_or(1), signals)?;
        if let Some(report) = report {
            if !options.json && !options.csv {
                if reports.is_empty() {
                    output::line(report::head())?;
                }
                output::lines(report::line(&report))?;
            }
            reports.push(report);
        }
        // The child has printed the reason.
        status = code;
        if status != 0 {
            break;
        }
    }
    if options.json {
        output::line(Value::Array(reports))?;
    } else if options.csv {
        csv::print(&reports)?;
    }
    Ok(status)
}

/// Runs `haff bench` of a program for one cell; its exit status and its report.
fn child(
    program: &Path,
    options: &Bench,
    cell: Cell<'_>,
    repeats: u32,
    signals: &Signals,
) -> Result<(u8, Option<Value>), Failure> {
    let failed = |why: &dyn std::fmt::Display| {
        Failure::new(
            Status::File,
            format!("{}: cannot measure {}: {why}", output::path(program), name(options, cell)),
        )
    };
    let mut command = Command::new(program);
    command.arg("bench").arg("--json").arg(format!("--scene={}", options.scene));
    command.arg(format!("--repeats={repeats}"));
    let mut pass = |option: &str, value: Option<String>| {
        if let Some(value) = value {
            command.arg(format!("--{option}={value}"));
        }
    };
    pass("n", cell.n.map(|n| n.to_string()));
    pass("phi", cell.phi.map(|phi| phi.to_string()));
    pass("threads", cell.threads.map(|threads| threads.to_string()));
    pass("collisions", options.collisions.map(|count| count.to_string()));
    pass("melt", options.melt.map(|melt| melt.to_string()));
    pass("seed", options.seed.map(|seed| seed.to_string()));
    pass("neighbors", cell.neighbors.map(str::to_owned));
    pass("simd", options.simd.clone());
    pass("blocks", options.blocks.map(|blocks| blocks.to_string()));
    for set in &options.set {
        pass("set", Some(set.clone()));
    }
    if options.quiet {
        command.arg("--quiet");
    }
    let command = end_with_this_process(&mut command).stdout(Stdio::piped());
    let mut child = command.spawn().map_err(|error| failed(&error))?;
    let _kept_open = child.stdin.take();
    // Read meanwhile: the buffer of a pipe is small.
    let mut printed = child.stdout.take();
    let reader = std::thread::spawn(move || {
        let mut bytes = Vec::new();
        printed.as_mut().map_or(Ok(0), |pipe| pipe.read_to_end(&mut bytes)).map(|_| bytes)
    });
    wait(&mut child, signals).map_err(|error| failed(&error))?;
    let status = child.wait().map_err(|error| failed(&error))?;
    let bytes = reader.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic));
    let report: Option<Value> = serde_json::from_slice(&bytes.map_err(|error| failed(&error))?).ok();
    // A failure has been printed by the child.
    let report = report.filter(|report| !Failure::is_json(report));
    let code = status.code().unwrap_or_else(|| 128 + status.signal().unwrap_or(0));
    match (code, &report) {
        (0, None) => Err(failed(&"it gave no report")),
        _ => Ok((code as u8, report)),
    }
}

/// Waits for a child to end, and forwards a signal to it.
fn wait(child: &mut Child, signals: &Signals) -> std::io::Result<()> {
    let mut forwarded = false;
    while child.try_wait()?.is_none() {
        if let (Some(signal), false) = (signals.received(), forwarded) {
            forwarded = true;
            let signal = Signal::try_from(signal).unwrap_or(Signal::SIGTERM);
            // The child may have ended meanwhile.
            let _ = kill(Pid::from_raw(child.id() as i32), signal);
        }
        std::thread::sleep(Duration::from_millis(20));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn standard_scenes_have_the_given_number_of_particles_and_packing_fraction() {
        for standard in &scenes::STANDARD {
            // 1,003 fills no lattice: sites stay vacant.
            for (n, phi) in [(1003, standard.phi), (1003, 0.01)] {
                let text = standard.scene(n, phi, 3, 77);
                let scene = haff_scene::parse(standard.name, &text, &[], &haff_scene::NoStates)
                    .unwrap_or_else(|errors| panic!("{}: {errors}\n{text}", standard.name));
                assert_eq!(scene.system.bodies.len() as u64, n, "{}", standard.name);
                let off = scene.packing_fraction / phi - 1.0;
                assert!(
                    off.abs() < 1e-12,
                    "{}: φ = {}, requested {phi}",
                    standard.name,
                    scene.packing_fraction
                );
                assert_eq!((scene.seed, scene.run.collisions), (3, Some(77)));
                assert_eq!(scene.output.file, None, "a benchmark writes nothing");
            }
        }
    }

    #[test]
    fn mixture_has_half_of_its_volume_in_large_grains() {
        let text = scenes::find("mixture").unwrap().scene(10_010, 0.2, 1, 1);
        let scene = haff_scene::parse("mixture", &text, &[], &haff_scene::NoStates).unwrap();
        let volume = |radius: f64| {
            let of = |body: &&haff_engine::Body| scene.system.classes[body.class as usize].radius == radius;
            scene.system.bodies.iter().filter(of).count() as f64 * radius.powi(3)
        };
        assert_eq!(volume(0.5), volume(5.0));
    }
}
