//! The time of the last contact of each particle, for laws that depend on it: the TC model and contacts that
//! can come to rest. Anchors do not tell it, because drives, changes from outside and long flights set them,
//! too.

use haff_neighbors::Array;

use crate::{
    model::{System, thresholds::Thresholds},
    numerics::{
        clock::Clock,
        error::EngineError,
        words::{Words, fault},
    },
};

/// At the start of an epoch, an older contact gets this age \[ticks\].
const OLDEST: i64 = 1 << 61;
/// The time of a particle without contacts so far [ticks].
const NEVER: i64 = i64::MIN;

/// The time of the last contact of each particle with another particle or with a wall \[ticks\].
#[derive(Debug, Clone)]
pub(crate) struct ContactTimes(Array<i64>);

impl ContactTimes {
    /// The times of a system without contacts so far; `None` if no law depends on them. The system must still
    /// have its bodies.
    pub fn of(system: &System) -> Option<Self> {
        let is_needed = system.contacts.tc > 0.0 || Thresholds::of(system).is_some();
        is_needed.then(|| Self(vec![NEVER; system.bodies.len()].into()))
    }

    /// The same without particles.
    pub fn without_particles() -> Self {
        Self(Array::default())
    }

    /// Another owner of the same times.
    ///
    /// # Safety
    ///
    /// As for [`Array::alias`].
    pub unsafe fn alias(&mut self) -> Self {
        // SAFETY: guaranteed by the caller.
        Self(unsafe { self.0.alias() })
    }

    /// The time of the last contact of particle i \[ticks\], as [`Self::set`] takes it.
    pub fn get(&self, i: u32) -> i64 {
        self.0[i as usize]
    }

    /// Sets the time of the last contact of particle i \[ticks\].
    #[inline(always)]
    pub fn set(&mut self, i: u32, time: i64) {
        self.0[i as usize] = time;
    }

    /// Time since the last contact of particle i \[time\]; infinite without contacts so far.
    #[inline]
    pub fn age(&self, i: u32, clock: &Clock, ticks: i64) -> f64 {
        match self.0[i as usize] {
            NEVER => f64::INFINITY,
            time => clock.duration(time, ticks),
        }
    }

    /// Replaces the times by those that `replace` makes of them and of that of a particle without contacts.
    pub fn replace(&mut self, replace: impl FnOnce(&[i64], i64) -> Vec<i64>) {
        self.0 = replace(&self.0, NEVER).into();
    }

    /// Takes over the times of particles in another world, whose present `from` is the present `to` of this
    /// one, each a clock and ticks. `particles`: the indices there of the first particles here.
    pub fn take_over(
        &mut self,
        other: &Self,
        particles: &[u32],
        (from, then): (&Clock, i64),
        (to, now): (&Clock, i64),
    ) {
        for (time, &i) in self.0.iter_mut().zip(particles) {
            *time = match other.get(i) {
                NEVER => NEVER,
                contact => now - in_ticks(contact, then, from, to),
            };
        }
    }

    /// Starts the next epoch, whose clock is `to`, at the tick `now` of the present one.
    pub fn start_epoch(&mut self, now: i64, from: &Clock, to: &Clock) {
        for time in self.0.iter_mut().filter(|time| **time != NEVER) {
            // Times since a contact do not change: they are rounded only if the tick does.
            *time = if from.exponent == to.exponent && to.drag.is_none() {
                (*time - now).max(-OLDEST)
            } else {
                -in_ticks(*time, now, from, to)
            };
        }
    }

    /// Saves the times for a resumed run.
    pub fn save(&self, words: &mut Vec<u64>) {
        words.extend(self.0.iter().map(|&time| time as u64));
    }

    /// Loads what [`Self::save`] has saved, in a run that is resumed at `now` \[ticks\].
    pub fn load(&mut self, words: &mut Words, now: i64) -> Result<(), EngineError> {
        for time in self.0.iter_mut() {
            *time = words.integer()?;
            if *time != NEVER && !(-OLDEST..=now).contains(time) {
                let what = format!("the time {time} of a contact must be in [{}, {now}] ticks", -OLDEST);
                return Err(fault(&what));
            }
        }
        Ok(())
    }
}

/// The duration between two times in ticks of `from` as one in ticks of `to` before the start of an epoch,
/// not longer than [`OLDEST`].
fn in_ticks(contact: i64, then: i64, from: &Clock, to: &Clock) -> i64 {
    let ticks = if from.drag.is_none() && to.drag.is_none() {
        (then - contact) as f64 * (from.tick / to.tick)
    } else {
        to.ticks_back(from.duration(contact, then))
    };
    ticks.min(OLDEST as f64).floor() as i64
}
