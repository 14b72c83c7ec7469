//! The rounds of a step: which block takes which events.

use std::sync::{Mutex, PoisonError};

use crate::{
    numerics::tuning::particles::PARALLEL_EVENTS,
    report::{BlockCounts, Observer},
    search::{
        batch::Kernel,
        blocks::{cut::Round, front::Dilations, part::RoundView, rows, step::Step},
        event_loop::Limit,
        parallel, sharing,
    },
    state::{State, world::World},
};

use super::{front::Bounds, part::Part};

/// Factors of the distances of fronts: if a step is undone because of an event that a front has not expected,
/// it is tried again with the next one.
pub(crate) const DILATIONS: [f32; 2] = [1.0, 1.6];

/// Number of events whose blocks are found at a time.
pub(super) const CHUNK: usize = 512;

/// What decides whether and how events are taken by blocks.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Settings {
    /// Smallest number of particles, and of events of a step for each block.
    pub min_particles: usize,
    pub min_events: usize,
    /// Number of blocks; `None`: that of threads.
    pub blocks: Option<usize>,
    /// Smallest thickness of a block [largest contact distances], and [longest displacements].
    pub thickness: [f32; 2],
    /// Distances of fronts.
    pub dilations: Dilations,
}

impl Settings {
    pub const MEASURED: Self = Self {
        min_particles: PARALLEL_EVENTS,
        min_events: 150,
        blocks: None,
        thickness: [20.0, 2.0],
        dilations: Dilations { face: 4.1, source: 2.6, inner: 1.1 },
    };

    /// The settings for a number of blocks, or those of a test, if it has set any.
    pub fn new(blocks: Option<u16>) -> Self {
        #[cfg(test)]
        if let Some(settings) = super::tests::SETTINGS.get() {
            return settings;
        }
        // As many as are wanted, in systems of any size.
        let Some(blocks) = blocks else { return Self::MEASURED };
        Self {
            min_particles: 0,
            min_events: 1,
            thickness: [1.0, 0.0],
            blocks: Some(blocks.into()),
            ..Self::MEASURED
        }
    }

    /// Largest number of blocks.
    pub fn most(&self) -> usize {
        self.blocks.unwrap_or_else(sharing::threads)
    }

    /// Why the events of a world that can be shared are taken on one thread; `None` if blocks take them.
    pub fn serial_reason(&self, world: &World) -> Option<&'static str> {
        if self.most() < 2 {
            Some("there is one thread or block")
        } else if world.particles.len() < self.min_particles {
            Some("there are too few particles")
        } else {
            None
        }
    }
}

/// Whether blocks of any search can share events.
///
/// # Errors
/// Why one thread takes all events.
pub(crate) fn can_share(world: &World) -> Result<(), &'static str> {
    if world.supported.resting != 0 || world.boundary.carries {
        Err("grains rest on walls, or walls carry them")
    } else {
        Ok(())
    }
}

/// One block, with its data of the search.
pub(crate) trait Block: Send {
    /// Whether all particles have one size and mass.
    const UNIFORM: bool;
    /// An event in a queue.
    type Event: Copy + Send + Sync;
    /// The data that do not depend on the search.
    fn part(&mut self) -> &mut Part<Self::Event>;
    /// Prepares a round with these bounds.
    fn begin_round(&mut self, _: Bounds) {}
    /// Takes the events of a round, or leaves them over. `EVENTS`: rows of events are recorded. `VECTORS`:
    /// the caller is compiled for AVX2 and FMA, and the processor supports them.
    fn take<const EVENTS: bool, const VECTORS: bool>(&mut self, round: &RoundView);
    /// Whether some memory of the block has been too small, so that the step must be undone.
    fn is_full(&self) -> bool {
        false
    }
}

