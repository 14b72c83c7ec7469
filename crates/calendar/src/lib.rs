/*!
Event calendars: priority queues of events in integer time.

A [`Calendar`] returns events in the order of [`Event::time`], in integer ticks. Events of one time come in an
order that depends only on the sequence of calls. It contains no physics: invalidated events stay in it until
they are returned, and the caller drops them then.

[`Ladder`] is the calendar for production, [`WindowQueue`] that for one window of time, [`Heap`] their plain
reference; every test runs them side by side.
*/

mod few;
mod heap;
mod ladder;
mod window_queue;

pub use heap::Heap;
pub use ladder::Ladder;
pub use window_queue::WindowQueue;

/// Something that happens at an integer time. `Ord` must have the time as its first key.
pub trait Event: Copy + Ord {
    /// Time of the event \[ticks\], between −2^62 and 2^62.
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
    /// An event that would be taken about `ahead` events from now: a hint, `None` where it is not known.
    fn upcoming(&self, ahead: usize) -> Option<&E>;
    /// Removes every event.
    fn clear(&mut self);
    /// Number of events held, including invalidated ones.
    fn len(&self) -> usize;
    /// Whether no event is held.
    fn is_empty(&self) -> bool {
        self.len() == 0
    }
}
