/*!
Events tile by tile, for systems larger than the caches.

In the order of time every event is somewhere else, and what it looks at has to come from memory. Tile by tile
([`super::tiles`]) it is in the cache mostly. Causes come before effects nearly always; where they do not, somebody has gone on
too early, which shows in one of two ways: a new path meets a path of the past before that ended, or an entry is void though
both paths were in force at its time. What has happened too early is then taken back ([`super::history`]), with all that followed
from it, and those concerned are searched for again. When the window is done, its events are those of the order of time,
and nothing of the trajectory tells in which order they were taken.
*/

use super::{
    Windows,
    due::Due,
    exact,
    filter::{BEFORE, Probe, Record},
    history::{Happened, Standing, Tie},
    tiles::Tiles,
};
use crate::{
    batch::Kernel,
    entry::{Entry, Kind},
    machine::{Features, Limit, State},
    model::System,
    particles::World,
    report::{EventRecord, Observer},
    resolve,
};

/// Tiles are worth while from this many particles on…
const LARGE: usize = 200_000;
/// …and up to so many: what has happened in a window takes a hundred bytes a particle, more than a very large system has to spare.
pub(super) const VERY_LARGE: usize = 800_000;
/// After a window that had to be taken again, the next is taken in the order of time; after each further one, twice as many, up to this.
const LONGEST_PENALTY: u32 = 64;
/// A window has at most so many times as many events as contacts are known at its start.
const MOST_EVENTS: usize = 4;

/// The system is not for tiles now: the window has to be taken in the order of time.
struct Untileable;

impl From<Tie> for Untileable {
    fn from(_: Tie) -> Self {
        Self
    }
}

/// What has to be taken back: a slot's events after a time, and at it if so.
type TakeBack = (u32, i64, bool);

/// Whether events of a system may be taken tile by tile: collisions only, whose outcome depends on no clock but the anchors'.
pub(super) fn is_tileable(system: &System) -> bool {
    system.walls.is_empty()
        && system.contacts.tc == 0.0
        && system.classes.iter().all(|class| class.mass.is_finite())
}

impl<F: Features> Windows<F> {
    /// How to cut the window that begins: not at all unless it is sure to be taken to its end.
    pub(super) fn choose_tiles(&mut self, state: &State, limit: &Limit) -> Tiles {
        #[cfg(not(test))]
        let large = LARGE;
        #[cfg(test)]
        let large = tests::LARGE.get();
        // As many as in the window before, and a quarter more, or as many as contacts were known at its start.
        let collisions = state.book.counters.collisions;
        let before = collisions - std::mem::replace(&mut self.collisions, collisions).min(collisions);
        let expected = (before + before / 4).max(self.found.entries.len() as u64);
        if !self.tileable
            || self.space.cells.axes.is_folded()
            || !(large..=VERY_LARGE).contains(&self.space.records.len())
            || limit.ticks <= self.space.end
            || limit.collisions.saturating_sub(state.book.counters.collisions) <= expected
        {
            return Tiles::none();
        }
        if self.untiled > 0 {
            self.untiled -= 1;
            return Tiles::none();
        }
        Tiles::new(&self.space.cells.axes, self.begin, self.space.end)
    }

