//! Simple shear of a periodic box (A. W. Lees, S. F. Edwards, J. Phys. C 5, 1921 (1972)).
//!
//! The image of the box across the upper face of the gradient axis is displaced along the flow by γ̇ L t and
//! moves with γ̇ L, for the edge length L of the gradient axis. The mean velocity at the coordinate y along
//! the gradient is then γ̇ y. *Peculiar* velocities c are relative to it; all energies, temperatures and
//! momenta are those of peculiar velocities. In its flight a particle keeps its velocity, so that c changes
//! along the flow by −γ̇ c_y in a unit of time: this is the work of the shear, −γ̇ m c_x c_y. In an impact it
//! is −γ̇ y₁₂ J_x, with the vector r₁₂ of the centers and the impulse J on the second particle. Both together
//! are −γ̇ V P_yx in a unit of time.

use glam::DVec3;
use haff_neighbors::{Shift, Sliding};

use crate::{
    features::Features, flights, instant::Instant, ledger::Term, measure::total, model::System,
    particles::World, report::VelocityChange, state::State,
};

/// Simple shear.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Shear {
    /// Axis of the flow: 0, 1 or 2.
    pub flow: usize,
    /// Axis along which the velocity of the flow grows; another one than `flow`.
    pub gradient: usize,
    /// γ̇, the velocity of the flow per length [1/time].
    pub rate: f64,
    /// Displacement along the flow of the image across the upper face at time 0 \[length\].
    pub offset: f64,
}

/// The images of a sheared box.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct SlidingImages {
    pub flow: usize,
    pub gradient: usize,
    /// γ̇ [1/time].
    pub rate: f64,
    /// Velocity of the image across the upper face [length/time].
    pub speed: f64,
    /// Edge length along the flow \[length\], and along the gradient.
    length: f64,
    height: f64,
    /// Displacement of that image at time 0, and its change in a unit of time \[edges\].
    start: f64,
    frequency: f64,
}

/// Displacement of the image across the upper face along the flow: `turns` edges and `offset` \[length\],
/// which is at most half an edge.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Displacement {
    pub turns: i64,
    pub offset: f64,
}

impl SlidingImages {
    pub fn of(system: &System) -> Option<Self> {
        let shear = system.domain.shear?;
        let (length, height) = (system.domain.size[shear.flow], system.domain.size[shear.gradient]);
        let speed = shear.rate * height;
        Some(Self {
            flow: shear.flow,
            gradient: shear.gradient,
            rate: shear.rate,
            speed,
            length,
            height,
            start: shear.offset / length,
            frequency: speed / length,
        })
    }

    /// The displacement at a time.
    pub fn at(&self, time: Instant) -> Displacement {
        let (whole, part) = time.turns(self.frequency);
        let edges = part + self.start;
        let more = edges.round_ties_even();
        Displacement { turns: (whole + more) as i64, offset: (edges - more) * self.length }
    }

    /// Velocity of the flow at a position [length/time].
    pub fn velocity(&self, position: DVec3) -> DVec3 {
        DVec3::AXES[self.flow] * (self.rate * position[self.gradient])
    }

    /// The force that changes the sum of peculiar momenta by which the particles have this `momentum` across
    /// the flow: −γ̇ P_y along the flow.
    pub fn force(&self, momentum: DVec3) -> DVec3 {
        DVec3::AXES[self.flow] * (-self.rate * momentum[self.gradient])
    }

    /// Moves a position into the box along the gradient, and as far along the flow as that image is displaced
    /// at `time`. Along the flow it can be outside of the box.
    pub fn fold(&self, mut position: DVec3, time: Instant) -> DVec3 {
        let up = (position[self.gradient] / self.height).floor();
        if up != 0.0 {
            position[self.gradient] -= up * self.height;
            position[self.flow] -= up * self.at(time).offset;
        }
        position
    }
}

impl World {
    /// Peculiar velocity of particle i at `ticks`, and its position.
    #[inline]
    pub fn peculiar(&self, i: u32, ticks: i64) -> (DVec3, DVec3) {
        let (position, velocity) = self.state(i, ticks);
        (position, velocity - self.flow_velocity(position))
    }

    /// Velocity of the flow at a position; zero without shear.
    #[inline]
    pub fn flow_velocity(&self, position: DVec3) -> DVec3 {
        self.shear.as_ref().map_or(DVec3::ZERO, |shear| shear.velocity(position))
    }

