//! Distances from walls, and contacts with them.

use glam::DVec3;
use haff_mechanics::{RelativeFlight, Surface, Swing};

use crate::{
    model::{
        Shape, WallMotion,
        bounds::allowed_overlap,
        wall_law::WallLaw,
        wall_motion::{Approach, Shrinking, WallTime},
    },
    numerics::clock::HORIZON,
    state::{
        particle::{ClassData, Particle},
        world::World,
    },
};

/// The frame in which a surface that shrinks is at rest: x/s at the time θ = τ/s, a time τ after an anchor,
/// with s = s₀ − γ τ. There a straight flight is straight, and a particle grows.
#[derive(Debug, Clone, Copy)]
pub(crate) struct ShrinkingFrame {
    /// s₀: the size of the surface at the anchor, as a part of that at time 0.
    pub scale: f64,
    /// γ [1/time].
    rate: f64,
}

impl ShrinkingFrame {
    /// That of an anchor at a time.
    pub fn of(motion: &Shrinking, at: impl WallTime) -> Self {
        Self { scale: motion.scale(at), rate: motion.rate }
    }

    /// The time θ = τ/s of the frame at a time τ after the anchor \[time\].
    pub fn to(&self, delay: f64) -> f64 {
        let scale = self.scale - self.rate * delay;
        if delay < f64::INFINITY && scale > 0.0 { delay / scale } else { f64::INFINITY }
    }

    /// The time after the anchor at a time of the frame; `None` if that is never.
    fn from(&self, time: f64) -> Option<f64> {
        if time == f64::INFINITY {
            return Some(time);
        }
        let growth = 1.0 + self.rate * time;
        (growth > 0.0).then(|| self.scale * time / growth)
    }
}

impl World {
    /// Signed distance of a particle's surface from a wall and its rate of change, for a particle at
    /// `position` with `velocity` at `ticks`.
    #[inline]
    pub fn wall_approach(
        &self,
        wall: u32,
        radius: f64,
        position: DVec3,
        velocity: DVec3,
        ticks: i64,
    ) -> (f64, f64) {
        if let Some(shape) = &self.boundary.walls[wall as usize].shape {
            return self.surface_approach((wall, shape), radius, (position, velocity), ticks);
        }
        self.plane_approach(wall, radius, position, velocity, ticks)
    }

    /// [`Self::wall_approach`] of a wall that is no half-space.
    #[inline(never)]
    fn surface_approach(
        &self,
        (wall, shape): (u32, &Shape),
        radius: f64,
        state: (DVec3, DVec3),
        ticks: i64,
    ) -> (f64, f64) {
        let (position, velocity) = self.relative_to(wall, state, ticks);
        let (distance, rate) = shape.surface().approach(position, velocity);
        if let WallMotion::Shrinking(motion) = &self.boundary.walls[wall as usize].motion {
            let scale = motion.scale((&self.clock, ticks));
            return (scale * distance - radius, rate - motion.rate * distance);
        }
        (distance - radius, rate)
    }

    /// [`Self::wall_approach`] of a half-space.
    #[inline]
    fn plane_approach(
        &self,
        wall: u32,
        radius: f64,
        position: DVec3,
        velocity: DVec3,
        ticks: i64,
    ) -> (f64, f64) {
        if self.is_level(wall) {
            let wall = &self.boundary.walls[wall as usize];
            let contact = wall.point.dot(wall.normal) + radius;
            return (position.dot(wall.normal) - contact, velocity.dot(wall.normal));
        }
        let wall = &self.boundary.walls[wall as usize];
        let mut point = wall.point;
        let mut relative = velocity;
        if wall.motion.is_moving() {
            point += wall.motion.displacement(wall.normal, (&self.clock, ticks));
            relative -= wall.motion.velocity(wall.normal, (&self.clock, ticks));
        }
        ((position - point).dot(wall.normal) - radius, relative.dot(wall.normal))
    }

    /// Time from an anchor until its flight touches a wall \[ticks\]; `None` if it never does. Contacts later
    /// than `within` \[time\] are not wanted: some are found, others not.
    #[inline(always)]
    pub fn wall_contact(
        &self,
        anchor: &Particle,
        radius: f64,
        acceleration: DVec3,
        wall: u32,
        within: f64,
    ) -> Option<f64> {
        if self.laws.has_passages && self.wall_law(&self.classes[anchor.class()], wall) == WallLaw::Passes {
            return None;
        }
        if let Some(shape) = &self.boundary.walls[wall as usize].shape {
            return self.surface_contact(anchor, (radius, within), acceleration, (wall, shape));
        }
        let (distance, rate) =
            self.plane_approach(wall, radius, anchor.position, anchor.velocity, anchor.time);
        let wall = &self.boundary.walls[wall as usize];
        let approach = Approach {
            distance,
            rate,
            speed: anchor.velocity.dot(wall.normal),
            acceleration: acceleration.dot(wall.normal),
        };
        let delay = wall.motion.time_to_contact(&approach, (&self.clock, anchor.time))?;
        Some(delay * self.clock.per_time)
    }

