//! The particles in a window, and their contacts up to its end.

use std::{marker::PhantomData, ops::Range};

use glam::DVec3;
use haff_neighbors::{Array, prefetch_at};

use crate::{
    model::features::Features,
    numerics::tuning::particles::{PARALLEL_RARE_WINDOWS, PARALLEL_WINDOWS, RARE},
    search::{
        batch::Kernel,
        compact::CompactParticle,
        entry::Target,
        parallel,
        planes::{self, Planes},
        sharing,
    },
    state::{particle::Particle, world::World},
};

use super::{
    axes::Axes,
    cells::{Cells, Part},
    filter::{self, Scratch, WindowQuery},
    narrow_phase,
    window_event::{Contact, Entry, WindowEvent},
};

/// Number of queries that the batch phase searches for at a time.
const BLOCK: usize = 32;
/// Number of slots per parallel task.
pub(super) const TASK: usize = 4096;
/// Approximate number of cells of a strip in one plane.
const STRIP: usize = 512;

/// The data of a window that searches read.
pub(super) struct Space<F> {
    pub cells: Cells,
    /// The compact particle in each slot.
    pub particles: Array<CompactParticle>,
    /// Lowest cell in which each slot is registered at the start of the window.
    pub lowest: Vec<u32>,
    /// First slot of each row of cells when slots were last sorted; the last element is the number of slots.
    pub rows: Vec<u32>,
    /// Particle in each slot.
    pub ids: Array<u32>,
    /// Anchor of the particle in each slot.
    pub anchors: Array<Particle>,
    /// End of the window [ticks].
    pub end: i64,
    /// Smallest radius, with its margin [length]. Searches extend to this distance around a path plus the
    /// radius of its own particle; larger particles are registered farther around their paths.
    pub common_radius: f32,
    /// Contacts found when the last window was opened.
    pub contacts: usize,
    /// The walls, for bounds on the distance from them.
    pub planes: Planes,
    pub features: PhantomData<F>,
}

impl<F: Features> Space<F> {
    /// The same space for another thread, without what only the opening of windows needs.
    ///
    /// # Safety
    ///
    /// As for [`Array::alias`]: no thread changes cells and slots that another one uses.
    pub unsafe fn alias(&mut self) -> Self {
        // SAFETY: guaranteed by the caller.
        unsafe {
            Self {
                cells: self.cells.alias(),
                particles: self.particles.alias(),
                lowest: Vec::new(),
                rows: Vec::new(),
                ids: self.ids.alias(),
                anchors: self.anchors.alias(),
                end: self.end,
                common_radius: self.common_radius,
                contacts: self.contacts,
                planes: self.planes.clone(),
                features: PhantomData,
            }
        }
    }

    /// For each cell of an axis and its end: the number of particles in cells with a lower index along this
    /// axis, when slots were last sorted.
    pub fn slots_up_to(&self, axis: usize) -> Vec<u64> {
        let axes = &self.cells.axes;
        let mut sums = vec![0; axes.n[axis] as usize + 1];
        if axis == 0 {
            for particle in &self.particles {
                sums[axes.fold(axes.cells(axes.grid_coordinates(particle.x)))[0] as usize + 1] += 1;
            }
        } else {
            for (row, slots) in self.rows.windows(2).enumerate() {
                let (y, z) = (row % axes.n[1] as usize, row / axes.n[1] as usize);
                sums[1 + if axis == 1 { y } else { z }] += u64::from(slots[1] - slots[0]);
            }
        }
        for plane in 1..sums.len() {
            sums[plane] += sums[plane - 1];
        }
        sums
    }

    /// Distance around its path within which a particle with this radius, including the margin, is registered
    /// [length].
    #[inline(always)]
    pub fn extent(&self, radius: f32) -> f32 {
        if F::UNIFORM { 0.0 } else { radius - self.common_radius }
    }

