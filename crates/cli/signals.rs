//! SIGINT and SIGTERM end a run cleanly; a second one ends it at once. SIGXFSZ has no effect.

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

/// Watches for signals.
pub struct Signals(Arc<AtomicUsize>);

impl Signals {
    /// Starts watching.
    pub fn watch() -> Result<Self, Failure> {
        Self::register()
            .map_err(|error| Failure::new(Status::File, format!("cannot watch for signals: {error}")))
    }

    fn register() -> std::io::Result<Self> {
        let received = Arc::new(AtomicUsize::new(0));
        for signal in [SIGINT, SIGTERM] {
            // Armed by the first signal, the conditional shutdown lets the second one through. The order matters: the
            // shutdown is looked at first.
            let armed = Arc::new(AtomicBool::new(false));
            flag::register_conditional_shutdown(signal, 128 + signal, Arc::clone(&armed))?;
            flag::register(signal, armed)?;
            flag::register_usize(signal, Arc::clone(&received), signal as usize)?;
        }
        Ok(Self(received))
    }

    /// The signal received, if any.
    pub fn received(&self) -> Option<i32> {
        match self.0.load(Ordering::Relaxed) {
            0 => None,
            signal => Some(signal as i32),
        }
    }
}
