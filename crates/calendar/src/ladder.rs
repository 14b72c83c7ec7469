/*!
A two-level ladder queue with lazy deletion.

Time is cut into *fine* buckets of 2^s ticks and *coarse* buckets of 2^m fine ones; a *year* is 2^k coarse
buckets, stored as a ring.

```text
 heap + run  |  fine buckets of the    |  coarse buckets of    |  everything
 (sorted)    |  current coarse bucket  |  a year from now on   |  later
```

An event is appended, unsorted, to the bucket of its time. It moves to a fine bucket when its coarse bucket
becomes current, and is sorted only with the few other events of its fine bucket. Events that are added to the
current fine bucket, or to the past, are inserted into the sorted run while it is short, otherwise into a
binary heap. So each event is moved three times, twice by an append. The width of a fine bucket is chosen from
the rate of events: about [`TARGET`] events per bucket.
*/

use std::{cmp::Reverse, collections::BinaryHeap, mem};

use crate::{Calendar, Event, few::sort_times_to};

/// Number of events per fine bucket for which the width is chosen. With events of 24 bytes the sort stays
/// within a few cache lines, and the scan over empty buckets stays short.
const TARGET: usize = 8;
/// The width is chosen again when buckets hold more than this factor times [`TARGET`], or less than
/// [`TARGET`] divided by this factor.
const SLACK: usize = 2;
/// Length of the run from which on events are added to the heap instead.
const SHORT: usize = 64;
/// Approximate number of events from which the width is chosen.
const SAMPLE: usize = 1 << 14;
/// Least number of events that are taken between two reviews of the width.
const REVIEW: usize = 64;
/// Largest exponent of a year's length, so that bucket arithmetic on 64-bit ticks cannot overflow.
const MAX_YEAR_BITS: u32 = 61;

/// Two-level ladder queue. [`Heap`](crate::Heap) is its plain reference.
#[derive(Debug, Clone)]
pub struct Ladder<E: Event> {
    /// Sorted events up to the end of the current fine bucket, latest first.
    run: Vec<E>,
    /// While the run is not longer than this, the next bucket is added to it.
    min_run: usize,
    /// Events added to the current fine bucket, or before it, while the run was too long.
    late: BinaryHeap<Reverse<E>>,
    fine: Vec<Vec<E>>,
    coarse: Vec<Vec<E>>,
    /// Events that were more than a year ahead when the current year began, or when they were added.
    later: Vec<E>,
    /// log₂ of the fine bucket's width in ticks.
    shift: u32,
    /// log₂ of the number of fine buckets, and of coarse ones.
    fine_bits: u32,
    coarse_bits: u32,
    /// Indices of the current fine bucket, coarse bucket and year, counted from time 0.
    fine_now: i64,
    coarse_now: i64,
    year_now: i64,
    len: usize,
    /// Number of fine buckets passed since the last review of the width.
    buckets: i64,
    /// Number of events taken since the last review. This field is neither next to `len` nor as wide:
    /// otherwise the compiler increments both with one vector instruction, which stalls on store forwarding
    /// after `len` has been written alone.
    taken: u32,
    /// Number of events to take before the next review. A change of the width costs O(`len`). 0 at the start.
    review_budget: u32,
}

impl<E: Event> Ladder<E> {
    /// Sets the width of a fine bucket to 2^shift ticks, or to the largest possible one.
    fn set_shift(&mut self, shift: u32) {
        self.shift = shift.min(MAX_YEAR_BITS - self.fine_bits - self.coarse_bits);
    }

    /// Sets the current fine bucket to that of `time`; all buckets must be empty.
    fn set_current(&mut self, time: i64) {
        self.fine_now = time >> self.shift;
        self.coarse_now = self.fine_now >> self.fine_bits;
        self.year_now = self.coarse_now >> self.coarse_bits;
    }

