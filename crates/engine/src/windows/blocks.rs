//! Events on several threads: the grid is cut into blocks along one axis, and the window into steps of time.
//!
//! In a step, each block takes the events that nothing unknown can have changed ([`super::front`]) from its
//! own queue, in the order of time, and leaves the others over. In a second round, blocks that reach from the
//! middle of one to the middle of the next do the same with these; in a third one, a single block takes the
//! rest. A block changes only particles that are registered in none but its own cells, and reads only these
//! cells: what one thread writes no other one reads.
//!
//! A prediction depends only on the anchors of two particles, and an impact only on those of its partners.
//! Therefore every order of events that respects causes gives the same bits. If an event of a later round is
//! where the front of an earlier one has not expected it, or a limit is exceeded, the step is undone, and its
//! events are taken one after the other.

mod block;

use haff_neighbors::prefetch_at;
use rayon::prelude::*;

use super::{
    Windows,
    front::{Dilations, Metric, Planes, Sources},
    space::TASK,
    window_event::{Entry, WindowEvent},
};
use crate::{
    compact::CompactParticle,
    event_loop::Limit,
    features::Features,
    particles::World,
    report::{Exchange, Observer, VelocityChange},
    state::State,
    tuning::particles::PARALLEL_EVENTS,
};
use block::{Block, Round, Step, place};

/// The largest speed of fronts, relative to that of the fastest particle when the window is opened.
const SPEED: f32 = 1.25;
/// Number of steps of a window, for one contact per particle: so many that few particles have two collisions
/// in a step, and a source is seldom reached by the cone of another one.
const STEPS_PER_CONTACT: f32 = 130.0;
const MAX_STEPS: f32 = 64.0;
/// Rounds of a step.
const ROUNDS: usize = 3;
/// Blocks of entries for full cells, for each block: this number, and one for so many cells.
const SPARE: (usize, usize) = (1024, 64);

/// What decides whether and how events are taken by blocks.
#[derive(Debug, Clone, Copy)]
struct Settings {
    /// Smallest number of particles, and of contacts known at the start of a step.
    min_particles: usize,
    min_contacts: usize,
    /// Number of blocks; `None`: that of threads, if there are several.
    blocks: Option<usize>,
    /// Smallest thickness of a block [largest contact distances], without the ways of the fastest particles.
    thickness: f32,
    /// Distances of fronts.
    dilations: Dilations,
}

impl Settings {
    const MEASURED: Self = Self {
        min_particles: PARALLEL_EVENTS,
        min_contacts: 300,
        blocks: None,
        thickness: 20.0,
        dilations: Dilations { face: 5.0, source: 3.5, inner: 2.0 },
    };

    #[cfg(not(test))]
    fn present() -> Self {
        Self::MEASURED
    }

    /// Those of a test, if it has set any.
    #[cfg(test)]
    fn present() -> Self {
        tests::SETTINGS.get()
    }
}

/// Where contacts are distributed to blocks, the particle of the contact that comes this many later is
/// prefetched.
const AHEAD: usize = 12;

/// The steps of the present window.
pub(super) struct Steps<F> {
    /// Contacts of the steps that have not begun, by step.
    contacts: Vec<Vec<WindowEvent>>,
    /// Contacts that are left to the next round.
    pending: Vec<WindowEvent>,
    /// The end of each step [ticks], and the next step.
    ends: Vec<i64>,
    next: usize,
    /// End of the last step [ticks].
    end: i64,
    /// Whether particles have been changed since then by something other than a block.
    is_serial: bool,
    metric: Option<Metric>,
    rounds: [Round; ROUNDS],
    blocks: Vec<Block<F>>,
    settings: Settings,
    /// Counts over the run.
    counts: Counts,
}

/// How events have been taken.
#[derive(Debug, Clone, Copy, Default)]
struct Counts {
    /// Events by round.
    rounds: [u64; ROUNDS],
    /// Steps, and how many of them were undone.
    steps: u64,
    undone: u64,
}

impl<F> Default for Steps<F> {
    fn default() -> Self {
        Self {
            contacts: Vec::new(),
            pending: Vec::new(),
            ends: Vec::new(),
            next: 0,
            end: 0,
            is_serial: false,
            metric: None,
            rounds: Default::default(),
            blocks: Vec::new(),
            settings: Settings::present(),
            counts: Counts::default(),
        }
    }
}

