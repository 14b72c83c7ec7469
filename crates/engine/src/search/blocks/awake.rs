//! Threads of the pool that stay awake between the rounds of steps.
//!
//! A round takes less than a millisecond. To wake a thread that sleeps takes tens of microseconds.

use std::{
    cell::Cell,
    sync::atomic::{AtomicBool, AtomicUsize, Ordering},
    thread::available_parallelism,
};

use rayon::Yield;

use crate::search::sharing::threads;

/// A thread that finds no work this many times in a row lets other processes use its processor.
const PATIENCE: u32 = 2000;

thread_local! {
    /// Whether this thread is in a call of [`with_awake_threads`], or stays awake for one.
    static IS_AWAKE: Cell<bool> = const { Cell::new(false) };
}

/// Ends a call at the end of a scope, also after a panic.
struct Done<'a>(&'a AtomicBool);

impl Drop for Done<'_> {
    fn drop(&mut self) {
        IS_AWAKE.set(false);
        self.0.store(true, Ordering::Release);
    }
}

/// Calls `work`. Until it returns, other threads of the pool look for work without sleeping: as many as there
/// are processors.
pub(crate) fn with_awake_threads<R>(work: impl FnOnce() -> R) -> R {
    let processors = available_parallelism().map_or(1, usize::from);
    let helpers = threads().min(processors).saturating_sub(1);
    if helpers == 0 || IS_AWAKE.get() {
        return work();
    }
    let (done, count) = (AtomicBool::new(false), AtomicUsize::new(0));
    rayon::in_place_scope(|scope| {
        let (done, count) = (&done, &count);
        scope.spawn_broadcast(move |_, _| {
            // Neither the thread that works, nor one that helps already.
            if IS_AWAKE.get() || count.fetch_add(1, Ordering::Relaxed) >= helpers {
                return;
            }
            IS_AWAKE.set(true);
            let mut idle = 0;
            while !done.load(Ordering::Acquire) {
                idle = if rayon::yield_now() == Some(Yield::Executed) { 0 } else { idle + 1 };
                if idle < PATIENCE {
                    std::hint::spin_loop();
                } else {
                    std::thread::yield_now();
                }
            }
            IS_AWAKE.set(false);
        });
        IS_AWAKE.set(true);
        let _done = Done(done);
        work()
    })
}
