/*!
The calendar of a scheduler in which every particle has exactly one valid entry, its earliest event.

An event of the entry's own particle invalidates the entry, which is then dropped. After an event of the
partner, the entry's particle is predicted again. So each valid entry has exactly one successor.

In the order of time every event of a large system is somewhere else in memory. Both calendars keep the next
few events sorted, so that their particles, then slots, compact particles and lists, then cells and members
of lists are prefetched in steps. From 100,000 particles on this makes windows 1.2 times as fast, and lists
1.1 times from 15,000 and 1.5 times from 500,000 on.

An entry of a particle is the earliest of its collisions, wall collisions, end of bounces, and crossing or
list update. An entry has both event counters. Own counter changed: it is invalidated and dropped. Partner's
changed: this particle alone is predicted again. Each valid entry leaves one successor. A particle whose next
event is a crossing keeps its best collision, so that only the new cells are searched after it.
*/

use haff_calendar::{Calendar, Ladder};

use crate::{
    model::features::Features,
    search::{
        entry::Entry,
        ties::{Ties, is_valid},
    },
    state::{State, world::World},
};

/// Entries per particle in the long run, including invalidated ones. A calendar with a smaller capacity must
/// be reallocated, which needs twice the memory for a moment.
const ENTRIES_PER_PARTICLE: f64 = 1.75;

/// Predicts the events of a [`Queue`].
pub(crate) trait Predictor {
    /// The features of the particles.
    type Features: Features;
    /// The kind of event of an entry.
    type Kind;
    /// Predicts the next event of particle i from the present; the time `i64::MAX` means no event.
    fn predict(&mut self, state: &State, i: u32) -> Entry<Self::Kind>;
    /// Prefetches the memory that the next events will read.
    /// `upcoming` returns the entry that is this many entries after the next one, if it is known.
    fn prefetch<'a>(&self, upcoming: impl Fn(usize) -> Option<&'a Entry<Self::Kind>>, state: &State)
    where
        Self::Kind: 'a;
}

/// The calendar, with the entries of the present tick.
pub(crate) struct Queue<K> {
    calendar: Ladder<Entry<K>>,
    /// The first of several entries of one tick; an entry without an event while `ties` has the others. Not a
    /// flag, with which the events of lists take 0.2 % more instructions.
    tied: Vec<Entry<K>>,
    ties: Ties<K>,
}

impl<K> Queue<K> {
    /// An empty queue. The entries up to `ahead` after the next one can be [prefetched](Predictor::prefetch).
    pub fn new(particles: usize, ahead: usize) -> Self {
        let mut calendar = Ladder::with_capacity(particles);
        calendar.keep_sorted(ahead + 1);
        Self { calendar, tied: Vec::new(), ties: Ties::new() }
    }

    pub fn clear(&mut self) {
        self.calendar.clear();
        self.tied.clear();
        self.ties.clear();
    }

    pub fn is_empty(&self) -> bool {
        self.calendar.is_empty() && self.tied.is_empty()
    }

    /// Sizes the calendar for this number of `particles`, given a sample of their events. The calendar must
    /// be empty.
    pub fn prepare(&mut self, some: &[Entry<K>], particles: usize) {
        let events: Vec<Entry<K>> = some.iter().copied().filter(|entry| entry.time < i64::MAX).collect();
        self.calendar.prepare(&events, (ENTRIES_PER_PARTICLE * particles as f64) as usize);
    }

    /// Moves the entries up to `limit` to `entries`, invalidated ones too.
    pub fn take_until(&mut self, limit: i64, entries: &mut Vec<Entry<K>>) {
        entries.extend(self.tied.drain(..).filter(|entry| entry.time < i64::MAX));
        self.ties.take(entries);
        self.calendar.take_until(limit, entries);
    }

    /// Adds an entry, unless its time is `i64::MAX`.
    #[inline(always)]
    pub fn push(&mut self, entry: Entry<K>) {
        if entry.time < i64::MAX {
            self.calendar.push(entry);
        }
    }

