/*!
The calendar of a scheduler in which every particle has exactly one valid entry, its earliest event.

An entry is invalidated by an event of its own particle, and dropped. After an event of its partner its
particle is predicted again. So each valid entry leaves exactly one successor.
*/

use haff_calendar::{Calendar, Ladder};

use crate::{entry::Entry, features::Features, particles::World, state::State};

/// Entries per particle in the long run, invalidated ones included. A calendar made for less has to be made
/// anew, which for a moment takes twice the memory.
const ENTRIES: f64 = 1.75;

/// Predicts for a [`Queue`].
pub(crate) trait Predictor {
    /// What the particles are like.
    type Features: Features;
    /// What entries announce.
    type Kind;
    /// The next event of particle i, predicted at the world's present; one at `i64::MAX` is not entered.
    fn predict(&mut self, state: &State, i: u32) -> Entry<Self::Kind>;
    /// Prefetches the memory that the next events will read.
    fn prefetch(&self, calendar: &Ladder<Entry<Self::Kind>>, state: &State);
}

/// The calendar, with the entries of the present tick.
pub(crate) struct Queue<K> {
    calendar: Ladder<Entry<K>>,
    /// Entries of one and the same tick, latest rank first, while there are several.
    ties: Vec<Entry<K>>,
}

impl<K> Queue<K> {
    /// An empty queue, of which the entries up to `ahead` from the next can be
    /// [prefetched](Predictor::prefetch).
    pub fn new(particles: usize, ahead: usize) -> Self {
        let mut calendar = Ladder::with_capacity(particles);
        calendar.keep_sorted(ahead + 1);
        Self { calendar, ties: Vec::new() }
    }

    pub fn clear(&mut self) {
        self.calendar.clear();
        self.ties.clear();
    }

    pub fn is_empty(&self) -> bool {
        self.calendar.is_empty() && self.ties.is_empty()
    }

    /// Lays the calendar out for the events of `particles`, of which these are some; nothing may have been
    /// entered.
    pub fn prepare(&mut self, some: &[Entry<K>], particles: usize) {
        let events: Vec<Entry<K>> = some.iter().copied().filter(|entry| entry.time < i64::MAX).collect();
        self.calendar.prepare(&events, (ENTRIES * particles as f64) as usize);
    }

    /// Enters an event, unless it is at no time.
    #[inline(always)]
    pub fn push(&mut self, entry: Entry<K>) {
        if entry.time < i64::MAX {
            self.calendar.push(entry);
        }
    }

    /// The next valid entry whose partner has had no other event, up to `limit`.
    #[inline(always)]
    pub fn next<P: Predictor<Kind = K>>(
        &mut self,
        state: &mut State,
        predictor: &mut P,
        limit: i64,
    ) -> Option<Entry<K>> {
        loop {
            if !self.ties.is_empty() {
                if let Some(entry) = self.next_tie(state, predictor, limit) {
                    return Some(entry);
                }
                if !self.ties.is_empty() {
                    return None;
                }
            }
            let entry = self.calendar.pop_until(limit)?;
            predictor.prefetch(&self.calendar, state);
            if state.world.particles[entry.owner as usize].count != entry.own_count {
                state.accumulators.counters.dropped += 1;
                continue;
            }
            if let Some(next) = self.calendar.peek()
                && next.time == entry.time
            {
                // Usually the partner's entry for the same collision, and nothing else. The collision will
                // invalidate it, unless the partner is a body of infinite mass, whose entry must leave its
                // successor.
                let movable = |i: u32| P::Features::UNIFORM || state.world.class(i).inverse_mass != 0.0;
                if next.mirrors(&entry) && movable(entry.owner) && movable(next.owner) {
                    self.calendar.pop_until(limit);
                    predictor.prefetch(&self.calendar, state);
                    state.accumulators.counters.dropped += 1;
                }
                if self.calendar.next_time() == Some(entry.time) {
                    self.ties.push(entry);
                    continue;
                }
            }
            if has_met_others(&state.world, &entry) {
                self.repredict(state, predictor, entry);
                continue;
            }
            return Some(entry);
        }
    }

    /// Of several entries at one tick, the first in rank. Those whose partner has had another event are
    /// predicted again before, so that the first does not depend on the order of predictions.
    #[cold]
    fn next_tie<P: Predictor<Kind = K>>(
        &mut self,
        state: &mut State,
        predictor: &mut P,
        limit: i64,
    ) -> Option<Entry<K>> {
        let time = self.ties[0].time;
        if time > limit {
            return None;
        }
        loop {
            let mut changed = false;
            while let Some(entry) = self.calendar.pop_until(time) {
                self.ties.push(entry);
                changed = true;
            }
            let mut outdated = Vec::new();
            self.ties.retain(|entry| {
                if state.world.particles[entry.owner as usize].count != entry.own_count {
                    state.accumulators.counters.dropped += 1;
                    return false;
                }
                if has_met_others(&state.world, entry) {
                    outdated.push(*entry);
                    return false;
                }
                true
            });
            if changed {
                self.ties.sort_unstable_by(|a, b| (b.rank(), b).cmp(&(a.rank(), a)));
            }
            if outdated.is_empty() {
                break;
            }
            for entry in outdated {
                self.repredict(state, predictor, entry);
            }
        }
        self.ties.pop()
    }

    /// Predicts again the particle of an entry whose partner has had another event.
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
fn has_met_others<K>(world: &World, entry: &Entry<K>) -> bool {
    entry.target.partner().is_some_and(|j| world.particles[j as usize].count != entry.partner_count)
}
