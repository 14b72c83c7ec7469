//! Sums over particles that do not depend on the number of threads.

use rayon::prelude::*;

use crate::numerics::sum::Sums;

/// Particles per block of a parallel sum. Blocks do not depend on the number of threads, and their sums are
/// added in order, so that the result does not depend on it either.
pub(crate) const BLOCK: usize = 4096;

/// Sums `terms(i)` over i < `count`, in an order that does not depend on the number of threads.
pub(crate) fn total<const K: usize>(count: usize, terms: impl Fn(u32) -> [f64; K] + Sync) -> [f64; K] {
    let blocks: Vec<Sums<K>> = (0..count.div_ceil(BLOCK))
        .into_par_iter()
        .map(|block| {
            let mut sums = Sums::ZERO;
            for i in block * BLOCK..((block + 1) * BLOCK).min(count) {
                sums.add(terms(i as u32));
            }
            sums
        })
        .collect();
    let mut sums = Sums::ZERO;
    for block in &blocks {
        sums.merge(block);
    }
    sums.values()
}
