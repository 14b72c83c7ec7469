/*!
A calendar of one window of time: buckets of equal width, filled once, and drained in order.

Most events are known when the window opens: they are sorted into buckets by counting, so that they lie in memory in the
order in which they will be taken. Events that arrive later wait in lists, one per bucket. The next few are a sorted run, so that what
comes soon can be [seen](Agenda::soon) beforehand.
*/

use std::{cmp::Reverse, collections::BinaryHeap};

use crate::{Event, few::sort_to};

/// Events per bucket that the width is chosen for: the sort of a run stays within two cache lines or three.
const TARGET: usize = 4;
/// Events that have been taken before the room that they stood in is used again.
const TAKEN: usize = 64;
/// Longest run: what comes later of the same bucket waits in a heap. Insertion into a run takes time in proportion to its
/// length, and very many events may fall into one bucket, where a particle is caught in a wedge.
const LONGEST_RUN: usize = 256;
/// End of a list.
const NONE: u32 = u32::MAX;

/// An agenda; see the [module's page](self).
#[derive(Debug, Clone)]
pub struct Agenda<E: Event> {
    begin: i64,
    /// log₂ of a bucket's width in ticks.
    shift: u32,
    /// Events known from the start, by bucket; bucket b ends at `ends[b]`.
    known: Vec<E>,
    ends: Vec<u32>,
    /// Later events: lists through `nodes`, from `heads[b]` on.
    heads: Vec<u32>,
    nodes: Vec<(E, u32)>,
    /// The last bucket that the run holds, −1 before the first.
    current: i64,
    /// Those of a bucket, before they are sorted.
    unsorted: Vec<E>,
    /// The next events in their order, from `head` on.
    run: Vec<E>,
    head: usize,
    /// Events of the run's buckets that are too many for it, all later than those in it.
    crowd: BinaryHeap<Reverse<E>>,
    /// Length of the run, with what has been taken of it, from which on it is not simply inserted into: none while there is a crowd.
    longest: usize,
    /// How many the run shall hold.
    lead: usize,
    len: usize,
}

impl<E: Event> Default for Agenda<E> {
    fn default() -> Self {
        Self {
            begin: 0,
            shift: 0,
            known: Vec::new(),
            ends: Vec::new(),
            heads: Vec::new(),
            nodes: Vec::new(),
            current: -1,
            unsorted: Vec::new(),
            run: Vec::new(),
            head: 0,
            crowd: BinaryHeap::new(),
            longest: LONGEST_RUN,
            lead: 1,
            len: 0,
        }
    }
}

impl<E: Event> Agenda<E> {
    /// Keeps the next `events` sorted, as far as there are, so that they can be seen [soon](Self::soon).
    pub fn keep_sorted(&mut self, events: usize) {
        self.lead = events.max(1);
    }

    /// Forgets everything and opens a window [`begin`, `end`] \[ticks\], `begin` < `end`, with the events known from the start.
    ///
    /// Events before or after the window are taken in their order too, only less quickly.
    pub fn open(&mut self, begin: i64, end: i64, events: &[E]) {
        let buckets = (events.len() / TARGET).clamp(1, 1 << 24) as u64;
        let span = end.saturating_sub(begin).max(1) as u64;
        self.begin = begin;
        // The least width of a power of two that covers the window with at most that many buckets.
        self.shift = u64::BITS - (span / buckets).leading_zeros();
        let buckets = (span >> self.shift) as usize + 1;
        self.ends.clear();
        self.ends.resize(buckets + 1, 0);
        self.heads.clear();
        self.heads.resize(buckets, NONE);
        self.nodes.clear();
        self.run.clear();
        self.head = 0;
        self.crowd.clear();
        self.longest = LONGEST_RUN;
        self.current = -1;
        self.len = events.len();
        for event in events {
            let bucket = self.bucket(event.time());
            self.ends[bucket] += 1;
        }
        let mut sum = 0;
        for end in &mut self.ends {
            sum += *end;
            *end = sum;
        }
        if let Some(&first) = events.first() {
            self.known.clear();
            self.known.resize(events.len(), first);
        }
        // From behind: the ends become the beginnings, which are the ends of the buckets before.
        for event in events.iter().rev() {
            let bucket = self.bucket(event.time());
            self.ends[bucket] -= 1;
            self.known[self.ends[bucket] as usize] = *event;
        }
        self.ends.remove(0);
    }

