//! Progress of a sweep on a terminal: a bar for the whole, and a line for each run in progress.

use std::{io::IsTerminal, time::Duration};

use indicatif::{MultiProgress, ProgressBar};

use super::row::Row;
use crate::terminal::{
    progress::{Progress, style},
    screen,
};

/// The view; empty if standard error is not a terminal.
pub struct View(Option<(MultiProgress, ProgressBar)>);

impl View {
    /// A view of this many runs, some of them complete already.
    pub fn new(quiet: bool, runs: usize, complete: usize) -> Self {
        let shown = !quiet && std::io::stderr().is_terminal();
        Self(shown.then(|| {
            let lines = MultiProgress::with_draw_target(screen::bars());
            let whole = lines.add(ProgressBar::new(runs as u64).with_position(complete as u64));
            whole.set_style(style("{pos}/{len} runs  {elapsed} gone  {left}  {wide_bar}"));
            whole.reset_eta();
            whole.enable_steady_tick(Duration::from_millis(200));
            (lines, whole)
        }))
    }

    /// A line for a run that begins.
    pub fn line(&self, label: &str) -> Progress {
        Progress::line_of(self.0.as_ref().map(|(lines, _)| lines), label.to_owned())
    }

    /// A run has ended.
    pub fn done(&self, row: &Row) {
        if let Some((lines, whole)) = &self.0 {
            whole.inc(1);
            if row.error.is_some() {
                // The list of failures follows at the end; errors of the terminal are ignored.
                let _ = lines.println(format!("run {} failed", row.index));
            }
        }
    }

    /// Removes the view.
    pub fn finish(&self) {
        if let Some((_, whole)) = &self.0 {
            whole.finish_and_clear();
        }
    }
}
