//! A long run's observables while it goes on: a line for a sample, at most some a second.

use std::time::{Duration, Instant};

use haff_engine::Sample;

/// Shortest time between two lines: nobody reads faster.
const PAUSE: Duration = Duration::from_millis(500);

/// The columns of [`Watch::line`].
pub const HEAD: &str = "          time     collisions    temperature  ledger residual    collisions/s";

/// Makes lines of samples.
pub struct Watch {
    /// When the last line was made, and the collisions it told.
    last: Option<(Instant, u64)>,
}

impl Watch {
    pub fn new() -> Self {
        Self { last: None }
    }

    /// The sample as a line; `None` if the last one is too recent.
    pub fn line(&mut self, sample: &Sample) -> Option<String> {
        self.line_at(sample, Instant::now())
    }

    fn line_at(&mut self, sample: &Sample, now: Instant) -> Option<String> {
        let rate = match self.last {
            Some((before, _)) if now.duration_since(before) < PAUSE => return None,
            Some((before, collisions)) => {
                let done = sample.collisions.saturating_sub(collisions);
                format!("{:.3e}", done as f64 / now.duration_since(before).as_secs_f64())
            }
            None => "–".to_owned(),
        };
        self.last = Some((now, sample.collisions));
        Some(format!(
            "{:>14.6} {:>14} {:>14.6e} {:>16.1e} {rate:>15}",
            sample.time, sample.collisions, sample.temperature, sample.ledger.residual
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_tell_the_rate_since_the_last_and_do_not_flood() {
        let mut watch = Watch::new();
        let start = Instant::now();
        let sample = |collisions| Sample { time: 1.5, collisions, temperature: 0.25, ..Sample::default() };
        let first = watch.line_at(&sample(100), start).unwrap();
        assert!(first.ends_with('–') && first.contains("1.500000") && first.contains("2.5"), "{first}");
        assert_eq!(watch.line_at(&sample(200), start + PAUSE / 2), None);
        let next = watch.line_at(&sample(1100), start + 2 * PAUSE).unwrap();
        assert!(next.ends_with("1.000e3"), "1000 collisions in a second: {next}");
        assert_eq!(HEAD.chars().count(), next.chars().count(), "{HEAD}\n{next}");
    }
}
