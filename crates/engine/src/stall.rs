//! Notices when time stands still.

use std::collections::BTreeSet;

use glam::DVec3;

use crate::{
    entry::{Entry, Kind},
    error::EngineError,
    particles::World,
};

/// A run of events within this many ticks…
const SPAN: i64 = 1 << 10;
/// …of more than this number, and this number per particle, is a collapse.
const EVENTS: u64 = 100_000;
const EVENTS_PER_PARTICLE: u64 = 10;
/// Of so many events after that it is noted who takes part.
const NOTED: u64 = 10_000;

/// The run of events in progress. Only collisions, wall collisions and ends of rests count, which all engines have in
/// common; checkpoints keep it. So a collapse is reported at the same event by every engine and after every resume.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Stall {
    /// When it began \[ticks\], and events since then.
    pub since: i64,
    pub events: u64,
    /// Who took part in the last of very many events.
    pub particles: BTreeSet<u32>,
    pub walls: BTreeSet<u32>,
}

impl Default for Stall {
    fn default() -> Self {
        Self { since: i64::MIN, events: 0, particles: BTreeSet::new(), walls: BTreeSet::new() }
    }
}

impl Stall {
    /// Counts an event; an error if there have been too many at what is one time.
    #[inline]
    pub fn watch(&mut self, world: &World, entry: &Entry) -> Result<(), EngineError> {
        self.events += 1;
        if entry.time.saturating_sub(self.since) >= SPAN {
            self.since = entry.time;
            self.events = 0;
        }
        if self.events > EVENTS + EVENTS_PER_PARTICLE * world.particles.len() as u64 {
            return self.note(world, entry);
        }
        Ok(())
    }

    /// Notes who takes part, and gives up when enough is known.
    #[cold]
    fn note(&mut self, world: &World, entry: &Entry) -> Result<(), EngineError> {
        let enough = EVENTS + EVENTS_PER_PARTICLE * world.particles.len() as u64 + NOTED;
        if self.events + NOTED == enough + 1 {
            self.particles.clear();
            self.walls.clear();
        }
        self.particles.insert(entry.owner);
        match entry.target.kind() {
            Kind::Collision(j) => {
                self.particles.insert(j);
            }
            Kind::Wall(wall) => {
                self.walls.insert(wall);
            }
            // The others are not counted.
            Kind::Rest | Kind::Transfer(_) | Kind::Renewal => {}
        }
        if self.events < enough {
            return Ok(());
        }
        let error = self.collapse(world, entry);
        // The event does not happen: from a checkpoint made now it is counted again.
        self.events -= 1;
        Err(error)
    }

    fn collapse(&self, world: &World, entry: &Entry) -> EngineError {
        let least = self.particles.first().copied().unwrap_or(entry.owner);
        let first = world.state(least, entry.time).0;
        let among: DVec3 =
            self.particles.iter().map(|&i| world.nearest_image(world.state(i, entry.time).0 - first)).sum();
        // Who rests on a wall has no events with it any more.
        let supports = self.particles.iter().flat_map(|&i| world.support(i)).flatten().map(u32::from);
        let walls: BTreeSet<u32> = self.walls.iter().copied().chain(supports).collect();
        let position = first + among / self.particles.len() as f64;
        EngineError::Collapse {
            time: world.clock.time(entry.time),
            events: self.events,
            span: (entry.time - self.since).max(0) as f64 * world.clock.tick,
            particles: self.particles.iter().copied().collect(),
            walls: walls.iter().map(|&wall| world.walls[wall as usize].name.clone()).collect(),
            position: world.wrap(position).0.to_array(),
            could_rest: world.gravity != DVec3::ZERO && world.thresholds.is_none(),
        }
    }
}
