/*!
Events of lists by [`crate::search::blocks`].

Entries of the calendars up to the end of a step are given to the block in which their particle then is.
Entries after that end go to one calendar for each block, so that threads fill and empty them at the same
time.

An update of a list reads and changes bins, lists and reference positions near its particle
([`Lists::reach`]), a prediction reads the particles of a list. Fronts are farther than that from the faces of
a block, so that what one thread writes no other one reads. The axes of blocks are all periodic, because bins
beyond a wall are those at the opposite one. Blocks use memory that the scheduler lends to them for
longer lists and fuller bins; updates that need more are left to the last round.

After a step that must be undone, particles, reference positions and calendars are those of its start. Lists
are then the same sets, because they follow from the reference positions alone.

[`Lists::reach`]: super::neighbor_lists::Lists::reach
*/

use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};

use haff_calendar::{Calendar, Ladder};
use haff_neighbors::{Array, prefetch_at};

use crate::{
    model::features::Features,
    report::Observer,
    search::{
        blocks::{
            self, DILATIONS, Dilations, Metric, NO_BLOCK, NextStep, Outcome, Ownership, Round, Step,
            Stepping, part_before,
        },
        compact::CompactParticle,
        entry::Target,
        event_loop::{Limit, Scheduler},
        parallel,
        search_event::SearchEvent,
        sharing::join,
    },
    state::{State, world::World},
};

use super::{
    Entry, ListSearch,
    block::{ListBlock, Places},
    predictor::ListPredictor,
    scheduler::ListedEvent,
    step_data::Steps,
};

/// Number of entries of a step for each particle; each collision has several. So few that few particles have
/// two events in a step, and a source is seldom reached by the cone of another one.
const ENTRIES_PER_PARTICLE: f64 = 1.0 / 60.0;
/// Largest displacement of a particle in a step [largest contact distances].
const LONGEST: f32 = 0.1;
/// Steps are so short that fronts need less distance from faces than in windows: this part of it
/// (threads.md).
const FACE: f32 = 0.73;
/// Smallest number of entries of a step.
const LEAST_ENTRIES: f64 = 64.0;
/// The length of steps changes by at most this factor from one to the next.
const CHANGE: f64 = 2.0;
/// Least number of steps of a span.
const STEPS_PER_SPAN: f64 = 8.0;
/// A step of which less than one part of this number is before a limit is taken in order.
const SHORT: i64 = 8;
/// Where the blocks of entries are found, the particle of the entry that comes this many later is
/// prefetched.
const AHEAD: usize = 12;

/// Whether blocks share the events of lists.
///
/// # Errors
/// Why one thread takes all events.
pub(crate) fn can_share(world: &World) -> Result<(), &'static str> {
    blocks::can_share(world)?;
    if world.classes.iter().any(|class| class.inverse_mass == 0.0) {
        return Err("there are bodies of infinite mass");
    }
    Ok(())
}

