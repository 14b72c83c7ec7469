//! The contacts of a window, in the order of events. Simultaneous events are ordered, too, which is possible
//! because all contacts of the window are known.

use std::cmp::Ordering;

use haff_calendar::Event;

use crate::search::entry::{self, Kind};

/// Kinds of contacts in a window.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Contact {
    /// With particle `.0`.
    Collision(u32),
    /// With wall `.0`.
    Wall(u32),
}

impl Kind for Contact {
    #[inline]
    fn encode(self) -> (u32, u32) {
        match self {
            Self::Collision(j) => (entry::COLLISION, j),
            Self::Wall(wall) => (entry::WALL, wall),
        }
    }

    #[inline]
    fn decode(tag: u32, index: u32) -> Self {
        if tag == entry::COLLISION { Self::Collision(index) } else { Self::Wall(index) }
    }
}

/// Queue entry of a contact.
pub(super) type Entry = entry::Entry<Contact>;

/// An entry, ordered by time, then by rank.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct WindowEvent(pub Entry);

impl Ord for WindowEvent {
    #[inline]
    fn cmp(&self, other: &Self) -> Ordering {
        self.0.time.cmp(&other.0.time).then_with(|| self.0.rank().cmp(&other.0.rank())).then_with(|| {
            // Only to make the order total: both entries are for the same event, or one of them is
            // invalidated.
            self.0.cmp(&other.0)
        })
    }
}

impl PartialOrd for WindowEvent {
    #[inline]
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Event for WindowEvent {
    #[inline]
    fn time(&self) -> i64 {
        self.0.time
    }
}
