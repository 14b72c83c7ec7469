/*!
A calendar of one window of time: buckets of equal width, filled once, and drained in order.

The window may be cut into *tiles* that are drained one after the other, each in the order of time. Buckets are those of a tile then.

Most events are known when the window opens: they are sorted into buckets by counting, so that they lie in memory in the
order in which they will be taken, and what comes soon can be [seen](Agenda::soon) beforehand. Events that arrive later wait in lists, one per
bucket. The bucket in progress is a small sorted run.
*/

use crate::Event;

/// Events per bucket that the width is chosen for: the sort of a run stays within two cache lines or three.
const TARGET: usize = 4;
/// End of a list.
const NONE: u32 = u32::MAX;

/// An agenda; see the [module's page](self).
#[derive(Debug, Clone)]
pub struct Agenda<E: Event> {
    begin: i64,
    /// log₂ of a bucket's width in ticks.
    shift: u32,
    /// Buckets per tile.
    per_tile: usize,
    /// Events known from the start, by bucket; bucket b ends at `ends[b]`.
    known: Vec<E>,
    ends: Vec<u32>,
    /// Later events: lists through `nodes`, from `heads[b]` on.
    heads: Vec<u32>,
    nodes: Vec<(E, u32)>,
    /// The bucket in progress, −1 before the first, and its events, latest first.
    current: i64,
    run: Vec<E>,
    len: usize,
}

impl<E: Event> Default for Agenda<E> {
    fn default() -> Self {
        Self {
            begin: 0,
            shift: 0,
            per_tile: 1,
            known: Vec::new(),
            ends: Vec::new(),
            heads: Vec::new(),
            nodes: Vec::new(),
            current: -1,
            run: Vec::new(),
            len: 0,
        }
    }
}

impl<E: Event> Agenda<E> {
    /// Forgets everything and opens a window [`begin`, `end`] \[ticks\], `begin` < `end`, with the events known from the start.
    ///
    /// Events before or after the window are taken in their order too, only less quickly.
    pub fn open(&mut self, begin: i64, end: i64, events: &[E]) {
        self.fill(begin, end, events, 1, |_| 0);
    }

    /// [`Self::open`] for a window of so many tiles; `tiles` tells that of each event.
    ///
    /// # Panics
    ///
    /// If there are not as many tiles told as events, or one of them is not below `count`.
    pub fn open_in_tiles(&mut self, begin: i64, end: i64, events: &[E], count: usize, tiles: &[u16]) {
        assert_eq!(events.len(), tiles.len());
        self.fill(begin, end, events, count, |k| usize::from(tiles[k]));
    }

    #[inline(always)]
    fn fill(&mut self, begin: i64, end: i64, events: &[E], tiles: usize, tile: impl Fn(usize) -> usize) {
        // A tile has its events in a part of the window's time only.
        let spread = if tiles > 1 { TARGET / 2 } else { TARGET };
        let buckets = (events.len() / spread / tiles).clamp(1, 1 << 24) as u64;
        let span = end.saturating_sub(begin).max(1) as u64;
        self.begin = begin;
        // The least width of a power of two that covers the window with at most that many buckets.
        self.shift = u64::BITS - (span / buckets).leading_zeros();
        self.per_tile = (span >> self.shift) as usize + 1;
        let buckets = self.per_tile * tiles;
        self.ends.clear();
        self.ends.resize(buckets + 1, 0);
        self.heads.clear();
        self.heads.resize(buckets, NONE);
        self.nodes.clear();
        self.run.clear();
        self.current = -1;
        self.len = events.len();
        for (k, event) in events.iter().enumerate() {
            let bucket = self.bucket(event.time(), tile(k));
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
        for (k, event) in events.iter().enumerate().rev() {
            let bucket = self.bucket(event.time(), tile(k));
            self.ends[bucket] -= 1;
            self.known[self.ends[bucket] as usize] = *event;
        }
        self.ends.remove(0);
    }

    #[inline(always)]
    fn bucket(&self, time: i64, tile: usize) -> usize {
        let within = time.saturating_sub(self.begin).max(0) as u64 >> self.shift;
        tile * self.per_tile + (within as usize).min(self.per_tile - 1)
    }

    /// Adds an event.
    #[inline]
    pub fn push(&mut self, event: E) {
        self.push_in_tile(event, 0);
    }

    /// Adds an event of a tile. If the tile has been drained, the event joins those in progress.
    #[inline(always)]
    pub fn push_in_tile(&mut self, event: E, tile: usize) {
        self.len += 1;
        let bucket = self.bucket(event.time(), tile);
        if bucket as i64 > self.current {
            let node = self.nodes.len() as u32;
            self.nodes.push((event, self.heads[bucket]));
            self.heads[bucket] = node;
        } else {
            let place = self.run.iter().rposition(|later| *later >= event).map_or(0, |k| k + 1);
            self.run.insert(place, event);
        }
    }

    /// Takes the least event if its time is at most `limit`.
    #[inline]
    pub fn pop_until(&mut self, limit: i64) -> Option<E> {
        if self.run.is_empty() && !self.next_bucket() {
            return None;
        }
        if self.run.last()?.time() > limit {
            return None;
        }
        self.len -= 1;
        self.run.pop()
    }

    /// Fills the run from the next bucket that has events.
    fn next_bucket(&mut self) -> bool {
        if self.len == 0 {
            return false;
        }
        while self.run.is_empty() {
            self.current += 1;
            let bucket = self.current as usize;
            let Some(&end) = self.ends.get(bucket) else { return false };
            let start = if bucket == 0 { 0 } else { self.ends[bucket - 1] };
            self.run.extend_from_slice(&self.known[start as usize..end as usize]);
            let mut node = self.heads[bucket];
            while node != NONE {
                let (event, next) = self.nodes[node as usize];
                self.run.push(event);
                node = next;
            }
        }
        self.run.sort_unstable_by(|a, b| b.cmp(a));
        true
    }

    /// The event known from the start that is likely to be taken `ahead` events from now: one further with every event taken.
    #[inline]
    pub fn soon(&self, ahead: usize) -> Option<&E> {
        let end = if self.current < 0 { 0 } else { *self.ends.get(self.current as usize)? as usize };
        self.known.get((end + ahead).saturating_sub(self.run.len()))
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
