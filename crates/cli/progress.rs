//! The progress bar: simulated time, collisions per second, time left. On a terminal only.

use std::{
    io::IsTerminal,
    time::{Duration, Instant},
};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

use crate::output;

/// Steps of the bar; its unit is a part of the whole run.
const STEPS: u64 = 10_000;

/// Shows how far a run has come.
pub struct Progress {
    bar: Option<ProgressBar>,
    started: Instant,
    collisions_before: u64,
}

impl Progress {
    /// A bar that starts at `collisions`, or none if it is not wanted or nobody looks.
    pub fn new(wanted: bool, collisions: u64) -> Self {
        let shown = wanted && std::io::stderr().is_terminal();
        let bar = shown.then(|| {
            let bar = ProgressBar::with_draw_target(Some(STEPS), ProgressDrawTarget::stderr_with_hz(10));
            let style = ProgressStyle::with_template("{bar:30} {percent:>3} %  {msg}  {eta} left");
            bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()).progress_chars("━╸─"));
            bar.enable_steady_tick(Duration::from_millis(200));
            bar
        });
        Self { bar, started: Instant::now(), collisions_before: collisions }
    }

    /// Shows the present: the part of the run that is done, the simulated time and the collisions so far.
    pub fn show(&self, part: f64, time: f64, collisions: u64) {
        if let Some(bar) = &self.bar {
            let rate =
                (collisions - self.collisions_before) as f64 / self.started.elapsed().as_secs_f64().max(1e-3);
            bar.set_position((part.clamp(0.0, 1.0) * STEPS as f64) as u64);
            bar.set_message(format!("t = {time:.4}  {collisions} collisions  {:.2} M/s", rate / 1e6));
        }
    }

    /// Tells a line, above the bar.
    pub fn line(&self, text: &str) {
        match &self.bar {
            Some(bar) => bar.println(text),
            None => output::tell(text),
        }
    }

    /// Removes the bar.
    pub fn finish(&self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }
}
