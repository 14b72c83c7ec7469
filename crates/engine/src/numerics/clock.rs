/*!
Time as integer ticks, so that its resolution does not depend on the length of a run.

The length of a tick is a power of two, so short that the displacement of the fastest particle in one tick is
below the rounding error of a coordinate. Ticks count from the start of the present *epoch*, which lasts
[`EPOCH`] ticks. At its end [`EPOCH`] is subtracted from all times, which is exact. The duration between two
times is a difference of integers, and is rounded only once, when it is converted to `f64`.

Time is an integer: ticks of 2^k time units, so fine that the fastest particle's displacement in one is below
the rounding of a coordinate. After 2^60 ticks an *epoch* ends: 2^60 is subtracted everywhere, which is
exact; anchors older than 2^62 ticks are moved along their flight to the present; and if the system has become
four times slower or faster, the tick is changed with it, and all anchors are moved. An impact that would make
a particle too fast for the tick (`World::is_resolved`) ends the epoch before it. All of that depends on the
trajectory alone. Then the scheduler is rebuilt. The anchor's time is that of any own event; laws that depend
on the last contact (`tc`, rest) have `contact_times`, data of their own.

Under a linear drag, dv/dt = −v/τ, ticks are those of the transformed time s = τ (1 − e^(−t/τ)) since the
start of the epoch, in which all flights are straight ([`haff_mechanics::drag`]): a search needs nothing more.
Velocities of anchors are those that the particles would have at the start of the epoch, v e^(t/τ)
([`Clock::decay`]). An epoch ends at s = τ/2 at the latest, and all anchors then move to the present.
*/

use haff_mechanics::drag::{flight_time, transformed_time};

use crate::numerics::instant::Instant;

/// Length of an epoch [ticks]: about 64 times the time in which the fastest particle crosses the system.
pub(crate) const EPOCH: i64 = 1 << 60;
/// At the end of an epoch, older anchors than this are moved to the present \[ticks\].
pub(crate) const OLDEST_ANCHOR: i64 = 1 << 62;
/// An event later than this from now is not entered; the particle is predicted again at this time [ticks].
pub(crate) const HORIZON: f64 = (1_u64 << 60) as f64;
/// Longest duration from an anchor to an event \[ticks\]. It exceeds [`HORIZON`], because an anchor may be
/// older than an epoch. Its sum with the time of an anchor stays below 2^63.
pub(crate) const LONGEST: f64 = ((1_u64 << 62) + (1_u64 << 61)) as f64;
/// Under a drag, times that are not later than so many ticks before the start of an epoch are at its start:
/// the logarithms and exponentials of both epochs are rounded.
const DRAG_NOISE: f64 = 4096.0;
/// log₂ of the number of ticks in which the fastest particle crosses the system.
const TICKS_PER_CROSSING: i32 = 54;

/// Converts between ticks and time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Clock {
    /// log₂ of the tick [time].
    pub exponent: i32,
    /// Length of a tick [time], a power of two.
    pub tick: f64,
    /// Ticks per time.
    pub per_time: f64,
    /// Start of the epoch [time]; `base_low` is its rounding error.
    pub base: f64,
    pub base_low: f64,
    /// The time that was shown last when the epoch started: none shown later is before it \[time\].
    pub earliest: f64,
    /// Time constant τ of a drag \[time\]: ticks are then of transformed time.
    pub drag: Option<f64>,
}

impl Clock {
    /// A clock at time 0 with ticks of length 2^`exponent`.
    pub fn new(exponent: i32) -> Self {
        let exponent = exponent.clamp(-1000, 900);
        Self {
            exponent,
            tick: power_of_two(exponent),
            per_time: power_of_two(-exponent),
            base: 0.0,
            base_low: 0.0,
            earliest: 0.0,
            drag: None,
        }
    }

    /// The exponent of the tick for a system of this extent and largest speed.
    pub fn exponent_for(extent: f64, speed: f64) -> i32 {
        let crossing = if speed > 0.0 { extent / speed } else { 1.0 };
        exponent_of(crossing) - TICKS_PER_CROSSING
    }

    /// Time at `ticks`, without rounding.
    pub fn instant(&self, ticks: i64) -> Instant {
        // Each half of the ticks is a number without rounding.
        let (upper, lower) = (ticks >> 32 << 32, ticks & 0xffff_ffff);
        let start = Instant { high: self.base, low: self.base_low };
        if let Some(drag) = self.drag {
            return start.after(flight_time(ticks as f64 * self.tick, drag));
        }
        start.after(upper as f64 * self.tick).after(lower as f64 * self.tick)
    }

