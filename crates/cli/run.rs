//! `haff run`.

use std::path::PathBuf;

use haff_engine::{Fault, TRAJECTORY_VERSION};
use haff_linkage::{Machine, MachineError};
use haff_record::{Header, RecordError, Recorder};
use haff_scene::{ErrorKind, Scene, SceneErrors, Schedule};
use serde_json::{Value, json};

use crate::{
    arguments::{Run, VERSION},
    failure::{Failure, Status},
    info::{OwnStates, States},
    output,
    session::{Ending, Outcome, Session},
    signals::Signals,
};

/// A scene's errors as a failure of the command.
pub fn scene_failure(errors: &SceneErrors) -> Failure {
    let status = match errors.kind() {
        ErrorKind::Invalid => Status::Invalid,
        ErrorKind::Unreadable => Status::File,
    };
    Failure::new(status, errors)
}

/// A file's error as a failure of the command.
pub fn file_failure(error: &RecordError) -> Failure {
    Failure::new(Status::File, error)
}

/// Runs a scene, or goes on with one.
/// `logs` tells that lines are told on standard error, where a bar would be in their way.
pub fn run(options: &Run, logs: bool) -> Result<u8, Failure> {
    set_threads(options.threads)?;
    let signals = Signals::watch()
        .map_err(|error| Failure::new(Status::File, format!("cannot watch for signals: {error}")))?;
    match (&options.resume, &options.scene) {
        (Some(file), _) => resume(options, file.clone(), logs, &signals),
        (None, Some(scene)) => {
            let mut scene =
                haff_scene::load(scene, &options.set, &States).map_err(|errors| scene_failure(&errors))?;
            if let Some(output) = &options.output {
                scene.output.file = Some(output.clone());
            }
            start(options, scene, logs, &signals)
        }
        (None, None) => Err(Failure::new(Status::Invalid, "a scene file is needed")),
    }
}

/// The number of threads of everything that rayon does.
pub fn set_threads(threads: Option<u16>) -> Result<(), Failure> {
    let mut pool = rayon::ThreadPoolBuilder::new();
    if let Some(threads) = threads {
        pool = pool.num_threads(threads.into());
    }
    pool.build_global().map_err(|error| Failure::new(Status::Invalid, format!("--threads: {error}")))
}

fn start(options: &Run, scene: Scene, logs: bool, signals: &Signals) -> Result<u8, Failure> {
    let Scene { system, joints, title, seed, run, output, resolved, .. } = scene;
    let recorder = match &output.file {
        Some(path) => {
            let header = Header {
                title: title.clone(),
                scene_toml: resolved,
                seed,
                version: env!("CARGO_PKG_VERSION").to_owned(),
                git_revision: env!("HAFF_GIT_REVISION").to_owned(),
                trajectory_version: TRAJECTORY_VERSION,
                frames: output.frames != Schedule::Off,
                observables: output.observables != Schedule::Off,
                events: output.events.clone(),
                compressed: output.compressed,
                has_springs: !joints.springs.is_empty(),
                ..Header::from_system(&system)
            };
            Some(Recorder::create(path, header, options.overwrite).map_err(|error| file_failure(&error))?)
        }
        None => None,
    };
    if let Some(path) = &output.file {
        tracing::info!(file = %path.display(), frames = ?output.frames, observables = ?output.observables, "output");
    }
    let simulation = Machine::new(system, joints, scene.options).map_err(|error| machine_failure(&error))?;
    let session = Session {
        simulation,
        run,
        output: &output,
        recorder: recorder.as_ref(),
        signals,
        bar: !options.quiet && !logs,
        watch: options.watch,
        recorded: None,
    };
    let outcome = session.run(false);
    conclude(
        options,
        &outcome,
        &Context { title, seed, file: output.file.clone(), resumed_from: None },
        recorder,
    )
}

