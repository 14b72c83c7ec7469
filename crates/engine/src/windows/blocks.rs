//! Events on several threads: the grid is cut into blocks, and the window into steps of time.
//!
//! In a step, each block takes the events that nothing unknown can have changed ([`super::front`]) from its
//! own queue, in the order of time, and leaves the others over. In a second round, blocks that reach from the
//! middle of one to the middle of the next do the same with these, and so on ([`cut`]); in the last round, a
//! single block takes the rest. A block changes only particles that are registered in none but its own cells,
//! and reads only these cells: what one thread writes no other one reads.
//!
//! A prediction depends only on the anchors of two particles, and an impact only on those of its partners.
//! Therefore every order of events that respects causes gives the same bits. If an event of a later round is
//! where the front of an earlier one has not expected it, or a limit is exceeded, the step is undone, and its
//! events are taken one after the other.

mod awake;
mod block;
mod cut;
mod ownership;
mod rows;

use haff_neighbors::prefetch_at;
use rayon::prelude::*;

use super::{
    Windows,
    front::{Dilations, Metric},
    space::TASK,
    window_event::WindowEvent,
    worker::Worker,
};
use crate::{
    compact::CompactParticle,
    event_loop::Limit,
    features::Features,
    particles::World,
    report::{BlockCounts, Observer},
    state::State,
    tuning::particles::PARALLEL_EVENTS,
};
use block::{Block, Step, place};
use cut::Round;
use ownership::Ownership;

/// The largest speed of fronts, relative to that of the fastest particle when the window is opened.
const SPEED: f32 = 1.25;
/// Number of steps of a window, for one contact per particle: so many that few particles have two collisions
/// in a step, and a source is seldom reached by the cone of another one.
const STEPS_PER_CONTACT: f32 = 130.0;
const MAX_STEPS: f32 = 64.0;
/// Factors of the distances of fronts: if a step is undone because of an event that a front has not expected,
/// it is tried again with the next one.
const DILATIONS: [f32; 2] = [1.0, 1.6];
/// Most events of a block in a step: this number, and so many for each contact known at its start.
const MOST: (usize, usize) = (1000, 20);
/// Blocks of entries for full cells, for each block: this number, and one for so many cells.
const SPARE: (usize, usize) = (1024, 64);

/// What decides whether and how events are taken by blocks.
#[derive(Debug, Clone, Copy)]
struct Settings {
    /// Smallest number of particles, and of contacts of a step for each block.
    min_particles: usize,
    min_contacts: usize,
    /// Number of blocks; `None`: that of threads.
    blocks: Option<usize>,
    /// Smallest thickness of a block [largest contact distances], and [longest displacements].
    thickness: [f32; 2],
    /// Distances of fronts.
    dilations: Dilations,
}

impl Settings {
    const MEASURED: Self = Self {
        min_particles: PARALLEL_EVENTS,
        min_contacts: 150,
        blocks: None,
        thickness: [20.0, 2.0],
        dilations: Dilations { face: 4.1, source: 2.6, inner: 1.1 },
    };

    /// Those for a number of blocks, if it is given.
    fn new(blocks: Option<u16>) -> Self {
        // As many as are wanted, in systems of any size.
        let Some(blocks) = blocks else { return Self::MEASURED };
        Self {
            min_particles: 0,
            min_contacts: 1,
            thickness: [1.0, 0.0],
            blocks: Some(blocks.into()),
            ..Self::MEASURED
        }
    }
}

/// The settings for a number of blocks, or those of a test, if it has set any.
fn settings(blocks: Option<u16>) -> Settings {
    #[cfg(test)]
    if let Some(settings) = tests::SETTINGS.get() {
        return settings;
    }
    Settings::new(blocks)
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
    /// Number of steps that blocks have begun in the window.
    attempts: usize,
    /// End of the last step [ticks].
    end: i64,
    /// Whether particles have been changed since then by something other than a block.
    is_serial: bool,
    /// Whether the last step was undone because of an event that a front had not expected.
    is_unexpected: bool,
    /// Whether all changes of the window have been made by blocks.
    has_noted: bool,
    metric: Option<Metric>,
    rounds: Vec<Round>,
    blocks: Vec<Block<F>>,
    settings: Settings,
}

impl<F> Steps<F> {
    /// No steps yet, for this number of blocks, if it is given.
    pub fn new(blocks: Option<u16>) -> Self {
        Self {
            contacts: Vec::new(),
            pending: Vec::new(),
            ends: Vec::new(),
            next: 0,
            attempts: 0,
            end: 0,
            is_serial: false,
            is_unexpected: false,
            has_noted: false,
            metric: None,
            rounds: Vec::new(),
            blocks: Vec::new(),
            settings: settings(blocks),
        }
    }

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