    /// Takes all events of the window that has just been opened in tiles; if that cannot be, the window is opened once more, uncut.
    pub(super) fn take_tiles(&mut self, state: &mut State, limit: &mut Limit, observer: &mut dyn Observer) {
        let mut rows = observer.wants_events().then(Vec::new);
        self.history.clear(self.space.records.len());
        let dropped = state.book.counters.dropped;
        let taken = match self.kernel {
            Kernel::Portable => self.tiles_to_end::<false>(state, limit, &mut rows),
            #[cfg(target_arch = "x86_64")]
            // SAFETY: `Kernel::Avx2` is made by `Kernel::choose` alone, after it has found the features.
            Kernel::Avx2 => unsafe { self.tiles_to_end_avx2(state, limit, &mut rows) },
        };
        if taken.is_ok() && self.file_events(state, observer, rows).is_ok() {
            #[cfg(test)]
            tests::note(&self.history, true);
            limit.entries = limit.entries.saturating_sub(self.history.valid as u64);
            state.world.now = self.space.end;
            self.penalty = 1;
            return;
        }
        #[cfg(test)]
        tests::note(&self.history, false);
        self.history.undo(&mut state.world);
        state.book.counters.dropped = dropped;
        state.world.now = self.begin;
        self.untiled = self.penalty;
        self.penalty = (2 * self.penalty).min(LONGEST_PENALTY);
        self.space.tiles = Tiles::none();
        self.start_afresh(&state.world);
        self.open(&state.world);
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt,popcnt")]
    fn tiles_to_end_avx2(
        &mut self,
        state: &mut State,
        limit: &Limit,
        rows: &mut Option<Vec<EventRecord>>,
    ) -> Result<(), Untileable> {
        self.tiles_to_end::<true>(state, limit, rows)
    }

    #[inline(always)]
    fn tiles_to_end<const VECTORS: bool>(
        &mut self,
        state: &mut State,
        limit: &Limit,
        rows: &mut Option<Vec<EventRecord>>,
    ) -> Result<(), Untileable> {
        let most = MOST_EVENTS * self.found.entries.len() + 1000;
        let room = limit.collisions - state.book.counters.collisions;
        while let Some(Due(entry)) = self.agenda.pop_until(i64::MAX) {
            self.prefetch_soon(&state.world);
            let Kind::Collision(j) = entry.target.kind() else { return Err(Untileable) };
            let pair = [entry.owner.min(j), entry.owner.max(j)];
            match self.standing(&state.world, &entry, pair) {
                Standing::Due => self.collide::<VECTORS>(&mut state.world, pair, entry.time, rows)?,
                Standing::Void => state.book.counters.dropped += 1,
                Standing::Missed => {
                    // Somebody has gone on too early: back, and the same contact is found anew.
                    let back = pair.map(|id| (self.slot_of[id as usize], entry.time, false));
                    self.put_right(&mut state.world, back.to_vec())?;
                }
                Standing::Tie => return Err(Untileable),
            }
            if self.history.events.len() > most || self.history.valid as u64 >= room {
                return Err(Untileable);
            }
        }
        Ok(())
    }

    /// Whether what an entry announces happens now.
    #[inline(always)]
    fn standing(&self, world: &World, entry: &Entry, pair: [u32; 2]) -> Standing {
        let mut counts = [entry.own_count, entry.partner_count];
        if entry.owner != pair[0] {
            counts.reverse();
        }
        let particles = pair.map(|id| &world.particles[id as usize]);
        let now = particles.map(|particle| particle.count);
        if counts == now {
            return Standing::Due;
        }
        // The common case, told by the anchors alone: whoever has changed did so before.
        if (0..2).any(|k| counts[k] != now[k] && particles[k].time < entry.time) {
            return Standing::Void;
        }
        self.history.standing(entry.time, pair, pair.map(|id| self.slot_of[id as usize]), counts, now)
    }

    /// Takes a collision, files it, and enters what follows from it.
    #[inline(always)]
    fn collide<const VECTORS: bool>(
        &mut self,
        world: &mut World,
        pair: [u32; 2],
        time: i64,
        rows: &mut Option<Vec<EventRecord>>,
    ) -> Result<(), Untileable> {
        world.now = time;
        let slots = pair.map(|id| self.slot_of[id as usize]);
        let before = pair.map(|id| (world.particles[id as usize], world.images[id as usize]));
        let contact = resolve::collide::<F>(world, pair[0], pair[1], time).map_err(|_| Untileable)?;
        if let Some(rows) = rows {
            rows.push(contact.row(world));
        }
        let impact = &contact.impact;
        let happened = Happened {
            time,
            pair,
            virial: impact.impulse * contact.distance,
            energy_loss: impact.energy_loss,
            carnot_energy: impact.carnot_energy,
            void: false,
        };
        self.history.file(world, slots, before, happened);
        for id in pair {
            world.wrap_anchor(id);
        }
        let probes = pair.map(|id| self.update(world, id));
        let too_early = self.search::<2, VECTORS>(world, &probes)?;
        if !too_early.is_empty() {
            self.put_right(world, too_early)?;
        }
        Ok(())
    }

    /// Enters what the probes will meet, and registers them; what they show to have been taken too early.
    #[inline(always)]
    fn search<const K: usize, const VECTORS: bool>(
        &mut self,
        world: &World,
        probes: &[Probe; K],
    ) -> Result<Vec<TakeBack>, Untileable> {
        if probes.iter().any(|probe| self.is_too_fast(probe)) {
            return Err(Untileable);
        }
        let mut too_early = Vec::new();
        let mut tie = false;
        let mut entries = 0;
        let (agenda, history, space) = (&mut self.agenda, &self.history, &self.space);
        let anchor = |slot: u32| &space.anchors[slot as usize];
        let push = |entry: Due, probe: &Probe, slot| {
            // Two who overlap where the later path begins have met before, as will be found out.
            if exact::begins_with_overlap(world, anchor(probe.slot), anchor(slot), entry.0.time) {
                return;
            }
            entries += 1;
            agenda.push_in_tile(entry, usize::from(space.tile(probe, entry.0.time)));
        };
        let ahead = |probe: &Probe, slot: u32| {
            let (own, id) = (anchor(probe.slot), space.ids[probe.slot as usize]);
            // The earliest contact with a path of the past, before its end.
            let mut first: Option<i64> = None;
            history.since(slot, own.time, |past, ended| {
                if ended.time == own.time && ended.pair.contains(&id) {
                    return; // The collision that both paths began with.
                }
                let Some(time) = exact::contact::<F>(world, own, past) else { return };
                if time > ended.time || exact::begins_with_overlap(world, own, past, time) {
                    return;
                }
                tie |= time == ended.time;
                first = Some(first.map_or(time, |first| first.min(time)));
            });
            if let Some(time) = first {
                too_early.push((slot, time, false));
            }
        };
        space.predict::<false, VECTORS>(world, probes, &mut self.scratch, push, ahead);
        for probe in probes {
            self.register(probe);
        }
        self.scratch.work.entries += entries;
        if tie { Err(Untileable) } else { Ok(too_early) }
    }

    /// Takes back what has happened too early, and all that followed from it; then searches for those concerned again.
    #[cold]
    #[inline(never)]
    fn put_right(&mut self, world: &mut World, mut back: Vec<TakeBack>) -> Result<(), Untileable> {
        let mut again: Vec<u32> = Vec::new();
        loop {
            while let Some((slot, time, inclusive)) = back.pop() {
                let slot_of = &self.slot_of;
                let partner = |id: u32, time: i64| back.push((slot_of[id as usize], time, true));
                if self.history.take_back(world, slot, time, inclusive, partner)? && !again.contains(&slot) {
                    again.push(slot);
                }
            }
            let Some(slot) = again.pop() else { return Ok(()) };
            // The others, too: each is to be found where it is now.
            for &other in &again {
                self.restore(world, other);
            }
            let probe = self.restore(world, slot);
            // There are so few of these that the portable filter will do.
            back = self.search::<1, false>(world, &[probe])?;
        }
    }

    /// Puts a particle back on an older path; how it is looked from the start of that path, or of the window.
    fn restore(&mut self, world: &World, slot: u32) -> Probe {
        let id = self.space.ids[slot as usize];
        let particle = world.particles[id as usize];
        if particle.time >= self.begin {
            return self.update(world, id);
        }
        let axes = &self.space.cells.axes;
        let (position, velocity) = world.flight::<F>(id, self.begin);
        let (position, step) = (position.to_array(), self.step);
        self.space.anchors[slot as usize] = particle;
        let record = &mut self.space.records[slot as usize];
        *record = Record {
            x: [0, 1, 2].map(|axis| axes.coordinate(axis, position[axis])),
            v: velocity.to_array().map(|v| (v * step) as f32),
            since: BEFORE,
            ..*record
        };
        Probe { slot, record: *record, place: record.x, from: 0.0 }
    }

    /// Books the events of a window, and shows them in the order of time.
    fn file_events(
        &self,
        state: &mut State,
        observer: &mut dyn Observer,
        rows: Option<Vec<EventRecord>>,
    ) -> Result<(), Untileable> {
        let events = &self.history.events;
        if let Some(rows) = rows {
            let valid = |k: &u32| !events[*k as usize].void;
            let mut order: Vec<u32> = (0..events.len() as u32).filter(valid).collect();
            order.sort_unstable_by_key(|&k| (events[k as usize].time, events[k as usize].pair));
            // What is simultaneous may yet have an order.
            if order.windows(2).any(|two| events[two[0] as usize].time == events[two[1] as usize].time) {
                return Err(Untileable);
            }
            for k in order {
                observer.event(&rows[k as usize]);
            }
        }
        for event in events.iter().filter(|event| !event.void) {
            let now = state.world.clock.time(event.time);
            state.book.add_collision(now, event.virial, event.energy_loss, event.carnot_energy);
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests;