fn resume(options: &Run, path: PathBuf, logs: bool, signals: &Signals) -> Result<u8, Failure> {
    let info = haff_record::info(&path).map_err(|error| file_failure(&error))?;
    if let (true, Some(summary)) = (info.finished, &info.summary) {
        let mut report: Value = serde_json::from_str(summary)
            .map_err(|error| Failure::new(Status::File, format!("{}: summary: {error}", path.display())))?;
        report["resumed_from"] = report["simulated_time"].clone();
        if !options.quiet {
            output::tell(format_args!("{} is complete: nothing to resume", path.display()));
        }
        return if options.json { output::line(report).map(|()| 0) } else { Ok(0) };
    }
    if info.trajectory_version != TRAJECTORY_VERSION {
        let message = format!(
            "{} was written by haff {} with trajectory version {}, this is version {TRAJECTORY_VERSION}: \
             use that release to go on",
            path.display(),
            info.version,
            info.trajectory_version
        );
        return Err(Failure::new(Status::File, message));
    }
    let name = format!("{} (its scene)", path.display());
    let own = OwnStates(path.clone());
    let scene =
        haff_scene::parse(&name, &info.scene_toml, &[], &own).map_err(|errors| scene_failure(&errors))?;
    let Scene { system, joints, title, seed, run, output, options: machinery, .. } = scene;
    let (recorder, resumed) = Recorder::append(&path).map_err(|error| file_failure(&error))?;
    tracing::info!(file = %path.display(), from = resumed.last_frame, "resumed");
    let simulation = Machine::restore(system, joints, machinery, &resumed.checkpoint)
        .map_err(|error| Failure::new(Status::File, format!("{}: {error}", path.display())))?;
    let context = Context { title, seed, file: Some(path), resumed_from: Some(simulation.time()) };
    let recorded = resumed.last_frame.map(|time| {
        let counters = simulation.counters();
        (time, counters.collisions + counters.wall_collisions)
    });
    let session = Session {
        simulation,
        run,
        output: &output,
        recorder: Some(&recorder),
        signals,
        bar: !options.quiet && !logs,
        watch: options.watch,
        recorded,
    };
    let outcome = session.run(true);
    conclude(options, &outcome, &context, Some(recorder))
}

/// What stops a simulation, or forbids it, as a failure of the command.
pub fn machine_failure(error: &MachineError) -> Failure {
    let status = match error.fault() {
        Fault::Invalid => Status::Invalid,
        Fault::Checkpoint => Status::File,
        Fault::Stopped => Status::Stopped,
    };
    Failure::new(status, error)
}

/// What the report says beside the simulation itself.
struct Context {
    title: String,
    seed: u64,
    file: Option<PathBuf>,
    resumed_from: Option<f64>,
}

/// Writes the summary, prints the report, and finds the exit status.
fn conclude(
    options: &Run,
    outcome: &Outcome,
    context: &Context,
    recorder: Option<Recorder>,
) -> Result<u8, Failure> {
    let mut report = report(outcome, context);
    let unwritten = match (recorder, &outcome.ending) {
        (_, Ending::Unwritable(error)) => Some(error.clone()),
        (Some(recorder), ending) => recorder.finish(&report.to_string(), ending.is_final()).err(),
        (None, _) => None,
    };
    if let Some(error) = &unwritten {
        report["stopped"] = json!("output");
        report["error"] = json!(error.to_string());
    }
    // How the run went matters more than who reads about it.
    let printed = if options.json { output::line(report) } else { Ok(()) };
    if let Some(error) = unwritten {
        return Err(file_failure(&error));
    }
    if !options.quiet {
        tell(outcome, context);
    }
    match &outcome.ending {
        Ending::Until | Ending::Collisions | Ending::Rest | Ending::WallTime => printed.map(|()| 0),
        Ending::Signal(signal) => Ok(128 + *signal as u8),
        Ending::Failed(error) => {
            let failure = machine_failure(error);
            let kept = context.file.as_ref().map(|file| format!("\nrecorded so far: {}", file.display()));
            Err(Failure { message: failure.message + &kept.unwrap_or_default(), ..failure })
        }
        Ending::Unwritable(error) => Err(file_failure(error)),
    }
}

