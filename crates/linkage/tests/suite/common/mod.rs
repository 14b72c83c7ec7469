//! Scenes for tests, and an observer that stores all events.

use glam::DVec3;
use haff_engine::{
    Body, Boundary, Class, Contacts, Dimension, Domain, EventKind, EventRecord, Group, Observer, System,
    Until, Wall, model::Restitution,
};
use haff_linkage::{Joints, LinkageError, Pendulum, Rod, Simulation, Spring, SpringEnd, Tether};

/// A scene in open space, every particle in its own group.
pub struct Scene {
    pub particles: Vec<(DVec3, DVec3, f64, f64)>,
    pub gravity: DVec3,
    pub walls: Vec<Wall>,
    pub restitution: f64,
    pub wall_restitution: f64,
    pub pairs: Vec<(usize, usize, f64)>,
    pub joints: Joints,
}

impl Scene {
    pub fn new(restitution: f64) -> Self {
        Self {
            particles: Vec::new(),
            gravity: DVec3::ZERO,
            walls: Vec::new(),
            restitution,
            wall_restitution: restitution,
            pairs: Vec::new(),
            joints: Joints::default(),
        }
    }

    /// Adds a particle: position, velocity, mass, radius.
    pub fn particle(&mut self, x: [f64; 3], v: [f64; 3], mass: f64, radius: f64) -> usize {
        self.particles.push((DVec3::from_array(x), DVec3::from_array(v), mass, radius));
        self.particles.len() - 1
    }

    pub fn wall(&mut self, point: [f64; 3], normal: [f64; 3]) -> usize {
        self.walls.push(Wall {
            name: format!("wall {}", self.walls.len()),
            point: DVec3::from_array(point),
            normal: DVec3::from_array(normal).normalize(),
            motion: haff_engine::WallMotion::Fixed,
            shape: None,
        });
        self.walls.len() - 1
    }

    pub fn pendulum(&mut self, pivot: DVec3, length: f64, bob: usize, tether: Tether) {
        let name = format!("pendulum {}", self.joints.pendulums.len());
        self.joints.pendulums.push(Pendulum { name, pivot, length, bob, tether, slack: false });
    }

    pub fn spring(&mut self, a: SpringEnd, b: SpringEnd, stiffness: f64, natural_length: f64) {
        let name = format!("spring {}", self.joints.springs.len());
        self.joints.springs.push(Spring { name, ends: [a, b], stiffness, natural_length });
    }

    pub fn rod(&mut self, a: usize, b: usize, length: f64) {
        let name = format!("rod {}", self.joints.rods.len());
        self.joints.rods.push(Rod { name, ends: [a, b], length });
    }

    pub fn build(&self) -> (System, Joints) {
        let n = self.particles.len();
        let mut pair = vec![Restitution::Constant(self.restitution); n * n];
        for &(i, j, e) in &self.pairs {
            pair[i * n + j] = Restitution::Constant(e);
            pair[j * n + i] = Restitution::Constant(e);
        }
        let system = System {
            spin: None,
            drag: None,
            drives: Vec::new(),
            measure: haff_engine::Measure::default(),
            flow: None,
            seed: 0,
            dimension: Dimension::Three,
            domain: Domain {
                size: DVec3::ONE,
                boundary: [Boundary::Open; 3],
                gravity: self.gravity,
                shear: None,
                compression: None,
            },
            bodies: (0..n)
                .map(|i| Body {
                    position: self.particles[i].0,
                    velocity: self.particles[i].1,
                    image: [0; 3],
                    class: i as u32,
                    species: 0,
                })
                .collect(),
            classes: (0..n)
                .map(|i| Class { mass: self.particles[i].2, radius: self.particles[i].3, group: i as u32 })
                .collect(),
            groups: (0..n).map(|i| Group { name: format!("p{i}") }).collect(),
            species: vec!["all".into()],
            walls: self.walls.clone(),
            contacts: Contacts {
                pair,
                wall: vec![(Restitution::Constant(self.wall_restitution)).into(); n * self.walls.len()],
                tc: 0.0,
                rest_speed: 0.0,
            },
        };
        (system, self.joints.clone())
    }

    pub fn start(&self) -> Simulation {
        self.try_start().expect("a valid scene")
    }

    pub fn try_start(&self) -> Result<Simulation, LinkageError> {
        let (system, joints) = self.build();
        Simulation::new(system, joints)
    }
}

/// Stores all events.
#[derive(Default)]
pub struct Log(pub Vec<EventRecord>);

impl Observer for Log {
    fn wants_events(&self) -> bool {
        true
    }
    fn event(&mut self, event: &EventRecord) {
        self.0.push(*event);
    }
}

impl Log {
    pub fn of(&self, kind: EventKind) -> Vec<EventRecord> {
        self.0.iter().copied().filter(|event| event.kind == kind).collect()
    }
}

pub fn run(simulation: &mut Simulation, time: f64) -> Log {
    let mut log = Log::default();
    simulation.advance(Until { time, entries: 10_000_000, ..Until::default() }, &mut log).expect("runs");
    log
}

/// Asserts relative agreement; the message contains both values.
#[track_caller]
pub fn close(what: &str, found: f64, expected: f64, tolerance: f64) {
    let scale = expected.abs().max(1e-300);
    assert!(
        (found - expected).abs() <= tolerance * scale,
        "{what}: {found:.17e}, expected {expected:.17e}, relative {:.1e}",
        (found - expected).abs() / scale
    );
}

/// Asserts absolute agreement.
#[track_caller]
pub fn near(what: &str, found: f64, expected: f64, tolerance: f64) {
    assert!((found - expected).abs() <= tolerance, "{what}: {found:.17e}, expected {expected:.17e}");
}
