//! The state of settling beside the particles: when the next scan is due, and the contacts of grains at rest.

use crate::particles::World;

/// A settling scan that is due waits until there have been this many events for each grain that is not at
/// rest…
const EVENTS_PER_GRAIN: f64 = 0.0625;
/// … but not longer than this many periods.
const MOST_PERIODS: u64 = 16;
/// Of more contacts than this, and this for each grain that is not at rest, …
const JAMMED: u64 = 200;
const JAMMED_PER_GRAIN: u64 = 4;
/// … within this part of a period, some are of grains that are jammed.
pub(super) const MOMENT: f64 = 1e-3;

/// The state of settling.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct SettlingState {
    /// When the next settling scan is due \[ticks\].
    pub next: i64,
    /// Events until the last scan, `u64::MAX` before the first, and periods since.
    pub events: u64,
    pub waited: u64,
    /// Contacts since a time \[ticks\] that is a small part of a period ago at most.
    pub recent_contacts: u64,
    pub counted_since: i64,
    /// Of every asleep grain the asleep grains and fixed bodies it is in contact with, in order; a function of
    /// where they are.
    pub near: Vec<Vec<u32>>,
}

impl Default for SettlingState {
    fn default() -> Self {
        Self {
            next: 0,
            events: u64::MAX,
            waited: 0,
            recent_contacts: 0,
            counted_since: i64::MIN,
            near: Vec::new(),
        }
    }
}

impl SettlingState {
    /// Counts a contact at `time` \[ticks\]; whether grains are jammed: without any room they hop without
    /// end.
    #[inline]
    pub fn watch(&mut self, world: &World, time: i64) -> bool {
        let Some(thresholds) = &world.thresholds else { return false };
        self.recent_contacts += 1;
        if (time.saturating_sub(self.counted_since)) as f64 * world.clock.tick > thresholds.period * MOMENT {
            (self.recent_contacts, self.counted_since) = (0, time);
        }
        let is_jammed =
            self.recent_contacts > JAMMED + JAMMED_PER_GRAIN * (world.movable - world.asleep) as u64;
        if is_jammed {
            self.recent_contacts = 0;
        }
        is_jammed
    }

    /// Whether the scan that is due can find anything new, with these events so far and grains not at
    /// rest.
    pub(super) fn is_worth_it(&self, events: u64, free: usize) -> bool {
        let first = self.events == u64::MAX;
        let new = events.wrapping_sub(self.events);
        let enough = new as f64 >= EVENTS_PER_GRAIN * free as f64 || self.waited + 1 >= MOST_PERIODS;
        first || (new > 0 && enough)
    }

    /// The scan that was due, with these events so far, has been made or put off.
    pub(super) fn after_scan(&mut self, events: u64, taken: bool) {
        (self.events, self.waited) = if taken { (events, 0) } else { (self.events, self.waited + 1) };
    }
}
