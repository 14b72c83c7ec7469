//! Threads that simulations share, or have of their own. A process made by fork has none of the threads of
//! the process that it is a copy of: work given to a pool from there would never be done, so that pools are
//! made anew in it.

use std::{
    process,
    sync::{Arc, OnceLock},
};

use parking_lot::Mutex;
use rayon::{ThreadPool, ThreadPoolBuilder};

/// The process that has loaded the module; only there has rayon's global pool its threads.
static HOME: OnceLock<u32> = OnceLock::new();
/// The pool that simulations of a forked process share instead, and the process.
static SHARED: Mutex<Option<(u32, Arc<ThreadPool>)>> = Mutex::new(None);

/// To be called when the module is loaded.
pub fn remember_process() {
    HOME.get_or_init(process::id);
}

/// Runs `work` with the threads that simulations share.
pub fn shared<R: Send>(work: impl FnOnce() -> R + Send) -> Result<R, String> {
    if HOME.get().is_none_or(|&home| home == process::id()) {
        return Ok(work());
    }
    let pool = {
        let mut shared = SHARED.lock();
        let known = shared.take().filter(|(owner, _)| *owner == process::id()).map(|(_, pool)| pool);
        let pool = known.map_or_else(|| build(0).map(Arc::new), Ok)?;
        *shared = Some((process::id(), Arc::clone(&pool)));
        pool
    };
    Ok(pool.install(work))
}

/// A pool of so many threads; 0: as many as there are processors.
fn build(threads: usize) -> Result<ThreadPool, String> {
    let pool = ThreadPoolBuilder::new().num_threads(threads).build();
    pool.map_err(|error| format!("threads = {threads}: {error}"))
}

/// The threads of a simulation.
#[derive(Default)]
pub struct Threads {
    /// `None`: those that simulations share.
    asked: Option<usize>,
    /// Those of its own, and the process that they belong to.
    own: Option<(u32, ThreadPool)>,
}

impl Threads {
    pub fn new(asked: Option<usize>) -> Self {
        Self { asked, own: None }
    }

    /// Runs `work` with these threads.
    pub fn run<R: Send>(&mut self, work: impl FnOnce() -> R + Send) -> Result<R, String> {
        let Some(asked) = self.asked else { return shared(work) };
        if let Some((owner, pool)) = self.own.take_if(|(owner, _)| *owner != process::id()) {
            forget(owner, pool);
        }
        if self.own.is_none() {
            self.own = Some((process::id(), build(asked)?));
        }
        let Some((_, pool)) = &self.own else { return shared(work) };
        Ok(pool.install(work))
    }
}

impl Drop for Threads {
    fn drop(&mut self) {
        if let Some((owner, pool)) = self.own.take() {
            forget(owner, pool);
        }
    }
}

/// Ends a pool; one of another process has no threads that could be told to end.
fn forget(owner: u32, pool: ThreadPool) {
    if owner == process::id() {
        drop(pool);
    } else {
        std::mem::forget(pool);
    }
}
