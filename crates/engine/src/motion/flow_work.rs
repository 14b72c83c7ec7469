//! The work of the flow of a box that deforms, in flights: −∫ m c·G c dt (`state/deformation.rs`).

use crate::{
    numerics::total::total,
    report::ledger::Term,
    state::{State, deformation::Deformation, world::World},
};

impl World {
    /// The work of the flow on particle i in `duration` \[time\] from its anchor \[energy\].
    fn flight_work(&self, images: &Deformation, i: u32, duration: f64) -> f64 {
        let particle = &self.particles[i as usize];
        let mass = self.class(i).mass;
        let start = self.clock.time(particle.time);
        images.work_in_flight(mass, [particle.position, particle.velocity], start, duration)
    }

    /// The work of the flow in the flights since the anchors of all particles, and the term of the balance
    /// that has it.
    pub fn pending_flow_work(&self) -> Option<(Term, f64)> {
        let images = self.boundary.deformation.as_ref()?;
        let [work] = total(self.particles.len(), |i| [self.flight_work(images, i, self.age(i, self.now))]);
        Some((images.term(), work))
    }

    /// Notes the length of a path in a box that deforms \[length\], if it is longer than two edges.
    #[inline]
    pub fn note_path(&mut self, path: f64) {
        let is_long = |images: &Deformation| {
            let edge =
                images.sliding.as_ref().map_or(self.boundary.periodicity.size.min_element(), |s| s.length);
            path > 2.0 * edge
        };
        if self.boundary.deformation.as_ref().is_some_and(is_long) {
            self.resolution.longest_flight = self.resolution.longest_flight.max(path);
        }
    }
}

/// How far particle i and its images have come along the flow at `ticks` since its anchor \[length\]: the
/// rounding error of a contact is relative to that.
#[inline]
pub(crate) fn path(world: &World, i: u32, ticks: i64) -> f64 {
    let Some(images) = &world.boundary.deformation else { return 0.0 };
    let velocity = world.particles[i as usize].velocity.abs();
    let speed = match &images.sliding {
        Some(shear) => velocity[shear.flow].max(shear.speed.abs()),
        None => velocity.max(images.speeds.abs()).max_element(),
    };
    speed * world.age(i, ticks)
}

/// Notes the path of particle i in a flight that ends at `ticks`, if it is longer than two edges.
#[inline]
pub(crate) fn note_path(world: &mut World, i: u32, ticks: i64) {
    let path = path(world, i, ticks);
    world.note_path(path);
}

/// Adds the work of the flow on particle i in `duration` \[time\] from its anchor. It gets another one then.
pub(crate) fn end_flight_after(state: &mut State, i: u32, duration: f64) {
    let State { world, accumulators, .. } = state;
    let Some(images) = &world.boundary.deformation else { return };
    let work = world.flight_work(images, i, duration);
    accumulators.add_work_in_flight(images.term(), work);
}
