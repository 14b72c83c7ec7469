//! Ladder and window queue return the same events at the same times as the heap. Events of one time come in
//! any order.

use std::collections::BTreeSet;

use haff_calendar::{Calendar, Event, Heap, Ladder, WindowQueue};
use haff_testing::Random;
use proptest::prelude::*;

#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Item {
    time: i64,
    id: u32,
}

impl Event for Item {
    fn time(&self) -> i64 {
        self.time
    }
}

#[derive(Debug, Clone)]
enum Operation {
    Push(i64),
    Pop,
    PopUntil(i64),
    TakeUntil(i64),
    Clear,
}

fn operation(spread: i64) -> impl Strategy<Value = Operation> {
    prop_oneof![
        12 => (0..spread).prop_map(Operation::Push),
        1 => (-5_i64..3).prop_map(Operation::Push),
        10 => Just(Operation::Pop),
        3 => (0..spread / 4 + 1).prop_map(Operation::PopUntil),
        1 => (0..spread / 4 + 1).prop_map(Operation::TakeUntil),
        1 => Just(Operation::Clear),
    ]
}

/// The items in both calendars. If both return events at the same times, and each returns every event once,
/// they return the same events.
#[derive(Default)]
struct Contents([BTreeSet<Item>; 2]);

impl Contents {
    fn push(&mut self, item: Item) {
        assert!(self.0.iter_mut().all(|contents| contents.insert(item)));
    }

    /// Removes the returned events. Both calendars must have returned one, or neither.
    fn take(&mut self, taken: [Option<Item>; 2]) {
        let [a, b] = taken.map(|item| item.map(|item| item.time));
        assert_eq!(a, b, "{taken:?}");
        for (contents, item) in self.0.iter_mut().zip(taken) {
            assert!(
                item.is_none_or(|item| contents.remove(&item)),
                "{item:?} was never added, or taken before"
            );
        }
    }
}

/// Applies the same operations to both calendars; times are relative to the last event taken.
fn run_both(operations: &[Operation]) {
    let (mut heap, mut ladder) = (Heap::with_capacity(16), Ladder::with_capacity(16));
    ladder.keep_sorted(operations.len() % 20);
    let (mut now, mut id, mut contents) = (0_i64, 0, Contents::default());
    for operation in operations {
        match *operation {
            Operation::Push(ahead) => {
                // Times up to 2^62 are allowed.
                let item = Item { time: now.saturating_add(ahead).min(1 << 62), id };
                id += 1;
                contents.push(item);
                heap.push(item);
                ladder.push(item);
            }
            Operation::Pop | Operation::PopUntil(_) => {
                let limit = if let Operation::PopUntil(ahead) = operation {
                    now.saturating_add(*ahead)
                } else {
                    i64::MAX
                };
                assert_eq!(heap.next_time(), ladder.next_time());
                let (a, b) = (heap.pop_until(limit), ladder.pop_until(limit));
                contents.take([a, b]);
                now = a.map_or(now, |item| item.time);
            }
            Operation::TakeUntil(ahead) => {
                let limit = now.saturating_add(ahead);
                let mut all = Vec::new();
                ladder.take_until(limit, &mut all);
                all.sort_unstable();
                for item in all {
                    contents.take([heap.pop_until(limit), Some(item)]);
                    now = item.time;
                }
                assert!(heap.next_time().is_none_or(|time| time > limit));
            }
            Operation::Clear => {
                contents = Contents::default();
                heap.clear();
                ladder.clear();
            }
        }
        assert_eq!(heap.len(), ladder.len());
    }
    while let Some(item) = heap.pop_until(i64::MAX) {
        contents.take([Some(item), ladder.pop_until(i64::MAX)]);
    }
    assert!(ladder.is_empty() && ladder.pop_until(i64::MAX).is_none());
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 200, rng_seed: proptest::test_runner::RngSeed::Fixed(1), ..ProptestConfig::default() })]

    #[test]
    fn ladder_agrees_with_heap_on_close_times(operations in prop::collection::vec(operation(40), 1..600)) {
        run_both(&operations);
    }

    #[test]
    fn ladder_agrees_with_heap_on_distant_times(operations in prop::collection::vec(operation(1 << 58), 1..600)) {
        run_both(&operations);
    }

    #[test]
    fn ladder_agrees_with_heap_across_sixty_binary_orders(
        operations in prop::collection::vec((0_u32..60).prop_flat_map(|bits| operation(1 << bits)), 1..600)
    ) {
        run_both(&operations);
    }
}

/// The bucket width is adapted to the many near events. A few events are later than a year of the calendar,
/// some by an exact number of years.
#[test]
fn ladder_agrees_with_heap_on_events_years_ahead() {
    let (mut heap, mut ladder) = (Heap::with_capacity(16), Ladder::with_capacity(16));
    let mut generator = Random(1);
    let mut random = |n: u64| generator.bits() % n;
    let (mut contents, mut id) = (Contents::default(), 0);
    let mut push =
        |now: i64, ahead: u64, contents: &mut Contents, heap: &mut Heap<Item>, ladder: &mut Ladder<Item>| {
            let item = Item { time: now + ahead as i64, id };
            id += 1;
            contents.push(item);
            heap.push(item);
            ladder.push(item);
        };
    for k in 0..200 {
        push(0, k, &mut contents, &mut heap, &mut ladder);
    }
    for _ in 0..200_000 {
        let taken = [heap.pop_until(i64::MAX), ladder.pop_until(i64::MAX)];
        contents.take(taken);
        let now = taken[0].unwrap().time;
        let ahead = if random(500) > 0 { 1 + random(64) } else { 1 + random(1 << 13) };
        push(now, ahead, &mut contents, &mut heap, &mut ladder);
    }
}

