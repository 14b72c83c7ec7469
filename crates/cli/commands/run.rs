//! `haff run`.

use crate::{
    arguments::Run,
    running::{
        continued,
        controls::Controls,
        single::{self, Finished},
        starting::Starting,
        warnings::warnings,
    },
    terminal::{
        failure::{Failure, Status, scene_failure},
        output, overwrite,
        progress::Progress,
        signals::Signals,
        words::say,
    },
};

/// Runs a scene, or resumes a run. `logs`: log messages go to standard error, so no progress bar is drawn
/// there.
pub fn run(options: &Run, logs: bool) -> Result<u8, Failure> {
    set_threads(options.threads)?;
    let signals = Signals::watch()?;
    let progress = Progress::on_terminal(options.quiet || logs);
    let controls = Controls { signals: &signals, progress, watch: options.watch };
    let finished = match (&options.resume, &options.scene) {
        (Some(file), _) => match &options.output {
            Some(new) => continued::start(file, new, options, controls)?,
            None if !options.set.is_empty() => {
                let message = say(
                    "--set with --resume changes the run: name a new file for it (-o)",
                    "another value in haff.resume changes the run: name a new file for it (file=…)",
                );
                return Err(Failure::new(Status::Invalid, message));
            }
            None if options.overwrite => {
                let message = say(
                    "--overwrite with --resume: name the file that may be replaced (-o)",
                    "overwrite=True in haff.resume: name the file that may be replaced (file=…)",
                );
                return Err(Failure::new(Status::Invalid, message));
            }
            None => single::resume(file.clone(), controls)?,
        },
        (None, Some(scene)) => {
            let file = scene;
            let starting =
                Starting::new(Progress::on_terminal(options.quiet || logs), options.output.clone());
            let loaded = haff_scene::load(file, &options.set, &starting);
            starting.finish();
            let mut scene = loaded.map_err(|errors| {
                starting.remove_kept();
                scene_failure(&errors)
            })?;
            if let Some(output) = &options.output {
                scene.output.file = Some(output.clone());
            }
            if let Some(output) = &scene.output.file {
                let state = scene.state_file.as_deref();
                let inputs =
                    [("the scene", Some(file.as_path())), ("the state that the scene starts from", state)];
                overwrite::check(output, &inputs, options.overwrite)?;
                // Before the checkpoints of a growth are removed.
                overwrite::check_free(output, options.overwrite)?;
            }
            if !options.quiet {
                output::warnings(&warnings(&scene));
            }
            starting.remove_kept();
            single::start(scene, options.overwrite, controls)?
        }
        (None, None) => return Err(Failure::new(Status::Invalid, "a scene file is needed")),
    };
    tell(&finished, options.json, options.quiet)
}

/// Prints a run that has ended, and returns its exit status.
pub fn tell(finished: &Finished, json: bool, quiet: bool) -> Result<u8, Failure> {
    // A failure of the run takes precedence over one of printing its report.
    let printed = if json { output::line(&finished.report) } else { Ok(()) };
    if !quiet {
        finished.print_summary();
    }
    match finished.status()? {
        0 => printed.map(|()| 0),
        status => Ok(status),
    }
}

/// Sets the number of threads of rayon's global pool.
pub fn set_threads(threads: Option<u16>) -> Result<(), Failure> {
    // This thread, which runs the events, is part of the pool: it takes its share of the work instead of
    // waiting for two other threads to be scheduled while the writer may occupy a core.
    let mut pool = rayon::ThreadPoolBuilder::new().use_current_thread();
    if let Some(threads) = threads {
        pool = pool.num_threads(threads.into());
    }
    pool.build_global()
        .map_err(|error| Failure::new(Status::Invalid, format!("{}: {error}", say("--threads", "threads"))))
}
