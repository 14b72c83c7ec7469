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

use std::collections::BTreeMap;

use glam::DVec3;
use haff_neighbors::prefetch_at;
use rayon::prelude::*;

use super::{
    Windows,
    axes::Axes,
    cells::path_span,
    front::{Dilations, Fields, Metric, Planes, Sources},
    space::TASK,
    window_event::{Contact, Entry, WindowEvent},
    worker::Worker,
};
use crate::{
    accumulators::Accumulators,
    batch::Kernel,
    compact::CompactParticle,
    event_loop::Limit,
    features::Features,
    particles::{Particle, World},
    report::{EventRecord, Exchange, Observer, Partner, VelocityChange},
    resolve,
    rest::state::SettlingState,
    stall::Stall,
    state::State,
    tuning::particles::PARALLEL_EVENTS,
};

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

/// One of the rounds of a step.
#[derive(Default)]
struct Round {
    planes: Vec<Planes>,
    sources: Vec<Sources>,
    fields: Fields,
}

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

/// What a thread has for one block.
struct Block<F> {
    worker: Worker<F>,
    state: State,
    /// Contacts at the start of the round.
    contacts: Vec<WindowEvent>,
    /// Events that are left to the next round.
    left: Vec<WindowEvent>,
    undo: Vec<Undo>,
    /// Changes of the images of particles in a step.
    wraps: Vec<(u32, [i32; 3])>,
    rows: Rows,
    /// Times of the events \[ticks\], those of a round in order.
    times: Vec<i64>,
    /// Where the times of the present round begin.
    first_time: usize,
    is_failed: bool,
}

/// A particle before its first event in a step.
struct Undo {
    i: u32,
    particle: Particle,
}

/// Order of simultaneous rows.
type Key = (i64, (u32, u32, u32));

/// Rows of events of one block.
#[derive(Default)]
struct Rows {
    key: Key,
    events: Vec<(Key, EventRecord)>,
    exchanges: Vec<(Key, f64, [Option<VelocityChange>; 2], Partner)>,
}

impl Observer for Rows {
    fn event(&mut self, event: &EventRecord) {
        self.events.push((self.key, *event));
    }

