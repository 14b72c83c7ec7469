//! The opening of windows on all cores: moving of particles, registration, and the batch phase.

use haff_neighbors::{Axis, prefetch_at, with_huge_pages};

use crate::{
    model::features::Features,
    numerics::tuning::particles::KEEP_CONTACTS,
    search::{
        batch::Kernel,
        compact::{CompactParticle, HEADROOM, LONGEST_SPAN, NEAREST},
        parallel,
    },
    state::{State, world::World},
};

use super::{
    axes::{self, MAX_WINDOWS},
    cells::Cells,
    filter::{MAX_DISPLACEMENT, SHORT_DISPLACEMENT, Scratch, margin},
    scheduler::{SEARCHES, SEARCHES_PER_PARTICLE, Windows},
    space::{Fall, Space, TASK},
    tune::Work,
    worker::Worker,
};

/// Smallest number of windows after which the slots are filled from the anchors again.
const MIN_WINDOWS: u64 = 3;
/// Approximate number of searches in a trial of the tuner. The counts of shorter trials are too noisy.
const TRIAL: u64 = 200_000;
/// While slots are filled, the particle for the slot that comes this many slots later is prefetched.
const SLOTS_AHEAD: usize = 16;

impl<F: Features> Windows<F> {
    /// Starts a window at the present, with slots filled from the anchors.
    pub(super) fn start_from_anchors(&mut self, world: &World) {
        self.steps.drop_blocks();
        let count = world.particles.len();
        let [path, width] = self.tuner.values;
        if self.width != width {
            self.width = width;
            // The old cells are freed first: they are about a tenth of all memory (benches/record/memory.md).
            self.worker.space.cells = Cells::default();
            self.worker.space.cells = Cells::new(&self.geometry, width * self.spacing, count);
        }
        if let Some(frame) = &mut self.worker.moving {
            frame.start(world, world.now, 0.0, &mut self.worker.space.cells.axes);
        }
        let moving = self.worker.moving;
        // Summed in fixed blocks, so that the rounding does not depend on the number of threads.
        let gravity = self.worker.gravity;
        let blocks = parallel::map_parts(&world.particles, TASK, &|block| {
            let squares = block.iter().map(|particle| {
                let mut velocity = particle.velocity;
                if F::DEFORMS
                    && let Some(frame) = &moving
                {
                    let age = (world.now - particle.time) as f64 * world.clock.tick;
                    return frame.square_speed(particle.position + velocity * age, velocity);
                }
                if F::GRAVITY {
                    velocity += gravity * ((world.now - particle.time) as f64 * world.clock.tick);
                }
                velocity.length_squared()
            });
            squares.fold((0.0, 0.0), |(sum, largest), square| (sum + square, f64::max(largest, square)))
        });
        let (sum, largest) = blocks
            .into_iter()
            .fold((0.0, 0.0), |(sum, largest), block| (sum + block.0, f64::max(largest, block.1)));
        let (mut mean_square, fastest) = (sum / count.max(1) as f64, largest.sqrt());
        if F::GRAVITY {
            // Particles that start to fall from rest reach this speed within about one spacing.
            mean_square += self.worker.gravity.length() * self.spacing;
        }
        let mean = mean_square.sqrt();
        let contact = 2.0 * self.smallest_radius;
        let rounding = (0..3)
            .filter(|&axis| self.geometry.axes[axis] != Axis::Flat)
            .map(|axis| {
                let periodic = self.geometry.axes[axis] == Axis::Periodic;
                axes::rounding(self.geometry.size[axis], periodic, self.smallest_radius)
            })
            .fold(0.0, f64::max);
        let tilt = moving.map_or(0.0, |frame| frame.largest_tilt_at_end());
        let rounding = rounding * (1.0 + tilt);
        let largest_contact = self.largest_contact * f64::from(margin(MAX_DISPLACEMENT, rounding));
        let limit = (0..3)
            .map(|axis| match self.geometry.axes[axis] {
                Axis::Periodic => {
                    let edge = self.geometry.size[axis];
                    // The relative displacement of two particles is up to twice that of one.
                    let straight = || 0.5 * (NEAREST * edge - largest_contact);
                    moving.filter(|_| F::DEFORMS).map_or_else(straight, |frame| {
                        frame.longest_displacement(axis, edge, largest_contact)
                    })
                }
                // Without periodic images the range of coordinates is the limit.
                Axis::Bounded | Axis::Open => NEAREST * self.geometry.size[axis],
                Axis::Flat => f64::INFINITY,
            })
            .zip(self.worker.space.cells.axes.period)
            .map(|(limit, period)| if period > 0.0 { limit.min(NEAREST * period) } else { limit })
            .fold(MAX_DISPLACEMENT * contact, f64::min);
        let windows = (TRIAL / count.max(1) as u64).clamp(MIN_WINDOWS, MAX_WINDOWS);
        // Speed that a falling particle has gained at the end of the last window before the next fill,
        // divided by the length of a window. That window must be short enough for this speed, too.
        let speed_gain = if F::GRAVITY { self.worker.gravity.length() * (windows + 1) as f64 } else { 0.0 };
        let longest = longest_step(limit, HEADROOM * fastest, speed_gain);
        let longest = moving.map_or(longest, |frame| longest.min(frame.longest()));
        let step = (path * self.spacing / mean).min(longest);
        // The length is clamped because a system without motion allows windows of any length.
        let ticks = (step * world.clock.per_time).clamp(1.0, LONGEST_SPAN) as i64;
        self.worker.begin = world.now;
        self.worker.space.end = self.worker.begin + ticks;
        self.worker.step = ticks as f64 * world.clock.tick;
        self.path = mean * self.worker.step / self.spacing;
        // The limit is lowered to the displacement that particles are likely to reach: the margin grows with
        // its square.
        let limit = limit.min(
            ((HEADROOM * fastest + speed_gain * self.worker.step) * self.worker.step)
                .max(SHORT_DISPLACEMENT * contact),
        );
        // Without the displacement that falling adds up to the last window.
        self.worker.max_displacement = (limit - speed_gain * self.worker.step * self.worker.step) as f32;
        let margin = margin(limit / contact * (1.0 + tilt), rounding);
        if let Some(frame) = &moving {
            frame.tilt(&mut self.worker.space.cells.axes, self.worker.step, limit);
        }
        self.worker.space.common_radius = self.smallest_radius as f32 * margin;
        self.fill(world, margin);
        self.fill_age = 0;
        self.fill_interval = windows;
    }

