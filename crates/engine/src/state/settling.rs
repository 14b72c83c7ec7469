//! The state of settling: when the next scan is due, and the contacts of grains at rest.

use crate::state::world::World;

/// A settling scan is put off until there have been this many events per grain that is not at rest.
const EVENTS_PER_GRAIN: f64 = 0.0625;
/// A settling scan is put off for at most this many periods.
const MAX_PERIODS: u64 = 16;
/// Grains are jammed if there are more contacts within [`JAM_DURATION`] than this number, plus
/// [`JAM_CONTACTS_PER_GRAIN`] for each grain that is not at rest.
const JAM_CONTACTS: u64 = 200;
const JAM_CONTACTS_PER_GRAIN: u64 = 4;
/// Time in which these contacts are counted [periods between settling scans].
pub(crate) const JAM_DURATION: f64 = 1e-3;

/// The state of settling.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct SettlingState {
    /// When the next settling scan is due \[ticks\].
    pub next: i64,
    /// Total of events at the last scan, `u64::MAX` before the first; and periods by which the next has been
    /// put off.
    pub events: u64,
    pub waited: u64,
    /// Number of contacts since a time \[ticks\], which is at most [`JAM_DURATION`] ago.
    pub recent_contacts: u64,
    pub counted_since: i64,
    /// For every asleep grain the asleep grains and fixed bodies that it touches, in ascending order. They
    /// follow from the positions, so that checkpoints do not contain them.
    pub contacts: Vec<Vec<u32>>,
}

impl Default for SettlingState {
    fn default() -> Self {
        Self {
            next: 0,
            events: u64::MAX,
            waited: 0,
            recent_contacts: 0,
            counted_since: i64::MIN,
            contacts: Vec::new(),
        }
    }
}

impl SettlingState {
    /// Counts a contact at `time` \[ticks\]. Returns whether grains are jammed: without any room they would
    /// collide without end.
    #[inline]
    pub fn count_contact(&mut self, world: &World, time: i64) -> bool {
        let Some(thresholds) = &world.laws.thresholds else { return false };
        self.recent_contacts += 1;
        if (time.saturating_sub(self.counted_since)) as f64 * world.clock.tick
            > thresholds.period * JAM_DURATION
        {
            (self.recent_contacts, self.counted_since) = (0, time);
        }
        let is_jammed = self.recent_contacts
            > JAM_CONTACTS + JAM_CONTACTS_PER_GRAIN * (world.movable - world.asleep) as u64;
        if is_jammed {
            self.recent_contacts = 0;
        }
        is_jammed
    }

    /// Whether the scan that is due should be made. `events` is the total so far, `awake` the number of
    /// grains that are not at rest. Without new events a scan would find nothing new.
    pub(crate) fn should_scan(&self, events: u64, awake: usize) -> bool {
        let first = self.events == u64::MAX;
        let new = events.wrapping_sub(self.events);
        let enough = new as f64 >= EVENTS_PER_GRAIN * awake as f64 || self.waited + 1 >= MAX_PERIODS;
        first || (new > 0 && enough)
    }

    /// Records that the scan that was due has been made or put off, at this total of events.
    pub(crate) fn after_scan(&mut self, events: u64, made: bool) {
        (self.events, self.waited) = if made { (events, 0) } else { (self.events, self.waited + 1) };
    }
}