    /// [`Self::wall_contact`] for a wall that is no half-space; infinite beyond the horizon.
    #[inline(never)]
    fn surface_contact(
        &self,
        anchor: &Particle,
        (radius, within): (f64, f64),
        acceleration: DVec3,
        (wall, shape): (u32, &Shape),
    ) -> Option<f64> {
        let horizon = ((self.now - anchor.time).max(0) as f64 + HORIZON) * self.clock.tick;
        let within = within.min(horizon);
        if self.is_piston(wall) {
            // No search for partners predicts these contacts (`search/pistons.rs`).
            return None;
        }
        let flight = self.relative_flight(anchor, acceleration, wall);
        if let WallMotion::Shrinking(motion) = &self.boundary.walls[wall as usize].motion {
            let frame = ShrinkingFrame::of(motion, (&self.clock, anchor.time));
            let (radius, within) = (radius / frame.scale, frame.to(within));
            let delay = frame.from(shape.surface().time_to_contact(&flight, radius, within)?)?;
            return Some(delay * self.clock.per_time);
        }
        let delay = shape.surface().time_to_contact(&flight, radius, within)?;
        Some(delay * self.clock.per_time)
    }

    /// The flight of a particle from its anchor on, relative to a wall that is no half-space, in the
    /// coordinates of its surface; beside one that shrinks it is in its [`ShrinkingFrame`].
    pub fn relative_flight(&self, anchor: &Particle, acceleration: DVec3, wall: u32) -> RelativeFlight {
        let wall = &self.boundary.walls[wall as usize];
        let at = (&self.clock, anchor.time);
        let position = anchor.position - wall.origin();
        let mut flight = RelativeFlight::new(position, anchor.velocity, acceleration);
        match &wall.motion {
            WallMotion::Fixed | WallMotion::Rotating(_) | WallMotion::Piston(_) => {}
            WallMotion::Shrinking(motion) => {
                flight.position /= motion.scale(at);
                flight.velocity += flight.position * motion.rate;
                flight.growth = motion.rate;
            }
            WallMotion::Constant(motion) => {
                flight.position -= wall.motion.displacement(wall.normal, at);
                flight.velocity -= motion.velocity;
            }
            WallMotion::Oscillating(motion) => {
                let (direction, cycles) = (wall.normal, motion.at(at));
                flight.swing = Some(Swing { direction, oscillation: motion.oscillation, cycles });
            }
        }
        flight
    }

    /// Position and velocity relative to the surface of a wall, in the coordinates of this surface.
    fn relative_to(&self, wall: u32, (position, velocity): (DVec3, DVec3), ticks: i64) -> (DVec3, DVec3) {
        let wall = &self.boundary.walls[wall as usize];
        let at = (&self.clock, ticks);
        if let WallMotion::Shrinking(motion) = &wall.motion {
            let position = position / motion.scale(at);
            return (position, velocity + position * motion.rate);
        }
        (position - wall.moved(at), velocity - wall.motion.velocity(wall.normal, at))
    }

    /// Signed distance of a position of particle i from a wall at present \[length\]: of a closed surface
    /// negative on the wrong side. Infinite if the particle passes through the wall.
    pub fn wall_distance(&self, i: u32, wall: u32, position: DVec3) -> f64 {
        self.distance_for(self.class(i), wall, position)
    }

    /// [`Self::wall_distance`] for a particle of this class.
    pub fn distance_for(&self, class: &ClassData, wall: u32, position: DVec3) -> f64 {
        if self.laws.has_passages && self.wall_law(class, wall) == WallLaw::Passes {
            return f64::INFINITY;
        }
        let plane = &self.boundary.walls[wall as usize];
        if plane.shape.is_some() {
            return plane.distance(position, (&self.clock, self.now));
        }
        self.wall_approach(wall, 0.0, position, DVec3::ZERO, self.now).0
    }

    /// Whether a wall is at rest, under gravity, and perpendicular to an axis. A contact with such a wall has
    /// a fixed coordinate: every bounce starts and ends at exactly the same height, and rounding changes no
    /// energy.
    #[inline]
    pub fn is_level(&self, wall: u32) -> bool {
        self.boundary.level[wall as usize]
    }

    /// Unit normal of a wall towards particle i in contact, with this position and velocity at `ticks`: in an
    /// edge that of the side which the particle approaches.
    #[inline]
    pub fn contact_normal(&self, i: u32, wall: u32, state: (DVec3, DVec3), ticks: i64) -> DVec3 {
        match &self.boundary.walls[wall as usize].shape {
            None => self.boundary.walls[wall as usize].normal,
            Some(shape) => self.surface_normal(i, (wall, shape), state, ticks),
        }
    }

    /// [`Self::contact_normal`] of a wall that is no half-space.
    #[inline(never)]
    fn surface_normal(
        &self,
        i: u32,
        (wall, shape): (u32, &Shape),
        state: (DVec3, DVec3),
        ticks: i64,
    ) -> DVec3 {
        let (position, velocity) = self.relative_to(wall, state, ticks);
        let surface = match shape {
            Shape::Partition(partition) => return partition.normal(position),
            Shape::Named(named) => named.get(),
        };
        let plane = &self.boundary.walls[wall as usize];
        let radius = self.class(i).radius;
        let coordinates = self.coordinates(i).max(state.0.abs()).max(plane.coordinates()).max_element();
        let slack = allowed_overlap(radius, coordinates + self.resolution.extent);
        surface.contact_normal(
            position,
            velocity,
            (radius + slack) / plane.motion.scale((&self.clock, ticks)),
        )
    }
}