    /// Fills the slots, in the order of their cells, from the anchors.
    fn fill(&mut self, world: &World, margin: f32) {
        let count = world.particles.len();
        let Space { cells, particles, lowest, rows, ids, anchors, .. } = &mut self.worker.space;
        let (axes, step, moving) = (cells.axes, self.worker.step, self.worker.moving);
        let compact = |i: u32| {
            let (position, velocity) = world.flight::<F>(i, world.now);
            if F::DEFORMS
                && let Some(frame) = &moving
            {
                let flight = frame.flight(position, velocity, 0.0, step);
                return CompactParticle {
                    x: [0, 1, 2].map(|axis| axes.coordinate(axis, flight.start[axis])),
                    radius: world.class(i).radius as f32 * margin,
                    v: flight.displacement.map(|v| v as f32),
                    count: 0,
                };
            }
            let p = position.to_array();
            CompactParticle {
                x: [0, 1, 2].map(|axis| axes.coordinate(axis, p[axis])),
                radius: world.class(i).radius as f32 * margin,
                v: velocity.to_array().map(|v| (v * step) as f32),
                count: 0,
            }
        };
        // A counting sort. `slot_of` first holds the cell of every particle, then its slot.
        parallel::change_parts(&mut self.worker.slot_of, TASK, &|first, part| {
            for (i, cell) in part.iter_mut().enumerate() {
                *cell = cells.cell_of(compact((first + i) as u32).x);
            }
        });
        let mut next_slot = vec![0_u32; cells.len() + 1];
        for &cell in &self.worker.slot_of {
            next_slot[cell as usize + 1] += 1;
        }
        for cell in 1..next_slot.len() {
            next_slot[cell] += next_slot[cell - 1];
        }
        ids.change(|ids| ids.resize(count, 0));
        for (i, slot) in self.worker.slot_of.iter_mut().enumerate() {
            let next = &mut next_slot[*slot as usize];
            *slot = *next;
            *next += 1;
            ids[*slot as usize] = i as u32;
        }
        // Now `next_slot` of a cell is the first slot of the next cell.
        let nx = cells.axes.n[0] as usize;
        rows.clear();
        rows.push(0);
        rows.extend(next_slot[..cells.len()].chunks_exact(nx).map(|row| row[nx - 1]));
        lowest.resize(count, 0);
        if particles.is_empty() && count > 0 {
            particles.change(|particles| {
                *particles = with_huge_pages(count);
                particles.resize(count, CompactParticle::default());
            });
            anchors.change(|anchors| {
                *anchors = with_huge_pages(count);
                anchors.resize(count, world.particles[0]);
            });
        }
        let ids: &[u32] = ids;
        parallel::change_both(particles, anchors, TASK, &|first, particles, anchors| {
            for (slot, (own, anchor)) in (first..).zip(particles.iter_mut().zip(anchors)) {
                if let Some(&later) = ids.get(slot + SLOTS_AHEAD) {
                    prefetch_at(&world.particles, later as usize);
                }
                let i = ids[slot];
                *own = compact(i);
                *anchor = world.particles[i as usize];
            }
        });
    }

