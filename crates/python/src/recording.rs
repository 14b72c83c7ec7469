//! The output file of a simulation that Python advances.
//!
//! Particles may be added and removed while it is recorded. Each has a row of its own in the file, those that
//! are added one of the rows kept for them; a frame has those that are there, as the frames of inlets and
//! outlets.

use glam::DVec3;
use haff_engine::{EventRecord, Frame, SceneFeatures, Stop, System, TRAJECTORY_VERSION, Term, Until};
use haff_linkage::{AnySimulation, AnySimulationError};
use haff_record::{Entered, Header, RecordError, Recorder, StoredMesh};
use haff_scene::{Due, MeshFile, OutputPlan, Records, Scene, Schedule, Times};
use serde_json::json;

use crate::events::Log;

/// A particle: radius, mass, index of the species.
type Kind = (f64, f64, u32);

/// A file, and what is due to be written to it.
pub struct Recording {
    recorder: Recorder,
    records: Records,
    /// The row in the file of each particle.
    rows: Vec<u32>,
    /// The number of particles at the start, the next row kept for one, and the number of all rows.
    first: u32,
    next: u32,
    most: u32,
    /// Whether events are recorded, and whether Python takes them, too.
    events: [bool; 2],
    /// Whether frames say which particles are there.
    flow: bool,
    /// q = I/(m R²) by species, with spin.
    inertia: Option<Vec<f64>>,
    /// Times of the last frame and of the last row.
    last: [Option<f64>; 2],
    title: String,
    seed: u64,
}

/// What describes a run in its file.
pub struct Texts {
    pub title: String,
    pub resolved: String,
    pub seed: u64,
    pub springs: bool,
    pub meshes: Vec<StoredMesh>,
    pub conserved_momentum: [bool; 3],
}

impl Texts {
    /// Those of a scene, whose triangles it takes.
    pub fn of(scene: &mut Scene) -> Self {
        let meshes = std::mem::take(&mut scene.meshes).into_iter();
        Self {
            title: scene.title.clone(),
            resolved: scene.resolved.clone(),
            seed: scene.seed,
            springs: !scene.joints.springs.is_empty(),
            meshes: meshes.map(|MeshFile { corners, hash }| StoredMesh { hash, corners }).collect(),
            conserved_momentum: scene.joints.conserved_momentum(&scene.system),
        }
    }
}

/// Why a simulation has stopped advancing.
pub enum Ended {
    Simulation(AnySimulationError),
    Record(RecordError),
}

impl From<RecordError> for Ended {
    fn from(error: RecordError) -> Self {
        Self::Record(error)
    }
}

/// Runs events up to the first of the bounds, with or without an output file.
pub fn advance(
    recording: Option<&mut Recording>,
    simulation: &mut AnySimulation,
    bounds: Until,
    log: &mut Log,
) -> Result<Stop, Ended> {
    match recording {
        Some(recording) => recording.advance(simulation, bounds, log),
        None => simulation.advance(bounds, log).map_err(Ended::Simulation),
    }
}

