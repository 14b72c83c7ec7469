//! Calendar entries: one per particle, its earliest event.

use std::cmp::Ordering;

use haff_calendar::Event;

/// What an entry announces. The order is that of simultaneous events: impacts first, bookkeeping last.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Kind {
    /// Collision with particle `.0`.
    Collision(u32),
    /// Collision with wall `.0`.
    Wall(u32),
    /// End of a completed series of bounces.
    Rest,
    /// The search's transfer `.0`.
    Transfer(u8),
    /// Nothing within the horizon: look again.
    Renewal,
}

/// Target of an entry, packed: two tag bits above thirty of index.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(transparent)]
pub(crate) struct Target(u32);

const TAG: u32 = 30;
const INDEX: u32 = (1 << TAG) - 1;
/// Transfer code that stands for a renewal.
const RENEWAL: u32 = INDEX;

impl Target {
    /// No event at all.
    pub const NONE: Self = Self(3 << TAG | RENEWAL);

    #[inline]
    pub fn new(kind: Kind) -> Self {
        Self(match kind {
            Kind::Collision(j) => j,
            Kind::Wall(wall) => 1 << TAG | wall,
            Kind::Rest => 2 << TAG,
            Kind::Transfer(code) => 3 << TAG | u32::from(code),
            Kind::Renewal => 3 << TAG | RENEWAL,
        })
    }

    #[inline]
    pub fn kind(self) -> Kind {
        let index = self.0 & INDEX;
        match self.0 >> TAG {
            0 => Kind::Collision(index),
            1 => Kind::Wall(index),
            2 => Kind::Rest,
            _ if index == RENEWAL => Kind::Renewal,
            _ => Kind::Transfer(index as u8),
        }
    }
}

/// One calendar entry, 24 bytes. It is void once `owner` has had another event, stale once its partner has.
///
/// The small fields are first: they are copied as one half of sixteen bytes then, and no copy is read in other parts than it was
/// written in, which would have to wait.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(C)]
pub(crate) struct Entry {
    pub owner: u32,
    pub target: Target,
    /// Event counters of owner and partner when the entry was made.
    pub own_count: u32,
    pub partner_count: u32,
    pub time: i64,
}

impl Entry {
    /// Rank among simultaneous events: kind, then the ids of the bodies, lesser first. It does not depend on which of
    /// two partners made the entry.
    #[inline]
    pub fn rank(&self) -> (u32, u32, u32) {
        let tag = self.target.0 >> TAG;
        if tag == 0 {
            (0, self.owner.min(self.target.0), self.owner.max(self.target.0))
        } else {
            (tag, self.owner, self.target.0 & INDEX)
        }
    }

    /// Whether the other is the partner's entry for the same collision.
    #[inline]
    pub fn mirrors(&self, other: &Self) -> bool {
        self.target.0 == other.owner
            && other.target.0 == self.owner
            && self.own_count == other.partner_count
            && self.partner_count == other.own_count
    }
}

/// The order of the calendar: by time alone as far as physics goes. What is first of a tick is for [`Entry::rank`].
impl Ord for Entry {
    #[inline]
    fn cmp(&self, other: &Self) -> Ordering {
        self.time.cmp(&other.time).then_with(|| {
            // Only to make the order total.
            (self.owner, self.target.0, self.own_count, self.partner_count).cmp(&(
                other.owner,
                other.target.0,
                other.own_count,
                other.partner_count,
            ))
        })
    }
}

impl PartialOrd for Entry {
    #[inline]
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Event for Entry {
    #[inline]
    fn time(&self) -> i64 {
        self.time
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_entry_is_24_bytes() {
        assert_eq!(size_of::<Entry>(), 24);
    }

    #[test]
    fn targets_survive_packing() {
        for kind in [
            Kind::Collision(0),
            Kind::Collision(INDEX),
            Kind::Wall(7),
            Kind::Rest,
            Kind::Transfer(5),
            Kind::Renewal,
        ] {
            assert_eq!(Target::new(kind).kind(), kind);
        }
    }

    #[test]
    fn simultaneous_events_go_by_kind_then_ids_whoever_made_them() {
        let entry =
            |owner, kind| Entry { time: 5, owner, target: Target::new(kind), own_count: 0, partner_count: 0 };
        let mut entries = [
            entry(0, Kind::Transfer(1)),
            entry(0, Kind::Wall(2)),
            entry(9, Kind::Collision(3)),
            entry(4, Kind::Collision(8)),
            entry(1, Kind::Rest),
        ];
        entries.sort_by_key(Entry::rank);
        let kinds: Vec<_> = entries.iter().map(|e| (e.owner, e.target.kind())).collect();
        assert_eq!(
            kinds,
            [
                (9, Kind::Collision(3)),
                (4, Kind::Collision(8)),
                (0, Kind::Wall(2)),
                (1, Kind::Rest),
                (0, Kind::Transfer(1))
            ]
        );
    }
}