    /// Starts the next window.
    pub(super) fn next_window(&mut self, state: &mut State) {
        state.world.now = self.worker.space.end;
        self.fill_age += 1;
        if self.fill_age >= self.fill_interval {
            let work = self.worker.scratch.work;
            let opening = std::mem::take(&mut self.opening_work);
            let events = work.since(&self.tuned_work).since(&opening);
            self.tuner.update(&opening, &events, self.path * self.fill_age as f64);
            self.tuned_work = work;
            let [path, width] = self.tuner.values;
            tracing::debug!(path, width, "next lengths of windows and widths of cells");
            self.start_from_anchors(&state.world);
        } else {
            let ticks = self.worker.space.end - self.worker.begin;
            self.worker.begin = self.worker.space.end;
            self.worker.space.end += ticks;
            let fall = self.fall();
            self.worker.space.stream(self.kernel, fall);
            if F::DEFORMS && !self.continue_moving(&state.world) {
                self.start_from_anchors(&state.world);
            }
        }
        self.open(&state.world);
    }

    /// Sets the tilt of a window that follows another one. Returns false if a particle has become too fast,
    /// relative to the flow at its place.
    fn continue_moving(&mut self, world: &World) -> bool {
        let Worker { space, moving, begin, step, max_displacement, .. } = &mut self.worker;
        let Some(frame) = moving else { return true };
        let turns = frame.start(world, *begin, *step, &mut space.cells.axes);
        if turns != 0 {
            space.reduce_tilt(turns, frame.axes.ratio);
        }
        frame.tilt(&mut space.cells.axes, *step, f64::from(*max_displacement));
        space.are_within(*max_displacement)
    }

    /// The change of all positions and displacements by gravity in one window.
    fn fall(&self) -> Fall {
        if !F::GRAVITY {
            return Fall::default();
        }
        let gain = self.worker.gravity * (self.worker.step * self.worker.step);
        Fall {
            displacement: self
                .worker
                .space
                .cells
                .axes
                .displacement((0.5 * gain).to_array().map(|x| x as f32), 1.0),
            gain: gain.to_array().map(|x| x as f32),
        }
    }

    /// Opens the window.
    pub(super) fn open(&mut self, world: &World) {
        match self.kernel {
            Kernel::Portable => self.find_contacts::<false>(world),
            #[cfg(target_arch = "x86_64")]
            // SAFETY: only `Kernel::choose` makes this variant, after it has detected the features.
            Kernel::Avx2 => unsafe { self.find_contacts_avx2(world) },
        }
    }

    /// The batch phase: registers all particles and finds all contacts of the window from the present
    /// flights.
    #[inline(always)]
    fn find_contacts<const VECTORS: bool>(&mut self, world: &World) {
        self.steps.drop_blocks();
        let before = self.worker.scratch.work;
        self.worker.space.register_all(self.kernel);
        let mut found = std::mem::take(&mut self.found);
        found.clear();
        let strips = self.worker.space.strips();
        if self.worker.space.is_parallel() {
            let (space, kernel) = (&self.worker.space, self.kernel);
            let parts = parallel::map(strips, &Scratch::new, &|scratch, slots| {
                let mut found = Vec::new();
                scratch.work = Work::default();
                space.scan_anywhere(kernel, world, slots, scratch, &mut found);
                (found, scratch.work)
            });
            for (mut part, work) in parts {
                found.append(&mut part);
                self.worker.scratch.work.add(&work);
            }
        } else {
            for slots in strips {
                self.worker.space.scan::<VECTORS>(world, slots, &mut self.worker.scratch, &mut found);
            }
        }
        self.worker.scratch.work.windows += 1;
        self.search_limit = self.worker.scratch.work.searches
            + SEARCHES
            + SEARCHES_PER_PARTICLE * self.worker.space.particles.len() as u64;
        self.worker.scratch.work.entries += found.len() as u64;
        self.opening_work.add(&self.worker.scratch.work.since(&before));
        self.worker.space.contacts = found.len();
        if self.prepare_steps(world, &found) {
            // Freed, to save memory: the steps have their own copies.
            return;
        }
        self.end_steps();
        self.worker.queue.open(self.worker.begin, self.worker.space.end, &found);
        // In very large systems, too.
        if self.worker.space.particles.len() <= KEEP_CONTACTS {
            self.found = found;
        }
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt,popcnt")]
    fn find_contacts_avx2(&mut self, world: &World) {
        self.find_contacts::<true>(world);
    }
}

/// The longest time t for which v t + a t² ≤ `displacement`.
fn longest_step(displacement: f64, v: f64, a: f64) -> f64 {
    2.0 * displacement / (v + (v * v + 4.0 * a * displacement).sqrt())
}