    /// Drops the aliases of the window's arrays.
    pub fn drop_blocks(&mut self) {
        self.blocks.clear();
    }
}

impl<F: Features> Windows<F> {
    /// Why events are taken on one thread, if they are.
    pub(super) fn serial_reason(&self, world: &World) -> Option<&'static str> {
        if self.steps.settings.blocks.unwrap_or_else(rayon::current_num_threads) < 2 {
            Some("there is one thread or block")
        } else if world.particles.len() < self.steps.settings.min_particles {
            Some("there are too few particles")
        } else if world.wall_sums.is_some() {
            Some("forces on walls are measured")
        } else if world.resting != 0 || world.carries {
            Some("grains rest on walls, or walls carry them")
        } else {
            None
        }
    }

    /// Prepares the steps of a window that has just been opened with these contacts. Returns false if its
    /// events are taken one after the other.
    pub(super) fn prepare_steps(&mut self, world: &World, found: &[WindowEvent]) -> bool {
        self.steps.blocks.clear();
        if self.serial_reason(world).is_some() {
            return false;
        }
        let settings = self.steps.settings;
        let axes = self.worker.space.cells.axes;
        let sigma = 2.0
            * self.geometry.radius as f32
            * (self.worker.space.common_radius / self.smallest_radius as f32);
        let particles = &self.worker.space.particles;
        let speed = (SPEED * fastest(particles)).max(1e-30);
        let metric = Metric::new(&axes, speed, sigma, settings.dilations);
        let most = settings.blocks.unwrap_or_else(rayon::current_num_threads);
        let lengths = [0, 1, 2].map(|k| axes.n[k] as f32 / axes.cells[k].max(f32::MIN_POSITIVE));
        let lengths = [0, 1, 2].map(|k| if axes.n[k] > 1 { lengths[k] } else { 0.0 });
        let blocks =
            cut::divide(lengths, most, settings.thickness[0] * sigma + settings.thickness[1] * speed);
        let blocks_in_all: usize = blocks.iter().product();
        let density = found.len() as f32 / particles.len().max(1) as f32;
        // In a step no particle moves by more than a contact distance, so that a block does not read what is
        // deep in another one.
        let least = (speed / sigma).ceil();
        let wanted = (density * STEPS_PER_CONTACT).max(least).clamp(1.0, MAX_STEPS) as usize;
        let count = wanted.min(found.len() / (settings.min_contacts * blocks_in_all));
        if blocks_in_all < 2
            || (count as f32) < least
            || !metric.reaches(DILATIONS[1] * metric.source + sigma)
        {
            return false;
        }
        self.steps.metric = Some(metric);
        (self.steps.is_serial, self.steps.has_noted) = (false, true);
        (self.steps.next, self.steps.attempts) = (0, 0);
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
        self.cut(metric, blocks);
        let most = self.steps.rounds.iter().map(|round| round.fronts.len()).max().unwrap_or(1);
        let spare = SPARE.0 + self.worker.space.cells.len() / SPARE.1;
        let mut first = self.worker.space.cells.reserve(most * spare);
        let ownership = Ownership::new(world.particles.len());
        for _ in 0..most {
            // SAFETY: blocks are dropped before the window's arrays are changed; see the module's description
            // for which elements a block uses.
            let mut worker = unsafe { self.worker.alias() };
            worker.space.cells.limit_to(first..first + spare);
            first += spare;
            self.steps.blocks.push(Block::new(worker, world, ownership.clone()));
        }
        true
    }

    /// Cuts the grid into this number of blocks along each axis, with about the same number of particles in
    /// each part of an axis.
    fn cut(&mut self, metric: Metric, blocks: [usize; 3]) {
        let space = &self.worker.space;
        let axes = space.cells.axes;
        let slots = space.particles.len() as u64;
        let planes = [0, 1, 2].map(|k| if blocks[k] > 1 { space.slots_up_to(k) } else { Vec::new() });
        let faces = |k: usize, is_shifted: bool| -> Vec<i32> {
            let (count, shift) = (blocks[k] as u64, u64::from(is_shifted));
            let face = |part: u64| {
                let target = slots * (2 * part + shift) / (2 * count);
                planes[k].iter().position(|&sum| sum >= target).unwrap_or(0) as i32
            };
            if count > 1 { (0..count).map(face).collect() } else { Vec::new() }
        };
        let shifts = cut::shifts(blocks);
        self.steps.rounds.resize_with(shifts.len() + 1, Round::default);
        let all = shifts.iter().map(|shift| [0, 1, 2].map(|k| faces(k, shift[k])));
        for (round, faces) in self.steps.rounds.iter_mut().zip(all.chain([Default::default()])) {
            *round = Round::new(metric, &axes, &faces, round);
        }
    }

    /// Tests whether particles that have been changed by something other than an event are slower than the
    /// fronts. Otherwise the further events of the window are taken one after the other.
    pub(super) fn test_speeds(&mut self, bodies: &[u32]) {
        self.steps.has_noted = false;
        let Some(metric) = &self.steps.metric else { return };
        let Worker { slot_of, space, .. } = &self.worker;
        let limit = metric.speed * metric.speed;
        let is_slow = |&body: &u32| space.particles[slot_of[body as usize] as usize].is_within(limit);
        if !bodies.iter().all(is_slow) {
            self.steps.metric = None;
        }
    }

    /// Ends the steps of the window: its further events are taken one after the other.
    pub(super) fn end_steps(&mut self) {
        self.steps.blocks.clear();
        self.worker.horizon = self.worker.space.end;
        self.worker.later.clear();
    }

    /// Takes the events of the next steps of the window, or gives those of one step to the queue of the
    /// window.
    #[cold]
    #[inline(never)]
    pub(super) fn take_steps(
        &mut self,
        state: &mut State,
        limit: &mut Limit,
        observer: &mut dyn Observer,
        events: bool,
    ) {
        awake::with_awake_threads(|| {
            while self.take_step(state, limit, observer, events)
                && self.worker.horizon < limit.ticks.min(self.worker.space.end)
                && state.accumulators.counters.collisions < limit.collisions
                && limit.entries > 0
            {}
        });
    }

    /// Takes the events of the next step of the window. If they have to be taken one after the other, gives
    /// them to the queue of the window, and returns false.
    fn take_step(
        &mut self,
        state: &mut State,
        limit: &mut Limit,
        observer: &mut dyn Observer,
        events: bool,
    ) -> bool {
        let (begin, step) = (self.worker.begin, self.steps.next);
        for entry in self.worker.later.drain(..) {
            let step = self.steps.step_of(begin, entry.0.time).max(step);
            self.steps.contacts[step].push(entry);
        }
        let mut contacts = std::mem::take(&mut self.steps.contacts[step]);
        let (from, mut to) = (self.worker.horizon, self.steps.ends[step]);
        let mut until = limit.ticks;
        // Near a limit of collisions, less than what is expected up to it.
        let remaining = limit.collisions.saturating_sub(state.accumulators.counters.collisions);
        let part = usize::try_from(remaining / 4 * 3).unwrap_or(usize::MAX);
        if part < contacts.len() {
            until = until.min(contacts.select_nth_unstable_by_key(part, |entry| entry.0.time).1.0.time);
        }
        if until < to {
            // A part of the step.
            to = until;
            let rest = contacts.extract_if(.., |entry| entry.0.time > to);
            self.steps.contacts[step].extend(rest);
        } else {
            self.steps.next += 1;
        }
        self.worker.horizon = to;
        self.steps.end = from;
        if std::mem::take(&mut self.steps.is_serial) {
            let fastest = fastest(&self.worker.space.particles);
            self.steps.metric = self.steps.metric.filter(|metric| fastest <= metric.speed);
        }
        // A part of a step is short, but after events that are taken one after the other, blocks leave more
        // over.
        let suits = contacts.len()
            >= self.steps.settings.min_contacts / 8 * self.steps.rounds[0].fronts.len()
            && state.world.resting == 0
            && contacts.iter().all(|entry| entry.0.time > from);
        let mut is_taken = false;
        for factor in DILATIONS {
            let Some(metric) = self.steps.metric.filter(|_| suits) else { break };
            let metric = metric.widened(factor);
            is_taken = self.run_rounds(state, metric, &contacts, limit, observer, events);
            if is_taken || !std::mem::take(&mut self.steps.is_unexpected) {
                break;
            }
        }
        if is_taken {
            self.worker.queue.open(from, to, &[]);
        } else {
            (self.steps.is_serial, self.steps.has_noted) = (true, false);
            self.worker.queue.open(from, to, &contacts);
        }
        if step < self.steps.next {
            contacts.clear();
            self.steps.contacts[step] = contacts;
        }
        is_taken
    }

    /// The rounds of a step. Returns false if the step has been undone.
    fn run_rounds(
        &mut self,
        state: &mut State,
        metric: Metric,
        contacts: &[WindowEvent],
        limit: &mut Limit,
        observer: &mut dyn Observer,
        events: bool,
    ) -> bool {
        let per_time = state.world.clock.tick / self.worker.step;
        let (from, to) = (self.steps.end, self.worker.horizon);
        let step = Step {
            metric,
            from,
            to,
            begin: self.worker.begin,
            per_time,
            most: MOST.0 + MOST.1 * contacts.len(),
            has_noted: self.steps.has_noted,
        };
        let mut pending = std::mem::take(&mut self.steps.pending);
        pending.clear();
        pending.extend_from_slice(contacts);
        for block in &mut self.steps.blocks {
            // SAFETY: the aliases are used in this call only.
            unsafe {
                block.state.world.share_particles(&mut state.world);
                self.worker.space.cells.renew(&mut block.worker.space.cells);
            }
            block.state.world.now = state.world.now;
            block.state.accumulators.sampled_at = state.accumulators.sampled_at;
        }
        let blocks = self.steps.rounds[0].fronts.len() as u64;
        let mut counts = BlockCounts { blocks, steps: 1, ..BlockCounts::default() };
        let mut is_failed = false;
        let rounds = self.steps.rounds.len();
        self.steps.attempts += 1;
        for round in 0..rounds {
            if pending.is_empty() {
                break;
            }
            self.distribute(round, &mut pending, &step);
            let (earlier, present) = self.steps.rounds.split_at_mut(round);
            let fronts = &mut present[0].fronts;
            let blocks = &mut self.steps.blocks[..fronts.len()];
            for (k, (block, front)) in blocks.iter_mut().zip(&mut *fronts).enumerate() {
                block.ownership.begin(self.steps.attempts * rounds + round, k);
                block.worker.space.cells.own(front.bounds);
                front.begin(metric, step.fraction(from), step.fraction(to));
                block.rows.begin_round();
                std::mem::swap(&mut block.front, front);
            }
            let kernel = self.kernel;
            let run = |block: &mut Block<F>| block.run(kernel, &step, earlier, events);
            blocks.par_iter_mut().with_max_len(1).for_each(run);
            let mut longest = 0;
            for (block, front) in blocks.iter_mut().zip(fronts) {
                std::mem::swap(&mut block.front, front);
                let taken = (block.times.len() - block.first_time) as u64;
                longest = longest.max(taken);
                *(match round {
                    0 => &mut counts.first,
                    _ if round + 1 < rounds => &mut counts.further,
                    _ => &mut counts.last,
                }) += taken;
                block.first_time = block.times.len();
                pending.append(&mut block.left);
                self.steps.is_unexpected |= block.is_unexpected;
                is_failed |= block.is_failed || block.worker.space.cells.is_full();
            }
            counts.critical_path += longest;
            if is_failed {
                break;
            }
        }
        self.steps.pending = pending;
        let total = counts.events();
        if is_failed
            || state.accumulators.counters.collisions + total >= limit.collisions
            || !state.stall.allows(&state.world, total)
        {
            let critical_path = counts.critical_path;
            state.blocks.add(&BlockCounts { steps: 1, undone: 1, critical_path, ..BlockCounts::default() });
            self.undo_step(state);
            return false;
        }
        state.blocks.add(&counts);
        self.end_step(state, total, limit, observer);
        true
    }

    /// Distributes the contacts of a round to its blocks.
    fn distribute(&mut self, round: usize, pending: &mut Vec<WindowEvent>, step: &Step) {
        let (round, blocks) = (&self.steps.rounds[round], &mut self.steps.blocks);
        for block in blocks.iter_mut() {
            block.contacts.clear();
        }
        if round.fronts.len() == 1 {
            blocks[0].contacts.append(pending);
            return;
        }
        let axes = &self.worker.space.cells.axes;
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
            round.block_at(place(axes, &particles[slot], step.fraction(entry.time))) as u32
        };
        let targets: Vec<u32> = (0..pending.len()).into_par_iter().with_min_len(512).map(target).collect();
        for (entry, target) in pending.drain(..).zip(targets) {
            blocks[target as usize].contacts.push(entry);
        }
    }

    /// Adds what blocks have counted and recorded in a step.
    fn end_step(&mut self, state: &mut State, total: u64, limit: &mut Limit, observer: &mut dyn Observer) {
        let mut times = Vec::new();
        for block in &mut self.steps.blocks {
            state.accumulators.merge(&mut block.state.accumulators);
            state.world.longest_flight = state.world.longest_flight.max(block.state.world.longest_flight);
            self.worker.scratch.work.add(&block.worker.scratch.work);
            self.worker.later.append(&mut block.worker.later);
            times.append(&mut block.times);
        }
        times.sort_unstable();
        state.stall.count_sorted(&times);
        if let Some(&last) = times.last() {
            state.world.now = state.world.now.max(last);
        }
        limit.entries = limit.entries.saturating_sub(total);
        rows::deliver(self.steps.blocks.iter().map(|block| &block.rows), observer);
        self.steps.blocks.iter_mut().for_each(Block::clear);
    }

    /// Restores all particles as they were before the step.
    fn undo_step(&mut self, state: &mut State) {
        for block in &mut self.steps.blocks {
            for undo in block.undo.drain(..) {
                let slot = self.worker.slot_of[undo.i as usize] as usize;
                state.world.particles[undo.i as usize] = undo.particle;
                self.worker.space.anchors[slot] = undo.particle;
                self.worker.space.particles[slot].note_path();
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

#[cfg(test)]
mod tests;
