//! One run from its scene, or from its file, to its end and report; `haff run` does one, `haff sweep` many.

use std::path::{Path, PathBuf};

use haff_engine::{Ledger, SceneFeatures, System, TRAJECTORY_VERSION};
use haff_linkage::{AnySimulation, Joints};
use haff_record::{Header, RecordError, Recorder, StoredMesh};
use haff_scene::{MeshFile, OutputPlan, Scene, Schedule};
use serde_json::{Value, json};

use crate::{
    running::{
        controls::Controls,
        parts::Parts,
        report::{Context, print_summary, report},
        session::{Ending, Outcome, Recorded, Session},
        states::OwnStates,
    },
    terminal::{
        failure::{Failure, Status, file_failure, scene_failure, simulation_failure},
        output::{self, shown},
    },
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

/// The texts of a scene for its output file.
pub struct Texts {
    pub title: String,
    /// The scene with all values that were chosen.
    pub resolved: String,
    pub seed: u64,
    /// The summary of the run so far; empty if it begins.
    pub earlier: String,
    /// The triangles of its walls.
    pub meshes: Vec<StoredMesh>,
}

/// The meshes of a scene as files have them.
pub fn stored(meshes: Vec<MeshFile>) -> Vec<StoredMesh> {
    meshes.into_iter().map(|MeshFile { corners, hash }| StoredMesh { hash, corners }).collect()
}

/// Creates the output file of a scene, if it has one. `ledger`: that of the run so far.
pub fn create(
    output: &OutputPlan,
    system: &System,
    joints: &Joints,
    texts: Texts,
    ledger: &Ledger,
    overwrite: bool,
) -> Result<Option<Recorder>, Failure> {
    let Some(path) = &output.file else { return Ok(None) };
    let header = Header {
        title: texts.title,
        scene_toml: texts.resolved,
        seed: texts.seed,
        version: env!("CARGO_PKG_VERSION").to_owned(),
        git_revision: env!("HAFF_GIT_REVISION").to_owned(),
        trajectory_version: TRAJECTORY_VERSION,
        frames: output.frames != Schedule::Off,
        observables: output.observables != Schedule::Off,
        events: output.events.clone(),
        compressed: output.compressed,
        present: SceneFeatures { springs: !joints.springs.is_empty(), ..SceneFeatures::of(system) }
            .with_terms(ledger),
        earlier: texts.earlier,
        meshes: texts.meshes,
        conserved_momentum: joints.conserved_momentum(system),
        ..Header::from_system(system)
    };
    let recorder = Recorder::create(path, header, overwrite).map_err(|error| file_failure(&error))?;
    tracing::info!(file = %path.display(), frames = ?output.frames, observables = ?output.observables, "output");
    Ok(Some(recorder))
}

/// Runs a scene; `overwrite` replaces its output file.
pub fn start(scene: Scene, overwrite: bool, controls: Controls) -> Result<Finished, Failure> {
    controls.signals.begin();
    let Scene { system, joints, title, seed, run, output, resolved, meshes, .. } = scene;
    let texts =
        Texts { title: title.clone(), resolved, seed, earlier: String::new(), meshes: stored(meshes) };
    let recorder = create(&output, &system, &joints, texts, &Ledger::default(), overwrite)?;
    let simulation =
        AnySimulation::new(system, joints, scene.options).map_err(|error| simulation_failure(&error))?;
    let recorded = Recorded::default();
    let session =
        Session { simulation, run, output: &output, recorder: recorder.as_ref(), controls, recorded };
    let outcome = session.run(false);
    let context = Context {
        title,
        seed,
        file: output.file.clone(),
        resumed_from: None,
        continues: None,
        parts: Parts::default(),
    };
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
    check_version(&path, &info.version, info.trajectory_version)?;
    let scene = stored_scene(&path, &info.scene_toml)?;
    let Scene { system, joints, title, seed, run, output, options, .. } = scene;
    // Checked before the file is truncated: one that cannot be resumed is not changed.
    let resumed = haff_record::resumable(&path).map_err(|error| file_failure(&error))?;
    resumed.require(&path, &Header::from_system(&system)).map_err(|error| file_failure(&error))?;
    let simulation = AnySimulation::restore(system, joints, options, &resumed.checkpoint)
        .map_err(|error| Failure::new(Status::File, format!("{}: {}", output::path(&path), shown(error))))?;
    tracing::info!(file = %path.display(), from = resumed.last_frame, "resumed");
    controls.signals.begin();
    let parts = Parts::before(&resumed);
    let (recorder, appended) = Recorder::append(&path).map_err(|error| file_failure(&error))?;
    if (appended.finished, &appended.checkpoint) != (resumed.finished, &resumed.checkpoint) {
        // Another process has resumed it between the two reads.
        return Err(file_failure(&RecordError::InUse { path }));
    }
    let context = Context {
        title,
        seed,
        file: Some(path),
        resumed_from: Some(simulation.time()),
        continues: None,
        parts,
    };
    let recorded = Recorded { frame: resumed.last_frame, sample: resumed.last_sample };
    let session = Session { simulation, run, output: &output, recorder: Some(&recorder), controls, recorded };
    let outcome = session.run(true);
    Ok(Finished::new(outcome, context, Some(recorder)))
}

/// Fails if a file was written by a version whose trajectories have other bits.
pub fn check_version(path: &Path, version: &str, trajectory_version: u32) -> Result<(), Failure> {
    if trajectory_version == TRAJECTORY_VERSION {
        return Ok(());
    }
    let message = format!(
        "{} was written by haff {} with trajectory version {trajectory_version}, this is version \
         {TRAJECTORY_VERSION}: use that release to go on",
        output::path(path),
        shown(version),
    );
    Err(Failure::new(Status::File, message))
}

/// The scene of a file.
pub fn stored_scene(path: &Path, scene: &str) -> Result<Scene, Failure> {
    let name = format!("{} (its scene)", path.display());
    // The scene was valid when it was stored, so this is an error of the file.
    haff_scene::parse_recorded(&name, scene, &[], &OwnStates(path.to_owned()))
        .map_err(|errors| Failure { status: Status::File, ..scene_failure(&errors) })
}

impl Finished {
    /// Writes the summary into the file and closes it.
    pub fn new(outcome: Outcome, context: Context, recorder: Option<Recorder>) -> Self {
        let mut report = report(&outcome, &context);
        let unwritten = match (recorder, &outcome.ending) {
            (_, Ending::Unwritable(error)) => Some(error.clone()),
            (Some(recorder), ending) => recorder.finish(&report.to_string(), ending.is_final()).err(),
            (None, _) => None,
        };
        if let Some(error) = &unwritten {
            report["stopped"] = json!("output");
            report["error"] = json!(file_failure(error).message);
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
            Ending::Until
            | Ending::Collisions
            | Ending::PackingFraction
            | Ending::ReducedPressure
            | Ending::Box
            | Ending::Rest
            | Ending::WallTime => Ok(0),
            Ending::Jammed(why) => {
                let kept =
                    context.file.as_ref().map(|file| format!("\nrecorded so far: {}", output::path(file)));
                Err(Failure::new(Status::Stopped, why.clone() + &kept.unwrap_or_default()))
            }
            Ending::Signal(signal) => Ok(128 + *signal as u8),
            Ending::Failed(error) => {
                let failure = simulation_failure(error);
                let kept =
                    context.file.as_ref().map(|file| format!("\nrecorded so far: {}", output::path(file)));
                let message = outcome.told(&failure.message);
                Err(Failure { message: message + &kept.unwrap_or_default(), ..failure })
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
