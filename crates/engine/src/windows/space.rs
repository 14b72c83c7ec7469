//! The particles in a window, and their contacts up to its end.

use std::{marker::PhantomData, ops::Range};

use super::{
    axes::Axes,
    cells::{Cells, Part},
    filter::{self, Query, Scratch},
    narrow_phase,
    window_event::{Contact, Entry, WindowEvent},
};
use haff_neighbors::prefetch_at;
use rayon::prelude::*;

use crate::{
    batch::Kernel,
    compact::CompactParticle,
    entry::Target,
    features::Features,
    particles::{Particle, World},
    tuning::particles::{PARALLEL_RARE_WINDOWS, PARALLEL_WINDOWS, RARE},
};

/// Slots that the batch phase searches for at a time.
const BLOCK: usize = 32;
/// Slots per parallel task.
pub(super) const TASK: usize = 4096;
/// Cells of a strip in a plane, about.
const STRIP: usize = 512;

/// The particles in a window, as searches read them.
pub(super) struct Space<F> {
    pub cells: Cells,
    pub particles: Vec<CompactParticle>,
    /// Least cell that each slot is registered in at the start of the window.
    pub lowest: Vec<u32>,
    /// First slots of the rows of cells when the slots were sorted, and the number of slots.
    pub rows: Vec<u32>,
    /// Particles in the order of the slots, and their anchors.
    pub ids: Vec<u32>,
    pub anchors: Vec<Particle>,
    /// End of the window [ticks].
    pub end: i64,
    /// Least radius, widened [length]: what searches look for around their paths, besides their own radius.
    pub common_radius: f32,
    /// Contacts found when the last window was opened.
    pub contacts: usize,
    pub features: PhantomData<F>,
}

impl<F: Features> Space<F> {
    /// How far around its path a particle of this widened radius has to be registered [length].
    #[inline(always)]
    pub fn extent(&self, radius: f32) -> f32 {
        if F::UNIFORM { 0.0 } else { radius - self.common_radius }
    }

    /// Whether opening a window is for all cores.
    pub fn is_parallel(&self) -> bool {
        let count = self.particles.len();
        let much =
            count >= PARALLEL_WINDOWS || count >= PARALLEL_RARE_WINDOWS && self.contacts < count / RARE;
        much && rayon::current_num_threads() > 1
    }

    /// Moves all particles on by one window, in parallel if that is worth while.
    #[inline(always)]
    pub fn stream(&mut self, kernel: Kernel, fall: Fall) {
        let axes = self.cells.axes;
        if self.is_parallel() {
            self.particles.par_chunks_mut(TASK).for_each(|particles| match kernel {
                Kernel::Portable => stream::<F>(&axes, fall, particles),
                #[cfg(target_arch = "x86_64")]
                // SAFETY: made by `Kernel::choose` alone, after it has found the features.
                Kernel::Avx2 => unsafe { stream_avx2::<F>(&axes, fall, particles) },
            });
        } else {
            stream::<F>(&axes, fall, &mut self.particles);
        }
    }

    /// Registers all particles along the paths of the window that begins, in parallel if that is worth while.
    #[inline(always)]
    pub fn register_all(&mut self, kernel: Kernel) {
        let is_parallel = self.is_parallel();
        let Self { cells, particles, lowest, rows, common_radius, .. } = self;
        let (axes, particles, common_radius) = (cells.axes, &*particles, *common_radius);
        let parts = cells.parts(rows, lowest);
        let mut left = Vec::new();
        if is_parallel {
            let lefts: Vec<Vec<(u32, u32)>> = parts
                .into_par_iter()
                .map(|part| {
                    let mut left = Vec::new();
                    match kernel {
                        Kernel::Portable => fill::<F>(part, &axes, particles, common_radius, &mut left),
                        #[cfg(target_arch = "x86_64")]
                        // SAFETY: as above.
                        Kernel::Avx2 => unsafe {
                            fill_avx2::<F>(part, &axes, particles, common_radius, &mut left);
                        },
                    }
                    left
                })
                .collect();
            left = lefts.concat();
        } else {
            for part in parts {
                fill::<F>(part, &axes, particles, common_radius, &mut left);
            }
        }
        cells.complete(&left);
    }

    /// Slots in strips that are searched one after the other: some rows of a plane of cells, then those above
    /// them in the next plane. Cells and particles of a strip's surroundings stay in the cache.
    pub fn strips(&self) -> Vec<Range<usize>> {
        let [across, deep, high] = [0, 1, 2].map(|axis| self.cells.axes.n[axis] as usize);
        let thick = (STRIP / across).clamp(1, deep);
        let mut strips = Vec::with_capacity(high * deep.div_ceil(thick));
        for row in (0..deep).step_by(thick) {
            for plane in 0..high {
                let first = plane * deep;
                let end = (row + thick).min(deep);
                strips.push(self.rows[first + row] as usize..self.rows[first + end] as usize);
            }
        }
        strips
    }

