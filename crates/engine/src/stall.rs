//! Notices when time stands still.

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

/// The run of events in progress.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Stall {
    since: i64,
    events: u64,
}

impl Default for Stall {
    fn default() -> Self {
        Self { since: i64::MIN, events: 0 }
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
            return Err(self.collapse(world, entry));
        }
        Ok(())
    }

    #[cold]
    fn collapse(&self, world: &World, entry: &Entry) -> EngineError {
        EngineError::Collapse {
            time: world.clock.time(entry.time),
            events: self.events,
            span: (entry.time - self.since).max(0) as f64 * world.clock.tick,
            i: entry.owner,
            partner: match entry.target.kind() {
                Kind::Collision(j) => format!("particle {j}"),
                Kind::Wall(wall) => format!("wall {}", world.walls[wall as usize].name),
                Kind::Rest | Kind::Transfer(_) | Kind::Renewal => "nobody".to_owned(),
            },
        }
    }
}
