//! Joints between particles, as plain data beside the engine's [`haff_engine::System`].

use glam::DVec3;
use haff_engine::{System, conserved_momentum};

/// The kind of a pendulum's joint.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Tether {
    /// A massless inextensible string: it pulls, but never pushes; it goes slack instead.
    #[default]
    String,
    /// A massless rigid rod, free to turn about the pivot in every direction.
    Rod,
}

/// A particle at the end of a string or rod whose other end does not move.
#[derive(Debug, Clone, PartialEq)]
pub struct Pendulum {
    /// Name as in the scene.
    pub name: String,
    /// The fixed end \[length\].
    pub pivot: DVec3,
    /// From the pivot to the bob's center \[length\], > 0.
    pub length: f64,
    /// Particle row of the bob.
    pub bob: usize,
    /// String or rod.
    pub tether: Tether,
    /// Whether a string may be slack at the start, its bob nearer to the pivot than its length.
    pub slack: bool,
}

/// One end of a spring.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum SpringEnd {
    /// The center of a particle, by its row.
    Particle(usize),
    /// A point at rest \[length\].
    Point(DVec3),
}

/// A linear massless spring: its force is k (length − natural length), pulling if it is longer.
#[derive(Debug, Clone, PartialEq)]
pub struct Spring {
    /// Name as in the scene.
    pub name: String,
    /// Its ends; at least one is a particle.
    pub ends: [SpringEnd; 2],
    /// k [force/length], > 0.
    pub stiffness: f64,
    /// Length without force \[length\], ≥ 0.
    pub natural_length: f64,
}

/// A rigid massless rod between the centers of two particles, which turns freely at both.
#[derive(Debug, Clone, PartialEq)]
pub struct Rod {
    /// Name as in the scene.
    pub name: String,
    /// Particle rows of its ends.
    pub ends: [usize; 2],
    /// Distance of the two centers \[length\], > 0.
    pub length: f64,
}

/// All joints of a system.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Joints {
    /// Pendulums.
    pub pendulums: Vec<Pendulum>,
    /// Springs.
    pub springs: Vec<Spring>,
    /// Rods.
    pub rods: Vec<Rod>,
    /// Pairs of contact groups that stick: an impact removes all components of their relative velocity
    /// permanently.
    pub sticking: Vec<[u32; 2]>,
    /// Contact groups, and rows of walls that they stick to.
    pub sticking_to_walls: Vec<[u32; 2]>,
}

impl Joints {
    /// Whether there are no joints, so that the granular engine can simulate the system.
    pub fn is_empty(&self) -> bool {
        self.pendulums.is_empty()
            && self.springs.is_empty()
            && self.rods.is_empty()
            && self.sticking.is_empty()
            && self.sticking_to_walls.is_empty()
    }

    /// Whether momentum along each axis is conserved, as [`haff_engine::conserved_momentum`] says: along none
    /// if a joint ends at a point at rest, or particles stick to walls.
    pub fn conserved_momentum(&self, system: &System) -> [bool; 3] {
        let is_fixed = |spring: &Spring| spring.ends.iter().any(|end| matches!(end, SpringEnd::Point(_)));
        let is_held = !self.pendulums.is_empty()
            || !self.sticking_to_walls.is_empty()
            || self.springs.iter().any(is_fixed);
        if is_held { [false; 3] } else { conserved_momentum(system) }
    }
}