    /// The displacement of images at `ticks`; zero without shear.
    pub fn displacement(&self, ticks: i64) -> Displacement {
        match &self.shear {
            Some(shear) => shear.at(self.clock.instant(ticks)),
            None => Displacement { turns: 0, offset: 0.0 },
        }
    }

    /// Edge vectors of the box at `ticks`.
    pub fn edges(&self, ticks: i64) -> [DVec3; 3] {
        let size = self.periodicity.size;
        let mut edges = [0, 1, 2].map(|axis| DVec3::AXES[axis] * size[axis]);
        if let Some(shear) = &self.shear {
            edges[shear.gradient][shear.flow] = self.displacement(ticks).offset;
        }
        edges
    }

    /// The images for a search that is built at the present.
    pub fn sliding_images(&self) -> Option<Sliding> {
        let shear = self.shear.as_ref()?;
        let Displacement { turns, offset } = self.displacement(self.now);
        let SlidingImages { flow, gradient, speed, .. } = *shear;
        Some(Sliding { flow, gradient, speed, offset, turns, start: self.now, tick: self.clock.tick })
    }

    /// The difference of positions and velocities of a pair at `ticks`, for the image that a search has
    /// found.
    #[inline(always)]
    pub fn image<F: Features>(&self, r: DVec3, v: DVec3, shift: Shift, ticks: i64) -> (DVec3, DVec3) {
        if shift == [0; 3] {
            return (r, v);
        }
        if F::SHEAR
            && let Some(shear) = &self.shear
            && shift[shear.gradient] != 0
        {
            return self.image_at(shear, r, v, shift, ticks);
        }
        (self.periodicity.image(r, shift), v)
    }

    #[inline(never)]
    fn image_at(
        &self,
        shear: &SlidingImages,
        r: DVec3,
        mut v: DVec3,
        shift: Shift,
        ticks: i64,
    ) -> (DVec3, DVec3) {
        let Displacement { turns, offset } = self.displacement(ticks);
        let up = f64::from(shift[shear.gradient]);
        let along = i64::from(shift[shear.flow]) + i64::from(shift[shear.gradient]) * turns;
        let mut lengths = shift.map(f64::from);
        lengths[shear.flow] = along as f64;
        let mut moved = DVec3::from_array(lengths) * self.periodicity.size;
        moved[shear.flow] += up * offset;
        v[shear.flow] += up * shear.speed;
        (r + moved, v)
    }

    /// The difference of positions and velocities of a pair at `ticks`, for the image that is the nearest at
    /// present, when the difference of positions is `present`.
    #[inline(always)]
    pub fn image_of_present(&self, r: DVec3, v: DVec3, present: DVec3, ticks: i64) -> (DVec3, DVec3) {
        if let Some(shear) = &self.shear
            && 2.0 * present[shear.gradient].abs() > shear.height
        {
            return self.sliding_image_of_present(shear, r, v, present, ticks);
        }
        (r + self.periodicity.offset(present), v)
    }

    #[inline(never)]
    fn sliding_image_of_present(
        &self,
        shear: &SlidingImages,
        r: DVec3,
        v: DVec3,
        mut present: DVec3,
        ticks: i64,
    ) -> (DVec3, DVec3) {
        let Displacement { turns, offset } = self.displacement(self.now);
        let up = -(present[shear.gradient] / shear.height).round_ties_even();
        present[shear.flow] += up * offset;
        let mut shift = [0, 1, 2].map(|axis| -self.periodicity.turns(present[axis], axis) as i32);
        shift[shear.gradient] = up as i32;
        shift[shear.flow] -= (up as i64 * turns) as i32;
        self.image_at(shear, r, v, shift, ticks)
    }

    /// The nearest image of a difference of positions at `ticks`, and its velocity. Along the gradient the
    /// image must be nearer than half of the box.
    #[inline(always)]
    pub fn nearest_image(&self, r: DVec3, ticks: i64) -> (DVec3, DVec3) {
        match &self.shear {
            None => (self.periodicity.nearest(r), DVec3::ZERO),
            Some(shear) => self.nearest_sliding_image(shear, r, ticks),
        }
    }

    #[inline(never)]
    fn nearest_sliding_image(&self, shear: &SlidingImages, mut r: DVec3, ticks: i64) -> (DVec3, DVec3) {
        let up = -(r[shear.gradient] / shear.height).round_ties_even();
        let mut velocity = DVec3::ZERO;
        if up != 0.0 {
            r[shear.gradient] += up * shear.height;
            r[shear.flow] += up * self.displacement(ticks).offset;
            velocity[shear.flow] = up * shear.speed;
        }
        (self.periodicity.nearest(r), velocity)
    }