impl<F: Features, E: ListedEvent> ListSearch<F, E> {
    /// Why events are taken on one thread, if they are.
    pub(super) fn serial_reason(&self, world: &World) -> Option<&'static str> {
        self.unsuitable(world).or(self.steps.reason)
    }

    /// Why blocks cannot take events.
    fn unsuitable(&self, world: &World) -> Option<&'static str> {
        let is_empty = || self.predictor.lists.grid().is_none().then_some("most of the box is empty");
        can_share(world).err().or_else(|| self.steps.settings.serial_reason(world)).or_else(is_empty)
    }

    /// Begins steps at the present time, without entries, if events can be taken by blocks. Returns false if
    /// all events are taken from the queue.
    pub(super) fn begin_steps(&mut self, state: &State) -> bool {
        self.horizon = i64::MAX;
        let is_possible = self.unsuitable(&state.world).is_none() && self.cut(&state.world);
        if is_possible {
            self.horizon = state.world.now;
            let per_tick = self.predictor.plan.frame.per_tick;
            // Short, because the number of entries is not known: the next ones become longer.
            self.steps.ticks = 1e-4 / (f64::from(self.steps.metric.speed) * per_tick);
        }
        is_possible
    }

    /// Cuts space into blocks for the present span. Returns false if there would be less than two.
    fn cut(&mut self, world: &World) -> bool {
        let Self { predictor, steps, queue, .. } = self;
        let frame = &predictor.plan.frame;
        steps.span = Some(frame.begin);
        let Some(mut grid) = predictor.lists.grid() else { return false };
        let motion = frame.motion;
        // Lengths at the beginning of the span instead of those of the lists.
        (0..3).for_each(|k| grid.cells[k] *= motion.to_lists[k]);
        let settings = steps.settings;
        // Under gravity the frame of the filter moves past the lists, by no more in a step than a particle
        // does.
        let slip = if F::GRAVITY { LONGEST } else { 0.0 };
        let reach = predictor.lists.reach() * motion.strain_of_lists;
        let face = (FACE * settings.dilations.face).max(LONGEST + 0.1 + slip + reach);
        let speed = (frame.limit2.sqrt() * motion.speed).max(1e-30);
        let metric = Metric::new(&grid, speed, motion.strain, Dilations { face, ..settings.dilations });
        let thickness = settings.thickness[0] * motion.strain;
        let numbers = blocks::divide(grid.lengths(), settings.most(), thickness);
        let count: usize = numbers.iter().product();
        // A front moves by at most a contact distance in a step.
        if count < 2 || !metric.reaches(DILATIONS[1] * metric.source + motion.strain) {
            steps.reason = Some("blocks would be too thin");
            return false;
        }
        steps.reason = None;
        steps.places = Places::new(grid, motion);
        let particles = predictor.particles.part(0..world.particles.len());
        let up_to = |k: usize| {
            let mut sums = vec![0; grid.n[k] as usize + 1];
            for particle in particles {
                sums[steps.places.cell(k, particle.x[k]) + 1] += 1;
            }
            (1..sums.len()).for_each(|c| sums[c] += sums[c - 1]);
            sums
        };
        blocks::cut(metric, &grid, numbers, up_to, &mut steps.rounds);
        steps.metric = metric;
        let most = steps.rounds.iter().map(|round| round.fronts.len()).max().unwrap_or(1);
        if steps.calendars.len() != most {
            // The number of threads has changed.
            steps.move_to(queue);
            steps.calendars.resize_with(most, || Ladder::with_capacity(world.particles.len() / most));
            steps.incoming.resize_with(most, Vec::new);
            steps.collected.resize_with(most, Vec::new);
        }
        steps.attempts = 0;
        steps.blocks.clear();
        let [ownership, lists] = [0, 1].map(|_| Ownership::new(world.particles.len()));
        for _ in 0..most {
            // SAFETY: blocks use their aliases in steps only, which renew them; see the module's description
            // for which elements a block uses.
            let mut alias = unsafe { predictor.alias() };
            predictor.lists.take_back(&mut alias.lists);
            steps.blocks.push(ListBlock::new(alias, world, [ownership.clone(), lists.clone()], steps.places));
        }
        true
    }

    /// Takes all entries up to `to` from the calendars.
    fn collect(&mut self, to: i64) {
        let Self { queue, steps, .. } = self;
        steps.known.clear();
        let Steps { calendars, incoming, collected, known, .. } = steps;
        let all: Vec<_> = calendars.iter_mut().zip(incoming).zip(collected.iter_mut()).collect();
        let from_calendars = || {
            parallel::map(all, &|| (), &|(), ((calendar, incoming), entries)| {
                incoming.drain(..).for_each(|entry| calendar.push(entry));
                entries.clear();
                calendar.take_until(to, entries);
            });
        };
        join(from_calendars, || queue.take_until(to, known));
        for entries in collected {
            known.extend_from_slice(entries);
        }
    }
}

