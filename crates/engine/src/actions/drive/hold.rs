//! A thermostat for particles that are heated ever faster: the work of a compression near jamming grows
//! with the pressure, without bound in a finite time.

use haff_neighbors::Geometry;

use crate::{actions::timed::TimedAction, numerics::error::EngineError, report::Observer, state::State};

use super::{driven::Driven, rescale::rescale};

/// Change of the temperature between two actions, as its logarithm, that the intervals aim at.
const CHANGE: f64 = 0.2;
/// The first interval, as a part of the longest: a run can start close to jamming, where heating is fast, and
/// particles that are heated without bound would never reach the time of the next action.
const FIRST: f64 = 1e-6;
/// Factors by which an interval can differ from the one before.
const FACTORS: (f64, f64) = (0.25, 2.0);

/// Rescales velocities to a temperature, at intervals that follow the heating.
#[derive(Debug)]
pub(super) struct Hold {
    name: String,
    driven: Driven,
    temperature: f64,
    /// The longest interval [time].
    longest: f64,
    /// The present interval and the time of the next action \[time\].
    interval: f64,
    next: f64,
}

impl Hold {
    pub fn new(index: usize, driven: Driven, temperature: f64, longest: f64) -> Self {
        let name = format!("drive.{index}");
        let first = FIRST * longest;
        Self { name, driven, temperature, longest, interval: first, next: first }
    }
}

impl TimedAction for Hold {
    fn next(&self, state: &State) -> i64 {
        state.world.clock.ticks(self.next)
    }

    fn apply(
        &mut self,
        state: &mut State,
        _geometry: &Geometry,
        observer: &mut dyn Observer,
    ) -> Result<Vec<u32>, EngineError> {
        let factor = rescale(&self.driven, self.temperature, state, observer)?;
        // Of the temperature before; none without relative motion.
        let change = factor.map_or(0.0, |factor| 2.0 * libm::log(factor).abs());
        self.interval = (self.interval * (CHANGE / change).clamp(FACTORS.0, FACTORS.1)).min(self.longest);
        self.next += self.interval;
        // The clock may be too coarse for the interval.
        while state.world.clock.ticks(self.next) <= state.world.now {
            self.interval *= 2.0;
            self.next += self.interval;
        }
        Ok(if factor.is_some() { self.driven.particles.clone() } else { Vec::new() })
    }

    fn save(&self, put: &mut dyn FnMut(&str, u64)) {
        put(&format!("{}.interval", self.name), self.interval.to_bits());
        put(&format!("{}.next", self.name), self.next.to_bits());
    }

    fn load(&mut self, take: &mut dyn FnMut(&str) -> u64, time: f64) -> Result<(), EngineError> {
        self.interval = f64::from_bits(take(&format!("{}.interval", self.name)));
        self.next = f64::from_bits(take(&format!("{}.next", self.name)));
        let latest = time + self.longest * (1.0 + 1e-12);
        if self.interval > 0.0
            && self.interval <= self.longest
            && (time * (1.0 - 1e-15)..=latest).contains(&self.next)
        {
            return Ok(());
        }
        Err(EngineError::Checkpoint(format!(
            "{}.next = {} must be between the time {time} and {latest}, and its interval {} at most {}",
            self.name, self.next, self.interval, self.longest
        )))
    }
}
