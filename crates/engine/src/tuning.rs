/*!
Measured thresholds: numbers of particles and densities from which something else is faster.

Each names the page of `benches/record/` that it comes from. None changes a trajectory. Numbers of particles
follow the caches of the machines described there.
*/

/// A number for disks and one for spheres.
#[derive(Debug, Clone, Copy)]
pub(crate) struct PerDimension {
    pub disks: f64,
    pub spheres: f64,
}

impl PerDimension {
    /// The number for this many dimensions, 2 or 3.
    pub fn of(self, dimensions: usize) -> f64 {
        if dimensions == 2 { self.disks } else { self.spheres }
    }
}

/// Numbers of particles.
pub(crate) mod particles {
    /// Up to this many all pairs are tested (throughput.md).
    pub(crate) const ALL_PAIRS: usize = 12;
    /// Windows are chosen from this many on (throughput.md).
    pub(crate) const WINDOWS: usize = 100;

    /// The second-level cache no longer holds what events of the calendar with cells or lists read: it is
    /// prefetched (throughput.md).
    pub(crate) const PREFETCH_CALENDAR: usize = 10_000;
    /// The same for the lists of [`crate::nearby`] …
    pub(crate) const PREFETCH_LISTS: usize = 15_000;
    /// … and for windows.
    pub(crate) const PREFETCH_WINDOWS: usize = 20_000;
    /// The third-level cache no longer holds the cells of windows: they are prefetched, too (throughput.md).
    pub(crate) const PREFETCH_CELLS: usize = 100_000;
    /// Members of lists come from the third-level cache: shorter lists are faster (throughput.md).
    pub(crate) const SHORT_LISTS: usize = 40_000;
    /// Events of windows wait for memory: their work is weighted more than that of opening windows
    /// (throughput.md).
    pub(crate) const WEIGHT_EVENTS: usize = 300_000;

    /// Windows are opened on all cores (threads.md) …
    pub(crate) const PARALLEL_WINDOWS: usize = 1 << 16;
    /// … or from this many on, if contacts within a window are rare: what one core has written the other has
    /// to fetch, and where events are most of the work this costs more than it gains.
    pub(crate) const PARALLEL_RARE_WINDOWS: usize = 1 << 14;
    /// Contacts are rare if there are fewer than one for so many particles.
    pub(crate) const RARE: usize = 8;

    /// Up to this many, windows keep the array of contacts that a new one has been filled with (memory.md).
    pub(crate) const KEEP_CONTACTS: usize = 800_000;
    /// Overlaps are searched for in one slab of the box after the other (memory.md).
    pub(crate) const SLABS: usize = 200_000;
}

/// Packing fractions around the average particle above which lists are faster (throughput.md).
pub(crate) mod dense {
    use super::PerDimension;

    /// Than cells, where all particles have one size …
    pub(crate) const CELLS: PerDimension = PerDimension { spheres: 0.18, disks: 0.42 };
    /// … and where they have not: the width of cells follows the largest, the shell of lists the mean.
    pub(crate) const CELLS_MIXED: PerDimension = PerDimension { spheres: 0.26, disks: 0.5 };
    /// Than windows: the lists of [`crate::nearby`] …
    pub(crate) const WINDOWS: PerDimension = PerDimension { spheres: 0.24, disks: 0.3 };
    /// … from [`super::particles::PREFETCH_LISTS`] on, …
    pub(crate) const WINDOWS_LARGE: PerDimension = PerDimension { spheres: 0.29, disks: 0.34 };
    /// … the lists of the calendar, …
    pub(crate) const WINDOWS_OTHER: PerDimension = PerDimension { spheres: 0.38, disks: 0.7 };
    /// … these under gravity …
    pub(crate) const WINDOWS_FALLING: PerDimension = PerDimension { spheres: 0.55, disks: 0.7 };
    /// … and where sizes differ too much for [`crate::nearby`].
    pub(crate) const WINDOWS_WIDE: PerDimension = PerDimension { spheres: 0.46, disks: 0.7 };
}