/// Takes the events of a round.
pub(super) fn take<B: Block>(block: &mut B, kernel: Kernel, events: bool, round: &RoundView) {
    match (kernel, events) {
        #[cfg(not(target_arch = "x86_64"))]
        (Kernel::Portable, false) => block.take::<false, false>(round),
        #[cfg(not(target_arch = "x86_64"))]
        (Kernel::Portable, true) => block.take::<true, false>(round),
        #[cfg(target_arch = "x86_64")]
        (Kernel::Portable, _) => take_portable(block, round),
        #[cfg(target_arch = "x86_64")]
        // SAFETY: only `Kernel::choose` makes this variant, after it has detected the features.
        (Kernel::Avx2, false) => unsafe { take_avx2::<B, false>(block, round) },
        #[cfg(target_arch = "x86_64")]
        // SAFETY: as above.
        (Kernel::Avx2, true) => unsafe { take_avx2::<B, true>(block, round) },
    }
}

/// On x86-64 the event loop of this kernel always asks for rows, and never has particles of one size.
#[cfg(target_arch = "x86_64")]
fn take_portable<B: Block>(block: &mut B, round: &RoundView) {
    if B::UNIFORM {
        unreachable!("`Choice::is_uniform` excludes it");
    }
    block.take::<true, false>(round);
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt,popcnt")]
pub(super) fn take_avx2<B: Block, const EVENTS: bool>(block: &mut B, round: &RoundView) {
    block.take::<EVENTS, true>(round);
}

/// How a step has ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Outcome {
    /// All events have been taken.
    Taken,
    /// The step must be undone.
    Failed,
    /// It must be undone because of an event that a front has not expected.
    Unexpected,
}

/// Working space of steps.
#[derive(Debug)]
pub(crate) struct WorkingSpace<E> {
    /// Events of a step, then those that are left to the next round.
    pub pending: Vec<E>,
    /// The block of each of them.
    targets: Vec<u32>,
    /// Times of the events of a step \[ticks\].
    times: Vec<i64>,
}

impl<E> WorkingSpace<E> {
    pub const fn new() -> Self {
        Self { pending: Vec::new(), targets: Vec::new(), times: Vec::new() }
    }
}

/// No block takes the event: it is invalid.
pub(crate) const NO_BLOCK: u32 = u32::MAX;

/// Runs the rounds of a step. `route` says in which block of a round each of these events is, or
/// [`NO_BLOCK`]; it may change the events. `start_last` prepares the single block of the last round.
/// `number`: of the steps since ownership has begun.
pub(crate) fn run_rounds<B: Block>(
    rounds: &mut [Round],
    blocks: &mut [B],
    WorkingSpace { pending, targets, .. }: &mut WorkingSpace<B::Event>,
    (step, number): (&Step, usize),
    (kernel, events): (Kernel, bool),
    route: impl Fn(&Round, &mut [B::Event], &mut [u32]) + Sync,
    start_last: impl FnOnce(&mut B),
) -> (BlockCounts, Outcome) {
    let mut counts =
        BlockCounts { blocks: rounds[0].fronts.len() as u64, steps: 1, ..BlockCounts::default() };
    let last = rounds.len() - 1;
    let mut start_last = Some(start_last);
    for round in 0..=last {
        if pending.is_empty() {
            break;
        }
        targets.clear();
        targets.resize(pending.len(), 0);
        if round < last {
            let find =
                |_, events: &mut [B::Event], targets: &mut [u32]| route(&rounds[round], events, targets);
            parallel::change_both(pending, targets, CHUNK, &find);
        } else if let Some(start_last) = start_last.take() {
            start_last(&mut blocks[0]);
        }
        let (earlier, present) = rounds.split_at_mut(round);
        let fronts = &mut present[0].fronts;
        let blocks = &mut blocks[..fronts.len()];
        for (k, (block, front)) in blocks.iter_mut().zip(&mut *fronts).enumerate() {
            front.begin(step.metric, step.fraction(step.from), step.fraction(step.to));
            let part = block.part();
            part.ownership.begin(number * (last + 1) + round, k);
            part.rows.begin_round();
            block.begin_round(front.bounds);
            std::mem::swap(&mut block.part().front, front);
        }
        let (known, targets) = (&pending[..], &targets[..]);
        // Each of these locks is taken once.
        let slots: Vec<Mutex<&mut B>> = blocks.iter_mut().map(Mutex::new).collect();
        let run = |k: usize| {
            let block = &mut **slots[k].lock().unwrap_or_else(PoisonError::into_inner);
            let part = block.part();
            part.known.clear();
            let own = known.iter().zip(targets).filter(|&(_, &target)| target == k as u32);
            part.known.extend(own.map(|(event, _)| *event));
            take(block, kernel, events, &RoundView { step, earlier });
        };
        parallel::for_each(slots.len(), &run);
        pending.clear();
        let (mut longest, mut is_failed, mut is_unexpected) = (0, false, false);
        for (block, front) in blocks.iter_mut().zip(fronts) {
            is_failed |= block.is_full();
            let part = block.part();
            std::mem::swap(&mut part.front, front);
            let taken = (part.times.len() - part.first_time) as u64;
            longest = longest.max(taken);
            *(match round {
                0 => &mut counts.first,
                _ if round < last => &mut counts.further,
                _ => &mut counts.last,
            }) += taken;
            part.first_time = part.times.len();
            pending.append(&mut part.left);
            is_unexpected |= part.is_unexpected;
            is_failed |= part.is_failed;
        }
        counts.critical_path += longest;
        if is_failed {
            return (counts, if is_unexpected { Outcome::Unexpected } else { Outcome::Failed });
        }
    }
    (counts, Outcome::Taken)
}

