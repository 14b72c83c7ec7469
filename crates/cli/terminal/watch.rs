//! Observables of a running simulation: a line per sample, at most some a second, no wider than the terminal.

use std::{
    fmt::Display,
    time::{Duration, Instant},
};

use console::Term;
use haff_engine::Sample;

use crate::terminal::screen;

/// Shortest time between two lines.
const PAUSE: Duration = Duration::from_millis(500);

/// Headings and widths of the columns; the last ones are omitted where they do not fit. Three fit into 40.
const COLUMNS: [(&str, usize); 5] =
    [("time", 12), ("collisions", 11), ("temperature", 11), ("ledger residual", 15), ("collisions/s", 12)];

/// Separator of two columns.
const GAP: &str = "  ";

/// Formats samples as lines.
pub struct Watch {
    terminal: Term,
    /// Time of the last line shown, and its number of collisions.
    last: Option<(Instant, u64)>,
    /// Columns of the last line.
    columns: usize,
}

impl Watch {
    /// Lines for a terminal or a file.
    pub fn on(terminal: Term) -> Self {
        Self { terminal, last: None, columns: 0 }
    }

    /// The sample as a line, below a line of headings if it is the first or if the number of columns has
    /// changed; `None` if the last one is too recent.
    pub fn line(&mut self, sample: &Sample) -> Option<String> {
        self.line_at(sample, Instant::now(), screen::width(&self.terminal))
    }

    fn line_at(&mut self, sample: &Sample, now: Instant, width: Option<usize>) -> Option<String> {
        let rate = match self.last {
            Some((before, _)) if now.duration_since(before) < PAUSE => return None,
            Some((before, collisions)) => {
                let done = sample.collisions.saturating_sub(collisions);
                format!("{:.3e}", done as f64 / now.duration_since(before).as_secs_f64())
            }
            None => "–".to_owned(),
        };
        self.last = Some((now, sample.collisions));
        let columns = fitting(width);
        let heads = (columns != self.columns).then(|| row(&COLUMNS.map(|(head, _)| head), columns));
        self.columns = columns;
        let cells = [
            short(format!("{:.6}", sample.time), sample.time, 0),
            short(sample.collisions.to_string(), sample.collisions as f64, 1),
            format!("{:.4e}", sample.temperature),
            format!("{:.1e}", sample.ledger.residual),
            rate,
        ];
        Some(heads.map_or_else(String::new, |heads| heads + "\n") + &row(&cells, columns))
    }
}

/// Number of columns that fit into a width, at least one.
fn fitting(width: Option<usize>) -> usize {
    let Some(width) = width else { return COLUMNS.len() };
    let mut used = 0;
    let fit = COLUMNS.iter().take_while(|(_, column)| {
        used += column + if used > 0 { GAP.len() } else { 0 };
        used <= width
    });
    fit.count().max(1)
}

/// The text of a number, or a shorter form where that is wider than its column.
fn short(text: String, number: f64, column: usize) -> String {
    if text.len() <= COLUMNS[column].1 { text } else { format!("{number:.5e}") }
}

fn row(cells: &[impl Display; COLUMNS.len()], columns: usize) -> String {
    let padded = cells.iter().zip(COLUMNS).take(columns).map(|(cell, (_, width))| format!("{cell:>width$}"));
    padded.collect::<Vec<_>>().join(GAP)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_have_the_rate_since_the_last_line_and_a_minimum_interval() {
        let mut watch = Watch::on(Term::stderr());
        let start = Instant::now();
        let sample = |collisions| Sample { time: 1.5, collisions, temperature: 0.25, ..Sample::default() };
        let first = watch.line_at(&sample(100), start, None).unwrap();
        let (heads, first) = first.split_once('\n').expect("heads above the first line");
        assert!(first.ends_with('–') && first.contains("1.500000") && first.contains("2.5"), "{first}");
        assert_eq!(watch.line_at(&sample(200), start + PAUSE / 2, None), None);
        let next = watch.line_at(&sample(1100), start + 2 * PAUSE, None).unwrap();
        assert!(next.ends_with("1.000e3"), "1000 collisions in a second: {next}");
        assert_eq!(heads.chars().count(), next.chars().count(), "{heads}\n{next}");
    }

    #[test]
    fn lines_are_no_wider_than_the_terminal() {
        // As wide as numbers get.
        let ledger = haff_engine::Ledger { residual: -1e-300, ..haff_engine::Ledger::default() };
        let sample = Sample {
            time: 1.0 / 3.0 * 1e300,
            collisions: u64::MAX,
            temperature: 1e-300,
            ledger,
            ..Sample::default()
        };
        let mut now = Instant::now();
        let mut watch = Watch::on(Term::stderr());
        for (width, heads) in [(12, 1), (38, 3), (40, 3), (54, 3), (55, 4), (69, 5), (80, 5)] {
            now += PAUSE;
            let changed = heads != watch.columns;
            let lines = watch.line_at(&sample, now, Some(width)).unwrap();
            assert_eq!(lines.lines().count(), 1 + usize::from(changed), "{lines}");
            assert!(lines.lines().all(|line| line.chars().count() <= width), "{width}:\n{lines}");
            assert_eq!(watch.columns, heads, "{width}");
        }
    }
}
