/*!
The calendar of an engine in which every particle has exactly one live entry, its earliest event.

An entry whose own particle has had another event is void and dropped; one whose partner has is stale, and its particle is
predicted afresh. So each live entry leaves exactly one successor.
*/

use haff_calendar::{Calendar, Ladder};

use crate::{
    entry::{Entry, Kind},
    machine::{Features, State},
    particles::World,
};

/// Entries per particle in the long run, with those that are void. A calendar made for less has to be made anew, which for a
/// moment takes twice the memory.
const ENTRIES: f64 = 1.75;

/// What predicts for a [`Queue`].
pub(crate) trait Prophet {
    /// What the particles are like.
    type Features: Features;
    /// The next event of particle i, as seen at the world's present; one at no time is not entered.
    fn foresee(&mut self, state: &State, i: u32) -> Entry;
    /// Asks for the memory that the next events will read.
    fn look_ahead(&self, calendar: &Ladder<Entry>, state: &State);
}

/// The calendar, and what stands beside it.
pub(crate) struct Queue {
    calendar: Ladder<Entry>,
    /// Entries of one and the same tick, latest rank first, while several of them are due.
    ties: Vec<Entry>,
}

impl Queue {
    /// An empty queue, of which the entries up to `ahead` from the next can be [looked at](Prophet::look_ahead).
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

    /// Makes ready for the events of `particles`, of which these are some; nothing may have been entered.
    pub fn prepare(&mut self, some: &[Entry], particles: usize) {
        let due: Vec<Entry> = some.iter().copied().filter(|entry| entry.time < i64::MAX).collect();
        self.calendar.prepare(&due, (ENTRIES * particles as f64) as usize);
    }

    /// Enters an event, unless it is at no time.
    #[inline(always)]
    pub fn push(&mut self, entry: Entry) {
        if entry.time < i64::MAX {
            self.calendar.push(entry);
        }
    }

    /// The next entry that is neither void nor stale, up to `limit`.
    #[inline(always)]
    pub fn next<P: Prophet>(&mut self, state: &mut State, prophet: &mut P, limit: i64) -> Option<Entry> {
        loop {
            if !self.ties.is_empty() {
                if let Some(entry) = self.next_tie(state, prophet, limit) {
                    return Some(entry);
                }
                if !self.ties.is_empty() {
                    return None;
                }
            }
            let entry = self.calendar.pop_until(limit)?;
            prophet.look_ahead(&self.calendar, state);
            if state.world.particles[entry.owner as usize].count != entry.own_count {
                state.book.counters.dropped += 1;
                continue;
            }
            if let Some(next) = self.calendar.peek()
                && next.time == entry.time
            {
                // Usually the partner's entry for the same collision, and nothing else. It will be void, unless the partner
                // is a body of infinite mass, whose entry must find its successor.
                let movable = |i: u32| P::Features::UNIFORM || state.world.class(i).inverse_mass != 0.0;
                if next.mirrors(&entry) && movable(entry.owner) && movable(next.owner) {
                    self.calendar.pop_until(limit);
                    prophet.look_ahead(&self.calendar, state);
                    state.book.counters.dropped += 1;
                }
                if self.calendar.next_time() == Some(entry.time) {
                    self.ties.push(entry);
                    continue;
                }
            }
            if is_stale(&state.world, &entry) {
                self.renew(state, prophet, entry);
                continue;
            }
            return Some(entry);
        }
    }

    /// Of several entries at one tick, the first in rank. All that are stale are predicted afresh before, so that
    /// what is first does not depend on which of them had been predicted when.
    #[cold]
    fn next_tie<P: Prophet>(&mut self, state: &mut State, prophet: &mut P, limit: i64) -> Option<Entry> {
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
            let mut stale = Vec::new();
            self.ties.retain(|entry| {
                if state.world.particles[entry.owner as usize].count != entry.own_count {
                    state.book.counters.dropped += 1;
                    return false;
                }
                if is_stale(&state.world, entry) {
                    stale.push(*entry);
                    return false;
                }
                true
            });
            if changed {
                self.ties.sort_unstable_by(|a, b| (b.rank(), b).cmp(&(a.rank(), a)));
            }
            if stale.is_empty() {
                break;
            }
            for entry in stale {
                self.renew(state, prophet, entry);
            }
        }
        self.ties.pop()
    }

    /// Predicts afresh the particle whose partner has collided since.
    #[inline(always)]
    fn renew<P: Prophet>(&mut self, state: &mut State, prophet: &mut P, entry: Entry) {
        state.world.now = state.world.now.max(entry.time);
        state.book.counters.stale += 1;
        let entry = prophet.foresee(state, entry.owner);
        self.push(entry);
    }
}

/// Whether the partner of an entry has had another event since.
#[inline]
fn is_stale(world: &World, entry: &Entry) -> bool {
    match entry.target.kind() {
        Kind::Collision(j) => world.particles[j as usize].count != entry.partner_count,
        Kind::Wall(_) | Kind::Rest | Kind::Transfer(_) | Kind::Renewal => false,
    }
}
