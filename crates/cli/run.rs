//! `haff run`.

use haff_engine::Fault;
use haff_linkage::AnySimulationError;
use haff_record::RecordError;
use haff_scene::{ErrorKind, SceneErrors};

use crate::{
    arguments::Run,
    failure::{Failure, Status},
    info::States,
    output::{self, shown},
    overwrite,
    progress::Progress,
    signals::Signals,
    single::{self, Controls},
};

/// A scene's errors as a failure of the command.
pub fn scene_failure(errors: &SceneErrors) -> Failure {
    let status = match errors.kind() {
        ErrorKind::Invalid => Status::Invalid,
        ErrorKind::Unreadable => Status::File,
    };
    Failure::new(status, errors)
}

/// A file's error as a failure of the command.
pub fn file_failure(error: &RecordError) -> Failure {
    Failure::new(Status::File, shown(error))
}

/// Runs a scene, or resumes a run. `logs`: log messages go to standard error, so no progress bar is drawn
/// there.
pub fn run(options: &Run, logs: bool) -> Result<u8, Failure> {
    set_threads(options.threads)?;
    let signals = Signals::watch()?;
    let progress = Progress::on_terminal(options.quiet || logs);
    let controls = Controls { signals: &signals, progress, watch: options.watch };
    let finished = match (&options.resume, &options.scene) {
        (Some(file), _) => single::resume(file.clone(), controls)?,
        (None, Some(scene)) => {
            let file = scene;
            let mut scene =
                haff_scene::load(file, &options.set, &States).map_err(|errors| scene_failure(&errors))?;
            if let Some(output) = &options.output {
                scene.output.file = Some(output.clone());
            }
            if let Some(output) = &scene.output.file {
                overwrite::check(output, file, scene.state_file.as_deref(), options.overwrite)?;
            }
            single::start(scene, options.overwrite, controls)?
        }
        (None, None) => return Err(Failure::new(Status::Invalid, "a scene file is needed")),
    };
    // A failure of the run takes precedence over one of printing its report.
    let printed = if options.json { output::line(&finished.report) } else { Ok(()) };
    if !options.quiet {
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
    pool.build_global().map_err(|error| Failure::new(Status::Invalid, format!("--threads: {error}")))
}

/// An error of a simulation as a failure of the command.
pub fn simulation_failure(error: &AnySimulationError) -> Failure {
    let status = match error.fault() {
        Fault::Invalid => Status::Invalid,
        Fault::Checkpoint => Status::File,
        Fault::Stopped => Status::Stopped,
    };
    Failure::new(status, shown(error))
}

/// Largest resident memory so far [bytes].
pub fn peak_memory() -> Option<u64> {
    // On Linux, getrusage includes the memory of the process before exec, such as that of a large parent.
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let peak = status.lines().find_map(|line| line.strip_prefix("VmHWM:")?.trim().strip_suffix(" kB"));
    if let Some(kibibytes) = peak.and_then(|peak| peak.trim().parse::<u64>().ok()) {
        return Some(kibibytes * 1024);
    }
    let usage = nix::sys::resource::getrusage(nix::sys::resource::UsageWho::RUSAGE_SELF).ok()?;
    // Linux counts in KiB, macOS in bytes.
    let unit = if cfg!(target_os = "macos") { 1 } else { 1024 };
    u64::try_from(usage.max_rss()).ok().map(|size| size * unit)
}