impl Recording {
    /// Creates the file of a simulation, with `room` for more particles.
    pub fn create(
        output: &OutputPlan,
        system: &System,
        texts: Texts,
        room: u32,
        overwrite: bool,
        takes_events: bool,
    ) -> Result<Option<Self>, RecordError> {
        let Some(path) = &output.file else { return Ok(None) };
        let own = Header::from_system(system);
        let count = own.species.len() as u32;
        let flow = room > 0 || system.flow.is_some();
        let mut present = SceneFeatures { springs: texts.springs, flow, ..SceneFeatures::of(system) };
        // The state may be changed from outside.
        present.terms[Term::Change as usize] = true;
        let mut header = Header {
            title: texts.title.clone(),
            scene_toml: texts.resolved,
            seed: texts.seed,
            trajectory_version: TRAJECTORY_VERSION,
            frames: output.frames != Schedule::Off,
            observables: output.observables != Schedule::Off,
            events: output.events.clone(),
            compressed: output.compressed,
            present,
            conserved_momentum: texts.conserved_momentum,
            used: count as usize,
            meshes: texts.meshes,
            ..own
        };
        // Until a particle takes its place, a row is like the first one.
        let kept = (count + room) as usize;
        extend(&mut header.species, kept);
        extend(&mut header.mass, kept);
        extend(&mut header.radius, kept);
        extend(&mut header.inertia, kept);
        let inertia = system.spin.as_ref().map(|spin| spin.inertia.clone());
        let recorder = Recorder::create(path, header, overwrite)?;
        let records = Records::new(Times::after(output.frames, 0.0), Times::after(output.observables, 0.0));
        Ok(Some(Self {
            recorder,
            records,
            rows: (0..count).collect(),
            first: count,
            next: count,
            most: count + room,
            events: [!output.events.is_empty(), takes_events],
            flow,
            inertia,
            last: [None; 2],
            title: texts.title,
            seed: texts.seed,
        }))
    }

    pub fn path(&self) -> &std::path::Path {
        self.recorder.path()
    }

    /// Whether the log is needed.
    pub fn wants_events(&self) -> bool {
        self.events[0]
    }

    /// Writes the present state, unless it is written.
    pub fn record(&mut self, simulation: &mut AnySimulation, due: Due) -> Result<(), Ended> {
        let time = Some(simulation.time());
        let [frame, sample] = [due.frame, due.frame || due.sample];
        if sample && self.last[1] != time {
            self.last[1] = time;
            let mut row = simulation.sample();
            if self.most > self.first {
                // Of inlets and outlets the engine counts them.
                row.particles = self.rows.len() as u64;
                row.particles_in = u64::from(self.next - self.first);
                row.particles_out = u64::from(self.next) - row.particles;
            }
            self.recorder.sample(row)?;
        }
        if frame && self.last[0] != time {
            self.last[0] = time;
            simulation.measure_overlap().map_err(Ended::Simulation)?;
            let (rows, kept, flow) = (&self.rows, self.most as usize, self.flow);
            self.recorder.frame_with(|| spread(simulation.frame(), rows, kept, flow))?;
        }
        Ok(())
    }

    /// Advances for a slice at most, and writes what is due.
    pub fn advance(
        &mut self,
        simulation: &mut AnySimulation,
        bounds: Until,
        log: &mut Log,
    ) -> Result<Stop, Ended> {
        let done = simulation.counters().collisions;
        let (time, count) = self.records.next(done);
        let target = Until {
            time: bounds.time.min(time),
            collisions: bounds.collisions.min(count),
            entries: bounds.entries,
        };
        let stop = simulation.advance(target, log).map_err(Ended::Simulation);
        self.take_log(log)?;
        let stop = stop?;
        let now = simulation.counters().collisions;
        match stop {
            Stop::Time => {
                let due = self.records.take(target.time);
                self.record(simulation, due)?;
                Ok(if target.time < bounds.time { Stop::Slice } else { Stop::Time })
            }
            Stop::Collisions => {
                self.records.count(simulation.time(), done, now);
                Ok(if now < bounds.collisions { Stop::Slice } else { Stop::Collisions })
            }
            stop => Ok(stop),
        }
    }

    /// Writes the rows of the log.
    pub fn take_log(&mut self, log: &mut Log) -> Result<(), RecordError> {
        for row in &log.profiles[log.recorded_profiles..] {
            self.recorder.profile(row.clone())?;
        }
        log.recorded_profiles = log.profiles.len();
        if !self.events[0] {
            return Ok(());
        }
        let of = |i: u32| self.rows.get(i as usize).copied().unwrap_or(i);
        let row = |event: &EventRecord| {
            let j = if event.kind.is_of_two_particles() { of(event.j) } else { event.j };
            EventRecord { i: of(event.i), j, ..*event }
        };
        self.recorder.events(log.rows[log.recorded..].iter().map(row).collect())?;
        log.recorded = log.rows.len();
        if !self.events[1] {
            log.rows.clear();
            log.recorded = 0;
        }
        Ok(())
    }

