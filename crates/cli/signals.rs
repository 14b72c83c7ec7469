//! SIGINT and SIGTERM end the command at once before a run begins, and end a run cleanly; a second one ends
//! it at once. SIGXFSZ has no effect.

use std::sync::{
    Arc,
    atomic::{AtomicBool, AtomicUsize, Ordering},
};

use signal_hook::{
    consts::{SIGINT, SIGTERM, SIGXFSZ},
    flag,
};

use crate::failure::{Failure, Status};

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
        Ok(Self { received, at_once })
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
