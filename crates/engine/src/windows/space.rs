//! Where everybody is in a window, and what they may meet until its end.

use std::{marker::PhantomData, ops::Range};

use super::{
    cells::Cells,
    due::Due,
    exact,
    filter::{self, Probe, Record, Scratch},
};
use crate::{
    batch::Kernel,
    entry::{Entry, Kind, Target},
    machine::Features,
    particles::{Particle, World},
};

/// Slots that the batch phase searches for at a time.
const BLOCK: usize = 32;

/// Where everybody is in a window: what searches look at.
pub(super) struct Space<F> {
    pub cells: Cells,
    pub records: Vec<Record>,
    /// Anchors in the order of the slots.
    pub anchors: Vec<Particle>,
    /// End of the window [ticks].
    pub end: i64,
    /// Least radius, widened [length]: what searches look for around their paths, besides their own radius.
    pub common_radius: f32,
    pub features: PhantomData<F>,
}

impl<F: Features> Space<F> {
    /// How far around its path a particle of this widened radius has to be registered [length].
    #[inline(always)]
    pub fn extent(&self, radius: f32) -> f32 {
        if F::UNIFORM { 0.0 } else { radius - self.common_radius }
    }

    /// [`Self::scan`] from a thread that has not been told which instructions there are.
    pub fn scan_anywhere(
        &self,
        kernel: Kernel,
        world: &World,
        slots: Range<usize>,
        scratch: &mut Scratch,
        found: &mut Vec<Due>,
    ) {
        match kernel {
            Kernel::Portable => self.scan::<false>(world, slots, scratch, found),
            #[cfg(target_arch = "x86_64")]
            // SAFETY: `Kernel::Avx2` is made by `Kernel::choose` alone, after it has found the features.
            Kernel::Avx2 => unsafe { self.scan_avx2(world, slots, scratch, found) },
        }
    }

    /// Finds all contacts of the window that start from these slots.
    #[inline(always)]
    pub fn scan<const VECTORS: bool>(
        &self,
        world: &World,
        slots: Range<usize>,
        scratch: &mut Scratch,
        found: &mut Vec<Due>,
    ) {
        let mut probes = Vec::with_capacity(BLOCK);
        for from in slots.clone().step_by(BLOCK) {
            probes.clear();
            for slot in from..(from + BLOCK).min(slots.end) {
                let record = self.records[slot];
                probes.push(Probe { slot: slot as u32, record, place: record.x, from: 0.0 });
            }
            self.predict::<true, VECTORS>(world, &probes, scratch, |entry| found.push(entry));
        }
    }

    /// Tells all contacts of the probes up to the window's end.
    #[inline(always)]
    pub fn predict<const HALF: bool, const VECTORS: bool>(
        &self,
        world: &World,
        probes: &[Probe],
        scratch: &mut Scratch,
        mut tell: impl FnMut(Due),
    ) {
        filter::search::<F, HALF, VECTORS>(&self.records, &self.cells, self.common_radius, probes, scratch);
        scratch.work.exact += scratch.hits.len() as u64;
        for &(search, slot) in &scratch.hits {
            let probe = &probes[search as usize];
            let (a, b) = (&self.anchors[probe.slot as usize], &self.anchors[slot as usize]);
            let Some(time) = exact::contact::<F>(world, a, b) else { continue };
            if time <= self.end {
                tell(Due(Entry {
                    time,
                    owner: probe.record.id,
                    target: Target::new(Kind::Collision(self.records[slot as usize].id)),
                    own_count: a.count,
                    partner_count: b.count,
                }));
            }
        }
        if !world.walls.is_empty() {
            for probe in probes {
                self.predict_walls(world, probe, &mut tell);
            }
        }
    }

    /// Tells the contacts of a probe with walls.
    fn predict_walls(&self, world: &World, probe: &Probe, tell: &mut impl FnMut(Due)) {
        let anchor = &self.anchors[probe.slot as usize];
        let class = &world.classes[anchor.class()];
        if class.inverse_mass == 0.0 {
            return;
        }
        for wall in 0..world.walls.len() as u32 {
            let Some(time) = exact::wall_contact(world, anchor, class.radius, wall) else { continue };
            if time <= self.end {
                tell(Due(Entry {
                    time,
                    owner: probe.record.id,
                    target: Target::new(Kind::Wall(wall)),
                    own_count: anchor.count,
                    partner_count: 0,
                }));
            }
        }
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt,popcnt")]
    fn scan_avx2(&self, world: &World, slots: Range<usize>, scratch: &mut Scratch, found: &mut Vec<Due>) {
        self.scan::<true>(world, slots, scratch, found);
    }
}
