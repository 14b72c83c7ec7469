//! Times of records: k·Δ, a geometric series, or numbers of collisions.

use haff_scene::Schedule;

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
