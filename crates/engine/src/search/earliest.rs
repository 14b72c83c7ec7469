//! The earliest event of a particle.

use crate::{
    numerics::clock::{LONGEST, whole},
    search::entry::{Entry, Kind, Target},
};

/// Keeps the earliest of the events of one particle.
pub(crate) struct Earliest<K> {
    pub entry: Entry<K>,
    /// Whether an event beyond the horizon was found.
    pub far: bool,
}

impl<K> Earliest<K> {
    /// Keeps an event if it is earlier than the one found so far, or of lower rank at the same time.
    #[inline(always)]
    pub fn offer(&mut self, time: i64, target: Target<K>, partner_count: u32) {
        if time > self.entry.time {
            return;
        }
        let entry = Entry { target, partner_count, time, ..self.entry };
        if time < self.entry.time || entry.rank() < self.entry.rank() {
            self.entry = entry;
        }
    }

    /// Offers an event `delay` [ticks] after `from`.
    #[inline(always)]
    pub fn offer_after(&mut self, from: i64, delay: f64, kind: K, partner_count: u32)
    where
        K: Kind,
    {
        if delay <= LONGEST {
            self.offer(from + whole(delay), Target::new(kind), partner_count);
        } else {
            self.far = true;
        }
    }
}
