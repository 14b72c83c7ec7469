//! The errors of the engine.

use crate::numerics::number::significant;

/// The class of an error, as far as callers distinguish them.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Fault {
    /// The scene requests something that is impossible.
    Invalid,
    /// The checkpoint cannot be resumed.
    Checkpoint,
    /// The simulation cannot continue.
    Stopped,
}

/// The reason why a simulation cannot start or continue. Data recorded before stay valid.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum EngineError {
    /// Infinitely many collisions in a finite time.
    #[error(
        "collapse at t = {}: {events} contacts so fast that the clock {} (inelastic collapse), around {} \
         among {}; set {}, or a restitution that tends to 1 at low speed (model = \"cutoff\" or \
         \"viscoelastic\")",
        significant(*time, 9),
        if *span > 0.0 { format!("advanced by {} only", significant(*span, 2)) } else { "did not advance".to_owned() },
        rounded(position),
        participants(particles, walls),
        remedies(*contact_duration, *rest_speed)
    )]
    Collapse {
        /// When [time].
        time: f64,
        /// Number of events during which time hardly advanced.
        events: u64,
        /// Time in which these events occurred [time].
        span: f64,
        /// All particles of the last of these events, in ascending order.
        particles: Vec<u32>,
        /// Names of the walls of these events.
        walls: Vec<String>,
        /// Mean of their positions \[length\], wrapped into the box along periodic axes.
        position: [f64; 3],
        /// A speed of rest that suits the system [length/time], larger than the one that is set; 0 without
        /// gravity.
        rest_speed: f64,
        /// A contact duration that suits the system [time]; 0 if none is known.
        contact_duration: f64,
    },
    /// A velocity is no longer finite.
    #[error("particle {i} has a velocity beyond the range of numbers at t = {time}: {velocity:?}")]
    Overflow {
        /// When [time].
        time: f64,
        /// The particle.
        i: u32,
        /// Its velocity [length/time].
        velocity: [f64; 3],
    },
    /// A particle would become too fast for the length of a tick. [`Simulation`](crate::Simulation) chooses a
    /// shorter one and goes on; it never returns this error.
    #[error("a speed of {speed} is too large for the length of a tick")]
    LongTick {
        /// The speed [length/time].
        speed: f64,
    },
    /// Particles overlap by more than rounding can explain.
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
        /// The other particle; `None` for a wall.
        partner: Option<u32>,
        /// Depth of the overlap [contact distances; radii at a wall].
        depth: f64,
    },
    /// A box that is compressed has become so short that a particle would touch its own image.
    #[error(
        "the edge of the box along {} has become {}, and particles touch their own images, at t = {}",
        ["x", "y", "z"][*axis],
        significant(*edge, 6),
        significant(*time, 9)
    )]
    ShortEdge {
        /// When [time].
        time: f64,
        /// The axis: 0, 1 or 2.
        axis: usize,
        /// The edge [length].
        edge: f64,
    },
    /// The processor does not support the requested instructions.
    #[error("engine.simd = \"avx2\": this processor does not have AVX2; use \"auto\" or \"portable\"")]
    NoAvx2,
    /// The requested partner search does not work for this system.
    #[error("engine.neighbors = \"{choice}\" does not work here: {why}; use \"auto\"")]
    Unsuitable {
        /// The requested search.
        choice: &'static str,
        /// The reason.
        why: String,
    },
    /// A checkpoint is invalid, does not belong to this system, or was written by another version.
    #[error("the checkpoint does not fit: {0}")]
    Checkpoint(String),
    /// A change of the state is not possible; it is as before.
    #[error("the state cannot be changed: {0}")]
    Change(String),
    /// What another crate has added does not keep its contract.
    #[error("\"{name}\" does not work: {why}")]
    Plugin {
        /// Its name in scenes.
        name: String,
        /// What is wrong.
        why: String,
    },
    /// There are more particles or walls than indices can represent.
    #[error("{what} = {count}: at most {limit} are possible")]
    TooMany {
        /// Particles or walls, in words.
        what: &'static str,
        /// Their number.
        count: usize,
        /// The largest possible number.
        limit: usize,
    },
    /// An internal invariant does not hold. This is a bug, reported so that no wrong results are used.
    #[error("internal inconsistency at t = {time}: {what}; please report this scene")]
    Inconsistent {
        /// When [time].
        time: f64,
        /// The invariant that does not hold.
        what: String,
    },
}

impl EngineError {
    /// The class of the error, as far as callers distinguish them.
    pub fn fault(&self) -> Fault {
        match self {
            Self::NoAvx2 | Self::Change(_) | Self::TooMany { .. } | Self::Unsuitable { .. } => Fault::Invalid,
            Self::Checkpoint(_) => Fault::Checkpoint,
            Self::Collapse { .. }
            | Self::Overflow { .. }
            | Self::ShortEdge { .. }
            | Self::LongTick { .. }
            | Self::Plugin { .. }
            | Self::Overlap { .. }
            | Self::Inconsistent { .. } => Fault::Stopped,
        }
    }
}

/// A message lists at most this many particles of a collapse.
const NAMED: usize = 20;

/// A position with few enough digits to be readable; of disks without the third coordinate, which is 0.
fn rounded(position: &[f64; 3]) -> String {
    let axes = if position[2] == 0.0 { 2 } else { 3 };
    let coordinates: Vec<String> = position[..axes].iter().map(|&x| significant(x, 6)).collect();
    format!("({})", coordinates.join(", "))
}

/// A list of particles and walls, as text.
fn participants(particles: &[u32], walls: &[String]) -> String {
    let names: Vec<String> = particles.iter().take(NAMED).map(u32::to_string).collect();
    let more = particles.len().saturating_sub(NAMED);
    let more = if more > 0 { format!(" and {more} more") } else { String::new() };
    let walls: String = walls.iter().fold(String::new(), |text, name| text + ", wall " + name);
    let noun = if particles.len() == 1 { "particle" } else { "particles" };
    format!("{noun} {}{more}{walls}", names.join(", "))
}

/// Keys that end a series of contacts. With gravity `contact.tc` is the last one: on a floor grains bounce
/// for ever with it.
fn remedies(contact_duration: f64, rest_speed: f64) -> String {
    let duration = if contact_duration > 0.0 {
        format!("contact.tc, for example contact.tc = {contact_duration:e}")
    } else {
        "contact.tc".to_owned()
    };
    if rest_speed > 0.0 {
        format!("contact.rest_speed, for example {rest_speed} (without a floor also {duration})")
    } else {
        duration
    }
}
