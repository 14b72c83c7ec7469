//! One cell: its scene, its melting, its timing.

use std::{
    path::Path,
    time::{Duration, Instant},
};

use haff_engine::{Body, Counters, Silent, Simulation, Stop, Until};
use haff_scene::Scene;

use super::scenes::Standard;
use crate::{
    running::{session::Ending, states::States},
    terminal::{
        failure::{Failure, Status, scene_failure, simulation_failure},
        memory::peak_memory,
        signals::Signals,
    },
};

/// Calendar entries between two checks of signals, as in a run.
const SLICE: u64 = 1 << 15;
/// Collisions per particle before a standard scene is timed.
const MELT: f64 = 20.0;
/// Default number of timed collisions, or twice the particles if that is more.
const COLLISIONS: u64 = 1_000_000;

/// Source of a cell's scene.
pub enum Source<'a> {
    /// A standard scene with its number of particles, packing fraction and seed.
    Standard { scene: &'static Standard, n: u64, phi: f64, seed: u64 },
    /// A scene file.
    File(&'a Path),
}

/// A cell to measure.
pub struct Plan<'a> {
    pub source: Source<'a>,
    pub collisions: Option<u64>,
    pub melt: Option<f64>,
    pub repeats: u32,
    /// Overrides of the scene's keys.
    pub set: Vec<String>,
}

/// Measurements of one repeat of the timed part.
#[derive(Debug, Clone, Copy)]
pub struct Stretch {
    pub collisions: u64,
    pub seconds: f64,
}

/// A measured cell.
pub struct Measured {
    pub simulation: Simulation,
    pub ending: Ending,
    pub stretches: Vec<Stretch>,
    /// Counters and simulated time when the clock was started.
    pub melted: (Counters, f64),
    pub seed: u64,
    pub packing_fraction: f64,
    /// Number of bodies of finite mass.
    pub movable: usize,
    /// Reading, packing and drawing velocities.
    pub packing: Duration,
    /// Building the engine: cells, first predictions, calendar.
    pub building: Duration,
    pub melting: Duration,
    /// Memory of the process before it had any particle [bytes], if the system tells it.
    pub process: Option<u64>,
}

/// Outcome of [`Plan::measure`].
pub enum Outcome {
    Measured(Box<Measured>),
    /// A signal came before the clock was started.
    Interrupted(i32),
}

