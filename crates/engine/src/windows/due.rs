//! Events in the order in which they happen, those of one tick among them: a window knows all that are to come.

use std::cmp::Ordering;

use haff_calendar::Event;

use crate::entry::Entry;

/// An entry whose order is that of events, ties by rank.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Due(pub Entry);

impl Ord for Due {
    #[inline]
    fn cmp(&self, other: &Self) -> Ordering {
        self.0.time.cmp(&other.0.time).then_with(|| self.0.rank().cmp(&other.0.rank())).then_with(|| {
            // Only to make the order total: either announces the same event, or one is stale.
            self.0.cmp(&other.0)
        })
    }
}

impl PartialOrd for Due {
    #[inline]
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Event for Due {
    #[inline]
    fn time(&self) -> i64 {
        self.0.time
    }
}
