//! Keys of the scene that change while a simulation goes on.

use glam::DVec3;
use haff_engine::{EngineError, EventColumn, Observer, SceneFeatures as Features, Simulation, System};
use haff_record::RecordError;
use haff_scene::{Present, Scene, SceneErrors};

use crate::scenes::Files;

/// Keys that may change, with those below them.
const CHANGEABLE: [&str; 3] = ["contact", "domain.gravity", "wall"];

/// What follows from the scene, and changes with its keys.
pub struct Described {
    /// The scene with every default written out, as TOML.
    pub resolved: String,
    pub gravity: DVec3,
    pub wall_names: Vec<String>,
    /// The observables that exist.
    pub present: Features,
    /// Whether the event log has impulse vectors, and tangential losses.
    pub extra_columns: [bool; 2],
}

impl Described {
    pub fn of(system: &System, resolved: String, springs: bool) -> Self {
        Self {
            resolved,
            gravity: system.domain.gravity,
            wall_names: system.walls.iter().map(|wall| wall.name.clone()).collect(),
            present: Features { springs, ..Features::of(system) },
            extra_columns: [EventColumn::ImpulseVector, EventColumn::TangentialLoss]
                .map(|column| column.exists(system)),
        }
    }

    /// Of the same simulation with changed keys; what existed before does so still.
    fn changed(&self, system: &System, resolved: String) -> Self {
        let mut next = Self::of(system, resolved, false);
        for (term, before) in next.present.terms.iter_mut().zip(self.present.terms) {
            *term |= before;
        }
        for (column, before) in next.extra_columns.iter_mut().zip(self.extra_columns) {
            *column |= before;
        }
        next
    }
}

/// Why keys cannot change.
pub enum Refused {
    Scene(SceneErrors),
    Engine(EngineError),
    Record(RecordError),
    Other(&'static str),
}

impl From<SceneErrors> for Refused {
    fn from(errors: SceneErrors) -> Self {
        Self::Scene(errors)
    }
}

impl From<EngineError> for Refused {
    fn from(error: EngineError) -> Self {
        Self::Engine(error)
    }
}

/// Changes keys of a simulation; `overrides` are `KEY=VALUE`, `files` has the state it started from. Its
/// particles may be others than those of the scene. Also returns whether anything has changed: otherwise
/// the run goes on as it is, as with the command.
pub fn change(
    simulation: &mut Simulation,
    described: &Described,
    name: &str,
    overrides: &[String],
    files: &Files,
    observer: &mut dyn Observer,
) -> Result<(Described, bool), Refused> {
    let (text, present) = (&described.resolved, Present::of(simulation));
    let Scene { system: new, joints, resolved, .. } =
        haff_scene::parse_changed(name, text, overrides, &CHANGEABLE, files, &present)?;
    if !joints.is_empty() {
        return Err(Refused::Other("contacts cannot become sticking in a run that goes on"));
    }
    let mut system = simulation.present_system()?;
    (system.walls, system.contacts, system.domain.gravity) = (new.walls, new.contacts, new.domain.gravity);
    match (&mut system.spin, new.spin) {
        (Some(spin), Some(new)) => (spin.pair, spin.wall) = (new.pair, new.wall),
        (None, None) => {}
        _ => return Err(Refused::Other("spin cannot appear or vanish in a live simulation")),
    }
    let next = described.changed(&system, resolved);
    let of = |system: &System| {
        let System { walls, contacts, spin, domain, .. } = system;
        let laws = spin.as_ref().map(|spin| (spin.pair.clone(), spin.wall.clone()));
        (walls.clone(), contacts.clone(), laws, domain.gravity)
    };
    let changes = of(&system) != of(simulation.system());
    if changes {
        simulation.change_system(system, observer)?;
    }
    Ok((next, changes))
}
