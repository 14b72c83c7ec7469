//! Detects an inelastic collapse: very many events at almost one time.
//!
//! If time advances by less than 2^27 ticks over 10⁵ events and ten per particle, `advance` returns an error
//! that names time, place, particles and walls; what was recorded stays. Only collisions, wall collisions
//! and ends of bounces count (`stall`), and checkpoints keep the count: the error comes at the same event
//! with every search and after every resumption.

use std::collections::BTreeSet;

use glam::DVec3;

use crate::{model::rest_speed::rest_speed_of_diameter, numerics::error::EngineError, state::world::World};

/// Longest duration of a run of events that counts as a collapse [ticks]: some 10⁻⁸ of the time in which the
/// fastest particle crosses the system. In a collapse the clock need not stand still: bounces whose height
/// is the rounding of a coordinate take some ticks each.
const SPAN: i64 = 1 << 27;
/// A run within [`SPAN`] is a collapse if it has more events than this number, plus [`EVENTS_PER_PARTICLE`]
/// for each particle.
const EVENTS: u64 = 100_000;
const EVENTS_PER_PARTICLE: u64 = 10;
/// The same where a temperature is held in a box that becomes shorter: near jamming all particles have more
/// and more events, as long as the clock resolves them.
const SPAN_OF_JAM: i64 = 1 << 8;
/// Those events are of most particles; of the last ones recorded, at least of this part of them.
const JAMMED: f64 = 0.25;
/// The participants of this many further events are recorded before the collapse is reported.
const RECORDED_EVENTS: u64 = 10_000;

/// The present run of events. Only collisions, wall collisions and ends of series of bounces count: these are
/// the same with every scheduler. Checkpoints contain the run. So a collapse is reported at the same event
/// with every scheduler and after every resumption.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Stall {
    /// Start of the run \[ticks\], and number of events since then.
    pub since: i64,
    pub events: u64,
    /// Participants of the last [`RECORDED_EVENTS`] events before a collapse.
    pub particles: BTreeSet<u32>,
    pub walls: BTreeSet<u32>,
}

impl Default for Stall {
    fn default() -> Self {
        Self { since: i64::MIN, events: 0, particles: BTreeSet::new(), walls: BTreeSet::new() }
    }
}

impl Stall {
    /// Counts an event at `time` \[ticks\]. Returns an error if there have been too many at almost one time.
    #[inline(always)]
    pub fn count_event(
        &mut self,
        world: &World,
        time: i64,
        participants: impl FnOnce() -> ([u32; 2], Option<u32>),
    ) -> Result<(), EngineError> {
        self.events += 1;
        if time.saturating_sub(self.since) >= SPAN {
            self.since = time;
            self.events = 0;
        }
        if self.events > EVENTS + EVENTS_PER_PARTICLE * world.particles.len() as u64 {
            let (particles, wall) = participants();
            return self.record_participants(world, time, particles, wall);
        }
        Ok(())
    }

    /// Whether this number of further events cannot be a collapse.
    pub fn allows(&self, world: &World, events: u64) -> bool {
        self.events + events <= EVENTS + EVENTS_PER_PARTICLE * world.particles.len() as u64
    }

    /// Counts events at these times \[ticks\], in order, that [are no collapse](Self::allows).
    pub fn count_sorted(&mut self, times: &[i64]) {
        for &time in times {
            self.events += 1;
            if time.saturating_sub(self.since) >= SPAN {
                self.since = time;
                self.events = 0;
            }
        }
    }

    /// Records the particles and the wall of an event. Returns the error of a collapse after enough events.
    #[cold]
    fn record_participants(
        &mut self,
        world: &World,
        time: i64,
        particles: [u32; 2],
        wall: Option<u32>,
    ) -> Result<(), EngineError> {
        let enough = EVENTS + EVENTS_PER_PARTICLE * world.particles.len() as u64 + RECORDED_EVENTS;
        if self.events + RECORDED_EVENTS == enough + 1 {
            self.particles.clear();
            self.walls.clear();
        }
        self.particles.extend(particles);
        self.walls.extend(wall);
        if self.events < enough {
            return Ok(());
        }
        if self.is_jam(world, time) {
            (self.since, self.events) = (time, 0);
            return Ok(());
        }
        let error = self.collapse(world, time, particles[0]);
        // The event is not resolved: a run that resumes from here counts it again.
        self.events -= 1;
        Err(error)
    }

    /// Whether so many events are those of particles that jam, and not of a few that collapse.
    fn is_jam(&self, world: &World, time: i64) -> bool {
        // With a temperature that is held: else the work of the compression heats them without bound, and
        // jamming takes infinitely many events.
        let count = world.particles.len().min(RECORDED_EVENTS as usize) as f64;
        world.resolution.holds
            && time - self.since >= SPAN_OF_JAM
            && self.particles.len() as f64 >= JAMMED * count
    }

    fn collapse(&self, world: &World, time: i64, particle: u32) -> EngineError {
        let lowest = self.particles.first().copied().unwrap_or(particle);
        let first = world.state(lowest, time).0;
        let among: DVec3 =
            self.particles.iter().map(|&i| world.nearest_image(world.state(i, time).0 - first, time).0).sum();
        // Supporting walls are added: a particle at rest on a wall has no more events with it.
        let supports = self.particles.iter().flat_map(|&i| world.support(i)).flatten().map(u32::from);
        let walls: BTreeSet<u32> = self.walls.iter().copied().chain(supports).collect();
        let position = first + among / self.particles.len() as f64;
        EngineError::Collapse {
            time: world.clock.shown(time),
            events: self.events,
            span: (time - self.since).max(0) as f64 * world.clock.tick,
            particles: self.particles.iter().copied().collect(),
            walls: walls.iter().map(|&wall| world.boundary.walls[wall as usize].name.clone()).collect(),
            position: world.wrap(position, time).0.to_array(),
            contact_duration: 0.0,
            // A jam that lasts needs a larger speed than the one that is set.
            rest_speed: world
                .laws
                .thresholds
                .map_or_else(|| suitable_rest_speed(world), |thresholds| 2.0 * thresholds.wake),
        }
    }
}

/// A value for `contact.rest_speed` that suits the system \[length/time\]: 0.05 √(g d) of the smallest
/// diameter d, with one digit. 0 without gravity.
fn suitable_rest_speed(world: &World) -> f64 {
    let least = world.classes.iter().map(|class| class.radius).fold(f64::INFINITY, f64::min);
    rest_speed_of_diameter(world.gravity.length(), 2.0 * least)
}
