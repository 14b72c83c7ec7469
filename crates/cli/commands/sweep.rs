//! `haff sweep`: one file for each combination of values and seeds, as many at a time as there are cores.
//!
//! Runs are independent and each has its own thread pool, so results depend neither on how many run at a time
//! nor on their order. Complete runs are kept, stopped ones continue from their checkpoints, and a run that
//! fails does not stop the others.

mod growth;
mod lock;
mod manifest;
mod member;
mod plan;
mod report;
mod row;
mod values;
mod view;

use std::{
    num::NonZero,
    path::{Path, PathBuf},
    sync::{
        Mutex, PoisonError,
        atomic::{AtomicUsize, Ordering},
    },
    thread,
    time::{Duration, Instant},
};

use lock::{Lock, Refused};
use manifest::Manifest;
use plan::{Member, Plan};
use row::{Row, State};
use serde_json::{Map, Value};
use view::View;

use crate::{
    arguments::Sweep,
    running::states::States,
    terminal::{
        failure::{Failure, Status, scene_failure},
        output,
        progress::Progress,
        signals::Signals,
        words::{output_option, say},
    },
};

/// Shortest time between two writings of the manifest.
const WRITE_EVERY: Duration = Duration::from_secs(1);
/// Largest fraction of the time spent on writing it.
const WRITE_SHARE: u32 = 20;

/// A complete run of a sweep.
pub struct CompleteRun {
    /// Its parameters without the seed.
    pub parameters: Map<String, Value>,
    /// Its file.
    pub file: PathBuf,
}

/// The complete runs of the sweep in a folder.
pub fn complete_runs(folder: &Path) -> Result<Vec<CompleteRun>, Failure> {
    let rows = manifest::rows_in(folder)?.into_iter().filter(|row| row.status == State::Complete);
    let run = |mut row: Row| {
        row.parameters.remove("seed");
        CompleteRun { parameters: row.parameters, file: folder.join(row.file) }
    };
    Ok(rows.map(run).collect())
}

/// Runs a sweep, or one member of it, or lists its members.
pub fn sweep(options: &Sweep) -> Result<u8, Failure> {
    let plan = Plan::new(options)?;
    if let Some(index) = options.index
        && index >= plan.len()
    {
        return Err(Failure::new(
            Status::Invalid,
            format!("{} {index}: the sweep has {} runs, counted from 0", say("--index", "run"), plan.len()),
        ));
    }
    check(&plan)?;
    let folder = options.output.as_deref();
    // Without a folder no member has a file.
    let mut manifest = Manifest::of_folder(folder.unwrap_or(Path::new("")), &plan)?;
    if options.list {
        return list(options, &mut manifest, folder);
    }
    let Some(folder) = folder else {
        let option = say("-o DIR", "output=…");
        return Err(Failure::new(Status::Invalid, format!("a folder for the runs is needed: {option}")));
    };
    let signals = Signals::watch()?;
    // Members are generated while others run.
    signals.begin();
    manifest.begin()?;
    if let Some(index) = options.index {
        // Members of a job array that start at the same time all write the same.
        manifest.grow()?;
        return one(options, &plan, &manifest, index, &signals);
    }
    let _lock = Lock::of_sweep(folder).map_err(|refused| locked(folder, &refused))?;
    // Read again: another sweep may have written it before this one took the lock.
    let manifest = Manifest::of_folder(folder, &plan)?;
    manifest.grow()?;
    all(options, &plan, folder, manifest, &signals)
}

/// The error of a folder whose lock was not taken.
fn locked(folder: &Path, refused: &Refused) -> Failure {
    let folder = folder.display();
    match refused {
        Refused::Held(holder) => Failure::new(
            Status::File,
            format!(
                "{folder}: {holder} runs a sweep in this folder: wait for its end, or take another folder {}",
                output_option("output")
            ),
        ),
        Refused::Failed(error) => Failure::new(Status::File, format!("{folder}: cannot write: {error}")),
    }
}

/// Refuses a sweep with values that give no valid scene, such as those of a key that does not exist.
fn check(plan: &Plan) -> Result<(), Failure> {
    let name = plan.scene.display().to_string();
    let mut first = None;
    for index in plan.corners() {
        match haff_scene::parse(&name, &plan.text, &plan.member(index).overrides(), &States) {
            Ok(_) => return Ok(()),
            Err(errors) => {
                first.get_or_insert_with(|| scene_failure(&errors));
            }
        }
    }
    first.map_or(Ok(()), Err)
}

/// Lists the members and their states; an existing manifest is updated.
fn list(options: &Sweep, manifest: &mut Manifest, folder: Option<&Path>) -> Result<u8, Failure> {
    if let Some(folder) = folder {
        for index in 0..manifest.rows().len() {
            let row = manifest.row_mut(index);
            if !member::is_settled(folder, row) {
                member::update_from_file(folder, row);
            }
        }
        // A running sweep writes its own manifest.
        let lock =
            if manifest.exists() && !manifest.is_grown() { Some(Lock::of_sweep(folder)) } else { None };
        if lock.as_ref().is_some_and(|lock| !matches!(lock, Err(Refused::Held(_)))) {
            manifest.write()?;
        }
    }
    let rows: Vec<&Row> = match options.index {
        Some(index) => vec![&manifest.rows()[index]],
        None => manifest.rows().iter().collect(),
    };
    if options.json {
        output::line(report::summary(&rows, folder))?;
    } else {
        output::lines(report::table(&rows).trim_end())?;
    }
    Ok(0)
}

