/*!
Measured thresholds: numbers of particles and packing fractions above which another method is faster.

Each threshold names the page of `benches/record/` with the measurements. No threshold changes a trajectory.
The numbers of particles follow from the cache sizes of the machines described there.
*/

/// A value for disks and one for spheres.
#[derive(Debug, Clone, Copy)]
pub(crate) struct PerDimension {
    pub disks: f64,
    pub spheres: f64,
}

impl PerDimension {
    /// The value for this number of dimensions, 2 or 3.
    pub fn of(self, dimensions: usize) -> f64 {
        if dimensions == 2 { self.disks } else { self.spheres }
    }
}

/// Numbers of particles.
pub(crate) mod particles {
    /// All pairs are tested up to this number (throughput.md).
    pub(crate) const ALL_PAIRS: usize = 12;
    /// Windows are chosen from this number on (throughput.md).
    pub(crate) const WINDOWS: usize = 100;
    /// The same in a box that deforms, whose cells are slower (choice.md).
    pub(crate) const WINDOWS_IN_DEFORMING: usize = 20;

    /// From this number on, the calendar with cells prefetches the data of coming events, which no
    /// longer fit in the second-level cache (throughput.md).
    pub(crate) const PREFETCH_CALENDAR: usize = 10_000;
    /// The same for the lists of [`crate::search::lists`].
    pub(crate) const PREFETCH_LISTS: usize = 15_000;
    /// The same for windows.
    pub(crate) const PREFETCH_WINDOWS: usize = 20_000;
    /// From this number on, windows also prefetch cells, which no longer fit in the third-level cache
    /// (throughput.md).
    pub(crate) const PREFETCH_CELLS: usize = 100_000;
    /// From this number on, members of lists are read from the third-level cache, and shorter lists are
    /// faster (throughput.md).
    pub(crate) const SHORT_LISTS: usize = 40_000;
    /// Above this number, events of windows wait for memory, and their work has a larger weight relative to
    /// that of opening windows (throughput.md).
    pub(crate) const WEIGHT_EVENTS: usize = 300_000;

    /// From this number on, windows are opened on all cores (threads.md).
    pub(crate) const PARALLEL_WINDOWS: usize = 1 << 16;
    /// From this number on, windows are opened on all cores if contacts within a window are rare
    /// (threads.md). Events read data that another core has written, and where events are most of the work
    /// this transfer costs more than the opening on all cores saves.
    pub(crate) const PARALLEL_RARE_WINDOWS: usize = 1 << 14;
    /// Contacts are rare if a window has fewer than one contact for this number of particles.
    pub(crate) const RARE: usize = 8;

    /// From this number on, events of windows and lists are taken on several threads (threads.md).
    pub(crate) const PARALLEL_EVENTS: usize = 100_000;
    /// Up to this number, windows keep the array of the contacts found at their opening (memory.md).
    pub(crate) const KEEP_CONTACTS: usize = 800_000;
    /// From this number on, overlaps are searched for in one slab of the box after the other (memory.md).
    pub(crate) const SLABS: usize = 200_000;
}

/// Limits of cells.
pub(crate) mod cells {
    use super::PerDimension;

    /// Mean number of particles in the cells around a particle above which lists are chosen, if sizes differ
    /// (throughput.md, choice.md): with few large particles cells are wide, and most of what is in them is
    /// far away.
    pub(crate) const FULL: PerDimension = PerDimension { spheres: 100.0, disks: 50.0 };
}

/// Packing fractions around the average particle above which lists are chosen, because they are faster than
/// another search (throughput.md).
pub(crate) mod lists_above {
    use super::PerDimension;

    /// Lists instead of cells, if all particles have the same size.
    pub(crate) const CELLS: PerDimension = PerDimension { spheres: 0.18, disks: 0.42 };
    /// Lists instead of cells, if sizes differ: the width of cells follows from the largest radius, the shell
    /// of lists from the mean one.
    pub(crate) const CELLS_MIXED: PerDimension = PerDimension { spheres: 0.26, disks: 0.5 };
    /// The same in a box under shear, in which lists become old sooner, and in one whose edges change.
    pub(crate) const CELLS_SHEARED: PerDimension = PerDimension { spheres: 0.3, disks: 0.6 };
    pub(crate) const CELLS_STRETCHED: PerDimension = PerDimension { spheres: 0.0, disks: 0.0 };
    /// Lists instead of windows.
    pub(crate) const WINDOWS: PerDimension = PerDimension { spheres: 0.24, disks: 0.3 };
    /// The same from [`super::particles::PREFETCH_LISTS`] particles on.
    pub(crate) const WINDOWS_LARGE: PerDimension = PerDimension { spheres: 0.29, disks: 0.34 };
    /// The same in a box under shear, and in one whose edges change.
    pub(crate) const WINDOWS_SHEARED: PerDimension = PerDimension { spheres: 0.48, disks: 0.68 };
    pub(crate) const WINDOWS_STRETCHED: PerDimension = PerDimension { spheres: 0.33, disks: 0.45 };
    /// The same if radii differ by more than twice.
    pub(crate) const WINDOWS_WIDE: PerDimension = PerDimension { spheres: 0.46, disks: 0.7 };
}
