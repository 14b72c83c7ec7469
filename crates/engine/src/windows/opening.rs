//! How windows are opened: streaming, registration and the batch phase, on all cores.

use haff_neighbors::{Axis, prefetch_at, with_huge_pages};
use rayon::prelude::*;

use super::{
    SEARCHES, SEARCHES_PER_PARTICLE, Windows,
    axes::{self, MOST_WINDOWS},
    cells::Cells,
    filter::{FARTHEST, NEAR, Scratch, margin},
    space::{Fall, Space, TASK},
    tune::Work,
    window_event::WindowEvent,
};
use crate::{
    batch::Kernel,
    compact::{CompactParticle, HEADROOM, LONGEST_SPAN, NEAREST},
    features::Features,
    particles::World,
    state::State,
    tuning::particles::KEEP_CONTACTS,
};

const LEAST_WINDOWS: u64 = 3;
/// Searches that a trial of the tuner takes, so that its counts mean something.
const TRIAL: u64 = 200_000;
/// While slots are filled, particles are asked for so many slots ahead.
const AHEAD: usize = 16;

impl<F: Features> Windows<F> {
    /// Starts a window at the present, from the anchors.
    pub(super) fn start_afresh(&mut self, world: &World) {
        let count = world.particles.len();
        let [path, width] = self.tuner.values;
        if self.width != width {
            self.width = width;
            // The old ones go first: they are a tenth of all memory.
            self.space.cells = Cells::default();
            self.space.cells = Cells::new(&self.geometry, width * self.spacing, count);
        }
        // By blocks, so that the sum does not depend on the number of threads.
        let blocks: Vec<(f64, f64)> = world
            .particles
            .par_chunks(TASK)
            .map(|block| {
                let squares = block.iter().map(|particle| {
                    let mut velocity = particle.velocity;
                    if F::GRAVITY {
                        velocity += self.gravity * ((world.now - particle.time) as f64 * world.clock.tick);
                    }
                    velocity.length_squared()
                });
                squares.fold((0.0, 0.0), |(sum, most), square| (sum + square, f64::max(most, square)))
            })
            .collect();
        let (sum, most) = blocks
            .into_iter()
            .fold((0.0, 0.0), |(sum, most), block| (sum + block.0, f64::max(most, block.1)));
        let (mut mean_square, fastest) = (sum / count.max(1) as f64, most.sqrt());
        if F::GRAVITY {
            // Particles that have just begun to fall are soon as fast as this.
            mean_square += self.gravity.length() * self.spacing;
        }
        let mean = mean_square.sqrt();
        // Two particles come apart at twice the speed of one.
        let contact = 2.0 * self.least;
        let rounding = (0..3)
            .filter(|&axis| self.geometry.axes[axis] != Axis::Flat)
            .map(|axis| {
                let periodic = self.geometry.axes[axis] == Axis::Periodic;
                axes::rounding(self.geometry.size[axis], periodic, self.least)
            })
            .fold(0.0, f64::max);
        let widest = 2.0 * self.geometry.radius * f64::from(margin(FARTHEST, rounding));
        let farthest = (0..3)
            .map(|axis| match self.geometry.axes[axis] {
                Axis::Periodic => 0.5 * (NEAREST * self.geometry.size[axis] - widest),
                // There the range of coordinates is the limit.
                Axis::Bounded | Axis::Open => NEAREST * self.geometry.size[axis],
                Axis::Flat => f64::INFINITY,
            })
            .zip(self.space.cells.axes.period)
            .map(|(farthest, period)| if period > 0.0 { farthest.min(NEAREST * period) } else { farthest })
            .fold(FARTHEST * contact, f64::min);
        let windows = (TRIAL / count.max(1) as u64).clamp(LEAST_WINDOWS, MOST_WINDOWS);
        // The last window has to be short enough for particles that have been falling in all of them.
        let gain = if F::GRAVITY { self.gravity.length() * (windows + 1) as f64 } else { 0.0 };
        let longest = longest_step(farthest, HEADROOM * fastest, gain);
        let step = (path * self.spacing / mean).min(longest);
        // Without motion any window will do.
        let ticks = (step * world.clock.per_time).clamp(1.0, LONGEST_SPAN) as i64;
        self.begin = world.now;
        self.space.end = self.begin + ticks;
        self.step = ticks as f64 * world.clock.tick;
        self.path = mean * self.step / self.spacing;
        // No further than particles are likely to move: single precision rounds long displacements more.
        let farthest =
            farthest.min(((HEADROOM * fastest + gain * self.step) * self.step).max(NEAR * contact));
        self.farthest = (farthest - gain * self.step * self.step) as f32;
        let margin = margin(farthest / contact, rounding);
        self.space.common_radius = self.least as f32 * margin;
        self.fill(world, margin);
        self.opened = 0;
        self.last_window = windows;
    }

