//! Detects an inelastic collapse: very many events at what is one time.

use std::collections::BTreeSet;

use glam::DVec3;

use crate::{error::EngineError, particles::World};

/// A run of events within this many ticks…
const SPAN: i64 = 1 << 10;
/// …of more than this number, and this number per particle, is a collapse.
const EVENTS: u64 = 100_000;
const EVENTS_PER_PARTICLE: u64 = 10;
/// Of so many events after that the participants are noted.
const NOTED: u64 = 10_000;

/// The run of events in progress. Only collisions, wall collisions and ends of rests count, which all engines
/// have in common; checkpoints keep it. So a collapse is reported at the same event by every engine and after
/// every resume.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Stall {
    /// When it began \[ticks\], and events since then.
    pub since: i64,
    pub events: u64,
    /// Participants of the last of very many events.
    pub particles: BTreeSet<u32>,
    pub walls: BTreeSet<u32>,
}

impl Default for Stall {
    fn default() -> Self {
        Self { since: i64::MIN, events: 0, particles: BTreeSet::new(), walls: BTreeSet::new() }
    }
}

impl Stall {
    /// Counts an event at `time` \[ticks\]; an error if there have been too many at what is one time.
    #[inline(always)]
    pub fn watch(
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
            return self.note(world, time, particles, wall);
        }
        Ok(())
    }

    /// Notes the particles and the wall of an event, and gives up when enough is known.
    #[cold]
    fn note(
        &mut self,
        world: &World,
        time: i64,
        particles: [u32; 2],
        wall: Option<u32>,
    ) -> Result<(), EngineError> {
        let enough = EVENTS + EVENTS_PER_PARTICLE * world.particles.len() as u64 + NOTED;
        if self.events + NOTED == enough + 1 {
            self.particles.clear();
            self.walls.clear();
        }
        self.particles.extend(particles);
        self.walls.extend(wall);
        if self.events < enough {
            return Ok(());
        }
        let error = self.collapse(world, time, particles[0]);
        // The event does not happen: from a checkpoint made now it is counted again.
        self.events -= 1;
        Err(error)
    }

    fn collapse(&self, world: &World, time: i64, particle: u32) -> EngineError {
        let least = self.particles.first().copied().unwrap_or(particle);
        let first = world.state(least, time).0;
        let among: DVec3 =
            self.particles.iter().map(|&i| world.periodicity.nearest(world.state(i, time).0 - first)).sum();
        // A particle at rest on a wall has no events with it any more.
        let supports = self.particles.iter().flat_map(|&i| world.support(i)).flatten().map(u32::from);
        let walls: BTreeSet<u32> = self.walls.iter().copied().chain(supports).collect();
        let position = first + among / self.particles.len() as f64;
        EngineError::Collapse {
            time: world.clock.time(time),
            events: self.events,
            span: (time - self.since).max(0) as f64 * world.clock.tick,
            particles: self.particles.iter().copied().collect(),
            walls: walls.iter().map(|&wall| world.walls[wall as usize].name.clone()).collect(),
            position: world.periodicity.wrap(position).0.to_array(),
            could_rest: world.gravity != DVec3::ZERO && world.thresholds.is_none(),
        }
    }
}
