//! The progress bar: simulated time, collisions per second, time left. On a terminal only.

use std::{
    fmt::Write,
    io::IsTerminal,
    time::{Duration, Instant},
};

use indicatif::{
    HumanDuration, MultiProgress, ProgressBar, ProgressDrawTarget, ProgressState, ProgressStyle,
};

use crate::terminal::{output, screen};

/// Steps of the bar, in fractions of the whole run.
const STEPS: u64 = 10_000;

/// Shows the progress of a run; a clone shows it on the same line.
#[derive(Clone)]
pub struct Progress {
    bar: Option<ProgressBar>,
    /// Name of the run in a view of several; `None` in a view of one run.
    name: Option<String>,
    started: Instant,
    collisions_before: u64,
}

impl Progress {
    /// A bar on standard error if that is a terminal, otherwise none.
    pub fn on_terminal(quiet: bool) -> Self {
        let shown = !quiet && std::io::stderr().is_terminal();
        let bar = shown.then(|| {
            // Hidden until the run begins, so that earlier errors are printed without a bar.
            let bar = ProgressBar::with_draw_target(Some(STEPS), ProgressDrawTarget::hidden());
            bar.set_style(style("{bar:16} {percent:>3} %  {left:>8}  {wide_msg}"));
            bar
        });
        Self::with(bar, None)
    }

    /// A line of a view of several runs, or none without a view.
    pub fn line_of(view: Option<&MultiProgress>, name: String) -> Self {
        let bar = view.map(|view| {
            let bar = view.add(ProgressBar::new(STEPS));
            bar.set_style(style("  {bar:16} {percent:>3} %  {wide_msg}"));
            bar.set_message(name.clone());
            bar
        });
        Self::with(bar, Some(name))
    }

    fn with(bar: Option<ProgressBar>, name: Option<String>) -> Self {
        Self { bar, name, started: Instant::now(), collisions_before: 0 }
    }

    /// The run begins, after this many collisions before a resumption.
    pub fn begin(&mut self, collisions: u64) {
        self.started = Instant::now();
        self.collisions_before = collisions;
        self.draw();
    }

    /// Draws the bar from now on.
    fn draw(&self) {
        if let (Some(bar), None) = (&self.bar, &self.name) {
            bar.set_draw_target(screen::bars());
            bar.enable_steady_tick(Duration::from_millis(200));
        }
    }

    /// Shows the completed fraction of some work before a run, and what it is.
    pub fn show_work(&self, work: &str, part: f64) {
        if let Some(bar) = &self.bar {
            if bar.is_hidden() {
                self.draw();
            }
            bar.set_position((part.clamp(0.0, 1.0) * STEPS as f64) as u64);
            bar.set_message(work.to_owned());
        }
    }

    /// Shows the completed fraction of the run, the simulated time and the collisions so far.
    pub fn show(&self, part: f64, time: f64, collisions: u64) {
        if let Some(bar) = &self.bar {
            let rate =
                (collisions - self.collisions_before) as f64 / self.started.elapsed().as_secs_f64().max(1e-3);
            bar.set_position((part.clamp(0.0, 1.0) * STEPS as f64) as u64);
            let speed = format!("{:.2} M/s", rate / 1e6);
            bar.set_message(match &self.name {
                Some(name) => format!("{name}  t = {time:.4}  {speed}"),
                None => format!("t = {time:.4}  {collisions} collisions  {speed}"),
            });
        }
    }

    /// Prints a line above the bar.
    pub fn line(&self, text: &str) {
        match &self.bar {
            Some(bar) => bar.println(text),
            None => output::message(text),
        }
    }

    /// Removes the bar.
    pub fn finish(&self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }
}

/// The style of a bar; `{left}` is the time left. One field should be `wide_`, so that text that does not fit
/// on a line of the terminal is cut.
pub fn style(template: &str) -> ProgressStyle {
    let style = ProgressStyle::with_template(template);
    style.unwrap_or_else(|_| ProgressStyle::default_bar()).progress_chars("━╸─").with_key(
        "left",
        |state: &ProgressState, out: &mut dyn Write| {
            // Unknown before the first progress. A failed write only omits the text.
            if !state.eta().is_zero() {
                let _ = write!(out, "{:#} left", HumanDuration(state.eta()));
            }
        },
    )
}