    fn exchange(&mut self, exchange: &Exchange) {
        let change = |k: usize| exchange.changes.get(k).copied();
        self.exchanges.push((self.key, exchange.time, [change(0), change(1)], exchange.partner));
    }
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
            self.steps.blocks.push(Block {
                worker,
                state: State {
                    world: world.without_particles(),
                    accumulators: Accumulators::default(),
                    pending: BTreeMap::new(),
                    stall: Stall::default(),
                    settling: SettlingState::default(),
                },
                contacts: Vec::new(),
                left: Vec::new(),
                undo: Vec::new(),
                wraps: Vec::new(),
                rows: Rows::default(),
                times: Vec::new(),
                first_time: 0,
                is_failed: false,
            });
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
        let fraction = |ticks: i64| ((ticks - self.worker.begin) as f64 * per_time) as f32;
        let (from, to) = (self.steps.end, self.worker.horizon);
        let step = Step { metric, from, to, begin: self.worker.begin, per_time, start: fraction(from) };
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
            block.is_failed = false;
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
                    planes.known =
                        planes.known.map(|time| if time == f32::INFINITY { time } else { step.start });
                }
            }
            if round == 1 {
                let axes = &self.worker.space.cells.axes;
                set_known(&mut present.planes, &metric, &pending, |entry: &Entry| {
                    let slot = self.worker.slot_of[entry.owner as usize] as usize;
                    let time = fraction(entry.time);
                    (place(axes, &self.worker.space.particles[slot], time), time)
                });
            }
            // Distribute.
            let axes = &self.worker.space.cells.axes;
            for block in blocks.iter_mut() {
                block.contacts.clear();
            }
            let single = present.planes.len() == 1;
            if single {
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
            let work = std::mem::take(&mut block.worker.scratch.work);
            self.worker.scratch.work.add(&work);
            self.worker.later.append(&mut block.worker.later);
            block.undo.clear();
            block.wraps.clear();
            times.append(&mut block.times);
            block.first_time = 0;
            events.append(&mut block.rows.events);
            exchanges.append(&mut block.rows.exchanges);
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
            block.state.accumulators = Accumulators::default();
            block.state.pending.clear();
            block.state.world.resting = 0;
            block.state.world.longest_flight = 0.0;
            let work = std::mem::take(&mut block.worker.scratch.work);
            self.worker.scratch.work.add(&work);
            block.worker.later.clear();
            block.left.clear();
            block.times.clear();
            block.first_time = 0;
            block.rows.events.clear();
            block.rows.exchanges.clear();
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

impl Planes {
    /// Whether nothing is beyond these planes.
    #[inline(always)]
    fn is_whole(&self) -> bool {
        self.known == [f32::INFINITY; 2]
    }
}

/// The place of a particle in its window after a fraction of it [cells].
#[inline(always)]
fn place(axes: &Axes, particle: &CompactParticle, fraction: f32) -> [f32; 3] {
    let mut x = axes.grid_coordinates(particle.x);
    for k in 0..3 {
        x[k] += particle.v[k] * fraction * axes.cells[k];
        let n = axes.n[k] as f32;
        if axes.wraps(k) {
            if x[k] < 0.0 {
                x[k] += n;
            }
            if x[k] >= n {
                x[k] -= n;
            }
        }
    }
    [x[0], x[1], x[2]]
}

/// The present step, for all blocks.
struct Step {
    metric: Metric,
    /// After `from`, up to and including `to` [ticks].
    from: i64,
    to: i64,
    /// Start of the window [ticks], and its length as fractions per tick.
    begin: i64,
    per_time: f64,
    /// Start of the step as a fraction of the window.
    start: f32,
}

impl<F: Features> Block<F> {
    /// Takes the events of a round.
    #[expect(clippy::too_many_arguments, reason = "one call")]
    fn run(
        &mut self,
        kernel: Kernel,
        step: &Step,
        planes: &Planes,
        sources: &mut Sources,
        fields: Fields,
        earlier: &[Round],
        events: bool,
    ) {
        let mut present = Present { step, planes, sources, fields, earlier };
        match (kernel, events) {
            (Kernel::Portable, false) => self.take::<false, false>(&mut present),
            (Kernel::Portable, true) => self.take::<true, false>(&mut present),
            #[cfg(target_arch = "x86_64")]
            // SAFETY: only `Kernel::choose` makes this variant, after it has detected the features.
            (Kernel::Avx2, false) => unsafe { self.take_avx2::<false>(&mut present) },
            #[cfg(target_arch = "x86_64")]
            // SAFETY: as above.
            (Kernel::Avx2, true) => unsafe { self.take_avx2::<true>(&mut present) },
        }
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt,popcnt")]
    fn take_avx2<const EVENTS: bool>(&mut self, present: &mut Present) {
        self.take::<EVENTS, true>(present);
    }

    #[inline(always)]
    fn take<const EVENTS: bool, const VECTORS: bool>(&mut self, present: &mut Present) {
        let (from, to) = (present.step.from, present.step.to);
        self.worker.horizon = to;
        self.worker.queue.open(from, to, &self.contacts);
        while let Some(event) = self.worker.queue.pop_until(to) {
            let (metric, planes) = (&present.step.metric, present.planes);
            let contains = |axis: usize, c: i32| axis != metric.axis || metric.contains_cells(planes, c, 1);
            self.worker.prefetch(&self.state.world, contains);
            if !self.take_event::<EVENTS, VECTORS>(present, event) {
                self.is_failed = true;
                return;
            }
        }
    }

    /// Takes an event or leaves it over. Returns false if the step must be undone.
    #[inline(always)]
    fn take_event<const EVENTS: bool, const VECTORS: bool>(
        &mut self,
        present: &mut Present,
        event: WindowEvent,
    ) -> bool {
        match event.0.target.kind() {
            Contact::Collision(j) => self.take_collision::<EVENTS, VECTORS>(present, event, j),
            Contact::Wall(wall) => self.take_wall_collision::<EVENTS, VECTORS>(present, event, wall),
        }
    }

    #[inline(always)]
    fn take_collision<const EVENTS: bool, const VECTORS: bool>(
        &mut self,
        present: &mut Present,
        event: WindowEvent,
        j: u32,
    ) -> bool {
        let entry = event.0;
        let i = entry.owner;
        let (world, step) = (&self.state.world, present.step);
        let (a, b) = (&world.particles[i as usize], &world.particles[j as usize]);
        if a.count != entry.own_count || b.count != entry.partner_count {
            self.state.accumulators.counters.dropped += 1;
            return true;
        }
        let time = step.fraction(entry.time);
        let slots = [self.worker.slot_of[i as usize] as usize, self.worker.slot_of[j as usize] as usize];
        let space = &self.worker.space;
        let places = [
            place(&space.cells.axes, &space.particles[slots[0]], time),
            place(&space.cells.axes, &space.particles[slots[1]], time),
        ];
        if !self.is_known(present, [i, j], slots, &places, time) {
            return self.leave(present, event, &places, time);
        }
        let Ok(impact) = resolve::collide::<F>(world, [i, j], entry.time) else { return false };
        for (k, (body, position, velocity)) in impact.after().into_iter().enumerate() {
            // In the order of the indices.
            let k = if i < j { k } else { 1 - k };
            let place = places[k];
            match self.stays(present, body, slots[k], place, (position, velocity), entry.time) {
                Stays::Inside => {}
                Stays::Outside => return self.leave(present, event, &places, time),
                Stays::TooFast => return false,
            }
        }
        if !present.is_expected(&places, time) {
            return false;
        }
        self.save(step, i);
        self.save(step, j);
        self.state.world.now = entry.time;
        self.rows.key = (entry.time, entry.rank());
        resolve::apply::<F, EVENTS>(&mut self.state, &impact, entry.time, &mut self.rows);
        self.times.push(entry.time);
        self.wrap(i);
        self.wrap(j);
        let world = &self.state.world;
        if F::GRAVITY && (world.resting != 0 || !self.state.pending.is_empty()) {
            return false;
        }
        let movable = |body: u32| F::UNIFORM || world.class(body).inverse_mass != 0.0;
        match (movable(i), movable(j)) {
            (true, true) => self.worker.predict_again::<2, VECTORS>(world, [i.min(j), i.max(j)]),
            (true, false) => self.worker.predict_again::<1, VECTORS>(world, [i]),
            (false, _) => self.worker.predict_again::<1, VECTORS>(world, [j]),
        }
    }

    #[inline(never)]
    fn take_wall_collision<const EVENTS: bool, const VECTORS: bool>(
        &mut self,
        present: &mut Present,
        event: WindowEvent,
        wall: u32,
    ) -> bool {
        let entry = event.0;
        let i = entry.owner;
        let (world, step) = (&self.state.world, present.step);
        if world.particles[i as usize].count != entry.own_count {
            self.state.accumulators.counters.dropped += 1;
            return true;
        }
        let time = step.fraction(entry.time);
        let slot = self.worker.slot_of[i as usize] as usize;
        let space = &self.worker.space;
        let places = [place(&space.cells.axes, &space.particles[slot], time)];
        if !self.is_known(present, [i], [slot], &places, time) {
            return self.leave(present, event, &places, time);
        }
        let Ok((contact, outcome)) = resolve::collide_with_wall::<F>(world, i, wall, entry.time) else {
            return false;
        };
        let after = (contact.position, outcome.velocity());
        match self.stays(present, i, slot, places[0], after, entry.time) {
            Stays::Inside => {}
            Stays::Outside => return self.leave(present, event, &places, time),
            Stays::TooFast => return false,
        }
        if !present.is_expected(&places, time) {
            return false;
        }
        self.save(step, i);
        self.state.world.now = entry.time;
        self.rows.key = (entry.time, entry.rank());
        resolve::apply_wall::<F, EVENTS>(&mut self.state, &contact, &outcome, &mut self.rows);
        self.times.push(entry.time);
        self.wrap(i);
        let world = &self.state.world;
        if F::GRAVITY && (world.resting != 0 || !self.state.pending.is_empty()) {
            return false;
        }
        self.worker.predict_again::<1, VECTORS>(world, [i])
    }

    /// Whether nothing unknown can have changed an event, and its particles are registered in no cells but
    /// those of this block.
    #[inline(always)]
    fn is_known<const K: usize>(
        &self,
        present: &Present,
        bodies: [u32; K],
        slots: [usize; K],
        places: &[[f32; 3]; K],
        time: f32,
    ) -> bool {
        let (metric, planes) = (&present.step.metric, present.planes);
        if planes.is_whole() {
            return true;
        }
        for k in 0..K {
            let x = places[k];
            let is_known = metric.contains(planes, x)
                && metric.arrival_from_faces(planes, x, 0.0) > time
                && !present.fields.is_reached(metric, x, time);
            if !is_known || !self.is_registered_inside(present, bodies[k], slots[k], x) {
                return false;
            }
        }
        true
    }

    /// Whether a particle is registered in cells of this block only.
    #[inline(always)]
    fn is_registered_inside(&self, present: &Present, body: u32, slot: usize, x: [f32; 3]) -> bool {
        let (metric, planes) = (&present.step.metric, present.planes);
        let space = &self.worker.space;
        let extent = space.extent(space.particles[slot].radius);
        // Of a particle with an event in this window, only the last of its paths is stored. It is registered
        // along the earlier ones up to the end of the window: from an event at a place b, up to a
        // displacement of the window ahead of b, and the present place is up to another one away from b.
        let has_turned = self.state.world.particles[body as usize].time > present.step.begin;
        let displacements = if has_turned { 2.0 } else { 1.0 };
        if metric.is_deep(planes, x, displacements * metric.speed + extent) {
            return true;
        }
        if has_turned {
            return false;
        }
        let compact = &space.particles[slot];
        let (low, count) = path_span(&space.cells.axes, compact.x, compact.v, 1.0, extent);
        metric.contains_cells(planes, low[metric.axis], count[metric.axis])
    }

    /// Whether the cells along a new path, and those that a search around it reads, are in this block.
    #[inline(always)]
    fn stays(
        &self,
        present: &Present,
        body: u32,
        slot: usize,
        x: [f32; 3],
        (mut position, mut velocity): (DVec3, DVec3),
        ticks: i64,
    ) -> Stays {
        let (step, planes) = (present.step, present.planes);
        let metric = &step.metric;
        let world = &self.state.world;
        if !F::UNIFORM && world.class(body).inverse_mass == 0.0 {
            return Stays::Inside;
        }
        if F::GRAVITY {
            let elapsed = (ticks - step.begin) as f64 * world.clock.tick;
            position -= self.worker.gravity * (0.5 * elapsed * elapsed);
            velocity -= self.worker.gravity * elapsed;
        }
        let square = velocity.length_squared() * (self.worker.step * self.worker.step);
        if square > f64::from(metric.speed) * f64::from(metric.speed) {
            return Stays::TooFast;
        }
        let space = &self.worker.space;
        let reach = space.particles[slot].radius + space.common_radius;
        if planes.is_whole() || metric.is_deep(planes, x, metric.speed + reach) {
            return Stays::Inside;
        }
        let axes = &space.cells.axes;
        let (p, u) = (position.to_array(), velocity.to_array());
        let (mut start, mut v) = ([0; 3], [0.0; 3]);
        for k in 0..3 {
            start[k] = axes.coordinate(k, p[k]);
            v[k] = (u[k] * self.worker.step) as f32;
        }
        let (low, count) = path_span(axes, start, v, 1.0 - step.fraction(ticks), reach);
        if metric.contains_cells(planes, low[metric.axis], count[metric.axis]) {
            Stays::Inside
        } else {
            Stays::Outside
        }
    }

    /// Wraps the anchor of a particle into the box.
    #[inline(always)]
    fn wrap(&mut self, i: u32) {
        let wraps = self.state.world.wrap_anchor(i);
        if wraps != [0; 3] {
            self.wraps.push((i, wraps));
        }
    }

    /// Saves a particle before its first event in a step.
    #[inline(always)]
    fn save(&mut self, step: &Step, i: u32) {
        let particle = self.state.world.particles[i as usize];
        if particle.time <= step.from {
            self.undo.push(Undo { i, particle });
        }
    }

    /// Leaves an event to the next round.
    #[cold]
    #[inline(never)]
    fn leave(&mut self, present: &mut Present, event: WindowEvent, places: &[[f32; 3]], time: f32) -> bool {
        let Present { step, planes, sources, fields, .. } = present;
        let metric = &step.metric;
        self.left.push(event);
        let end = ((step.to - step.begin) as f64 * step.per_time) as f32;
        // One source for both particles of a pair: each is half a contact distance from it.
        let x = metric.middle(places);
        // A place of another block is behind the face.
        if metric.contains(planes, x) && metric.arrival_from_faces(planes, x, metric.source) > time {
            fields.add(metric, planes, sources, x, time, end);
        }
        true
    }
}

/// Where a new path leads.
enum Stays {
    Inside,
    Outside,
    /// The particle is faster than the front.
    TooFast,
}

/// What a block uses in a round besides its own data.
struct Present<'a> {
    step: &'a Step,
    planes: &'a Planes,
    sources: &'a mut Sources,
    fields: Fields,
    earlier: &'a [Round],
}

impl Present<'_> {
    /// Whether the fronts of all earlier rounds expect an event at these places.
    #[inline(always)]
    fn is_expected(&self, places: &[[f32; 3]], time: f32) -> bool {
        let step = self.step;
        self.earlier
            .iter()
            .all(|round| places.iter().all(|&x| round.expects(&step.metric, x, time, step.start)))
    }
}

impl Step {
    /// A time as a fraction of the window.
    #[inline(always)]
    fn fraction(&self, ticks: i64) -> f32 {
        ((ticks - self.begin) as f64 * self.per_time) as f32
    }
}

impl Round {
    /// Whether an event of a later round can be at this place and time.
    fn expects(&self, metric: &Metric, x: [f32; 3], time: f32, begin: f32) -> bool {
        let block = self.planes.iter().position(|planes| metric.contains(planes, x));
        block.is_some_and(|k| self.fields.expects(metric, &self.planes[k], &self.sources[k], x, time, begin))
    }
}

#[cfg(test)]
mod tests;
