//! A failed allocation ends the command with a message and exit status 3. Rust's default is to abort.
//!
//! The process exits at once, without unwinding. Output files are left as after a kill: readable up to the
//! last flush, and resumable.

use std::{
    alloc::{GlobalAlloc, Layout, System},
    fmt::{self, Write},
    io,
};

use nix::{libc, unistd};

use crate::terminal::{failure::Status, words::say};

/// The system's allocator, with a message when an allocation fails.
pub struct ReportingAllocator;

// SAFETY: every call is passed to the system's allocator with its arguments unchanged, and the result is
// returned unchanged. A null result ends the process.
//
// Not inlined: with inlined calls the compiler's layout of the event loops changes, by up to 0.2 % of
// instructions.
unsafe impl GlobalAlloc for ReportingAllocator {
    #[inline(never)]
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        // SAFETY: the requirements of `System` are those of this trait, which the caller satisfies.
        not_null(unsafe { System.alloc(layout) }, layout.size())
    }

    #[inline(never)]
    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        // SAFETY: as above.
        not_null(unsafe { System.alloc_zeroed(layout) }, layout.size())
    }

    #[inline(never)]
    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        // SAFETY: as above.
        not_null(unsafe { System.realloc(pointer, layout, size) }, size)
    }

    #[inline(never)]
    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: as above.
        unsafe { System.dealloc(pointer, layout) }
    }
}

/// Stack of the main thread that is taken at the start [bytes]: runs have used up to 0.4 MB.
const STACK: usize = 1 << 20;

/// Takes the stack that the main thread may need. It grows page by page, and where the address space is
/// limited and full by then, that is a segmentation fault, not a failed allocation.
#[inline(never)]
#[expect(clippy::large_stack_arrays, reason = "it is there to be large")]
pub fn take_stack() {
    std::hint::black_box(&mut [0_u8; STACK]);
}

#[inline]
fn not_null(pointer: *mut u8, size: usize) -> *mut u8 {
    if pointer.is_null() { report_and_exit(size) } else { pointer }
}

/// Writes a message and exits. Neither allocates nor locks.
#[cold]
#[inline(never)]
fn report_and_exit(size: usize) -> ! {
    let mut line = Line { text: [0; 320], length: 0 };
    let go_on = say("haff run --resume FILE", "haff.resume(file)");
    // A message that does not fit is cut off.
    let _ = writeln!(
        line,
        "error: out of memory: an allocation of {size} bytes failed\n\
         error: an output file is readable up to its last flush; continue from its last checkpoint with: \
         {go_on}"
    );
    let _ = unistd::write(io::stderr(), &line.text[..line.length]);
    // SAFETY: always sound. Exit handlers are skipped, because they may allocate.
    unsafe { libc::_exit(Status::Stopped as i32) }
}

/// A text of limited length on the stack.
struct Line {
    text: [u8; 320],
    length: usize,
}

impl Write for Line {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        let room = self.text.get_mut(self.length..self.length + text.len()).ok_or(fmt::Error)?;
        room.copy_from_slice(text.as_bytes());
        self.length += text.len();
        Ok(())
    }
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