/// Ends the rounds of a step: keeps its events, unless a limit of collisions is reached or they are a
/// collapse, and gives their rows to the observer. A step that is not kept is noted as undone; the search
/// undoes it.
pub(crate) fn conclude<B: Block>(
    blocks: &mut [B],
    working_space: &mut WorkingSpace<B::Event>,
    state: &mut State,
    (counts, mut outcome): (BlockCounts, Outcome),
    limit: &mut Limit,
    observer: &mut dyn Observer,
) -> Outcome {
    let total = counts.events();
    let may_keep = || {
        state.accumulators.counters.collisions + total < limit.collisions
            && state.stall.allows(&state.world, total)
    };
    if outcome == Outcome::Taken && !may_keep() {
        outcome = Outcome::Failed;
    }
    if outcome == Outcome::Taken {
        let transfers = state.accumulators.counters.transfers;
        end_step(blocks, working_space, state, &counts, observer);
        let updates = state.accumulators.counters.transfers - transfers;
        limit.entries = limit.entries.saturating_sub(total + updates);
    } else {
        let critical_path = counts.critical_path;
        state.blocks.add(&BlockCounts { steps: 1, undone: 1, critical_path, ..BlockCounts::default() });
    }
    outcome
}

/// Adds what blocks have counted and recorded in a step to the state, and gives their rows to the observer.
fn end_step<B: Block>(
    blocks: &mut [B],
    WorkingSpace { times, .. }: &mut WorkingSpace<B::Event>,
    state: &mut State,
    counts: &BlockCounts,
    observer: &mut dyn Observer,
) {
    state.blocks.add(counts);
    times.clear();
    for block in &mut *blocks {
        let part = block.part();
        state.accumulators.merge(&mut part.state.accumulators);
        let sums = (&mut state.world.boundary.wall_sums, &mut part.state.world.boundary.wall_sums);
        if let (Some(sums), Some(of_block)) = sums {
            sums.take_from_block(of_block);
        }
        state.world.resolution.longest_flight =
            state.world.resolution.longest_flight.max(part.state.world.resolution.longest_flight);
        times.append(&mut part.times);
    }
    #[allow(
        clippy::stable_sort_primitive,
        reason = "it makes use of the order within each round of a block"
    )]
    times.sort();
    state.stall.count_sorted(times);
    if let Some(&last) = times.last() {
        state.world.now = state.world.now.max(last);
    }
    rows::deliver(blocks.iter_mut().map(|block| &block.part().rows), observer);
}