/// The run as one JSON object.
fn report(outcome: &Outcome, context: &Context) -> Value {
    let simulation = &outcome.simulation;
    let counters = simulation.counters();
    let ledger = simulation.ledger();
    let seconds = outcome.wall.as_secs_f64();
    let mut report = json!({
        "title": context.title,
        "stopped": outcome.ending.word(),
        "particles": simulation.particles(),
        "collisions": counters.collisions,
        "wall_collisions": counters.wall_collisions,
        "events": counters.collisions + counters.wall_collisions,
        "rests": counters.rests,
        "wakes": counters.wakes,
        "simulated_time": simulation.time(),
        "wall_seconds": seconds,
        "collisions_per_second": counters.collisions as f64 / seconds,
        "kinetic_energy": ledger.kinetic,
        "potential_energy": ledger.potential,
        "dissipated_energy": ledger.dissipated,
        "carnot_energy": ledger.carnot,
        "wall_work": ledger.wall_work,
        "rest_energy": ledger.rest,
        "ledger_residual": ledger.residual,
        "max_overlap": simulation.max_overlap(),
        "peak_memory_bytes": peak_memory(),
        "threads": rayon::current_num_threads(),
        "neighbors": simulation.search(),
        "seed": context.seed,
        "version": VERSION,
        "trajectory_version": TRAJECTORY_VERSION,
        "state_hash": simulation.state_hash(),
        "counters": {
            "predictions": counters.predictions,
            "stale": counters.stale,
            "dropped": counters.dropped,
            "transfers": counters.transfers,
            "candidates": counters.candidates,
            "windows": counters.windows,
            "epochs": counters.epochs,
        },
        "file": context.file.as_ref().map(|file| file.display().to_string()),
    });
    if let Some(from) = context.resumed_from {
        report["resumed_from"] = json!(from);
    }
    if let Ending::Failed(error) = &outcome.ending {
        report["error"] = json!(error.to_string());
    }
    report
}

/// The run in a few lines for people.
fn tell(outcome: &Outcome, context: &Context) {
    let simulation = &outcome.simulation;
    let (counters, ledger) = (simulation.counters(), simulation.ledger());
    let why = match &outcome.ending {
        Ending::Until => "reached run.until".to_owned(),
        Ending::Collisions => "reached the number of collisions".to_owned(),
        Ending::WallTime => "run.wall_time is used up".to_owned(),
        Ending::Signal(_) => "ended by a signal".to_owned(),
        Ending::Rest => "at rest: nothing will happen any more".to_owned(),
        Ending::Failed(_) => "the simulation cannot go on".to_owned(),
        Ending::Unwritable(_) => "the output cannot be written".to_owned(),
    };
    if !context.title.is_empty() {
        output::tell(&context.title);
    }
    output::tell(format_args!(
        "{} particles to t = {} in {:.2?}: {why}",
        simulation.particles(),
        simulation.time(),
        outcome.wall
    ));
    let millions = counters.collisions as f64 / outcome.wall.as_secs_f64() / 1e6;
    output::tell(format_args!(
        "{} collisions ({millions:.3} M/s), {} wall collisions; ledger residual {:.1e}, largest overlap {:.1e}",
        counters.collisions,
        counters.wall_collisions,
        ledger.residual,
        simulation.max_overlap()
    ));
    if counters.rests > 0 {
        output::tell(format_args!(
            "{} times put to rest, {} times woken; rest has taken the energy {:.3e}",
            counters.rests, counters.wakes, ledger.rest
        ));
    }
    if let Some(file) = &context.file {
        output::tell(format_args!("wrote {}", file.display()));
        if !outcome.ending.is_final() {
            output::tell(format_args!("go on with: haff run --resume {}", file.display()));
        }
    }
}

/// Largest resident memory so far [bytes].
pub fn peak_memory() -> Option<u64> {
    // Linux counts in getrusage what the process was before it became this program, such as a large parent.
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let peak = status.lines().find_map(|line| line.strip_prefix("VmHWM:")?.trim().strip_suffix(" kB"));
    if let Some(kibibytes) = peak.and_then(|peak| peak.trim().parse::<u64>().ok()) {
        return Some(kibibytes * 1024);
    }
    let usage = nix::sys::resource::getrusage(nix::sys::resource::UsageWho::RUSAGE_SELF).ok()?;
    // Linux counts in KiB, macOS in bytes.
    let unit = if cfg!(target_os = "macos") { 1 } else { 1024 };
    u64::try_from(usage.max_rss()).ok().map(|size| size * unit)
}