    /// Adds an event to the bucket of its time.
    #[inline]
    fn insert(&mut self, event: E) {
        let fine = event.time() >> self.shift;
        if fine <= self.fine_now {
            self.insert_late(event);
            return;
        }
        let coarse = fine >> self.fine_bits;
        if coarse == self.coarse_now {
            let slot = (fine & ((1 << self.fine_bits) - 1)) as usize;
            self.fine[slot].push(event);
        } else if coarse.wrapping_sub(self.coarse_now) as u64 <= 1 << self.coarse_bits {
            // A bucket exactly a year ahead also has a slot in the ring: that of the current bucket, which is
            // empty.
            let slot = (coarse & ((1 << self.coarse_bits) - 1)) as usize;
            let bucket = &mut self.coarse[slot];
            if bucket.len() == bucket.capacity() {
                // Grows by a quarter instead of doubling, which limits the memory: nearly all events of a
                // large system are in these buckets.
                bucket.reserve_exact(bucket.len() / 4 + TARGET);
            }
            bucket.push(event);
        } else {
            self.later.push(event);
        }
    }

    /// Adds an event to the current fine bucket, which is already sorted.
    fn insert_late(&mut self, event: E) {
        if self.run.len() < SHORT {
            let at = self.run.iter().rposition(|other| *other > event).map_or(0, |at| at + 1);
            self.run.insert(at, event);
        } else {
            self.late.push(Reverse(event));
        }
    }