    /// Fills the slots, in the order of their cells, from the anchors.
    fn fill(&mut self, world: &World, margin: f32) {
        let count = world.particles.len();
        let Space { cells, particles, lowest, rows, ids, anchors, .. } = &mut self.space;
        let (axes, step) = (cells.axes, self.step);
        let compact = |i: u32| {
            let (position, velocity) = world.flight::<F>(i, world.now);
            let p = position.to_array();
            CompactParticle {
                x: [0, 1, 2].map(|axis| axes.coordinate(axis, p[axis])),
                radius: world.class(i).radius as f32 * margin,
                v: velocity.to_array().map(|v| (v * step) as f32),
                count: 0,
            }
        };
        // First the cell of every particle, then its slot.
        self.slot_of
            .par_iter_mut()
            .enumerate()
            .for_each(|(i, cell)| *cell = cells.cell_of(compact(i as u32).x));
        let mut place = vec![0_u32; cells.len() + 1];
        for &cell in &self.slot_of {
            place[cell as usize + 1] += 1;
        }
        for cell in 1..place.len() {
            place[cell] += place[cell - 1];
        }
        ids.resize(count, 0);
        for (i, slot) in self.slot_of.iter_mut().enumerate() {
            let place = &mut place[*slot as usize];
            *slot = *place;
            *place += 1;
            ids[*slot as usize] = i as u32;
        }
        // By now the place of a cell is where the next begins.
        let across = cells.axes.n[0] as usize;
        rows.clear();
        rows.push(0);
        rows.extend(place[..cells.len()].chunks_exact(across).map(|row| row[across - 1]));
        lowest.resize(count, 0);
        if particles.is_empty() && count > 0 {
            (*particles, *anchors) = (with_huge_pages(count), with_huge_pages(count));
            particles.resize(count, CompactParticle::default());
            anchors.resize(count, world.particles[0]);
        }
        let ids = &*ids;
        particles.par_iter_mut().zip(anchors).enumerate().for_each(|(slot, (own, anchor))| {
            if let Some(&later) = ids.get(slot + AHEAD) {
                prefetch_at(&world.particles, later as usize);
            }
            let i = ids[slot];
            *own = compact(i);
            *anchor = world.particles[i as usize];
        });
    }

    /// Starts the next window.
    pub(super) fn next_window(&mut self, state: &mut State) {
        state.world.now = self.space.end;
        self.opened += 1;
        if self.opened >= self.last_window {
            let work = self.scratch.work;
            let opening = std::mem::take(&mut self.opening);
            let events = work.since(&self.judged).since(&opening);
            self.tuner.judge(&opening, &events, self.path * self.opened as f64);
            self.judged = work;
            let [path, width] = self.tuner.values;
            tracing::debug!(path, width, "next lengths of windows and widths of cells");
            self.start_afresh(&state.world);
        } else {
            let ticks = self.space.end - self.begin;
            self.begin = self.space.end;
            self.space.end += ticks;
            let fall = self.fall();
            self.space.stream(self.kernel, fall);
        }
        self.open(&state.world);
    }

    /// The fall of all particles in the time of a window.
    fn fall(&self) -> Fall {
        if !F::GRAVITY {
            return Fall::default();
        }
        let faster = self.gravity * (self.step * self.step);
        Fall {
            displacement: self
                .space
                .cells
                .axes
                .displacement((0.5 * faster).to_array().map(|way| way as f32), 1.0),
            faster: faster.to_array().map(|way| way as f32),
        }
    }

    /// Opens the window.
    pub(super) fn open(&mut self, world: &World) {
        match self.kernel {
            Kernel::Portable => self.find_contacts::<false>(world),
            #[cfg(target_arch = "x86_64")]
            // SAFETY: made by `Kernel::choose` alone, after it has found the features.
            Kernel::Avx2 => unsafe { self.find_contacts_avx2(world) },
        }
    }

    /// The batch phase: all contacts of the window, as things stand.
    #[inline(always)]
    fn find_contacts<const VECTORS: bool>(&mut self, world: &World) {
        let before = self.scratch.work;
        self.space.register_all(self.kernel);
        let mut found = std::mem::take(&mut self.found);
        found.clear();
        let strips = self.space.strips();
        if self.space.is_parallel() {
            let (space, kernel) = (&self.space, self.kernel);
            let parts: Vec<(Vec<WindowEvent>, Work)> = strips
                .into_par_iter()
                .map_init(Scratch::new, |scratch, slots| {
                    let mut found = Vec::new();
                    scratch.work = Work::default();
                    space.scan_anywhere(kernel, world, slots, scratch, &mut found);
                    (found, scratch.work)
                })
                .collect();
            for (mut part, work) in parts {
                found.append(&mut part);
                self.scratch.work.add(&work);
            }
        } else {
            for slots in strips {
                self.space.scan::<VECTORS>(world, slots, &mut self.scratch, &mut found);
            }
        }
        self.scratch.work.windows += 1;
        self.last_search =
            self.scratch.work.searches + SEARCHES + SEARCHES_PER_PARTICLE * self.space.particles.len() as u64;
        self.scratch.work.entries += found.len() as u64;
        self.opening.add(&self.scratch.work.since(&before));
        self.space.contacts = found.len();
        self.queue.open(self.begin, self.space.end, &found);
        // Of very large systems they are not kept: they are in the queue now, and their number is not used.
        if self.space.particles.len() <= KEEP_CONTACTS {
            self.found = found;
        }
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt,popcnt")]
    fn find_contacts_avx2(&mut self, world: &World) {
        self.find_contacts::<true>(world);
    }
}

/// The longest time t in which v t + a t² is no more than `farthest`.
fn longest_step(farthest: f64, v: f64, a: f64) -> f64 {
    2.0 * farthest / (v + (v * v + 4.0 * a * farthest).sqrt())
}