impl<F: Features, E: ListedEvent> Stepping for ListSearch<F, E> {
    fn begin_step(&mut self, state: &mut State, limit: &Limit) -> Option<NextStep> {
        let from = self.horizon.max(state.world.now);
        let wanted = (self.steps.ticks as i64).max(1);
        if self.predictor.plan.frame.end.saturating_sub(from) < wanted / 4 + 1 {
            self.predictor.begin_at(&state.world, from, false);
        }
        let frame = &self.predictor.plan.frame;
        // The fastest particle has moved little in a step, even if nothing has moved before.
        let most = (frame.end - frame.begin) as f64 / STEPS_PER_SPAN;
        self.steps.ticks = self.steps.ticks.min(most).max(1.0);
        let wanted = wanted.min(self.steps.ticks as i64);
        let (is_new, end) = (self.steps.span != Some(frame.begin), frame.end);
        let is_possible = end > from && self.unsuitable(&state.world).is_none();
        if !is_possible || is_new && !self.cut(&state.world) {
            self.steps.move_to(&mut self.queue);
            self.steps.clear();
            self.horizon = i64::MAX;
            return None;
        }
        let longest =
            f64::from(LONGEST) / (f64::from(self.steps.metric.speed) * self.predictor.plan.frame.per_tick);
        let target = (ENTRIES_PER_PARTICLE * state.world.particles.len() as f64).max(LEAST_ENTRIES);
        let least = self.steps.settings.min_events * self.steps.rounds[0].fronts.len();
        // Where so short a step has too few entries: a longer one, whose events are taken in order.
        let is_dilute = target * longest < least as f64 * self.steps.ticks;
        let length = if is_dilute { wanted } else { wanted.min(longest as i64).max(1) };
        let whole = from.saturating_add(length).min(end);
        // If little of the step is before a limit, all of it is taken in order: the queue stops at limits.
        let mut is_short = limit.ticks.saturating_sub(from) < length / SHORT;
        let mut to = if is_short { whole } else { whole.min(limit.ticks) };
        self.collect(to);
        if to == whole {
            let ticks = (to - from) as f64 * target / self.steps.known.len().max(1) as f64;
            self.steps.ticks = ticks.clamp(self.steps.ticks / CHANGE, self.steps.ticks * CHANGE).max(1.0);
        }
        let part = part_before(limit, state);
        let known = &mut self.steps.known;
        is_short |= part < known.len() / SHORT as usize;
        if part < known.len() && !is_short {
            to = known.select_nth_unstable_by_key(part, |entry| entry.time).1.time;
            known.extract_if(.., |entry| entry.time > to).for_each(|entry| self.queue.push(entry));
        }
        (self.steps.from, self.horizon) = (from, to);
        self.steps.reason = is_dilute.then_some("steps would have too few events");
        let suits = !is_dilute
            && !is_short
            && known.len() >= self.steps.settings.min_events / 8 * self.steps.rounds[0].fronts.len()
            && known.iter().all(|entry| entry.time > from);
        Some(NextStep { metric: suits.then_some(self.steps.metric), is_empty: known.is_empty() })
    }

