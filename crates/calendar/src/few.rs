/*!
Sorts a few events by rank.

Buckets hold some ten events in any order. The branches of a comparison sort are unpredictable. Here the rank
of every event is counted instead: the number of earlier events. That takes more comparisons but no branches;
vector instructions compare eight events at a time.
*/

use crate::Event;

/// Largest number of events that are sorted by counting.
const FEW: usize = 16;
/// Number of events whose ranks are counted at a time.
const LANES: usize = 8;

/// Copies events in order to `places`, a slice of the same length, the earliest first.
#[inline(always)]
pub(crate) fn sort_to<E: Event>(events: &[E], places: &mut [E]) {
    sort_by::<E, false>(events, places, |_, event| event.time());
}

/// Copies events within a short span of time from `begin` on, below 2^58 ticks, to `places`, a slice of the
/// same length, in the order of their times, the latest first; events of one time are in any order.
#[inline(always)]
pub(crate) fn sort_times_to<E: Event>(events: &[E], places: &mut [E], begin: i64) {
    // Makes all keys different.
    sort_by::<E, true>(events, places, |k, event| (event.time() - begin) * FEW as i64 + k);
}

#[inline(always)]
fn sort_by<E: Event, const REVERSED: bool>(events: &[E], places: &mut [E], key: impl Fn(i64, &E) -> i64) {
    let counted = if events.len() <= LANES {
        count::<E, 1, REVERSED>(events, places, key)
    } else if events.len() <= FEW {
        count::<E, { FEW / LANES }, REVERSED>(events, places, key)
    } else {
        false
    };
    if !counted {
        sort_many(events, places);
        if REVERSED {
            places.reverse();
        }
    }
}

#[cold]
#[inline(never)]
fn sort_many<E: Event>(events: &[E], places: &mut [E]) {
    places.copy_from_slice(events);
    places.sort_unstable();
}

/// Copies up to `GROUPS` times eight events to `places` in the order of their keys, the last first if
/// `REVERSED`. Returns false if two of them have the same key, which does not happen if `REVERSED`.
#[inline(always)]
fn count<E: Event, const GROUPS: usize, const REVERSED: bool>(
    events: &[E],
    places: &mut [E],
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
    // Events with the same key have fewer predecessors than their ranks in a total order.
    if !REVERSED && 2 * before.iter().sum::<i64>() != (last + 1) * last {
        return false;
    }
    for (event, &before) in events.iter().zip(before) {
        places[if REVERSED { last - before } else { before } as usize] = *event;
    }
    true
}

#[cfg(test)]
mod tests {
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
        let mut state = 1_u64;
        let mut random = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            state >> 33
        };
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