impl<F> Steps<F> {
    /// The step in which a time falls.
    fn step_of(&self, begin: i64, time: i64) -> usize {
        let last = self.ends.len() - 1;
        let part = (time - begin) as f64 / (self.ends[last] - begin) as f64;
        let mut step = ((part * self.ends.len() as f64) as usize).min(last);
        // By rounding, the time can be in a neighboring step.
        while step > 0 && time <= self.ends[step - 1] {
            step -= 1;
        }
        while step < last && time > self.ends[step] {
            step += 1;
        }
        step
    }

    /// Notes that particles have been changed by something other than a block.
    pub fn mark_serial(&mut self) {
        self.is_serial = true;
    }

    /// Drops the aliases of the window's arrays.
    pub fn drop_blocks(&mut self) {
        self.blocks.clear();
    }
}

#[cfg(not(test))]
impl<F> Drop for Steps<F> {
    fn drop(&mut self) {
        let Counts { rounds: [first, second, third], steps, undone } = self.counts;
        if steps > 0 {
            tracing::info!(first, second, third, steps, undone, "events taken by blocks, by round");
        }
    }
}

impl<F: Features> Windows<F> {
    /// Whether events can be taken by blocks: the number of blocks, if there are several threads and the
    /// system is large enough.
    fn blocks(&self, world: &World) -> Option<usize> {
        let Settings { min_particles, blocks, .. } = self.steps.settings;
        let suits = world.particles.len() >= min_particles
            && world.wall_sums.is_none()
            && world.resting == 0
            && !world.carries;
        let blocks = blocks.unwrap_or_else(rayon::current_num_threads);
        (suits && blocks > 1).then_some(blocks)
    }

    /// Prepares the steps of a window that has just been opened with these contacts. Returns false if its
    /// events are taken one after the other.
    pub(super) fn prepare_steps(&mut self, world: &World, found: &[WindowEvent]) -> bool {
        self.steps.blocks.clear();
        let Some(most) = self.blocks(world) else { return false };
        let axes = self.worker.space.cells.axes;
        let axis = if axes.n[2] > 1 { 2 } else { 1 };
        let planes = axes.n[axis];
        let sigma = 2.0
            * self.geometry.radius as f32
            * (self.worker.space.common_radius / self.smallest_radius as f32);
        let particles = &self.worker.space.particles;
        let fastest = fastest(particles);
        let speed = (SPEED * fastest).max(1e-30);
        let metric = Metric::new(&axes, axis, speed, sigma, self.steps.settings.dilations);
        // Steps so short that a source is seldom reached by the cone of another one.
        let density = found.len() as f32 / particles.len().max(1) as f32;
        let count = steps(density, found.len(), self.steps.settings.min_contacts);
        let thickness = (self.steps.settings.thickness * sigma + 2.0 * speed) * axes.cells[axis];
        let blocks = most.min((planes as f32 / thickness) as usize);
        let reach = metric.source + metric.speed / count.max(1) as f32;
        if blocks < 2 || count == 0 || !metric.reaches(reach) {
            return false;
        }
        self.steps.metric = Some(metric);
        self.steps.next = 0;
        self.steps.end = self.worker.begin;
        self.worker.horizon = self.worker.begin;
        self.worker.queue.open(self.worker.begin, self.worker.space.end, &[]);
        self.worker.later.clear();
        self.steps.contacts.iter_mut().for_each(Vec::clear);
        let steps = self.steps.contacts.len().max(count);
        self.steps.contacts.resize_with(steps, Vec::new);
        let (begin, end) = (self.worker.begin, self.worker.space.end);
        self.steps.ends.clear();
        self.steps.ends.extend((0..count).map(|step| step_end(step, begin, end, count)));
        for entry in found {
            let step = self.steps.step_of(begin, entry.0.time);
            self.steps.contacts[step].push(*entry);
        }
        // Blocks of about the same number of particles.
        let rows = &self.worker.space.rows;
        let per_plane = (rows.len() - 1) / planes as usize;
        let slots = particles.len() as u64;
        let face = |part: u64, parts: u64| {
            let target = (slots * part / parts) as u32;
            let plane = (0..planes as usize).position(|plane| rows[plane * per_plane] >= target);
            plane.unwrap_or(planes as usize) as i32
        };
        let wraps = axes.wraps(axis);
        let faces = |shift: u64| -> Vec<i32> {
            (0..blocks as u64).map(|k| face(2 * k + shift, 2 * blocks as u64)).collect()
        };
        for (round, shift) in [0, 1].into_iter().enumerate() {
            let faces = faces(shift);
            self.steps.rounds[round].planes = planes_between(&faces, planes, wraps);
        }
        let whole = Planes { first: 0, end: planes, known: [f32::INFINITY; 2] };
        self.steps.rounds[2].planes = vec![whole];
        let cells = self.worker.space.cells.len();
        for round in &mut self.steps.rounds {
            // The last round has a single block, which leaves nothing over.
            if round.planes != [whole] {
                round.fields.resize(cells, cells / axes.n[0] as usize);
            }
            round.sources.resize_with(round.planes.len(), Sources::default);
        }
        let most = self.steps.rounds.iter().map(|round| round.planes.len()).max().unwrap_or(1);
        let spare = SPARE.0 + cells / SPARE.1;
        let mut first = self.worker.space.cells.reserve(most * spare);
        for _ in 0..most {
            // SAFETY: blocks are dropped before the window's arrays are changed; see the module's description
            // for which elements a block uses.
            let mut worker = unsafe { self.worker.alias() };
            worker.space.cells.limit_to(first..first + spare);
            first += spare;
            self.steps.blocks.push(Block::new(worker, world));
        }
        true
    }

