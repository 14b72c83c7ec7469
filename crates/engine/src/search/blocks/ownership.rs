//! Assertions that no block reads or changes a particle that another one changes in the same round. They are
//! made with debug assertions only; those for cells are in `windows::cells`.

use std::sync::{
    Arc,
    atomic::{AtomicU64, Ordering},
};

/// The particles that one block has changed in the present round.
#[derive(Clone, Default)]
pub(crate) struct Ownership {
    /// For each particle, the round and the block that have changed it last; empty without assertions.
    changes: Arc<Vec<AtomicU64>>,
    /// The present round and the block.
    present: [u32; 2],
}

impl Ownership {
    /// Ownership of all blocks, for this number of particles.
    pub fn new(particles: usize) -> Self {
        let particles = if cfg!(debug_assertions) { particles } else { 0 };
        Self { changes: Arc::new((0..particles).map(|_| AtomicU64::new(0)).collect()), present: [0; 2] }
    }

    /// Begins a round, which has another number than all rounds of the window before, for a block.
    pub fn begin(&mut self, round: usize, block: usize) {
        self.present = [round as u32 + 1, block as u32 + 1];
    }

    /// Begins the round and block of another ownership.
    pub fn begin_as(&mut self, other: &Self) {
        self.present = other.present;
    }

    /// Asserts that no other block has changed a particle in this round.
    #[inline(always)]
    pub fn read(&self, i: u32) {
        if cfg!(debug_assertions) {
            self.test(i, self.changes[i as usize].load(Ordering::Relaxed));
        }
    }

    /// The same, and marks the particle as changed by this block.
    #[inline(always)]
    pub fn change(&self, i: u32) {
        if cfg!(debug_assertions) {
            let [round, block] = self.present.map(u64::from);
            self.test(i, self.changes[i as usize].swap(round << 32 | block, Ordering::Relaxed));
        }
    }

    fn test(&self, i: u32, change: u64) {
        let [round, block] = self.present.map(u64::from);
        assert!(
            change >> 32 != round || change & 0xffff_ffff == block,
            "block {block} uses particle {i}, which block {} has changed in the same round",
            change & 0xffff_ffff
        );
    }
}

#[cfg(all(test, debug_assertions))]
mod tests {
    use super::*;

    #[test]
    #[should_panic(expected = "block 2 uses particle 3, which block 1 has changed in the same round")]
    fn a_particle_that_another_block_has_changed_is_not_used() {
        let mut blocks = vec![Ownership::new(5); 2];
        for (k, block) in blocks.iter_mut().enumerate() {
            block.begin(1, k);
        }
        blocks[0].change(3);
        blocks[0].read(3);
        blocks[1].read(2);
        blocks[1].read(3);
    }
}