    /// Wraps a position at `ticks` into the box: the position, the number of box lengths, which along the
    /// flow count from the start of the run, and the velocity that has to be added.
    pub fn wrap(&self, mut position: DVec3, ticks: i64) -> (DVec3, [i32; 3], DVec3) {
        let Some(shear) = &self.shear else {
            let (position, wraps) = self.periodicity.wrap(position);
            return (position, wraps, DVec3::ZERO);
        };
        let up = self.periodicity.wrap(position).1[shear.gradient];
        let mut velocity = DVec3::ZERO;
        let mut turned = 0;
        if up != 0 {
            let Displacement { turns, offset } = self.displacement(ticks);
            position[shear.flow] -= f64::from(up) * offset;
            velocity[shear.flow] = -f64::from(up) * shear.speed;
            turned = (i64::from(up) * turns) as i32;
        }
        let (position, mut wraps) = self.periodicity.wrap(position);
        wraps[shear.flow] -= turned;
        (position, wraps, velocity)
    }

    /// The image numbers of a particle at `ticks` in the box whose edge along the gradient is displaced by at
    /// most half an edge: unwrapped position = position + Σ image · edge.
    pub fn image_in_box(&self, mut image: [i32; 3], ticks: i64) -> [i32; 3] {
        if let Some(shear) = &self.shear {
            let turns = self.displacement(ticks).turns;
            image[shear.flow] += (i64::from(image[shear.gradient]) * turns) as i32;
        }
        image
    }

    /// The opposite of [`Self::image_in_box`].
    pub fn image_from_box(&self, mut image: [i32; 3], ticks: i64) -> [i32; 3] {
        if let Some(shear) = &self.shear {
            let turns = self.displacement(ticks).turns;
            image[shear.flow] -= (i64::from(image[shear.gradient]) * turns) as i32;
        }
        image
    }

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
        let Some(shear) = &self.shear else { return 0.0 };
        let [work] = total(self.particles.len(), |i| [self.flight_work(shear, i, self.age(i, self.now))]);
        work
    }
}

/// Makes the velocities of an impact peculiar. The velocity of the second particle before it is that of its
/// image in contact, at `r` from the first one.
pub(crate) fn make_peculiar(
    world: &World,
    changes: &mut [VelocityChange; 2],
    positions: [DVec3; 2],
    r: DVec3,
) {
    let [first, second] = changes;
    let flow = world.flow_velocity(positions[0]);
    (first.before, first.after) = (first.before - flow, first.after - flow);
    second.before -= world.flow_velocity(positions[0] + r);
    second.after -= world.flow_velocity(positions[1]);
}

/// How far particle i and its images have come along the flow at `ticks` since its anchor \[length\]: the
/// rounding error of a contact is relative to that.
pub(crate) fn path(world: &World, i: u32, ticks: i64) -> f64 {
    let Some(shear) = &world.shear else { return 0.0 };
    let along = world.particles[i as usize].velocity[shear.flow].abs();
    along.max(shear.speed.abs()) * world.age(i, ticks)
}

/// Notes the path of particle i in a flight that ends at `ticks`, if it is longer than two edges.
fn note_path(world: &mut World, i: u32, ticks: i64) {
    let path = path(world, i, ticks);
    if world.shear.is_some_and(|shear| path > 2.0 * shear.length) {
        world.longest_flight = world.longest_flight.max(path);
    }
}

/// Adds the work of the shear on particle i in `duration` \[time\] from its anchor. It gets another one then.
pub(crate) fn end_flight_after(state: &mut State, i: u32, duration: f64) {
    let State { world, accumulators, .. } = state;
    let Some(shear) = &world.shear else { return };
    let work = world.flight_work(shear, i, duration);
    accumulators.add_work_in_flight(Term::ShearWork, work);
}

/// Adds the work of the shear on two particles until their impact at `ticks`, and in it: `r` is the vector
/// between their centers and `impulse` that on the second one. Their anchors are still those before.
#[inline(never)]
pub(crate) fn end_flights(state: &mut State, bodies: [u32; 2], r: DVec3, impulse: DVec3, ticks: i64) {
    if state.world.shear.is_none() {
        return;
    }
    for i in bodies {
        note_path(&mut state.world, i, ticks);
        flights::end(state, i, ticks);
    }
    let Some(shear) = &state.world.shear else { return };
    let work = -shear.rate * r[shear.gradient] * impulse[shear.flow];
    let now = state.world.clock.time(ticks);
    state.accumulators.add_energy(Term::ShearWork, now, work);
}
