//! Calendar entries: one event of one particle.

use std::{cmp::Ordering, marker::PhantomData};

use haff_calendar::Event;

/// The kind of event of a calendar entry. Tags are in the order of simultaneous events: impacts first.
pub(crate) trait Kind: Copy {
    /// The tag, below 4, and an index.
    fn encode(self) -> (u32, u32);
    /// The inverse of [`Self::encode`].
    fn decode(tag: u32, index: u32) -> Self;
}

/// Tags. The first three are events of all calendars, the last one is an update of a scheduler's own data.
pub(crate) const COLLISION: u32 = 0;
pub(crate) const WALL: u32 = 1;
pub(crate) const END_OF_BOUNCES: u32 = 2;
pub(crate) const UPDATE: u32 = 3;
/// Index of an update that only predicts the particle again at a later time.
pub(crate) const PREDICTION: u32 = INDEX;

/// Target of an entry: two bits of tag above thirty bits of index.
#[derive(Debug)]
#[repr(transparent)]
pub(crate) struct Target<K>(u32, PhantomData<K>);

const TAG: u32 = 30;
const INDEX: u32 = (1 << TAG) - 1;

impl<K> Target<K> {
    /// No event.
    pub const NONE: Self = Self(UPDATE << TAG | PREDICTION, PhantomData);

    /// The partner, if the event is a collision of two particles.
    #[inline]
    pub fn partner(self) -> Option<u32> {
        (self.0 >> TAG == COLLISION).then_some(self.0)
    }
}

impl<K: Kind> Target<K> {
    #[inline]
    pub fn new(kind: K) -> Self {
        let (tag, index) = kind.encode();
        Self(tag << TAG | index, PhantomData)
    }

    #[inline]
    pub fn kind(self) -> K {
        K::decode(self.0 >> TAG, self.0 & INDEX)
    }
}

// Implemented by hand: derived implementations would require the same traits of `K`.
impl<K> Clone for Target<K> {
    #[inline]
    fn clone(&self) -> Self {
        *self
    }
}

impl<K> Copy for Target<K> {}

impl<K> PartialEq for Target<K> {
    #[inline]
    fn eq(&self, other: &Self) -> bool {
        self.0 == other.0
    }
}

impl<K> Eq for Target<K> {}

/// One calendar entry, 24 bytes. The next event of `owner` invalidates it. After an event of the partner, the
/// owner must be predicted again.
///
/// The small fields come first, so that they are copied together as sixteen bytes. Reading a copy in other
/// parts than those in which it was written stalls on store forwarding.
#[derive(Debug)]
#[repr(C)]
pub(crate) struct Entry<K> {
    pub owner: u32,
    pub target: Target<K>,
    /// Event counters of owner and partner when the entry was made.
    pub own_count: u32,
    pub partner_count: u32,
    pub time: i64,
}

impl<K> Entry<K> {
    /// An entry without an event, for a particle with this event counter.
    #[inline]
    pub fn none(owner: u32, own_count: u32) -> Self {
        Self { time: i64::MAX, owner, target: Target::NONE, own_count, partner_count: 0 }
    }

    /// Rank among simultaneous events: the kind, then the ids of the bodies, lower one first. It does not
    /// depend on which of two partners owns the entry.
    #[inline]
    pub fn rank(&self) -> (u32, u32, u32) {
        let tag = self.target.0 >> TAG;
        if tag == COLLISION {
            (COLLISION, self.owner.min(self.target.0), self.owner.max(self.target.0))
        } else {
            (tag, self.owner, self.target.0 & INDEX)
        }
    }

    /// Whether `other` is the partner's entry for the same collision.
    #[inline]
    pub fn mirrors(&self, other: &Self) -> bool {
        self.target.0 == other.owner
            && other.target.0 == self.owner
            && self.own_count == other.partner_count
            && self.partner_count == other.own_count
    }
}

impl<K> Clone for Entry<K> {
    #[inline]
    fn clone(&self) -> Self {
        *self
    }
}

impl<K> Copy for Entry<K> {}

impl<K> PartialEq for Entry<K> {
    #[inline]
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl<K> Eq for Entry<K> {}

/// The order of the calendar: by time. Events of one tick are taken in the order of [`Entry::rank`], which is
/// not part of this order.
impl<K> Ord for Entry<K> {
    #[inline]
    fn cmp(&self, other: &Self) -> Ordering {
        self.time.cmp(&other.time).then_with(|| {
            // The rest only makes the order total.
            (self.owner, self.target.0, self.own_count, self.partner_count).cmp(&(
                other.owner,
                other.target.0,
                other.own_count,
                other.partner_count,
            ))
        })
    }
}

impl<K> PartialOrd for Entry<K> {
    #[inline]
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl<K> Event for Entry<K> {
    #[inline]
    fn time(&self) -> i64 {
        self.time
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::search::search_event::SearchEvent;

    #[test]
    fn an_entry_is_24_bytes() {
        assert_eq!(size_of::<Entry<SearchEvent>>(), 24);
    }

    #[test]
    fn targets_survive_packing() {
        for kind in [
            SearchEvent::Collision(0),
            SearchEvent::Collision(INDEX),
            SearchEvent::Wall(7),
            SearchEvent::EndOfBounces,
            SearchEvent::Crossing(5),
            SearchEvent::Prediction,
        ] {
            let target = Target::new(kind);
            assert_eq!(target.kind(), kind);
            let partner = if let SearchEvent::Collision(j) = kind { Some(j) } else { None };
            assert_eq!(target.partner(), partner);
        }
        assert_eq!(Target::<SearchEvent>::NONE.kind(), SearchEvent::Prediction);
    }

    #[test]
    fn simultaneous_events_are_ordered_by_kind_then_by_ids() {
        let entry =
            |owner, kind| Entry { time: 5, owner, target: Target::new(kind), own_count: 0, partner_count: 0 };
        let mut entries = [
            entry(0, SearchEvent::Crossing(1)),
            entry(0, SearchEvent::Wall(2)),
            entry(9, SearchEvent::Collision(3)),
            entry(4, SearchEvent::Collision(8)),
            entry(1, SearchEvent::EndOfBounces),
        ];
        entries.sort_by_key(Entry::rank);
        let kinds: Vec<_> = entries.iter().map(|e| (e.owner, e.target.kind())).collect();
        assert_eq!(
            kinds,
            [
                (9, SearchEvent::Collision(3)),
                (4, SearchEvent::Collision(8)),
                (0, SearchEvent::Wall(2)),
                (1, SearchEvent::EndOfBounces),
                (0, SearchEvent::Crossing(1))
            ]
        );
    }
}
