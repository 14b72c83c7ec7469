//! SIGINT and SIGTERM end the command at once before a run begins, and end a run cleanly; a second one ends
//! it at once. SIGXFSZ has no effect.
//!
//! The end of the process that has started the command acts as SIGTERM, if that process asks for it
//! ([`end_with_this_process`]): a killed Python leaves no runs behind.

use std::{
    env, io,
    process::{Command, Stdio},
    sync::{
        Arc,
        atomic::{AtomicBool, AtomicUsize, Ordering},
    },
    thread,
};

use signal_hook::{
    consts::{SIGINT, SIGTERM, SIGXFSZ},
    flag, low_level,
};

use crate::terminal::failure::{Failure, Status};

/// If this variable is set, standard input is a pipe that only the starting process holds open: its end is
/// the end of that process, however it has ended. `python/haff/command/call.py` sets it, too.
const ENDS_WITH_STDIN: &str = "HAFF_ENDS_WITH_STDIN";

/// Has `command`, which is `haff`, end with this process: as long as this one lives and keeps the standard
/// input of the child.
pub fn end_with_this_process(command: &mut Command) -> &mut Command {
    command.env(ENDS_WITH_STDIN, "1").stdin(Stdio::piped())
}

/// Makes a write beyond the file-size limit fail with EFBIG. By default SIGXFSZ ends the process. A handler,
/// unlike an ignored signal, is not inherited by child processes.
pub fn handle_file_size_limit() {
    // Without the handler the signal ends the process.
    let _ = flag::register(SIGXFSZ, Arc::new(AtomicBool::new(false)));
}

/// Receives signals.
pub struct Signals {
    received: Arc<AtomicUsize>,
    /// Whether a signal ends the command at once.
    at_once: Arc<AtomicBool>,
}

impl Signals {
    /// Installs the handlers. A signal ends the command at once until a run [begins](Self::begin): packings
    /// of many particles take minutes.
    pub fn watch() -> Result<Self, Failure> {
        Self::register()
            .map_err(|error| Failure::new(Status::File, format!("cannot watch for signals: {error}")))
    }

    fn register() -> std::io::Result<Self> {
        let (received, at_once) = (Arc::new(AtomicUsize::new(0)), Arc::new(AtomicBool::new(true)));
        for signal in [SIGINT, SIGTERM] {
            // Handlers run in this order: the first signal of a run sets the flag after the shutdown handler
            // has read it.
            flag::register_conditional_shutdown(signal, 128 + signal, Arc::clone(&at_once))?;
            flag::register(signal, Arc::clone(&at_once))?;
            flag::register_usize(signal, Arc::clone(&received), signal as usize)?;
        }
        let signals = Self { received, at_once };
        if env::var_os(ENDS_WITH_STDIN).is_some() {
            signals.watch_standard_input()?;
        }
        Ok(signals)
    }

    /// Takes the end of standard input for SIGTERM. A signal that comes before or after it, such as that of a
    /// batch system to all processes of a job, still is the first one: the run ends cleanly.
    fn watch_standard_input(&self) -> io::Result<()> {
        let (received, at_once) = (Arc::clone(&self.received), Arc::clone(&self.at_once));
        let wait = move || {
            // An error, such as of a closed standard input, is its end, too.
            let _ = io::copy(&mut io::stdin().lock(), &mut io::sink());
            if received.compare_exchange(0, SIGTERM as usize, Ordering::Relaxed, Ordering::Relaxed).is_ok()
                && at_once.load(Ordering::Relaxed)
            {
                low_level::exit(128 + SIGTERM);
            }
        };
        thread::Builder::new().name("end of the caller".to_owned()).spawn(wait).map(drop)
    }

    /// From now on a signal ends the run cleanly.
    pub fn begin(&self) {
        if self.received().is_none() {
            self.at_once.store(false, Ordering::Relaxed);
        }
    }

    /// The signal received, if any.
    pub fn received(&self) -> Option<i32> {
        match self.received.load(Ordering::Relaxed) {
            0 => None,
            signal => Some(signal as i32),
        }
    }
}