    /// Ends the steps of the window: its further events are taken one after the other.
    pub(super) fn end_steps(&mut self) {
        self.steps.blocks.clear();
        self.worker.horizon = self.worker.space.end;
        self.worker.later.clear();
    }

    /// Takes the events of the next step of the window, or gives them to the queue of the window.
    #[cold]
    #[inline(never)]
    pub(super) fn take_step(
        &mut self,
        state: &mut State,
        limit: &mut Limit,
        observer: &mut dyn Observer,
        events: bool,
    ) {
        let (begin, step) = (self.worker.begin, self.steps.next);
        let (from, to) = (self.worker.horizon, self.steps.ends[step]);
        for entry in self.worker.later.drain(..) {
            let step = self.steps.step_of(begin, entry.0.time).max(step);
            self.steps.contacts[step].push(entry);
        }
        let mut contacts = std::mem::take(&mut self.steps.contacts[step]);
        self.steps.next += 1;
        self.worker.horizon = to;
        self.steps.end = from;
        self.steps.counts.steps += 1;
        if std::mem::take(&mut self.steps.is_serial) {
            let fastest = fastest(&self.worker.space.particles);
            self.steps.metric = self.steps.metric.filter(|metric| fastest <= metric.speed);
        }
        let suits = limit.ticks >= to
            && contacts.len() >= self.steps.settings.min_contacts
            && state.world.resting == 0
            && contacts.iter().all(|entry| entry.0.time > from);
        if suits && self.run_rounds(state, &contacts, limit, observer, events) {
            self.worker.queue.open(from, to, &[]);
        } else {
            self.steps.counts.undone += u64::from(suits);
            self.steps.is_serial = true;
            self.worker.queue.open(from, to, &contacts);
        }
        contacts.clear();
        self.steps.contacts[step] = contacts;
    }

