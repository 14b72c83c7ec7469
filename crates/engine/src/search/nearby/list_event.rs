//! Events in the calendar of this scheduler.

use crate::search::entry::{self, Kind};

/// The event of a calendar entry.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum ListEvent {
    /// Collision with particle `.0`.
    Collision(u32),
    /// Collision with wall `.0`.
    Wall(u32),
    /// The particle leaves its skin sphere, so its list is updated.
    ListUpdate,
    /// No event within the horizon: the particle is predicted again when the horizon is reached.
    Prediction,
}

impl Kind for ListEvent {
    #[inline]
    fn encode(self) -> (u32, u32) {
        match self {
            Self::Collision(j) => (entry::COLLISION, j),
            Self::Wall(wall) => (entry::WALL, wall),
            Self::ListUpdate => (entry::UPDATE, 0),
            Self::Prediction => (entry::UPDATE, entry::PREDICTION),
        }
    }

    #[inline]
    fn decode(tag: u32, index: u32) -> Self {
        match (tag, index) {
            (entry::COLLISION, j) => Self::Collision(j),
            (entry::WALL, wall) => Self::Wall(wall),
            (_, entry::PREDICTION) => Self::Prediction,
            _ => Self::ListUpdate,
        }
    }
}

/// A calendar entry of this scheduler.
pub(super) type Entry = entry::Entry<ListEvent>;
