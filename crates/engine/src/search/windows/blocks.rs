//! Events of a window by [`crate::search::blocks`].
//!
//! A block takes an event only if its particles are registered in none but its own cells, and if the searches
//! after it read only these: what one thread writes no other one reads.

use haff_neighbors::prefetch_at;
use rayon::prelude::*;

use crate::{
    model::features::Features,
    report::Observer,
    search::{
        blocks::{self, DILATIONS, Metric, NextStep, Outcome, Ownership, Round, Step, Stepping, part_before},
        compact::CompactParticle,
        event_loop::Limit,
        sharing::least_items,
    },
    state::{State, world::World},
};

use super::{
    Windows,
    block::{WindowBlock, place},
    space::TASK,
    window_event::WindowEvent,
    worker::Worker,
};

/// The largest speed of fronts, relative to that of the fastest particle when the window is opened.
const SPEED: f32 = 1.25;
/// Number of steps of a window, for one contact per particle: so many that few particles have two collisions
/// in a step, and a source is seldom reached by the cone of another one.
const STEPS_PER_CONTACT: f32 = 130.0;
const MAX_STEPS: f32 = 64.0;
/// Blocks of entries for full cells, for each block: this number, and one for so many cells.
const SPARE: (usize, usize) = (1024, 64);

/// Where the blocks of contacts are found, the particle of the contact that comes this many later is
/// prefetched.
const AHEAD: usize = 12;

impl<F: Features> Windows<F> {
    /// Why events are taken on one thread, if they are.
    pub(super) fn serial_reason(&self, world: &World) -> Option<&'static str> {
        blocks::can_share(world).err().or_else(|| self.steps.settings.serial_reason(world))
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
            * (self.worker.space.common_radius / self.smallest_radius as f32)
            * axes.tilt.strain();
        let particles = &self.worker.space.particles;
        let speed = (SPEED * axes.tilt.speed() * fastest(particles)).max(1e-30);
        let grid = axes.grid();
        let metric = Metric::new(&grid, speed, sigma, settings.dilations);
        let thickness = settings.thickness[0] * sigma + settings.thickness[1] * speed;
        let blocks = blocks::divide(grid.lengths(), settings.most(), thickness);
        let blocks_in_all: usize = blocks.iter().product();
        let density = found.len() as f32 / particles.len().max(1) as f32;
        // In a step no particle moves by more than a contact distance, so that a block does not read what is
        // deep in another one.
        let least = (speed / sigma).ceil();
        let wanted = (density * STEPS_PER_CONTACT).max(least).clamp(1.0, MAX_STEPS) as usize;
        let count = wanted.min(found.len() / (settings.min_events * blocks_in_all));
        if blocks_in_all < 2
            || (count as f32) < least
            || !metric.reaches(DILATIONS[1] * metric.source + sigma)
        {
            return false;
        }
        self.steps.metric = Some(metric);
        // A drive can press particles together: such contacts are at the begin itself, before all steps.
        let is_at_begin = |entry: &&WindowEvent| entry.0.time <= self.worker.begin;
        let at_begin: Vec<WindowEvent> = found.iter().filter(is_at_begin).copied().collect();
        (self.steps.is_serial, self.steps.has_noted) = (!at_begin.is_empty(), at_begin.is_empty());
        (self.steps.next, self.steps.attempts) = (0, 0);
        self.steps.end = self.worker.begin;
        self.worker.horizon = self.worker.begin;
        self.worker.queue.open(self.worker.begin, self.worker.space.end, &at_begin);
        self.worker.later.clear();
        self.steps.contacts.iter_mut().for_each(Vec::clear);
        let steps = self.steps.contacts.len().max(count);
        self.steps.contacts.resize_with(steps, Vec::new);
        let (begin, end) = (self.worker.begin, self.worker.space.end);
        self.steps.ends.clear();
        self.steps.ends.extend((0..count).map(|step| step_end(step, begin, end, count)));
        for entry in found.iter().filter(|entry| entry.0.time > begin) {
            let step = self.steps.step_of(begin, entry.0.time);
            self.steps.contacts[step].push(*entry);
        }
        let space = &self.worker.space;
        blocks::cut(metric, &grid, blocks, |k| space.slots_up_to(k), &mut self.steps.rounds);
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
            self.steps.blocks.push(WindowBlock::new(worker, world, ownership.clone()));
        }
        true
    }

    /// Tests whether particles that have been changed by something other than an event are slower than the
    /// fronts. Otherwise the further events of the window are taken one after the other.
    pub(super) fn test_speeds(&mut self, bodies: &[u32]) {
        self.steps.has_noted = false;
        // Contacts up to the present are taken from the queue, before the next step.
        self.steps.is_serial |= !self.worker.queue.is_empty();
        let Some(metric) = &self.steps.metric else { return };
        let Worker { slot_of, space, .. } = &self.worker;
        let limit = metric.speed / space.cells.axes.tilt.speed();
        let limit = limit * limit;
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
}

