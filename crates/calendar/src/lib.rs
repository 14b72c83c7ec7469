/*!
Event calendars: priority queues of events in integer time.

A [`Calendar`] hands out events in the order of [`Event::time`], in integer ticks; those of one time in any order, which is the same
whenever it has been used in the same way. It knows no physics: events that have become void stay in it until they surface, and the caller
drops them then.

[`Ladder`] is the calendar for production, [`Agenda`] that of a single window of time, [`Heap`] their plain twin; every test
drives them side by side.
*/

mod agenda;
mod few;
mod heap;
mod ladder;

pub use agenda::Agenda;
pub use heap::Heap;
pub use ladder::Ladder;

/// Something that happens at an integer time. `Ord` must have the time as its first key.
pub trait Event: Copy + Ord {
    /// When it happens \[ticks\], between −2^62 and 2^62.
    fn time(&self) -> i64;
}

/// A priority queue of events, earliest first.
pub trait Calendar<E: Event> {
    /// A calendar for about `events` live events.
    fn with_capacity(events: usize) -> Self;
    /// Adds an event; it may lie before the last one taken.
    fn push(&mut self, event: E);
    /// Takes the first event if its time is at most `limit`.
    fn pop_until(&mut self, limit: i64) -> Option<E>;
    /// The first event.
    fn peek(&mut self) -> Option<&E>;
    /// Time of the first event.
    fn next_time(&mut self) -> Option<i64> {
        self.peek().map(Event::time)
    }
    /// An event that will be taken `ahead` events from now or thereabouts; a hint, and `None` where that is not at hand.
    fn upcoming(&self, ahead: usize) -> Option<&E>;
    /// Removes every event.
    fn clear(&mut self);
    /// Number of events held, void ones among them.
    fn len(&self) -> usize;
    /// Whether no event is held.
    fn is_empty(&self) -> bool {
        self.len() == 0
    }
}
