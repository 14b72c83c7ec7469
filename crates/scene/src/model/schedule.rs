//! Times of records: k·Δ, a geometric series, or numbers of collisions.

use super::scene::Schedule;

/// Iterates over the times of a schedule after 0.
#[derive(Debug, Clone)]
pub struct Times {
    schedule: Schedule,
    step: u64,
}

impl Times {
    /// The times of a schedule later than `after`.
    pub fn after(schedule: Schedule, after: f64) -> Self {
        let step = match schedule {
            Schedule::Off | Schedule::Collisions(_) => 0,
            // An estimate, then corrected by single steps, since k·Δ rounds.
            Schedule::Every(interval) => ((after / interval).floor() - 1.0).max(1.0) as u64,
            Schedule::Log { first, factor } => {
                if after > first {
                    (((after / first).ln() / factor.ln()).floor() - 1.0).max(0.0) as u64
                } else {
                    0
                }
            }
        };
        let mut times = Self { schedule, step };
        while times.next() <= after {
            times.step += 1;
        }
        times
    }

    /// The next time, or ∞.
    pub fn next(&self) -> f64 {
        match self.schedule {
            Schedule::Off | Schedule::Collisions(_) => f64::INFINITY,
            Schedule::Every(interval) => self.step as f64 * interval,
            Schedule::Log { first, factor } => first * factor.powi(self.step.min(i32::MAX as u64) as i32),
        }
    }

    /// The number of collisions of the next record, after one with `done` of them.
    pub fn collisions(&self, done: u64) -> u64 {
        match self.schedule {
            Schedule::Collisions(count) => (done / count + 1).saturating_mul(count),
            _ => u64::MAX,
        }
    }

    /// Whether `time` is the next one; advances if so.
    pub fn take(&mut self, time: f64) -> bool {
        let due = self.next() <= time;
        while self.next() <= time {
            self.step += 1;
        }
        due
    }
}

/// Which records are due.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Due {
    /// A frame.
    pub frame: bool,
    /// A row of observables.
    pub sample: bool,
}

/// The schedules of frames and of rows of observables. A run goes on to the next bound, and asks what is due
/// there.
#[derive(Debug, Clone)]
pub struct Records {
    frames: Times,
    samples: Times,
    /// For which there have been enough collisions: at the end of this instant \[time\].
    counted: Option<(f64, Due)>,
}

impl Records {
    /// Of frames and of rows.
    pub fn new(frames: Times, samples: Times) -> Self {
        Self { frames, samples, counted: None }
    }

    /// The time of the next record, or ∞, and the number of collisions of it, after `done` of them.
    pub fn next(&self, done: u64) -> (f64, u64) {
        let instant = self.counted.map_or(f64::INFINITY, |(time, _)| time);
        let time = self.frames.next().min(self.samples.next()).min(instant);
        (time, self.frames.collisions(done).min(self.samples.collisions(done)))
    }

    /// The run has stopped at a number of collisions: those that ask for records do so at the end of the
    /// instant.
    pub fn count(&mut self, time: f64, before: u64, now: u64) {
        let due = Due {
            frame: now >= self.frames.collisions(before),
            sample: now >= self.samples.collisions(before),
        };
        if due != Due::default() {
            let (_, earlier) = self.counted.unwrap_or_default();
            let due = Due { frame: due.frame || earlier.frame, sample: due.sample || earlier.sample };
            self.counted = Some((time, due));
        }
    }

    /// What is due at a time up to which all events have happened.
    pub fn take(&mut self, time: f64) -> Due {
        let (_, counted) = self.counted.take_if(|(instant, _)| *instant <= time).unwrap_or_default();
        Due {
            frame: self.frames.take(time) || counted.frame,
            sample: self.samples.take(time) || counted.sample,
        }
    }

    /// Whether records are due at the end of this instant: a run that goes on from here would not know of
    /// them.
    pub fn is_pending(&self) -> bool {
        self.counted.is_some()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_are_multiples_of_the_interval_after_zero() {
        let mut times = Times::after(Schedule::Every(0.1), 0.0);
        for k in 1..1000 {
            assert_eq!(times.next(), f64::from(k) * 0.1);
            assert!(times.take(times.next()));
        }
    }

    #[test]
    fn records_by_collisions_are_at_multiples() {
        let times = Times::after(Schedule::Collisions(50), 0.0);
        assert_eq!([0, 49, 50, 51, 120].map(|done| times.collisions(done)), [50, 50, 100, 100, 150]);
        assert_eq!(times.next(), f64::INFINITY);
        assert_eq!(Times::after(Schedule::Every(1.0), 0.0).collisions(3), u64::MAX);
    }

    #[test]
    fn records_of_collisions_are_due_at_the_end_of_their_instant() {
        let times = |schedule| Times::after(schedule, 0.0);
        let mut records = Records::new(times(Schedule::Every(2.0)), times(Schedule::Collisions(10)));
        assert_eq!(records.next(0), (2.0, 10));
        records.count(1.5, 0, 10);
        assert!(records.is_pending());
        assert_eq!(records.next(10), (1.5, 20));
        assert_eq!(records.take(1.5), Due { frame: false, sample: true });
        assert!(!records.is_pending());
        records.count(1.7, 10, 15);
        assert!(!records.is_pending());
        assert_eq!(records.take(2.0), Due { frame: true, sample: false });
    }

    #[test]
    fn resumed_schedule_continues_after_the_last_time() {
        for k in [1_u32, 3, 7, 1000, 123_457] {
            let times = Times::after(Schedule::Every(0.1), f64::from(k) * 0.1);
            assert_eq!(times.next(), f64::from(k + 1) * 0.1);
        }
        let log = Schedule::Log { first: 0.5, factor: 2.0 };
        assert_eq!(Times::after(log, 0.0).next(), 0.5);
        assert_eq!(Times::after(log, 4.0).next(), 8.0);
        assert_eq!(Times::after(Schedule::Off, 3.0).next(), f64::INFINITY);
    }
}
