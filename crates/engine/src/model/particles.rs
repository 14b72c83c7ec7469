//! What actions and probes of other crates are given of a run.

use glam::DVec3;

/// The particles at one time, after all events up to it.
pub trait Particles {
    /// Number of particles.
    fn count(&self) -> u32;

    /// 2 or 3.
    fn dimension(&self) -> usize;

    /// The time [time].
    fn time(&self) -> f64;

    /// Position of the center of particle i [length], wrapped into the box along periodic axes.
    fn position(&self, i: u32) -> DVec3;

    /// Velocity of particle i [length/time]; in a sheared box that relative to the flow.
    fn velocity(&self, i: u32) -> DVec3;

    /// Mass of particle i [mass]; infinite for fixed and driven bodies.
    fn mass(&self, i: u32) -> f64;

    /// Radius of particle i [length].
    fn radius(&self, i: u32) -> f64;
}

/// The particles at the time of an action.
pub trait DrivenParticles: Particles {
    /// The particles that the drive acts on: those of its species that have a finite mass, in ascending
    /// order.
    fn driven(&self) -> &[u32];

    /// Independent normal random numbers of mean 0 and variance 1, for particle i in this action: a function
    /// of the seed of the scene, the drive, the action and the particle. In two dimensions the third is 0.
    fn normals(&self, i: u32) -> DVec3;

    /// Gives particle i another velocity [length/time] after the action: until then [`Particles::velocity`]
    /// is that before it. The work is counted as that of drives. Nothing happens to a particle that the drive
    /// does not act on. The run ends with an error if the velocity is not finite.
    fn set_velocity(&mut self, i: u32, velocity: DVec3);
}
