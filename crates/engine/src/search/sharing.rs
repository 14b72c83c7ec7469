//! Threads that share the processors with other processes.
//!
//! In a step each thread waits for the slowest one. If another process takes one of the processors for a
//! while, all others wait, and two threads can be slower than one. The work of the run then goes back to one
//! thread, until the processors are free again. Threads never change a result, so that this may depend on
//! the clock.

use std::{
    cell::Cell,
    time::{Duration, Instant},
};

/// Rates are measured over this time at least.
const PERIOD: Duration = Duration::from_millis(100);
/// Threads that wait look for work without sleeping: on free processors the process uses this part of the
/// time of its threads, at least.
const FREE: f64 = 0.9;
/// Time until the other number of threads is tried again, at first and at most: it doubles with each trial
/// in vain.
const WAIT: [Duration; 2] = [Duration::from_secs(1), Duration::from_secs(16)];
/// Several threads are kept if they are faster than one by this factor.
const FASTER: f64 = 1.05;
/// All threads are tried again only where processors of the machine were idle for this part of the time of
/// one, if the system tells.
const IDLE: f64 = 0.5;
/// Largest number of calendar entries between two measurements.
const ENTRIES: u64 = 100_000;

thread_local! {
    /// Whether the present thread works alone.
    static IS_ALONE: Cell<bool> = const { Cell::new(false) };
}

/// Number of threads for which work is divided.
pub(crate) fn threads() -> usize {
    if IS_ALONE.get() { 1 } else { rayon::current_num_threads() }
}

/// Least number of items of a parallel loop that a thread takes: all, if it works alone.
pub(crate) fn least_items() -> usize {
    if IS_ALONE.get() { usize::MAX } else { 1 }
}

/// Runs both, on two threads unless the present one works alone.
pub(crate) fn join(a: impl FnOnce() + Send, b: impl FnOnce() + Send) {
    if IS_ALONE.get() {
        a();
        b();
    } else {
        rayon::join(a, b);
    }
}

/// What happened in some time.
#[derive(Debug, Clone, Copy, Default)]
struct Span {
    wall: Duration,
    /// Processor time of all threads of the process.
    processor: Duration,
    events: u64,
}

impl Span {
    fn rate(&self) -> f64 {
        self.events as f64 / self.wall.as_secs_f64()
    }

    fn add(&mut self, other: Self) {
        self.wall += other.wall;
        self.processor += other.processor;
        self.events += other.events;
    }
}

/// Which threads work, and what is being tried. Rates are events per second.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Mode {
    Together,
    /// One thread is tried; the rate of all was this.
    TryAlone(f64),
    Alone,
    /// All threads are tried; the rate of one was this.
    TryTogether(f64),
}

/// Decides whether a run uses all threads or one.
#[derive(Debug)]
pub(crate) struct Sharing {
    mode: Mode,
    /// The present period. The first one after a change is not counted: steps that have begun go on as
    /// before.
    span: Span,
    is_settled: bool,
    /// Time since the last trial, and until the next.
    since: Duration,
    wait: Duration,
    /// Time for which processors had been idle at the last trial.
    idle: Option<Duration>,
}

/// Ends the work of a thread alone at the end of a scope.
pub(crate) struct Scope;

impl Drop for Scope {
    fn drop(&mut self) {
        IS_ALONE.set(false);
    }
}

/// The state of the clocks at the start of a part of a run.
pub(crate) struct Start(Option<(Instant, Duration)>);

impl Default for Sharing {
    fn default() -> Self {
        Self {
            mode: Mode::Together,
            span: Span::default(),
            is_settled: true,
            since: WAIT[0],
            wait: WAIT[0],
            idle: None,
        }
    }
}

impl Sharing {
    /// Whether one thread works, although there are others.
    pub fn is_alone(&self) -> bool {
        matches!(self.mode, Mode::Alone | Mode::TryAlone(_))
    }

    /// Until the end of the scope this thread works alone, if that has been decided.
    pub fn enter(&self) -> Scope {
        IS_ALONE.set(self.is_alone());
        Scope
    }

    /// Starts a part of a run. `is_shared`: all threads can take its events. Returns the largest number of
    /// entries of this part, too.
    pub fn start(&self, is_shared: bool) -> (Start, u64) {
        if rayon::current_num_threads() < 2 || !(is_shared || self.is_alone()) {
            return (Start(None), u64::MAX);
        }
        let Some(processor) = processor_time() else { return (Start(None), u64::MAX) };
        (Start(Some((Instant::now(), processor))), ENTRIES)
    }

    /// Ends a part of a run that has had this number of events. Returns whether all threads work again.
    pub fn end(&mut self, start: &Start, events: u64) -> bool {
        let (Some((begin, before)), Some(after)) = (start.0, processor_time()) else { return false };
        let was_alone = self.is_alone();
        self.record(
            Span { wall: begin.elapsed(), processor: after.saturating_sub(before), events },
            rayon::current_num_threads(),
            idle_time,
        );
        IS_ALONE.set(self.is_alone());
        was_alone && !self.is_alone()
    }