    /// Whether windows are opened on all cores.
    pub fn is_parallel(&self) -> bool {
        let count = self.particles.len();
        let is_large =
            count >= PARALLEL_WINDOWS || count >= PARALLEL_RARE_WINDOWS && self.contacts < count / RARE;
        is_large && sharing::threads() > 1
    }

    /// Moves all particles to the start of the next window, in parallel if that is profitable.
    #[inline(always)]
    pub fn stream(&mut self, kernel: Kernel, fall: Fall) {
        let axes = self.cells.axes;
        if self.is_parallel() {
            parallel::change_parts(&mut self.particles, TASK, &|_, particles| match kernel {
                Kernel::Portable => stream::<F>(&axes, fall, particles),
                #[cfg(target_arch = "x86_64")]
                // SAFETY: only `Kernel::choose` makes this variant, after it has detected the features.
                Kernel::Avx2 => unsafe { stream_avx2::<F>(&axes, fall, particles) },
            });
        } else {
            stream::<F>(&axes, fall, &mut self.particles);
        }
    }

    /// Whether no particle is displaced by more than `displacement` [length] in the window.
    pub fn are_within(&self, displacement: f32) -> bool {
        let is_within = |compact: &CompactParticle| compact.is_within(displacement * displacement);
        let parts = parallel::map_parts(&self.particles, TASK, &|part| part.iter().all(is_within));
        parts.into_iter().all(|part| part)
    }

    /// Describes all particles with a tilt that is less by `turns` edges along the flow per edge along the
    /// gradient: it has exceeded half an edge.
    pub fn reduce_tilt(&mut self, turns: i32, ratio: f64) {
        let more = (f64::from(turns) * ratio) as f32;
        parallel::change_parts(&mut self.particles, TASK, &|_, part| {
            for compact in part {
                // Both edges have the same number of coordinates.
                compact.x[0] = compact.x[0].wrapping_add(turns.wrapping_mul(compact.x[1]));
                compact.v[0] += more * compact.v[1];
            }
        });
    }

    /// Registers all particles along their paths in the new window, in parallel if that is profitable.
    #[inline(always)]
    pub fn register_all(&mut self, kernel: Kernel) {
        let is_parallel = self.is_parallel();
        let Self { cells, particles, lowest, rows, common_radius, .. } = self;
        let (axes, particles, common_radius) = (cells.axes, &*particles, *common_radius);
        let parts = cells.parts(rows, lowest);
        let mut leftover = Vec::new();
        if is_parallel {
            let leftovers = parallel::map(parts, &|| (), &|(), part| {
                let mut leftover = Vec::new();
                match kernel {
                    Kernel::Portable => fill::<F>(part, &axes, particles, common_radius, &mut leftover),
                    #[cfg(target_arch = "x86_64")]
                    // SAFETY: only `Kernel::choose` makes this variant, after it has detected the features.
                    Kernel::Avx2 => unsafe {
                        fill_avx2::<F>(part, &axes, particles, common_radius, &mut leftover);
                    },
                }
                leftover
            });
            leftover = leftovers.concat();
        } else {
            for part in parts {
                fill::<F>(part, &axes, particles, common_radius, &mut leftover);
            }
        }
        cells.complete(&leftover);
    }

    /// Slots of strips, in the order in which they are searched: some rows of a plane of cells, then the same
    /// rows of the next plane. The cells and particles around a strip stay in the cache.
    pub fn strips(&self) -> Vec<Range<usize>> {
        let [nx, ny, nz] = [0, 1, 2].map(|axis| self.cells.axes.n[axis] as usize);
        let rows_per_strip = (STRIP / nx).clamp(1, ny);
        let mut strips = Vec::with_capacity(nz * ny.div_ceil(rows_per_strip));
        for row in (0..ny).step_by(rows_per_strip) {
            for plane in 0..nz {
                let first = plane * ny;
                let end = (row + rows_per_strip).min(ny);
                strips.push(self.rows[first + row] as usize..self.rows[first + end] as usize);
            }
        }
        strips
    }

