//! The predictions of all events, and a calendar of their times.

use std::{cmp::Ordering, collections::BTreeMap};

use haff_calendar::{Calendar, Event, Heap};

use crate::predict::{Key, Prediction};

/// The calendar is made again when it has more than `EXCESS` entries for each prediction, and `SPARE` more.
const EXCESS: usize = 4;
const SPARE: usize = 64;

/// One prediction for each [`Key`] at most. Entries of the calendar whose prediction has been replaced or
/// removed are invalid; they are dropped when they are reached, or when they are too many: predictions far in
/// the future may be replaced at each of very many events.
#[derive(Debug, Clone)]
pub(crate) struct Predictions {
    current: BTreeMap<Key, Prediction>,
    calendar: Heap<Entry>,
}

impl Default for Predictions {
    fn default() -> Self {
        Self { current: BTreeMap::new(), calendar: Heap::with_capacity(0) }
    }
}

impl Predictions {
    /// Sets the prediction of a key.
    pub fn insert(&mut self, key: Key, prediction: Prediction) {
        self.current.insert(key, prediction);
        self.calendar.push(Entry { key, prediction });
        if self.calendar.len() > EXCESS * self.current.len() + SPARE {
            self.calendar.clear();
            for (&key, &prediction) in &self.current {
                self.calendar.push(Entry { key, prediction });
            }
        }
    }

    /// Removes the prediction of a key.
    pub fn remove(&mut self, key: &Key) {
        self.current.remove(key);
    }

    /// Removes the predictions of a flight.
    pub fn remove_flight(&mut self, flight: usize) {
        self.current.remove(&Key::Renew(flight));
        let monitored = Key::Monitored(flight, 0)..=Key::Monitored(flight, usize::MAX);
        while let Some((&key, _)) = self.current.range(monitored.clone()).next() {
            self.current.remove(&key);
        }
    }

    /// Whether nothing is predicted.
    pub fn is_empty(&self) -> bool {
        self.current.is_empty()
    }

    /// The earliest prediction; of several at one time, the one of the first key.
    pub fn first(&mut self) -> Option<(Key, Prediction)> {
        while let Some(&Entry { key, prediction }) = self.calendar.peek() {
            if self.current.get(&key) == Some(&prediction) {
                return Some((key, prediction));
            }
            self.calendar.pop_until(i64::MAX);
        }
        None
    }
}

/// A calendar entry, in the order of instants and keys.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Entry {
    key: Key,
    prediction: Prediction,
}

impl Eq for Entry {}

impl Ord for Entry {
    fn cmp(&self, other: &Self) -> Ordering {
        let (at, other_at) = (self.prediction.at, other.prediction.at);
        at.partial_cmp(&other_at)
            .unwrap_or(Ordering::Equal)
            .then_with(|| self.key.cmp(&other.key))
            .then_with(|| self.prediction.happens.cmp(&other.prediction.happens))
    }
}

impl PartialOrd for Entry {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Event for Entry {
    /// The bits of a time that is not negative increase with it; half of them keep to the calendar's range.
    fn time(&self) -> i64 {
        (self.prediction.at.high.max(0.0).to_bits() >> 1) as i64
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::predict::Key;
    use haff_engine::Instant;

    fn at(time: f64) -> Prediction {
        Prediction { at: Instant::at(time), happens: true }
    }

    #[test]
    fn the_earliest_valid_prediction_is_first_and_replaced_ones_take_no_memory() {
        let mut predictions = Predictions::default();
        for k in 0..100_000 {
            // The first is replaced at each event, by one that is never reached.
            predictions.insert(Key::Pair(0, 1), at(1e9 + f64::from(k)));
            predictions.insert(Key::Taut(2), at(f64::from(k)));
            assert_eq!(predictions.first(), Some((Key::Taut(2), at(f64::from(k)))));
        }
        assert!(predictions.calendar.len() <= 2 * EXCESS + SPARE, "{}", predictions.calendar.len());
        predictions.remove(&Key::Taut(2));
        assert_eq!(predictions.first(), Some((Key::Pair(0, 1), at(1e9 + 99_999.0))));
        // Of two at one time the lesser key.
        predictions.insert(Key::Wall(3, 0), at(5.0));
        predictions.insert(Key::Pair(1, 2), at(5.0));
        assert_eq!(predictions.first(), Some((Key::Pair(1, 2), at(5.0))));
        predictions.insert(Key::Monitored(3, 0), at(4.0));
        predictions.insert(Key::Monitored(3, 7), at(4.0));
        predictions.insert(Key::Renew(3), at(4.0));
        assert_eq!(predictions.first(), Some((Key::Monitored(3, 0), at(4.0))));
        predictions.remove_flight(3);
        assert_eq!(predictions.first(), Some((Key::Pair(1, 2), at(5.0))));
        for key in [Key::Wall(3, 0), Key::Pair(1, 2), Key::Pair(0, 1)] {
            predictions.remove(&key);
        }
        assert_eq!(predictions.first(), None);
        assert!(predictions.is_empty());
    }
}