/// The hold model: each event that is taken schedules another one, at a rate that drifts over twelve binary
/// orders, so that the ladder increases and decreases its width.
#[test]
fn ladder_agrees_with_heap_while_the_event_rate_drifts() {
    let (mut heap, mut ladder) = (Heap::with_capacity(1000), Ladder::with_capacity(1000));
    ladder.keep_sorted(12);
    let mut state = 12345_u64;
    let mut random = move || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        state
    };
    let mut contents = Contents::default();
    for id in 0..1000 {
        let item = Item { time: (random() >> 34) as i64, id };
        contents.push(item);
        heap.push(item);
        ladder.push(item);
    }
    for step in 0..200_000_u32 {
        let (a, b) = (heap.pop_until(i64::MAX).unwrap(), ladder.pop_until(i64::MAX).unwrap());
        contents.take([Some(a), Some(b)]);
        let bits = 34 + (step / 5000) % 24 * u32::from(step % 240_000 < 120_000) / 2;
        let item = Item { time: a.time + (random() >> bits) as i64, id: 1000 + step };
        contents.push(item);
        heap.push(item);
        ladder.push(item);
    }
}

#[test]
fn ladder_returns_all_ten_thousand_simultaneous_events() {
    let mut ladder = Ladder::with_capacity(10_000);
    for id in (0..10_000).rev() {
        ladder.push(Item { time: 1 << 40, id });
    }
    let mut ids: Vec<u32> = (0..10_000).map(|_| ladder.pop_until(1 << 40).unwrap().id).collect();
    ids.sort_unstable();
    assert!(ids.into_iter().eq(0..10_000));
    assert!(ladder.is_empty());
}

proptest! {
    /// A window queue agrees with a heap, whether events are known at the start, come later, or lie outside
    /// the window.
    #[test]
    fn window_queue_agrees_with_heap(
        begin in -1000_i64..1000,
        span in 1_i64..2_000_000,
        known in prop::collection::vec(-50_i64..2_100_000, 0..400),
        later in prop::collection::vec((0_i64..100_000, any::<bool>()), 0..400),
        sorted in 0_usize..40,
    ) {
        let mut heap = Heap::with_capacity(16);
        let mut queue = WindowQueue::default();
        queue.keep_sorted(sorted);
        // Opened twice: no event of the first window remains.
        queue.open(0, 10, &[Item { time: 5, id: 7 }]);
        queue.push(Item { time: 6, id: 8 });
        let items: Vec<Item> =
            known.iter().enumerate().map(|(k, &time)| Item { time: begin + time, id: k as u32 }).collect();
        queue.open(begin, begin + span, &items);
        for &item in &items {
            heap.push(item);
        }
        let mut now = begin;
        for (k, &(ahead, limited)) in later.iter().enumerate() {
            let item = Item { time: now + ahead, id: 1000 + k as u32 };
            heap.push(item);
            queue.push(item);
            let limit = if limited { now + 1000 } else { i64::MAX };
            let (a, b) = (heap.pop_until(limit), queue.pop_until(limit));
            prop_assert_eq!(a, b);
            prop_assert_eq!(heap.len(), queue.len());
            now = a.map_or(now, |item| item.time);
        }
        while let Some(item) = heap.pop_until(i64::MAX) {
            prop_assert_eq!(Some(item), queue.pop_until(i64::MAX));
        }
        prop_assert!(queue.is_empty() && queue.pop_until(i64::MAX).is_none());
    }
}

thread_local! {
    static COMPARISONS: std::cell::Cell<u64> = const { std::cell::Cell::new(0) };
}

/// An item that counts its comparisons.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Counted(Item);

impl Ord for Counted {
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        COMPARISONS.set(COMPARISONS.get() + 1);
        self.0.cmp(&other.0)
    }
}

impl PartialOrd for Counted {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

impl Event for Counted {
    fn time(&self) -> i64 {
        self.0.time
    }
}

/// A particle in a wedge has a hundred thousand events in one bucket, each followed by entries for later in
/// that bucket.
#[test]
fn many_events_in_one_bucket_of_a_window_queue_take_logarithmic_time() {
    const EVENTS: u32 = 30_000;
    let (mut heap, mut queue) = (Heap::with_capacity(16), WindowQueue::default());
    queue.keep_sorted(20);
    let first = Counted(Item { time: 0, id: 0 });
    queue.open(0, 1 << 50, &[first]);
    heap.push(first.0);
    let mut random = Random(1);
    for k in 1..=EVENTS {
        let (a, b) = (heap.pop_until(i64::MAX).unwrap(), queue.pop_until(i64::MAX).unwrap());
        assert_eq!(a, b.0);
        // One event at the next tick, and a later one.
        let later = 1_000_000 + (random.bits() >> 44) as i64;
        for (ahead, id) in [(1, 2 * k), (later, 2 * k + 1)] {
            let item = Item { time: a.time + ahead, id };
            heap.push(item);
            queue.push(Counted(item));
        }
        assert_eq!(heap.len(), queue.len());
    }
    while let Some(item) = heap.pop_until(i64::MAX) {
        assert_eq!(Some(Counted(item)), queue.pop_until(i64::MAX));
    }
    // 60,000 events need about 16 comparisons each; insertion into one sorted list would take 60,000²/4.
    let comparisons = COMPARISONS.get();
    assert!(comparisons < 60_000 * 100, "{comparisons} comparisons");
}
