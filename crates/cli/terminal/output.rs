//! Output of the command: results on standard output, messages for users on standard error.
//!
//! External text (titles, names, keys, values, paths, errors of libraries) enters messages through [`shown`]
//! or [`path`], so that it stays on one line. Printing escapes control characters once more, except line
//! ends.
//!
//! `println!` panics on a closed pipe, as in `haff schema | head -1`; the functions here do not. A lint of
//! clippy forbids `println!` in the command.

use std::{
    fmt::Display,
    io::{self, ErrorKind, Write},
    path::Path,
    sync::atomic::{AtomicBool, Ordering},
};

use haff_scene::text::escaped_lines;
pub use haff_scene::text::shown;

use crate::terminal::failure::{Failure, Status};

/// Whether something has been written to standard output.
static WRITTEN: AtomicBool = AtomicBool::new(false);

/// Whether the command has begun to print its result.
pub fn has_begun() -> bool {
    WRITTEN.load(Ordering::Relaxed)
}

/// A path for messages.
pub fn path(path: &Path) -> String {
    shown(path.display())
}

/// Writes lines to standard output, with control characters escaped, and ends the last one.
pub fn lines(text: impl Display) -> Result<(), Failure> {
    line(escaped_lines(&text.to_string()))
}

/// Writes to standard output without escaping: JSON, scenes, completions. A closed pipe ends the command
/// without a message; any other error is reported.
pub fn print(text: impl Display) -> Result<(), Failure> {
    WRITTEN.store(true, Ordering::Relaxed);
    let mut output = io::stdout().lock();
    match output.write_all(text.to_string().as_bytes()).and_then(|()| output.flush()) {
        Err(error) if error.kind() == ErrorKind::BrokenPipe => Err(Failure::new(Status::Unread, "")),
        Err(error) => Err(Failure::new(Status::File, format!("standard output: {error}"))),
        Ok(()) => Ok(()),
    }
}

/// Writes a line to standard output; as [`print()`].
pub fn line(text: impl Display) -> Result<(), Failure> {
    print(format_args!("{text}\n"))
}

/// Writes a message of one or more lines to standard error. Errors are ignored: a closed standard error must
/// not stop a run.
pub fn message(text: impl Display) {
    let text = text.to_string();
    let _ = io::stderr().lock().write_all(format!("{}\n", escaped_lines(&text)).as_bytes());
}

/// Writes warnings to standard error, one on each line.
pub fn warnings(texts: &[String]) {
    for text in texts {
        message(format_args!("warning: {text}"));
    }
}

/// A size with a unit, for output to users.
pub fn bytes(size: u64) -> String {
    let units = ["B", "KiB", "MiB", "GiB", "TiB", "PiB"];
    let power = (size.max(1).ilog2() / 10).min(units.len() as u32 - 1);
    let value = size as f64 / 1024_f64.powi(power as i32);
    if power == 0 { format!("{size} B") } else { format!("{value:.1} {}", units[power as usize]) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_are_formatted_with_units() {
        assert_eq!((bytes(0), bytes(1023), bytes(1536)), ("0 B".into(), "1023 B".into(), "1.5 KiB".into()));
        assert_eq!(bytes(5 << 30), "5.0 GiB");
    }
}
