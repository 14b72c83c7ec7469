//! The work of the shear in flights.
//!
//! In its flight a particle keeps its velocity, so that its peculiar velocity c changes along the flow by −γ̇
//! c_y in a unit of time: this is the work of the shear, −γ̇ m c_x c_y.

use crate::{
    numerics::total::total,
    report::ledger::Term,
    state::{State, sliding_images::SlidingImages, world::World},
};

impl World {
    /// The work of the shear on particle i in `duration` \[time\] from its anchor \[energy\].
    fn flight_work(&self, shear: &SlidingImages, i: u32, duration: f64) -> f64 {
        let particle = &self.particles[i as usize];
        let mass = self.class(i).mass;
        let across = particle.velocity[shear.gradient];
        let along = (particle.velocity - shear.velocity(particle.position))[shear.flow];
        // c_x after a time, and its change in a unit of time.
        let fall = shear.rate * across;
        let power = -shear.rate * mass * across;
        power * duration * (along - 0.5 * fall * duration)
    }

    /// The work of the shear in the flights since the anchors of all particles.
    pub fn pending_shear_work(&self) -> f64 {
        let Some(shear) = &self.boundary.shear else { return 0.0 };
        let [work] = total(self.particles.len(), |i| [self.flight_work(shear, i, self.age(i, self.now))]);
        work
    }

    /// Notes the length of a path in a sheared box \[length\], if it is longer than two edges.
    pub fn note_path(&mut self, path: f64) {
        if self.boundary.shear.is_some_and(|shear| path > 2.0 * shear.length) {
            self.resolution.longest_flight = self.resolution.longest_flight.max(path);
        }
    }
}

/// How far particle i and its images have come along the flow at `ticks` since its anchor \[length\]: the
/// rounding error of a contact is relative to that.
pub(crate) fn path(world: &World, i: u32, ticks: i64) -> f64 {
    let Some(shear) = &world.boundary.shear else { return 0.0 };
    let along = world.particles[i as usize].velocity[shear.flow].abs();
    along.max(shear.speed.abs()) * world.age(i, ticks)
}

/// Notes the path of particle i in a flight that ends at `ticks`, if it is longer than two edges.
pub(crate) fn note_path(world: &mut World, i: u32, ticks: i64) {
    let path = path(world, i, ticks);
    world.note_path(path);
}

/// Adds the work of the shear on particle i in `duration` \[time\] from its anchor. It gets another one then.
pub(crate) fn end_flight_after(state: &mut State, i: u32, duration: f64) {
    let State { world, accumulators, .. } = state;
    let Some(shear) = &world.boundary.shear else { return };
    let work = world.flight_work(shear, i, duration);
    accumulators.add_work_in_flight(Term::ShearWork, work);
}
