//! The events of the calendar of a search.

use crate::{
    laws::event::AnyEvent,
    search::entry::{self, Kind},
};

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

impl SearchEvent {
    /// The event that ends the rest of particle i on a wall, or its bounces or slide there, if this is one.
    #[inline(always)]
    pub fn of_support(self, i: u32) -> Option<AnyEvent> {
        match self {
            Self::EndOfBounces => Some(AnyEvent::EndOfBounces(i)),
            Self::Release => Some(AnyEvent::Release(i)),
            Self::EndOfSlide => Some(AnyEvent::EndOfSlide(i)),
            _ => None,
        }
    }
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
        // In the order of their frequency.
        match (tag, index) {
            (entry::COLLISION, j) => Self::Collision(j),
            (entry::UPDATE, entry::PREDICTION) => Self::Prediction,
            (entry::UPDATE, code) => Self::Crossing(code as u8),
            (entry::WALL, wall) => Self::Wall(wall),
            (_, 0) => Self::EndOfBounces,
            (_, 1) => Self::Release,
            _ => Self::EndOfSlide,
        }
    }
}
