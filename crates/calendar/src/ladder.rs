/*!
A two-level ladder queue with lazy deletion.

Time is cut into *fine* buckets of 2^s ticks and *coarse* buckets of 2^m fine ones; a *year* is 2^k coarse
buckets, stored as a ring.

```text
 heap + run  |  fine buckets of the    |  coarse buckets of    |  everything
 (sorted)    |  current coarse bucket  |  a year from now on   |  later
```

An event is appended, unsorted, to the bucket of its time, moves down one level when its coarse bucket becomes
current, and is sorted only with the few others of its fine bucket. Events that arrive for the current fine
bucket, or for the past, are inserted into the sorted run while it is short, and into a binary heap beside it
otherwise. So each event is moved three times, twice by an append. The fine width follows the event rate:
about [`TARGET`] events a bucket.
*/

use std::{cmp::Reverse, collections::BinaryHeap, mem};

use crate::{Calendar, Event, few::sort_times_to};

/// Events per fine bucket that the width is tuned for: the sort stays within two cache lines of 24-byte
/// events and the scan over empty buckets stays short.
const TARGET: usize = 8;
/// The width is re-tuned when buckets hold this factor more or less than they should.
const SLACK: usize = 2;
/// Longest run into which events are inserted.
const SHORT: usize = 64;
/// Number of events that the width is chosen from.
const SAMPLE: usize = 1 << 14;
/// Least number of events taken between two reviews of the width.
const REVIEW: usize = 64;
/// Largest exponent of a year's length, so that bucket arithmetic on 64-bit ticks cannot overflow.
const MAX_YEAR_BITS: u32 = 61;

/// Two-level ladder queue; [`Heap`](crate::Heap) is the plain reference.
#[derive(Debug, Clone)]
pub struct Ladder<E: Event> {
    /// Sorted events up to the end of the current fine bucket, latest first.
    run: Vec<E>,
    /// The run is lengthened by the next bucket while it is shorter than this.
    min_run: usize,
    /// Events pushed into the current fine bucket or before it since it was sorted.
    late: BinaryHeap<Reverse<E>>,
    fine: Vec<Vec<E>>,
    coarse: Vec<Vec<E>>,
    /// Events that were more than a year ahead when the calendar year began, or when they were entered in it.
    later: Vec<E>,
    /// log₂ of the fine bucket's width in ticks.
    shift: u32,
    /// log₂ of the number of fine buckets, and of coarse ones.
    fine_bits: u32,
    coarse_bits: u32,
    /// Absolute index of the current fine, coarse bucket and year.
    fine_now: i64,
    coarse_now: i64,
    year_now: i64,
    len: usize,
    /// Fine buckets passed, and events taken, since the last review of the width. (`taken` is neither next to
    /// `len` nor as wide: the compiler would increment both with one vector instruction, which stalls on
    /// store forwarding after `len` has been written alone.)
    buckets: i64,
    taken: u32,
    /// Number of events to be taken before the next review: a change costs O(len). 0 at the start.
    review_budget: u32,
}

impl<E: Event> Ladder<E> {
    fn set_shift(&mut self, shift: u32) {
        self.shift = shift.min(MAX_YEAR_BITS - self.fine_bits - self.coarse_bits);
    }

    /// Sets the current fine bucket to that of `time`; all buckets must be empty.
    fn set_current(&mut self, time: i64) {
        self.fine_now = time >> self.shift;
        self.coarse_now = self.fine_now >> self.fine_bits;
        self.year_now = self.coarse_now >> self.coarse_bits;
    }

    #[inline]
    fn place(&mut self, event: E) {
        let fine = event.time() >> self.shift;
        if fine <= self.fine_now {
            self.place_late(event);
            return;
        }
        let coarse = fine >> self.fine_bits;
        if coarse == self.coarse_now {
            let slot = (fine & ((1 << self.fine_bits) - 1)) as usize;
            self.fine[slot].push(event);
        } else if coarse.wrapping_sub(self.coarse_now) as u64 <= 1 << self.coarse_bits {
            // Also exactly a year ahead: the slot of the current bucket in the ring is empty.
            let slot = (coarse & ((1 << self.coarse_bits) - 1)) as usize;
            let bucket = &mut self.coarse[slot];
            if bucket.len() == bucket.capacity() {
                // By a quarter, not twofold: nearly all events of a large system are in these buckets.
                bucket.reserve_exact(bucket.len() / 4 + TARGET);
            }
            bucket.push(event);
        } else {
            self.later.push(event);
        }
    }

