//! The reference calendar: a binary heap.

use std::{cmp::Reverse, collections::BinaryHeap};

use crate::{Calendar, Event};

/// Binary heap, the plain reference for [`crate::Ladder`].
#[derive(Debug, Clone)]
pub struct Heap<E: Event>(BinaryHeap<Reverse<E>>);

impl<E: Event> Calendar<E> for Heap<E> {
    fn with_capacity(events: usize) -> Self {
        Self(BinaryHeap::with_capacity(events))
    }

    fn push(&mut self, event: E) {
        self.0.push(Reverse(event));
    }

    fn pop_until(&mut self, limit: i64) -> Option<E> {
        if self.0.peek()?.0.time() > limit {
            return None;
        }
        self.0.pop().map(|Reverse(event)| event)
    }

    fn peek(&mut self) -> Option<&E> {
        self.0.peek().map(|Reverse(event)| event)
    }

    fn upcoming(&self, ahead: usize) -> Option<&E> {
        if ahead == 0 { self.0.peek().map(|Reverse(event)| event) } else { None }
    }

    fn clear(&mut self) {
        self.0.clear();
    }

    fn len(&self) -> usize {
        self.0.len()
    }
}
