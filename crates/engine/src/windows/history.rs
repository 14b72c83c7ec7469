/*!
What has happened in a window whose events are not taken in the order of time: it can be taken back.

For every particle there is a stack of the paths that its events have ended. A path is in force from the event that began it
to the one that ended it, so it can be said whom a particle would have met *before* an event that has been taken too early.
*/

use super::filter::Record;
use crate::particles::{Anchor, Particle, World};

/// No path; the end of a stack.
const NONE: u32 = u32::MAX;

/// A path that has been ended by an event.
#[derive(Debug, Clone, Copy)]
struct Past {
    anchor: Anchor,
    image: [i32; 3],
    /// The one before it.
    below: u32,
    /// The event that ended it.
    event: u32,
    id: u32,
}

/// A collision that has been taken.
#[derive(Debug, Clone, Copy)]
pub(super) struct Happened {
    pub time: i64,
    /// The lesser first.
    pub pair: [u32; 2],
    /// Its J |r₁₂|, energy loss and Carnot energy.
    pub virial: f64,
    pub energy_loss: f64,
    pub carnot_energy: f64,
    /// Taken back.
    pub void: bool,
}

/// What happened to a particle: its latest past path, and the greatest count it has had, 0 if it has had no event.
#[derive(Debug, Clone, Copy)]
struct Latest {
    past: u32,
    count: u32,
}

/// What an entry of the agenda turns out to be.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Standing {
    /// Both are on the paths that it was made for.
    Due,
    /// Somebody's path had ended before.
    Void,
    /// Both paths were in force, but somebody has gone on too early.
    Missed,
    /// Something else happened in the same tick.
    Tie,
}

/// Two events of one particle in one tick: too much for this kind of bookkeeping.
#[derive(Debug)]
pub(super) struct Tie;

/// See the [module's page](self).
#[derive(Debug, Default)]
pub(super) struct History {
    latest: Vec<Latest>,
    past: Vec<Past>,
    pub events: Vec<Happened>,
    /// Events that are not void.
    pub valid: usize,
}

impl History {
    /// Forgets everything; there are `count` slots.
    pub fn clear(&mut self, count: usize) {
        self.latest.clear();
        self.latest.resize(count, Latest { past: NONE, count: 0 });
        self.past.clear();
        self.events.clear();
        self.valid = 0;
    }

    /// Files a collision of the particles in these slots that has just been resolved; `before` are anchors and images until then. Gives
    /// the particles counts that they have never had.
    #[inline(always)]
    pub fn file(
        &mut self,
        world: &mut World,
        slots: [u32; 2],
        before: [(Particle, [i32; 3]); 2],
        happened: Happened,
    ) {
        let event = self.events.len() as u32;
        for k in 0..2 {
            let id = happened.pair[k];
            let latest = &mut self.latest[slots[k] as usize];
            let (anchor, image) = before[k];
            let past = Past { anchor: anchor.into(), image, below: latest.past, event, id };
            latest.past = self.past.len() as u32;
            let particle = &mut world.particles[id as usize];
            if latest.count != 0 {
                particle.count = latest.count.wrapping_add(1);
            }
            latest.count = particle.count;
            self.past.push(past);
        }
        self.events.push(happened);
        self.valid += 1;
    }

    /// When the present path of a slot began, if that was in this window.
    #[inline(always)]
    fn began(&self, slot: u32) -> Option<&Happened> {
        let past = self.latest[slot as usize].past;
        (past != NONE).then(|| &self.events[self.past[past as usize].event as usize])
    }

    /// What an entry is whose counts are not those of now: `counts` are those of the entry and `now` the present ones.
    #[inline]
    pub fn standing(
        &self,
        time: i64,
        pair: [u32; 2],
        slots: [u32; 2],
        counts: [u32; 2],
        now: [u32; 2],
    ) -> Standing {
        for k in 0..2 {
            let mut count = now[k];
            let mut past = self.latest[slots[k] as usize].past;
            while past != NONE {
                let Past { anchor, below, event, .. } = &self.past[past as usize];
                let ended = &self.events[*event as usize];
                if ended.time < time {
                    break;
                }
                if ended.time == time {
                    return if ended.pair == pair { Standing::Void } else { Standing::Tie };
                }
                count = anchor.count;
                past = *below;
            }
            if count != counts[k] {
                return Standing::Void;
            }
        }
        Standing::Missed
    }

    /// Visits the past paths of a slot that ended at or after `time`, the latest first: anchor, and the event that ended it.
    pub fn since(&self, slot: u32, time: i64, mut visit: impl FnMut(&Particle, &Happened)) {
        let mut past = self.latest[slot as usize].past;
        while past != NONE {
            let Past { anchor, below, event, .. } = &self.past[past as usize];
            let ended = &self.events[*event as usize];
            if ended.time < time {
                break;
            }
            visit(&Particle::from(*anchor), ended);
            past = *below;
        }
    }

    /// Takes back what happened to a slot after `time`, and at it if `inclusive`; `partner` is told the partner of each event that
    /// becomes void by that, and its time. Whether the particle has got an older path back.
    pub fn take_back(
        &mut self,
        world: &mut World,
        slot: u32,
        time: i64,
        inclusive: bool,
        mut partner: impl FnMut(u32, i64),
    ) -> Result<bool, Tie> {
        let mut changed = false;
        while let Some(&Happened { time: began, pair, void, .. }) = self.began(slot) {
            if began < time {
                break;
            }
            if began == time && !inclusive {
                return Err(Tie);
            }
            let latest = &mut self.latest[slot as usize];
            let Past { anchor, image, below, event, id } = self.past[latest.past as usize];
            latest.past = below;
            world.particles[id as usize] = anchor.into();
            world.images[id as usize] = image;
            if !void {
                self.events[event as usize].void = true;
                self.valid -= 1;
                partner(if pair[0] == id { pair[1] } else { pair[0] }, began);
            }
            changed = true;
        }
        Ok(changed)
    }

    /// Takes everything back.
    pub fn undo(&mut self, world: &mut World) {
        for past in self.past.iter().rev() {
            world.particles[past.id as usize] = past.anchor.into();
            world.images[past.id as usize] = past.image;
        }
        self.past.clear();
        self.events.clear();
        self.valid = 0;
    }
}

/// Whether a record's path began at or after `from`, a part of the window.
#[inline(always)]
pub(super) fn is_ahead(record: &Record, from: f32) -> bool {
    record.since >= from
}