    fn run_step(
        &mut self,
        state: &mut State,
        metric: Metric,
        limit: &mut Limit,
        observer: &mut dyn Observer,
        events: bool,
    ) -> Outcome {
        let from = self.steps.from;
        let Self { kernel, predictor, steps, horizon, .. } = self;
        let places = steps.places;
        let frame = &predictor.plan.frame;
        let span = (frame.begin, frame.per_tick);
        let step = Step::new(metric, (from, *horizon), span, steps.known.len());
        steps.working_space.pending.clear();
        steps.working_space.pending.extend_from_slice(&steps.known);
        predictor.lists.reserve(steps.blocks.len());
        for block in &mut steps.blocks {
            // SAFETY: the aliases are used in this call only.
            unsafe {
                block.part.begin_step(state);
                block.predictor = predictor.alias();
            }
        }
        // SAFETY: as above, and read between the rounds only.
        let particles = unsafe { predictor.particles.alias() };
        steps.attempts += 1;
        let mut is_last = false;
        let run = || {
            blocks::run_rounds(
                &mut steps.rounds,
                &mut steps.blocks,
                &mut steps.working_space,
                (&step, steps.attempts),
                (*kernel, events),
                |round, entries, targets| {
                    route::<F>(&particles, &state.world, places, &step, round, entries, targets);
                },
                |block| {
                    // The lists of the last round can grow without limits: no other block uses them.
                    std::mem::swap(predictor, &mut block.predictor);
                    is_last = true;
                },
            )
        };
        let result = catch_unwind(AssertUnwindSafe(run));
        if is_last {
            // Also after a panic: the blocks must not own the memory that others use.
            std::mem::swap(predictor, &mut steps.blocks[0].predictor);
        }
        for block in &mut steps.blocks {
            predictor.lists.take_back(&mut block.predictor.lists);
        }
        let found = result.unwrap_or_else(|panic| resume_unwind(panic));
        let outcome =
            blocks::conclude(&mut steps.blocks, &mut steps.working_space, state, found, limit, observer);
        if outcome == Outcome::Taken {
            for (block, incoming) in steps.blocks.iter_mut().zip(&mut steps.incoming) {
                incoming.append(&mut block.later);
            }
        } else {
            undo(predictor, state, &mut steps.blocks);
        }
        for block in &mut steps.blocks {
            self.work.add(block.work);
            block.clear();
        }
        outcome
    }

    fn end_step(&mut self, is_taken: bool) {
        if !is_taken {
            self.steps.known.drain(..).for_each(|entry| self.queue.push(entry));
        }
    }

    fn goes_on(&self, ticks: i64) -> bool {
        self.horizon < ticks && !Scheduler::is_idle(self)
    }
}

/// Finds the block of a round in which each of these entries is.
fn route<F: Features>(
    particles: &Array<CompactParticle>,
    world: &World,
    places: Places,
    step: &Step,
    round: &Round,
    entries: &mut [Entry],
    targets: &mut [u32],
) {
    for k in 0..entries.len() {
        if let Some(later) = entries.get(k + AHEAD) {
            let partner = later.target.partner().unwrap_or(later.owner);
            prefetch_at(particles, later.owner as usize);
            prefetch_at(&world.particles, later.owner as usize);
            prefetch_at(&world.particles, partner as usize);
        }
        let entry = &mut entries[k];
        if world.particles[entry.owner as usize].count != entry.own_count {
            targets[k] = NO_BLOCK;
            continue;
        }
        // Here, because in a round the partner can be far away by now, where another block changes it.
        let partner = entry.target.partner();
        if partner.is_some_and(|j| world.particles[j as usize].count != entry.partner_count) {
            entry.target = Target::new(SearchEvent::Prediction);
        }
        let particle = &particles[entry.owner as usize];
        targets[k] = round.block_at(places.at::<F>(particle, step.fraction(entry.time))) as u32;
    }
}

/// Restores particles and lists as they were before the step.
fn undo<F: Features>(predictor: &mut ListPredictor<F>, state: &mut State, blocks: &mut [ListBlock<F>]) {
    let mut moved = Vec::new();
    for block in blocks {
        block.part.undo(state, |world, i| predictor.copy(world, i));
        moved.append(&mut block.moved);
    }
    // Of several updates of one list, the position before the first.
    moved.sort_unstable();
    moved.dedup_by_key(|(i, ..)| *i);
    for (i, _, reference) in moved {
        let is_moved = predictor.lists.set_reference::<F, false>(i, reference, &predictor.particles);
        debug_assert!(is_moved, "the lists of the scheduler can grow");
    }
}