    #[inline(always)]
    fn bucket(&self, time: i64) -> usize {
        let within = time.saturating_sub(self.begin).max(0) as u64 >> self.shift;
        (within as usize).min(self.heads.len() - 1)
    }

    /// Adds an event; the agenda must have been opened.
    #[inline(always)]
    pub fn push(&mut self, event: E) {
        self.len += 1;
        let bucket = self.bucket(event.time());
        if bucket as i64 > self.current {
            let node = self.nodes.len() as u32;
            self.nodes.push((event, self.heads[bucket]));
            self.heads[bucket] = node;
        } else {
            self.insert(event);
        }
    }

    /// Inserts an event into the run.
    #[inline(always)]
    fn insert(&mut self, event: E) {
        if self.run.len() >= self.longest {
            return self.insert_into_crowd(event);
        }
        self.insert_into_run(event);
    }

    /// Inserts an event where there are too many for the run.
    #[cold]
    fn insert_into_crowd(&mut self, event: E) {
        self.run.drain(..self.head);
        self.head = 0;
        if self.run.len() >= LONGEST_RUN {
            self.crowd.extend(self.run.drain(LONGEST_RUN / 2..).map(Reverse));
        }
        if self.crowd.is_empty() || self.run.last().is_some_and(|last| event < *last) {
            self.insert_into_run(event);
        } else {
            self.crowd.push(Reverse(event));
        }
        self.longest = if self.crowd.is_empty() { LONGEST_RUN } else { 0 };
    }

    #[inline(always)]
    fn insert_into_run(&mut self, event: E) {
        let ahead = self.run[self.head..].iter().position(|later| *later > event);
        let place = ahead.map_or(self.run.len(), |ahead| self.head + ahead);
        if self.head > 0 {
            self.run.copy_within(self.head..place, self.head - 1);
            self.head -= 1;
            self.run[place - 1] = event;
        } else {
            self.run.insert(place, event);
        }
    }

    /// Takes the least event if its time is at most `limit`.
    #[inline(always)]
    pub fn pop_until(&mut self, limit: i64) -> Option<E> {
        if self.run.len() < self.head + self.lead {
            self.lengthen();
        }
        let next = *self.run.get(self.head)?;
        if next.time() > limit {
            return None;
        }
        self.len -= 1;
        self.head += 1;
        Some(next)
    }

    /// Lengthens the run by the next buckets, until it holds as many as it shall or all.
    #[inline(always)]
    fn lengthen(&mut self) {
        if self.head >= TAKEN {
            self.run.drain(..self.head);
            self.head = 0;
        }
        while self.run.len() < self.head + self.lead && self.run.len() - self.head < self.len {
            if let Some(Reverse(event)) = self.crowd.pop() {
                self.run.push(event);
                continue;
            }
            self.current += 1;
            let bucket = self.current as usize;
            let first = if bucket == 0 { 0 } else { self.ends[bucket - 1] };
            let known = &self.known[first as usize..self.ends[bucket] as usize];
            self.unsorted.clear();
            self.unsorted.extend_from_slice(known);
            let mut node = self.heads[bucket];
            while node != NONE {
                let (event, next) = self.nodes[node as usize];
                self.unsorted.push(event);
                node = next;
            }
            if let Some(&any) = self.unsorted.first() {
                let start = self.run.len();
                self.run.resize(start + self.unsorted.len(), any);
                sort_to(&self.unsorted, &mut self.run[start..]);
            }
        }
    }

    /// The event that will be taken `ahead` events from now, as things stand; one of those [kept sorted](Self::keep_sorted).
    #[inline(always)]
    pub fn soon(&self, ahead: usize) -> Option<&E> {
        self.run.get(self.head + ahead)
    }

    /// Number of events held.
    pub fn len(&self) -> usize {
        self.len
    }

    /// Whether no event is held.
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }
}
