//! [`AnySimulation`]: the granular engine and the simulation of linkages behind one interface. Scenes with
//! pendulums, springs, rods or sticking contact run as a linkage, all others in the granular engine.

use glam::DVec3;
use haff_engine::{
    BlockCounts, Checkpoint, Correlation, Counters, EngineError, Fault, Frame, Ledger, Observer, Options,
    Sample, Simulation, Stop, System, Until,
};

use crate::{Joints, LinkageError, simulation::Simulation as Linkage};

/// Movable particles in a linkage without a warning.
const MANY: usize = 50;

/// A running simulation of either kind.
pub enum AnySimulation {
    /// Spheres and walls.
    Granular(Box<Simulation>),
    /// Few bodies with joints.
    Linkage(Box<Linkage>),
}

/// An error of either simulation.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error(transparent)]
pub enum AnySimulationError {
    /// Of the granular engine.
    Granular(#[from] EngineError),
    /// Of a linkage.
    Linkage(#[from] LinkageError),
}

impl AnySimulationError {
    /// The class of the error, which gives the exit status of the command and the exception in Python.
    pub fn fault(&self) -> Fault {
        match self {
            Self::Granular(error) => error.fault(),
            Self::Linkage(error) => error.fault(),
        }
    }
}

/// Warnings for a scene, as texts without a final point.
pub fn warnings(system: &System, joints: &Joints) -> Vec<String> {
    if joints.is_empty() {
        return haff_engine::warnings(system);
    }
    // Series of impacts of a linkage end by themselves, and it has no contact duration.
    many_bodies_warning(system).into_iter().collect()
}

/// A warning for a linkage with many bodies under gravity.
fn many_bodies_warning(system: &System) -> Option<String> {
    let movable = system.bodies.iter().map(|body| &system.classes[body.class as usize]);
    let movable: Vec<_> = movable.filter(|class| class.mass.is_finite()).collect();
    let g = system.domain.gravity.length();
    if movable.len() <= MANY || g == 0.0 || system.contacts.rest_speed > 0.0 {
        return None;
    }
    let radius = movable.iter().map(|class| class.radius).filter(|&r| r > 0.0).fold(f64::INFINITY, f64::min);
    let speed = if radius.is_finite() {
        format!(", for example {},", haff_engine::rest_speed_of_diameter(g, 2.0 * radius))
    } else {
        String::new()
    };
    Some(format!(
        "{} particles in a scene with pendulums, springs, rods or sticking contacts: the motion of all bodies in \
         contact is computed together, and a heap of many has very many impacts at low speeds, so that the run \
         may take very long; contact.rest_speed{speed} ends them earlier, and scenes without such joints run in \
         the granular engine: let fixed particles (mass = inf) stand for those that stick",
        movable.len()
    ))
}

/// Calls the same method of either simulation.
macro_rules! either {
    ($any:expr, $simulation:ident => $call:expr) => {
        match $any {
            AnySimulation::Granular($simulation) => $call,
            AnySimulation::Linkage($simulation) => $call,
        }
    };
}

impl AnySimulation {
    /// Starts a linkage if the scene has joints, otherwise the granular engine.
    pub fn new(system: System, joints: Joints, options: Options) -> Result<Self, AnySimulationError> {
        if joints.is_empty() {
            Ok(Self::Granular(Box::new(Simulation::new(system, options)?)))
        } else {
            Ok(Self::Linkage(Box::new(Linkage::new(system, joints)?)))
        }
    }

    /// Continues from a checkpoint of the same scene.
    pub fn restore(
        system: System,
        joints: Joints,
        options: Options,
        checkpoint: &Checkpoint,
    ) -> Result<Self, AnySimulationError> {
        if joints.is_empty() {
            Ok(Self::Granular(Box::new(Simulation::restore(system, options, checkpoint)?)))
        } else {
            Ok(Self::Linkage(Box::new(Linkage::restore(system, joints, checkpoint)?)))
        }
    }

    /// Runs events until the first of the bounds.
    pub fn advance(&mut self, until: Until, observer: &mut dyn Observer) -> Result<Stop, AnySimulationError> {
        Ok(either!(self, simulation => simulation.advance(until, observer)?))
    }

    /// Whether time passes where nothing moves, because the caller will change the state. With joints it
    /// always does, up to a bound of time.
    pub fn wait(&mut self, waits: bool) {
        if let Self::Granular(simulation) = self {
            simulation.wait(waits);
        }
    }

    /// Warnings for the scene that is simulated, see [`warnings`].
    pub fn warnings(&self) -> Vec<String> {
        match self {
            Self::Granular(simulation) => warnings(simulation.system(), &Joints::default()),
            Self::Linkage(simulation) => warnings(simulation.system(), simulation.joints()),
        }
    }

    /// Present simulated time [time].
    pub fn time(&self) -> f64 {
        either!(self, simulation => simulation.time())
    }

    /// All particles now.
    pub fn frame(&self) -> Frame {
        either!(self, simulation => simulation.frame())
    }

    /// Edge vectors of the box now; `None` if they never change.
    pub fn moving_edges(&self) -> Option<[DVec3; 3]> {
        match self {
            Self::Granular(simulation) => {
                let domain = &simulation.system().domain;
                (domain.shear.is_some() || domain.compression.is_some()).then(|| simulation.edges())
            }
            Self::Linkage(_) => None,
        }
    }

    /// One row of observables.
    pub fn sample(&mut self) -> Sample {
        either!(self, simulation => simulation.sample())
    }

    /// The correlations in time so far, of those that are measured.
    pub fn correlations(&self) -> Vec<Correlation> {
        match self {
            Self::Granular(simulation) => simulation.correlations(),
            Self::Linkage(_) => Vec::new(),
        }
    }

    /// Energies and their balance now.
    pub fn ledger(&self) -> Ledger {
        either!(self, simulation => simulation.ledger())
    }

    /// Number of particles that frames have: with those that have left or are still to come.
    pub fn rows(&self) -> usize {
        match self {
            Self::Granular(simulation) => simulation.rows(),
            Self::Linkage(simulation) => simulation.particles(),
        }
    }

    /// Numbers of particles that have come in and have been taken out so far; `None` without inlets and
    /// outlets.
    pub fn passages(&self) -> Option<[u64; 2]> {
        match self {
            Self::Granular(simulation) => simulation.passages(),
            Self::Linkage(_) => None,
        }
    }

    /// Counts of events and predictions so far.
    pub fn counters(&self) -> Counters {
        either!(self, simulation => simulation.counters())
    }

    /// The exact state.
    pub fn checkpoint(&self) -> Checkpoint {
        either!(self, simulation => simulation.checkpoint())
    }

    /// Hash of the present state.
    pub fn state_hash(&self) -> String {
        either!(self, simulation => simulation.state_hash())
    }

    /// Number of particles.
    pub fn particles(&self) -> usize {
        either!(self, simulation => simulation.particles())
    }

    /// Measures the largest overlap now and keeps the maximum over the run. An error if it exceeds rounding.
    pub fn measure_overlap(&mut self) -> Result<(), AnySimulationError> {
        match self {
            Self::Granular(simulation) => {
                simulation.measure_overlap()?;
            }
            Self::Linkage(simulation) => simulation.measure_overlap()?,
        }
        Ok(())
    }

    /// Largest overlap found so far [contact distances].
    pub fn max_overlap(&self) -> f64 {
        either!(self, simulation => simulation.max_overlap())
    }

    /// Name of the method that finds collision partners.
    pub fn search(&self) -> &'static str {
        match self {
            Self::Granular(simulation) => simulation.neighbors().name(),
            Self::Linkage(_) => "conservative_advancement",
        }
    }

    /// How several threads have taken events so far, and why one thread takes them at present, if so.
    pub fn blocks(&self) -> (BlockCounts, Option<&'static str>) {
        match self {
            Self::Granular(simulation) => (simulation.block_counts(), simulation.serial_reason()),
            Self::Linkage(_) => {
                (BlockCounts::default(), Some("there are pendulums, springs, rods or sticking contacts"))
            }
        }
    }
}