    /// [`Self::scan`] from a thread that has not been told which instructions there are.
    pub fn scan_anywhere(
        &self,
        kernel: Kernel,
        world: &World,
        slots: Range<usize>,
        scratch: &mut Scratch,
        found: &mut Vec<WindowEvent>,
    ) {
        match kernel {
            Kernel::Portable => self.scan::<false>(world, slots, scratch, found),
            #[cfg(target_arch = "x86_64")]
            // SAFETY: made by `Kernel::choose` alone, after it has found the features.
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
        found: &mut Vec<WindowEvent>,
    ) {
        let mut queries = Vec::with_capacity(BLOCK);
        for from in slots.clone().step_by(BLOCK) {
            queries.clear();
            for slot in from..(from + BLOCK).min(slots.end) {
                let compact = self.particles[slot];
                queries.push(Query { slot: slot as u32, compact, start: compact.x, from: 0.0 });
            }
            self.predict::<true, VECTORS>(world, &queries, scratch, |entry| found.push(entry));
        }
    }

    /// Emits all contacts of the queries up to the window's end.
    #[inline(always)]
    pub fn predict<const HALF: bool, const VECTORS: bool>(
        &self,
        world: &World,
        queries: &[Query],
        scratch: &mut Scratch,
        mut emit: impl FnMut(WindowEvent),
    ) {
        let Self { particles, cells, lowest, common_radius, .. } = self;
        filter::search::<F, HALF, VECTORS>(particles, cells, lowest, *common_radius, queries, scratch);
        scratch.work.predictions += scratch.pairs.len() as u64;
        for &(_, slot) in &scratch.pairs {
            prefetch_at(&self.anchors, slot as usize);
            prefetch_at(&self.ids, slot as usize);
        }
        for &(search, slot) in &scratch.pairs {
            let query = &queries[search as usize];
            let (a, b) = (&self.anchors[query.slot as usize], &self.anchors[slot as usize]);
            let Some(time) = narrow_phase::contact::<F>(world, a, b) else { continue };
            if time <= self.end {
                let entry = Entry {
                    time,
                    owner: self.ids[query.slot as usize],
                    target: Target::new(Contact::Collision(self.ids[slot as usize])),
                    own_count: a.count,
                    partner_count: b.count,
                };
                emit(WindowEvent(entry));
            }
        }
        if !world.walls.is_empty() {
            for query in queries {
                self.predict_walls(world, query, &mut emit);
            }
        }
    }

    /// Emits the contacts of a query with walls.
    fn predict_walls(&self, world: &World, query: &Query, mut emit: impl FnMut(WindowEvent)) {
        let anchor = &self.anchors[query.slot as usize];
        let class = &world.classes[anchor.class()];
        if class.inverse_mass == 0.0 {
            return;
        }
        for wall in 0..world.walls.len() as u32 {
            let Some(time) = narrow_phase::wall_contact::<F>(world, anchor, class.radius, wall) else {
                continue;
            };
            if time <= self.end {
                emit(WindowEvent(Entry {
                    time,
                    owner: self.ids[query.slot as usize],
                    target: Target::new(Contact::Wall(wall)),
                    own_count: anchor.count,
                    partner_count: 0,
                }));
            }
        }
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt,popcnt")]
    fn scan_avx2(
        &self,
        world: &World,
        slots: Range<usize>,
        scratch: &mut Scratch,
        found: &mut Vec<WindowEvent>,
    ) {
        self.scan::<true>(world, slots, scratch, found);
    }
}

/// The fall of all particles within a window [coordinates], and what the displacement in a window is then
/// longer by [length].
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Fall {
    pub displacement: [i32; 3],
    pub faster: [f32; 3],
}

#[inline(always)]
fn stream<F: Features>(axes: &Axes, fall: Fall, particles: &mut [CompactParticle]) {
    for compact in particles {
        let way = axes.displacement(compact.v, 1.0);
        for axis in 0..3 {
            compact.x[axis] = compact.x[axis].wrapping_add(way[axis]);
            if F::GRAVITY {
                compact.x[axis] = compact.x[axis].wrapping_add(fall.displacement[axis]);
                compact.v[axis] += fall.faster[axis];
            }
        }
    }
}

#[inline(always)]
fn fill<F: Features>(
    part: Part<'_>,
    axes: &Axes,
    particles: &[CompactParticle],
    common_radius: f32,
    left: &mut Vec<(u32, u32)>,
) {
    let path = |slot: u32| {
        let CompactParticle { x, v, radius, .. } = particles[slot as usize];
        (x, v, if F::UNIFORM { 0.0 } else { radius - common_radius })
    };
    part.fill(axes, path, left);
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt,popcnt")]
fn stream_avx2<F: Features>(axes: &Axes, fall: Fall, particles: &mut [CompactParticle]) {
    stream::<F>(axes, fall, particles);
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt,popcnt")]
fn fill_avx2<F: Features>(
    part: Part<'_>,
    axes: &Axes,
    particles: &[CompactParticle],
    common_radius: f32,
    left: &mut Vec<(u32, u32)>,
) {
    fill::<F>(part, axes, particles, common_radius, left);
}
