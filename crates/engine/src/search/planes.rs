//! A lower bound on the distance from walls within a time.
//!
//! Most particles touch no wall within a window of time, or before their next collision. Without this bound,
//! exact predictions with six walls take a third of all instructions of windows in a closed box.

use glam::DVec3;

use crate::{
    model::{Shape, Surface, Wall, WallMotion},
    motion::walls::ShrinkingFrame,
    state::{particle::Particle, world::World},
};

/// Rounding of a distance from a wall is less than this part of the extent of the system.
const SLACK: f64 = 1e-9;

/// The time for which contacts with walls are searched that are wanted within a `duration` [time]: somewhat
/// longer, for the rounding of times.
pub(crate) fn searched(duration: f64, tick: f64) -> f64 {
    duration * (1.0 + 1e-9) + tick
}

/// The walls of a system as planes, and those of other shapes.
#[derive(Debug, Clone, Default)]
pub(crate) struct Planes {
    /// Half-spaces.
    flat: Vec<FilteredPlane>,
    partitions: Vec<FilteredPlane>,
    shapes: Vec<FilteredShape>,
    /// Distances up to this are treated as contacts [length].
    slack: f64,
}

#[derive(Debug, Clone, Copy)]
struct FilteredPlane {
    normal: DVec3,
    /// Distance of the plane from the origin along the normal, at the reference time and at the most
    /// [length].
    offset: f64,
    /// Time at which the plane has its given position [time].
    reference_time: f64,
    /// Mean velocity along the normal [length/time].
    speed: f64,
    /// How far the farthest place of the wall to the other side is behind `offset` [length].
    swing: f64,
    /// Its index.
    wall: u32,
}

impl FilteredPlane {
    /// Height of an anchor above the plane, and its first and second rate of change.
    #[inline(always)]
    fn approach(&self, anchor: &Particle, acceleration: DVec3, time: f64) -> [f64; 3] {
        let height =
            self.normal.dot(anchor.position) - self.offset - self.speed * (time - self.reference_time);
        [height, self.normal.dot(anchor.velocity) - self.speed, self.normal.dot(acceleration)]
    }

    /// Whether a particle can touch a plane within a `duration`, from its distance and the rates of change of
    /// that.
    #[inline(always)]
    fn is_in_reach([distance, rate, pull]: [f64; 3], duration: f64, slack: f64) -> bool {
        // Not larger than the smallest distance: an acceleration away from the wall is left out. Sums of four
        // planes at a time, for vector instructions, take 8 % more instructions of a gas between six walls.
        let approach = rate.min(0.0) + 0.5 * pull.min(0.0) * duration;
        distance + approach * duration <= slack
    }
}

/// A wall that is neither a half-space nor a partition.
#[derive(Debug, Clone, Copy)]
struct FilteredShape {
    surface: &'static dyn Surface,
    /// The middle of a container, and its distance from the surface \[length\]: that of another position is
    /// smaller by at most their distance. Of other walls the distance is 0.
    center: DVec3,
    clearance: f64,
    /// Its index.
    wall: u32,
}

impl FilteredShape {
    fn of(wall: &Wall, index: u32) -> Option<Self> {
        let surface = wall.surface()?;
        let middle = match wall.motion {
            WallMotion::Fixed | WallMotion::Rotating(_) => surface.enclosure().map(|[a, b]| 0.5 * (a + b)),
            _ => None,
        };
        let (center, clearance) = match middle.filter(|middle| middle.is_finite()) {
            Some(middle) => (middle + wall.point, surface.distance(middle) * (1.0 - SLACK)),
            None => (DVec3::ZERO, 0.0),
        };
        Some(Self { surface, center, clearance, wall: index })
    }
}

