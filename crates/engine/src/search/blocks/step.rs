//! A step of blocks.

use crate::search::blocks::front::Metric;

/// Most events of a block in a step: this number, and so many for each event known at its start.
const MOST: (usize, usize) = (1000, 20);

/// The present step, for all blocks.
pub(crate) struct Step {
    pub metric: Metric,
    /// After `from`, up to and including `to` [ticks].
    pub from: i64,
    pub to: i64,
    /// Times are given as fractions of the window, or span, that began at `begin` [ticks].
    pub begin: i64,
    pub per_tick: f64,
    /// Most events of a block: more are a collapse, which is found where events are taken in order.
    pub most: usize,
}

impl Step {
    /// The step after `from`, up to `to` [ticks], in which this number of events is known.
    pub fn new(metric: Metric, (from, to): (i64, i64), (begin, per_tick): (i64, f64), events: usize) -> Self {
        Self { metric, from, to, begin, per_tick, most: MOST.0 + MOST.1 * events }
    }

    /// A time as a fraction of the window.
    #[inline(always)]
    pub fn fraction(&self, ticks: i64) -> f32 {
        ((ticks - self.begin) as f64 * self.per_tick) as f32
    }
}
