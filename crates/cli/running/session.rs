//! One run from its present state to its end: events in slices, records when they are due, and the reasons to
//! stop.

use std::time::{Duration, Instant};

use console::Term;
use haff_engine::{EngineError, Sample, Stop, Until, significant};
use haff_linkage::{AnySimulation, AnySimulationError, LinkageError};
use haff_record::{EventLog, RecordError, Recorder};
use haff_scene::{Due, Grown, GrowthEnd, OutputPlan, Records, RunPlan, Times, UntilOf};

use crate::{
    running::{compressing, controls::Controls},
    terminal::{progress::Progress, watch::Watch},
};

/// Largest number of calendar entries between two checks of signals, of the wall clock and of the progress
/// bar: a few tens of milliseconds in most scenes.
const SLICE: u64 = 1 << 15;
/// Slices that take longer than this are made shorter, so that signals are handled without delay in every
/// scene.
const SLICE_TIME: Duration = Duration::from_millis(100);
/// Longest wall time between checkpoints, whatever the scene's interval; for large systems this time per
/// particle, such that checkpoints write 1.3 MB/s.
pub const CHECKPOINT_EVERY: Duration = Duration::from_secs(3);
pub const CHECKPOINT_PARTICLE: Duration = Duration::from_micros(60);

/// Why a run ended.
#[derive(Debug, Clone, PartialEq)]
pub enum Ending {
    /// `run.until` is reached.
    Until,
    /// `run.collisions` is reached.
    Collisions,
    /// `growth.until_packing_fraction` is reached.
    PackingFraction,
    /// `growth.until_reduced_pressure` is reached.
    ReducedPressure,
    /// A growth has jammed before it has reached its packing fraction.
    Jammed(String),
    /// The box is as short or as full as it can be.
    Box,
    /// `run.wall_time` is used up.
    WallTime,
    /// A signal.
    Signal(i32),
    /// Nothing moves any more.
    Rest,
    /// The simulation cannot continue.
    Failed(AnySimulationError),
    /// The output file cannot be written any more.
    Unwritable(RecordError),
}

impl Ending {
    /// The word for `stopped`.
    pub fn word(&self) -> &'static str {
        match self {
            Self::Until | Self::Box => "until",
            Self::Collisions => "collisions",
            Self::PackingFraction => "packing_fraction",
            Self::ReducedPressure => "reduced_pressure",
            Self::Jammed(_) => "jammed",
            Self::WallTime => "wall_time",
            Self::Signal(_) => "signal",
            Self::Rest => "rest",
            Self::Failed(
                AnySimulationError::Granular(EngineError::Collapse { .. })
                | AnySimulationError::Linkage(LinkageError::Collapse { .. }),
            ) => "collapse",
            Self::Failed(
                AnySimulationError::Granular(EngineError::Overlap { .. })
                | AnySimulationError::Linkage(LinkageError::Overlap(_)),
            ) => "overlap",
            Self::Failed(_) => "error",
            Self::Unwritable(_) => "output",
        }
    }

    /// Whether a checkpoint of the present state can be resumed. After an overflow velocities are not finite.
    pub fn is_resumable(&self) -> bool {
        !matches!(
            self,
            Self::Failed(AnySimulationError::Granular(
                EngineError::Overflow { .. } | EngineError::Inconsistent { .. }
            ))
        )
    }

    /// Whether the run has reached the end given in its scene, so that nothing is left to resume.
    pub fn is_final(&self) -> bool {
        matches!(
            self,
            Self::Until
                | Self::Collisions
                | Self::PackingFraction
                | Self::ReducedPressure
                | Self::Jammed(_)
                | Self::Box
                | Self::Rest
        )
    }
}

impl From<UntilOf> for Ending {
    fn from(until: UntilOf) -> Self {
        match until {
            UntilOf::Run => Self::Until,
            UntilOf::PackingFraction => Self::PackingFraction,
            UntilOf::Box => Self::Box,
        }
    }
}

impl From<RecordError> for Ending {
    fn from(error: RecordError) -> Self {
        Self::Unwritable(error)
    }
}

/// Times of the last frame and of the last row of observables. None is written twice at one time: a run can
/// stop at a time at which one is due, or at which its clock no longer advances.
#[derive(Debug, Clone, Copy, Default)]
pub struct Recorded {
    pub frame: Option<f64>,
    pub sample: Option<f64>,
}

/// The inputs of a run.
pub struct Session<'a> {
    pub simulation: AnySimulation,
    pub run: RunPlan,
    pub output: &'a OutputPlan,
    pub recorder: Option<&'a Recorder>,
    pub controls: Controls<'a>,
    /// What has been recorded before.
    pub recorded: Recorded,
}