    /// Adds an event to the current fine bucket.
    fn place_late(&mut self, event: E) {
        if self.run.len() < SHORT {
            let at = self.run.iter().rposition(|other| *other > event).map_or(0, |at| at + 1);
            self.run.insert(at, event);
        } else {
            self.late.push(Reverse(event));
        }
    }

    /// Chooses the fine width for `len` live events from `some` of them: by their median distance from the
    /// first, for `TARGET` events a bucket. The fine bucket before the first event becomes the current one,
    /// so that no event starts in the heap; all buckets must be empty.
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

    /// Prepares for `len` events, given some of them; the calendar must be empty. Without this call all
    /// events added before the first is taken go to one heap, and are moved then.
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

    /// Keeps at least `events` events sorted, up to half of [`SHORT`], or all if there are fewer, so that the
    /// [upcoming](Calendar::upcoming) ones are known.
    pub fn keep_sorted(&mut self, events: usize) {
        self.min_run = events.min(SHORT / 2);
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
                    // The events already in the run are earlier, so they go to its end.
                    let (held, more) = (self.run.len(), bucket.len());
                    self.run.resize(held + more, bucket[0]);
                    self.run.copy_within(..held, more);
                    sort_times_to(bucket, &mut self.run[..more], self.fine_now << self.shift);
                    bucket.clear();
                    return true;
                }
            }
            self.next_coarse();
        }
    }

    /// Checks whether the width still fits the rate of events.
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

    /// Rebuilds with a width that fits the present events.
    fn retune(&mut self) {
        let (fine, coarse) = (self.fine.len(), self.coarse.len());
        let fine = mem::replace(&mut self.fine, vec![Vec::new(); fine]);
        let coarse = mem::replace(&mut self.coarse, vec![Vec::new(); coarse]);
        let (run, later) = (mem::take(&mut self.run), mem::take(&mut self.later));
        // The heap holds most of them when the width has never been tuned.
        let late = mem::take(&mut self.late).into_vec();
        let buckets = || fine.iter().chain(&coarse).chain([&run, &later]);
        self.tune_from(late.iter().map(|late| &late.0).chain(buckets().flatten()), self.len);
        for Reverse(event) in late {
            self.place(event);
        }
        // Bucket by bucket: the memory of each is freed while that of others grows.
        for bucket in fine.into_iter().chain(coarse).chain([run, later]) {
            for event in bucket {
                self.place(event);
            }
        }
    }

    /// Moves the next non-empty coarse bucket down into the fine ones.
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
            // The year is over. Events that were more than a year ahead may be due in the next one, but not
            // before: those that are go into the ring now, whose last bucket is exactly a year ahead.
            let elsewhere = self.run.len() + self.late.len() + self.later.len();
            if self.len > elsewhere {
                self.year_now += 1;
            } else {
                // The ring is empty: jump to the year of the first event left.
                let Some(first) = self.later.iter().map(Event::time).min() else {
                    unreachable!("the caller has checked that events are left")
                };
                let first_coarse = first >> (self.shift + self.fine_bits);
                self.coarse_now = first_coarse - 1;
                self.year_now = first_coarse >> self.coarse_bits;
                self.fine_now = (first_coarse << self.fine_bits) - 1;
                // `first` goes into the ring: `coarse_now` is just before its bucket.
            }
            for event in mem::take(&mut self.later) {
                self.place(event);
            }
        }
    }

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

    fn open_coarse(&mut self, slot: usize) {
        self.fine_now = (self.coarse_now << self.fine_bits) - 1;
        // Its memory is freed, too: each bucket is the fullest for some time, so that all would grow to the
        // largest size.
        for event in mem::take(&mut self.coarse[slot]) {
            let fine = event.time() >> self.shift;
            self.fine[(fine & ((1 << self.fine_bits) - 1)) as usize].push(event);
        }
    }
}

impl<E: Event> Calendar<E> for Ladder<E> {
    fn with_capacity(events: usize) -> Self {
        // Fine × coarse buckets × TARGET = 16 times the live events: nearly all of them fall into one year.
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
        self.place(event);
    }

    #[inline(always)]
    fn pop_until(&mut self, limit: i64) -> Option<E> {
        if self.taken >= self.review_budget {
            self.review();
        }
        if self.late.is_empty() {
            // The usual case.
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
