//! The entries of one tick, if there are several.
//!
//! A box in which everything starts alike can have as many of them as particles: a lattice of balls that
//! falls on a floor. So an event may cost no more than the entries that it changes, and the logarithm of all.

use std::{
    cmp::Reverse,
    collections::{BinaryHeap, HashMap},
};

use crate::{search::entry::Entry, state::world::World};

type Rank = (u32, u32, u32);

/// Entries of one tick, by rank.
pub(crate) struct Ties<K> {
    /// The lowest rank first, with entries that are invalid or have been replaced.
    entries: BinaryHeap<Reverse<(Rank, Entry<K>)>>,
    /// For each partner its event counter, and the entries with it. The order of the map is not used.
    by_partner: HashMap<u32, (u32, Vec<Entry<K>>)>,
    /// Bodies that may have had an event since their partners were looked at.
    changed: Vec<u32>,
    /// The entry that was returned last. It needs no other one: the event gives its bodies new ones.
    taken: Option<Entry<K>>,
}

impl<K> Ties<K> {
    pub fn new() -> Self {
        Self { entries: BinaryHeap::new(), by_partner: HashMap::new(), changed: Vec::new(), taken: None }
    }

    /// Their time; `None` if there are none.
    #[inline(always)]
    pub fn time(&self) -> Option<i64> {
        self.entries.peek().map(|Reverse((_, entry))| entry.time)
    }

    #[inline(always)]
    pub fn is_empty(&self) -> bool {
        self.entries.is_empty()
    }

    pub fn clear(&mut self) {
        self.entries.clear();
        self.by_partner.clear();
        self.changed.clear();
        self.taken = None;
    }

    /// Adds an entry whose partner has had no event since the prediction.
    pub fn push(&mut self, entry: Entry<K>) {
        if let Some(partner) = entry.target.partner() {
            let (count, entries) =
                self.by_partner.entry(partner).or_insert((entry.partner_count, Vec::new()));
            debug_assert_eq!(*count, entry.partner_count, "the partner has had an event in between");
            entries.push(entry);
        }
        self.entries.push(Reverse((entry.rank(), entry)));
    }

    /// Notes bodies that may have had an event, besides those of the entries that [`Self::pop`] has returned.
    pub fn note(&mut self, bodies: &[u32]) {
        if !self.entries.is_empty() {
            self.changed.extend_from_slice(bodies);
        }
    }

    /// Takes out the entries that must be replaced, because their partners have had an event.
    pub fn take_outdated(&mut self, world: &World) -> Vec<Entry<K>> {
        let mut outdated = Vec::new();
        for body in self.changed.drain(..) {
            let count = world.particles[body as usize].count;
            if self.by_partner.get(&body).is_some_and(|(before, _)| *before != count)
                && let Some((_, entries)) = self.by_partner.remove(&body)
            {
                let is_left = |entry: &Entry<K>| self.taken != Some(*entry) && is_valid(world, entry);
                outdated.extend(entries.into_iter().filter(is_left));
            }
        }
        outdated
    }

    /// Removes and returns the valid entry of lowest rank, and counts those that are `dropped`.
    pub fn pop(&mut self, world: &World, dropped: &mut u64) -> Option<Entry<K>> {
        while let Some(Reverse((_, entry))) = self.entries.pop() {
            if !is_valid(world, &entry) {
                *dropped += 1;
            } else if self.is_present(&entry) {
                if self.entries.is_empty() {
                    self.clear();
                } else {
                    self.changed.push(entry.owner);
                    self.changed.extend(entry.target.partner());
                    self.taken = Some(entry);
                }
                return Some(entry);
            }
        }
        self.clear();
        None
    }

    /// Moves the entries that have not been replaced to `entries`, invalid ones too.
    pub fn take(&mut self, entries: &mut Vec<Entry<K>>) {
        let all = std::mem::take(&mut self.entries).into_vec();
        entries
            .extend(all.into_iter().map(|Reverse((_, entry))| entry).filter(|entry| self.is_present(entry)));
        self.clear();
    }

    /// Whether an entry has not been replaced.
    fn is_present(&self, entry: &Entry<K>) -> bool {
        entry.target.partner().is_none_or(|partner| {
            self.by_partner.get(&partner).is_some_and(|(count, _)| *count == entry.partner_count)
        })
    }
}

/// Whether the particle of an entry has had no event since.
pub(crate) fn is_valid<K>(world: &World, entry: &Entry<K>) -> bool {
    world.particles[entry.owner as usize].count == entry.own_count
}

#[cfg(test)]
mod tests {
    use glam::DVec3;
    use haff_testing::Random;

    use super::*;
    use crate::{
        search::{blocks::tests::gas, entry::Target, search_event::SearchEvent},
        state::{particle::Particle, world::World},
    };

    /// An entry that its particle and its partner, if it has one, would have now.
    fn entry(world: &World, owner: u32, kind: SearchEvent) -> Entry<SearchEvent> {
        let count = |i: u32| world.particles[i as usize].count;
        let target = Target::new(kind);
        let partner_count = target.partner().map_or(0, count);
        Entry { time: 5, owner, target, own_count: count(owner), partner_count }
    }

    /// Ties beside a list that is searched anew for each event.
    #[test]
    fn entries_come_by_rank_and_are_replaced_once_their_partners_have_changed() {
        let mut random = Random(3);
        let mut replaced = 0;
        for _ in 0..200 {
            let mut world = World::new(&gas(), 0);
            let count = 30;
            let (mut ties, mut plain) = (Ties::new(), Vec::new());
            for i in 0..count {
                let j = random.index(count as usize) as u32;
                let kind = if j == i { SearchEvent::Prediction } else { SearchEvent::Collision(j) };
                ties.push(entry(&world, i, kind));
                plain.push(entry(&world, i, kind));
            }
            let mut dropped = 0;
            loop {
                let outdated = ties.take_outdated(&world);
                let is_outdated = |entry: &Entry<SearchEvent>| {
                    entry
                        .target
                        .partner()
                        .is_some_and(|j| world.particles[j as usize].count != entry.partner_count)
                };
                plain.retain(|entry| is_valid(&world, entry));
                let mut expected: Vec<u32> =
                    plain.extract_if(.., |entry| is_outdated(entry)).map(|entry| entry.owner).collect();
                let mut found: Vec<u32> = outdated.iter().map(|entry| entry.owner).collect();
                expected.sort_unstable();
                found.sort_unstable();
                assert_eq!(found, expected);
                replaced += found.len();
                for owner in found {
                    // Half of them have a contact in this tick again.
                    if random.index(2) == 0 {
                        let other = SearchEvent::Collision((owner + 1) % count);
                        ties.push(entry(&world, owner, other));
                        plain.push(entry(&world, owner, other));
                    }
                }
                plain.sort_by_key(|entry| (entry.rank(), *entry));
                let next = ties.pop(&world, &mut dropped);
                assert_eq!(next, (!plain.is_empty()).then(|| plain.remove(0)));
                let Some(next) = next else { break };
                // Body 0 has infinite mass: its counter stays.
                for body in [Some(next.owner), next.target.partner()].into_iter().flatten().filter(|&i| i > 0)
                {
                    let Particle { position, velocity, .. } = world.particles[body as usize];
                    world.particles[body as usize].set_anchor(position, velocity + DVec3::X, 5);
                }
            }
            assert!(ties.is_empty());
        }
        assert!(replaced > 1000, "{replaced}");
    }
}