    /// The rounds of a step. Returns false if the step has been undone.
    fn run_rounds(
        &mut self,
        state: &mut State,
        contacts: &[WindowEvent],
        limit: &mut Limit,
        observer: &mut dyn Observer,
        events: bool,
    ) -> bool {
        let Some(metric) = self.steps.metric else { return false };
        let per_time = state.world.clock.tick / self.worker.step;
        let (from, to) = (self.steps.end, self.worker.horizon);
        let step = Step { metric, from, to, begin: self.worker.begin, per_time };
        let start = step.fraction(from);
        let mut pending = std::mem::take(&mut self.steps.pending);
        pending.clear();
        pending.extend_from_slice(contacts);
        let mut taken = [0; ROUNDS];
        let blocks = &mut self.steps.blocks;
        for block in blocks.iter_mut() {
            // SAFETY: the aliases are used in this call only.
            unsafe {
                block.state.world.share_particles(&mut state.world);
                self.worker.space.cells.renew(&mut block.worker.space.cells);
            }
            block.state.world.now = state.world.now;
            block.state.accumulators.sampled_at = state.accumulators.sampled_at;
        }
        let mut is_failed = false;
        for round in 0..ROUNDS {
            if pending.is_empty() {
                break;
            }
            let (earlier, present) = self.steps.rounds.split_at_mut(round);
            let present = &mut present[0];
            if round == 0 {
                for planes in &mut present.planes {
                    planes.known = planes.known.map(|time| if time == f32::INFINITY { time } else { start });
                }
            }
            if round == 1 {
                let axes = &self.worker.space.cells.axes;
                set_known(&mut present.planes, &metric, &pending, |entry: &Entry| {
                    let slot = self.worker.slot_of[entry.owner as usize] as usize;
                    let time = step.fraction(entry.time);
                    (place(axes, &self.worker.space.particles[slot], time), time)
                });
            }
            // Distribute.
            let axes = &self.worker.space.cells.axes;
            for block in blocks.iter_mut() {
                block.contacts.clear();
            }
            if present.planes.len() == 1 {
                blocks[0].contacts.append(&mut pending);
            } else {
                let (slot_of, particles) = (&self.worker.slot_of, &self.worker.space.particles);
                let target = |k: usize| {
                    if let Some(later) = pending.get(k + 2 * AHEAD) {
                        prefetch_at(slot_of, later.0.owner as usize);
                    }
                    if let Some(later) = pending.get(k + AHEAD) {
                        prefetch_at(particles, slot_of[later.0.owner as usize] as usize);
                    }
                    let entry = &pending[k].0;
                    let slot = slot_of[entry.owner as usize] as usize;
                    let x = place(axes, &particles[slot], step.fraction(entry.time));
                    present.planes.iter().position(|planes| metric.contains(planes, x)).unwrap_or(0) as u32
                };
                let targets: Vec<u32> =
                    (0..pending.len()).into_par_iter().with_min_len(1024).map(target).collect();
                for (entry, target) in pending.drain(..).zip(targets) {
                    blocks[target as usize].contacts.push(entry);
                }
            }
            let earlier = &*earlier;
            let tasks: Vec<_> = blocks
                .iter_mut()
                .zip(&present.planes)
                .zip(&mut present.sources)
                // SAFETY: each block uses the cells of its own planes.
                .map(|((block, planes), sources)| (block, planes, sources, unsafe { present.fields.alias() }))
                .collect();
            let kernel = self.kernel;
            tasks.into_par_iter().with_max_len(1).for_each(|(block, planes, sources, fields)| {
                block.run(kernel, &step, planes, sources, fields, earlier, events);
            });
            for block in blocks.iter_mut().take(present.planes.len()) {
                taken[round] += (block.times.len() - block.first_time) as u64;
                block.first_time = block.times.len();
                pending.append(&mut block.left);
                is_failed |= block.is_failed || block.worker.space.cells.is_full();
            }
            if is_failed {
                break;
            }
        }
        self.steps.pending = pending;
        let total: u64 = taken.iter().sum();
        let is_failed = is_failed
            || state.accumulators.counters.collisions + total >= limit.collisions
            || !state.stall.allows(&state.world, total);
        for round in &mut self.steps.rounds {
            for sources in &mut round.sources {
                round.fields.clear(&metric, sources);
            }
        }
        if is_failed {
            self.undo_step(state);
            return false;
        }
        for (sum, count) in self.steps.counts.rounds.iter_mut().zip(taken) {
            *sum += count;
        }
        self.end_step(state, total, limit, observer);
        true
    }