    /// Time at `ticks`, rounded. States of walls are computed with it, also at anchors before the epoch.
    #[inline]
    pub fn time(&self, ticks: i64) -> f64 {
        if let Some(drag) = self.drag {
            return self.damped_time(ticks, drag);
        }
        self.straight_time(ticks)
    }

    /// [`Self::time`] where there is no drag.
    #[inline(always)]
    pub fn straight_time(&self, ticks: i64) -> f64 {
        self.base + (ticks as f64 * self.tick + self.base_low)
    }

    #[cold]
    fn damped_time(&self, ticks: i64, drag: f64) -> f64 {
        self.base + (flight_time(ticks as f64 * self.tick, drag) + self.base_low)
    }

    /// The part e^(−t/τ) = 1 − s/τ that a drag has left of velocities at `ticks` since the start of the
    /// epoch; 1 without drag.
    #[inline]
    pub fn decay(&self, ticks: i64) -> f64 {
        self.drag.map_or(1.0, |drag| 1.0 - ticks as f64 * self.tick / drag)
    }

    /// Transformed time from the start of the epoch to an instant \[time\]; 0 for one before it.
    pub fn transformed(&self, instant: Instant) -> f64 {
        let duration = instant.since(Instant { high: self.base, low: self.base_low });
        match self.drag {
            Some(drag) if duration > 0.0 => transformed_time(duration, drag),
            _ => duration.max(0.0),
        }
    }

    /// Duration between two times \[ticks\], the later one last \[time\].
    #[inline]
    pub fn duration(&self, from: i64, to: i64) -> f64 {
        if self.drag.is_some() {
            return self.instant(to).since(self.instant(from));
        }
        (to - from) as f64 * self.tick
    }

    /// How long before the start of the epoch a `duration` \[time\] began \[ticks\].
    pub fn ticks_back(&self, duration: f64) -> f64 {
        let transformed = self.drag.map_or(duration, |drag| -transformed_time(-duration, drag));
        transformed * self.per_time
    }

    /// When an epoch must end because of a drag, at s = τ/2 \[ticks\].
    pub fn horizon_of_drag(&self) -> i64 {
        self.drag.map_or(i64::MAX, |drag| (0.5 * drag * self.per_time) as i64)
    }

    /// Time at `ticks` as it stands in rows of events, frames and sums: of two, the later is not shown as the
    /// earlier one. [`Self::time`] rounds twice, and can be an ulp above the start of the next epoch; and a
    /// contact at the start of an epoch can be predicted again a few ticks before it.
    #[inline]
    pub fn shown(&self, ticks: i64) -> f64 {
        self.time(ticks).max(self.earliest)
    }

    /// The tick nearest to a time, limited to ±2^62.
    pub fn ticks(&self, time: f64) -> i64 {
        const FAR: f64 = (1_u64 << 62) as f64;
        if let Some(drag) = self.drag {
            let transformed = transformed_time((time - self.base) - self.base_low, drag);
            let ticks = (transformed * self.per_time).round_ties_even().clamp(-FAR, FAR);
            return if ticks >= -DRAG_NOISE { ticks.max(0.0) as i64 } else { ticks as i64 };
        }
        (((time - self.base) - self.base_low) * self.per_time).round_ties_even().clamp(-FAR, FAR) as i64
    }

    /// Starts the next epoch at `now` \[ticks\], usually [`EPOCH`].
    pub fn start_epoch(&mut self, now: i64) {
        self.earliest = self.shown(now);
        if now != EPOCH || self.drag.is_some() {
            let start = self.instant(now);
            (self.base, self.base_low) = (start.high, start.low);
            return;
        }
        let step = EPOCH as f64 * self.tick;
        let sum = self.base + step;
        // Two-sum: exact up to a base of 2^53 epochs, and compensated beyond.
        let part = sum - self.base;
        self.base_low += (self.base - (sum - part)) + (step - part);
        self.base = sum;
    }

    /// The same clock with another length of a tick.
    pub fn with_exponent(&self, exponent: i32) -> Self {
        let Self { exponent, tick, per_time, .. } = Self::new(exponent);
        Self { exponent, tick, per_time, ..*self }
    }

    /// A clock with another length of a tick, of which a new epoch starts at `now` \[ticks of this clock\].
    pub fn restarted(&self, now: i64, exponent: i32) -> Self {
        let start = self.instant(now);
        let earliest = self.shown(now);
        Self { base: start.high, base_low: start.low, earliest, ..self.with_exponent(exponent) }
    }
}