/// Runs one member, for job arrays, without updating the manifest, which other processes may be writing.
fn one(
    options: &Sweep,
    plan: &Plan,
    manifest: &Manifest,
    index: usize,
    signals: &Signals,
) -> Result<u8, Failure> {
    let threads = options.threads.map_or_else(cores, usize::from);
    let progress = Progress::on_terminal(options.quiet);
    let (row, report) = pool(threads)?
        .install(|| member::run(manifest.folder(), plan, &manifest.member(plan, index), signals, progress));
    // A failure of the run takes precedence over one of printing its report.
    let printed = if options.json { output::line(report::member(&row, report.as_ref())) } else { Ok(()) };
    if !options.quiet {
        output::message(report::line(&row));
    }
    match (&row.error, row.exit) {
        (Some(error), exit) => Err(Failure::new(Status::of(exit), error)),
        (None, None | Some(0)) => printed.map(|()| 0),
        (None, Some(exit)) => Ok(exit),
    }
}

/// Runs all members that are not complete.
fn all(
    options: &Sweep,
    plan: &Plan,
    folder: &Path,
    manifest: Manifest,
    signals: &Signals,
) -> Result<u8, Failure> {
    let todo: Vec<usize> =
        manifest.rows().iter().filter(|row| !member::is_settled(folder, row)).map(|row| row.index).collect();
    // A killed sweep leaves lock files, also of members that this one may not reach.
    for &index in &todo {
        Lock::remove_left(folder, &manifest.rows()[index].file);
    }
    let (jobs, threads) = share(options, todo.len());
    let todo: Vec<(usize, String)> =
        todo.into_iter().map(|index| (index, manifest.rows()[index].file.clone())).collect();
    let view = View::new(options.quiet, plan.len(), plan.len() - todo.len());
    let next = AtomicUsize::new(0);
    let book = Mutex::new(Book::new(manifest));
    let work = || -> Result<(), Failure> {
        let pool = pool(threads)?;
        while signals.received().is_none()
            && let Some((index, file)) = todo.get(next.fetch_add(1, Ordering::Relaxed))
        {
            let member = Member { file: file.clone(), ..plan.member(*index) };
            let progress = view.line(&plan.label(&member));
            let (row, _) = pool.install(|| member::run(folder, plan, &member, signals, progress));
            view.done(&row);
            book.lock().unwrap_or_else(PoisonError::into_inner).enter(row);
        }
        Ok(())
    };
    thread::scope(|scope| {
        let workers: Vec<_> = (0..jobs).map(|_| scope.spawn(work)).collect();
        // A panic is passed on; the other workers have ended by then.
        workers
            .into_iter()
            .try_for_each(|worker| worker.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic)))
    })?;
    view.finish();
    let manifest = book.into_inner().unwrap_or_else(PoisonError::into_inner).manifest;
    let written = manifest.write();
    let rows: Vec<&Row> = manifest.rows().iter().collect();
    let printed = if options.json { output::line(report::summary(&rows, Some(folder))) } else { Ok(()) };
    if !options.quiet {
        report::print_end(&rows, todo.len(), written.is_ok().then_some(folder));
    }
    if let Some(signal) = signals.received() {
        return written.map(|()| 128 + signal as u8);
    }
    for row in rows.iter().filter(|row| row.error.is_some()) {
        for line in report::line(row).lines() {
            output::message(format_args!("error: {line}"));
        }
    }
    written?;
    match rows.iter().filter_map(|row| row.exit).max() {
        None | Some(0) => printed.map(|()| 0),
        Some(worst) => Ok(worst),
    }
}

/// The manifest while runs end.
struct Book {
    manifest: Manifest,
    written: Instant,
    pause: Duration,
}

impl Book {
    fn new(manifest: Manifest) -> Self {
        Self { manifest, written: Instant::now(), pause: WRITE_EVERY }
    }

    /// Enters a row, and writes the manifest unless it was written just before. A failed write is retried
    /// later: the files of the runs are authoritative.
    fn enter(&mut self, row: Row) {
        let index = row.index;
        *self.manifest.row_mut(index) = row;
        if self.written.elapsed() >= self.pause {
            let started = Instant::now();
            if let Err(failure) = self.manifest.write() {
                tracing::warn!("{}", failure.message);
            }
            self.written = Instant::now();
            self.pause = WRITE_EVERY.max(WRITE_SHARE * started.elapsed());
        }
    }
}

/// Number of runs at a time and threads of each, such that their product does not exceed the cores.
fn share(options: &Sweep, todo: usize) -> (usize, usize) {
    let cores = cores();
    let requested = options.jobs.map(|jobs| usize::from(jobs).min(cores));
    let threads = match (options.threads, requested) {
        (Some(threads), _) => usize::from(threads).min(cores),
        (None, Some(jobs)) => cores / jobs.min(todo.max(1)),
        (None, None) => cores / cores.min(todo.max(1)),
    };
    let jobs = requested.unwrap_or(cores).min(cores / threads).min(todo).max(1);
    if !options.quiet
        && usize::from(options.jobs.unwrap_or(1)) * usize::from(options.threads.unwrap_or(1)) > cores
    {
        output::message(format_args!(
            "there are {cores} cores; runs at a time: {jobs}, threads of each: {threads}"
        ));
    }
    (jobs, threads)
}

fn cores() -> usize {
    thread::available_parallelism().map_or(1, NonZero::get)
}

fn pool(threads: usize) -> Result<rayon::ThreadPool, Failure> {
    rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .build()
        .map_err(|error| Failure::new(Status::Invalid, format!("{}: {error}", say("--threads", "threads"))))
}