impl Plan<'_> {
    /// Collisions of the melting, of each stretch (none: up to the scene's own end), and of both together.
    fn counts(&self, n: u64) -> (u64, Option<u64>, Option<u64>) {
        let per_particle = self.melt.unwrap_or(if self.is_file() { 0.0 } else { MELT });
        let melt = (0.5 * per_particle * n as f64).ceil() as u64;
        let default = if self.is_file() { None } else { Some(COLLISIONS.max(2 * n)) };
        let timed = self.collisions.or(default);
        let total = timed.map(|timed| timed.saturating_mul(self.repeats.into()).saturating_add(melt));
        (melt, timed, total)
    }

    fn is_file(&self) -> bool {
        matches!(self.source, Source::File(_))
    }

    /// The scene, packed and moving, that ends where the measurement does.
    pub fn scene(&self) -> Result<Scene, Failure> {
        let parse = |name: &str, text: &str, set: &[String]| {
            haff_scene::parse(name, text, set, &States).map_err(|errors| scene_failure(&errors))
        };
        match self.source {
            Source::Standard { scene, n, phi, seed } => {
                let (.., total) = self.counts(n);
                let text = scene.scene(n, phi, seed, total.unwrap_or(u64::MAX));
                parse(&format!("haff bench --scene {}", scene.name), &text, &self.set)
            }
            Source::File(path) => {
                let name = path.display().to_string();
                let text = haff_scene::read(path).map_err(|errors| scene_failure(&errors))?;
                let scene = parse(&name, &text, &self.set)?;
                let (.., Some(total)) = self.counts(scene.system.bodies.len() as u64) else {
                    return Ok(scene);
                };
                // Parsed again, so that the resolved text contains it too.
                parse(&name, &text, &[&self.set[..], &[format!("run.collisions={total}")]].concat())
            }
        }
    }

    /// Melts and times the cell. `announce` is called with the name of each phase.
    pub fn measure(&self, signals: &Signals, announce: impl Fn(&str)) -> Result<Outcome, Failure> {
        let process = peak_memory();
        let started = Instant::now();
        announce("packing");
        let scene = self.scene()?;
        let packing = started.elapsed();

        let Scene { system, joints, options, run, seed, packing_fraction, .. } = scene;
        if !joints.is_empty() {
            let message = "haff bench measures the granular engine: the scene has pendulums, springs, rods or sticking contacts";
            return Err(Failure::new(Status::Invalid, message));
        }
        let (melt, timed, _) = self.counts(system.bodies.len() as u64);
        let is_movable = |body: &&Body| system.classes[body.class as usize].mass.is_finite();
        let movable = system.bodies.iter().filter(is_movable).count();
        let started = Instant::now();
        let mut simulation =
            Simulation::new(system, options).map_err(|error| simulation_failure(&error.into()))?;
        let building = started.elapsed();

        announce("melting");
        let until = run.until.unwrap_or(f64::INFINITY);
        let started = Instant::now();
        let mut ending = advance(&mut simulation, melt, until, signals);
        let melting = started.elapsed();
        match &ending {
            Ending::Collisions => {}
            &Ending::Signal(signal) => return Ok(Outcome::Interrupted(signal)),
            Ending::Failed(error) => return Err(simulation_failure(error)),
            early => {
                let message = format!(
                    "nothing left to time: the scene ended ({}) at t = {} while melting, after {} of {melt} collisions; \
                     lower --melt or prolong its run",
                    early.word(),
                    simulation.time(),
                    simulation.counters().collisions
                );
                return Err(Failure::new(Status::Invalid, message));
            }
        }

        announce("timing");
        let melted = (simulation.counters(), simulation.time());
        let mut stretches = Vec::new();
        for _ in 0..self.repeats {
            let before = simulation.counters().collisions;
            let target =
                timed.map_or(run.collisions.unwrap_or(u64::MAX), |timed| before.saturating_add(timed));
            let started = Instant::now();
            ending = advance(&mut simulation, target, until, signals);
            let seconds = started.elapsed().as_secs_f64();
            stretches.push(Stretch { collisions: simulation.counters().collisions - before, seconds });
            if ending != Ending::Collisions {
                break;
            }
        }
        if let Err(error) = simulation.measure_overlap()
            && !matches!(ending, Ending::Failed(_))
        {
            ending = Ending::Failed(error.into());
        }
        let measured = Measured {
            simulation,
            ending,
            stretches,
            melted,
            seed,
            packing_fraction,
            movable,
            packing,
            building,
            melting,
            process,
        };
        Ok(Outcome::Measured(Box::new(measured)))
    }
}

/// Runs to a total of collisions, or to the end of the scene if that comes first, without records.
fn advance(simulation: &mut Simulation, collisions: u64, until: f64, signals: &Signals) -> Ending {
    // The engine checks its bounds after an event: a bound already reached must not cost one more event.
    if simulation.counters().collisions >= collisions {
        return Ending::Collisions;
    }
    loop {
        match simulation.advance(Until { time: until, collisions, entries: SLICE }, &mut Silent) {
            Err(error) => return Ending::Failed(error.into()),
            Ok(Stop::Rest) => return Ending::Rest,
            Ok(Stop::Collisions) => return Ending::Collisions,
            Ok(Stop::Time) => return Ending::Until,
            Ok(Stop::Slice) => {}
        }
        if let Some(signal) = signals.received() {
            return Ending::Signal(signal);
        }
    }
}