/// Rounds a duration in [0, [`LONGEST`]] to whole ticks.
#[inline(always)]
pub(crate) fn whole(ticks: f64) -> i64 {
    debug_assert!((0.0..=LONGEST).contains(&ticks));
    (ticks + 0.5) as i64
}

/// 2^e for −1022 ≤ e ≤ 1023.
fn power_of_two(exponent: i32) -> f64 {
    f64::from_bits(((exponent + 1023) as u64) << 52)
}

/// ⌊log₂ x⌋ of a positive finite number.
fn exponent_of(x: f64) -> i32 {
    ((x.clamp(1e-290, 1e290).to_bits() >> 52) & 0x7ff) as i32 - 1023
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn epochs_are_exact() {
        let mut clock = Clock::new(-50);
        for _ in 0..1000 {
            clock.start_epoch(EPOCH);
        }
        assert_eq!(clock.time(0), 1000.0 * 1024.0);
        assert_eq!(clock.ticks(clock.time(12_345 << 30)), 12_345 << 30);
        assert_eq!(clock.base_low, 0.0);
    }

    #[test]
    fn times_shown_do_not_go_back_when_an_epoch_starts() {
        let mut random = haff_testing::Random(3);
        let mut rounded_up = 0;
        for _ in 0..100_000 {
            let mut clock = Clock::new(-46);
            clock.base = random.uniform(1.0, 3000.0);
            clock.base_low = 0.5 * f64::EPSILON * random.uniform(-1.0, 1.0);
            let now =
                if random.index(4) == 0 { EPOCH } else { (random.uniform(0.0, 1.0) * EPOCH as f64) as i64 };
            let mut next = clock;
            next.start_epoch(now);
            rounded_up += i32::from(next.time(0) < clock.time(now));
            assert!(next.shown(0) >= clock.shown(now), "{clock:?}, {now}");
            assert!(next.shown(-3) >= clock.shown(now), "{clock:?}, {now}");
            assert!(next.shown(0) <= clock.time(now).max(next.time(0)), "{clock:?}, {now}");
            let restarted = clock.restarted(now, -46);
            assert_eq!(restarted.earliest, next.earliest);
            assert!(now == EPOCH || restarted == next, "{clock:?}, {now}");
        }
        assert!(rounded_up > 100, "{rounded_up}");
    }

    #[test]
    fn times_under_a_drag_go_forward_and_back_to_their_ticks() {
        let mut random = haff_testing::Random(7);
        for _ in 0..100_000 {
            let drag = 10_f64.powf(random.uniform(-3.0, 3.0));
            let exponent = Clock::exponent_for(1.0, (1.0 / drag).max(random.uniform(0.1, 10.0)));
            let mut clock = Clock { drag: Some(drag), ..Clock::new(exponent) };
            clock.base = random.uniform(0.0, 10.0) * drag;
            let last = clock.horizon_of_drag().min(EPOCH);
            let ticks = (random.uniform(0.0, 1.0) * last as f64) as i64;
            assert!(clock.time(ticks) <= clock.time(ticks + 1), "{clock:?} {ticks}");
            // A time is rounded at its own size.
            let rounding = 4.0 * f64::EPSILON * clock.time(ticks).max(drag) * clock.per_time + 1.0;
            assert!((clock.ticks(clock.time(ticks)) - ticks).abs() as f64 <= rounding, "{clock:?} {ticks}");
            let decay = (-(clock.time(ticks) - clock.base) / drag).exp();
            let error = 4.0 * f64::EPSILON * (1.0 + clock.base / drag);
            assert!((clock.decay(ticks) / decay - 1.0).abs() < error, "{clock:?} {ticks}");
            // A time that is due at the end of an epoch is due at the start of the next one.
            let (mut next, due) = (clock, clock.time(ticks));
            let now = clock.ticks(due);
            next.start_epoch(now);
            assert!(next.shown(0) >= clock.shown(now), "{clock:?} {ticks}");
            assert!((0..DRAG_NOISE as i64).contains(&next.ticks(due)), "{clock:?} {ticks}");
        }
    }

    #[test]
    fn a_tick_moves_nothing_by_more_than_rounding() {
        for (extent, speed) in [(1.0, 1.0), (300.0, 5.0), (1e-6, 3e8), (7e5, 1e-9)] {
            let clock = Clock::new(Clock::exponent_for(extent, speed));
            assert!(clock.tick * speed <= extent * 2.0_f64.powi(-54));
            assert!(clock.tick * speed > extent * 2.0_f64.powi(-56));
        }
    }
}
