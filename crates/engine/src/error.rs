//! What can stop a simulation.

/// The cause of an error, as far as callers treat causes differently.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Fault {
    /// The scene asks for what cannot be.
    Invalid,
    /// The checkpoint cannot be gone on from.
    Checkpoint,
    /// The simulation cannot go on.
    Stopped,
}

/// Why a simulation cannot start or go on. What was recorded before stays valid.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum EngineError {
    /// Infinitely many collisions in a finite time.
    #[error(
        "inelastic collapse at t = {time} around {}: {events} events within {span:e} time units among {}; \
         set contact.tc, a restitution that tends to 1 at low speed (model = \"cutoff\" or \"viscoelastic\"){}",
        place(position),
        listed(particles, walls),
        if *could_rest { ", or contact.rest_speed" } else { "" }
    )]
    Collapse {
        /// When [time].
        time: f64,
        /// Events during which time hardly went on.
        events: u64,
        /// How far it went on [time].
        span: f64,
        /// Everyone that took part in the last of them, in order.
        particles: Vec<u32>,
        /// Names of the walls that did.
        walls: Vec<String>,
        /// Mean of their positions \[length\], wrapped into the box along periodic axes.
        position: [f64; 3],
        /// Whether grains could be put to rest: gravity acts, and it has not been asked for.
        could_rest: bool,
    },
    /// A velocity or position has left the range of numbers.
    #[error("particle {i} has a velocity beyond the range of numbers at t = {time}: {velocity:?}")]
    Overflow {
        /// When [time].
        time: f64,
        /// The particle.
        i: u32,
        /// Its velocity [length/time].
        velocity: [f64; 3],
    },
    /// Particles overlap by more than rounding comes to.
    #[error(
        "particle {i} overlaps with {} by {depth:.1e} contact distances at t = {time}, which is more than rounding: \
         what was recorded before is right, what would follow is not",
        partner.map_or("a wall".to_owned(), |j| format!("particle {j}"))
    )]
    Overlap {
        /// When [time].
        time: f64,
        /// The particle.
        i: u32,
        /// The other particle, or none at a wall.
        partner: Option<u32>,
        /// How deep [contact distances; radii at a wall].
        depth: f64,
    },
    /// The processor does not have the asked instructions.
    #[error("engine.simd = \"avx2\": this processor does not have AVX2; use \"auto\" or \"portable\"")]
    NoAvx2,
    /// The asked partner search does not work for this system.
    #[error("engine.neighbors = \"{choice}\" does not work here: {why}; use \"auto\"")]
    Unsuitable {
        /// The choice.
        choice: &'static str,
        /// What stands against it.
        why: String,
    },
    /// A checkpoint does not belong to this system, or was written by another version.
    #[error("the checkpoint does not fit: {0}")]
    Checkpoint(String),
    /// More particles or walls than indices can name.
    #[error("{what} = {count}: at most {limit} are possible")]
    TooMany {
        /// What there is too much of.
        what: &'static str,
        /// How many.
        count: usize,
        /// How many may be.
        limit: usize,
    },
    /// An internal invariant does not hold; a bug, reported instead of wrong figures.
    #[error("internal inconsistency at t = {time}: {what}; please report this scene")]
    Inconsistent {
        /// When [time].
        time: f64,
        /// What does not hold.
        what: String,
    },
}

impl EngineError {
    /// The cause of the error, as far as callers treat causes differently.
    pub fn fault(&self) -> Fault {
        match self {
            Self::NoAvx2 | Self::TooMany { .. } | Self::Unsuitable { .. } => Fault::Invalid,
            Self::Checkpoint(_) => Fault::Checkpoint,
            Self::Collapse { .. }
            | Self::Overflow { .. }
            | Self::Overlap { .. }
            | Self::Inconsistent { .. } => Fault::Stopped,
        }
    }
}

/// At most this many particles of a collapse are named.
const NAMED: usize = 20;

/// A position, short enough to read.
fn place([x, y, z]: &[f64; 3]) -> String {
    format!("({x:.6}, {y:.6}, {z:.6})")
}

/// Particles and walls in words.
fn listed(particles: &[u32], walls: &[String]) -> String {
    let names: Vec<String> = particles.iter().take(NAMED).map(u32::to_string).collect();
    let more = particles.len().saturating_sub(NAMED);
    let more = if more > 0 { format!(" and {more} more") } else { String::new() };
    let walls: String = walls.iter().fold(String::new(), |text, name| text + ", wall " + name);
    let noun = if particles.len() == 1 { "particle" } else { "particles" };
    format!("{noun} {}{more}{walls}", names.join(", "))
}