impl<F: Features> Stepping for Windows<F> {
    /// The contacts of the step are taken out of those of the window.
    fn begin_step(&mut self, state: &mut State, limit: &Limit) -> Option<NextStep> {
        let (begin, step) = (self.worker.begin, self.steps.next);
        for entry in self.worker.later.drain(..) {
            let step = self.steps.step_of(begin, entry.0.time).max(step);
            self.steps.contacts[step].push(entry);
        }
        let mut contacts = std::mem::take(&mut self.steps.contacts[step]);
        let (from, mut to) = (self.worker.horizon, self.steps.ends[step]);
        let mut until = limit.ticks;
        let part = part_before(limit, state);
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
            let fastest = fastest * self.worker.space.cells.axes.tilt.speed();
            self.steps.metric = self.steps.metric.filter(|metric| fastest <= metric.speed);
        }
        // A part of a step is short, but after events that are taken one after the other, blocks leave more
        // over.
        let suits = contacts.len() >= self.steps.settings.min_events / 8 * self.steps.rounds[0].fronts.len()
            && state.world.supported.resting == 0
            && contacts.iter().all(|entry| entry.0.time > from);
        self.steps.known = contacts;
        self.steps.known_of = step;
        Some(NextStep { metric: self.steps.metric.filter(|_| suits), is_empty: false })
    }

    fn run_step(
        &mut self,
        state: &mut State,
        metric: Metric,
        limit: &mut Limit,
        observer: &mut dyn Observer,
        events: bool,
    ) -> Outcome {
        let Self { kernel, worker, steps, .. } = self;
        let span = (worker.begin, state.world.clock.tick / worker.step);
        let step = Step::new(metric, (steps.end, worker.horizon), span, steps.known.len());
        steps.working_space.pending.clear();
        steps.working_space.pending.extend_from_slice(&steps.known);
        for block in &mut steps.blocks {
            // SAFETY: the aliases are used in this call only.
            unsafe {
                block.part.begin_step(state);
                worker.space.cells.renew(&mut block.worker.space.cells);
            }
            block.has_noted = steps.has_noted;
        }
        steps.attempts += 1;
        let found = blocks::run_rounds(
            &mut steps.rounds,
            &mut steps.blocks,
            &mut steps.working_space,
            (&step, steps.attempts),
            (*kernel, events),
            |round, events, targets| route(worker, &step, round, events, targets),
            |_| {},
        );
        let outcome =
            blocks::conclude(&mut steps.blocks, &mut steps.working_space, state, found, limit, observer);
        for block in &mut steps.blocks {
            worker.scratch.work.add(&block.worker.scratch.work);
            if outcome == Outcome::Taken {
                worker.later.append(&mut block.worker.later);
            } else {
                block.part.undo(state, |world, i| {
                    let slot = worker.slot_of[i as usize] as usize;
                    worker.space.anchors[slot] = world.particles[i as usize];
                    worker.space.particles[slot].note_path();
                    worker.set_path(world, i);
                });
            }
            block.clear();
        }
        outcome
    }

    fn end_step(&mut self, is_taken: bool) {
        let Self { worker, steps, .. } = self;
        if is_taken {
            worker.queue.open(steps.end, worker.horizon, &[]);
        } else {
            (steps.is_serial, steps.has_noted) = (true, false);
            worker.queue.open(steps.end, worker.horizon, &steps.known);
        }
        steps.known.clear();
        if steps.known_of < steps.next {
            // Its memory serves another window.
            steps.contacts[steps.known_of] = std::mem::take(&mut steps.known);
        }
    }

    fn goes_on(&self, ticks: i64) -> bool {
        self.worker.horizon < ticks.min(self.worker.space.end)
    }
}

/// Finds the block of a round in which each of these events is.
fn route<F: Features>(
    worker: &Worker<F>,
    step: &Step,
    round: &Round,
    events: &[WindowEvent],
    targets: &mut [u32],
) {
    let axes = &worker.space.cells.axes;
    let (slot_of, particles) = (&worker.slot_of, &worker.space.particles);
    for (k, target) in targets.iter_mut().enumerate() {
        if let Some(later) = events.get(k + 2 * AHEAD) {
            prefetch_at(slot_of, later.0.owner as usize);
        }
        if let Some(later) = events.get(k + AHEAD) {
            prefetch_at(particles, slot_of[later.0.owner as usize] as usize);
        }
        let entry = &events[k].0;
        let slot = slot_of[entry.owner as usize] as usize;
        *target = round.block_at(place::<F>(axes, &particles[slot], step.fraction(entry.time))) as u32;
    }
}

/// The longest displacement of a particle in its window [length].
fn fastest(particles: &[CompactParticle]) -> f32 {
    let square =
        |most: f32, p: &CompactParticle| most.max(p.v[0] * p.v[0] + p.v[1] * p.v[1] + p.v[2] * p.v[2]);
    let chunks = particles.par_chunks(TASK).with_min_len(least_items());
    chunks.map(|chunk| chunk.iter().fold(0.0, square)).reduce(|| 0.0, f32::max).sqrt()
}

/// The end of a step [ticks].
fn step_end(step: usize, begin: i64, end: i64, count: usize) -> i64 {
    if step + 1 >= count {
        return end;
    }
    begin + ((i128::from(end - begin) * (step as i128 + 1)) / count as i128) as i64
}
