//! The events of the calendar of a search.

use crate::search::entry::{self, Kind};

/// The kind of event of an entry in this calendar.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum SearchEvent {
    /// Collision with particle `.0`.
    Collision(u32),
    /// Collision with wall `.0`.
    Wall(u32),
    /// End of a completed series of bounces.
    EndOfBounces,
    /// The particle leaves the wall that carries it.
    Release,
    /// The particle ends to slide on a wall.
    EndOfSlide,
    /// Crossing into another cell, or update of a list; `.0` is the code of the search.
    Crossing(u8),
    /// No event within the horizon; at the horizon the particle is predicted again.
    Prediction,
}

impl Kind for SearchEvent {
    #[inline]
    fn encode(self) -> (u32, u32) {
        match self {
            Self::Collision(j) => (entry::COLLISION, j),
            Self::Wall(wall) => (entry::WALL, wall),
            Self::EndOfBounces => (entry::END_OF_BOUNCES, 0),
            Self::Release => (entry::END_OF_BOUNCES, 1),
            Self::EndOfSlide => (entry::END_OF_BOUNCES, 2),
            Self::Crossing(code) => (entry::UPDATE, u32::from(code)),
            Self::Prediction => (entry::UPDATE, entry::PREDICTION),
        }
    }

    #[inline]
    fn decode(tag: u32, index: u32) -> Self {
        match tag {
            entry::COLLISION => Self::Collision(index),
            entry::WALL => Self::Wall(index),
            entry::END_OF_BOUNCES if index == 0 => Self::EndOfBounces,
            entry::END_OF_BOUNCES if index == 1 => Self::Release,
            entry::END_OF_BOUNCES => Self::EndOfSlide,
            _ if index == entry::PREDICTION => Self::Prediction,
            _ => Self::Crossing(index as u8),
        }
    }
}
