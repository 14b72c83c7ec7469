/*!
Event calendars: priority queues of events in integer time.

A [`Calendar`] returns events in the order of [`Event::time`], in integer ticks. The order of events with
equal times depends only on the sequence of calls. A calendar contains no physics: it returns invalidated
events like all others, and the caller drops them.

[`Ladder`] is the calendar for whole runs, and [`WindowQueue`] is the queue for one window of time. [`Heap`]
is their plain reference: the tests compare them with it.
*/

mod few;
mod heap;
mod ladder;
mod window_queue;

pub use heap::Heap;
pub use ladder::Ladder;
pub use window_queue::WindowQueue;

/// An event at an integer time. `Ord` must compare the times first.
pub trait Event: Copy + Ord {
    /// Time of the event \[ticks\], between −2^62 and 2^62.
    fn time(&self) -> i64;
}

/// A priority queue of events, earliest first.
pub trait Calendar<E: Event> {
    /// A calendar for about `events` events at a time.
    fn with_capacity(events: usize) -> Self;
    /// Adds an event. Its time may be before that of the last event taken.
    fn push(&mut self, event: E);
    /// Removes and returns the first event if its time is at most `limit`.
    fn pop_until(&mut self, limit: i64) -> Option<E>;
    /// The first event.
    fn peek(&mut self) -> Option<&E>;
    /// Time of the first event.
    fn next_time(&mut self) -> Option<i64> {
        self.peek().map(Event::time)
    }
    /// The event that is expected to be taken `ahead` events after the next one. This is a hint, and `None`
    /// if it is not known.
    fn upcoming(&self, ahead: usize) -> Option<&E>;
    /// Removes every event.
    fn clear(&mut self);
    /// Number of events in the calendar, including invalidated ones.
    fn len(&self) -> usize;
    /// Whether the calendar contains no events.
    fn is_empty(&self) -> bool {
        self.len() == 0
    }
}