    /// Adds what blocks have counted and recorded in a step.
    fn end_step(&mut self, state: &mut State, total: u64, limit: &mut Limit, observer: &mut dyn Observer) {
        let (mut times, mut events, mut exchanges) = (Vec::new(), Vec::new(), Vec::new());
        for block in &mut self.steps.blocks {
            state.accumulators.merge(&mut block.state.accumulators);
            state.world.longest_flight = state.world.longest_flight.max(block.state.world.longest_flight);
            self.worker.scratch.work.add(&block.worker.scratch.work);
            self.worker.later.append(&mut block.worker.later);
            times.append(&mut block.times);
            events.append(&mut block.rows.events);
            exchanges.append(&mut block.rows.exchanges);
            block.clear();
        }
        times.sort_unstable();
        state.stall.count_sorted(&times);
        if let Some(&last) = times.last() {
            state.world.now = state.world.now.max(last);
        }
        limit.entries = limit.entries.saturating_sub(total);
        // Stable: a pair can collide twice at one time.
        events.sort_by_key(|row| row.0);
        exchanges.sort_by_key(|row| row.0);
        // Of every event, the exchange comes first, and not every event has one.
        let mut exchanges = exchanges.into_iter().peekable();
        for (key, event) in events {
            while let Some((_, time, changes, partner)) = exchanges.next_if(|row| row.0 <= key) {
                let changes: Vec<VelocityChange> = changes.into_iter().flatten().collect();
                observer.exchange(&Exchange { time, changes: &changes, partner });
            }
            observer.event(&event);
        }
    }

    /// Restores all particles as they were before the step.
    fn undo_step(&mut self, state: &mut State) {
        for block in &mut self.steps.blocks {
            for undo in block.undo.drain(..) {
                let slot = self.worker.slot_of[undo.i as usize] as usize;
                state.world.particles[undo.i as usize] = undo.particle;
                self.worker.space.anchors[slot] = undo.particle;
                self.worker.set_path(&state.world, undo.i);
            }
            for (i, wraps) in block.wraps.drain(..) {
                for (image, turns) in state.world.images[i as usize].iter_mut().zip(wraps) {
                    *image -= turns;
                }
            }
            self.worker.scratch.work.add(&block.worker.scratch.work);
            block.clear();
        }
    }
}

/// Number of steps of a window with this number of contacts per particle.
fn steps(contacts_per_particle: f32, contacts: usize, min_contacts: usize) -> usize {
    let wanted = (contacts_per_particle * STEPS_PER_CONTACT).clamp(1.0, MAX_STEPS) as usize;
    wanted.min(contacts / min_contacts)
}

/// The longest displacement of a particle in its window [length].
fn fastest(particles: &[CompactParticle]) -> f32 {
    let square =
        |most: f32, p: &CompactParticle| most.max(p.v[0] * p.v[0] + p.v[1] * p.v[1] + p.v[2] * p.v[2]);
    let chunks = particles.par_chunks(TASK);
    chunks.map(|chunk| chunk.iter().fold(0.0, square)).reduce(|| 0.0, f32::max).sqrt()
}

/// The end of a step [ticks].
fn step_end(step: usize, begin: i64, end: i64, count: usize) -> i64 {
    if step + 1 >= count {
        return end;
    }
    begin + ((i128::from(end - begin) * (step as i128 + 1)) / count as i128) as i64
}

/// The planes between faces in ascending order.
fn planes_between(faces: &[i32], n: i32, wraps: bool) -> Vec<Planes> {
    let mut planes = Vec::new();
    let count = faces.len();
    if wraps {
        for k in 0..count {
            let end = if k + 1 < count { faces[k + 1] } else { faces[0] + n };
            planes.push(Planes { first: faces[k], end, known: [0.0; 2] });
        }
        return planes;
    }
    let mut inner: Vec<i32> = faces.iter().copied().filter(|&face| face > 0 && face < n).collect();
    inner.dedup();
    let mut first = 0;
    for (k, &face) in inner.iter().chain([&n]).enumerate() {
        let known = [if k == 0 { f32::INFINITY } else { 0.0 }, if face == n { f32::INFINITY } else { 0.0 }];
        planes.push(Planes { first, end: face, known });
        first = face;
    }
    planes
}

/// Sets the times at which events that are left over can reach the faces.
fn set_known(
    planes: &mut [Planes],
    metric: &Metric,
    pending: &[WindowEvent],
    place: impl Fn(&Entry) -> ([f32; 3], f32),
) {
    for planes in &mut *planes {
        planes.known = planes.known.map(|time| if time == f32::INFINITY { time } else { f32::MAX });
    }
    for entry in pending {
        let (x, time) = place(&entry.0);
        for planes in &mut *planes {
            for (side, face) in [planes.first, planes.end].into_iter().enumerate() {
                if planes.known[side] != f32::INFINITY {
                    planes.known[side] = planes.known[side].min(metric.arrival_at_face(face, x, time));
                }
            }
        }
    }
}

#[cfg(test)]
mod tests;
