/*!
A queue of the events in one window of time: buckets of equal width, filled once and emptied in order.

Most events are known when the window opens. A counting sort puts them into buckets, so that their order in
memory is that in which they will be taken. Events added later go to linked lists, one per bucket. The next
few events are in a sorted run, so that the memory of the [upcoming](WindowQueue::upcoming) ones can be
prefetched.
*/

use std::{cmp::Reverse, collections::BinaryHeap};

use crate::{Event, few::sort_to};

/// Number of events per bucket for which the width is chosen. The sort of a bucket stays within two or three
/// cache lines.
const TARGET: usize = 4;
/// Number of events already taken from the run after which their memory is reused.
const TAKEN: usize = 64;
/// Largest length of the run; later events of the same bucket are in a heap. The time of an insertion into
/// the run is proportional to its length, and a particle trapped in a wedge can have very many events in one
/// bucket.
const LONGEST_RUN: usize = 256;
/// End of a list.
const NONE: u32 = u32::MAX;

/// Queue of the events in one window; see the documentation of its file.
#[derive(Debug, Clone)]
pub struct WindowQueue<E: Event> {
    /// Begin of the window [ticks].
    begin: i64,
    /// log₂ of a bucket's width in ticks.
    shift: u32,
    /// Events known when the window was opened, in the order of their buckets. Bucket b ends at `ends[b]`.
    known: Vec<E>,
    ends: Vec<u32>,
    /// Events added later: the linked list of bucket b begins at node `heads[b]`.
    heads: Vec<u32>,
    nodes: Vec<(E, u32)>,
    /// The last bucket that has been added to the run; −1 before the first.
    current: i64,
    /// Working space: the events of one bucket before they are sorted.
    unsorted: Vec<E>,
    /// The next events in order, from index `head` on. Those before `head` have been taken.
    run: Vec<E>,
    head: usize,
    /// Events of the buckets of the run that do not fit in it. All of them are later than those in the run.
    overflow: BinaryHeap<Reverse<E>>,
    /// Length of the run, events already taken included, from which on an insertion checks for overflow. 0
    /// while `overflow` contains events.
    longest: usize,
    /// Least length of the run, as long as the queue contains enough events.
    min_run: usize,
    len: usize,
}

impl<E: Event> Default for WindowQueue<E> {
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
            overflow: BinaryHeap::new(),
            longest: LONGEST_RUN,
            min_run: 1,
            len: 0,
        }
    }
}

impl<E: Event> WindowQueue<E> {
    /// Keeps the next `events` events sorted, or all if there are fewer, so that they can be
    /// [read](Self::upcoming).
    pub fn keep_sorted(&mut self, events: usize) {
        self.min_run = events.max(1);
    }

    /// Removes all events and opens a window [`begin`, `end`] \[ticks\], `begin` < `end`, with the events
    /// known at its start.
    ///
    /// Events before or after the window are also returned in order, but take more time.
    pub fn open(&mut self, begin: i64, end: i64, events: &[E]) {
        let buckets = (events.len() / TARGET).clamp(1, 1 << 24) as u64;
        let span = end.saturating_sub(begin).max(1) as u64;
        self.begin = begin;
        // The width is the least power of two such that at most `buckets` buckets cover the window.
        self.shift = u64::BITS - (span / buckets).leading_zeros();
        let buckets = (span >> self.shift) as usize + 1;
        self.ends.clear();
        self.ends.resize(buckets + 1, 0);
        self.heads.clear();
        self.heads.resize(buckets, NONE);
        self.nodes.clear();
        self.run.clear();
        self.head = 0;
        self.overflow.clear();
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
        // In reverse order: the end of each bucket is lowered to its beginning, which is the end of the
        // bucket before.
        for event in events.iter().rev() {
            let bucket = self.bucket(event.time());
            self.ends[bucket] -= 1;
            self.known[self.ends[bucket] as usize] = *event;
        }
        self.ends.remove(0);
    }

    /// The bucket of a time: the first or last one if it is outside the window.
    #[inline(always)]
    fn bucket(&self, time: i64) -> usize {
        let within = time.saturating_sub(self.begin).max(0) as u64 >> self.shift;
        (within as usize).min(self.heads.len() - 1)
    }

    /// Adds an event. A window must have been opened before.
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

    /// Inserts an event of a bucket that has been added to the run.
    #[inline(always)]
    fn insert(&mut self, event: E) {
        if self.run.len() >= self.longest {
            return self.insert_with_overflow(event);
        }
        self.insert_into_run(event);
    }

    /// Inserts an event into the run or into `overflow`, and limits the length of the run.
    #[cold]
    fn insert_with_overflow(&mut self, event: E) {
        self.run.drain(..self.head);
        self.head = 0;
        if self.run.len() >= LONGEST_RUN {
            self.overflow.extend(self.run.drain(LONGEST_RUN / 2..).map(Reverse));
        }
        if self.overflow.is_empty() || self.run.last().is_some_and(|last| event < *last) {
            self.insert_into_run(event);
        } else {
            self.overflow.push(Reverse(event));
        }
        self.longest = if self.overflow.is_empty() { LONGEST_RUN } else { 0 };
    }

    /// Inserts an event into the run, in the memory of an event already taken if there is one.
    #[inline(always)]
    fn insert_into_run(&mut self, event: E) {
        let ahead = self.run[self.head..].iter().position(|later| *later > event);
        let position = ahead.map_or(self.run.len(), |ahead| self.head + ahead);
        if self.head > 0 {
            self.run.copy_within(self.head..position, self.head - 1);
            self.head -= 1;
            self.run[position - 1] = event;
        } else {
            self.run.insert(position, event);
        }
    }

    /// Removes and returns the first event if its time is at most `limit`.
    #[inline(always)]
    pub fn pop_until(&mut self, limit: i64) -> Option<E> {
        if self.run.len() < self.head + self.min_run {
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

    /// Adds the next buckets to the run until it contains at least `min_run` events, or all.
    #[inline(always)]
    fn lengthen(&mut self) {
        if self.head >= TAKEN {
            self.run.drain(..self.head);
            self.head = 0;
        }
        while self.run.len() < self.head + self.min_run && self.run.len() - self.head < self.len {
            if let Some(Reverse(event)) = self.overflow.pop() {
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

    /// The event `ahead` events after the next one, if it is one of those [kept sorted](Self::keep_sorted).
    #[inline(always)]
    pub fn upcoming(&self, ahead: usize) -> Option<&E> {
        self.run.get(self.head + ahead)
    }

    /// Number of events in the queue.
    pub fn len(&self) -> usize {
        self.len
    }

    /// Whether the queue contains no events.
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }
}