    /// Chooses the fine width for `len` events in the calendar from `some` of them, for [`TARGET`] events per
    /// bucket between the first event and the median. The fine bucket before the first event becomes the
    /// current one, so that no event starts in the heap. All buckets must be empty.
    fn tune_from<'a>(&mut self, some: impl Iterator<Item = &'a E> + Clone, len: usize)
    where
        E: 'a,
    {
        let Some(first) = some.clone().map(Event::time).min() else { return };
        let sample = some.clone().step_by(some.count().div_ceil(SAMPLE));
        let mut ahead: Vec<u64> = sample.map(|event| event.time().wrapping_sub(first) as u64).collect();
        let middle = ahead.len() / 2;
        let (_, &mut median, _) = ahead.select_nth_unstable(middle);
        let width = (u128::from(median) * TARGET as u128 / ((len / 2).max(1) as u128)).max(1) as u64;
        self.set_shift(width.ilog2());
        self.set_current(first.saturating_sub(1 << self.shift));
    }

    /// Prepares for `len` events, given some of them. The calendar must be empty. Without this call, all
    /// events that are added before the first one is taken are in one heap, and move to the buckets when it
    /// is taken.
    pub fn prepare(&mut self, some: &[E], len: usize) {
        debug_assert!(self.is_empty());
        if some.is_empty() {
            return;
        }
        self.tune_from(some.iter(), len);
        self.review_budget = len.clamp(REVIEW, 1 << 31) as u32;
        self.taken = 0;
        self.buckets = 0;
    }

    /// Keeps the next `events` events sorted, or all if there are fewer, so that the
    /// [upcoming](Calendar::upcoming) events are known. The largest possible number is half of `SHORT`.
    pub fn keep_sorted(&mut self, events: usize) {
        self.min_run = events.min(SHORT / 2);
    }

    /// Moves all events up to `limit` to `events`, in no particular order.
    pub fn take_until(&mut self, limit: i64, events: &mut Vec<E>) {
        if self.taken >= self.review_budget {
            self.review();
        }
        let before = events.len();
        let taken = self.run.iter().rev().take_while(|event| event.time() <= limit).count();
        events.extend(self.run.drain(self.run.len() - taken..));
        while self.late.peek().is_some_and(|Reverse(event)| event.time() <= limit) {
            events.extend(self.late.pop().map(|late| late.0));
        }
        self.len -= events.len() - before;
        // Whole buckets are not sorted.
        while self.run.is_empty() && self.late.is_empty() && self.len > 0 {
            let end = (self.coarse_now + 1) << self.fine_bits;
            while self.fine_now + 1 < end && (self.fine_now + 2) << self.shift <= limit.saturating_add(1) {
                self.fine_now += 1;
                self.buckets += 1;
                let slot = (self.fine_now & ((1 << self.fine_bits) - 1)) as usize;
                self.len -= self.fine[slot].len();
                events.append(&mut self.fine[slot]);
            }
            if self.len == 0 {
                break;
            }
            if self.fine_now + 1 < end {
                let more = self.fine_now + 1;
                // Only a part of the next bucket, or none of it.
                if more << self.shift <= limit {
                    self.advance();
                    let taken = self.run.iter().rev().take_while(|event| event.time() <= limit).count();
                    self.len -= taken;
                    events.extend(self.run.drain(self.run.len() - taken..));
                }
                break;
            }
            // Beyond the limit, nothing is moved.
            if end << self.shift > limit {
                break;
            }
            self.next_coarse();
        }
        self.taken = self.taken.saturating_add((events.len() - before) as u32);
    }

    /// Adds the next non-empty fine bucket to the run. False if all buckets are empty.
    #[inline(always)]
    fn advance(&mut self) -> bool {
        if self.len == self.run.len() + self.late.len() {
            return false;
        }
        loop {
            let end = (self.coarse_now + 1) << self.fine_bits;
            while self.fine_now + 1 < end {
                self.fine_now += 1;
                self.buckets += 1;
                let slot = (self.fine_now & ((1 << self.fine_bits) - 1)) as usize;
                let bucket = &mut self.fine[slot];
                if !bucket.is_empty() {
                    // The events already in the run are earlier, so they move to its end.
                    let (present, more) = (self.run.len(), bucket.len());
                    self.run.resize(present + more, bucket[0]);
                    self.run.copy_within(..present, more);
                    sort_times_to(bucket, &mut self.run[..more], self.fine_now << self.shift);
                    bucket.clear();
                    return true;
                }
            }
            self.next_coarse();
        }
    }

    /// Checks whether the width is still right for the rate of events, and otherwise chooses it again.
    #[cold]
    fn review(&mut self) {
        let per_bucket = self.taken as usize / self.buckets.max(1) as usize;
        if self.review_budget == 0 || per_bucket > TARGET * SLACK || per_bucket * SLACK < TARGET {
            self.retune();
        }
        self.review_budget = self.len.clamp(REVIEW, 1 << 31) as u32;
        self.taken = 0;
        self.buckets = 0;
    }

    /// Chooses the width for the present events, and moves them to the new buckets.
    fn retune(&mut self) {
        let (fine, coarse) = (self.fine.len(), self.coarse.len());
        let fine = mem::replace(&mut self.fine, vec![Vec::new(); fine]);
        let coarse = mem::replace(&mut self.coarse, vec![Vec::new(); coarse]);
        let (run, later) = (mem::take(&mut self.run), mem::take(&mut self.later));
        // Before the first choice of the width most events are in the heap.
        let late = mem::take(&mut self.late).into_vec();
        let buckets = || fine.iter().chain(&coarse).chain([&run, &later]);
        self.tune_from(late.iter().map(|late| &late.0).chain(buckets().flatten()), self.len);
        for Reverse(event) in late {
            self.insert(event);
        }
        // Bucket by bucket: the memory of an old bucket is freed before the next new buckets grow.
        for bucket in fine.into_iter().chain(coarse).chain([run, later]) {
            for event in bucket {
                self.insert(event);
            }
        }
    }

    /// Moves the events of the next non-empty coarse bucket to the fine buckets.
    #[inline(never)]
    fn next_coarse(&mut self) {
        loop {
            let end = (self.year_now + 1) << self.coarse_bits;
            while self.coarse_now + 1 < end {
                self.coarse_now += 1;
                let slot = (self.coarse_now & ((1 << self.coarse_bits) - 1)) as usize;
                if !self.coarse[slot].is_empty() {
                    self.open_coarse(slot);
                    return;
                }
            }
            // The year is over. The events in `later` are in the next year or after it. Those that are at
            // most a year ahead now move to the ring, whose last bucket is exactly a year ahead.
            let elsewhere = self.run.len() + self.late.len() + self.later.len();
            if self.len > elsewhere {
                self.year_now += 1;
            } else {
                // The ring is empty: the year of the first remaining event becomes current.
                let Some(first) = self.later.iter().map(Event::time).min() else {
                    unreachable!("the caller has checked that events remain")
                };
                let first_coarse = first >> (self.shift + self.fine_bits);
                self.coarse_now = first_coarse - 1;
                self.year_now = first_coarse >> self.coarse_bits;
                self.fine_now = (first_coarse << self.fine_bits) - 1;
                // `coarse_now` is just before the bucket of `first`, so that this event moves to the ring.
            }
            for event in mem::take(&mut self.later) {
                self.insert(event);
            }
        }
    }

    /// [`Calendar::pop_until`] when the heap contains events.
    #[cold]
    fn pop_with_late(&mut self, limit: i64) -> Option<E> {
        let from_run = match (self.run.last(), self.late.peek()) {
            (Some(run), Some(Reverse(late))) => run <= late,
            (run, _) => run.is_some(),
        };
        let next = if from_run { self.run.last().copied() } else { self.late.peek().map(|late| late.0) };
        if next?.time() > limit {
            return None;
        }
        self.len -= 1;
        self.taken += 1;
        if from_run { self.run.pop() } else { self.late.pop().map(|late| late.0) }
    }

    /// Moves the events of the current coarse bucket, at `slot` of the ring, to the fine buckets.
    fn open_coarse(&mut self, slot: usize) {
        self.fine_now = (self.coarse_now << self.fine_bits) - 1;
        // The memory of the bucket is freed. Otherwise every bucket would grow to the largest size, because
        // each is the fullest one for some time.
        for event in mem::take(&mut self.coarse[slot]) {
            let fine = event.time() >> self.shift;
            self.fine[(fine & ((1 << self.fine_bits) - 1)) as usize].push(event);
        }
    }
}