    /// Takes a measurement into account, and decides at the end of a period. `idle` tells how long processors
    /// of the machine have been idle so far.
    fn record(&mut self, span: Span, threads: usize, idle: impl Fn() -> Option<Duration>) {
        self.span.add(span);
        self.since += span.wall;
        if self.span.wall < PERIOD {
            return;
        }
        let span = std::mem::take(&mut self.span);
        if !std::mem::replace(&mut self.is_settled, true) {
            return;
        }
        let is_free = span.processor.as_secs_f64() >= FREE * threads as f64 * span.wall.as_secs_f64();
        let rate = span.rate();
        let is_due = self.since >= self.wait;
        let is_joined = self.mode == Mode::Alone && is_due && self.is_other_idle(idle());
        let mode = match self.mode {
            Mode::Together if !is_free && is_due => Mode::TryAlone(rate),
            Mode::TryAlone(together) if together < FASTER * rate => Mode::Alone,
            Mode::TryAlone(_) => Mode::Together,
            Mode::Alone if is_joined => Mode::TryTogether(rate),
            Mode::TryTogether(alone) if rate > FASTER * alone => Mode::Together,
            Mode::TryTogether(_) => Mode::Alone,
            kept @ (Mode::Together | Mode::Alone) => kept,
        };
        match (self.mode, mode) {
            // In vain: the next trial is later.
            (Mode::TryAlone(_), Mode::Together) | (Mode::TryTogether(_), Mode::Alone) => {
                (self.since, self.wait) = (Duration::ZERO, WAIT[1].min(2 * self.wait));
            }
            (Mode::TryAlone(_), Mode::Alone) | (Mode::TryTogether(_), Mode::Together) => {
                (self.since, self.wait) = (Duration::ZERO, WAIT[0]);
            }
            _ => {}
        }
        if mode == Mode::Alone && self.mode != mode {
            self.idle = idle();
        }
        let was_alone = self.is_alone();
        self.mode = mode;
        self.is_settled = was_alone == self.is_alone();
    }

    /// Whether another processor may have been idle since the last trial. If it was not, the next question is
    /// after the same time.
    fn is_other_idle(&mut self, now: Option<Duration>) -> bool {
        let was_busy = now.zip(self.idle).is_some_and(|(now, before)| {
            now.saturating_sub(before).as_secs_f64() < IDLE * self.since.as_secs_f64()
        });
        self.idle = now;
        if was_busy {
            self.since = Duration::ZERO;
        }
        !was_busy
    }
}

/// Processor time that all threads of the process have used; `None` if the system does not tell.
#[cfg(unix)]
fn processor_time() -> Option<Duration> {
    use nix::time::{ClockId, clock_gettime};
    clock_gettime(ClockId::CLOCK_PROCESS_CPUTIME_ID).ok().map(Duration::from)
}

#[cfg(not(unix))]
fn processor_time() -> Option<Duration> {
    None
}

/// Time for which the processors of the machine have been idle, their sum; `None` if the system does not
/// tell.
fn idle_time() -> Option<Duration> {
    // "cpu", then the times of users, of those with low priority, of the system, and of idling, in units of
    // 10 ms on every Linux.
    let text = std::fs::read_to_string("/proc/stat").ok()?;
    let idle: u64 = text.strip_prefix("cpu ")?.split_whitespace().nth(3)?.parse().ok()?;
    Some(Duration::from_millis(idle.saturating_mul(10)))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A machine: events per second of one thread and of two, and whether another process is busy.
    struct Machine {
        one: f64,
        two: f64,
        is_busy: bool,
    }

    /// Runs for some seconds; `tells`: the system tells when processors are idle. Returns the events.
    fn run(sharing: &mut Sharing, machine: &Machine, seconds: f64, tells: bool) -> f64 {
        let (part, mut events) = (0.02, 0.0);
        let idle = std::cell::Cell::new(sharing.idle.unwrap_or_default());
        for _ in 0..(seconds / part) as usize {
            let alone = sharing.is_alone();
            let done = part * if alone { machine.one } else { machine.two };
            let share = if alone {
                1.0
            } else if machine.is_busy {
                1.5
            } else {
                2.0
            };
            let span = Span {
                wall: Duration::from_secs_f64(part),
                processor: Duration::from_secs_f64(part * share),
                events: done as u64,
            };
            if alone && !machine.is_busy {
                idle.set(idle.get() + span.wall);
            }
            sharing.record(span, 2, || tells.then(|| idle.get()));
            events += done;
        }
        events
    }

    #[test]
    fn threads_that_wait_hand_the_work_back_and_take_it_again() {
        let free = Machine { one: 1e6, two: 1.6e6, is_busy: false };
        // Where the system does not tell whether processors are idle, all threads are tried in vain.
        for (tells, least) in [(false, 0.97), (true, 0.99)] {
            let mut sharing = Sharing::default();
            let events = run(&mut sharing, &free, 60.0, tells);
            assert!(events > 0.9999 * 1.6e6 * 60.0, "nothing is tried on a free machine");
            for slow in [0.58e6, 0.9e6, 1.0e6] {
                let busy = Machine { one: 1e6, two: slow, is_busy: true };
                let events = run(&mut sharing, &busy, 60.0, tells);
                assert!(
                    sharing.is_alone() && events > least * 1e6 * 60.0,
                    "{events} events, two threads: {slow}/s"
                );
                // As soon as the other process has ended, all threads work again.
                let events = run(&mut sharing, &free, 60.0, tells);
                assert!(!sharing.is_alone() && events > 0.85 * 1.6e6 * 60.0, "{events}");
            }
            // Where two threads are still faster, they stay.
            let busy = Machine { one: 1e6, two: 1.2e6, is_busy: true };
            let events = run(&mut sharing, &busy, 60.0, tells);
            assert!(!sharing.is_alone() && events > 0.97 * 1.2e6 * 60.0, "{events}");
        }
    }
}
