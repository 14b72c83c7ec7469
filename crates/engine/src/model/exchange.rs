//! Changes of velocities by events.

use glam::DVec3;

/// The velocities that one event changes: an impact, or the kick of a drive. What gravity and the end of a
/// series of bounces change is not included.
#[derive(Debug, Clone, Copy)]
pub struct Exchange<'a> {
    /// Time of the event \[time\].
    pub time: f64,
    /// The particles of finite mass whose velocities change: one or two.
    pub changes: &'a [VelocityChange],
    /// Where the momentum of the first change comes from.
    pub partner: Partner,
}

/// A change of velocity.
#[derive(Debug, Clone, Copy)]
pub struct VelocityChange {
    /// Index of the particle.
    pub i: u32,
    /// Its mass [mass].
    pub mass: f64,
    /// Velocity before [length/time], under shear the peculiar one.
    pub before: DVec3,
    /// Velocity after [length/time].
    pub after: DVec3,
}

/// The other side of an [`Exchange`].
#[derive(Debug, Clone, Copy)]
pub enum Partner {
    /// Another particle, or a body of infinite mass.
    Particle {
        /// Both bodies, as indices.
        bodies: [u32; 2],
        /// Center of the first particle \[length\].
        position: DVec3,
        /// Vector from there to the center of the other one.
        branch: DVec3,
    },
    /// A wall.
    Wall(u32),
    /// A drive.
    Drive,
}