    /// Whether so many particles can be added.
    pub fn has_room(&self, added: usize) -> Result<(), String> {
        let left = self.most - self.next;
        if added <= left as usize {
            return Ok(());
        }
        Err(format!(
            "{added} more particles, but {} has room for {left}: make the simulation with a larger room",
            self.path().display()
        ))
    }

    /// Particles have been removed, by their indices, and others added.
    pub fn changed(&mut self, removed: &[u32], added: &[Kind], log: &mut Log) -> Result<(), RecordError> {
        let mut stays = vec![true; self.rows.len()];
        for &i in removed {
            stays[i as usize] = false;
        }
        let mut stays = stays.into_iter();
        self.rows.retain(|_| stays.next() == Some(true));
        let mut entered = Vec::with_capacity(added.len());
        for &(radius, mass, species) in added {
            let inertia = self.inertia.as_ref().and_then(|inertia| inertia.get(species as usize).copied());
            entered.push(Entered { row: self.next, species, mass, radius, inertia: inertia.unwrap_or(0.0) });
            self.rows.push(self.next);
            self.next += 1;
        }
        self.recorder.enter(entered)?;
        self.take_log(log)
    }

    /// Writes the end, and closes the file.
    pub fn finish(mut self, simulation: &mut AnySimulation, log: &mut Log) -> Result<(), Ended> {
        self.take_log(log)?;
        self.record(simulation, Due { frame: true, sample: true })?;
        self.recorder.correlations(simulation.correlations())?;
        let counters = simulation.counters();
        let summary = json!({
            "title": self.title,
            "seed": self.seed,
            "particles": simulation.particles(),
            "stopped": "closed",
            "simulated_time": simulation.time(),
            "collisions": counters.collisions,
            "wall_collisions": counters.wall_collisions,
            "events": counters.collisions + counters.wall_collisions,
            "simultaneous_contacts": counters.simultaneous,
            "ledger_residual": simulation.ledger().residual,
            "max_overlap": simulation.max_overlap(),
            "state_hash": simulation.state_hash(),
            "trajectory_version": TRAJECTORY_VERSION,
        });
        self.recorder.finish(&summary.to_string(), true).map_err(Ended::Record)
    }
}

/// A frame with the particles in their rows of the file, of which `kept` there are.
fn spread(frame: Frame, rows: &[u32], kept: usize, flow: bool) -> Frame {
    if rows.len() == kept && rows.iter().enumerate().all(|(k, &row)| k == row as usize) {
        let present = if flow && frame.present.is_empty() { vec![true; kept] } else { frame.present };
        return Frame { present, ..frame };
    }
    let there = vec![true; frame.position.len()];
    Frame {
        position: into_rows(&frame.position, rows, kept, DVec3::NAN),
        velocity: into_rows(&frame.velocity, rows, kept, DVec3::NAN),
        image: into_rows(&frame.image, rows, kept, [0; 3]),
        angular_velocity: into_rows(&frame.angular_velocity, rows, kept, DVec3::NAN),
        present: into_rows(&there, rows, kept, false),
        ..frame
    }
}

/// Values by the rows of a file, of which `kept` there are; `none` where there is no particle.
fn into_rows<T: Copy>(values: &[T], rows: &[u32], kept: usize, none: T) -> Vec<T> {
    let mut all = vec![none; if values.is_empty() { 0 } else { kept }];
    for (&value, &row) in values.iter().zip(rows) {
        all[row as usize] = value;
    }
    all
}

/// Values like the first one for rows that are kept.
fn extend<T: Copy>(values: &mut Vec<T>, count: usize) {
    if let Some(&first) = values.first() {
        values.resize(count, first);
    }
}
