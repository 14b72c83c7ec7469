//! One run from its scene, or from its file, to its end and report; `haff run` does one, `haff sweep` many.

use std::path::PathBuf;

use haff_engine::{Present, TRAJECTORY_VERSION, Term};
use haff_linkage::AnySimulation;
use haff_record::{Header, RecordError, Recorder};
use haff_scene::{Scene, Schedule};
use serde_json::{Value, json};

use crate::{
    arguments::VERSION,
    controls::Controls,
    failure::{Failure, Status, file_failure, scene_failure, simulation_failure},
    memory::peak_memory,
    output::{self, shown},
    session::{Ending, Outcome, Session},
    states::OwnStates,
    threads,
};

/// A run that has ended, with or without an error.
pub struct Finished {
    /// The run as one JSON object.
    pub report: Value,
    end: End,
}

/// How a run ended.
enum End {
    /// It ran.
    Ran { outcome: Box<Outcome>, context: Context, unwritten: Option<RecordError> },
    /// Its file was complete already.
    Complete(PathBuf),
}

/// Data of the report beside the simulation itself.
struct Context {
    title: String,
    seed: u64,
    file: Option<PathBuf>,
    resumed_from: Option<f64>,
}

/// Runs a scene; `overwrite` replaces its output file.
pub fn start(scene: Scene, overwrite: bool, controls: Controls) -> Result<Finished, Failure> {
    controls.signals.begin();
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
                present: Present { springs: !joints.springs.is_empty(), ..Present::of(&system) },
                ..Header::from_system(&system)
            };
            Some(Recorder::create(path, header, overwrite).map_err(|error| file_failure(&error))?)
        }
        None => None,
    };
    if let Some(path) = &output.file {
        tracing::info!(file = %path.display(), frames = ?output.frames, observables = ?output.observables, "output");
    }
    let simulation =
        AnySimulation::new(system, joints, scene.options).map_err(|error| simulation_failure(&error))?;
    let session =
        Session { simulation, run, output: &output, recorder: recorder.as_ref(), controls, recorded: None };
    let outcome = session.run(false);
    let context = Context { title, seed, file: output.file.clone(), resumed_from: None };
    Ok(Finished::new(outcome, context, recorder))
}

/// Resumes the run in a file.
pub fn resume(path: PathBuf, controls: Controls) -> Result<Finished, Failure> {
    let info = haff_record::info(&path).map_err(|error| file_failure(&error))?;
    if let (true, Some(summary)) = (info.finished, &info.summary) {
        let mut report: Value = serde_json::from_str(summary).map_err(|error| {
            Failure::new(Status::File, format!("{}: summary: {}", output::path(&path), shown(error)))
        })?;
        report["resumed_from"] = report["simulated_time"].clone();
        return Ok(Finished { report, end: End::Complete(path) });
    }
    if info.trajectory_version != TRAJECTORY_VERSION {
        let message = format!(
            "{} was written by haff {} with trajectory version {}, this is version {TRAJECTORY_VERSION}: \
             use that release to go on",
            output::path(&path),
            shown(&info.version),
            info.trajectory_version
        );
        return Err(Failure::new(Status::File, message));
    }
    let name = format!("{} (its scene)", path.display());
    let own = OwnStates(path.clone());
    // The scene was valid when it was stored, so this is an error of the file.
    let scene = haff_scene::parse(&name, &info.scene_toml, &[], &own)
        .map_err(|errors| Failure { status: Status::File, ..scene_failure(&errors) })?;
    let Scene { system, joints, title, seed, run, output, options, .. } = scene;
    // Checked before the file is truncated: one that cannot be resumed is not changed.
    let resumed = haff_record::resumable(&path).map_err(|error| file_failure(&error))?;
    let simulation = AnySimulation::restore(system, joints, options, &resumed.checkpoint)
        .map_err(|error| Failure::new(Status::File, format!("{}: {}", output::path(&path), shown(error))))?;
    tracing::info!(file = %path.display(), from = resumed.last_frame, "resumed");
    controls.signals.begin();
    let (recorder, appended) = Recorder::append(&path).map_err(|error| file_failure(&error))?;
    if (appended.finished, &appended.checkpoint) != (resumed.finished, &resumed.checkpoint) {
        // Another process has resumed it between the two reads.
        return Err(file_failure(&RecordError::InUse { path }));
    }
    let context = Context { title, seed, file: Some(path), resumed_from: Some(simulation.time()) };
    let recorded = resumed.last_frame.map(|time| {
        let counters = simulation.counters();
        (time, counters.collisions + counters.wall_collisions)
    });
    let session = Session { simulation, run, output: &output, recorder: Some(&recorder), controls, recorded };
    let outcome = session.run(true);
    Ok(Finished::new(outcome, context, Some(recorder)))
}