impl<E: Event> Calendar<E> for Ladder<E> {
    fn with_capacity(events: usize) -> Self {
        // Fine × coarse buckets × TARGET is about 16 times the number of events: nearly all are within one
        // year.
        let bits = (2 * events.max(1)).ilog2().div_ceil(2).clamp(4, 12);
        Self {
            run: Vec::new(),
            min_run: 0,
            late: BinaryHeap::new(),
            fine: vec![Vec::new(); 1 << bits],
            coarse: vec![Vec::new(); 1 << bits],
            later: Vec::new(),
            shift: MAX_YEAR_BITS - 2 * bits,
            fine_bits: bits,
            coarse_bits: bits,
            fine_now: 0,
            coarse_now: 0,
            year_now: 0,
            len: 0,
            taken: 0,
            buckets: 0,
            review_budget: 0,
        }
    }

    fn push(&mut self, event: E) {
        self.len += 1;
        self.insert(event);
    }

    #[inline(always)]
    fn pop_until(&mut self, limit: i64) -> Option<E> {
        if self.taken >= self.review_budget {
            self.review();
        }
        if self.late.is_empty() {
            // The heap is empty in the usual case.
            if self.run.len() <= self.min_run {
                self.advance();
            }
            let last = self.run.len().checked_sub(1)?;
            let next = self.run[last];
            if next.time() > limit {
                return None;
            }
            self.run.truncate(last);
            self.len -= 1;
            self.taken += 1;
            Some(next)
        } else {
            self.pop_with_late(limit)
        }
    }

    #[inline]
    fn peek(&mut self) -> Option<&E> {
        if self.run.is_empty() && self.late.is_empty() && !self.advance() {
            return None;
        }
        match (self.run.last(), self.late.peek()) {
            (Some(run), Some(Reverse(late))) => Some(run.min(late)),
            (run, late) => run.or(late.map(|late| &late.0)),
        }
    }

    #[inline(always)]
    fn upcoming(&self, ahead: usize) -> Option<&E> {
        self.run.get(self.run.len().checked_sub(ahead + 1)?)
    }

    fn clear(&mut self) {
        self.run.clear();
        self.late.clear();
        self.later.clear();
        self.fine.iter_mut().chain(&mut self.coarse).for_each(Vec::clear);
        self.len = 0;
        self.review_budget = 0;
    }

    fn len(&self) -> usize {
        self.len
    }
}