    /// [`Self::scan`] for the `kernel`, from code that is compiled for the baseline instruction set.
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
            // SAFETY: only `Kernel::choose` makes this variant, after it has detected the features.
            Kernel::Avx2 => unsafe { self.scan_avx2(world, slots, scratch, found) },
        }
    }

    /// Finds the contacts of these slots in the window; each pair is found from one of its slots only.
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
                queries.push(WindowQuery { slot: slot as u32, compact, start: compact.x, from: 0.0 });
            }
            self.predict::<true, VECTORS>(world, &queries, scratch, |entry| found.push(entry));
        }
    }

    /// Emits all contacts of the queries up to the end of the window.
    #[inline(always)]
    pub fn predict<const HALF: bool, const VECTORS: bool>(
        &self,
        world: &World,
        queries: &[WindowQuery],
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
        if !world.boundary.walls.is_empty() {
            for query in queries {
                self.predict_walls(world, query, &mut emit);
            }
        }
    }

    /// Emits the contacts of a query with walls up to the end of the window.
    fn predict_walls(&self, world: &World, query: &WindowQuery, mut emit: impl FnMut(WindowEvent)) {
        let anchor = &self.anchors[query.slot as usize];
        let class = &world.classes[anchor.class()];
        if class.inverse_mass == 0.0 {
            return;
        }
        let acceleration = if F::GRAVITY { world.gravity } else { DVec3::ZERO };
        let duration = (self.end - anchor.time) as f64 * world.clock.tick;
        let (planes, radius) = (&self.planes, class.radius);
        let within = planes::searched(duration, world.clock.tick);
        planes.for_each_in_reach(world, anchor, radius, acceleration, duration, |wall| {
            let contact = narrow_phase::wall_contact::<F>(world, anchor, radius, wall, within);
            if let Some(time) = contact
                && time <= self.end
            {
                emit(WindowEvent(Entry {
                    time,
                    owner: self.ids[query.slot as usize],
                    target: Target::new(Contact::Wall(wall)),
                    own_count: anchor.count,
                    partner_count: 0,
                }));
            }
        });
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

/// The effect of gravity on all particles within a window.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Fall {
    /// Displacement relative to free flight without gravity [coordinates].
    pub displacement: [i32; 3],
    /// Increase of the displacement from one window to the next [length].
    pub gain: [f32; 3],
}

#[inline(always)]
fn stream<F: Features>(axes: &Axes, fall: Fall, particles: &mut [CompactParticle]) {
    for compact in particles {
        let path = if F::DEFORMS { axes.tilt.chord(compact.v, 0.0) } else { compact.v };
        let displacement = axes.displacement(path, 1.0);
        if F::DEFORMS {
            // The velocity relative to the flow and the tilt have changed, both along the flow.
            compact.v[0] -= 2.0 * axes.tilt.change * compact.v[1];
            // c (1 + a t) is constant.
            for axis in 0..3 {
                compact.v[axis] *= axes.tilt.end[axis];
            }
        }
        compact.count = 0;
        for axis in 0..3 {
            compact.x[axis] = compact.x[axis].wrapping_add(displacement[axis]);
            if F::GRAVITY {
                compact.x[axis] = compact.x[axis].wrapping_add(fall.displacement[axis]);
                compact.v[axis] += fall.gain[axis];
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
    leftover: &mut Vec<(u32, u32)>,
) {
    let path = |slot: u32| {
        let CompactParticle { x, v, radius, .. } = particles[slot as usize];
        let v = if F::DEFORMS { axes.tilt.chord(v, 0.0) } else { v };
        (x, v, if F::UNIFORM { 0.0 } else { radius - common_radius })
    };
    part.fill(axes, path, leftover);
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
    leftover: &mut Vec<(u32, u32)>,
) {
    fill::<F>(part, axes, particles, common_radius, leftover);
}