impl Finished {
    /// Writes the summary into the file and closes it.
    fn new(outcome: Outcome, context: Context, recorder: Option<Recorder>) -> Self {
        let mut report = report(&outcome, &context);
        let unwritten = match (recorder, &outcome.ending) {
            (_, Ending::Unwritable(error)) => Some(error.clone()),
            (Some(recorder), ending) => recorder.finish(&report.to_string(), ending.is_final()).err(),
            (None, _) => None,
        };
        if let Some(error) = &unwritten {
            report["stopped"] = json!("output");
            report["error"] = json!(error.to_string());
        }
        Self { report, end: End::Ran { outcome: Box::new(outcome), context, unwritten } }
    }

    /// Whether nothing is left to resume.
    pub fn is_complete(&self) -> bool {
        match &self.end {
            End::Ran { outcome, unwritten, .. } => unwritten.is_none() && outcome.ending.is_final(),
            End::Complete(_) => true,
        }
    }

    /// The exit status of a run that ended as it should.
    pub fn status(&self) -> Result<u8, Failure> {
        let End::Ran { outcome, context, unwritten } = &self.end else { return Ok(0) };
        if let Some(error) = unwritten {
            return Err(file_failure(error));
        }
        match &outcome.ending {
            Ending::Until | Ending::Collisions | Ending::Rest | Ending::WallTime => Ok(0),
            Ending::Signal(signal) => Ok(128 + *signal as u8),
            Ending::Failed(error) => {
                let failure = simulation_failure(error);
                let kept =
                    context.file.as_ref().map(|file| format!("\nrecorded so far: {}", output::path(file)));
                Err(Failure { message: failure.message + &kept.unwrap_or_default(), ..failure })
            }
            Ending::Unwritable(error) => Err(file_failure(error)),
        }
    }

    /// Prints the run in a few lines, unless its file could not be written.
    pub fn print_summary(&self) {
        match &self.end {
            End::Ran { outcome, context, unwritten: None } => print_summary(outcome, context),
            End::Ran { .. } => {}
            End::Complete(path) => {
                output::message(format_args!("{} is complete: nothing to resume", output::path(path)));
            }
        }
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
        "rotational_energy": ledger.rotational,
        "potential_energy": ledger.potential,
        "dissipated_energy": ledger.dissipated,
        "carnot_energy": ledger.carnot,
        "ledger_residual": ledger.residual,
        "max_overlap": simulation.max_overlap(),
        "peak_memory_bytes": peak_memory(),
        "threads": rayon::current_num_threads(),
        "blocks": blocks(outcome),
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
    for term in Term::ALL {
        report[term.name()] = json!(ledger.term(term));
    }
    if let Some(from) = context.resumed_from {
        report["resumed_from"] = json!(from);
    }
    if let Ending::Failed(error) = &outcome.ending {
        report["error"] = json!(error.to_string());
    }
    report
}

/// How many threads have taken the events.
fn blocks(outcome: &Outcome) -> Value {
    let counters = outcome.simulation.counters();
    let (counts, reason) = outcome.simulation.blocks();
    threads::report(&counts, counters.collisions + counters.wall_collisions, reason)
}

/// Prints the run in a few lines.
fn print_summary(outcome: &Outcome, context: &Context) {
    let simulation = &outcome.simulation;
    let (counters, ledger) = (simulation.counters(), simulation.ledger());
    let why = match &outcome.ending {
        Ending::Until => "reached run.until".to_owned(),
        Ending::Collisions => "reached the number of collisions".to_owned(),
        Ending::WallTime => "run.wall_time is used up".to_owned(),
        Ending::Signal(_) => "ended by a signal".to_owned(),
        Ending::Rest => "at rest: there are no further events".to_owned(),
        Ending::Failed(_) => "the simulation cannot continue".to_owned(),
        Ending::Unwritable(_) => "the output cannot be written".to_owned(),
    };
    if !context.title.is_empty() {
        output::message(shown(&context.title));
    }
    output::message(format_args!(
        "{} particles to t = {} in {:.2?}: {why}",
        simulation.particles(),
        simulation.time(),
        outcome.wall
    ));
    let millions = counters.collisions as f64 / outcome.wall.as_secs_f64() / 1e6;
    output::message(format_args!(
        "{} collisions ({millions:.3} M/s), {} wall collisions; ledger residual {:.1e}, largest overlap {:.1e}",
        counters.collisions,
        counters.wall_collisions,
        ledger.residual,
        simulation.max_overlap()
    ));
    let served = blocks(outcome);
    let text = served["text"].as_str().unwrap_or_default();
    output::message(format_args!("threads: {}; {text}", rayon::current_num_threads()));
    let rest = ledger.term(Term::Rest);
    if rest != 0.0 {
        output::message(format_args!(
            "{} times at rest, {} times woken; rest has removed the energy {:.3e}",
            counters.rests, counters.wakes, rest
        ));
    }
    if let Some(file) = &context.file {
        let file = output::path(file);
        output::message(format_args!("wrote {file}"));
        if !outcome.ending.is_final() {
            output::message(format_args!("continue with: haff run --resume {file}"));
        }
    }
}