    /// Removes and returns the earliest valid entry up to `limit`; its partner has had no event since its
    /// prediction.
    #[inline(always)]
    pub fn next<P: Predictor<Kind = K>>(
        &mut self,
        state: &mut State,
        predictor: &mut P,
        limit: i64,
    ) -> Option<Entry<K>> {
        loop {
            if !self.tied.is_empty() {
                if let Some(entry) = self.next_tie(state, predictor, limit) {
                    return Some(entry);
                }
                if !self.tied.is_empty() {
                    return None;
                }
            }
            let entry = self.calendar.pop_until(limit)?;
            predictor.prefetch(|ahead| self.calendar.upcoming(ahead), state);
            if state.world.particles[entry.owner as usize].count != entry.own_count {
                state.accumulators.counters.dropped += 1;
                continue;
            }
            if let Some(next) = self.calendar.peek()
                && next.time == entry.time
            {
                // Usually this is only the partner's entry for the same collision. The collision will
                // invalidate it, unless the partner has infinite mass: the entry of such a body stays valid,
                // and must have a successor.
                let movable = |i: u32| P::Features::UNIFORM || state.world.class(i).inverse_mass != 0.0;
                if next.mirrors(&entry) && movable(entry.owner) && movable(next.owner) {
                    self.calendar.pop_until(limit);
                    predictor.prefetch(|ahead| self.calendar.upcoming(ahead), state);
                    state.accumulators.counters.dropped += 1;
                }
                if self.calendar.next_time() == Some(entry.time) {
                    self.tied.push(entry);
                    continue;
                }
            }
            if has_partner_changed(&state.world, &entry) {
                self.repredict(state, predictor, entry);
                continue;
            }
            return Some(entry);
        }
    }

    /// Removes and returns the entry of lowest rank among several entries of one tick. Entries whose partner
    /// has had another event are predicted again first, so that the result does not depend on the order of
    /// predictions.
    #[cold]
    fn next_tie<P: Predictor<Kind = K>>(
        &mut self,
        state: &mut State,
        predictor: &mut P,
        limit: i64,
    ) -> Option<Entry<K>> {
        let time = self.ties.time().or_else(|| self.tied.first().map(|entry| entry.time))?;
        if time > limit {
            return None;
        }
        let mut first = self.tied.pop().filter(|entry| entry.time < i64::MAX);
        loop {
            let mut outdated = self.ties.take_outdated(&state.world);
            while let Some(entry) = first.take().or_else(|| self.calendar.pop_until(time)) {
                if !is_valid(&state.world, &entry) {
                    state.accumulators.counters.dropped += 1;
                } else if has_partner_changed(&state.world, &entry) {
                    outdated.push(entry);
                } else {
                    self.ties.push(entry);
                }
            }
            if outdated.is_empty() {
                break;
            }
            for entry in outdated {
                self.repredict(state, predictor, entry);
            }
        }
        let entry = self.ties.pop(&state.world, &mut state.accumulators.counters.dropped);
        if !self.ties.is_empty() {
            self.tied.push(Entry::none(0, 0));
        }
        entry
    }

    /// Notes bodies that may have had an event which was not that of an entry.
    pub fn note_changed(&mut self, bodies: &[u32]) {
        self.ties.note(bodies);
    }

    /// Predicts the particle of an entry again, because the partner has had another event.
    #[inline(always)]
    fn repredict<P: Predictor<Kind = K>>(&mut self, state: &mut State, predictor: &mut P, entry: Entry<K>) {
        state.world.now = state.world.now.max(entry.time);
        state.accumulators.counters.stale += 1;
        let entry = predictor.predict(state, entry.owner);
        self.push(entry);
    }
}

/// Whether the partner of an entry has had another event since the prediction.
#[inline]
fn has_partner_changed<K>(world: &World, entry: &Entry<K>) -> bool {
    entry.target.partner().is_some_and(|j| world.particles[j as usize].count != entry.partner_count)
}
