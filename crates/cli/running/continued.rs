//! `haff run --resume FILE --set KEY=VALUE -o NEW`: a run goes on with changed keys, in a new file.

use std::path::Path;

use haff_engine::{EventRecord, Instant, Observer};
use haff_linkage::AnySimulation;
use haff_scene::{CHANGEABLE, Present, RunPlan, Scene, UntilOf};

use crate::{
    arguments::Run,
    running::{
        controls::Controls,
        parts::Parts,
        report::Context,
        session::{Recorded, Session},
        single::{self, Finished, Texts},
        states::OwnStates,
    },
    terminal::{
        failure::{Failure, Status, file_failure, scene_failure, simulation_failure},
        output, overwrite,
    },
};

/// The parts of a scene with joints that may change in a run that goes on.
const CHANGEABLE_WITH_JOINTS: [&str; 4] = ["engine", "output", "run", "title"];

/// Keeps the rows of events of the change.
#[derive(Default)]
struct Rows(Vec<EventRecord>);

impl Observer for Rows {
    fn wants_events(&self) -> bool {
        true
    }

    fn event(&mut self, event: &EventRecord) {
        self.0.push(*event);
    }
}

/// Goes on from the last checkpoint of a file, complete or not, with the keys of `--set`, in the file `new`.
pub fn start(file: &Path, new: &Path, options: &Run, controls: Controls) -> Result<Finished, Failure> {
    let resumed = haff_record::resumable(file).map_err(|error| file_failure(&error))?;
    single::check_version(file, &resumed.version, resumed.trajectory_version)?;
    let old = single::stored_scene(file, &resumed.scene_toml)?;
    let (name, text) = (format!("{} (its scene)", file.display()), &resumed.scene_toml);
    let states = OwnStates(file.to_owned());
    let changeable = if old.joints.is_empty() { &CHANGEABLE[..] } else { &CHANGEABLE_WITH_JOINTS[..] };
    let old_system = old.system.clone();
    let engine = match engine_keys(&options.set) {
        keys if keys.is_empty() => old.options,
        // Before all others: the present state is needed for them.
        keys => {
            haff_scene::parse_recorded(&name, text, &keys, &states).map_err(|e| scene_failure(&e))?.options
        }
    };
    let mut simulation = AnySimulation::restore(old.system, old.joints.clone(), engine, &resumed.checkpoint)
        .map_err(|error| within(file, &simulation_failure(&error)))?;
    let present = match &simulation {
        AnySimulation::Granular(granular) => Present::of(granular),
        AnySimulation::Linkage(_) => {
            let (at, walls) = (Instant::at(simulation.time()), old_system.walls.clone());
            Present { at, walls, fixed: Vec::new() }
        }
    };
    let scene = haff_scene::parse_changed(&name, text, &options.set, changeable, &states, &present)
        .map_err(|errors| scene_failure(&errors))?;
    let inputs = [
        ("the file that the run goes on from", Some(file)),
        ("the state that the scene starts from", scene.state_file.as_deref()),
    ];
    overwrite::check(new, &inputs, options.overwrite)?;
    let Scene { system, joints, title, seed, run, mut output, resolved, meshes, .. } = scene;
    output.file = Some(new.to_owned());
    let same = system == old_system && joints == old.joints;
    drop(old_system);
    check_end(&run, &simulation)?;
    if !options.quiet {
        output::warnings(&haff_linkage::warnings(&system, &joints));
    }
    let mut rows = Rows::default();
    let header = system.clone();
    if !same {
        match &mut simulation {
            AnySimulation::Granular(granular) if joints.is_empty() => granular
                .change_system(system, &mut rows)
                .map_err(|error| simulation_failure(&error.into()))?,
            _ => {
                let message = "a run cannot go on with other pendulums, springs, rods or sticking contacts";
                return Err(Failure::new(Status::Invalid, message));
            }
        }
    }
    controls.signals.begin();
    let parts = Parts::before(&resumed);
    let texts = Texts {
        title: title.clone(),
        resolved,
        seed,
        earlier: parts.summary(),
        meshes: single::stored(meshes),
    };
    let recorder = single::create(&output, &header, &joints, texts, &simulation.ledger(), options.overwrite)?;
    drop(header);
    if let (Some(recorder), false) = (&recorder, rows.0.is_empty()) {
        recorder.events(rows.0).map_err(|error| file_failure(&error))?;
    }
    let context = Context {
        title,
        seed,
        file: Some(new.to_owned()),
        resumed_from: Some(simulation.time()),
        continues: Some(file.to_owned()),
        parts,
    };
    let recorded = Recorded::default();
    let session =
        Session { simulation, run, output: &output, recorder: recorder.as_ref(), controls, recorded };
    let outcome = session.run(false);
    Ok(Finished::new(outcome, context, recorder))
}

/// The failure with the name of the file.
fn within(file: &Path, failure: &Failure) -> Failure {
    Failure::new(failure.status, format!("{}: {}", output::path(file), failure.message))
}

/// The keys of `[engine]`.
fn engine_keys(set: &[String]) -> Vec<String> {
    let is_engine = |key: &str| key == "engine" || key.starts_with("engine.");
    set.iter()
        .filter(|given| is_engine(given.split('=').next().unwrap_or_default().trim()))
        .cloned()
        .collect()
}

/// Refuses an end that the run has reached.
fn check_end(run: &RunPlan, simulation: &AnySimulation) -> Result<(), Failure> {
    let (time, done) = (simulation.time(), simulation.counters().collisions);
    let reached = match (run.until, run.collisions) {
        (Some(until), _) if until <= time => Some(match run.until_of {
            UntilOf::Run => format!("run.until = {until}: the run is at t = {time}"),
            UntilOf::PackingFraction => "growth.until_packing_fraction: the run is there".to_owned(),
            UntilOf::Box => format!("the box cannot become smaller: the run is at t = {time}"),
        }),
        (_, Some(collisions)) if collisions <= done => {
            Some(format!("run.collisions = {collisions}: the run has {done}"))
        }
        _ => None,
    };
    match reached {
        Some(what) => Err(Failure::new(Status::Invalid, format!("{what} already; set a later end"))),
        None => Ok(()),
    }
}
