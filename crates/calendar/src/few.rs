/*!
Sorts a few events by rank.

A bucket holds about ten events in any order. The branches of a comparison sort are unpredictable. Here the
rank of every event, the number of earlier events, is counted instead. That takes more comparisons but no
branches, and vector instructions compare eight events at a time.
*/

use crate::Event;

/// Largest number of events that are sorted by counting.
const FEW: usize = 16;
/// Number of events whose ranks are counted at a time.
const LANES: usize = 8;

/// Copies events to `sorted`, a slice of the same length, the earliest first.
#[inline(always)]
pub(crate) fn sort_to<E: Event>(events: &[E], sorted: &mut [E]) {
    sort_by::<E, false>(events, sorted, |_, event| event.time());
}

/// Copies events to `sorted`, a slice of the same length, the latest first. The order of events with equal
/// times is not specified. All events must be less than 2^58 ticks after `begin`, and none before it.
#[inline(always)]
pub(crate) fn sort_times_to<E: Event>(events: &[E], sorted: &mut [E], begin: i64) {
    // `k` makes all keys different.
    sort_by::<E, true>(events, sorted, |k, event| (event.time() - begin) * FEW as i64 + k);
}

/// Copies events to `sorted`: a few by counting, more by a comparison sort.
#[inline(always)]
fn sort_by<E: Event, const REVERSED: bool>(events: &[E], sorted: &mut [E], key: impl Fn(i64, &E) -> i64) {
    let counted = if events.len() <= LANES {
        count::<E, 1, REVERSED>(events, sorted, key)
    } else if events.len() <= FEW {
        count::<E, { FEW / LANES }, REVERSED>(events, sorted, key)
    } else {
        false
    };
    if !counted {
        sort_many(events, sorted);
        if REVERSED {
            sorted.reverse();
        }
    }
}

#[cold]
#[inline(never)]
fn sort_many<E: Event>(events: &[E], sorted: &mut [E]) {
    sorted.copy_from_slice(events);
    sorted.sort_unstable();
}

/// Copies up to `GROUPS` times eight events to `sorted` in the order of their keys, the last first if
/// `REVERSED`. Returns false if two events have the same key; with `REVERSED` all keys must be different.
#[inline(always)]
fn count<E: Event, const GROUPS: usize, const REVERSED: bool>(
    events: &[E],
    sorted: &mut [E],
    key: impl Fn(i64, &E) -> i64,
) -> bool {
    let mut keys = [[i64::MAX; LANES]; GROUPS];
    for (k, (to, event)) in keys.as_flattened_mut().iter_mut().zip(events).enumerate() {
        *to = key(k as i64, event);
    }
    let mut before = [[0_i64; LANES]; GROUPS];
    for &other in &keys.as_flattened()[..events.len()] {
        for (keys, before) in keys.iter().zip(&mut before) {
            for (key, before) in keys.iter().zip(before) {
                *before += i64::from(other < *key);
            }
        }
    }
    let before = &before.as_flattened()[..events.len()];
    let last = events.len() as i64 - 1;
    // In a total order the numbers of predecessors are 0, 1, …, `last`. Equal keys make their sum smaller.
    if !REVERSED && 2 * before.iter().sum::<i64>() != (last + 1) * last {
        return false;
    }
    for (event, &before) in events.iter().zip(before) {
        sorted[if REVERSED { last - before } else { before } as usize] = *event;
    }
    true
}

#[cfg(test)]
mod tests {
    use haff_testing::Random;

    use super::*;

    /// Time, and an id that makes the order total.
    #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
    struct Timed(i64, u32);

    impl Event for Timed {
        fn time(&self) -> i64 {
            self.0
        }
    }

    #[test]
    fn any_number_of_events_is_sorted_equal_times_included() {
        let mut generator = Random(1);
        let mut random = || generator.bits() >> 33;
        for count in 0..40 {
            for range in [2, 20, 1 << 30] {
                for _ in 0..20 {
                    let events: Vec<Timed> =
                        (0..count).map(|k| Timed(random() as i64 % range - range / 2, 40 - k)).collect();
                    let mut expected = events.clone();
                    expected.sort_unstable();
                    let mut found = events.clone();
                    sort_to(&events, &mut found);
                    assert_eq!(found, expected);
                    sort_times_to(&events, &mut found, -range / 2);
                    assert!(found.windows(2).all(|pair| pair[0].0 >= pair[1].0));
                    found.sort_unstable();
                    assert_eq!(found, expected, "none is lost");
                }
            }
        }
    }

    #[test]
    fn the_largest_times_are_sorted_last() {
        let events = [Timed(i64::MAX, 1), Timed(3, 2), Timed(i64::MAX - 1, 3), Timed(i64::MAX, 0)];
        let mut found = events;
        sort_to(&events, &mut found);
        assert_eq!(found, [events[1], events[2], events[3], events[0]]);
    }
}