/// Shows a sample with `--watch`, unless the last one is too recent.
fn show(watch: &mut Option<Watch>, progress: &Progress, sample: &Sample) {
    if let Some(line) = watch.as_mut().and_then(|watch| watch.line(sample)) {
        progress.line(&line);
    }
}

/// Result of [`Session::run`].
pub struct Outcome {
    pub simulation: AnySimulation,
    pub ending: Ending,
    /// Wall time of the run itself [s].
    pub wall: Duration,
    /// What a box that becomes smaller is like, if it cannot go on.
    pub jammed: Option<String>,
}

impl Outcome {
    /// The text of an error that has ended the run, with what the box is like.
    pub fn told(&self, error: &str) -> String {
        self.jammed.as_ref().map_or_else(|| error.to_owned(), |jammed| format!("{jammed}: {error}"))
    }
}

impl Session<'_> {
    /// Runs to an end. `resumed`: the present state is in the file already.
    pub fn run(mut self, resumed: bool) -> Outcome {
        let started = Instant::now();
        let mut ending = self.events_and_records(resumed, started).unwrap_or_else(|ending| ending);
        if !matches!(ending, Ending::Unwritable(_)) {
            match self.last_records(&ending) {
                Ok(()) => {}
                // The reason that ended the run first is kept.
                Err(Ending::Failed(_)) if matches!(ending, Ending::Failed(_)) => {}
                Err(worse) => ending = worse,
            }
        }
        tracing::info!(ending = ending.word(), time = self.simulation.time(), "end of the run");
        let jammed = (ending.word() == "collapse").then(|| self.jammed()).flatten();
        Outcome { simulation: self.simulation, ending, wall: started.elapsed(), jammed }
    }

    /// Runs events, and writes the records when they are due. `Err` if a record ends the run.
    fn events_and_records(&mut self, resumed: bool, started: Instant) -> Result<Ending, Ending> {
        let from = self.simulation.time();
        let recording = self.recorder.is_some();
        let plan = |schedule, after| {
            Times::after(if recording { schedule } else { haff_scene::Schedule::Off }, after)
        };
        // A checkpoint may have the time of a record that was not yet written.
        let Recorded { frame, sample } = self.recorded;
        let samples = if self.controls.watch {
            Times::after(self.output.observables, from)
        } else {
            plan(self.output.observables, sample.unwrap_or(from))
        };
        let mut records = Records::new(plan(self.output.frames, frame.unwrap_or(from)), samples);
        let mut checkpoints =
            plan(self.output.checkpoint.map_or(haff_scene::Schedule::Off, haff_scene::Schedule::Every), from);
        let mut progress = self.controls.progress.clone();
        progress.begin(self.simulation.counters().collisions);
        let mut watch = self.controls.watch.then(|| Watch::on(Term::stderr()));
        if !resumed {
            self.record(true, true, &mut |sample| show(&mut watch, &progress, sample))?;
            self.checkpoint()?;
        }
        let until = self.run.until.unwrap_or(f64::INFINITY);
        let collisions = self.run.collisions.unwrap_or(u64::MAX);
        let interval = CHECKPOINT_EVERY.max(CHECKPOINT_PARTICLE * self.simulation.particles() as u32);
        let mut slice = SLICE;
        let mut saved = Instant::now();
        let mut log = EventLog::new(self.recorder, !self.output.events.is_empty());
        let ending = loop {
            let done = self.simulation.counters().collisions;
            let step = self.run.growth.map_or(u64::MAX, |growth| growth.next(done));
            let (time, count) = records.next(done);
            let target = Until {
                time: time.min(checkpoints.next()).min(until),
                collisions: collisions.min(step).min(count),
                entries: slice,
            };
            let began = Instant::now();
            let stop = self.simulation.advance(target, &mut log);
            // The length of a slice does not affect results: it only sets the points where the run may stop.
            slice = match began.elapsed() {
                long if long > SLICE_TIME => (slice / 4).max(1),
                short if short < SLICE_TIME / 4 => (2 * slice).min(SLICE),
                _ => slice,
            };
            log.check()?;
            match stop {
                Err(error) => break Ending::Failed(error),
                Ok(Stop::Rest) => break Ending::Rest,
                Ok(Stop::Collisions) if self.simulation.counters().collisions >= collisions => {
                    break Ending::Collisions;
                }
                Ok(Stop::Collisions) => {
                    let now = self.simulation.counters().collisions;
                    records.count(self.simulation.time(), done, now);
                    if now >= step {
                        let row = self.has_rows_of_growth();
                        self.record(false, row, &mut |sample| show(&mut watch, &progress, sample))?;
                        if let Some(ending) = self.grown() {
                            break ending;
                        }
                    }
                }
                Ok(Stop::Time) => {
                    let Due { frame, sample } = records.take(target.time);
                    let checkpoint = checkpoints.take(target.time);
                    if target.time >= until {
                        break self.run.until_of.into();
                    }
                    self.record(frame, frame || sample, &mut |sample| show(&mut watch, &progress, sample))?;
                    if checkpoint {
                        log.hand_over()?;
                        self.checkpoint()?;
                        saved = Instant::now();
                    }
                }
                Ok(Stop::Slice) => {}
            }
            if records.is_pending() {
                continue;
            }
            if let Some(signal) = self.controls.signals.received() {
                break Ending::Signal(signal);
            }
            if self.run.wall_time.is_some_and(|limit| started.elapsed() >= limit) {
                break Ending::WallTime;
            }
            // By wall time, since simulated time is no measure of the work lost by a kill.
            if saved.elapsed() >= interval {
                log.hand_over()?;
                self.checkpoint()?;
                saved = Instant::now();
            }
            let (time, done) = (self.simulation.time(), self.simulation.counters().collisions);
            progress.show((time / until).max(done as f64 / collisions as f64), time, done);
        };
        log.hand_over()?;
        progress.finish();
        Ok(ending)
    }

    /// Whether each step of a growth ends with a row of observables.
    fn has_rows_of_growth(&self) -> bool {
        self.run.growth.is_some_and(|growth| growth.has_rows())
    }

    /// How a growth or a compression ends after the present step, if it does.
    fn grown(&mut self) -> Option<Ending> {
        let growth = self.run.growth?;
        let last = compressing::take(&mut self.simulation)?;
        let Grown::Jammed = growth.grown(&last, self.simulation.counters().collisions)? else {
            return Some(Ending::ReducedPressure);
        };
        let below = match growth.end? {
            GrowthEnd::PackingFraction(wanted) => {
                format!("growth.until_packing_fraction = {wanted}: slower growth (growth.rate) jams later")
            }
            GrowthEnd::Compressed { until, packing_fraction } => format!(
                "the {} of the end at t = {}: slower compression jams later",
                significant(packing_fraction, 6),
                significant(until, 6)
            ),
            GrowthEnd::ReducedPressure(_) => return None,
        };
        Some(Ending::Jammed(format!("{}, below {below}", compressing::jammed(&last))))
    }

    /// What a box that becomes smaller is like now.
    fn jammed(&mut self) -> Option<String> {
        if !compressing::shrinks(&self.simulation) {
            return None;
        }
        if self.recorded.sample != Some(self.simulation.time()) {
            self.simulation.sample();
        }
        compressing::take(&mut self.simulation).map(|last| compressing::jammed(&last))
    }

    /// Records the end, and a checkpoint.
    fn last_records(&mut self, ending: &Ending) -> Result<(), Ending> {
        // A resumed run continues from before these last rows, which an uninterrupted run would not have
        // written.
        if !ending.is_final() && ending.is_resumable() {
            self.checkpoint()?;
        }
        self.record(true, true, &mut |_| {})?;
        if ending.is_final() {
            self.checkpoint()?;
        }
        Ok(())
    }

    /// Records a frame and a row of observables, unless there is one of this time, and measures the overlap
    /// of all close pairs with a frame. `show` is called with the row.
    fn record(&mut self, frame: bool, sample: bool, show: &mut dyn FnMut(&Sample)) -> Result<(), Ending> {
        let time = Some(self.simulation.time());
        let frame = frame && self.recorded.frame != time;
        let sample = sample && self.recorded.sample != time;
        if sample {
            self.recorded.sample = time;
        }
        if sample && (self.recorder.is_some() || self.controls.watch || self.has_rows_of_growth()) {
            let row = self.simulation.sample();
            show(&row);
            if let Some(recorder) = self.recorder {
                recorder.sample(row)?;
            }
        }
        if frame {
            self.recorded.frame = time;
            let overlap = self.simulation.measure_overlap();
            if let Some(recorder) = self.recorder
                && self.output.frames != haff_scene::Schedule::Off
            {
                recorder.frame_with(|| self.simulation.frame())?;
            }
            overlap.map_err(Ending::Failed)?;
        }
        Ok(())
    }

    fn checkpoint(&self) -> Result<(), RecordError> {
        let Some(recorder) = self.recorder else { return Ok(()) };
        recorder.correlations(self.simulation.correlations())?;
        recorder.checkpoint_with(|| self.simulation.checkpoint())
    }
}