impl Planes {
    pub fn new(world: &World) -> Self {
        let walls = || world.boundary.walls.iter().zip(0..);
        let shapes = walls().filter_map(|(wall, index)| FilteredShape::of(wall, index));
        let plane = |(wall, index): (&Wall, u32)| {
            let (speed, amplitude) = wall.motion.bound(wall.normal);
            FilteredPlane {
                wall: index,
                normal: wall.normal,
                offset: wall.point.dot(wall.normal) + amplitude,
                reference_time: wall.motion.reference_time(),
                speed,
                swing: 2.0 * amplitude,
            }
        };
        let flat = walls().filter(|(wall, _)| wall.shape.is_none()).map(plane).collect();
        let is_partition = |wall: &Wall| matches!(wall.shape, Some(Shape::Partition(_)));
        let partitions = walls().filter(|(wall, _)| is_partition(wall)).map(plane).collect();
        let extent = world
            .boundary
            .walls
            .iter()
            .map(|wall| wall.coordinates().length())
            .fold(world.periodicity(world.now).size.length(), f64::max);
        Self { flat, partitions, shapes: shapes.collect(), slack: SLACK * extent }
    }

    /// Calls `predict` for each wall that a particle with this anchor can touch within the `duration` [time]
    /// after the anchor. `acceleration` is that of its flight.
    #[inline(always)]
    pub fn for_each_in_reach(
        &self,
        world: &World,
        anchor: &Particle,
        radius: f64,
        acceleration: DVec3,
        duration: f64,
        mut predict: impl FnMut(u32),
    ) {
        let time = world.clock.time(anchor.time);
        for plane in &self.flat {
            let [height, rate, pull] = plane.approach(anchor, acceleration, time);
            if FilteredPlane::is_in_reach([height - radius, rate, pull], duration, self.slack) {
                predict(plane.wall);
            }
        }
        if !(self.partitions.is_empty() && self.shapes.is_empty()) {
            self.for_each_other_in_reach(world, anchor, (radius, acceleration), duration, predict);
        }
    }

    /// [`Self::for_each_in_reach`] for partitions, and for shapes by their distance: it falls no faster than
    /// the particle moves.
    #[inline(never)]
    fn for_each_other_in_reach(
        &self,
        world: &World,
        anchor: &Particle,
        (radius, acceleration): (f64, DVec3),
        duration: f64,
        mut predict: impl FnMut(u32),
    ) {
        let time = world.clock.time(anchor.time);
        for plane in &self.partitions {
            let [mut height, mut rate, mut pull] = plane.approach(anchor, acceleration, time);
            if height < 0.0 {
                [height, rate, pull] = [-height - plane.swing, -rate, -pull];
            }
            if FilteredPlane::is_in_reach([height - radius, rate, pull], duration, self.slack) {
                predict(plane.wall);
            }
        }
        let path = (anchor.velocity.length() + 0.5 * acceleration.length() * duration) * duration;
        for &FilteredShape { surface, center, clearance, wall } in &self.shapes {
            let apart = clearance - (radius + self.slack + path);
            if apart > 0.0 && (anchor.position - center).length_squared() < apart * apart {
                continue;
            }
            let flight = world.relative_flight(anchor, acceleration, wall);
            let (radius, slack, duration) = match &world.boundary.walls[wall as usize].motion {
                WallMotion::Shrinking(motion) => {
                    let frame = ShrinkingFrame::of(motion, (&world.clock, anchor.time));
                    let duration = frame.to(duration);
                    let largest = flight.radius_at(radius, duration).max(radius);
                    (largest / frame.scale, self.slack / frame.scale, duration)
                }
                _ => (radius, self.slack, duration),
            };
            let swing = flight.swing.map_or(0.0, |swing| swing.oscillation.amplitude);
            // Relative to the wall.
            let path = (flight.velocity.length() + 0.5 * acceleration.length() * duration) * duration;
            let reach = radius + slack + swing + path;
            // Also where it is not a number.
            if !reach.is_finite() || surface.is_near(flight.position, reach) {
                predict(wall);
            }
        }
    }
}
